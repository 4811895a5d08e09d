"""Shape functions that are products of functions of fewer reference coordinates."""

from types import ModuleType

import numpy as np

from fastcontact.mesh.elements._element import Array, Function, Indices


def values(factors: Array) -> Array:
    """Return the products (m, n_nodes) [-] of `factors` (m, n_nodes, 3) [-], one of each coordinate."""
    return factors.prod(axis=2)


def gradients(factors: Array, slopes: Array) -> Array:
    """Return the derivatives (m, n_nodes, 3) [-] of the products.

    From the `factors` (m, n_nodes, 3) [-] and the derivative of each in its coordinate, `slopes` (m, n_nodes, 3) [-].
    """
    f, g, h = np.moveaxis(factors, 2, 0)
    df, dg, dh = np.moveaxis(slopes, 2, 0)
    return np.stack([df * g * h, f * dg * h, f * g * dh], axis=2)


def of_two(first: ModuleType, second: ModuleType, I: Indices, J: Indices) -> tuple[Function, Function]:  # noqa: E741
    """Return shape functions (m, n_nodes) [-] and derivatives (m, n_nodes, dim) [-] of a product of two elements.

    Node i has function number I[i] of the first element in the first coordinates, times number J[i] of the second in the
    others; `I` (n_nodes,) of int, `J` (n_nodes,) of int.
    """
    split = first.ELEMENT.dim

    def shape(xi: Array) -> Array:
        return np.asarray(first.shape(xi[:, :split])[:, I] * second.shape(xi[:, split:])[:, J])

    def gradient(xi: Array) -> Array:
        x, y = xi[:, :split], xi[:, split:]
        along_first = first.gradient(x)[:, I] * second.shape(y)[:, J, None]
        along_second = first.shape(x)[:, I, None] * second.gradient(y)[:, J]
        return np.concatenate([along_first, along_second], axis=2)

    return shape, gradient
