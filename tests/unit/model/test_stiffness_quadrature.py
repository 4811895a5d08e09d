"""How exact the quadrature of the stiffness is, judged without inverses: the integral of squared gradients."""

import numpy as np
import pytest

from fastcontact.mesh import elements
from fastcontact.model.model_warnings import _cofactors, _traces


@pytest.mark.parametrize("size", [2, 3])
def test_cofactors_are_the_transposed_inverse_times_the_determinant(size):
    J = np.random.default_rng(1).normal(size=(4, 5, size, size))
    expected = np.swapaxes(np.linalg.inv(J), 2, 3) * np.linalg.det(J)[..., None, None]
    assert np.allclose(_cofactors(J), expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", ["tri3", "quad8", "tet4", "hex8", "wedge6"])
def test_the_integral_of_squared_gradients_is_that_of_gradients_in_space(name):
    element = elements.get(name)
    xi, weights = element.quadrature
    corners = element.nodes + 0.1 * np.random.default_rng(2).normal(size=(3, *element.nodes.shape))
    expected = []
    for x in corners:
        J = np.einsum("qnk,nd->qkd", element.gradient(xi), x)
        gradients = np.linalg.solve(J, np.swapaxes(element.gradient(xi), 1, 2))
        expected.append(((gradients**2).sum(axis=(1, 2)) * np.abs(np.linalg.det(J))) @ weights)
    assert np.allclose(_traces(corners, element, xi, weights), expected, rtol=1e-12)


def test_a_cell_without_volume_has_no_such_integral():
    element = elements.get("quad4")
    flat = element.nodes * [1.0, 0.0]
    with np.errstate(all="ignore"):
        assert np.isnan(_traces(flat[None], element, *element.quadrature)).all()
