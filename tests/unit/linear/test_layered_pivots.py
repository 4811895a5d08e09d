"""Pivots of equations in layers: the inverse of the pivots' columns is exact, and refused where there is no order."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from fastcontact.linear.elimination.pivot_order import layered


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
    found = layered(csr_array(B), 0.25)
    assert found is not None
    pivots, inverse = found
    assert len(set(pivots.tolist())) == len(B)
    assert inverse.toarray() @ B[:, pivots] == pytest.approx(np.eye(len(B)), abs=1e-13)


def test_one_layer_is_a_diagonal():
    B = np.array([[2.0, 0.0, 1.0], [0.0, -4.0, 1.0]])
    pivots, inverse = layered(csr_array(B), 0.25)
    assert pivots.tolist() == [0, 1]
    assert inverse.toarray().tolist() == [[0.5, 0.0], [0.0, -0.25]]


def test_equations_that_all_share_their_unknowns_have_no_order():
    assert layered(csr_array(np.array([[2.0, 1.0], [1.0, 2.0]])), 0.25) is None


def test_weak_unknowns_are_no_pivots():
    B = csr_array(np.array([[0.1, 1.0, 0.0], [0.0, 1.0, 1.0]]))
    assert layered(B, 0.25)[0].tolist() == [1, 2]
    assert layered(B, 0.05)[0].tolist() == [0, 2]
