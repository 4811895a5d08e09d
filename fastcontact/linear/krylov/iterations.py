"""Conjugate gradient method and conjugate residual method, with compiled vector kernels.

Both methods update an iterate x and its residual r one step at a time, so that the caller can examine the iterate, stop, or
modify the problem slightly and continue.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np

from fastcontact._jit.norms_kernels import largest
from fastcontact._jit.parallel import spread
from fastcontact.arrays import AnyArray, Array
from fastcontact.linear.krylov import krylov_kernels
from fastcontact.linear.krylov.krylov_kernels import CHUNK, WORK_OF_NUMBER

# Function ``multiply(p, q)`` that fills q (n,) with ``A @ p``, and function ``precondition(r, norm, z)`` that fills z (n,)
# with an approximation of ``A^-1 r``, given the 2-norm of r.
Multiply = Callable[[Array, Array], None]
Precondition = Callable[[Array, float, Array], None]
# Number of earlier search directions of the conjugate residual method to which a new one is made orthogonal.
KEPT = 20
# A step of the conjugate residual method fails if the norm of the residual stays above this fraction of the last one.
LOST = 0.98


def scaled(factor: float, a: AnyArray, b: AnyArray) -> None:
    """Fill `b` (n,) with ``factor * a``, in the precision of b."""
    spread(krylov_kernels.scaled, len(a), WORK_OF_NUMBER, factor, a, b)


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
        self.x, self.r, self.z, self.q = (np.zeros(n) for _ in range(4))
        self._sums = np.empty(-(-n // CHUNK))
        self.norm = 0.0
        self._moved: tuple[float, Array, float] | None = None  # length and direction of the last step, residual before

    def dot(self, a: Array, b: Array) -> float:
        """Return the dot product of two vectors (n,)."""
        spread(krylov_kernels.dot, len(self._sums), WORK_OF_NUMBER * CHUNK, a, b, self._sums)
        return float(krylov_kernels.total(self._sums))

    def start(self) -> None:
        """Restart from `x` and its residual `r`, both set by the caller."""
        self.norm, self._moved = float(np.sqrt(self.dot(self.r, self.r))), None

    def change(self, n: int) -> float:
        """Return the largest change of the first n unknowns in the last step, over the fall of the residual; 0 without one.

        At the same rate of convergence, the product with the residual is the error that is left.
        """
        if self._moved is None:
            return 0.0
        alpha, p, before = self._moved
        return abs(alpha) * largest(p[:n]) / (before - self.norm) if self.norm < before else np.inf

    def _advance(self, alpha: float, p: Array, q: Array) -> None:
        """Step ``x += alpha p``, ``r -= alpha q``."""
        self._moved = alpha, p, self.norm
        self.norm = float(np.sqrt(self._stepped(alpha, p, q, self.x, self.r)))

    def _stepped(self, alpha: float, p: Array, q: Array, x: Array, r: Array) -> float:
        """Step ``x += alpha p``, ``r -= alpha q``; return the square of the norm of r."""
        spread(krylov_kernels.advance, len(self._sums), WORK_OF_NUMBER * CHUNK, alpha, p, q, x, r, self._sums)
        return float(krylov_kernels.total(self._sums))


class ConjugateGradients(Iteration):
    """Preconditioned conjugate gradients; see `Iteration`.

    Round-off of a preconditioner in single precision makes it slightly variable; the search directions are therefore updated
    with the Polak-Ribiere formula (flexible conjugate gradients; Notay, 2000), which costs one more dot product.
    """

    def __init__(self, n: int) -> None:
        super().__init__(n)
        self.p = np.zeros(n)
        self._rz = self._alpha = 0.0

    @property
    def nbytes(self) -> int:
        """Memory [bytes]."""
        return 5 * self.x.nbytes + self._sums.nbytes

    def start(self) -> None:
        """See `Iteration.start`."""
        super().start()
        self._rz = 0.0

    def step(self, multiply: Multiply, precondition: Precondition) -> bool:
        """Make one iteration; return False, without changes, if the preconditioner or A is not positive definite."""
        precondition(self.r, self.norm, self.z)
        rz = self.dot(self.r, self.z)
        beta = 0.0
        if self._rz > 0.0:
            change = -self._alpha * self.dot(self.q, self.z)
            beta = change / self._rz
        self._rz = rz
        spread(krylov_kernels.turn, len(self.p), WORK_OF_NUMBER, beta, self.z, self.p)
        multiply(self.p, self.q)
        curvature = self.dot(self.p, self.q)
        if not (rz > 0.0 and curvature > 0.0):
            return False
        self._alpha = rz / curvature
        self._advance(self._alpha, self.p, self.q)
        return True


class ConjugateResiduals(Iteration):
    """Preconditioned generalised conjugate residuals, truncated (Eisenstat, Elman and Schultz, 1983); see `Iteration`.

    For nonsymmetric matrices. Every iteration minimises the residual over the stored directions, so it never grows; the
    preconditioner may vary.
    """

    def __init__(self, n: int) -> None:
        super().__init__(n)
        # Directions of unit image, and the negative of their images, so that `advance` orthogonalises.
        self._kept: deque[tuple[Array, Array]] = deque()
        self._spare: list[tuple[Array, Array]] = []
        self._lost = False  # whether the last step failed

    @property
    def nbytes(self) -> int:
        """Memory [bytes]."""
        return (4 + 2 * (len(self._kept) + len(self._spare))) * self.x.nbytes + self._sums.nbytes

    def start(self) -> None:
        """See `Iteration.start`."""
        super().start()
        self._spare += self._kept
        self._kept.clear()
        self._lost = False

    def step(self, multiply: Multiply, precondition: Precondition) -> bool:
        """Make one iteration; return False if no direction reduces the residual."""
        z, q, norm = self.z, self.q, self.norm
        if self._lost:
            precondition(self._kept[-1][1], 1.0, z)
        else:
            precondition(self.r, norm, z)
        multiply(z, q)
        square = before = self.dot(q, q)
        for direction, image in self._kept:
            square = self._stepped(self.dot(q, image), direction, image, z, q)
        if not square > np.finfo(float).eps ** 2 * before:
            return False
        self._advance(self.dot(self.r, q) / square, z, q)
        self._keep(z, q, float(np.sqrt(square)))
        self._lost = self.norm > LOST * norm
        return True

    def _keep(self, z: Array, q: Array, size: float) -> None:
        """Store a direction and its image, of norm `size`, replacing the oldest one when full."""
        if len(self._kept) == KEPT:
            pair = self._kept.popleft()
        else:
            pair = self._spare.pop() if self._spare else (np.empty_like(z), np.empty_like(q))
        scaled(1.0 / size, z, pair[0])
        scaled(-1.0 / size, q, pair[1])
        self._kept.append(pair)
