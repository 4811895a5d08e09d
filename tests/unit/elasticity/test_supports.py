"""Elimination of supports from a matrix: parts add up to the whole; rows and columns of supports are empty."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import bsr_array

from fastcontact.elasticity.constrained_system import supports_apart


def matrix(rng, n, size):
    """Symmetric with blocks, some of them missing, on the diagonal, too; some numbers are zero."""
    there = np.triu(rng.random((n, n)) < 0.4)
    there |= there.T
    full = rng.normal(size=(n * size, n * size)) * (rng.random((n * size, n * size)) < 0.8)
    full = np.kron(there, np.ones((size, size))) * (full + full.T)
    return bsr_array(full, blocksize=(size, size)), full


@pytest.mark.parametrize("size", [2, 3])
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 7), share=st.sampled_from([0.0, 0.3, 1.0]))
def test_the_parts_make_the_whole(size, seed, n, share):
    rng = np.random.default_rng(seed)
    K, full = matrix(rng, n, size)
    fixed = rng.random(n * size) < share
    left, taken = supports_apart(K, fixed)
    expected = full.copy()
    expected[fixed], expected[:, fixed] = 0.0, 0.0
    diagonal = full.diagonal()
    np.fill_diagonal(expected, np.where(fixed & (diagonal <= 0), diagonal.max(initial=1.0), diagonal))
    assert np.array_equal(left.toarray(), expected)
    np.testing.assert_allclose(taken.toarray(), full - expected, rtol=0, atol=1e-15 * np.abs(full).max(initial=1.0))
    assert np.count_nonzero(taken.data) == taken.nnz
    assert taken.has_canonical_format
    rows = np.repeat(np.arange(n), np.diff(left.indptr))
    assert np.count_nonzero(rows == left.indices) == n
