"""Accuracy of the quadrature of the stiffness: the integral of squared gradients."""

import numpy as np
import pytest

from fastcontact.mesh import elements
from fastcontact.model.model_warnings import _traces


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
