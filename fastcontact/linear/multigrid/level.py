"""A level of the multigrid hierarchy: matrix, smoother, and transfer to the next coarser level."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fastcontact._jit.parallel import NODES, spread
from fastcontact.arrays import AnyArray
from fastcontact.linear.elimination.elimination import Elimination
from fastcontact.linear.multigrid import cycle_kernels
from fastcontact.linear.multigrid.matrix import WORK_OF_ROW, BlockMatrix
from fastcontact.linear.multigrid.stiffened_nodes import FreeMotions
from fastcontact.linear.springs import Springs


@dataclass(eq=False)
class Level:
    """A level of the multigrid hierarchy, with n unknowns in blocks of `size` unknowns per node.

    Attributes
    ----------
    A : BlockMatrix
        Matrix (n, n) of the level.
    diagonal, inverse : ndarray (n_nodes * size * size,)
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
        Contribution of eliminated equations and springs to the matrix, only on coarser levels: the numbers (k,) of the block
        rows that change, and the change in these rows as `indptr`, `indices` and `data` of a `BlockMatrix`.
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
    inverse: AnyArray
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
        """Return a copy without the changes by equations and springs, which shares the matrix and the transfer."""
        inverse = np.empty_like(self.inverse)
        cycle_kernels.invert_blocks(self.diagonal, len(self.A.rows), inverse)
        return Level(self.A, self.diagonal, inverse, self.bound, self.P, self.R)

    def relax(self, r: AnyArray, first: float, second: float, begin: bool = False) -> None:
        """Make one Chebyshev step for the residual r (n,), see `cycle_kernels.relax`; equations stay satisfied."""
        kind = r.dtype.type
        self.scale(r, kind(first), kind(second), self.d, self.x, begin)
        if self.free_motions is not None:
            self.free_motions.correct(r, second, self.d, self.x)
        if self.eliminated is not None:
            self.eliminated.complete(self.x)

    def scale(
        self, r: AnyArray, first: np.floating, second: np.floating, d: AnyArray, x: AnyArray, begin: bool
    ) -> None:
        """Apply `cycle_kernels.relax` to the last step `d` (n,) and the iterate `x` (n,), in place, without corrections."""
        rows = self.A.rows
        spread(cycle_kernels.relax, self.n // len(rows), NODES, self.inverse, r, first, second, d, x, rows, begin)

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
        if self.change is not None:
            spread(cycle_kernels.subtract_rows, len(self.change[0]), WORK_OF_ROW, *self.change, x, r, self.A.rows)

    def restrict(self, coarse: AnyArray) -> None:
        """Fill `coarse`, the right-hand side of the next coarser level, with the restricted residual; `r` is overwritten."""
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

    @property
    def nbytes(self) -> int:
        """Memory of the level [bytes]."""
        total = self.A.nbytes + self.diagonal.nbytes + self.inverse.nbytes + 4 * self.b.nbytes
        return total + sum(A.nbytes for A in (self.P, self.R) if A is not None)
