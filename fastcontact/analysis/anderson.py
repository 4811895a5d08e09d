"""Anderson acceleration of a fixed-point iteration (Anderson, 1965)."""

from __future__ import annotations

import numpy as np

from fastcontact.arrays import Array, Indices
from fastcontact.round_off import LENGTH_ROUND_OFF

# Number of earlier iterates that are combined with the last one.
DEPTH = 5


class Anderson:
    """Anderson acceleration of the fixed-point iteration ``x = G(x)``.

    The next iterate is the affine combination of the last images G(x) for which the same combination of the residuals
    ``G(x) - x`` has the smallest norm. Near a solution the iteration is nearly linear, and the method is equivalent to a
    Krylov method (Walker and Ni, 2011). The residual only includes the components `where`.

    Parameters
    ----------
    depth : int
        Number of earlier iterates in the combination.
    where : ndarray of int
        Components of x (n,) on which G depends.
    all_mixed : bool
        Whether the other components are combined as well. This is required if G uses them as an initial guess.
    """

    def __init__(self, depth: int, where: Indices, all_mixed: bool = True) -> None:
        self.depth, self.where = depth, where
        self.mixes: slice | Indices = slice(None) if all_mixed else where
        self._residuals: list[Array] = []
        self._images: list[Array] = []

    def restart(self) -> None:
        """Discard the earlier iterates, because G has changed."""
        self._residuals.clear()
        self._images.clear()

    def mixed(self, x: Array, image: Array) -> Array:
        """Return the next iterate (n,), given the last iterate `x` (n,) and its `image` G(x) (n,)."""
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
