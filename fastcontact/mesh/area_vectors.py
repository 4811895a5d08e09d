"""Area vectors of facets: normals whose length is the area."""

from __future__ import annotations

import numpy as np

from fastcontact.arrays import Array


def area_vectors(corners: Array, dN: Array) -> Array:
    """Return the area vectors (n, q, dim) per unit of the reference facet [length^(dim - 1)].

    They point to the right of a line's direction, and to the side from which a face's nodes run counter-clockwise.

    Parameters
    ----------
    corners : ndarray (n, k, dim)
        Nodes of facets of one kind [length].
    dN : ndarray (q, k, dim - 1)
        Derivatives of their shape functions [-].
    """
    along = np.einsum("qkj,nkd->nqdj", dN, corners)
    if corners.shape[2] == 2:
        return np.stack([along[..., 1, 0], -along[..., 0, 0]], axis=-1)
    return np.cross(along[..., 0], along[..., 1])


def weighted_area_vectors(
    corners: Array, N: Array, dN: Array, weights: Array, shares: Array, turned: bool
) -> tuple[Array, Array]:
    """Return integrals of the area vectors of facets, and their derivatives w.r.t. the nodes (Bonet and Wood, 2008, 8.5).

    Parameters
    ----------
    corners : ndarray (n, k, dim)
        Nodes of facets of one kind [length].
    N, dN : ndarray (q, k), ndarray (q, k, dim - 1)
        Their shape functions and derivatives [-].
    weights : ndarray (n, q)
        Weights of the quadrature, times additional integrands.
    shares : ndarray (q, k)
        Weight functions of the k integrals for each facet [-].
    turned : bool
        Whether to integrate over the full circle, the radius being the first coordinate.

    Returns
    -------
    vectors : ndarray (n, k, dim)
        Integrals [area].
    derivative : ndarray (n, k, dim, k, dim)
        Derivative with respect to the nodes, whose indices come last [length].
    """
    normal = area_vectors(corners, dN)
    by_node = np.zeros((*normal.shape[:2], dN.shape[1], corners.shape[2], corners.shape[2]))
    if corners.shape[2] == 2:
        by_node[..., 0, 1], by_node[..., 1, 0] = dN[:, :, 0], -dN[:, :, 0]
    else:
        first, second = np.einsum("qkj,nkd->jnqd", dN, corners)
        for j, unit in enumerate(np.eye(3)):
            by_node[..., j] = np.cross(unit, second)[:, :, None] * dN[:, :, 0, None]
            by_node[..., j] += np.cross(first, unit)[:, :, None] * dN[:, :, 1, None]
    if turned:
        circle = 2.0 * np.pi * corners[:, :, 0] @ N.T
        by_node *= circle[..., None, None, None]
        by_node[..., 0] += 2.0 * np.pi * np.einsum("qb,fqi->fqbi", N, normal)
        normal = normal * circle[..., None]
    vectors = np.einsum("fq,qa,fqi->fai", weights, shares, normal)
    return vectors, np.einsum("fq,qa,fqbij->faibj", weights, shares, by_node)


def flat_area_vectors(corners: Array) -> Array:
    """Return the area vectors (n, dim) of lines and polygons with `corners` (n, n_corners, dim) [length^(dim - 1)]."""
    spokes = corners[:, 1:] - corners[:, :1]
    if corners.shape[2] == 2:
        return np.column_stack([spokes[:, 0, 1], -spokes[:, 0, 0]])
    return np.asarray(0.5 * np.cross(spokes[:, :-1], spokes[:, 1:]).sum(axis=1))
