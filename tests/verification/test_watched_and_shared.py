"""Gap-only pairs, search distance, shared nodes, node-to-node pairing; forces on both sides."""

import numpy as np
import pytest
from mechanics import contact_forces
from models import elastic_model, with_contact
from refusals import refused
from two_bodies import SIDES, YOUNG, blocks, boxes, each, held, ring, touching

import fastcontact as fc

pytestmark = pytest.mark.each_value

both = pytest.mark.parametrize("kinematics", ["plane_strain", "axisymmetric", "3d"])


def pressed(formulation, kinematics="plane_strain", approach=0.02, apart=0.0, steps=1, matching=True, **options):
    divisions = ((3, 2), (3, 2)) if matching else ((5, 2), (3, 2))
    if kinematics == "3d":
        mesh = boxes(lower=(*divisions[0][:1], 3, 2), upper=(*divisions[1][:1], 3, 2), apart=apart)
    else:
        mesh = blocks(lower=divisions[0], upper=divisions[1], apart=apart)
    model = touching(held(mesh, kinematics, approach), formulation, **options)
    return model, fc.solve(model, fc.linear_ramp(steps))


# A pair that is only watched


@each
@both
def test_a_watched_pair_tells_penetration_and_carries_nothing(formulation, options, kinematics):
    _, steps = pressed(formulation, kinematics, steps=2, kind="gap_only", **options)
    for step, gap in zip(steps, (-0.01, -0.02), strict=True):
        contact = step.contact["pair"]
        np.testing.assert_allclose(contact.gap, gap, rtol=1e-12)
        assert not contact.force_vectors.any()
        assert not contact.primary_force_vectors.any()
        assert not contact.active.any()
        assert not contact.pressure.any()
        assert abs(step.stress).max() < 1e-9 * YOUNG


def test_a_watched_pair_leaves_another_pair_as_it_is():
    alone = pressed("mortar", matching=False)[1][-1]
    model = held(blocks(lower=(5, 2)))
    plane = fc.obstacles.HalfSpace((0.0, -5.25), (0.0, 1.0))
    model.add_obstacle("watched", secondary="LOWER_BOTTOM", obstacle=plane, kind="gap_only")
    step = fc.solve(touching(model, "mortar"), fc.linear_ramp(1))[-1]
    np.testing.assert_allclose(step.displacement, alone.displacement, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(step.contact["watched"].gap, 0.25, rtol=1e-13)
    assert step.contact["watched"].primary_force_vectors.shape == (0, 2)


def test_a_body_that_a_watched_pair_alone_would_hold_is_refused():
    model = touching(held(blocks()), "node_to_segment", kind="gap_only")
    model.supports = [support for support in model.supports if support.group != "UPPER_TOP"]
    model.add_pressure("UPPER_TOP", 1.0)
    refused(fc.ModelError, "not restrained", fc.solve, model, fc.linear_ramp(1))


# How far a point looks


@each
@both
def test_what_is_farther_off_than_the_search_distance_is_not_faced(formulation, options, kinematics):
    told = (
        "carries nothing where its sides penetrate by 0.2, more than its search_distance 0.1: raise that, or use more"
    )
    with pytest.warns(fc.FastcontactWarning, match=told):
        _, steps = pressed(formulation, kinematics, approach=0.5, apart=0.3, search_distance=0.1, **options)
    assert not steps[-1].contact["pair"].active.any()
    np.testing.assert_allclose(steps[-1].contact["pair"].gap, -0.2, rtol=1e-10)
    _, near = pressed(formulation, kinematics, approach=0.5, apart=0.3, search_distance=0.35, **options)
    _, anywhere = pressed(formulation, kinematics, approach=0.5, apart=0.3, **options)
    np.testing.assert_allclose(near[-1].displacement, anywhere[-1].displacement, rtol=1e-9, atol=1e-12)
    assert near[-1].contact["pair"].active.all()


@each
def test_steps_shorter_than_the_search_distance_miss_nothing(formulation, options):
    # No step ends where the sides just meet.
    _, steps = pressed(formulation, approach=0.5, apart=0.31, steps=10, search_distance=0.06, **options)
    _, anywhere = pressed(formulation, approach=0.5, apart=0.31, **options)
    np.testing.assert_allclose(steps[-1].displacement, anywhere[-1].displacement, rtol=1e-9, atol=1e-12)


# Sides that share nodes


def cracked(element="quad4"):
    """A body that a crack cuts along y = 0 from the left to half its width; both faces begin at the tip."""
    mesh = fc.generate.block_on_block(divisions_lower=(6, 3), divisions_upper=(6, 3), element=element)
    lower, upper = mesh.points_of("CONT_LOWER"), mesh.points_of("CONT_UPPER")
    lower, upper = (side[np.argsort(mesh.points[side, 0])] for side in (lower, upper))
    number = np.arange(mesh.n_points)
    joined = mesh.points[upper, 0] > 4.9
    number[upper[joined]] = lower[joined]
    cells = {name: number[block] for name, block in mesh.cells.items()}
    keep = np.unique(np.concatenate([block.ravel() for block in cells.values()]))
    position = np.full(mesh.n_points, -1)
    position[keep] = np.arange(len(keep))
    cells = {name: position[block] for name, block in cells.items()}
    groups = {}
    for name in ("LOWER_BOTTOM", "UPPER_TOP", "LOWER_LEFT", "UPPER_LEFT"):
        groups[name] = mesh.cell_groups[name]
    line = next(name for name in mesh.cells if name.startswith("line"))
    first = mesh.offsets[line]
    for name in ("CONT_LOWER", "CONT_UPPER"):
        members = mesh.cell_groups[name]
        middle = mesh.points[mesh.cells[line][members - first]].mean(axis=1)[:, 0]
        groups[name] = members[middle < 4.9]
    points = mesh.points[keep]
    tip = np.flatnonzero((np.abs(points[:, 1]) < 1e-9) & (np.abs(points[:, 0] - 5.0) < 1e-9))
    return fc.Mesh(points, cells, groups, {"TIP": tip})


@each
@pytest.mark.parametrize("element", ["quad4", "quad8"])
@pytest.mark.parametrize("swap", [False, True])
def test_a_closed_crack_carries_uniform_stress_up_to_the_node_that_its_faces_share(formulation, options, element, swap):
    model = elastic_model(cracked(element), "plane_strain", E=YOUNG, LOWER_LEFT="x", LOWER_BOTTOM="y")
    model.add_pressure("UPPER_TOP", 2.0)
    touching(model, formulation, swap=swap, excluded="TIP", normals="facet", **options)
    step = fc.solve(model, fc.linear_ramp(1))[-1]
    np.testing.assert_allclose(step.stress[:, 1], -2.0, rtol=1e-9)
    contact = step.contact["pair"]
    tip = model.mesh.point("TIP")
    assert tip in contact.points
    assert not contact.force_vectors[contact.points == tip].any()
    balanced(model, step)


# Forces on both sides


def balanced(model, step):
    """Check that internal forces are those of loads, supports and contact, node by node."""
    total = step.reaction + contact_forces(step) + sum(model.forces_by_ramp().values())
    np.testing.assert_allclose(model.internal_forces(step.displacement), total, atol=1e-9 * np.abs(total).max())


def moment(arms, forces):
    """The moments about all axes, in the plane about the one across it."""
    return sum(np.array([x * g - y * f for x, y, f, g in (
        (*arms.T[[i, j]], *forces.T[[i, j]]) for i, j in ((0, 1), (1, 2), (0, 2)) if j < arms.shape[1]
    )]).T)  # fmt: skip


@each
@both
def test_both_sides_carry_opposite_forces_and_all_nodes_are_in_balance(formulation, options, kinematics):
    model, steps = pressed(formulation, kinematics, matching=False, friction=0.3, **options)
    contact = steps[-1].contact["pair"]
    balanced(model, steps[-1])
    size = np.abs(contact.force_vectors).sum()
    np.testing.assert_allclose(
        contact.primary_force_vectors.sum(axis=0), -contact.force_vectors.sum(axis=0), atol=1e-10 * size
    )
    side = SIDES["space" if kinematics == "3d" else "plane"][1]
    assert set(contact.primary_points.tolist()) == set(model.mesh.points_of(side).tolist())
    if kinematics != "axisymmetric":  # moments about the origin
        sides = (contact.points, contact.force_vectors), (contact.primary_points, contact.primary_force_vectors)
        moments = [moment(model.mesh.points[points], forces) for points, forces in sides]
        np.testing.assert_allclose(moments[0], -moments[1], atol=1e-9 * size * 10.0)


# Nodes opposite nodes


@both
def test_on_meshes_that_match_nodes_face_what_facets_show(kinematics):
    nodes = pressed("node_to_segment", kinematics, opposite="node", normals="averaged")[1][-1]
    facets = pressed("node_to_segment", kinematics, normals="averaged")[1][-1]
    np.testing.assert_allclose(nodes.displacement, facets.displacement, rtol=1e-10, atol=1e-14)


@both
def test_every_node_pushes_on_the_nearest_one_alone(kinematics):
    model, steps = pressed("node_to_segment", kinematics, matching=False, opposite="node")
    contact = steps[-1].contact["pair"]
    positions = model.mesh.points + steps[-1].displacement
    opposite = positions[contact.primary_points]
    nearest = [int(np.argmin(np.linalg.norm(opposite - positions[node], axis=1))) for node in contact.points]
    expected = np.zeros_like(contact.primary_force_vectors)
    np.add.at(expected, nearest, -contact.force_vectors)
    np.testing.assert_allclose(contact.primary_force_vectors, expected, atol=1e-12 * np.abs(expected).max())


# Along which normals


@each
@both
@pytest.mark.parametrize("normals", ["secondary", "vector"])
def test_between_flat_sides_all_normals_are_the_same(formulation, options, kinematics, normals):
    axis = 2 if kinematics == "3d" else 1
    vector = [0.0] * (axis + 1)
    vector[axis] = 7.0
    plain = pressed(formulation, kinematics, **options)[1][-1]
    chosen = vector if normals == "vector" else normals
    step = pressed(formulation, kinematics, normals=chosen, **options)[1][-1]
    np.testing.assert_allclose(step.displacement, plain.displacement, rtol=1e-8, atol=1e-12)


def pin_in_hole(formulation, **options):
    """A quarter of a pin that a hole with other nodes holds."""
    inner = ring("quad4", 1.0, 2.0, (6, 2), "PIN")
    mesh = fc.generate.union(inner, ring("quad4", 2.0, 4.0, (9, 3), "HOLE"))
    model = elastic_model(mesh, "plane_strain", E=YOUNG, XAXIS="y", YAXIS="x")
    model.add_pressure("PIN_INNER", 5.0)
    return with_contact(model, "pair", "PIN_OUTER", "HOLE_INNER", formulation=formulation, **options)


@pytest.mark.filterwarnings("ignore:.*deviate from their arcs")
@each
def test_forces_lie_along_the_normals_that_are_asked_for(formulation, options):
    contact = fc.solve(pin_in_hole(formulation, normals="secondary", **options), fc.linear_ramp(1))[-1].contact["pair"]
    along = contact.coordinates / np.linalg.norm(contact.coordinates, axis=1, keepdims=True)
    # At the ends the mean of one chord's normal leans by half its angle, which the next node feels, too.
    inside = slice(1, -1) if formulation == "node_to_segment" else slice(2, -2)
    across = np.column_stack([-along[:, 1], along[:, 0]])
    sideways = np.abs((contact.force_vectors * across).sum(axis=1))[inside].max()
    assert np.abs(contact.normal[inside] + along[inside]).max() < 5e-3
    assert sideways < 5e-3 * np.abs(contact.force_vectors).max()


@each
def test_one_vector_turns_all_forces(formulation, options):
    vector = np.array([0.6, 0.8])
    model = pin_in_hole(formulation, normals=(-3 * vector).tolist(), **options)
    contact = fc.solve(model, fc.linear_ramp(1))[-1].contact["pair"]
    across = contact.force_vectors @ np.array([-0.8, 0.6])
    assert np.abs(across).max() < 1e-12 * np.abs(contact.force_vectors).max()


@pytest.mark.parametrize(("options", "words"), [
    ({"normals": (0.0, -1.0)}, "must point out of the body of 'CONT_LOWER'"),
    ({"normals": (0.0, 0.0)}, "a vector of 2 numbers"),
    ({"normals": (0.0, 1.0, 0.0)}, "a vector of 2 numbers"),
    ({"opposite": "edge"}, "lies opposite to 'edge'"),
    ({"slip": "none"}, "unknown kind of slip 'none'"),
    ({"search_distance": 0.0}, "must be positive; without it, the distance is unlimited"),
    ({"kind": "gap_only", "penalty": 1.0}, "gap_only, which has no forces"),
    ({"kind": "gap_only", "friction": 1.0}, "gap_only, which excludes friction"),
    ({"tangential_penalty": 1.0}, "no friction that it could soften"),
    ({"tangential_penalty": -1.0, "friction": 0.1}, "tangential_penalty -1 of contact 'pair' must be positive"),
])  # fmt: skip
def test_wrong_options_are_refused(options, words):
    model = held(blocks())
    with pytest.raises(fc.ContactError, match=words):
        fc.solve(touching(model, "node_to_segment", **options), fc.linear_ramp(1))


def test_an_option_that_is_none_is_left_out():
    assert touching(held(blocks()), "node_to_segment", friction=None, penalty=None).contact[0].options == {}


@pytest.mark.parametrize(("options", "words"), [
    ({"normals": "secondary", "formulation": "continuous"}, "a rigid obstacle has its own"),
    ({"opposite": "node", "formulation": "node_to_segment"}, "a rigid obstacle has no nodes"),
])  # fmt: skip
def test_options_of_two_bodies_are_refused_for_obstacles(options, words):
    model = held(blocks())
    plane = fc.obstacles.HalfSpace((0.0, -5.0), (0.0, 1.0))
    refused(fc.ContactError, words, model.add_obstacle, "plate", secondary="LOWER_BOTTOM", obstacle=plane, **options)
