"""The matrix of multigrid: entries split into two parts multiply like the original."""

import sys

import numpy as np
import pytest
from scipy.sparse import bsr_array
from stepping import Stepping

import fastcontact as fc
from fastcontact.linear import choice as linear
from fastcontact.linear.multigrid import matrix as matrices
from fastcontact.linear.multigrid.matrix import ALL_BLOCKS, ScaledMatrix, symmetric_storage

EXACT = 2.0**-47  # of split numbers, in units of the largest number of a row


def matrix(n, size, scale=1.0, seed=0):
    """Return a symmetric matrix (n size, n size) of a chain with a few more connections."""
    rng = np.random.default_rng(seed)
    full = np.zeros((n, size, n, size))
    for i in range(n):
        for j in {i, (i + 1) % n, (3 * i) % n}:
            block = rng.normal(size=(size, size)) * 10.0 ** rng.uniform(-6, 6)
            full[i, :, j] += block
            full[j, :, i] += block.T
    full = full.reshape(n * size, n * size)
    full[np.diag_indices_from(full)] = np.abs(full).sum(axis=1)
    return bsr_array(bsr_array(scale * full, blocksize=(size, size)))


@pytest.mark.parametrize("every", [False, True])
@pytest.mark.parametrize(("n", "size", "shortest"), [(7, 1, 1024), (600, 2, 100), (1300, 1, 200)])
def test_the_parts_of_stored_blocks_may_take_the_place_of_all(n, size, shortest, every, monkeypatch):
    """The high part is the nearest number, the low part the rest."""
    monkeypatch.setattr(matrices, "MIN_ROWS", shortest)
    K = matrix(n, size)
    storage, square = ALL_BLOCKS if every else symmetric_storage(K.indptr, K.indices), size * size
    start, columns = (K.indptr, K.indices) if every else (storage[0], storage[2])
    numbers, high = K.data.reshape(-1).copy(), np.empty(len(columns) * square, np.float32)
    matrices._store_parts(K.indptr, K.indices, storage, 0.25, numbers, square, high)
    dense = K.toarray().reshape(n, size, n, size)
    expected = 0.25 * dense[np.repeat(np.arange(n), np.diff(start)), :, columns].ravel()
    low = numbers.view(np.float32)[: len(high)]
    np.testing.assert_array_equal(high, expected.astype(np.float32))
    np.testing.assert_array_equal(low, (expected - high).astype(np.float32))
    np.testing.assert_allclose(high.astype(float) + low, expected, rtol=2.0**-48)


@pytest.mark.parametrize("release", [False, True])
@pytest.mark.parametrize("precision", ["single", "double"])
@pytest.mark.parametrize(("n", "size"), [(7, 1), (40, 2), (30, 3), (110, 3)])
def test_products_are_those_of_the_matrix(n, size, precision, release, monkeypatch):
    monkeypatch.setattr(matrices, "MIN_ROWS", 100)  # the largest is multiplied in parts
    K = matrix(n, size, scale=3e7)
    dense, rng = K.toarray(), np.random.default_rng(3)
    given = ScaledMatrix(K.copy(), precision, release)
    u, f = rng.normal(size=(2, n * size))
    size_of_rows = np.abs(dense) @ np.abs(u)
    np.testing.assert_array_less(np.abs(given @ u - dense @ u), EXACT * size_of_rows)
    out = np.full(n * size, np.nan)
    given.combine(-2.0, u, 0.0, out, out)
    np.testing.assert_array_less(np.abs(out + 2.0 * dense @ u), 2.0 * EXACT * size_of_rows)
    given.combine(0.5, u, 3.0, f, out)
    np.testing.assert_array_less(np.abs(out - 3.0 * f - 0.5 * dense @ u), EXACT * (size_of_rows + np.abs(f)))
    np.testing.assert_allclose(given.diagonal(), K.diagonal(), rtol=EXACT)
    np.testing.assert_allclose(given.absolute_product(u), size_of_rows, rtol=1e-6)
    some = np.array([0, n * size // 2, n * size - 1])
    np.testing.assert_array_less(
        np.abs(given.forces_at(some, u, f) - (dense @ u - f)[some]), EXACT * (size_of_rows + np.abs(f))[some]
    )
    np.testing.assert_allclose(given.scaled.rows_of(some).toarray() / given.scale, dense[some], rtol=EXACT)
    np.testing.assert_allclose(given.restored().toarray(), dense, rtol=EXACT)
    given.convert("double" if precision == "single" else "single")
    np.testing.assert_allclose(given.restored().toarray(), dense, rtol=2 * EXACT)


def test_a_matrix_that_is_released_gives_its_memory_away():
    K = matrix(50, 3)
    K = bsr_array((K.data.copy(), K.indices, K.indptr), shape=K.shape)
    n, dense = K.data.size, K.toarray()
    given = ScaledMatrix(K, "single", release=True)
    assert K.nnz == 0
    assert not (K @ np.ones(150)).any()
    owner = given.scaled.low
    while isinstance(owner.base, np.ndarray):
        owner = owner.base
    stored = 9 * (len(given.scaled.indices) + 50) // 2  # one of two triangles, and the diagonal
    assert given.scaled.data.size == stored < 0.61 * n
    if sys.gettrace() is None:  # what measures coverage holds arrays, too
        assert owner.nbytes <= 4 * stored + 8
    np.testing.assert_allclose(given.restored().toarray(), dense, rtol=EXACT)


def test_numbers_that_somebody_else_holds_stay_where_they_are():
    K = matrix(50, 3)
    dense, held = K.toarray(), K.data
    given = ScaledMatrix(K, "single", release=True)
    np.testing.assert_allclose(given.restored().toarray(), dense, rtol=EXACT)
    owner = held if held.base is None else held.base
    assert owner.nbytes == 8 * 9 * len(given.scaled.indices)  # no memory was taken from under it


@pytest.mark.parametrize("size", [1, 2, 3, 4])
@pytest.mark.parametrize("length", [3, 7, 40])
def test_blocks_stored_once_multiply_as_if_all_were(size, length, monkeypatch):
    """Parts of few rows, the last one shorter, or one part."""
    monkeypatch.setattr(matrices, "MIN_ROWS", length)
    monkeypatch.setattr(matrices, "MAX_STRIPS", 40)
    K = matrix(40, size)
    A, rng = ScaledMatrix(K, "single").scaled, np.random.default_rng(7)
    dense = A.to_scipy().toarray()
    np.testing.assert_allclose(dense, ScaledMatrix(K, "single").scale * K.toarray(), rtol=EXACT)
    assert np.array_equal(dense, dense.T)
    start, upper, columns, _ = A.storage
    for i in range(40):
        own, inside = columns[start[i] : start[i + 1]], range(i // length * length, (i // length + 1) * length)
        row = K.indices[K.indptr[i] : K.indptr[i + 1]]
        assert columns[upper[i] - 1] == i
        assert sorted(own) == [j for j in row if j >= i or j not in inside]
    assert len(columns) * size**2 == A.data.size == A.low.size
    assert A.nbytes == 4 * (A.data.size + len(columns) + 2 * 41 + 40 + len(K.indices))
    for kind, digits in ((np.float32, 1e-6), (np.float64, 1e-15)):
        x, z = rng.normal(size=(2, 40 * size)).astype(kind)
        y, factor = z.copy(), -0.5
        A.combine(factor, x, 3.0, y, y)
        scale = np.abs(dense) @ np.abs(x) + np.abs(z)
        numbers = dense if kind is np.float64 else dense.astype(np.float32)
        assert (np.abs(y - 3.0 * z - factor * numbers @ x.astype(float)) <= 40 * digits * scale).all()


def test_a_pattern_that_is_not_symmetric_is_stored_whole():
    K = matrix(30, 2)
    assert symmetric_storage(K.indptr, K.indices) is not ALL_BLOCKS
    asymmetric = K.indices.copy()
    row = next(i for i in range(30) if K.indptr[i + 1] - K.indptr[i] < 29 and K.indices[K.indptr[i]] == 0 and i > 1)
    absent = np.setdiff1d(np.arange(30), K.indices[K.indptr[row] : K.indptr[row + 1]])
    asymmetric[K.indptr[row]] = absent[0]
    asymmetric[K.indptr[row] : K.indptr[row + 1]].sort()
    assert symmetric_storage(K.indptr, asymmetric) is ALL_BLOCKS
    unsorted = K.indices.copy()
    unsorted[[0, 1]] = unsorted[[1, 0]]
    assert symmetric_storage(K.indptr, unsorted) is ALL_BLOCKS
    # Equal numbers of rows and columns, none on the diagonal of the first two.
    assert symmetric_storage(np.array([0, 1, 2], np.int32), np.array([1, 0], np.int32)) is ALL_BLOCKS
    wrong = bsr_array((K.data, asymmetric, K.indptr), shape=K.shape)
    u = np.random.default_rng(0).normal(size=60)
    np.testing.assert_allclose(ScaledMatrix(wrong, "single") @ u, wrong @ u, rtol=1e-12)


def test_an_analysis_has_the_stiffness_that_its_solver_stores(forma04):
    model = forma04(fc.generate.half_spheres("tri3", size=6.0))
    one, other = (Stepping(model, name, 1e-10, fc.Criteria()) for name in ("direct", "amg"))
    assert isinstance(one.system.matrix, bsr_array)
    assert isinstance(other.system.matrix, ScaledMatrix)
    u = np.random.default_rng(0).normal(size=model.n_dofs)
    assert np.abs(other.K @ u - (one.K @ u)).max() < 1e-13 * one.K.absolute_product(u).max()
    np.testing.assert_allclose(other.K.absolute_product(u), one.K.absolute_product(u), rtol=1e-6)


def test_columns_may_be_numbered_in_any_integers():
    K = matrix(40, 3)
    wide = bsr_array((K.data, K.indices, K.indptr), shape=K.shape)
    wide.indices, wide.indptr = K.indices.astype(np.int64), K.indptr.astype(np.int64)
    u = np.random.default_rng(0).normal(size=120)
    np.testing.assert_array_equal(ScaledMatrix(wide, "single") @ u, ScaledMatrix(K, "single") @ u)


def test_a_solver_leaves_a_matrix_that_is_not_released():
    K = matrix(60, 2)
    before = K.toarray()
    assert linear.make("amg", dim=2, n_dofs=120, tolerance=1e-10).prepare(K, np.tile(np.eye(2), (60, 1))) is K
    np.testing.assert_array_equal(K.toarray(), before)
