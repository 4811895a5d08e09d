"""Parts of the element loop of nonlinear bodies, compared with NumPy."""

import numpy as np
import pytest

from fastcontact._jit.decorators import kernel
from fastcontact.elasticity.tile_product import tile, tile_plain


@kernel
def of_tile(left, first, b, right, second, a, n, out, row, fresh):
    tile(left, first, b, right, second, a, n, out, row, fresh)


@pytest.mark.parametrize("fresh", [False, True])
@pytest.mark.parametrize("n", [0, 1, 3, 24])
def test_a_tile_is_changed_and_nothing_around_it(n, fresh):
    rng = np.random.default_rng(n)
    left, right, out = rng.normal(size=(n + 3, 12)), rng.normal(size=(n + 2, 8)), rng.normal(size=(9, 12))
    right[:2], left[:1] = np.nan, np.nan  # not read
    expected = out.copy()
    tile_plain(left, 1, 8, right[:, :], 2, 4, n, expected, 3, fresh)
    of_tile(left, 1, 8, right, 2, 4, n, out, 3, fresh)
    assert np.abs(out - expected).max() < 1e-13
    inside = np.zeros(out.shape, bool)
    inside[3:7, 4:8] = True
    assert np.array_equal(out[~inside], expected[~inside])
