"""Grouped and layered pivots: exact inverses, refused without an order."""

import numpy as np
import pytest
from pairwise import first_of
from scipy.sparse import csr_array

from fastcontact.linear.elimination import pivot_order
from fastcontact.linear.elimination.coupled_pivots import CoupledPivots
from fastcontact.linear.elimination.elimination import eliminate
from fastcontact.linear.elimination.pivot_order import chosen, inverse_of, of_groups, of_most_groups


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


def layered(B):
    """Return the pivots of equations that are groups of their own."""
    return of_groups(csr_array(B), np.arange(B.shape[0]))


def in_layers(seed, sizes=(5, 4, 3), n_others=6):
    """Equations in shuffled order, each with an own unknown that only earlier layers contain besides."""
    rng = np.random.default_rng(seed)
    m = sum(sizes)
    layer = np.repeat(np.arange(len(sizes)), sizes)
    own = np.where(layer[:, None] < layer[None, :], 0.5 * rng.uniform(-1, 1, (m, m)), 0.0) + np.diag(
        rng.uniform(1, 2, m)
    )
    others = 0.7 * rng.uniform(-1, 1, (m, n_others))
    others[:, 0] = 0.5  # so that none of these belongs to one equation alone
    others[:, 1:] *= rng.integers(0, 2, (1, n_others - 1))
    B = np.hstack([own, others])
    return B[rng.permutation(m)][:, rng.permutation(m + n_others)]


@pytest.mark.parametrize("seed", range(5))
def test_the_inverse_is_exact(seed):
    B = in_layers(seed)
    pivots = layered(B)
    assert pivots is not None
    inverse = inverse_of(csr_array(B), pivots, 1)
    assert len(set(pivots.tolist())) == len(B)
    assert inverse.solve(B[:, pivots]) == pytest.approx(np.eye(len(B)), abs=1e-13)


def test_one_layer_is_a_diagonal():
    B = np.array([[2.0, 0.0, 1.0], [0.0, -4.0, 1.0]])
    pivots, inverse = chosen(csr_array(B))
    assert pivots.tolist() == [0, 1]
    assert inverse.matrix.toarray().tolist() == [[0.5, 0.0], [0.0, -0.25]]


def test_equations_that_all_share_their_unknowns_have_no_order():
    assert layered(np.array([[2.0, 1.0], [1.0, 2.0]])) is None


def test_weak_unknowns_are_no_pivots():
    B = np.array([[0.1, 1.0, 0.0], [0.0, 1.0, 1.0]])
    assert layered(B).tolist() == [1, 2]
    B[0, 0] = 0.3
    assert layered(B).tolist() == [0, 2]


def nodes_in_layers(rng, corners=40, middles=60):
    """Equations of nodes, three each: those of corners on themselves, those of middles also on two corners; all on others."""
    n, equation = corners + middles, np.linalg.qr(rng.normal(size=(corners + middles, 3, 3)))[0]
    B = np.zeros((3 * n, 3 * n + 30))
    for node in range(n):
        own = slice(3 * node, 3 * node + 3)
        B[own, own] = equation[node]
        for other in rng.choice(corners, 2, replace=False) if node >= corners else ():
            B[own, 3 * other : 3 * other + 3] = 0.5 * equation[node]
        B[own, 3 * n + rng.choice(30, 4, replace=False)] = 0.25 * rng.normal(size=(3, 4))
    order = rng.permutation(3 * n)
    return csr_array(B[order]), np.repeat(np.arange(n), 3)[order]


@pytest.mark.parametrize("seed", range(3))
def test_nodes_in_layers_have_a_sparse_inverse(seed):
    B, nodes = nodes_in_layers(np.random.default_rng(seed))
    assert layered(B) is None  # three equations of a node share its three unknowns
    assert of_groups(B, nodes, layers=1) is None
    pivots, inverse = chosen(B, nodes, 3)
    assert np.array_equal(pivots, of_groups(B, nodes))
    P = B[:, pivots].toarray()
    assert inverse.solve(P) == pytest.approx(np.eye(len(P)), abs=1e-10)
    assert inverse.matrix.nnz < 12 * len(P)
    # Forces act through other rows of the same pattern.
    through = B + csr_array((0.1 * np.cos(np.arange(B.nnz)) * B.data, B.indices, B.indptr), shape=B.shape)
    inverse = inverse_of(csr_array(through), pivots, 3)
    assert inverse.solve(through[:, pivots].toarray()) == pytest.approx(np.eye(len(P)), abs=1e-9)
    assert inverse.matrix.nnz < 12 * len(P)


def test_a_chain_of_more_layers_is_no_sum_of_few_products():
    m = 80
    B = csr_array(np.eye(m) + 0.5 * np.eye(m, k=1))
    inverse = inverse_of(B, np.arange(m), 1)
    assert isinstance(inverse, CoupledPivots)
    assert inverse.solve(B @ np.ones(m)) == pytest.approx(np.ones(m))


def held_along_a_line(n):
    """Equations of n nodes in a row, two each: gaps with an own unknown, and slips that only move three nodes opposite."""
    B = np.zeros((2 * n, n + 2 * (n + 2)))
    for i in range(n):
        B[2 * i, i] = 1.0
        B[2 * i, n + i : n + i + 3] = -0.2, -0.6, -0.2
        B[2 * i + 1, 2 * n + 2 + i : 2 * n + 5 + i] = -0.25, -0.5, -0.25
    return csr_array(B), np.repeat(np.arange(n), 2)


@pytest.mark.parametrize("n", first_of(1, [20, 300]))
def test_equations_without_unknowns_of_their_own_leave_those_of_the_others_alone(n):
    """Slips of nodes that a support holds, but not what they stick to."""
    B, nodes = held_along_a_line(n)
    assert of_groups(B, nodes) is None
    gaps, slips = np.arange(0, 2 * n, 2), np.arange(1, 2 * n, 2)
    pivots = of_most_groups(B, nodes)
    assert (pivots[gaps] < 2 * n + 2).all()
    assert (pivots[slips] >= 2 * n + 2).all()
    pivots, inverse = chosen(B, nodes, 1)
    P = B[:, pivots].toarray()
    inverted = inverse.solve(P)
    assert inverted == pytest.approx(np.eye(2 * n), abs=1e-8)
