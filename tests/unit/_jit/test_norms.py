import numpy as np
import pytest

from fastcontact._jit.norms_kernels import largest, largest_difference


@pytest.mark.parametrize("n", [0, 1, 7, 1000])
def test_largest_difference_is_that_of_numpy(n):
    x, y = np.random.default_rng(n).normal(size=(2, n))
    assert largest_difference(x, y) == np.abs(x - y).max(initial=0.0)


@pytest.mark.parametrize("values", [[], [3.0], [-4.0, 3.0], [1.0, np.nan], [-np.inf, 2.0], [-1.0, -2.0]])
def test_largest_is_that_of_numpy(values):
    assert largest(np.array(values)) == pytest.approx(np.abs(values).max(initial=0.0), rel=0, abs=0, nan_ok=True)


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_no_number_is_not_passed_over(bad):
    x, y = np.ones(9), np.zeros(9)
    x[4] = bad
    assert not np.isfinite(largest_difference(x, y))
    y[4] = bad  # the difference of infinities is none
    assert np.isnan(largest_difference(x, y))
