"""Grouped pivots, and multipliers that act through other rows."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from fastcontact.linear.elimination import pivot_order
from fastcontact.linear.elimination.elimination import eliminate


def grouped(rng, n=60, groups=6):
    """Rows in groups of three, each on three unknowns of its own and some that others share."""
    label = np.repeat(np.arange(groups), 3)
    rng.shuffle(label)
    B = np.zeros((len(label), n))
    for g in range(groups):
        B[np.ix_(label == g, 3 * g + np.arange(3))] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        B[np.ix_(label == g, 3 * groups + rng.choice(n - 3 * groups, 4))] = 0.25 * rng.normal(size=(3, 4))
    return csr_array(B), label


@pytest.mark.parametrize("seed", range(5))
def test_pivots_of_groups_are_their_own_and_well_conditioned(seed):
    B, label = grouped(np.random.default_rng(seed))
    pivots = pivot_order.of_groups(B, label)
    assert len(set(pivots)) == len(pivots)
    taken = np.abs(B[:, pivots].toarray()) > 0
    assert not taken[label[:, None] != label[None]].any()
    assert np.linalg.cond(B[:, pivots].toarray()) < 50
    # The first pivot of a group is its largest entry among the unknowns that no other group has.
    dense = B.toarray()
    for g in range(6):
        others = (dense[label != g] != 0).any(axis=0)
        own = np.abs(np.where(others, 0.0, dense[label == g]))
        row, column = np.unravel_index(own.argmax(), own.shape)
        assert pivots[np.flatnonzero(label == g)[row]] == column


def test_groups_without_unknowns_of_their_own_are_told():
    B = csr_array(np.ones((2, 3)))
    assert pivot_order.of_groups(B, np.arange(2)) is None
    assert pivot_order.of_groups(B, np.zeros(2, np.intp)) is None  # two equal equations of one group
    weak = csr_array(np.array([[0.1, 0.0, 1.0], [0.0, 0.1, 1.0]]))  # no group has a pivot that is large enough
    assert pivot_order.of_groups(weak, np.arange(2)) is None
    assert pivot_order.of_nodes(weak, np.arange(2), 1) is None


def test_forces_move_along_the_rows_that_multipliers_act_through():
    rng = np.random.default_rng(3)
    B, label = grouped(rng)
    through = csr_array(B + 0.2 * csr_array(np.where(B.toarray() != 0, rng.normal(size=B.shape), 0.0)))
    tied = eliminate(B, rng.normal(size=B.shape[0]), through, label)
    x, r = rng.normal(size=(2, B.shape[1]))
    tied.complete(x, tied.offset)
    forces = r[tied.pivots].copy()
    moved = r.copy()
    tied.move_forces(moved)
    multiplier = tied.multiplier(forces)
    np.testing.assert_allclose(moved, r - through.T @ multiplier, atol=1e-12)
    assert np.abs(moved[tied.pivots]).max() < 1e-12
    assert np.abs((tied.force_weights - tied.weights).data).max() > 0.01
    symmetric = eliminate(B, np.zeros(B.shape[0]), nodes=label)
    assert symmetric.force_weights is symmetric.weights
