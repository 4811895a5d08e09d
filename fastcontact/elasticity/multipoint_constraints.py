"""Multi-point constraints ``R u = r`` and their elimination: ``u = T w + S r``."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.sparse import csr_array, diags_array

from fastcontact._tools.records import record
from fastcontact.arrays import Array, Indices, Mask, mask_at

Table = tuple[tuple[float, float], ...]
# Coefficients below this fraction of the largest coefficient in their row are considered round-off due to cancellation.
CANCELLATION = 1e-10
# Coefficients of a row by column. The columns are the n displacement components, followed by the right-hand sides.
Row = dict[int, float]


@record
class MultiPointConstraint:
    """Equations ``rows @ u = value`` between displacement components.

    Parameters
    ----------
    name : str
        Name for messages.
    rows : csr_array (m, n_dofs)
        Coefficients [unit of the caller].
    value : float or ndarray (m,)
        Right-hand sides at multiplier 1 of the ramp [length times the unit of the coefficients].
    ramp : tuple of (float, float), optional
        Points (load factor, multiplier) of the ramp of the right-hand side; None means the ramp of the analysis.
    """

    name: str
    rows: csr_array
    value: float | Array = 0.0
    ramp: Table | None = None


@record
class TemporaryConstraint(MultiPointConstraint):
    """A constraint that acts in the load steps between two instants; ``rows @ u`` is continuous at the first of them.

    Parameters
    ----------
    name, ramp
        As in `MultiPointConstraint`.
    rows : csr_array (m, n_dofs)
        Coefficients [unit of the caller].
    value : float or ndarray (m,)
        Right-hand sides at multiplier 1 of the ramp [length times the unit of the coefficients].
    begins, ends : float
        The two instants, which must be ends of load steps [-].
    keeps : bool
        Whether ``rows @ u`` retains the values that it has at the instant `begins`, irrespective of `value` and `ramp`.
        Otherwise, it changes linearly from these values to the next point of the ramp.
    """

    begins: float = -np.inf
    ends: float = np.inf
    keeps: bool = False

    def acts_from(self, begin: float) -> bool:
        """Return whether the constraint acts in the load step that begins at the instant `begin`."""
        return self.begins <= begin < self.ends

    def begun_constraints(self, initial_values: Array) -> list[MultiPointConstraint]:
        """Return the constraints that act from the instant `begins` on.

        `initial_values` (m,) [length times the unit of the coefficients] contains the values of ``rows @ u`` at this instant.
        """
        if self.keeps:
            return [MultiPointConstraint(self.name, self.rows, initial_values, ((0.0, 1.0),))]
        value, table = np.broadcast_to(self.value, initial_values.shape), self.ramp or ()
        later_points = [[(t, v * factor) for t, factor in table if t > self.begins] for v in value.tolist()]
        return [
            MultiPointConstraint(self.name, self.rows[[row]], 1.0, ((self.begins, start), *points))
            for row, (start, points) in enumerate(zip(initial_values.tolist(), later_points, strict=True))
        ]


@record
class Elimination:
    """Elimination of constraints: ``u = T w + S r`` satisfies ``R u = r`` for every w that satisfies the conditions.

    Attributes
    ----------
    pivots : ndarray of int (n_pivots,)
        The displacement components that are expressed in terms of the others.
    T : csr_array (n, n)
        Identity, except in the rows of the pivots; the columns of the pivots are empty [-].
    S : csr_array (n, m)
        Derivatives of the pivots with respect to the right-hand sides [length / unit of r].
    conditions : csr_array (k, n + m)
        Rows that involve only known components [unit of R] and right-hand sides [-]. Solutions exist if
        ``conditions @ (w, r) = 0``.
    origin : ndarray of int (k,)
        Row of R from which each condition originates.
    """

    pivots: Indices
    T: csr_array
    S: csr_array
    conditions: csr_array
    origin: Indices


def eliminate(R: csr_array, known: Mask) -> Elimination:
    """For each linearly independent row of ``R u = r``, express one unknown component in terms of the others.

    Parameters
    ----------
    R : csr_array (m, n)
        Rows, possibly linearly dependent [unit of the caller].
    known : ndarray of bool (n,)
        Components that are prescribed and never become pivots.
    """
    m, n = R.shape
    n_uses = np.bincount(R.indices, minlength=n)
    expressions: dict[int, Row] = {}
    users: dict[int, set[int]] = {}
    conditions: dict[int, Row] = {}
    for k in range(m):
        row = _substitute(R, k, expressions)
        row[n + k] = row.get(n + k, 0.0) - 1.0
        largest = max((abs(c) for key, c in row.items() if key < n), default=0.0)
        unknown = [key for key, c in row.items() if key < n and not known[key] and abs(c) > 0.1 * largest]
        unknown = unknown or [key for key, c in row.items() if key < n and not known[key]]
        if not unknown:
            conditions[k] = row
            continue
        # The pivot is the component that occurs in the fewest constraints, so that few constraints change.
        pivot = min(unknown, key=lambda key: (n_uses[key], -abs(row[key]), key))
        coefficient = row.pop(pivot)
        _express(pivot, {key: -c / coefficient for key, c in row.items()}, expressions, users)
    pivots, origin = np.array([*expressions], np.intp), np.array([*conditions], np.intp)
    not_pivot = 1.0 - mask_at(pivots, n)
    pivot_rows = _rows(expressions, (n, n + m))
    T, S = csr_array(pivot_rows[:, :n] + diags_array(not_pivot)), csr_array(pivot_rows[:, n:])
    return Elimination(pivots, T, S, _rows(dict(enumerate(conditions.values())), (len(conditions), n + m)), origin)


def _substitute(R: csr_array, k: int, expressions: dict[int, Row]) -> Row:
    """Return row `k` of R with pivots replaced by their expressions."""
    row: Row = {}
    entries = slice(R.indptr[k], R.indptr[k + 1])
    for key, c in zip(R.indices[entries].tolist(), R.data[entries].tolist(), strict=True):
        for component, d in expressions.get(key, {key: 1.0}).items():
            row[component] = row.get(component, 0.0) + c * d
    largest = np.abs(R.data[entries]).max(initial=0.0)
    return {key: c for key, c in row.items() if abs(c) > CANCELLATION * largest}


def _express(pivot: int, expression: Row, expressions: dict[int, Row], users: dict[int, set[int]]) -> None:
    """Add the expression of a pivot, and substitute it into the expressions of earlier pivots.

    `users` contains, for each component, the pivots whose expressions contain this component.
    """
    expressions[pivot] = expression
    for key in expression:
        users.setdefault(key, set()).add(pivot)
    for earlier in users.pop(pivot, set()):
        row = expressions[earlier]
        c = row.pop(pivot)
        for key, d in expression.items():
            row[key] = row.get(key, 0.0) + c * d
            users[key].add(earlier)


def _rows(rows: Mapping[int, Row], shape: tuple[int, int]) -> csr_array:
    """Return a sparse matrix, given the entries of its rows by row number and column."""
    row = np.array([number for number, entries in rows.items() for _ in entries], np.intp)
    column = np.array([key for entries in rows.values() for key in entries], np.intp)
    values = np.array([c for entries in rows.values() for c in entries.values()], np.float64)
    return csr_array((values, (row, column)), shape=shape)
