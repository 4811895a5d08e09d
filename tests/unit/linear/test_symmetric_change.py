"""Low-rank symmetric changes of a matrix compared with dense matrices; scaling and selection of sparse rows."""

import numpy as np
import pytest
from scipy.sparse import bsr_array, csr_array

from fastcontact.linear.elimination.elimination import Elimination
from fastcontact.linear.multigrid.hierarchy import by_columns, transposed
from fastcontact.linear.multigrid.matrix import BlockMatrix
from fastcontact.linear.multigrid.symmetric_change import SymmetricChange
from fastcontact.linear.sparse_rows import scaled, taken
from fastcontact.linear.springs import Springs

N_NODES, N_COARSE = 150, 20


def sparse(shape, density, rng):
    return csr_array(rng.normal(size=shape) * (rng.random(shape) < density))


def symmetric_blocks(size, rng):
    """Return a symmetric matrix of blocks, and the same as an array."""
    near = rng.random((N_NODES, N_NODES)) < 0.05
    near |= near.T | np.eye(N_NODES, dtype=bool)
    dense = rng.normal(size=2 * (N_NODES * size,))
    dense = (dense + dense.T) * np.kron(near, np.ones((size, size)))
    dense *= np.outer(*2 * (rng.random(len(dense)) < 0.9,))  # supported unknowns
    A = bsr_array(csr_array(dense), blocksize=(size, size))
    A.sort_indices()
    blocks = (0,) * size
    return BlockMatrix(A.indptr.astype(np.int32), A.indices.astype(np.int32), A.data.ravel(), blocks, blocks), dense


def prolongator(size, width, rng):
    near = rng.random((N_NODES, N_COARSE)) < 0.2
    near[:, -1] |= ~near.any(axis=1)
    pattern = csr_array(near.astype(float))
    data = rng.normal(size=(pattern.nnz, size, width)).astype(np.float32)
    P = bsr_array((data, pattern.indices, pattern.indptr), shape=(N_NODES * size, N_COARSE * width))
    dense = P.toarray().astype(float)
    return BlockMatrix(P.indptr, P.indices, P.data.ravel(), (0,) * size, (0,) * width), dense


def equations(size, rng, m=130):
    """Return an elimination of m unknowns, and the matrix T (n, n) with ``u = T u``."""
    n = N_NODES * size
    pivots = rng.permutation(n)[:m]
    dense = rng.normal(size=(m, n)) * (rng.random((m, n)) < 0.02)
    dense[:, pivots] = 0.0
    T = np.eye(n)
    T[pivots] = dense
    W = csr_array(dense)
    return Elimination(pivots, W, np.zeros(m), W), T


def changes(size, rng):
    """Return the change by equations, that by springs, and both as arrays."""
    A, dense = symmetric_blocks(size, rng)
    elimination, T = equations(size, rng)
    R, stiffness = sparse((70, N_NODES * size), 0.03, rng), rng.random(70)
    ours = (
        SymmetricChange.of_equations(A, elimination.pivots, elimination.weights),
        SymmetricChange.of_springs(Springs(R, stiffness), size),
    )
    return ours, (T.T @ dense @ T - dense, R.T @ (stiffness[:, None] * R.toarray()))


@pytest.mark.parametrize("number", [0, 1])
@pytest.mark.parametrize(("size", "width"), [(3, 6), (2, 3)])
def test_changes_on_the_finest_and_the_next_coarser_level(size, width, number):
    rng = np.random.default_rng(3 * size + number)
    ours, expected = changes(size, rng)
    change, expected = ours[number], expected[number]
    largest = np.abs(expected).max()
    assert np.abs(change.on_finest().toarray() - expected).max() < 1e-12 * largest
    P, dense = prolongator(size, width, rng)
    coarse = change.on_coarse(P).scattered(N_COARSE * width).toarray()
    assert np.abs(coarse - dense.T @ expected @ dense).max() < 1e-12 * np.abs(coarse).max()
    diagonal = change.diagonal()
    blocks = expected.reshape(N_NODES, size, N_NODES, size)[diagonal.nodes, :, diagonal.nodes]
    assert np.abs(diagonal.diagonal().reshape(blocks.shape) - blocks).max() < 1e-12 * largest
    beyond = np.setdiff1d(np.arange(N_NODES), diagonal.nodes)
    assert not expected.reshape(N_NODES, size, N_NODES, size)[beyond, :, beyond].any()


@pytest.mark.parametrize(("size", "width"), [(3, 6), (2, 3), (6, 6)])
def test_products_with_the_transpose_of_a_prolongator(size, width):
    rng = np.random.default_rng(width)
    P, dense = prolongator(size, width, rng)
    x, y = rng.normal(size=N_NODES * size).astype(np.float32), np.full(N_COARSE * width, np.nan, np.float32)
    transposed(P, by_columns(P, N_COARSE)).multiply(x, y)
    bound = np.finfo(np.float32).eps * N_NODES * (np.abs(dense.T) @ np.abs(x))
    assert (np.abs(y - dense.T @ x) <= bound).all()


def test_rows_scaled_and_taken():
    rng = np.random.default_rng(5)
    R, factor = sparse((9, 12), 0.4, rng), rng.normal(size=9)
    kept = R.toarray()
    assert scaled(R, factor).toarray() == pytest.approx(factor[:, None] * kept)
    factor[2:5] = 0.0
    some = scaled(R, factor)
    assert some.toarray() == pytest.approx(factor[:, None] * kept)
    assert not np.diff(some.indptr)[2:5].any()
    assert np.array_equal(R.toarray(), kept)
    assert taken(R, np.arange(9)) is R
    assert np.array_equal(taken(R, np.array([1, 4])).toarray(), kept[[1, 4]])
