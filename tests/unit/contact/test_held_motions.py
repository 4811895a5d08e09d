"""Directions in which nodes are held do not depend on the axes or on the order of nodes."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from fastcontact.contact.held_motions import alike, spanned, without

Q = Rotation.from_rotvec([0.4, 1.2, -0.5]).as_matrix()


def on(*directions):
    """The projector (3, 3) on some directions."""
    return spanned(sum(np.outer(d, d) for d in np.array(directions, float))[None], 1e-6)[0]


def quadrant(n=5):
    """Nodes of a quarter of a disc: held along x where x = 0, along y where y = 0, along both on the axis."""
    places = np.array([[i, j, 0.0] for i in range(n) for j in range(n)])
    x, y, none = on([1, 0, 0]), on([0, 1, 0]), np.zeros((3, 3))
    held = [x * (p[0] == 0) + y * (p[1] == 0) if p[0] * p[1] == 0 else none for p in places]
    return np.array(held), places


def rim(n=24):
    """Nodes of a disc whose rim is held along its normals."""
    angle = 2 * np.pi * np.arange(n) / n
    normal = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(n)])
    places = np.concatenate([2 * normal, 1 * normal])
    return np.concatenate([[on(d) for d in normal], np.zeros((n, 3, 3))]), places


def cornered():
    """The same with the node on the axis held altogether."""
    held, places = quadrant()
    held[0] = np.eye(3)
    return held, places


def said(groups):
    """Directions that no sign and no order matters to: the sums of their projectors over groups, at the nodes held."""
    return sum(np.where(nodes[:, None, None], along[:, :, None] * along[:, None], 0.0) for along, nodes in groups)


@pytest.mark.parametrize("made", [quadrant, rim, cornered])
def test_turned_and_renumbered_nodes_are_held_alike(made):
    held, places = made()
    order = np.random.default_rng(3).permutation(len(places))
    groups = alike(held, places)
    again = alike((Q @ held @ Q.T)[order], (places @ Q.T)[order])
    assert len(groups) == len(again)
    assert (Q @ said(groups) @ Q.T)[order] == pytest.approx(said(again), abs=1e-12)
    assert spanned(said(groups), 0.5) == pytest.approx(held, abs=1e-12)


def test_a_node_on_two_walls_belongs_to_both():
    held, places = quadrant()
    (first, at_first), (second, at_second) = alike(held, places)
    assert abs(first[0] @ second[0]) < 1e-12
    assert np.flatnonzero(at_first & at_second).tolist() == [0]
    assert at_first.sum() == at_second.sum() == 5


def test_beside_a_rim_the_direction_is_that_of_the_rim_nearby():
    held, places = rim()
    ((along, nodes),) = alike(held, places)
    assert nodes.sum() == 24
    radial = places / np.linalg.norm(places, axis=1, keepdims=True)
    outward = np.einsum("nd,nd->n", along, radial)
    assert outward * outward[0] == pytest.approx(1.0, abs=1e-9)


def test_what_nodes_move_apart_along_is_not_held():
    moved = np.array([[0.3, 0.3, 0.0], [0.0, 0.0, 0.0], [1e-12, 0.0, 0.0]])
    left = without(np.array([np.eye(3)] * 3), moved, 1e-9)
    assert left[0] == pytest.approx(on([1, -1, 0], [0, 0, 1]), abs=1e-12)
    assert left[1:] == pytest.approx(np.array([np.eye(3)] * 2), abs=1e-12)
