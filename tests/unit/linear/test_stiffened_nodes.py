"""Nodes tied to a much stiffer body: corrections that move no pivot, and unknowns that follow the pivots."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from fastcontact.linear.elimination.elimination import Elimination
from fastcontact.linear.multigrid.stiffened_nodes import FreeMotions, compose, follower_elimination

SIZE, PIVOTS, OPPOSITE, FREE = 3, 12, 25, 10
N = (PIVOTS + OPPOSITE + FREE) * SIZE
NODES = PIVOTS + np.arange(OPPOSITE)


def equations(directions, tilt, rng):
    """Return equations of the first nodes: the opposite ones move them, by weights that add up to one along each direction.

    With a `tilt`, unknowns beside the direction take part as they do in a gap along a normal that is tilted.
    """
    pivots, rows = [], []
    for node in range(PIVOTS):
        near = rng.permutation(OPPOSITE)[:5]
        share = rng.random(5) + 0.1
        share /= share.sum()
        for direction in directions:
            normal = np.full(SIZE, tilt)
            normal[direction] = 1.0
            row = np.zeros((N // SIZE, SIZE))
            row[NODES[near]] = share[:, None] * normal
            row[node] -= normal
            row[node, direction] = 0.0
            pivots.append(node * SIZE + direction)
            rows.append(row.ravel())
    W = csr_array(np.array(rows))
    return Elimination(np.array(pivots), W, np.zeros(len(pivots)), W)


def matrix(pivots, weights):
    """Return T (n, n) with ``u = T u``."""
    T = np.eye(N)
    T[pivots] = weights.toarray()
    return T


@pytest.mark.parametrize("directions", [(2,), (0, 1, 2)])
def test_free_motions_move_no_pivot_and_yield_as_their_body_does(directions):
    rng = np.random.default_rng(3)
    elimination = equations(directions, 0.0, rng)
    blocks = rng.normal(size=(OPPOSITE, SIZE, SIZE))
    of_blocks = np.linalg.inv(blocks @ blocks.transpose(0, 2, 1) + np.eye(SIZE))
    motions = FreeMotions(elimination.weights, NODES, of_blocks)
    at = (NODES[:, None] * SIZE + np.arange(SIZE)).ravel()
    W, D = elimination.weights.toarray()[:, at], np.zeros((len(at), len(at)))
    for k, block in enumerate(of_blocks):
        D[k * SIZE : (k + 1) * SIZE, k * SIZE : (k + 1) * SIZE] = block
    r, step, x = rng.normal(size=N), np.ones(N), np.zeros(N)
    motions.correct(r, 0.5, step, x)
    assert np.array_equal(np.flatnonzero(x), at)
    assert np.allclose(step, 1.0 + x)
    assert np.abs(W @ x[at]).max() < 1e-4 * np.abs(x).max()
    expected = D @ r[at] - D @ W.T @ np.linalg.pinv(W @ D @ W.T) @ W @ D @ r[at]
    assert np.allclose(x[at], 0.5 * expected, atol=1e-4 * np.abs(expected).max())


@pytest.mark.parametrize(("directions", "tilt"), [((2,), 0.0), ((2,), 0.2), ((0, 1, 2), 0.0)])
def test_both_sides_translate_together_where_stiffened_nodes_follow(directions, tilt):
    elimination = equations(directions, tilt, np.random.default_rng(5))
    followers = follower_elimination(elimination, NODES, SIZE)
    assert set(followers.pivots % SIZE) == set(directions)
    assert len(followers.pivots) > 0.7 * OPPOSITE * len(directions)
    pivots, weights = compose(elimination, followers)
    both = matrix(elimination.pivots, elimination.weights) @ matrix(followers.pivots, followers.weights)
    assert np.allclose(matrix(pivots, weights), both)
    # The pivots' side decides: where it moves and the other lies still, that follows.
    u = np.zeros((N // SIZE, SIZE))
    u[:PIVOTS] = 1.0, -2.0, 3.0
    if tilt == 0.0:
        moved = (both @ u.ravel()).reshape(-1, SIZE)
        assert np.allclose(
            moved[followers.pivots // SIZE, followers.pivots % SIZE], np.r_[1.0, -2.0, 3.0][followers.pivots % SIZE]
        )
    u[NODES] = 1.0, -2.0, 3.0
    assert np.allclose(both @ u.ravel(), u.ravel())


def test_unknowns_that_move_no_pivot_by_themselves_do_not_follow():
    elimination = equations((2,), 0.0, np.random.default_rng(7))
    W = elimination.weights.toarray()
    W[:, NODES[0] * SIZE + 2] = -0.1
    W = csr_array(W)
    followers = follower_elimination(Elimination(elimination.pivots, W, elimination.offset, W), NODES, SIZE)
    assert NODES[0] * SIZE + 2 not in followers.pivots
