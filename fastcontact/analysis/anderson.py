"""Anderson acceleration of a fixed-point iteration (Anderson, 1965)."""

from __future__ import annotations

import numpy as np

from fastcontact.arrays import Array, Indices

# Changes of the residual that point along the same line to more than this tell nothing apart.
DEPENDENT = 1e-8


class Anderson:
    """Mixing of the last iterates of ``x = G(x)`` so that their residuals ``G(x) - x`` cancel best.

    Near a solution a fixed point iteration whose error shrinks by a factor a time behaves like a linear one; mixing
    then does what a Krylov method does (Walker and Ni, 2011). Only `where` the iteration depends on x counts in the
    residual.

    Parameters
    ----------
    depth : int
        Earlier iterates in the mixture.
    where : ndarray of int
        Components of x (n,) that G looks at.
    all_mixed : bool
        Whether the others are mixed, too; they need not be where G finds them without a first guess.
    """

    def __init__(self, depth: int, where: Indices, all_mixed: bool = True) -> None:
        self.depth, self.where = depth, where
        self.mixes: slice | Indices = slice(None) if all_mixed else where
        self._residuals: list[Array] = []
        self._images: list[Array] = []

    def restart(self) -> None:
        """Forget earlier iterates, for another G."""
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
        weights = np.linalg.lstsq(differences, last, rcond=DEPENDENT)[0]
        mixture, newest = image.copy(), self._images[-1]
        for weight, earlier in zip(weights, self._images[:-1], strict=True):
            mixture[self.mixes] -= weight * (newest - earlier)
        return mixture
