"""What iterations on compiled vector kernels share: the iterate, its residual, dot products."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastcontact.linear.krylov import krylov_kernels

Array = NDArray[np.float64]


class Iteration:
    """An iterate and its residual.

    Parameters
    ----------
    n : int
        Number of unknowns.

    Attributes
    ----------
    x, r : ndarray (n,)
        Iterate and residual.
    norm : float
        2-norm of the residual.
    """

    def __init__(self, n: int) -> None:
        self.x, self.r = np.zeros(n), np.zeros(n)
        self._sums = np.empty(-(-n // krylov_kernels.CHUNK))
        self.norm = 0.0

    def dot(self, a: Array, b: Array) -> float:
        """Return the dot product of two vectors (n,)."""
        return float(krylov_kernels.dot(a, b, self._sums))

    def start(self) -> None:
        """Begin anew from `x` and its residual `r`, both set by the caller."""
        self.norm = float(np.sqrt(self.dot(self.r, self.r)))
