"""Linear system with supports and multi-point constraints eliminated: ``u = T v + t``.

T is the identity except for the displacements that multi-point constraints express in terms of others, t are the prescribed
displacements. The matrix of the solver is ``T.T K T``. It has the size and blocks of K: in the rows and columns of eliminated
components only the diagonal remains.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.sparse import bsr_array, csr_array, diags_array

from fastcontact._jit.norms_kernels import largest
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.elasticity.multipoint_constraints import Elimination, MultiPointConstraint, eliminate, stacked_rows
from fastcontact.errors import ModelError
from fastcontact.round_off import ROUND_OFF

# Relative tolerance of the conditions under which supports and constraints are consistent.
CONFLICT = 1e-9


@dataclass(frozen=True, eq=False)
class Stiffness:
    """A stiffness matrix as the sum of `parts` (n, n) [force / length].

    Without multi-point constraints there are two parts: the matrix of the linear solver, and the rows and columns of
    supports that were removed from it.
    """

    parts: tuple[Any, ...]

    def __matmul__(self, u: Array) -> Array:
        total = np.asarray(self.parts[0] @ u)
        for matrix in self.parts[1:]:
            total += matrix @ u
        return total

    def row_sums(self, u: Array) -> Array:
        """Return ``|K| |u|``, shape (n,), summed over the parts, which bounds the round-off of ``K u`` [force]."""
        return np.sum([_row_sums(matrix, u) for matrix in self.parts], axis=0)


def _row_sums(K: Any, u: Array) -> Array:
    return np.asarray(abs(K) @ np.abs(u) if isinstance(K, csr_array | bsr_array) else K.row_sums(u))


class ConstrainedMotion:
    """The displacements that supports and constraints allow, ``u = T v + t``.

    Parameters
    ----------
    fixed : ndarray of bool (n,)
    relations : sequence of MultiPointConstraint

    Attributes
    ----------
    free : ndarray of bool (n,)
        The unknowns v.
    T : csr_array (n, n) or None
        None without multi-point constraints.
    """

    T: csr_array | None = None

    def __init__(self, fixed: Mask, relations: Sequence[MultiPointConstraint]) -> None:
        self.fixed, self.relations = fixed, list(relations)
        self.free: Mask = ~fixed
        if not relations:
            return
        self._elimination: Elimination = eliminate(stacked_rows(relations, len(fixed)), fixed)
        self.free[self._elimination.pivots] = False
        T = csr_array(self._elimination.T @ diags_array(self.free.astype(float)))
        T.eliminate_zeros()
        self.T = T

    def values(self, multiplier: Sequence[float]) -> Array:
        """Return the right-hand sides (m,) of the constraints, given the load multiplier of each."""
        blocks = [
            np.full(relation.rows.shape[0], np.asarray(relation.value) * factor)
            for relation, factor in zip(self.relations, multiplier, strict=True)
        ]
        return np.concatenate(blocks) if blocks else np.empty(0)

    def lift(self, prescribed: Array, values: Array) -> Array:
        """Return t (n,) for prescribed displacements (n,) and right-hand sides (m,) of the constraints [length].

        Raises
        ------
        ModelError
            If constraints and supports contradict each other.
        """
        known: Array = np.where(self.fixed, prescribed, 0.0)
        if not self.relations:
            return known
        values_of_dofs = np.concatenate([known, values])
        off = np.abs(self._elimination.conditions @ values_of_dofs)
        scale = np.abs(self._elimination.conditions) @ np.abs(values_of_dofs)
        wrong = np.flatnonzero(off > CONFLICT * scale)
        if len(wrong):
            raise ModelError(
                f"{self._name(int(self._elimination.origin[wrong[0]]))} contradicts the supports, or constraints stated "
                f"before it, by {off[wrong[0]]:.3g}: remove one of them"
            )
        lift: Array = self._elimination.T @ known + self._elimination.S @ values
        return lift

    def _name(self, row: int) -> str:
        ends = np.cumsum([relation.rows.shape[0] for relation in self.relations])
        return self.relations[int(np.searchsorted(ends, row, side="right"))].name


class System(ConstrainedMotion):
    """Stiffness, supports and multi-point constraints of a model.

    Parameters
    ----------
    K : bsr_array (n, n)
        Stiffness [force / length]; rows and columns of supports are removed from this array.
    supported : ndarray of bool (n,)
        Displacement components that are prescribed.
    relations : sequence of MultiPointConstraint
    without_stiffness : ndarray of bool (n,), optional
        Components that are free although they have no stiffness, such as those of rigid obstacles; none by default.

    Attributes
    ----------
    K : Stiffness
        Stiffness including the rows and columns of supports.
    matrix : bsr_array (n, n), or its replacement by the linear solver
        Matrix of the linear solver [force / length].
    fixed : ndarray of bool (n,)
        Supported components, and those of points without stiffness or constraint, which stay at zero.
    free : ndarray of bool (n,)
        The unknowns.
    weightless : ndarray of bool (n,)
        Unknowns without stiffness: components of rigid obstacles, motions of bodies that constraints make rigid.
    """

    def __init__(
        self,
        K: bsr_array,
        supported: Mask,
        relations: Sequence[MultiPointConstraint] = (),
        without_stiffness: Mask | None = None,
    ) -> None:
        R = stacked_rows(relations, K.shape[0])
        related = np.zeros(K.shape[0], bool)
        related[R.indices] = True
        if without_stiffness is None:
            without_stiffness = np.zeros(K.shape[0], bool)
        diagonal = K.diagonal()
        super().__init__(supported | ((diagonal == 0.0) & ~related & ~without_stiffness), relations)
        self._reacting: Mask = self.fixed | related  # supports and constraints may exert forces here
        self._independent, self._without_stiffness = self.free, without_stiffness
        self._set_stiffness(K, diagonal)

    def renewed(self, K: bsr_array) -> System:
        """Return the system with another stiffness K (n, n), which is modified in place, as by the constructor."""
        system = copy.copy(self)
        system._set_stiffness(K, K.diagonal())
        return system

    def _set_stiffness(self, K: bsr_array, diagonal_of_K: Array) -> None:
        """Set the stiffness K (n, n), given its diagonal (n,)."""
        self.free = self._independent.copy()
        if self.T is None:
            self.K = Stiffness(supports_apart(K, self.fixed))
            self.matrix = self.K.parts[0]
            self.weightless: Mask = self.free & (diagonal_of_K == 0.0)
        else:
            self.K = Stiffness((K,))
            transformed = (self.T.T @ csr_array(K) @ self.T).tobsr(K.blocksize)
            transformed.sort_indices()
            diagonal = transformed.diagonal()
            # The transformed diagonal without the terms between different components, which may cancel.
            uncancelled = self.T.multiply(self.T).T @ diagonal_of_K
            # Excludes points without stiffness that constraints couple only with each other.
            self.free &= (uncancelled > 0.0) | self._without_stiffness
            self.weightless = self.free & (diagonal <= ROUND_OFF * uncancelled)
            self.matrix = supports_apart(transformed, ~self.free)[0]
        self._no_unknowns = np.flatnonzero(~self.free)

    def keep(self, matrix: Any) -> None:
        """Replace `matrix` by the return value of `LinearSolver.prepare`."""
        if self.K.parts[0] is self.matrix:
            self.K = Stiffness((matrix, *self.K.parts[1:]))
        self.matrix = matrix

    def right(self, f: Array, t: Array) -> Array:
        """Return the right-hand side (n,) of the solver for forces `f` (n,) on all displacements [force]."""
        # Without constraints t only holds displacements of supports, which load the unknowns through the removed
        # columns.
        return self.reduced(f - (self.K.parts[1] if self.T is None else self.K) @ t)

    def reduced(self, force: Array) -> Array:
        """Return the forces (n,) on the unknowns that do the same work as `force` (n,) on all displacements."""
        return self._of_unknowns(force.copy() if self.T is None else self.T.T @ force)

    def _of_unknowns(self, values: Array) -> Array:
        """Set to zero, in place, the values (n,) of components that are not unknowns."""
        values[self._no_unknowns] = 0.0
        return values

    def rows(self, rows: csr_array, offset: Array, t: Array) -> tuple[csr_array, Array]:
        """Return ``rows @ u + offset``, rows (m, n) and offset (m,), as rows and offset for the unknowns v."""
        offset = offset + rows @ t
        rows = rows.copy() if self.T is None else csr_array(rows @ self.T)
        rows.data[~self.free[rows.indices]] = 0.0
        rows.eliminate_zeros()
        return rows, offset

    def displacement(self, v: Array, t: Array) -> Array:
        """Return all displacements u (n,) [length]."""
        return (v if self.T is None else self.T @ v) + t

    def unknowns(self, u: Array, t: Array | float = 0.0) -> Array:
        """Return v (n,) of displacements u (n,) that satisfy the constraints."""
        return self._of_unknowns(u - t)

    def unknowns_of(self, motions: Array) -> Array:
        """Return the unknowns (n, k) of motions (n, k) that satisfy supports and constraints."""
        return np.where(self.free[:, None], motions, 0.0)

    def involved(self, dofs: Indices) -> Indices:
        """Return the unknowns on which the displacements `dofs` depend, ascending."""
        if self.T is not None:
            dofs = np.unique(self.T[dofs].indices)
        return dofs[self.free[dofs]].astype(np.intp)

    def balance(self, out: Array, round_off: Array | None = None) -> tuple[Array, float]:
        """Return the forces (n,) of supports and constraints, and the residual, the largest force on an unknown.

        `out` (n,) are the internal minus all other forces [force]. Forces up to the `round_off` (n,) of `out` do not count
        as residual.
        """
        residual = self.reduced(out)
        if round_off is not None:
            residual = np.maximum(np.abs(residual) - (round_off if self.T is None else abs(self.T).T @ round_off), 0.0)
        return np.where(self._reacting, out, 0.0), largest(residual)


def supports_apart(K: bsr_array, fixed: Mask) -> tuple[bsr_array, csr_array]:
    """Remove the rows and columns of supported degrees of freedom from K (n, n), in place.

    Returns
    -------
    matrix : bsr_array (n, n)
        K without these rows and columns, except for the diagonal.
    taken : csr_array (n, n)
        The removed entries: the original K minus `matrix`.
    """
    K = _with_diagonal(K)
    diagonal, size = K.diagonal(), K.blocksize[0]
    pivots = np.where(diagonal > 0, diagonal, diagonal.max(initial=1.0)).reshape(-1, size)
    supported, row = fixed.reshape(-1, size), np.repeat(np.arange(len(K.indptr) - 1), np.diff(K.indptr))
    on_support = np.asarray(supported.any(axis=1))
    near = np.flatnonzero(on_support[row] | on_support[K.indices])
    row, column, blocks = row[near], K.indices[near], K.data[near]
    remaining, own = np.zeros_like(blocks), np.flatnonzero(row == column)
    remaining[own[:, None], range(size), range(size)] = pivots[row[own]]
    moves = (supported[row][:, :, None] | supported[column][:, None]) & np.not_equal(blocks, remaining)
    block, i, j = np.nonzero(moves)
    K.data[near[block], i, j] = remaining[moves]
    rows = size * row[block] + i
    order = np.argsort(rows, kind="stable")
    start = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=K.shape[0]))]).astype(np.int32)
    columns, removed = (size * column[block] + j).astype(np.int32), (blocks - remaining)[moves]
    return K, csr_array((removed[order], columns[order], start), shape=K.shape)


def _with_diagonal(K: bsr_array) -> bsr_array:
    """Return K with a diagonal block in every block row, zero where there was none."""
    present = np.zeros(len(K.indptr) - 1, bool)
    block_row = np.repeat(np.arange(len(present)), np.diff(K.indptr))
    present[block_row[block_row == K.indices]] = True
    missing = np.flatnonzero(~present)
    if not len(missing):
        return K
    size = K.blocksize[0]
    rows, columns = np.r_[block_row, missing], np.r_[K.indices, missing]
    order = np.lexsort((columns, rows))
    data = np.concatenate([K.data, np.zeros((len(missing), size, size))])[order]
    indptr = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=len(present)))])
    return bsr_array((data, columns[order], indptr), shape=K.shape)
