"""Conjugate gradients on compiled vector kernels, with all vectors set aside beforehand."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fastcontact.linear.krylov import krylov_kernels
from fastcontact.linear.krylov.iteration import Iteration

Array = NDArray[np.float64]


class ConjugateGradients(Iteration):
    """Preconditioned conjugate gradients that can stop and go on; see `Iteration`.

    Round-off of a preconditioner in single precision makes it vary a little; the search directions are therefore
    turned by what the preconditioned residual has in common with the change of the residual (Polak and Ribiere's
    formula; Notay, 2000), which costs one more dot product.
    """

    def __init__(self, n: int) -> None:
        super().__init__(n)
        self.z, self.p, self.q = (np.zeros(n) for _ in range(3))
        self._rz = self._alpha = 0.0

    @property
    def nbytes(self) -> int:
        """Memory [bytes]."""
        return 5 * self.x.nbytes + self._sums.nbytes

    def start(self) -> None:
        """See `Iteration.start`."""
        super().start()
        self._rz = 0.0

    def step(
        self, multiply: Callable[[Array, Array], None], precondition: Callable[[Array, float, Array], None]
    ) -> bool:
        """Make one iteration; return whether it could be made.

        Parameters
        ----------
        multiply : callable
            ``multiply(p, q)`` fills q with ``A p``.
        precondition : callable
            ``precondition(r, norm, z)`` fills z with an approximation of ``A^-1 r``.
        """
        precondition(self.r, self.norm, self.z)
        rz = self.dot(self.r, self.z)
        beta = 0.0
        if self._rz > 0.0:
            change = -self._alpha * self.dot(self.q, self.z)
            beta = change / self._rz
        self._rz = rz
        krylov_kernels.turn(beta, self.z, self.p)
        multiply(self.p, self.q)
        curvature = self.dot(self.p, self.q)
        if not (rz > 0.0 and curvature > 0.0):
            return False
        self._alpha = rz / curvature
        self.norm = float(np.sqrt(krylov_kernels.advance(self._alpha, self.p, self.q, self.x, self.r, self._sums)))
        return True
