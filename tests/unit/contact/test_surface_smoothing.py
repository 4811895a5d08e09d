"""Surface smoothing: exact on circles, cylinders and spheres, no effect on flat sides; messages."""

import re

import numpy as np
import pytest
from models import elastic_model, last_step, made_of, supported, with_contact
from scipy.spatial.transform import Rotation

import fastcontact as fc
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.surface import surface
from fastcontact.contact.surface_smoothing import Smoothing, frames, smooth_side
from fastcontact.mesh import elements
from fastcontact.model.fingerprint import differing_parts, fingerprint

STEEL = fc.LinearElastic(E=210e3, nu=0.3)


def bent(element, divisions, radius, double, shift=0.0):
    """A box bent so that ZMAX lies on a cylinder about the y axis, or on a sphere."""
    mesh = fc.generate.box((1.0, 1.0, 0.3), divisions, element, (-0.5, -0.5, 0.0))
    x, y, z = mesh.points.T
    height = np.sqrt(radius**2 - (x + shift) ** 2 - (y**2 if double else 0.0))
    return mesh.replace(points=np.column_stack([x, y, height + z - 0.3]))


@pytest.mark.parametrize(("element", "tolerance"), [("quad4", 1e-3), ("tri3", 1e-3), ("quad8", 2e-3), ("tri6", 2e-3)])
def test_circles_are_met_from_both_sides_and_up_to_their_ends(element, tolerance):
    mesh = fc.generate.rings(element, divisions_inner=(1, 8), divisions_outer=(1, 8))
    for group, sign in (("CONT_INNER", 1.0), ("CONT_OUTER", -1.0)):
        side = surface(mesh, group)
        smooth = smooth_side(side, mesh.points)
        xi = np.full((side.n_facets, 1), 0.4)
        place = elements.get(side.only_block.element).shape(xi[:1])[0] @ mesh.points[side.only_block.facets]
        exact = 50.0 - np.linalg.norm(place, axis=1)
        assert smooth.height(np.arange(side.n_facets), xi) == pytest.approx(sign * exact, rel=tolerance)
        assert smooth.curvature.ravel() == pytest.approx(sign / 50.0, rel=2e-4)
        assert smooth.height(np.arange(side.n_facets), np.ones_like(xi)) == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("double", [False, True], ids=["cylinder", "sphere"])
@pytest.mark.parametrize(("element", "divisions", "tolerance"), [
    ("hex8", (6, 5, 1), 1e-3), ("hex8", (6, 1, 1), 2e-3), ("tet4", (6, 5, 1), 1e-3),
    ("hex20", (5, 4, 1), 0.02), ("tet10", (5, 4, 1), 0.02),
])  # fmt: skip
def test_cylinders_and_spheres_are_met(element, divisions, tolerance, double):
    if double and divisions[1] == 1:
        pytest.skip("one facet across tells nothing of the curvature that way")
    mesh = bent(element, divisions, 2.0, double, shift=0.2)
    side = surface(mesh, "ZMAX")
    smooth, facets = smooth_side(side, mesh.points), np.arange(side.n_facets)
    xi = np.tile(elements.get(side.only_block.element).nodes[:3].mean(axis=0)[None] + [0.1, 0.05], (side.n_facets, 1))
    place = elements.get(side.only_block.element).shape(xi[:1])[0] @ mesh.points[side.only_block.facets]
    place += [0.2, 0.0, 0.0]
    exact = 2.0 - np.linalg.norm(place if double else place[:, [0, 2]], axis=1)
    assert np.abs(smooth.height(facets, xi) - exact).max() < tolerance * np.abs(exact).max()
    principal = np.sort(np.linalg.eigvalsh(smooth.curvature), axis=1)
    assert principal == pytest.approx(np.tile([0.5 if double else 0.0, 0.5], (len(facets), 1)), abs=1e-3)


@pytest.mark.parametrize("element", ["hex8", "tet4", "tet10"])
def test_what_a_strip_of_single_facets_leaves_open_does_not_depend_on_rounding(element):
    mesh = bent(element, (6, 1, 1), 2.0, double=True, shift=0.2)
    side = surface(mesh, "ZMAX")
    Q = Rotation.from_rotvec([0.3, -1.1, 0.7]).as_matrix()
    smooth, turned = smooth_side(side, mesh.points), smooth_side(side, mesh.points @ Q.T)
    assert np.abs(turned.heights - smooth.heights).max() < 1e-9 * np.abs(smooth.heights).max()
    assert np.abs(turned.curvature - smooth.curvature).max() < 1e-9 * np.abs(smooth.curvature).max()


def test_flats_stay_flat_beside_fillets_and_up_to_corners():
    flat = fc.generate.box(divisions=(3, 3, 1))
    assert smooth_side(surface(flat, "ZMAX"), flat.points) is None
    mesh = fc.generate.block((2.0, 0.2), (20, 1))
    x, y = mesh.points.T
    angle = np.maximum(x - 1.0, 0.0)  # flat up to x = 1, then round with radius 1
    points = np.column_stack([np.minimum(x, 1.0) + (1 + y) * np.sin(angle), (1 + y) * np.cos(angle)])
    side = surface(mesh, "TOP")
    smooth = smooth_side(side, points)
    middle = points[side.only_block.facets].mean(axis=1)
    height = smooth.height(np.arange(20), np.zeros((20, 1)))
    assert np.abs(height[middle[:, 0] < 1.0]).max() < 0.25 * 0.12**2 / 8
    assert height[middle[:, 0] > 1.2] == pytest.approx(1.2 * (1 - np.cos(0.05)), rel=1e-3)


def test_only_the_curvature_that_both_sides_share_counts():
    rings = fc.generate.rings("quad4", divisions_inner=(1, 24), divisions_outer=(1, 36))
    inner, outer = surface(rings, "CONT_INNER"), surface(rings, "CONT_OUTER")
    both = Smoothing.of(inner, outer, rings.points)
    axes = [frames(side, rings.points, rings.points) for side in (inner, outer)]
    assert both.height_factors(np.array([0, 2]), np.array([1, 7]), axes) == pytest.approx(np.ones((2, 2)), rel=1e-5)
    twice = Smoothing(both.secondary, smooth_side(outer, 2.0 * rings.points))
    assert twice.height_factors(np.array([3]), np.array([4]), axes) == pytest.approx(np.array([[0.5, 1.0]]), rel=1e-5)
    same = Smoothing(both.secondary, both.secondary)  # convex on convex
    assert same.height_factors(np.array([3]), np.array([4]), (axes[0], axes[0])) == pytest.approx(np.zeros((1, 2)))
    mesh = fc.generate.sphere_on_block()
    model = with_contact(made_of(mesh, "3d", STEEL), "ball", "CONT_SPHERE", "CONT_BLOCK")
    assert model.bind(model.contact[0]).smoothing is None


def fit(element="quad4", divisions=(24, 36), clearance=-0.05, **options):
    mesh = fc.generate.rings(element, divisions_inner=(6, divisions[0]), divisions_outer=(6, divisions[1]))
    model = made_of(mesh, "plane_strain", STEEL, SYMMETRY_X="x", SYMMETRY_Y="y")
    if clearance is not None:
        options["clearance"] = clearance
    return with_contact(model, "fit", "CONT_INNER", "CONT_OUTER", **options)


@pytest.mark.parametrize("options", [
    {}, {"multipliers": "standard"}, {"formulation": "continuous", "surface_smoothing": True},
    {"formulation": "node_to_segment", "surface_smoothing": True},
], ids=["dual", "standard", "continuous", "node_to_segment"])  # fmt: skip
def test_rings_touch_all_round_where_their_circles_do(options):
    """Two circles of one radius have no gap, whatever their facets."""
    model = fit(clearance=0.0, **options)
    pair, at = model.bind(model.contact[0]), Configuration.undeformed(model.mesh.points)
    sag = 50.0 * (1 - np.cos(np.pi / 96))
    assert np.abs(pair.unilateral(at).gaps(at.displacement)).max() < 2e-4 * sag
    assert np.abs(pair.nodal_gap(at)[0]).max() < 2e-4 * sag


def warned(model):
    """Solve a model; return the result of the fit and the warnings about the chords of its facets."""
    step, texts = last_step(model, about="deviate from their arcs")
    return step.contact["fit"], texts


@pytest.mark.parametrize(("options", "told"), [
    ({}, False), ({"surface_smoothing": False}, True), ({"formulation": "continuous"}, False),
    ({"formulation": "continuous", "surface_smoothing": False}, True),
    ({"formulation": "continuous", "surface_smoothing": False, "divisions": (24, 24)}, False),
    ({"clearance": -5.0, "formulation": "continuous", "surface_smoothing": False}, False),
])  # fmt: skip
def test_chords_that_push_sides_apart_are_told(options, told):
    texts = warned(fit(**options))[1]
    assert bool(texts) == told
    assert all("surface_smoothing=True" in text for text in texts)


@pytest.mark.parametrize(("divisions", "secondary", "formulation"), [
    ((80, 64), "CONT_INNER", "mortar"), ((80, 64), "CONT_OUTER", "mortar"), ((128, 192), "CONT_OUTER", "continuous"),
    ((128, 192), "CONT_INNER", "mortar"), ((80, 64), "CONT_OUTER", "node_to_segment"),
    ((47, 48), "CONT_INNER", "node_to_segment"),
])  # fmt: skip
def test_the_error_told_of_a_press_fit_is_right_within_a_factor_of_three(divisions, secondary, formulation):
    """Mean gaps hardly show the sags of facets of nearly equal lengths: they cancel over each facet."""
    inner, outer = divisions
    mesh = fc.generate.rings(
        "quad4", inner_radius=20.0, outer_radius=100.0, divisions_inner=(8, inner), divisions_outer=(8, outer)
    )
    model = made_of(mesh, "plane_strain", {"INNER": STEEL, "OUTER": fc.LinearElastic(E=70e3, nu=0.33)})
    supported(model, SYMMETRY_X="x", SYMMETRY_Y="y")
    primary = "CONT_OUTER" if secondary == "CONT_INNER" else "CONT_INNER"
    options = {} if formulation == "node_to_segment" else {"surface_smoothing": False}
    model.add_contact("fit", secondary=secondary, primary=primary, clearance=-0.05, formulation=formulation, **options)
    contact, texts = warned(model)
    error = np.abs(contact.pressure - 31.6319).max()  # Lame
    told = float(re.search(r"pressures by about ([\d.]+),", texts[0])[1])
    assert 1.0 / 3.0 < told / error < 3.0


def test_facets_of_nearly_equal_lengths_under_a_small_pressure_error_are_not_told():
    """A pin in a hole of nearly its radius: phases of facets drift slowly, which mean gaps hardly show."""
    contact, texts = warned(fit(divisions=(96, 97), clearance=-0.2, surface_smoothing=False))
    assert np.ptp(contact.pressure) < 0.05 * contact.pressure.mean()
    assert not texts


@pytest.mark.parametrize("formulation", ["continuous", "mortar"])
@pytest.mark.parametrize(("n", "told"), [(12, True), (24, True), (36, True), (48, False)])
def test_errors_of_chords_against_exact_shapes_are_told_from_one_twentieth_on(n, told, formulation):
    """The estimate is within 30 %, here of the difference from contact at the nodes, which lie on the circle."""
    contacts = []
    for kind in (formulation, "node_to_segment"):
        model = fit(divisions=(n, n), kind="tied", clearance=None)
        rod = fc.obstacles.Sphere(centre=(0.0, 0.0), R=20.05)
        model.add_obstacle("rod", secondary="BORE", obstacle=rod, formulation=kind)
        contacts.append(last_step(model)[0])
    texts = [[text for text in step.warnings if "deviate from their arcs" in text] for step in contacts]
    pressure, exact = (step.contact["rod"].pressure.mean() for step in contacts)
    assert len(texts[0]) == told == (pressure > 1.05 * exact)
    assert not texts[1]
    for text in texts[0]:
        assert "formulation 'node_to_segment'" in text
        estimate = float(re.search(r"pressures by about ([\d.]+),", text)[1])
        assert 1.0 / 1.3 < estimate / (pressure - exact) < 1.3


def test_steps_with_and_without_smoothing_are_of_different_cases():
    """A file that was begun without goes on without; where nothing is smoothed, the option makes no difference."""
    curved = [
        fingerprint(fit(**options)) for options in ({}, {"surface_smoothing": False}, {"surface_smoothing": True})
    ]
    assert differing_parts(curved[0], curved[1]) == ["surface_smoothing of contact 'fit'"]
    assert differing_parts(curved[0], curved[2]) == []


def test_steps_with_nodes_and_with_gauss_points_at_corners_are_of_different_cases():
    """A file of an earlier version, which had Gauss points everywhere, goes on with integration="gauss"."""

    def model(**options):
        model = elastic_model(fc.generate.block(), BOTTOM="xy")
        plane = fc.obstacles.HalfSpace((0.0, 1.0), (0.0, -1.0))
        model.add_obstacle("c", secondary="TOP", obstacle=plane, formulation="continuous", **options)
        return fingerprint(model)

    (part,) = differing_parts(model(), model(integration="gauss"))
    assert "'gauss') of contact 'c'" in part


def test_an_obstacle_has_no_facets_to_smooth():
    model = fit(kind="tied", clearance=None)
    plane = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0))
    with pytest.raises(fc.ContactError, match="omit it for an obstacle"):
        model.add_obstacle("rod", secondary="BORE", obstacle=plane, surface_smoothing=True)


@pytest.mark.parametrize("smooth", [False, True])
@pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")
def test_facets_that_interlock_where_nodes_coincide_are_told(smooth):
    """A shaft turns in a hub whose nodes coincide with its own: facets inclined like the teeth of a ratchet hold it."""
    mesh, axes = fc.generate.rings("quad4", divisions_inner=(2, 8), divisions_outer=(2, 8)), fc.CylindricalAxes()
    model = made_of(mesh, "plane_stress", STEEL)
    model.fix("BORE", "y", axes=axes)
    model.prescribe("RIM", y=0.1, axes=axes, ramp=[(0.0, 0.0), (1.0, 0.0), (2.0, 1.0)])
    model.add_cyclic_symmetry("SYMMETRY_X", "SYMMETRY_Y", sectors=4)
    model.add_contact(
        "fit", secondary="CONT_OUTER", primary="CONT_INNER", friction=0.15, clearance=-0.1,
        formulation="node_to_segment", surface_smoothing=smooth,
    )  # fmt: skip
    assert any("inclined to the smooth surface" in text for text in fc.solve(model, [1.0, 2.0])[-1].warnings) != smooth


def test_facets_that_deviate_from_a_rigid_shape_are_reported_after_unloading():
    """Where bodies yield, the errors of the step with the largest force remain."""
    strip = fc.generate.block((20.0, np.pi / 2), (3, 12), origin=(20.0, 0.0))
    radius, angle = strip.points.T
    ring = strip.replace(points=np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]))
    model = elastic_model(ring, BOTTOM="y", TOP="x")
    shaft = fc.obstacles.Sphere((0.0, 0.0), 20.0)
    ramp = [(0.0, 0.0), (1.0, 1.0), (2.0, -1.0)]
    model.add_obstacle("shaft", secondary="LEFT", obstacle=shaft, clearance=-0.08, clearance_ramp=ramp)
    with pytest.warns(fc.FastcontactWarning, match="in load step 1, .* facets of 'LEFT' .* deviate from their arcs"):
        fc.solve(model, [1.0, 2.0])
