"""Press fits by a negative clearance compared with Lame: only the discretisation error remains."""

import re

import numpy as np
import pytest
from models import elastic_model, last_step, made_of, supported, united, with_contact
from two_bodies import arcs, rings

import fastcontact as fc

pytestmark = pytest.mark.each_value

INTERFERENCE = 0.02
PLANES_3D = {"XMIN": "x", "XMAX": "y", "ZMIN": "z", "ZMAX": "z"}
SHAFT, HUB = fc.LinearElastic(E=1000.0, nu=0.3), fc.LinearElastic(E=500.0, nu=0.25)
LAME = fc.analytic.press_fit_cylinders(
    E_inner=1000.0, nu_inner=0.3, E_outer=500.0, nu_outer=0.25,
    inner_radius=1.0, interface_radius=2.0, outer_radius=3.0, interference=INTERFERENCE,
)  # fmt: skip


def quarter(element, shaft, hub, formulation, swap=False, overlap=0.0, **options):
    """A quarter of shaft and hub in plane strain, with so many facets on each; errors of pressure and displacement."""
    mesh = rings(element, inner=(1.0, 2.0 + overlap), divisions=((shaft, shaft // 3), (hub, hub // 3)))
    model = made_of(mesh, "plane_strain", {"SHAFT": SHAFT, "HUB": HUB}, XAXIS="y", YAXIS="x")
    sides = ("SHAFT_OUTER", "HUB_INNER") if swap else ("HUB_INNER", "SHAFT_OUTER")
    model.add_contact("fit", secondary=sides[0], primary=sides[1], formulation=formulation, **options)
    return model, fc.solve(model, fc.linear_ramp(1))[-1]


def errors(model, last):
    """Errors of the mean pressure at the interface and of the mean displacement of the rim."""
    contact = last.contact["fit"]
    rim = np.linalg.norm(last.displacement[model.mesh.points_of("HUB_OUTER")], axis=1).mean()
    return contact.pressure.mean() / LAME.pressure - 1, rim / float(LAME.outer.displacement(3.0)) - 1


def rate(sizes, found):
    return -np.polyfit(np.log(sizes), np.log(np.abs(found)), 1)[0]


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize(("formulation", "element", "normals", "expected", "finest"), [
    ("continuous", "quad4", "facet", 1.9, 3e-3), ("mortar", "quad8", "averaged", 3.5, 5e-6),
    ("continuous", "quad8", "averaged", 3.5, 5e-6), ("node_to_segment", "quad9", "averaged", 3.5, 5e-6),
])  # fmt: skip
def test_matching_meshes_leave_the_error_of_the_mesh(formulation, element, normals, expected, finest, swap):
    sizes = (3, 6, 9, 15)
    found = []
    for n in sizes:
        options = {"normals": normals, "surface_smoothing": False}  # facets coincide
        model, last = quarter(element, n, n, formulation, swap, clearance=-INTERFERENCE, **options)
        assert last.contact["fit"].active.all()
        found.append(errors(model, last)[1])
    assert rate(sizes, found) > expected
    assert abs(found[-1]) < finest


def test_meshes_that_do_not_match_converge_as_fast_with_mortar():
    """Arcs of second order differ by the fourth power of their length."""
    sizes = (6, 12, 18, 24)
    found = [
        errors(*quarter("quad8", n, 3 * n // 2, "mortar", clearance=-INTERFERENCE)) for n in sizes
    ]  # fmt: skip
    pressure, displacement = np.array(found).T
    assert rate(sizes, displacement) > 3.5
    assert abs(displacement[-1]) < 5e-5
    assert abs(pressure[-1]) < 1e-3


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("multipliers", ["dual", "standard"])
@pytest.mark.parametrize("kind", ["clearance", "clearance_primary"])
def test_pressures_of_clearances_are_those_of_overlapping_meshes(kind, multipliers, swap):
    """A clearance is measured along the normals of the surface, of which a node sees the components along its own."""
    _, last = quarter("quad8", 10, 16, "mortar", swap, multipliers=multipliers, **{kind: -INTERFERENCE})
    assert last.contact["fit"].pressure == pytest.approx(LAME.pressure, rel=5e-3)


def arc_in_space(name, radii, divisions):
    box = fc.generate.box((1.0, 1.0, 1.0), divisions, "hex20", name=name)
    angle, r = 0.5 * np.pi * box.points[:, 0], radii[0] + (radii[1] - radii[0]) * box.points[:, 1]
    points = np.column_stack([r * np.sin(angle), r * np.cos(angle), 0.5 * box.points[:, 2]])
    return fc.generate.renamed(box.replace(points=points), lambda group: group if group == name else f"{name}_{group}")


@pytest.mark.parametrize("multipliers", ["dual", "standard"])
def test_pressures_of_clearances_in_space_are_those_of_overlapping_meshes(multipliers):
    """Facets are projected along their own normals, to which the distance of the sides is inclined."""
    interference, pressures = 0.1 * INTERFERENCE, []
    for overlap in (0.0, interference):
        shaft, hub = arc_in_space("S", (1.0, 2.0 + overlap), (6, 3, 1)), arc_in_space("H", (2.0, 3.0), (8, 3, 1))
        model = made_of(fc.generate.union(shaft, hub), "3d", {"S": SHAFT, "H": HUB})
        supported(model, **{f"{body}_{side}": axis for body in "SH" for side, axis in PLANES_3D.items()})
        options = {"formulation": "mortar", "multipliers": multipliers, "clearance": overlap - interference}
        model.add_contact("fit", secondary="H_YMIN", primary="S_YMAX", **options)
        pressures.append(fc.solve(model, 1)[-1].contact["fit"].pressure)
    assert pressures[0].mean() == pytest.approx(0.1 * LAME.pressure, rel=5e-3)
    assert pressures[0] == pytest.approx(pressures[1], rel=1.5e-3)


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("smooth", [False, True])
def test_continuous_pressures_follow_the_circles(smooth, swap):
    """The parabolas of facets of unequal length deviate from each other, if not smoothed."""
    _, last = quarter("quad8", 10, 16, "continuous", swap, clearance=-0.001, surface_smoothing=smooth)
    exact = LAME.pressure * 0.001 / INTERFERENCE
    error = np.abs(last.contact["fit"].pressure / exact - 1).max()
    assert error < 0.05 if smooth else error > 0.09


@pytest.mark.parametrize("stiffness", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("around", [(24, 26), (26, 24)])
def test_the_error_told_of_integration_over_complete_facets_is_right(around, stiffness):
    """Blocks under a uniform pressure: its error does not depend on the size of the facets, but on the stiffer side."""
    lower, upper = (fc.generate.block((1.0, 0.5), (n, n // 2), "quad8", (0.0, y)) for n, y in zip(around, (-0.5, 0.0)))
    materials = {"L_BLOCK": fc.LinearElastic(1000.0, 0.3), "U_BLOCK": fc.LinearElastic(1000.0 * stiffness, 0.3)}
    told, errors_of = [], []
    for formulation in ("continuous", "mortar"):
        model = made_of(united(L_=lower, U_=upper), "plane_strain", materials, L_BOTTOM="y")
        supported(model, L_LEFT="x", L_RIGHT="x", U_LEFT="x", U_RIGHT="x")
        model.add_pressure("U_TOP", 10.0)
        model.add_contact("fit", secondary="U_BOTTOM", primary="L_TOP", formulation=formulation)
        step, texts = last_step(model, about="integration points of complete facets")
        told.append(float(re.search(r"by about ([\d.]+),", texts[0])[1]) if texts else 0.0)
        errors_of.append(np.abs(step.contact["fit"].pressure - 10.0).max())
    assert told[1] == 0.0
    assert errors_of[1] < 1e-8
    assert bool(told[0]) == (stiffness > 0.5) == (errors_of[0] > 0.5)
    assert not told[0] or 0.5 < errors_of[0] / told[0] < 1.6


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous", "mortar"])
def test_in_axisymmetry_the_interface_is_exact(formulation):
    """Two tubes held between plates: the straight interface leaves only the error of u = A r + B / r."""
    sizes = (2, 3, 4, 6)
    for element, expected, finest in (("quad4", 1.9, 3e-3), ("quad8", 3.7, 1e-5)):
        found = []
        for n in sizes:
            model = tubes(element, n, 2 if formulation == "mortar" else 3)
            with_contact(model, "fit", "HUB_LEFT", "SHAFT_RIGHT", formulation=formulation, clearance=-INTERFERENCE)
            contact = fc.solve(model, fc.linear_ramp(1))[-1].contact["fit"]
            assert np.ptp(contact.pressure) < 1e-9 * LAME.pressure
            found.append(contact.pressure.mean() / LAME.pressure - 1)
        assert rate(sizes, found) > expected
        assert abs(found[-1]) < finest


def tubes(element, n, along):
    """Shaft and hub as tubes of unit length; `along` divisions of the shaft, three of the hub."""
    shaft = fc.generate.block((1.0, 1.0), (n, along), element, (1.0, 0.0), name="SHAFT")
    hub = fc.generate.block((1.0, 1.0), (n, 3), element, (2.0, 0.0), name="HUB")
    model = made_of(united(SHAFT_=shaft, HUB_=hub), "axisymmetric", {"SHAFT": SHAFT, "HUB": HUB})
    for part in ("SHAFT", "HUB"):
        supported(model, **{f"{part}_TOP": "y", f"{part}_BOTTOM": "y"})
    return model


def test_an_interference_by_clearance_is_that_of_the_geometry_to_first_order():
    """A shaft made too large, and one that is told to be: they differ by the interference over the radius."""
    apart = []
    for scale in (1.0, 0.25):  # below, what the arcs of facets of unequal length leave of their sag, 2e-6, would show
        d = scale * INTERFERENCE
        told = errors(*quarter("quad8", 9, 9, "mortar", clearance=-d))[1]
        made = errors(*quarter("quad8", 9, 9, "mortar", overlap=d))[1]
        apart.append((1 + made) / (1 + told) - 1)
    assert abs(apart[0]) < INTERFERENCE / 2.0
    assert apart[0] / apart[1] == pytest.approx(4.0, rel=0.02)


@pytest.mark.parametrize("element", ["quad4", "quad8"])
def test_the_two_sides_may_be_swapped(element):
    one, other = (
        errors(*quarter(element, 8, 8, "mortar", swap, clearance=-INTERFERENCE, normals="averaged"))
        for swap in (False, True)
    )  # fmt: skip
    mesh_error = max(abs(one[1]), abs(other[1]))
    assert abs(one[1] - other[1]) < mesh_error


def test_curved_sides_need_averaged_normals():
    """Opposite a node the normal of either facet is off by half their angle: the pairing flips until edges are rounded."""
    with pytest.warns(fc.FastcontactWarning, match='normals="averaged" makes this unnecessary'):
        model, last = quarter("quad8", 8, 12, "node_to_segment", clearance=-INTERFERENCE, normals="facet")
    assert last.iterations["geometry_updates"] <= 20
    assert abs(errors(model, last)[1]) < 5e-4
    model, last = quarter("quad8", 8, 12, "node_to_segment", clearance=-INTERFERENCE, normals="averaged")
    assert last.iterations["geometry_updates"] <= 10
    assert abs(errors(model, last)[1]) < 5e-4


def test_nodes_opposite_nodes_settle_on_one_facet():
    """Exactly between two facets the first is taken, whatever the rounding, so that the pairing stands still."""
    model, last = quarter("quad4", 8, 8, "node_to_segment", clearance=-INTERFERENCE, normals="facet")
    assert last.iterations["geometry_updates"] <= 10
    assert abs(errors(model, last)[1]) < 5e-3


@pytest.mark.parametrize("multipliers", ["dual", "standard"])
@pytest.mark.parametrize("around", [(10, 10), (6, 10), (10, 4), (9, 12)])
@pytest.mark.parametrize("element", ["tri3", "quad4", "quad8"])
@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")
def test_fits_settle_with_the_hollow_side_secondary(element, around, multipliers, friction):
    """The sides overlap by the interference: opposite a hollow corner the closest facet leaps as the rings move."""
    mesh = fc.generate.rings(
        element, inner_radius=0.5, interface_radius=1.0, outer_radius=1.6, divisions_inner=(3, around[0]),
        divisions_outer=(3, around[1]),
    )  # fmt: skip
    model = elastic_model(mesh, "plane_stress", SYMMETRY_X="x", SYMMETRY_Y="y")
    with_contact(model, "fit", "CONT_OUTER", "CONT_INNER", clearance=-0.05, multipliers=multipliers, friction=friction)
    assert fc.solve(model, 1, criteria=fc.Criteria(max_halvings=0))[-1].iterations["geometry_updates"] <= 12


@pytest.mark.filterwarnings("ignore:.*across its radius", "ignore:.*nodal pressures oscillate")
@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize(("element", "pressures"), [("hex8", (0.80, 1.18)), ("tet4", (0.1, 1.9))])
def test_a_strip_one_facet_wide_is_smoothed_as_one_two_facets_wide(element, pressures, swap):
    """A slice of two rings: facets alone are open, the force on smooth surfaces is within 2 % of Lame's."""
    width, found = 0.2, []
    for across in (1, 2):
        mesh = arcs(element, [(4, facets, across) for facets in (5, 7)], np.pi / 3.0, height=width)
        model = made_of(mesh, "3d", SHAFT)
        for name in "AB":
            supported(model, **{f"{name}YMIN": "y", f"{name}YMAX": "normal", f"{name}ZMIN": "z", f"{name}ZMAX": "z"})
        sides = ("BXMIN", "AXMAX") if swap else ("AXMAX", "BXMIN")
        model.add_contact("fit", secondary=sides[0], primary=sides[1], clearance=-1e-3)
        found.append(fc.solve(model, 1)[-1].contact["fit"])
    lame = 1e-3 * 1000.0 / (1.0 - 0.3**2) / (2.0 * (13.0 / 5.0 + 5.0 / 3.0))
    for contact in found:
        assert contact.normal_force == pytest.approx(lame * 2.0 * np.pi / 3.0 * width, rel=0.02)
        assert pressures[0] * lame < contact.pressure.min() <= contact.pressure.max() < pressures[1] * lame
    if element == "hex8":
        ends = [np.ptp(contact.pressure) for contact in found]
        assert ends[0] == pytest.approx(ends[1], rel=1e-3)


@pytest.mark.filterwarnings("ignore:.*across its radius")
@pytest.mark.parametrize(("options", "element", "count", "most"), [
    ({}, "quad4", 12, 0.16), ({}, "quad8", 4, 0.051), ({"formulation": "continuous"}, "quad8", 4, 0.01),
])  # fmt: skip
def test_friction_between_planes_of_symmetry_has_no_shear(options, element, count, most):
    """Closing is no slip: normals lean at the ends, where facets end, and clearances close along them."""
    model = made_of(arcs(element, [(count, count)] * 2, np.pi / 4.0), "plane_strain", SHAFT)
    for name in "AB":
        supported(model, **{f"{name}BOTTOM": "y", f"{name}TOP": "normal"})
    sides = {"secondary": "ARIGHT", "primary": "BLEFT"}
    model.add_contact("fit", friction=0.3, clearance=-1e-3, **sides, **options)
    contact = fc.solve(model, 1)[-1].contact["fit"]
    assert np.linalg.norm(contact.shear, axis=1).max() < most * contact.pressure.mean()
