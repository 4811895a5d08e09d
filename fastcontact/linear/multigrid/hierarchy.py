"""Smoothed-aggregation multigrid: hierarchy and V-cycle.

Neighbouring nodes form aggregates. The columns of the tentative prolongator that belong to an aggregate are the rigid-body
modes, restricted to its nodes. The tentative prolongator is smoothed by one step of the block Jacobi method (Vanek, Mandel
and Brezina, 1996), and the coarse matrix is the Galerkin product. On each level, a Chebyshev iteration is the smoother (see
`level`).

Two functions of pyamg are used: `standard_aggregation` forms the aggregates, and `fit_candidates` computes an orthonormal
basis of the rigid-body modes of each aggregate. For comparison, `linear.solvers.pyamg` uses the complete multigrid method of
pyamg.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import DTypeLike
from scipy.sparse import csr_matrix

from fastcontact._jit.parallel import parallel_for
from fastcontact.arrays import Array, Numbers
from fastcontact.linear.multigrid import cycle_kernels, galerkin_kernels
from fastcontact.linear.multigrid.level import COARSEST_SIZE, SAFETY_FACTOR, CoarseLevel, Level, chebyshev
from fastcontact.linear.multigrid.matrix import ALL_BLOCKS, BlockMatrix, pointers


class Hierarchy:
    """Multigrid hierarchy of a symmetric positive definite matrix.

    Parameters
    ----------
    A : BlockMatrix
        Matrix (n, n) of square blocks with ``len(A.rows)`` unknowns. The cycle has the precision of its `data`; the set-up
        uses double precision.
    modes : ndarray (n, n_modes)
        Rigid-body modes, which span the near null space; zero at supported unknowns.

    Attributes
    ----------
    n : int
        Number of unknowns of the finest level.
    levels : list of Level
        Levels, beginning with the finest.
    coarse : CoarseLevel
        Direct solver of the coarsest level.
    """

    def __init__(self, A: BlockMatrix, modes: Array) -> None:
        self.dtype: DTypeLike = A.data.dtype
        self.n = (len(A.indptr) - 1) * len(A.rows)
        self.levels: list[Level] = []
        while True:
            level = self._level(A)
            self.levels.append(level)
            coarser = self._coarsen(A, level, modes) if level.n > COARSEST_SIZE else None
            if coarser is None:
                break
            level.P, level.R, A, modes = coarser
            del coarser
        self.coarse = CoarseLevel(A.to_scipy().tocsc())
        # Bounds without the constraint equations and springs that `ConstrainedHierarchy` may add to the levels.
        self._bounds_without_equations = [level.bound for level in self.levels]
        self.set_bounds()

    def renewed(self, A: BlockMatrix) -> Hierarchy | None:
        """Return a hierarchy with a new finest level for a matrix A of the same pattern, and with the present coarser levels.

        Its cycle is a symmetric preconditioner of A, and its set-up costs a fifth of that of a complete hierarchy. The result
        is None if there are no coarser levels, or if A has a different precision.
        """
        if len(self.levels) == 1 or A.data.dtype != self.dtype:
            return None
        new, finest = copy.copy(self), self._level(A)
        finest.P, finest.R = self.levels[0].P, self.levels[0].R
        new.levels = [finest, *(level.without_equations() for level in self.levels[1:])]
        new.coarse = CoarseLevel(self.coarse.matrix)
        new._bounds_without_equations = [finest.bound, *self._bounds_without_equations[1:]]
        new.set_bounds()
        return new

    def _level(self, A: BlockMatrix) -> Level:
        """Return the level of a matrix, without transfer operators."""
        size = len(A.rows)
        matrix = replace(A, data=A.data.astype(self.dtype, copy=False), low=None)
        diagonal = matrix.diagonal_part(matrix.data)
        inverse_diagonal = np.empty_like(diagonal)
        cycle_kernels.invert_blocks(diagonal, size, inverse_diagonal)
        level = Level(matrix, diagonal, inverse_diagonal, 1.0)
        level.bound = SAFETY_FACTOR * level.largest_eigenvalue()
        return level

    def _coarsen(
        self, A: BlockMatrix, level: Level, modes: Array
    ) -> tuple[BlockMatrix, BlockMatrix, BlockMatrix, Array] | None:
        """Return the prolongator, its transpose, the coarse matrix and its modes; None if aggregation stagnates."""
        from pyamg.aggregation.aggregate import standard_aggregation
        from pyamg.aggregation.tentative import fit_candidates

        size, n_nodes = len(A.rows), len(A.indptr) - 1
        aggregates, _ = standard_aggregation(graph(A))
        n_coarse, n_modes = aggregates.shape[1], modes.shape[1]
        if not 0 < n_coarse * n_modes < level.n:
            return None
        T, coarse_modes = fit_candidates(aggregates, modes)
        aggregate = np.full(n_nodes, -1, np.int32)
        member = np.flatnonzero(np.diff(aggregates.indptr))
        aggregate[member] = aggregates.indices
        tentative = np.zeros((n_nodes, size * n_modes))
        tentative[member] = T.data.reshape(len(member), -1)
        del T
        omega = 4.0 / 3.0 / (level.bound / SAFETY_FACTOR)
        cols = (0,) * n_modes
        neighbours = csr_matrix((np.ones(len(A.indices), bool), A.indices, A.indptr), shape=(n_nodes, n_nodes))
        pattern = neighbours @ aggregates.astype(bool)
        pattern.sort_indices()
        # The prolongator is stored in the precision of the cycle before the coarse matrix is computed, so that the latter is
        # the Galerkin product with the prolongator that the cycle uses.
        columns, blocks = pattern.indices, np.empty(pattern.nnz * size * n_modes, self.dtype)
        parallel_for(
            galerkin_kernels.smooth_prolongator, n_nodes, A.work_of_row, A.indptr, A.indices, A.storage, A.exact_data,
            level.inverse_diagonal, aggregate, tentative.ravel(), omega, pattern.indptr, columns, blocks, A.rows, cols,
        )  # fmt: skip
        del tentative
        P = BlockMatrix(pattern.indptr, columns, blocks, A.rows, cols)
        columns_of_P = column_pattern(P, n_coarse)
        return P, transposed(P, columns_of_P), galerkin_product(A, P, columns_of_P), coarse_modes

    def __repr__(self) -> str:
        sizes = " -> ".join(str(level.n) for level in self.levels)
        return f"{len(self.levels)} levels, unknowns {sizes}, operator complexity {self.complexity:.2f}"

    @property
    def complexity(self) -> float:
        """Operator complexity: entries of the matrices of all levels, relative to those of the finest level [-]."""
        entries = [len(level.A.indices) * len(level.A.rows) ** 2 for level in self.levels]
        return sum(entries) / entries[0]

    @property
    def nbytes(self) -> int:
        """Memory of the hierarchy [bytes]."""
        return sum(level.nbytes for level in self.levels) + self.coarse.nbytes

    @property
    def bounds(self) -> list[float]:
        """Upper bounds of the eigenvalues of ``D^-1 A`` that the smoothers assume, by level [-]."""
        return [level.bound for level in self.levels]

    @bounds.setter
    def bounds(self, values: Sequence[float]) -> None:
        for level, bound in zip(self.levels, values, strict=True):
            level.bound = bound
        self._factors = [chebyshev(bound) for bound in values]

    def set_bounds(self, estimated: bool = False) -> None:
        """Set the bounds of the smoothers to those without eliminated constraint equations and springs.

        If `estimated` is true, bounds are also estimated for the current matrices, and used if they are larger.
        """
        self.bounds = [
            max(bound, SAFETY_FACTOR * level.largest_eigenvalue()) if estimated and level.P is not None else bound
            for level, bound in zip(self.levels, self._bounds_without_equations, strict=True)
        ]

    def cycle(self, index: int = 0) -> None:
        """Apply one V-cycle, beginning at ``levels[index]``, with a zero initial guess.

        The right-hand side is ``levels[index].b``, and the result is stored in ``levels[index].x``.
        """
        level = self.levels[index]
        if level.P is None:
            self.coarse.solve(level.b, level.x)
            return
        factors = self._factors[index]
        level.relax(level.b, *factors[0], level.d, level.x, True)
        for factor in factors[1:]:
            level.residual()
            level.relax(level.r, *factor, level.d, level.x)
        level.residual()
        coarser = self.levels[index + 1]
        level.restrict(coarser.b)
        self.cycle(index + 1)
        level.correct(coarser.x)
        for factor in factors:
            level.residual()
            level.relax(level.r, *factor, level.d, level.x)


def graph(A: BlockMatrix) -> csr_matrix:
    """Return the graph (n_nodes, n_nodes) of a symmetric matrix A, with positive entries for nonzero off-diagonal blocks."""
    n_nodes, (start, columns) = len(A.indptr) - 1, (A.indptr, A.indices) if A.storage is ALL_BLOCKS else A.storage[:3:2]
    rows = np.repeat(np.arange(n_nodes), np.diff(start))
    coupled = A.data.reshape(-1, len(A.rows) ** 2).any(axis=1) & (columns != rows)
    ones = np.ones(int(coupled.sum()), np.int8)
    stored = csr_matrix((ones, (rows[coupled], columns[coupled])), shape=(n_nodes, n_nodes))
    return stored + stored.T.tocsr()


def column_pattern(P: BlockMatrix, n_columns: int) -> tuple[Numbers, Numbers, Numbers]:
    """Return the pattern of P by columns.

    Returns
    -------
    start : ndarray of int (n_columns + 1,)
        Offsets of the block columns.
    rows : ndarray of int (n_blocks,)
        Row of each block, in ascending order within a column.
    blocks : ndarray of int (n_blocks,)
        Index of each block in P.
    """
    blocks = np.arange(len(P.indices), dtype=np.int32)
    columns = csr_matrix((blocks, P.indices, P.indptr), shape=(len(P.indptr) - 1, n_columns)).tocsc()
    return columns.indptr, columns.indices, columns.data


def transposed(P: BlockMatrix, columns_of_P: tuple[Numbers, Numbers, Numbers]) -> BlockMatrix:
    """Return the transpose of P; `columns_of_P` is ``column_pattern(P, n_columns)``."""
    blocks = P.data.reshape(-1, len(P.rows), len(P.cols))[columns_of_P[2]].transpose(0, 2, 1)
    return BlockMatrix(*columns_of_P[:2], blocks.ravel(), P.cols, P.rows)


def galerkin_product(A: BlockMatrix, P: BlockMatrix, columns_of_P: tuple[Numbers, Numbers, Numbers]) -> BlockMatrix:
    """Return the Galerkin product ``P.T A P`` for symmetric A; `columns_of_P` is ``column_pattern(P, n_columns)``."""
    n_coarse = len(columns_of_P[0]) - 1
    count, fine_count = np.zeros(n_coarse, np.int32), np.zeros(n_coarse, np.int32)
    work = len(A.indices) / max(1, n_coarse)
    patterns = A.indptr, A.indices, P.indptr, P.indices, *columns_of_P[:2]
    parallel_for(galerkin_kernels.count_galerkin, n_coarse, work, *patterns, count, fine_count)
    indptr = pointers(count)
    columns = np.empty(indptr[-1], np.int32)
    out = np.zeros(int(indptr[-1]) * len(P.cols) ** 2)
    parallel_for(
        galerkin_kernels.galerkin, n_coarse, work, A.indptr, A.indices, A.storage, A.exact_data, P.indptr, P.indices, P.data,
        *columns_of_P, indptr, int(fine_count.max(initial=0)), columns, out, P.rows, P.cols,
    )  # fmt: skip
    return BlockMatrix(indptr, columns, out, P.cols, P.cols)
