"""The reported pressure integrates to the contact force, in every formulation."""

import warnings

import numpy as np
import pytest
from models import elastic_model, supported, united, with_contact
from pairwise import first_of
from two_bodies import blocks, boxes, held, touching

import fastcontact as fc
from fastcontact.analysis import contact_result
from fastcontact.contact.integration import nodal_areas

pytestmark = pytest.mark.each_value

METHODS = {
    "node": {"formulation": "node_to_segment"},
    "node, averaged": {"formulation": "node_to_segment", "normals": "averaged"},
    "continuous": {"formulation": "continuous"},
    "continuous, simpson": {"formulation": "continuous", "integration": "simpson"},
    "continuous, node": {"formulation": "continuous", "integration": "node"},
    "mortar": {"formulation": "mortar"},
    "mortar, dual": {"formulation": "mortar", "multipliers": "dual"},
}
EVERY = pytest.mark.parametrize("method", METHODS)
# Fields are integrated by the rule of their points, which on curved facets differs a little from the one used here.
RULES = 5e-5


@pytest.fixture
def carried(monkeypatch):
    """What is known beside the result: by pair, normal forces of the constraints [force] and nodal areas [area]."""
    found, result = {}, contact_result.contact_result

    def watched(name, pair, part, solution, *more):
        forces = part.normal_forces(solution.multiplier)
        found[name] = forces, nodal_areas(pair.secondary, pair.points, pair.axisymmetric), pair.points
        return result(name, pair, part, solution, *more)

    monkeypatch.setattr(contact_result, "contact_result", watched)
    return found


def check(steps, carried, kinds=("unilateral",)):
    """The last step's pressures integrate to the forces, and lie on the active nodes alone."""
    for name, contact in steps[-1].contact.items():
        forces, areas, _ = carried[name]
        total = np.abs(forces).sum()
        assert (contact.pressure * areas).sum() == pytest.approx(forces.sum(), abs=RULES * total)
        assert not contact.pressure[~contact.active].any()
        if "unilateral" in kinds:
            assert (contact.pressure >= 0.0).all()
        assert np.isfinite(contact.pressure).all()
        assert total == 0.0 or contact.active.any()


def solved(model, steps=1):
    """Run a model that its method takes."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fc.FastcontactWarning)
        return fc.solve(model, fc.linear_ramp(steps))


def made(model, **options):
    """Add the pair, unless the method refuses these facets."""
    try:
        touching(model, **options)
    except fc.ContactError as error:
        if "no positive area" not in str(error) and "carry no pressure" not in str(error):
            raise
        pytest.skip("refused on these facets")
    return model


@EVERY
@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("kinematics", ["plane_strain", "axisymmetric"])
@pytest.mark.parametrize("element", ["tri3", "quad4", "tri6", "quad8"])
def test_a_bulging_block_in_the_plane(method, element, kinematics, swap, carried):
    """The lower side bulges: contact ends inside facets, and hollow sides lie on full ones."""
    mesh = blocks(element, lower=(9, 3), upper=(7, 3))
    points = mesh.points.copy()
    low = points[:, 1] < -1e-9
    on = np.setdiff1d(mesh.points_of("CONT_LOWER"), mesh.points_of("CONT_UPPER"))
    points[on, 1] -= 0.004 * points[on, 0] ** 2
    points[low, 1] -= 0.004 * points[low, 0] ** 2 * (1 + points[low, 1] / 5.0)
    model = held(mesh.replace(points=points), kinematics, approach=0.1)
    check(solved(made(model, swap=swap, **METHODS[method])), carried)


def bulging_boxes(element):
    """Two boxes, the lower side of the upper one bulging."""
    low = fc.generate.box((4.0, 4.0, 2.0), (5, 5, 2), element, (0.0, 0.0, -2.0))
    up = fc.generate.box((4.0, 4.0, 2.0), (4, 4, 2), element)
    points = up.points.copy()
    points[:, 2] += 0.02 * (points[:, :2] ** 2).sum(axis=1) * (1.0 - 0.5 * points[:, 2])
    return united(L_=low, U_=up.replace(points=points))


@EVERY
@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("element", ["hex8", "hex20", "hex27", "tet4", "tet10"])
def test_a_bulging_block_in_space(method, element, swap, carried):
    check(solved(made(held(bulging_boxes(element), "3d", 0.15), swap=swap, **METHODS[method])), carried)


@EVERY
@pytest.mark.parametrize("kind", ["bilateral", "tied"])
@pytest.mark.parametrize("space", ["plane", "space"])
def test_what_pulls_is_carried_too(method, kind, space, carried):
    mesh = boxes(lower=(4, 2, 2), upper=(3, 2, 2)) if space == "space" else blocks(lower=(5, 3), upper=(4, 3))
    model = held(mesh, "3d" if space == "space" else "plane_strain", approach=-0.02)
    steps = solved(made(model, kind=kind, **METHODS[method]))
    check(steps, carried, kinds=(kind,))
    assert steps[-1].contact["pair"].pressure.min() < 0.0


@EVERY
@pytest.mark.parametrize("kind", ["bilateral", "tied"])
@pytest.mark.parametrize("space", ["plane", "space"])
def test_nodes_beyond_the_other_side_carry_too(method, kind, space, carried):
    """All nodes of the one facet stand out beyond the other side, to which it is bound all the same."""
    flat = space == "plane"
    mesh = blocks(lower=(4, 2), upper=(1, 2)) if flat else boxes(lower=(3, 3, 2), upper=(1, 1, 1))
    upper, points = mesh.points_of("UPPER" if flat else "U_BOX"), mesh.points.copy()
    points[upper, :-1] = 5.0 + 1.2 * (points[upper, :-1] - 5.0)
    model = held(mesh.replace(points=points), "plane_strain" if flat else "3d", approach=0.02)
    steps = solved(made(model, kind=kind, **METHODS[method]))
    check(steps, carried, kinds=(kind,))
    assert method.startswith(("node", "continuous, node")) or steps[-1].contact["pair"].pressure_max > 0.0


@EVERY
@pytest.mark.parametrize("options", [{"friction": 0.3}, {"penalty": 500.0}, {"excluded": "OUT"}], ids=str)
@pytest.mark.parametrize("space", ["plane", "space"])
def test_options_change_nothing_about_it(method, options, space, carried):
    flat = space == "plane"
    mesh = blocks(lower=(6, 3), upper=(6, 3)) if flat else boxes(lower=(4, 2, 2), upper=(4, 2, 2))
    nodes = mesh.points_of("CONT_UPPER" if flat else "U_ZMIN")
    mesh = mesh.replace(point_groups={**mesh.point_groups, "OUT": nodes[mesh.points[nodes, 0] < 3.0]})
    model = held(mesh, "plane_strain" if flat else "3d")
    check(solved(made(model, **{"normals": "averaged", **METHODS[method], **options})), carried)


@EVERY
@pytest.mark.parametrize("element", ["tri3", "quad4", "tri6", "quad8"])
def test_the_training_case(method, element, carried, forma04):
    sizes = {"arc_sizes": (1.5, 6.0), "radial_sizes": (1.5, 8.0), "segments": 5} if "quad" in element else {"size": 5.0}
    if method == "node" and element in ("tri6", "quad8"):
        pytest.skip("normals that jump between quadratic facets do not settle")
    options = dict(METHODS[method])
    model = forma04(fc.generate.half_spheres(element, **sizes), options.pop("formulation"), **options)
    check(solved(model, 2), carried)


def pin_in_hole(secondary, primary, **options):
    """Half a pin in a hole wider by 0.05 of 10, loaded upwards."""
    quarter = fc.generate.rings(
        "quad4", inner_radius=2.0, interface_radius=10.0, outer_radius=60.0, divisions_inner=(6, 48),
        divisions_outer=(8, 50),
    )  # fmt: skip
    below = fc.generate.mirrored(quarter, "y", rename={"SYMMETRY_Y": "BY"})
    mesh = fc.generate.union(fc.generate.renamed(quarter, {"SYMMETRY_Y": "QY"}), below)
    points, pin = mesh.points.copy(), mesh.points_of("INNER")
    points[pin] *= 1 - 0.05 / 10.0
    mesh = fc.generate.merge_points(mesh.replace(points=points), 1e-9)
    points, pin = mesh.points.copy(), mesh.points_of("INNER")
    points[pin, 1] += 0.05
    model = elastic_model(mesh.replace(points=points), "plane_strain", E=210_000.0, SYMMETRY_X="x", RIM="y")
    model.add_traction("BORE", y=2000.0 / (4.0 * np.pi))
    return with_contact(model, "pair", secondary, primary, **options)


@EVERY
@pytest.mark.parametrize("sides", [("CONT_OUTER", "CONT_INNER"), ("CONT_INNER", "CONT_OUTER")], ids=["hole", "pin"])
def test_a_pin_in_a_hole_presses_where_it_touches(method, sides, carried):
    """Chords of the hole stand off the pin at its nodes, where nothing but the pressure tells that they touch."""
    steps = solved(pin_in_hole(*sides, **METHODS[method]))
    check(steps, carried)
    contact = steps[-1].contact["pair"]
    facet = 10.0 * 0.5 * np.pi / 48
    closed = np.abs(contact.place[contact.active])
    assert np.abs(contact.coordinates[contact.active, 0]).max() == pytest.approx(contact.radius[0], abs=facet)
    assert len(closed) == pytest.approx(closed.max() / facet, abs=3)
    order = np.argsort(np.arctan2(contact.coordinates[:, 0], contact.coordinates[:, 1] - 0.05))
    along = np.trapezoid(contact.pressure[order], contact.coordinates[order, 0])
    assert along == pytest.approx(np.abs(contact.force[1]), rel=0.02)


@pytest.mark.parametrize("multipliers", ["standard", "dual"])
@pytest.mark.parametrize("element", first_of(2, ["hex8", "hex20", "tet10"]))
def test_barely_covered_faces_have_no_wild_pressure(element, multipliers, carried):
    """A punch on a wider block: nothing physical depends on where its edge lies in the faces of the block."""
    largest = []
    for offset in (0.0, 0.09, 0.0999):
        low = fc.generate.box((2.0, 1.0, 1.0), (10, 2, 3), element, (0.0, 0.0, -1.0))
        up = fc.generate.box((1.0, 1.0, 1.0), (7, 3, 3), element, (0.5 + offset, 0.0, 0.0))
        model = elastic_model(united(L_=low, U_=up), "3d", nu=0.0)
        supported(model, L_YMIN="y", L_YMAX="y", U_YMIN="y", U_YMAX="y", L_ZMIN="xz", U_ZMAX={"x": 0.0, "z": -0.01})
        steps = solved(touching(model, "mortar", swap=True, multipliers=multipliers))
        check(steps, carried)
        largest.append(steps[-1].contact["pair"].pressure_max)
    assert np.ptp(largest) < 0.5 * np.mean(largest)
