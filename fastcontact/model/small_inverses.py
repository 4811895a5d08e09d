"""Inverses and determinants of many small matrices by their cofactors: LAPACK takes ten times as long for each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def inverses(J: Array) -> tuple[Array, Array]:
    """Return the inverses and the determinants of matrices of two or three rows.

    Parameters
    ----------
    J : ndarray (..., n, n)
        n is 2 or 3. Where a matrix is singular, its inverse has infinities or no numbers.

    Returns
    -------
    inverse : ndarray (..., n, n)
    determinant : ndarray (...,)
    """
    out = np.empty_like(J)
    if J.shape[-1] == 2:
        (a, b), (c, d) = np.moveaxis(J, (-2, -1), (0, 1))
        out[..., 0, 0], out[..., 0, 1], out[..., 1, 0], out[..., 1, 1] = d, -b, -c, a
        determinant = a * d - b * c
    else:
        rows = np.moveaxis(J, (-2, -1), (0, 1))
        for i in range(3):
            (a, b, c), (d, e, f) = rows[(i + 1) % 3], rows[(i + 2) % 3]
            out[..., 0, i], out[..., 1, i], out[..., 2, i] = b * f - c * e, c * d - a * f, a * e - b * d
        determinant = np.einsum("k...,...k->...", rows[0], out[..., 0])
    with np.errstate(divide="ignore", invalid="ignore"):
        out /= determinant[..., None, None]
    return out, determinant
