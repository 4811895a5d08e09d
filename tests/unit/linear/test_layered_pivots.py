"""Pivots in layers: the inverse of the pivot columns is exact, and refused without an order."""

import numpy as np
import pytest
from pairwise import first_of
from scipy.sparse import csr_array

from fastcontact.linear.elimination.coupled_pivots import CoupledPivots
from fastcontact.linear.elimination.pivot_order import chosen, inverse_of, of_groups, of_most_groups


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
