"""Area vectors of facets: along their normals, as long as they are large."""

from __future__ import annotations

import numpy as np

from fastcontact.arrays import Array


def area_vectors(corners: Array, dN: Array) -> Array:
    """Return the area vectors (n, q, dim) by unit of the reference facet [length^(dim - 1)].

    To the right of a line's direction; to where a face's nodes run counter-clockwise.

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


def flat_area_vectors(corners: Array) -> Array:
    """Return the area vectors (n, dim) of lines and polygons with `corners` (n, n_corners, dim) [length^(dim - 1)]."""
    spokes = corners[:, 1:] - corners[:, :1]
    if corners.shape[2] == 2:
        return np.column_stack([spokes[:, 0, 1], -spokes[:, 0, 0]])
    return np.asarray(0.5 * np.cross(spokes[:, :-1], spokes[:, 1:]).sum(axis=1))
