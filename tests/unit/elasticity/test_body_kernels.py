"""Parts of the element loop of nonlinear bodies, compared with NumPy."""

import numpy as np
import pytest

from fastcontact._jit.decorators import kernel
from fastcontact.elasticity.tile_product import tile, tile_plain


@kernel
def of_tile(left, left_row, left_column, right, right_row, column, n, out, row, overwrite):
    tile(left, left_row, left_column, right, right_row, column, n, out, row, overwrite)


@pytest.mark.parametrize("overwrite", [False, True])
@pytest.mark.parametrize("n", [0, 1, 3, 24])
def test_a_tile_is_changed_and_nothing_around_it(n, overwrite):
    rng = np.random.default_rng(n)
    left, right, out = rng.normal(size=(n + 3, 12)), rng.normal(size=(n + 2, 8)), rng.normal(size=(9, 12))
    right[:2], left[:1] = np.nan, np.nan  # not read
    expected = out.copy()
    tile_plain(left, 1, 8, right[:, :], 2, 4, n, expected, 3, overwrite)
    of_tile(left, 1, 8, right, 2, 4, n, out, 3, overwrite)
    assert np.abs(out - expected).max() < 1e-13
    inside = np.zeros(out.shape, bool)
    inside[3:7, 4:8] = True
    assert np.array_equal(out[~inside], expected[~inside])
