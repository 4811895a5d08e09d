"""Anderson acceleration of a fixed-point iteration (Anderson, 1965)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fastcontact.arrays import Array, Indices
from fastcontact.round_off import LENGTH_ROUND_OFF

# Number of earlier iterates that are combined with the last one.
DEPTH = 5


@dataclass(eq=False, repr=False)
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

    depth: int
    where: Indices
    all_mixed: bool = True
    # Residuals and images of the last iterates.
    _history: list[tuple[Array, Array]] = field(default_factory=list, init=False)

    def restart(self) -> None:
        """Discard the earlier iterates, because G has changed."""
        self._history.clear()

    def mixed(self, x: Array, image: Array) -> Array:
        """Return the next iterate (n,), given the last iterate `x` (n,) and its `image` G(x) (n,)."""
        mixed_components = slice(None) if self.all_mixed else self.where
        self._history.append(((image - x)[self.where], image[mixed_components]))
        del self._history[: -self.depth - 1]
        *earlier, (residual, last_image) = self._history
        if not earlier:
            return image
        differences = np.column_stack([residual - earlier_residual for earlier_residual, _ in earlier])
        weights = np.linalg.lstsq(differences, residual, rcond=LENGTH_ROUND_OFF)[0]
        mixture = image.copy()
        for weight, (_, earlier_image) in zip(weights, earlier, strict=True):
            mixture[mixed_components] -= weight * (last_image - earlier_image)
        return mixture
