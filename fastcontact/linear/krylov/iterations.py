"""Conjugate gradient method and conjugate residual method, with compiled vector kernels.

Both methods update an iterate x and its residual r one step at a time. Between two steps, the caller can examine the iterate,
stop, or modify the problem slightly and continue.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

import numpy as np

from fastcontact._jit.parallel import parallel_for
from fastcontact.arrays import AnyArray, Array, largest
from fastcontact.linear.krylov import krylov_kernels
from fastcontact.linear.krylov.krylov_kernels import CHUNK, WORK_PER_ENTRY

# Function ``multiply(p, q)`` that fills q (n,) with ``A @ p``, and function ``precondition(r, norm, z)`` that fills z (n,)
# with an approximation of ``A^-1 r``, given the 2-norm of r.
Multiply = Callable[[Array, Array], None]
Precondition = Callable[[Array, float, Array], None]
# Number of search directions that the conjugate residual method stores. The image of a new direction is made orthogonal to
# their images. With 3, "modulus ratio 0.0001" with friction takes 57 iterations (54 with 20; `fastcontact
# bench robustness`, 3 000 unknowns).
STORED_DIRECTIONS = 20
# A step of the conjugate residual method has failed (stagnation) if the norm of the residual remains above this fraction of
# the previous norm. Without it, `test_conjugate_residuals_progress_where_the_image_of_the_residual_is_orthogonal_to_it`
# fails; with 0.5, `test_conjugate_residuals_solve_nonsymmetric_equations`.
FAILED_REDUCTION = 0.98


def scaled(factor: float, a: AnyArray, b: AnyArray) -> None:
    """Fill `b` (n,) with ``factor * a``, in the precision of b."""
    parallel_for(krylov_kernels.scaled, len(a), WORK_PER_ENTRY, factor, a, b)


class Iteration:
    """Base class of Krylov methods: an iterate and its residual.

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
        # Length and direction of the last step, and the norm of the residual before it.
        self._last_step: tuple[float, Array, float] | None = None

    def dot(self, a: Array, b: Array) -> float:
        """Return the dot product of two vectors (n,)."""
        parallel_for(krylov_kernels.dot, len(self._sums), WORK_PER_ENTRY * CHUNK, a, b, self._sums)
        return float(krylov_kernels.total(self._sums))

    def start(self) -> None:
        """Restart from `x` and its residual `r`, both set by the caller."""
        self.norm, self._last_step = float(np.sqrt(self.dot(self.r, self.r))), None

    def change_per_residual(self, n: int) -> float:
        """Return the largest change of the first n unknowns in the last step, divided by the decrease of the residual norm.

        If the rate of convergence persists, the remaining error is this ratio times the norm of the residual. The ratio
        is zero before the first step.
        """
        if self._last_step is None:
            return 0.0
        alpha, p, previous_norm = self._last_step
        return abs(alpha) * largest(p[:n]) / (previous_norm - self.norm) if self.norm < previous_norm else np.inf

    def _advance(self, alpha: float, p: Array, q: Array) -> None:
        """Update the iterate and its residual, ``x += alpha p`` and ``r -= alpha q``."""
        self._last_step = alpha, p, self.norm
        self.norm = float(np.sqrt(self._step_along(alpha, p, q, self.x, self.r)))

    def _step_along(self, alpha: float, p: Array, q: Array, x: Array, r: Array) -> float:
        """Update arbitrary vectors, ``x += alpha p`` and ``r -= alpha q``; return the square of the norm of r."""
        parallel_for(krylov_kernels.advance, len(self._sums), WORK_PER_ENTRY * CHUNK, alpha, p, q, x, r, self._sums)
        return float(krylov_kernels.total(self._sums))


class ConjugateGradients(Iteration):
    """Preconditioned conjugate gradients; see `Iteration`.

    Because of round-off, a preconditioner in single precision varies slightly from one iteration to the next. Search
    directions are therefore updated by the Polak-Ribiere formula (flexible conjugate gradients; Notay, 2000), which takes one
    more dot product.
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
        """Perform one iteration; return False, with x and r kept, if A or the preconditioner is not positive definite."""
        precondition(self.r, self.norm, self.z)
        rz = self.dot(self.r, self.z)
        beta = 0.0
        if self._rz > 0.0:
            beta = -self._alpha * self.dot(self.q, self.z) / self._rz
        self._rz = rz
        parallel_for(krylov_kernels.direction, len(self.p), WORK_PER_ENTRY, beta, self.z, self.p)
        multiply(self.p, self.q)
        curvature = self.dot(self.p, self.q)
        if not (rz > 0.0 and curvature > 0.0):
            return False
        self._alpha = rz / curvature
        self._advance(self._alpha, self.p, self.q)
        return True


class ConjugateResiduals(Iteration):
    """Preconditioned, truncated generalised conjugate residuals (Eisenstat, Elman and Schultz, 1983); see `Iteration`.

    The matrix may be nonsymmetric, and the preconditioner may vary. Each iteration minimises the norm of the residual along a
    new search direction, whose image, the product with the matrix, is made orthogonal to the stored images. Therefore, the
    norm never increases.
    """

    def __init__(self, n: int) -> None:
        super().__init__(n)
        # Pairs of a search direction p and -A p, where A p has unit norm. With this sign, `_step_along` makes vectors
        # orthogonal to A p.
        self._stored: deque[tuple[Array, Array]] = deque()
        self._unused: list[tuple[Array, Array]] = []  # memory for directions and images
        self._failed = False  # whether the last step failed, see FAILED_REDUCTION

    @property
    def nbytes(self) -> int:
        """Memory [bytes]."""
        return (4 + 2 * (len(self._stored) + len(self._unused))) * self.x.nbytes + self._sums.nbytes

    def start(self) -> None:
        """See `Iteration.start`."""
        super().start()
        self._unused += self._stored
        self._stored.clear()
        self._failed = False

    def step(self, multiply: Multiply, precondition: Precondition) -> bool:
        """Perform one iteration; return False if the new image depends linearly on the stored images, up to round-off.

        After a failed step, the preconditioner is applied to the last image instead of the residual.
        """
        z, q, norm = self.z, self.q, self.norm
        if self._failed:
            precondition(self._stored[-1][1], 1.0, z)
        else:
            precondition(self.r, norm, z)
        multiply(z, q)
        square = initial_square = self.dot(q, q)
        for direction, image in self._stored:
            square = self._step_along(self.dot(q, image), direction, image, z, q)
        if not square > np.finfo(float).eps ** 2 * initial_square:
            return False
        self._advance(self.dot(self.r, q) / square, z, q)
        self._store(z, q, float(np.sqrt(square)))
        self._failed = self.norm > FAILED_REDUCTION * norm
        return True

    def _store(self, z: Array, q: Array, size: float) -> None:
        """Store a direction and its image of norm `size`; the oldest one is replaced if STORED_DIRECTIONS are stored."""
        if len(self._stored) == STORED_DIRECTIONS:
            pair = self._stored.popleft()
        else:
            pair = self._unused.pop() if self._unused else (np.empty_like(z), np.empty_like(q))
        scaled(1.0 / size, z, pair[0])
        scaled(-1.0 / size, q, pair[1])
        self._stored.append(pair)
