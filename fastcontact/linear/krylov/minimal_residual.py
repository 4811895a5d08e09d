"""Generalised minimal residual method (GMRES) for few unknowns or few iterations."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fastcontact.arrays import Array


def gmres(product: Callable[[Array], Array], b: Array, tolerance: float, max_iterations: int) -> tuple[Array, bool]:
    """Return an approximate solution x (n,) of ``A x = b``, and whether GMRES has converged (Saad, 2003, section 6.5).

    The initial guess is zero. Unlike this function, that of SciPy computes the final residual by an additional product with
    A, which is a fifth of all products if there are four iterations.

    Parameters
    ----------
    product : Callable
        Function from a vector v (n,) to ``A v`` (n,).
    b : ndarray (n,)
        Right-hand side.
    tolerance : float
        Largest 2-norm of the residual, relative to that of b [-].
    max_iterations : int
        Largest number of iterations.

    Raises
    ------
    LinAlgError
        If A is singular.
    """
    norm = float(np.linalg.norm(b))
    if norm == 0.0:
        return np.zeros_like(b), True
    basis, rotations = [b / norm], list[Array]()
    H, g = np.zeros((max_iterations + 1, max_iterations)), np.zeros(max_iterations + 1)
    g[0] = norm
    for j in range(max_iterations):
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
        if abs(g[j + 1]) <= tolerance * norm:
            break
    y = np.linalg.solve(np.triu(H[: j + 1, : j + 1]), g[: j + 1])
    return np.asarray(y @ np.stack(basis[: j + 1])), bool(abs(g[j + 1]) <= tolerance * norm)
