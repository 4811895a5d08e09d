"""Nodes without contact, and nodes without friction."""

import numpy as np
import pytest
from models import elastic_model
from two_bodies import SIDES, blocks, boxes, held, touching

import fastcontact as fc

pytestmark = pytest.mark.each_value

FORMULATIONS = ("node_to_segment", "continuous", "mortar")


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
        model.add_obstacle(
            "pair", secondary="U_ZMIN", obstacle=floor, motion={"x": -0.1, "y": -0.1, "z": 0.02}, **options
        )
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
    ({"excluded": "LOWER_BOTTOM"}, "'LOWER_BOTTOM', excluded in contact 'pair', has no nodes on the secondary side"),
    ({"excluded": "CONT_UPPER"}, "contact 'pair' excludes all nodes of 'CONT_UPPER'"),
    ({"frictionless": 3}, "frictionless = 3 of contact 'pair' must be a group or a list of groups"),
])  # fmt: skip
def test_wrong_groups_are_named(options, words):
    with pytest.raises(fc.ContactError, match=words):
        touching(held(blocks()), "node_to_segment", **options)
