"""Generalised minimal residual method (GMRES) for few unknowns or few iterations."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fastcontact.arrays import Array


def gmres(product: Callable[[Array], Array], right_side: Array, tolerance: float, most: int) -> tuple[Array, bool]:
    """Return an approximate solution x (n,) of ``A x = b`` by GMRES from x = 0, and whether it has converged.

    The function of SciPy computes the final residual by another product, which is a fifth of all products if there are four
    iterations (Saad, 2003, section 6.5).

    Parameters
    ----------
    product : Callable
        Function from a vector v (n,) to ``A v`` (n,).
    right_side : ndarray (n,)
        Vector b.
    tolerance : float
        Largest 2-norm of the residual, relative to that of b [-].
    most : int
        Largest number of iterations.

    Raises
    ------
    LinAlgError
        If A is singular.
    """
    size = float(np.linalg.norm(right_side))
    if size == 0.0:
        return np.zeros_like(right_side), True
    basis, rotations = [right_side / size], list[Array]()
    H, g = np.zeros((most + 1, most)), np.zeros(most + 1)
    g[0] = size
    for j in range(most):
        w = product(basis[j])
        for i, v in enumerate(basis):  # modified Gram-Schmidt orthogonalisation
            H[i, j] = v @ w
            w = w - H[i, j] * v
        H[j + 1, j] = np.linalg.norm(w)
        basis.append(w / (H[j + 1, j] or 1.0))
        for i, rotation in enumerate(rotations):
            H[i : i + 2, j] = rotation @ H[i : i + 2, j]
        c, s = H[j : j + 2, j] / (np.hypot(*H[j : j + 2, j]) or 1.0)
        rotations.append(np.array([[c, s], [-s, c]]))
        for vector in (H[j : j + 2, j], g[j : j + 2]):
            vector[:] = rotations[j] @ vector
        if abs(g[j + 1]) <= tolerance * size:
            break
    y = np.linalg.solve(np.triu(H[: j + 1, : j + 1]), g[: j + 1])
    return np.asarray(y @ np.stack(basis[: j + 1])), bool(abs(g[j + 1]) <= tolerance * size)
