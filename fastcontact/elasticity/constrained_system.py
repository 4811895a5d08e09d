"""Linear system from which supports and multi-point constraints are eliminated: ``u = T v + t``.

The vector v contains the unknowns. T is the identity, except in the rows of displacements that multi-point constraints
express in terms of other displacements. The vector t contains the prescribed displacements and the contribution of the
right-hand sides of the constraints. The matrix of the solver is ``T.T K T``. It has the size and the blocks of K, but only
the diagonal remains in the rows and columns of eliminated components.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.sparse import bsr_array, csr_array, diags_array

from fastcontact._tools.records import record
from fastcontact.arrays import Array, Indices, Mask, largest, mask_at
from fastcontact.elasticity.multipoint_constraints import Elimination, MultiPointConstraint, eliminate
from fastcontact.errors import ModelError
from fastcontact.linear.sparse_rows import entry_rows, stacked_rows, without_zeros
from fastcontact.round_off import ROUND_OFF

# Relative tolerance within which supports and constraints must be consistent.
CONSISTENCY_TOLERANCE = 1e-9


@record
class Stiffness:
    """A stiffness matrix in the form of a sum of matrices, `terms` (n, n) [force / length].

    Without multi-point constraints, there are two terms: the matrix of the linear solver, and the rows and columns of
    supports that were removed from it.
    """

    terms: tuple[Any, ...]

    def __matmul__(self, u: Array) -> Array:
        total = np.asarray(self.terms[0] @ u)
        for matrix in self.terms[1:]:
            total += matrix @ u
        return total

    def absolute_product(self, u: Array) -> Array:
        """Return ``|K| |u|`` (n,), summed over the terms; the round-off of ``K u`` is proportional to it [force]."""
        products = (K.absolute_product(u) if hasattr(K, "absolute_product") else abs(K) @ np.abs(u) for K in self.terms)
        return sum(products, np.zeros(u.shape))


class ConstrainedMotion:
    """The displacements that supports and constraints allow, ``u = T v + t``.

    Parameters
    ----------
    fixed : ndarray of bool (n,)
        Displacement components that are prescribed.
    relations : sequence of MultiPointConstraint

    Attributes
    ----------
    free : ndarray of bool (n,)
        The unknowns v.
    T : csr_array (n, n) or None
        Transformation from unknowns to displacements [-]; None without multi-point constraints.
    """

    T: csr_array | None = None

    def __init__(self, fixed: Mask, relations: Sequence[MultiPointConstraint]) -> None:
        self.fixed, self.relations = fixed, list(relations)
        self.free: Mask = ~fixed
        if not relations:
            return
        self._elimination: Elimination = eliminate(stacked_rows(relations, len(fixed)), fixed)
        self.free[self._elimination.pivots] = False
        self.T = without_zeros(csr_array(self._elimination.T @ diags_array(self.free.astype(float))))

    def lift(self, prescribed: Array, multipliers: Sequence[float]) -> Array:
        """Return t (n,) for prescribed displacements (n,) [length] and the load multiplier of each constraint [-].

        Raises
        ------
        ModelError
            If constraints and supports contradict each other.
        """
        u_prescribed: Array = np.where(self.fixed, prescribed, 0.0)
        if not self.relations:
            return u_prescribed
        right_sides = [np.broadcast_to(relation.value, relation.rows.shape[0]) for relation in self.relations]
        values = np.concatenate([side * factor for side, factor in zip(right_sides, multipliers, strict=True)])
        conditions, known = self._elimination.conditions, np.concatenate([u_prescribed, values])
        violation = np.abs(conditions @ known)
        # Coefficients may consist of round-off, such as the cosine of a right angle.
        tolerance = np.maximum(CONSISTENCY_TOLERANCE * (np.abs(conditions) @ np.abs(known)), ROUND_OFF * largest(known))
        conflicts = np.flatnonzero(violation > tolerance)
        if len(conflicts):
            row = self._elimination.origin[conflicts[0]]
            ends = np.cumsum([relation.rows.shape[0] for relation in self.relations])
            raise ModelError(
                f"{self.relations[int(np.searchsorted(ends, row, side='right'))].name} contradicts the supports, or "
                f"constraints stated before it, by {violation[conflicts[0]]:.3g}: remove one of them"
            )
        lift: Array = self._elimination.T @ u_prescribed + self._elimination.S @ values
        return lift


class System(ConstrainedMotion):
    """Stiffness, supports and multi-point constraints of a model.

    Parameters
    ----------
    K : bsr_array (n, n)
        Stiffness [force / length]. The rows and columns of supports are removed from this array.
    supported : ndarray of bool (n,)
        Displacement components that are prescribed.
    relations : sequence of MultiPointConstraint
    without_stiffness : ndarray of bool (n,)
        Components that are unknowns although they have no stiffness, such as those of rigid obstacles.

    Attributes
    ----------
    K : Stiffness
        Stiffness including the rows and columns of supports.
    matrix : bsr_array (n, n), or its replacement by the linear solver
        Matrix of the linear solver [force / length].
    fixed : ndarray of bool (n,)
        Supported components, and components without stiffness or constraint, whose displacements are zero.
    free : ndarray of bool (n,)
        The unknowns.
    zero_stiffness : ndarray of bool (n,)
        Unknowns without stiffness: those of rigid obstacles, and those for motions of bodies that constraints make rigid.
    """

    def __init__(
        self, K: bsr_array, supported: Mask, relations: Sequence[MultiPointConstraint], without_stiffness: Mask
    ) -> None:
        R = stacked_rows(relations, K.shape[0])
        constrained = mask_at(R.indices, K.shape[0])
        diagonal = K.diagonal()
        super().__init__(supported | ((diagonal == 0.0) & ~constrained & ~without_stiffness), relations)
        self._reacting: Mask = self.fixed | constrained  # supports and constraints may exert forces here
        self._independent, self._without_stiffness = self.free, without_stiffness
        self._entries: _SupportedEntries | None = None  # of the last `with_stiffness` matrix
        self._set_stiffness(K, diagonal)

    def with_stiffness(self, K: bsr_array) -> System:
        """Return the system with a different stiffness K (n, n) [force / length], which is modified as by the constructor."""
        pattern = self._entries.pattern if self._entries else ()
        if self.T is None and not (pattern and all(map(np.array_equal, pattern, (K.indptr, K.indices)))):
            K = _with_diagonal(K)
            self._entries = _SupportedEntries(K, self.fixed)
        system = copy.copy(self)
        system._set_stiffness(K, self._entries.diagonal_of(K) if self._entries else K.diagonal())
        return system

    def _set_stiffness(self, K: bsr_array, diagonal_of_K: Array) -> None:
        """Set the stiffness K (n, n), given with its diagonal (n,), and the attributes that depend on it."""
        self.free = self._independent.copy()
        if self.T is None:
            self.K = Stiffness((K, self._entries.remove_from(K)) if self._entries else separate_supports(K, self.fixed))
            self.matrix = self.K.terms[0]
            self.zero_stiffness: Mask = self.free & (diagonal_of_K == 0.0)
        else:
            self.K = Stiffness((K,))
            transformed = (self.T.T @ csr_array(K) @ self.T).tobsr(K.blocksize)
            transformed.sort_indices()
            diagonal = transformed.diagonal()
            # The diagonal without the contribution of off-diagonal terms of K, which may cancel that of the diagonal terms.
            magnitude = self.T.multiply(self.T).T @ diagonal_of_K
            # Points without stiffness that constraints couple only with each other are excluded from the unknowns.
            self.free &= (magnitude > 0.0) | self._without_stiffness
            self.zero_stiffness = self.free & (diagonal <= ROUND_OFF * magnitude)
            self.matrix = separate_supports(transformed, ~self.free)[0]
        self._eliminated = np.flatnonzero(~self.free)

    def set_matrix(self, matrix: Any) -> None:
        """Replace `matrix` by the return value of `LinearSolver.prepare`."""
        if self.K.terms[0] is self.matrix:
            self.K = Stiffness((matrix, *self.K.terms[1:]))
        self.matrix = matrix

    def right_side(self, f: Array, t: Array) -> Array:
        """Return the right-hand side (n,) of the solver for forces `f` (n,) on all displacements [force]."""
        # Without constraints, t contains only displacements of supports, which load the unknowns through the removed columns.
        return self.reduced(f - (self.K.terms[1] if self.T is None else self.K) @ t)

    def reduced(self, force: Array) -> Array:
        """Return the forces (n,) on the unknowns that do the same work as `force` (n,) on all displacements [force]."""
        forces = force.copy() if self.T is None else self.T.T @ force
        forces[self._eliminated] = 0.0
        return forces

    def rows(self, rows: csr_array, offset: Array, t: Array) -> tuple[csr_array, Array]:
        """Return the affine function ``rows @ u + offset`` as rows (m, n) and offset (m,) for the unknowns v."""
        offset = offset + rows @ t
        rows = rows.copy() if self.T is None else csr_array(rows @ self.T)
        rows.data[~self.free[rows.indices]] = 0.0
        return without_zeros(rows), offset

    def displacement(self, v: Array, t: Array) -> Array:
        """Return all displacements u (n,) [length]."""
        return (v if self.T is None else self.T @ v) + t

    def unknowns(self, u: Array, t: Array | float = 0.0) -> Array:
        """Return the unknowns v (n,) [length] of displacements u (n,) that satisfy the constraints."""
        v = u - t
        v[self._eliminated] = 0.0
        return v

    def unknowns_of(self, motions: Array) -> Array:
        """Return the unknowns (n, k) of motions (n, k) that satisfy homogeneous supports and constraints."""
        return np.where(self.free[:, None], motions, 0.0)

    def involved_unknowns(self, dofs: Indices) -> Indices:
        """Return the unknowns (k,) on which the displacements `dofs` (m,) depend, in ascending order."""
        if self.T is not None:
            dofs = np.unique(self.T[dofs].indices)
        return dofs[self.free[dofs]].astype(np.intp)

    def balance(self, unbalanced: Array, round_off: Array | None = None) -> tuple[Array, float]:
        """Return the forces (n,) of supports and constraints [force], and the largest residual force on an unknown.

        The argument `unbalanced` (n,) contains internal minus all other forces [force]. Residual forces up to `round_off`
        (n,) are treated as zero, and larger ones are reduced by this amount.
        """
        residual = self.reduced(unbalanced)
        if round_off is not None:
            residual = np.maximum(np.abs(residual) - (round_off if self.T is None else abs(self.T).T @ round_off), 0.0)
        return np.where(self._reacting, unbalanced, 0.0), largest(residual)


def separate_supports(K: bsr_array, fixed: Mask) -> tuple[bsr_array, csr_array]:
    """Remove the rows and columns of supported degrees of freedom from K (n, n), in place.

    Returns
    -------
    matrix : bsr_array (n, n)
        K without these rows and columns, except for the diagonal, which is positive there.
    removed : csr_array (n, n)
        The original K minus `matrix`.
    """
    K = _with_diagonal(K)
    return K, _SupportedEntries(K, fixed).remove_from(K)


class _SupportedEntries:
    """Entries in the rows and columns of the degrees of freedom `fixed` (n,), for the pattern of a matrix K (n, n).

    All diagonal blocks of K must be stored.
    """

    def __init__(self, K: bsr_array, fixed: Mask) -> None:
        self.pattern, size = (K.indptr, K.indices), K.blocksize[0]
        supported, row = fixed.reshape(-1, size), entry_rows(K)
        on_support, on_diagonal = np.asarray(supported.any(axis=1)), np.flatnonzero(row == K.indices)
        affected = np.flatnonzero(on_support[row] | on_support[K.indices])
        row, column = row[affected], K.indices[affected]
        block, i, j = np.nonzero(supported[row][:, :, None] | supported[column][:, None])
        rows, columns = size * row[block] + i, size * column[block] + j
        order = np.argsort(rows, kind="stable")
        self._positions = ((affected[block] * size + i) * size + j)[order]
        self._columns = columns[order].astype(np.int32)
        self._start = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=len(fixed)))]).astype(np.int32)
        self._diagonal = np.flatnonzero((rows == columns)[order])
        self._diagonal_entries = (size**2 * on_diagonal[:, None] + (size + 1) * np.arange(size)).ravel()

    def diagonal_of(self, K: bsr_array) -> Array:
        """Return the diagonal (n,) of K."""
        return np.asarray(K.data.reshape(-1)[self._diagonal_entries])

    def remove_from(self, K: bsr_array) -> csr_array:
        """Set the entries of K to zero, except for positive numbers on the diagonal, and return the removed part."""
        K.data = np.ascontiguousarray(K.data)
        entries = K.data.reshape(-1)
        removed = entries[self._positions]
        diagonal = removed[self._diagonal]
        if not (is_positive := diagonal > 0.0).all():
            diagonal[~is_positive] = self.diagonal_of(K).max(initial=1.0)
        entries[self._positions] = 0.0
        entries[self._positions[self._diagonal]] = diagonal
        removed[self._diagonal] -= diagonal
        return without_zeros(csr_array((removed, self._columns, self._start), shape=K.shape, copy=True))


def _with_diagonal(K: bsr_array) -> bsr_array:
    """Return K with a diagonal block in every block row; blocks that were not stored are zero."""
    block_row, n = entry_rows(K), len(K.indptr) - 1
    missing = np.flatnonzero(~mask_at(block_row[block_row == K.indices], n))
    if not len(missing):
        return K
    size = K.blocksize[0]
    rows, columns = np.r_[block_row, missing], np.r_[K.indices, missing]
    order = np.lexsort((columns, rows))
    data = np.concatenate([K.data, np.zeros((len(missing), size, size))])[order]
    indptr = np.concatenate([[0], np.cumsum(np.bincount(rows, minlength=n))])
    return bsr_array((data, columns[order], indptr), shape=K.shape)
