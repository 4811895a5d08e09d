"""Bilateral contact, nodes that alternate between two facets, and nodes without contact or friction."""

import numpy as np
import pytest
from models import elastic_model, with_obstacle
from two_bodies import SIDES, blocks, boxes, each, held, touching

import fastcontact as fc

pytestmark = pytest.mark.each_value

FORMULATIONS = ("node_to_segment", "continuous", "mortar")
MODULUS = {"plane_strain": 1000.0 / 0.91, "axisymmetric": 1000.0, "3d": 1000.0}
# Pressed by the first step, pulled by the second.
PRESS_AND_PULL = fc.Ramp((1.0, 2.0), ((0.0, 0.0), (1.0, 1.0), (2.0, -1.0)))


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("kinematics", ["plane_strain", "axisymmetric", "3d"])
@pytest.mark.parametrize("kind", ["bilateral", "tied"])
@each
def test_a_uniform_tension_passes(formulation, options, kind, kinematics, swap):
    apart = formulation == "mortar"  # the only one that meshes which do not match pass exactly
    solids = boxes(upper=(3, 2, 2) if apart else (2, 3, 2)), blocks(upper=(4 if apart else 3, 2))
    mesh = solids[0] if kinematics == "3d" else solids[1]
    model = touching(held(mesh, kinematics, -0.02), formulation, swap, kind=kind, **options)
    last = fc.solve(model, fc.linear_ramp(1))[-1]
    axis, expected = (2 if kinematics == "3d" else 1), MODULUS[kinematics] * 0.002
    assert np.abs(last.stress[:, axis] - expected).max() < 1e-10 * expected
    assert last.contact["pair"].active.all()
    assert last.contact["pair"].pressure == pytest.approx(-expected, rel=1e-10)
    assert np.abs(last.contact["pair"].gap).max() < 1e-12


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_a_bilateral_pair_slides_without_resistance(formulation):
    model = elastic_model(blocks(upper=(4, 2)), "plane_strain", LOWER_BOTTOM="xy", UPPER_TOP={"x": 0.5, "y": 0.0})
    touching(model, formulation, kind="bilateral", projection_tolerance=0.5)
    last = fc.solve(model, fc.linear_ramp(1))[-1]
    assert np.abs(last.displacement[model.mesh.points_of("UPPER")] - [0.5, 0.0]).max() < 1e-12
    assert np.abs(last.stress).max() < 1e-9


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("make", [blocks, boxes])
@pytest.mark.filterwarnings("ignore:contact .* has opened again at the end")
def test_once_closed_means_closed_in_a_load_step_before(make, formulation, swap):
    mesh = make()
    kinematics = "3d" if mesh.dim == 3 else "plane_strain"
    axis, expected = mesh.dim - 1, MODULUS[kinematics] * 0.002
    pulled = {}
    for kind in ("unilateral", "bilateral_once_closed"):
        steps = fc.solve(touching(held(mesh, kinematics, 0.02), formulation, swap, kind=kind), PRESS_AND_PULL)
        assert np.abs(steps[0].stress[:, axis] + expected).max() < 1e-10 * expected
        pulled[kind] = steps[1]
    assert np.abs(pulled["unilateral"].stress).max() < 1e-10 * expected
    assert not pulled["unilateral"].contact["pair"].active.any()
    assert np.abs(pulled["bilateral_once_closed"].stress[:, axis] - expected).max() < 1e-10 * expected
    assert pulled["bilateral_once_closed"].contact["pair"].active.all()
    assert pulled["bilateral_once_closed"].contact["pair"].pressure == pytest.approx(-expected, rel=1e-10)


@pytest.mark.filterwarnings(
    "ignore:nodes alternated between two facets"
)  # opposite nodes, of which facets bend outwards
@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous", "mortar"])
def test_once_closed_leaves_the_rest_free(formulation, forma04):
    """Two half-spheres, pressed, then pulled: they hang on what had been closed, the rest opens wider."""
    model = forma04(fc.generate.half_spheres("tri3", size=5.0), formulation, kind="bilateral_once_closed")
    pressed, pulled = fc.solve(model, fc.Ramp((1.0, 2.0), ((0.0, 0.0), (1.0, 0.5), (2.0, -0.1))))
    before, after = pressed.contact["hertz"], pulled.contact["hertz"]
    assert before.force[1] * after.force[1] < 0
    assert 0 < after.active.sum() < len(after.active)
    near = after.coordinates[:, 0] < before.radius[0] - 2.0
    assert np.abs(after.gap[near]).max() < 0.02 * after.gap[np.isfinite(after.gap)].max()
    assert after.pressure[after.active].min() < 0
    assert not after.pressure[~after.active].any()


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
def test_an_obstacle_may_be_a_guide(formulation):
    model = elastic_model(fc.generate.block((10.0, 5.0), (4, 2), "quad4"), "plane_strain", LEFT="x", TOP={"y": 0.01})
    floor = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0))
    model.add_obstacle("floor", secondary="BOTTOM", obstacle=floor, formulation=formulation, kind="bilateral")
    last = fc.solve(model, fc.linear_ramp(1))[-1]
    assert np.abs(last.stress[:, 1] / (MODULUS["plane_strain"] * 0.002) - 1).max() < 1e-10
    assert last.contact["floor"].force[1] < 0


def test_a_body_may_hang_on_a_bilateral_pair():
    """Nothing but the contact holds the upper block up."""
    model = elastic_model(blocks(upper=(4, 3)), "plane_strain", LOWER_LEFT="x", UPPER_LEFT="x", LOWER_BOTTOM="y")
    model.add_traction("UPPER_TOP", y=2.0)
    touching(model, "mortar", kind="bilateral")
    last = fc.solve(model, fc.linear_ramp(2))[-1]
    assert np.abs(last.stress[:, 1] - 2.0).max() < 1e-9
    assert last.iterations["regularised"]["relative_to_load"] < 1e-9


@pytest.mark.parametrize("multipliers", ["standard", "dual"])
@pytest.mark.parametrize(
    "options", [{"kind": "tied"}, {"kind": "bilateral"}, {"kind": "bilateral_once_closed"}], ids=str
)
def test_multigrid_finds_the_same(options, multipliers):
    """Equations that always hold go through elimination or compliance like constraints that are closed."""
    model = held(boxes(upper=(3, 2, 2)), "3d", 0.02)
    touching(model, "mortar", multipliers=multipliers, **options)
    one, other = (fc.solve(model, PRESS_AND_PULL, linear_solver=name)[-1] for name in ("amg", "direct"))
    assert np.abs(one.displacement - other.displacement).max() < 1e-8 * np.abs(other.displacement).max()
    assert one.contact["pair"].pressure == pytest.approx(-2.0, rel=1e-7)


def with_group(mesh, side, mask):
    """The mesh with a group OUT of the nodes of a side that `mask` picks by their coordinates."""
    nodes = mesh.points_of(side)
    return mesh.replace(point_groups={**mesh.point_groups, "OUT": nodes[mask(mesh.points[nodes])]})


def left_half(points):
    return points[:, 0] < 4.0


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("space", ["plane", "space"])
def test_excluded_nodes_carry_nothing(formulation, space):
    mesh = (boxes(upper=(6, 2, 2)) if space == "space" else blocks(upper=(6, 3))) if formulation == "mortar" else (
        boxes(lower=(6, 2, 2), upper=(6, 2, 2)) if space == "space" else blocks(lower=(6, 3), upper=(6, 3))
    )  # fmt: skip
    mesh = with_group(mesh, SIDES[space][0], left_half)
    # The surfaces bend where contact ends; opposite a node, normals of facets would flip there for ever.
    model = held(mesh, "3d" if space == "space" else "plane_strain")
    touching(model, formulation, excluded="OUT", normals="averaged")
    contact = fc.solve(model, fc.linear_ramp(1))[-1].contact["pair"]
    out = np.isin(contact.points, mesh.points_of("OUT"))
    assert 0 < out.sum() < len(out)
    assert not contact.active[out].any()
    assert not contact.pressure[out].any()
    assert (contact.gap[out & (contact.coordinates[:, 0] < 2.0)] < 0).all()  # they sink in
    assert contact.active[~out].all()
    assert contact.pressure[~out].min() > 0
    # A facet of excluded nodes alone pushes none of its nodes.
    size = 10.0 / 6.0
    inner = contact.coordinates[:, 0] < 4.0 - 1.01 * size
    assert not contact.force_vectors[inner].any()
    normal = contact.force_vectors[:, -1]
    assert contact.force[-1] == pytest.approx(normal.sum(), rel=1e-12)
    if formulation == "node_to_segment":
        assert not contact.force_vectors[out].any()


@pytest.mark.parametrize("space", ["plane", "space"])
def test_an_excluded_node_is_the_same_to_dual_multipliers(space):
    """Where nodes lie opposite nodes, dual multipliers are the forces of node-to-segment; neighbours take nothing over."""
    mesh = boxes(lower=(6, 2, 2), upper=(6, 2, 2)) if space == "space" else blocks(lower=(6, 3), upper=(6, 3))
    mesh = with_group(mesh, SIDES[space][0], lambda x: np.abs(x[:, 0] - 5.0) > 4.9)
    kinematics, found = "3d" if space == "space" else "plane_strain", {}
    for formulation, options in (("node_to_segment", {}), ("mortar", {"multipliers": "dual"})):
        for excluded in ([], ["OUT"]):
            model = touching(held(mesh, kinematics), formulation, excluded=excluded, normals="averaged", **options)
            found[formulation, len(excluded)] = fc.solve(model, 1)[-1].contact["pair"]
    out = np.isin(found["mortar", 1].points, mesh.points_of("OUT"))
    assert not found["mortar", 1].force_vectors[out].any()
    lost = [found[name, 1].force[-1] / found[name, 0].force[-1] for name in ("node_to_segment", "mortar")]
    assert lost[1] == pytest.approx(lost[0], rel=1e-3)
    assert lost[0] < 0.97


@pytest.mark.parametrize("element", ["quad4", "quad8", "tri6"])
@pytest.mark.parametrize("formulation", ["continuous", "mortar"])
@pytest.mark.parametrize("kinematics", ["plane_strain", "axisymmetric"])
def test_a_field_stays_uniform_up_to_an_excluded_node(formulation, element, kinematics):
    """The upper body rests on a strip of the lower one: half a facet more or less must not leave a wild pressure."""
    mesh = with_group(blocks(element, lower=(6, 3), upper=(6, 3)), "CONT_UPPER", lambda x: x[:, 0] < 1e-9)
    contact = fc.solve(touching(held(mesh, kinematics), formulation, excluded=["OUT"]), fc.linear_ramp(1))[-1].contact
    pressure, x = contact["pair"].pressure, contact["pair"].coordinates[:, 0]
    assert pressure[x < 1e-9] == 0.0
    mean = pressure[x > 1.0].mean()
    assert (np.abs(pressure[x > 1e-9] / mean - 1) < 0.5).all()


@pytest.mark.parametrize(("formulation", "element", "tolerance"), [
    ("node_to_segment", "tri3", 1e-13), ("mortar", "tri6", 1e-7),  # a pressure field fades over the facets beyond
])  # fmt: skip
def test_excluding_where_nothing_touches_changes_nothing(forma04, formulation, element, tolerance):
    mesh = fc.generate.half_spheres(element, size=6.0)
    out = with_group(mesh, "CONT1", lambda x: x[:, 0] > 30.0)
    one = fc.solve(forma04(mesh, formulation), fc.linear_ramp(1))[-1]
    other = fc.solve(forma04(out, formulation, excluded="OUT"), fc.linear_ramp(1))[-1]
    assert np.abs(one.displacement - other.displacement).max() < tolerance * np.abs(one.displacement).max()


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("space", ["plane", "space"])
def test_nodes_without_friction_slide_freely(formulation, space):
    mesh = boxes(lower=(4, 2, 2), upper=(4, 2, 2)) if space == "space" else blocks(lower=(6, 3), upper=(6, 3))
    mesh = with_group(mesh, SIDES[space][0], left_half)
    axis = "z" if space == "space" else "y"
    top, bottom = ("U_ZMAX", "L_ZMIN") if space == "space" else ("UPPER_TOP", "LOWER_BOTTOM")
    model = elastic_model(mesh, "3d" if space == "space" else "plane_strain", nu=0.0)
    model.fix(bottom, "xy" if axis == "y" else "xyz")
    model.prescribe(top, **{"x": 0.1, axis: -0.02, **({"y": 0.0} if axis == "z" else {})})
    touching(model, formulation, friction=0.3, frictionless="OUT")
    # Paired as they lie, normals are vertical, and horizontal forces are friction.
    contact = fc.solve(model, fc.linear_ramp(1), criteria=fc.Criteria(geometry_updates=0))[-1].contact["pair"]
    out = np.isin(contact.points, mesh.points_of("OUT"))
    assert contact.active.all()
    along = np.abs(contact.force_vectors[:, 0])
    size = 10.0 / 4 if space == "space" else 10.0 / 6
    assert along[contact.coordinates[:, 0] < 4.0 - size].max() < 1e-12 * along.max()
    assert along[~out].min() > 0
    exact = formulation == "node_to_segment"  # elsewhere facets on the border push nodes of both kinds
    sliding = 0.3 * contact.force_vectors[~out, -1].sum()
    assert abs(contact.force[0]) == pytest.approx(sliding, rel=1e-10 if exact else 0.1)


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous", "mortar", "obstacle"])
@pytest.mark.parametrize(("along", "expected"), [((2.0, 0.0, 0.0), (0.0, -0.3)), ((1.0, 1.0, 0.0), (0.0, 0.0)), (
    (1.0, -1.0, 9.0), (-0.3 / 2**0.5, -0.3 / 2**0.5))])  # fmt: skip
def test_friction_along_one_direction_alone(formulation, along, expected):
    """Sliding along the diagonal: what has no friction along x has mu N along y, as DIRE_EXCL_FROT of code_aster."""
    mesh = with_group(boxes(lower=(4, 2, 2), upper=(4, 2, 2)), "U_ZMIN", left_half)
    model = elastic_model(mesh, "3d", nu=0.0, L_ZMIN="xyz")
    options = {"friction": 0.3, "frictionless_along": along}
    if formulation == "obstacle":
        model.fix("U_ZMAX", "xyz")
        floor = fc.obstacles.HalfSpace(point=mesh.points[mesh.points_of("U_ZMIN")[0]], normal=(0.0, 0.0, 1.0))
        with_obstacle(model, "pair", "U_ZMIN", floor, motion={"x": -0.1, "y": -0.1, "z": 0.02}, **options)
    else:
        model.prescribe("U_ZMAX", x=0.1, y=0.1, z=-0.02)
        touching(model, formulation, **options)
    kept = fc.Criteria(geometry_updates=0)
    force = fc.solve(model, 1, criteria=kept)[-1].contact["pair"].force
    assert force[:2] == pytest.approx(np.array(expected) * force[2], abs=1e-8 * force[2])
    if formulation == "node_to_segment":
        model.contact[0].options["frictionless"] = "OUT"
        contact = fc.solve(model, 1, criteria=kept)[-1].contact["pair"]
        out = np.isin(contact.points, mesh.points_of("OUT"))
        ratio = np.linalg.norm(contact.force_vectors[:, :2], axis=1) / contact.force_vectors[:, 2]
        assert ratio[~out] == pytest.approx(0.3, abs=1e-8)
        assert contact.force_vectors[out][:, :2] @ along[:2] == pytest.approx(0.0, abs=1e-8 * force[2])


@pytest.mark.parametrize(("options", "words"), [
    ({"friction": 0.2, "frictionless_along": (0.0, 0.0)}, "must be a vector of 2 numbers, not all zero"),
    ({"frictionless": 3}, "frictionless = 3 of contact 'pair' must be a group or a list of groups"),
])  # fmt: skip
def test_wrong_groups_are_named(options, words):
    with pytest.raises(fc.ContactError, match=words):
        touching(held(blocks()), "node_to_segment", **options)
