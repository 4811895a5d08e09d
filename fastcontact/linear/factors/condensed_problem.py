"""K condensed to the contact unknowns: solutions by a dense inverse, without the other unknowns."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from fastcontact.linear.flexibility import balanced, symmetric
from fastcontact.linear.protocol import Monitor

Array = NDArray[np.float64]


class CondensedProblem:
    """See `linear.protocol.Loaded`; all its vectors are those of the k contact unknowns.

    Parameters
    ----------
    inverse : ndarray (k, k)
        Rows and columns of ``K^-1``, symmetric [length / force].
    free : ndarray (k,)
        Displacement without equations [length].
    """

    def __init__(self, inverse: Array, free: Array) -> None:
        self._inverse, self._free = inverse, free

    def solve(
        self, B: csr_array, c: Array, C: Array | None = None, guess: Array | None = None,
        monitor: Monitor | None = None, tolerance: float | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """See `Loaded`."""
        if B.shape[0] == 0:
            return self._free, np.empty(0)
        moved = B @ self._inverse
        multiplier = balanced(symmetric(B @ moved.T), c - B @ self._free, C)
        return self._free + multiplier @ moved, multiplier

    def flexibility(self, R: csr_array) -> tuple[Array, Array]:
        """See `Loaded`."""
        return R @ self._free, symmetric(R @ (R @ self._inverse).T)

    def involved_solution(self, force: Array, elsewhere: Array | None) -> Array:
        """See `Loaded`."""
        return np.asarray(self._free + self._inverse @ force)

    def full_solution(self, force: Array, u: Array | None = None) -> Array:
        """See `Loaded`."""
        return self.involved_solution(force, None)

    def condensed(self) -> CondensedProblem:
        """See `Loaded`."""
        return self
