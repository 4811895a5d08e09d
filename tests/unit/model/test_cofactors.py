"""Inverses by cofactors against NumPy's."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastcontact.model.small_inverses import inverses


@pytest.mark.parametrize("n", [2, 3])
@given(seed=st.integers(0, 2**32 - 1), shape=st.sampled_from([(), (5,), (2, 3)]))
def test_inverses_and_determinants_are_those_of_numpy(n, seed, shape):
    J = np.random.default_rng(seed).normal(size=(*shape, n, n)) + 3 * np.eye(n)
    inverse, determinant = inverses(J)
    scale = np.linalg.cond(J)[..., None, None]
    assert (np.abs(inverse @ J - np.eye(n)) < 1e-13 * scale).all()
    np.testing.assert_allclose(determinant, np.linalg.det(J), rtol=0, atol=1e-12 * np.abs(J).max() ** n)


def test_a_singular_matrix_has_no_inverse_and_no_warning():
    inverse, determinant = inverses(np.zeros((2, 2, 2)))
    assert not np.isfinite(inverse).any()
    assert (determinant == 0.0).all()
