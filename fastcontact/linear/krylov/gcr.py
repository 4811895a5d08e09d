"""Generalised conjugate residuals: a flexible iteration for matrices that are not symmetric."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fastcontact.linear.krylov import krylov_kernels
from fastcontact.linear.krylov.iteration import Iteration

Array = NDArray[np.float64]
# Search directions that a new one is made orthogonal to; older ones are forgotten.
KEPT = 20


class ConjugateResiduals(Iteration):
    """Preconditioned generalised conjugate residuals, truncated (Eisenstat, Elman and Schultz, 1983); see `Iteration`.

    Every iteration makes the residual as small as the directions kept allow, so it never grows; the preconditioner may
    vary. Directions are set aside as they are needed.
    """

    def __init__(self, n: int) -> None:
        super().__init__(n)
        self._z, self._q = np.zeros(n), np.zeros(n)
        # Directions of unit image, and their images turned round: what is taken from both has the same sign then.
        self._kept: list[tuple[Array, Array]] = []
        self._made = 0

    @property
    def nbytes(self) -> int:
        """Memory [bytes]."""
        return (4 + 2 * len(self._kept)) * self.x.nbytes + self._sums.nbytes

    def start(self) -> None:
        """See `Iteration.start`."""
        super().start()
        self._made = 0

    def step(
        self, multiply: Callable[[Array, Array], None], precondition: Callable[[Array, float, Array], None]
    ) -> bool:
        """Make one iteration; return whether there was a direction to go; see `ConjugateGradients.step`."""
        z, q = self._z, self._q
        precondition(self.r, self.norm, z)
        multiply(z, q)
        square = before = self.dot(q, q)
        for direction, image in self._kept[: min(self._made, KEPT)]:
            square = krylov_kernels.advance(self.dot(q, image), direction, image, z, q, self._sums)
        if not square > np.finfo(float).eps ** 2 * before:
            return False
        self.norm = float(
            np.sqrt(krylov_kernels.advance(self.dot(self.r, q) / square, z, q, self.x, self.r, self._sums))
        )
        self._keep(z, q, float(np.sqrt(square)))
        return True

    def _keep(self, z: Array, q: Array, size: float) -> None:
        at = self._made % KEPT
        if at == len(self._kept):
            self._kept.append((np.empty_like(z), np.empty_like(q)))
        direction, image = self._kept[at]
        krylov_kernels.scaled(1.0 / size, z, direction)
        krylov_kernels.scaled(-1.0 / size, q, image)
        self._made += 1
