"""Anderson acceleration of a fixed-point iteration (Anderson, 1965)."""

from __future__ import annotations

import numpy as np

from fastcontact.arrays import Array, Indices
from fastcontact.round_off import LENGTH_ROUND_OFF

# Number of earlier iterates that are mixed into the next one.
DEPTH = 5


class Anderson:
    """Mixing of the last iterates of ``x = G(x)`` so that their residuals ``G(x) - x`` cancel best.

    Near a solution a linearly convergent fixed-point iteration behaves like a linear one, and mixing is equivalent to a
    Krylov method (Walker and Ni, 2011). The residual only includes the components `where`, on which the iteration depends.

    Parameters
    ----------
    depth : int
        Number of earlier iterates in the mixture.
    where : ndarray of int
        Components of x (n,) on which G depends.
    all_mixed : bool
        Whether to mix the other components as well, as needed where they serve G as an initial guess.
    """

    def __init__(self, depth: int, where: Indices, all_mixed: bool = True) -> None:
        self.depth, self.where = depth, where
        self.mixes: slice | Indices = slice(None) if all_mixed else where
        self._residuals: list[Array] = []
        self._images: list[Array] = []

    def restart(self) -> None:
        """Discard earlier iterates, for another G."""
        self._residuals.clear()
        self._images.clear()

    def mixed(self, x: Array, image: Array) -> Array:
        """Return the next iterate (n,) from the last one `x` and its image ``G(x)``, both (n,)."""
        self._residuals.append((image - x)[self.where])
        self._images.append(image[self.mixes])
        del self._residuals[: -self.depth - 1], self._images[: -self.depth - 1]
        if len(self._residuals) < 2:
            return image
        last = self._residuals[-1]
        differences = np.column_stack([last - earlier for earlier in self._residuals[:-1]])
        weights = np.linalg.lstsq(differences, last, rcond=LENGTH_ROUND_OFF)[0]
        mixture, newest = image.copy(), self._images[-1]
        for weight, earlier in zip(weights, self._images[:-1], strict=True):
            mixture[self.mixes] -= weight * (newest - earlier)
        return mixture
