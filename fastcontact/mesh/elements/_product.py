"""Shape functions that are products of one factor in each of the three reference coordinates."""

import numpy as np

from fastcontact.mesh.elements._element import Array


def values(factors: Array) -> Array:
    """Return the products (m, n_nodes) of `factors` (m, n_nodes, 3)."""
    return factors.prod(axis=2)


def gradients(factors: Array, slopes: Array) -> Array:
    """Return the derivatives (m, n_nodes, 3) of the products; `slopes` are those of the factors."""
    f, g, h = np.moveaxis(factors, 2, 0)
    df, dg, dh = np.moveaxis(slopes, 2, 0)
    return np.stack([df * g * h, f * dg * h, f * g * dh], axis=2)
