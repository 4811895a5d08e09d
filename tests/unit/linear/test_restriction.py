"""Products with a transposed prolongator that is stored once."""

import numpy as np
import pytest
from pairwise import first_of
from scipy.sparse import csr_array

from fastcontact._jit import decorators, parallel
from fastcontact.linear.multigrid import restriction
from fastcontact.linear.multigrid.matrix import BlockMatrix
from fastcontact.linear.multigrid.restriction import Restriction


def prolongator(rows, columns, m, n, dtype, spread):
    """Return blocks near the diagonal, or anywhere; some rows without any."""
    rng = np.random.default_rng(3)
    near = np.abs(np.arange(rows)[:, None] * columns / rows - np.arange(columns)) < 2.0
    pattern = csr_array(((rng.random((rows, columns)) < 0.1) if spread else near) & (rng.random((rows, 1)) < 0.9))
    data = rng.normal(size=(pattern.nnz, m, n)).astype(dtype)
    indptr, indices = pattern.indptr.astype(np.int32), pattern.indices.astype(np.int32)
    P = BlockMatrix(indptr, indices, data.ravel(), (0,) * m, (0,) * n)
    dense = np.zeros((rows, m, columns, n))
    dense[np.repeat(np.arange(rows), np.diff(indptr)), :, indices] = data
    return P, dense.reshape(rows * m, columns * n)


@pytest.mark.parametrize("spread", [False, True])
@pytest.mark.parametrize(
    ("dtype", "m", "n"),
    first_of(
        2,
        [
            (np.float32, 2, 3),
            *((dtype, m, n) for m, n in ((3, 6), (6, 6), (1, 1)) for dtype in (np.float64, np.float32)),
        ],
    ),
)
def test_products_are_those_of_the_transpose_on_any_number_of_threads(dtype, m, n, spread, monkeypatch):
    monkeypatch.setattr(restriction, "SHORTEST", 20)
    monkeypatch.setattr(parallel, "WORTHWHILE", 100)
    P, dense = prolongator(500, 60, m, n, dtype, spread)
    R, x = Restriction(P), np.random.default_rng(0).normal(size=500 * m).astype(dtype)
    threads, found = decorators.threads(), []
    try:
        for count in (1, 2):
            decorators.set_threads(count)
            found.append(np.full(60 * n, np.nan, dtype))
            R.multiply(x, found[-1])
    finally:
        decorators.set_threads(threads)
    assert np.array_equal(*found)
    bound = np.finfo(dtype).eps * 60 * (np.abs(dense.T) @ np.abs(x))
    assert (np.abs(found[0] - dense.T @ x) <= bound).all()
    assert R.nbytes <= (25 * 60 if spread else 60 + 25 * 5) * n * np.dtype(dtype).itemsize


def test_few_rows_are_one_part():
    P, dense = prolongator(40, 6, 3, 6, np.float64, spread=False)
    x, y = np.ones(120), np.empty(36)
    Restriction(P).multiply(x, y)
    np.testing.assert_allclose(y, dense.T @ x, atol=1e-13)
    assert Restriction(P).nbytes == 8 * 36
