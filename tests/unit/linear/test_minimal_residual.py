"""GMRES compared with that of SciPy."""

import numpy as np
import pytest
from scipy.sparse.linalg import gmres as gmres_of_scipy

from fastcontact.linear.krylov.minimal_residual import gmres


@pytest.mark.parametrize(("n", "tolerance", "most"), [(1, 1e-2, 9), (60, 1e-2, 40), (60, 1e-10, 40), (60, 1e-10, 3)])
def test_the_solution_is_that_of_scipy(n, tolerance, most):
    random = np.random.default_rng(n)
    A, b = np.eye(n) - 0.3 * random.standard_normal((n, n)) / np.sqrt(n), random.standard_normal(n)
    products = []
    x, converged = gmres(lambda v: products.append(v) or A @ v, b, tolerance, most)
    assert converged == (np.linalg.norm(A @ x - b) <= (tolerance + 1e-14) * np.linalg.norm(b)) == (most > 3)
    expected, _ = gmres_of_scipy(A, b, rtol=tolerance, atol=0.0, restart=most, maxiter=1)
    np.testing.assert_allclose(x, expected, rtol=1e-9, atol=1e-12)
    assert len(products) <= most


def test_a_singular_matrix_is_an_error():
    with pytest.raises(np.linalg.LinAlgError):
        gmres(lambda v: 0.0 * v, np.ones(3), 1e-10, 5)
