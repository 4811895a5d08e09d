"""Area vectors of facets, which are normals whose length is the area."""

from __future__ import annotations

import numpy as np

from fastcontact.arrays import Array
from fastcontact.round_off import TINY


def unit_vectors(vectors: Array) -> Array:
    """Return unit vectors (..., dim) along vectors (..., dim), zero along those that vanish."""
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), TINY))


def area_vectors(x: Array, dN: Array) -> Array:
    """Return the area vectors (n, q, dim) per unit of the reference facet [length^(dim - 1)].

    The vector of a line points to the right of its direction. That of a face points to the side from which its nodes are
    counter-clockwise.

    Parameters
    ----------
    x : ndarray (n, k, dim)
        Positions of the nodes of facets of one element type [length].
    dN : ndarray (q, k, dim - 1)
        Derivatives of the shape functions at q points [-].
    """
    tangents = np.einsum("qkj,nkd->nqdj", dN, x)
    if x.shape[2] == 2:
        return np.asarray(tangents[..., ::-1, 0] * (1.0, -1.0))
    return np.cross(tangents[..., 0], tangents[..., 1])


def weighted_area_vectors(
    x: Array, N: Array, dN: Array, weights: Array, test: Array, axisymmetric: bool
) -> tuple[Array, Array]:
    """Return integrals of area vectors times test functions, and their derivatives with respect to the nodal positions.

    The derivatives are those of a following pressure (Bonet and Wood, 2008, section 8.5).

    Parameters
    ----------
    x : ndarray (n, k, dim)
        Positions of the nodes of facets of one element type [length].
    N, dN : ndarray (q, k), ndarray (q, k, dim - 1)
        Shape functions of the facets and their derivatives [-].
    weights : ndarray (n, q)
        Weights of the quadrature, times additional integrands.
    test : ndarray (q, k)
        Test functions of the k integrals for each facet [-].
    axisymmetric : bool
        Whether to integrate over the full circle, where the radius is the first coordinate.

    Returns
    -------
    vectors : ndarray (n, k, dim)
        Integrals [area].
    derivative : ndarray (n, k, dim, k, dim)
        Derivatives, with the node and the component of the position as the last two indices [length].
    """
    normal = area_vectors(x, dN)
    derivative = np.zeros((*normal.shape[:2], dN.shape[1], x.shape[2], x.shape[2]))
    if x.shape[2] == 2:
        derivative[..., 0, 1], derivative[..., 1, 0] = dN[:, :, 0], -dN[:, :, 0]
    else:
        first, second = np.einsum("qkj,nkd->jnqd", dN, x)
        for j, unit in enumerate(np.eye(3)):
            derivative[..., j] = np.cross(unit, second)[:, :, None] * dN[:, :, 0, None]
            derivative[..., j] += np.cross(first, unit)[:, :, None] * dN[:, :, 1, None]
    if axisymmetric:
        circle = 2.0 * np.pi * x[:, :, 0] @ N.T
        derivative *= circle[..., None, None, None]
        derivative[..., 0] += 2.0 * np.pi * np.einsum("qb,fqi->fqbi", N, normal)
        normal = normal * circle[..., None]
    vectors = np.einsum("fq,qa,fqi->fai", weights, test, normal)
    return vectors, np.einsum("fq,qa,fqbij->faibj", weights, test, derivative)


def flat_area_vectors(corners: Array) -> Array:
    """Return the area vectors (n, dim) of lines and polygons with `corners` (n, n_corners, dim) [length^(dim - 1)]."""
    arms = corners[:, 1:] - corners[:, :1]
    if corners.shape[2] == 2:
        return np.column_stack([arms[:, 0, 1], -arms[:, 0, 0]])
    return np.asarray(0.5 * np.cross(arms[:, :-1], arms[:, 1:]).sum(axis=1))
