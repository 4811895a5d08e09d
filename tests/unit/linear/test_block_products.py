"""Products of small blocks by vector instructions, compared with NumPy."""

import numpy as np
import pytest
from pairwise import first_of

from fastcontact._jit.decorators import kernel
from fastcontact.linear.multigrid import block_products

pytestmark = pytest.mark.each_value  # each case compiles its kernels

SIZES = first_of(5, [(1, 1), (2, 3), (3, 6), (6, 6), (4, 5), (1, 3), (2, 2), (3, 2), (3, 3), (6, 3), (2, 7)])


@kernel
def row_times(indices, numbers, x, begin, end, rows, cols):
    return block_products.row_times(indices, numbers, x, begin, end, rows, cols)


@kernel
def row_times_both_ways(indices, numbers, x, begin, end, own, factor, y, rows):
    return block_products.row_times_both_ways(indices, numbers, x, begin, end, own, factor, y, rows)


@kernel
def add_product(to, at, left, first, right, second, sizes):
    block_products.add_product(to, at, left, first, right, second, sizes)


@kernel
def add_transposed(to, at, left, first, right, second, sizes):
    block_products.add_transposed(to, at, left, first, right, second, sizes)


def surrounded(numbers, low, high):
    """Return the numbers from `low` to `high`, and no numbers around them."""
    found = np.full(len(numbers), np.nan, numbers.dtype)
    found[low:high] = numbers[low:high]
    return found


@pytest.mark.parametrize(("precision", "split"), [(np.float32, False), (np.float64, False), (np.float64, True)])
@pytest.mark.parametrize(("m", "n"), SIZES)
def test_a_row_times_a_vector(m, n, precision, split):
    rng = np.random.default_rng(m + 10 * n)
    indices, x = rng.permutation(9).astype(np.int32), rng.normal(size=9 * n).astype(precision)
    kind = np.float32 if split else precision
    numbers = tuple(rng.normal(size=9 * m * n).astype(kind) for _ in range(1 + split))
    size = np.abs(np.asarray(numbers)).max() * np.abs(x).max() * 9 * n
    for begin, end in ((0, 9), (0, 1), (8, 9), (3, 7), (4, 4)):
        given = tuple(surrounded(part, begin * m * n, end * m * n) for part in numbers)
        met = np.where(np.isin(np.repeat(np.arange(9), n), indices[begin:end]), x, np.nan).astype(precision)
        found = row_times(indices, given, met, begin, end, (0,) * m, (0,) * n)
        expected = block_products.row_times_plain(indices, given, met, begin, end, (0,) * m, (0,) * n)
        assert len(found) == m
        np.testing.assert_allclose(found, expected, rtol=0, atol=np.finfo(precision).eps * size)
        exact = [part.astype(float).reshape(9, m, n) for part in numbers]
        blocks = np.sum(exact, axis=0)[begin:end]
        np.testing.assert_allclose(
            found, np.einsum("kmn,kn->m", blocks, x.astype(float).reshape(9, n)[indices[begin:end]]),
            rtol=0, atol=np.finfo(precision).eps * size,
        )  # fmt: skip


@pytest.mark.parametrize(("precision", "split"), [(np.float32, False), (np.float64, False), (np.float64, True)])
@pytest.mark.parametrize("m", first_of(3, [2, 3, 6, 1, 4, 5, 7]))
def test_a_row_and_its_transpose_times_a_vector(m, precision, split):
    rng, rows = np.random.default_rng(m), (0,) * m
    indices = rng.permutation(9).astype(np.int32)
    x, y = rng.normal(size=(2, 9 * m)).astype(precision)
    kind = np.float32 if split else precision
    numbers = tuple(rng.normal(size=9 * m * m).astype(kind) for _ in range(1 + split))
    bound = np.finfo(precision).eps * np.abs(np.asarray(numbers)).max() * np.abs(x).max() * 9 * m
    factor = precision(-0.75)
    for begin, end in ((0, 9), (0, 1), (8, 9), (3, 7), (4, 4)):
        given = tuple(surrounded(part, begin * m * m, end * m * m) for part in numbers)
        own = int(indices[begin - 1])  # a row beside the columns, or one of them
        columns = np.repeat(np.arange(9), m)
        met = np.where(np.isin(columns, indices[begin:end]) | (columns == own), x, np.nan).astype(precision)
        into = np.where(np.isin(columns, indices[begin:end]), y, np.nan).astype(precision)
        found, expected = into.copy(), into.copy()
        sums = row_times_both_ways(indices, given, met, begin, end, own, factor, found, rows)
        plain = block_products.row_times_both_ways_plain(indices, given, met, begin, end, own, factor, expected, rows)
        np.testing.assert_allclose(sums, plain, rtol=0, atol=bound)
        np.testing.assert_allclose(found, expected, rtol=0, atol=bound)
        blocks = np.sum([part.astype(float).reshape(9, m, m) for part in numbers], axis=0)[begin:end]
        exact = np.full(9 * m, np.nan)
        exact.reshape(9, m)[indices[begin:end]] = y.reshape(9, m)[indices[begin:end]] + np.einsum(
            "kmn,m->kn", blocks, -0.75 * x.astype(float)[own * m : (own + 1) * m]
        )
        np.testing.assert_allclose(found, exact, rtol=0, atol=bound)


@pytest.mark.parametrize("split", [False, True])
@pytest.mark.parametrize("precision", [np.float32, np.float64])
@pytest.mark.parametrize(("m", "n"), SIZES)
@pytest.mark.parametrize("k", first_of(2, [3, 6, 1, 2]))
def test_products_that_are_added(m, k, n, precision, split):
    rng = np.random.default_rng(m + 10 * n + 100 * k)
    sizes = (0,) * m, (0,) * k, (0,) * n
    left = tuple(rng.normal(size=5 + m * k).astype(np.float32 if split else np.float64) for _ in range(1 + split))
    right, to = rng.normal(size=7 + k * n).astype(precision), rng.normal(size=4 + m * n)
    left = tuple(surrounded(part, 3, 3 + m * k) for part in left)
    right = surrounded(right, 2, 2 + k * n)
    exact = np.sum([part[3 : 3 + m * k].astype(float) for part in left], axis=0)
    B = right[2 : 2 + k * n].reshape(k, n).astype(float)
    for compiled, plain, A in (
        (add_product, block_products.add_product_plain, exact.reshape(m, k)),
        (add_transposed, block_products.add_transposed_plain, exact.reshape(k, m).T),
    ):
        found, expected = to.copy(), to.copy()
        compiled(found, 1, left, 3, right, 2, sizes)
        plain(expected, 1, left, 3, right, 2, sizes)
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-14 * k)
        np.testing.assert_array_equal(found[[0, *range(1 + m * n, 4 + m * n)]], to[[0, *range(1 + m * n, 4 + m * n)]])
        np.testing.assert_allclose(found[1 : 1 + m * n], to[1 : 1 + m * n] + (A @ B).ravel(), rtol=0, atol=1e-14 * k)
