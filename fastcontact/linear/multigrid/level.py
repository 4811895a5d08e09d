"""A level of the multigrid hierarchy: matrix, smoother, transfer operators, work space."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fastcontact._jit.parallel import spread
from fastcontact.arrays import AnyArray
from fastcontact.linear.elimination.elimination import Elimination
from fastcontact.linear.multigrid import cycle_kernels
from fastcontact.linear.multigrid.matrix import WORK_OF_BLOCK, WORK_OF_ROW, BlockMatrix
from fastcontact.linear.multigrid.restriction import Restriction
from fastcontact.linear.multigrid.stiffened_nodes import FreeMotions
from fastcontact.linear.springs import Springs


@dataclass(eq=False)
class Level:
    """A matrix of the hierarchy with its smoother, the transfer to the next coarser level, and work space.

    Attributes
    ----------
    A : BlockMatrix
    diagonal, inverse : ndarray (n_nodes * size * size,)
        Diagonal blocks, and their inverses for the smoother.
    bound : float
        Upper bound of the eigenvalues of ``D^-1 A``.
    P : BlockMatrix or None
        Prolongator; None on the coarsest level.
    R : Restriction or None
        Its transpose.
    eliminated : Elimination or None
        Equations on the finest level: weights in the precision of the cycle, the same for forces.
    change : tuple of ndarray, or None
        Contribution of eliminated equations and springs to the matrix on coarser levels: the block rows that change (k,), and
        the change as `indptr`, `indices` and `data` of a `BlockMatrix`.
    springs : Springs or None
        Springs on the finest level, under the equations.
    followers : Elimination or None
        Unknowns that follow the eliminated ones in corrections from coarser levels, on the finest level.
    free_motions : FreeMotions or None
        Correction of the smoother at nodes that equations stiffen strongly, on the finest level.
    b, x, r, d : ndarray (n,)
        Right-hand side, iterate, residual and step of the cycle.
    """

    A: BlockMatrix
    diagonal: AnyArray
    inverse: AnyArray
    bound: float
    P: BlockMatrix | None = None
    R: Restriction | None = None
    eliminated: Elimination | None = None
    change: tuple[AnyArray, ...] | None = None
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

    def relax(self, r: AnyArray, first: float, second: float, begin: bool = False) -> None:
        """Make a Chebyshev step: see `cycle_kernels.relax`."""
        kind = r.dtype.type
        self.scale(r, kind(first), kind(second), self.d, self.x, begin)
        if self.free_motions is not None:
            self.free_motions.correct(r, second, self.d, self.x)
        if self.eliminated is not None:
            self.eliminated.complete(self.x)

    def scale(
        self, r: AnyArray, first: np.floating, second: np.floating, d: AnyArray, x: AnyArray, begin: bool
    ) -> None:
        """Make the part of `relax` that scales by the inverse diagonal blocks, for other vectors `d` and `x`."""
        rows = self.A.rows
        spread(
            cycle_kernels.relax, self.n // len(rows), WORK_OF_BLOCK, self.inverse, r, first, second, d, x, rows, begin
        )

    def residual(self) -> None:
        """Fill `r` with ``b - A x``."""
        self.subtract_product(self.x, self.b, self.r)

    def subtract_product(self, x: AnyArray, b: AnyArray, r: AnyArray) -> None:
        """Fill `r` with ``b - A x``, eliminated equations included."""
        self.A.combine(-1.0, x, 1.0, b, r)
        if self.eliminated is not None:
            self.eliminated.move_forces(r)
        if self.springs is not None:
            self.springs.subtract_forces(x, r)
        if self.change is not None:
            numbers, indptr, indices, data = self.change
            spread(
                cycle_kernels.subtract_rows,
                len(numbers),
                WORK_OF_ROW,
                numbers,
                indptr,
                indices,
                (data,),
                x,
                r,
                self.A.rows,
            )

    def restrict(self, coarse: AnyArray) -> None:
        """Restrict the residual `r`, which is overwritten, to the right-hand side of the next coarser level."""
        assert self.R is not None
        if self.followers is not None:
            self.followers.move_forces(self.r)
        self.R.multiply(self.r, coarse)

    def correct(self, coarse: AnyArray) -> None:
        """Add the correction of the next coarser level."""
        assert self.P is not None
        if self.followers is None:
            self.P.combine(1.0, coarse, 1.0, self.x, self.x)
        else:
            pivots, W = self.followers.pivots, self.followers.weights
            beside = self.x[pivots] - W @ self.x
            self.P.combine(1.0, coarse, 1.0, self.x, self.x)
            self.x[pivots] = W @ self.x + beside
        if self.eliminated is not None:
            self.eliminated.complete(self.x)

    @property
    def nbytes(self) -> int:
        """Memory [bytes]."""
        total = self.A.nbytes + self.diagonal.nbytes + self.inverse.nbytes + 4 * self.b.nbytes
        return total + sum(A.nbytes for A in (self.P, self.R) if A is not None)
