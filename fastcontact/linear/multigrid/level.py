"""Levels of the multigrid hierarchy, with matrix, smoother and transfer operators, and the solver of the coarsest level.

Let A be the matrix of a level, D its diagonal blocks, and `bound` an upper bound of the eigenvalues of ``D^-1 A``. The
smoother is a Chebyshev iteration, preconditioned by D, that reduces the components of the error that belong to eigenvalues
between ``SMOOTHED_FRACTION * bound`` and `bound` (Adams, Brezina, Hu and Tuminaro, 2003). Unlike those of the Gauss-Seidel
method, its results do not depend on the number of threads. `Level.relax` performs one step.

On the coarsest level, the inverse of the matrix is computed. If the matrix is large because aggregation stopped early, it is
factorised by SuperLU instead.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import splu

from fastcontact._jit.parallel import NODES_PER_CELL, parallel_for
from fastcontact.arrays import AnyArray, mask_at
from fastcontact.linear.elimination.elimination import Elimination
from fastcontact.linear.multigrid import cycle_kernels
from fastcontact.linear.multigrid.matrix import BlockMatrix
from fastcontact.linear.multigrid.stiffened_nodes import FreeMotions
from fastcontact.linear.springs import Springs
from fastcontact.round_off import ROUND_OFF

# Number of Lanczos steps for the largest eigenvalue, and safety factor of its estimate. With 3 Lanczos steps, the
# base case of `fastcontact bench robustness` (3 000 unknowns, with friction) takes 1 028 iterations (22 with 8); without the
# factor, "tet4" takes 28 (15 with 1.08).
LANCZOS_STEPS = 8
SAFETY_FACTOR = 1.08
# Ratio of the lower to the upper end of the interval of eigenvalues that is smoothed, and number of Chebyshev steps. In the
# same benchmark, with a ratio of 1/4 "nu 0.499" takes 144 iterations, and 163 with 2 steps (109 with 1/24 and 3 steps); with
# 1/240 the base case takes 37 (16 with 1/24).
SMOOTHED_FRACTION = 1 / 24
DEGREE = 3
# Largest number of unknowns of a level that is not coarsened further and whose inverse is computed. With 20, the
# numbers of iterations in the same benchmark differ by at most two.
COARSEST_SIZE = 200


@dataclass(eq=False)
class Level:
    """A level of the multigrid hierarchy, with n unknowns in blocks of `size` unknowns per node.

    Attributes
    ----------
    A : BlockMatrix
        Matrix (n, n) of the level.
    diagonal, inverse_diagonal : ndarray (n_nodes * size * size,)
        Diagonal blocks D of the matrix, and their inverses for the smoother.
    bound : float
        Upper bound of the eigenvalues of ``D^-1 A`` [-].
    P : BlockMatrix or None
        Prolongator from the next coarser level; None on the coarsest level.
    R : BlockMatrix or None
        The transpose of P.
    eliminated : Elimination or None
        Eliminated equations, only on the finest level. The weights are stored in the precision of the cycle.
    change : tuple of ndarray, or None
        Change of the matrix by eliminated equations and springs, only on coarser levels: the numbers (k,) of the block rows
        that change, and these rows of the change as `indptr`, `indices` and `data` of a `BlockMatrix`.
    springs : Springs or None
        Springs that are added to the matrix after the elimination of equations, only on the finest level.
    followers : Elimination or None
        Unknowns that follow the eliminated ones in corrections from coarser levels, see `stiffened_nodes`; only on the finest
        level.
    free_motions : FreeMotions or None
        Correction of the smoother at nodes that equations stiffen strongly, see `stiffened_nodes`; only on the finest level.
    b, x, r, d : ndarray (n,)
        Right-hand side, iterate, residual, and last step of the smoother.
    """

    A: BlockMatrix
    diagonal: AnyArray
    inverse_diagonal: AnyArray
    bound: float
    P: BlockMatrix | None = None
    R: BlockMatrix | None = None
    eliminated: Elimination | None = None
    change: tuple[Any, ...] | None = None
    springs: Springs | None = None
    followers: Elimination | None = None
    free_motions: FreeMotions | None = None
    b: AnyArray = field(init=False)
    x: AnyArray = field(init=False)
    r: AnyArray = field(init=False)
    d: AnyArray = field(init=False)

    def __post_init__(self) -> None:
        n = (len(self.A.indptr) - 1) * len(self.A.rows)
        self.b, self.x, self.r, self.d = (np.zeros(n, self.A.data.dtype) for _ in range(4))

    @property
    def n(self) -> int:
        """Number of unknowns."""
        return len(self.b)

    def without_equations(self) -> Level:
        """Return a copy without equations and springs, which shares the matrix and the transfer operators."""
        inverse_diagonal = np.empty_like(self.inverse_diagonal)
        cycle_kernels.invert_blocks(self.diagonal, len(self.A.rows), inverse_diagonal)
        return Level(self.A, self.diagonal, inverse_diagonal, self.bound, self.P, self.R)

    def relax(
        self, r: AnyArray, step_factor: float, residual_factor: float, d: AnyArray, x: AnyArray, from_zero: bool = False
    ) -> None:
        """Update the iterate `x` (n,) by a Chebyshev step for the residual r (n,), and set its eliminated unknowns.

        The factors, those of `chebyshev`, multiply the last step `d` (n,), which is updated, and the preconditioned residual.
        """
        rows, factors = self.A.rows, map(r.dtype.type, (step_factor, residual_factor))
        arguments = self.inverse_diagonal, r, *factors, d, x, rows, from_zero
        parallel_for(cycle_kernels.relax, self.n // len(rows), NODES_PER_CELL, *arguments)
        if self.free_motions is not None:
            self.free_motions.correct(r, residual_factor, d, x)
        if self.eliminated is not None:
            self.eliminated.complete(x)

    def residual(self) -> None:
        """Fill `r` with ``b - A x``."""
        self.subtract_product(self.x, self.b, self.r)

    def subtract_product(self, x: AnyArray, b: AnyArray, r: AnyArray) -> None:
        """Fill `r` (n,) with ``b - A x``, where A includes the effects of eliminated equations and springs."""
        self.A.combine(-1.0, x, 1.0, b, r)
        if self.eliminated is not None:
            self.eliminated.move_forces(r)
        if self.springs is not None:
            self.springs.subtract_forces(x, r)
        if (change := self.change) is not None:
            parallel_for(cycle_kernels.subtract_rows, len(change[0]), self.A.work_of_row, *change, x, r, self.A.rows)

    def restrict(self, coarse: AnyArray) -> None:
        """Fill `coarse`, the right-hand side of the next coarser level, with the restricted residual; `r` may be changed."""
        assert self.R is not None
        if self.followers is not None:
            self.followers.move_forces(self.r)
        self.R.multiply(self.r, coarse)

    def correct(self, coarse: AnyArray) -> None:
        """Add the prolongated correction `coarse` of the next coarser level to `x`."""
        assert self.P is not None
        if self.followers is None:
            self.P.combine(1.0, coarse, 1.0, self.x, self.x)
        else:
            pivots, W = self.followers.pivots, self.followers.weights
            deviation = self.x[pivots] - W @ self.x
            self.P.combine(1.0, coarse, 1.0, self.x, self.x)
            self.x[pivots] = W @ self.x + deviation
        if self.eliminated is not None:
            self.eliminated.complete(self.x)

    def largest_eigenvalue(self) -> float:
        """Return an estimate of the largest eigenvalue of ``D^-1 A`` from below, by the Lanczos method.

        The tridiagonal matrix of the Lanczos method follows from the coefficients of the conjugate gradient method with the
        preconditioner D (Golub and Van Loan, Matrix Computations, 2013, section 11.3).
        """
        r = np.random.default_rng(0).normal(size=self.n).astype(self.b.dtype)
        z, q, p = np.empty_like(r), np.empty_like(r), np.zeros_like(r)
        scratch, zero = np.empty_like(r), np.zeros_like(r)
        if self.eliminated is not None:
            self.eliminated.move_forces(r)
        diagonal, off_diagonal = [], []
        old_alpha, beta, rz = 1.0, 0.0, 0.0
        real = r.dtype.type
        for step in range(min(LANCZOS_STEPS, self.n)):
            self.relax(r, 0.0, 1.0, scratch, z, True)
            new_rz = float(r @ z)
            if not new_rz > ROUND_OFF * abs(rz):
                break
            beta = new_rz / rz if step else 0.0
            rz = new_rz
            p = z + real(beta) * p
            self.subtract_product(p, zero, q)
            q *= -1
            alpha = rz / float(p @ q)
            diagonal.append(1 / alpha + beta / old_alpha)
            off_diagonal.append(np.sqrt(beta) / old_alpha)
            r -= real(alpha) * q
            old_alpha = alpha
        T = np.diag(diagonal) + np.diag(off_diagonal[1:], 1) + np.diag(off_diagonal[1:], -1)
        return float(np.linalg.eigvalsh(T).max()) if diagonal else 1.0

    @property
    def nbytes(self) -> int:
        """Memory of the level [bytes]."""
        total = self.A.nbytes + self.diagonal.nbytes + self.inverse_diagonal.nbytes + 4 * self.b.nbytes
        return total + sum(A.nbytes for A in (self.P, self.R) if A is not None)


def chebyshev(bound: float, degree: int = DEGREE) -> list[tuple[float, float]]:
    """Return the coefficients of `degree` Chebyshev steps for eigenvalues between ``SMOOTHED_FRACTION * bound`` and `bound`.

    The coefficients of a step multiply the last step and the preconditioned residual, see `cycle_kernels.relax`.
    """
    centre, half_width = 0.5 * (1 + SMOOTHED_FRACTION) * bound, 0.5 * (1 - SMOOTHED_FRACTION) * bound
    factors = [(0.0, 1.0 / centre)]
    rho = half_width / centre
    for _ in range(1, degree):
        new_rho = 1.0 / (2.0 * centre / half_width - rho)
        factors.append((new_rho * rho, 2.0 * new_rho / half_width))
        rho = new_rho
    return factors


class CoarseLevel:
    """Direct solver for a symmetric positive semidefinite matrix; unknowns without stiffness are set to zero.

    Parameters
    ----------
    A : csc_array (n, n)

    Attributes
    ----------
    matrix : csc_array (n, n)
        The matrix A, without the change that `factorise` adds.
    """

    def __init__(self, A: csc_array) -> None:
        self.n, self.matrix = A.shape[0], A
        self._lu: Any = None
        self._inverse = np.empty((self.n, self.n) if self.n <= COARSEST_SIZE else 0)
        self._changed = True
        self.factorise(None)

    @property
    def nbytes(self) -> int:
        """Memory of the inverse or of the factors [bytes]."""
        return self._inverse.nbytes if self._lu is None else 12 * int(self._lu.nnz)

    def factorise(self, change: csc_array | None) -> None:
        """Factorise or invert the sum of the matrix and the symmetric matrix `change` (n, n); None means zero."""
        if change is None and not self._changed:
            return
        self._changed = change is not None
        A = self.matrix if change is None else csc_array(self.matrix + change)
        if self.n <= COARSEST_SIZE:
            cycle_kernels.invert_blocks(A.toarray().ravel(), self.n, self._inverse.reshape(-1))
            return
        diagonal = A.diagonal()
        self._unstiffened = np.flatnonzero(diagonal <= ROUND_OFF * diagonal.max())
        active = 1.0 - mask_at(self._unstiffened, self.n)
        K = diags_array(active) @ A @ diags_array(active) + diags_array(1.0 - active)
        self._lu = splu(csc_array(K), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})

    def solve(self, b: AnyArray, x: AnyArray) -> None:
        """Fill `x` (n,) with the solution for the right-hand side `b` (n,)."""
        if self._lu is None:
            x[:] = self._inverse @ b
            return
        x[:] = self._lu.solve(b.astype(float))
        x[self._unstiffened] = 0.0
