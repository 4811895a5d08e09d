"""Multi-point constraints ``R u = r`` and their elimination: ``u = T w + S r``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array, diags_array, vstack

from fastcontact.arrays import Array, Indices, Mask

Table = tuple[tuple[float, float], ...]
# Coefficients below this fraction of the largest one of their row are round-off from cancellation.
ZERO = 1e-10
Row = dict[int, float]


@dataclass(frozen=True, eq=False)
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
        Points (instant, multiplier) of its ramp; None: the ramp of the analysis.
    """

    name: str
    rows: csr_array
    value: float | Array = 0.0
    ramp: Table | None = None


@dataclass(frozen=True, eq=False)
class TemporaryConstraint(MultiPointConstraint):
    """A constraint that acts in the load steps between two instants, starting from the values at its beginning.

    Parameters
    ----------
    name, ramp
        As in `MultiPointConstraint`.
    rows : csr_array (m, n_dofs)
        Coefficients [unit of the caller].
    value : float or ndarray (m,)
        Right-hand sides at multiplier 1 of the ramp [length times the unit of the coefficients].
    begins, ends : float
        Instants at ends of load steps [-].
    keeps : bool
        Whether the constraint keeps its initial values, ignoring `value` and `ramp`; otherwise it proceeds from them to
        the next point of its ramp.
    """

    begins: float = -np.inf
    ends: float = np.inf
    keeps: bool = False

    def acts_from(self, begin: float) -> bool:
        """Return whether the constraint acts in the load step that begins at an instant."""
        return self.begins <= begin < self.ends

    def after(self, reached: Array) -> list[MultiPointConstraint]:
        """Return the constraints that continue from `reached` (m,) [length], the values of ``rows @ u`` at the beginning."""
        if self.keeps:
            return [MultiPointConstraint(self.name, self.rows, reached, ((0.0, 1.0),))]
        value, table = np.broadcast_to(self.value, reached.shape), self.ramp or ()
        later = [[(t, v * factor) for t, factor in table if t > self.begins] for v in value.tolist()]
        return [
            MultiPointConstraint(self.name, self.rows[[row]], 1.0, ((self.begins, start), *points))
            for row, (start, points) in enumerate(zip(reached.tolist(), later, strict=True))
        ]


@dataclass(frozen=True, eq=False)
class Elimination:
    """``u = T w + S r``, with w zero at the pivots, satisfies ``R u = r`` for every w that satisfies the conditions.

    Attributes
    ----------
    pivots : ndarray of int (n_pivots,)
        The displacement components expressed in terms of the others.
    T : csr_array (n, n)
        Identity except for the rows of the pivots; the columns of the pivots are empty [-].
    S : csr_array (n, m)
        Derivatives of the pivots with respect to the right-hand sides [length / unit of r].
    conditions : csr_array (k, n + m)
        Rows that only involve known components and right-hand sides: solutions exist if ``conditions @ (w, r) = 0``
        [unit of R], [-].
    origin : ndarray of int (k,)
        Row of R from which each condition originates.
    """

    pivots: Indices
    T: csr_array
    S: csr_array
    conditions: csr_array
    origin: Indices


def stacked_rows(relations: Sequence[MultiPointConstraint], n_dofs: int) -> csr_array:
    """Return the rows of all constraints as one matrix R (m, n_dofs) [unit of the rows]."""
    if not relations:
        return csr_array((0, n_dofs))
    return csr_array(vstack([relation.rows for relation in relations], format="csr"))


def eliminate(R: csr_array, known: Mask) -> Elimination:
    """Express one unknown component by the others for each independent row of ``R u = r``.

    Parameters
    ----------
    R : csr_array (m, n)
        Rows, possibly linearly dependent [unit of the caller].
    known : ndarray of bool (n,)
        Components that are prescribed and never become pivots.
    """
    m, n = R.shape
    uses = np.bincount(R.indices, minlength=n)
    expressed: dict[int, Row] = {}
    users: dict[int, set[int]] = {}
    conditions: dict[int, Row] = {}
    for k in range(m):
        row = _substituted(R, k, expressed)
        row[n + k] = row.get(n + k, 0.0) - 1.0
        largest = max((abs(c) for key, c in row.items() if key < n), default=0.0)
        unknown = [key for key, c in row.items() if key < n and not known[key] and abs(c) > 0.1 * largest]
        unknown = unknown or [key for key, c in row.items() if key < n and not known[key]]
        if not unknown:
            conditions[k] = row
            continue
        # The pivot is the component in the fewest constraints, so that few expressions depend on it.
        pivot = min(unknown, key=lambda key: (uses[key], -abs(row[key]), key))
        coefficient = row.pop(pivot)
        _express(pivot, {key: -c / coefficient for key, c in row.items()}, expressed, users)
    pivots, origin = np.array([*expressed], np.intp), np.array([*conditions], np.intp)
    of_known = _rows(dict(enumerate(conditions.values())), (len(conditions), n + m))
    return Elimination(pivots, *_matrices(expressed, n, m), of_known, origin)


def _substituted(R: csr_array, k: int, expressed: dict[int, Row]) -> Row:
    """Return row `k` of R with pivots replaced by their expressions."""
    row: Row = {}
    size = 0.0
    for entry in range(R.indptr[k], R.indptr[k + 1]):
        key, c = int(R.indices[entry]), float(R.data[entry])
        size = max(size, abs(c))
        for other, d in expressed.get(key, {key: 1.0}).items():
            row[other] = row.get(other, 0.0) + c * d
    return {key: c for key, c in row.items() if abs(c) > ZERO * size}


def _express(pivot: int, by: Row, expressed: dict[int, Row], users: dict[int, set[int]]) -> None:
    """Add a new pivot, and replace it in the expressions of earlier ones."""
    expressed[pivot] = by
    for key in by:
        users.setdefault(key, set()).add(pivot)
    for other in users.pop(pivot, set()):
        row = expressed[other]
        c = row.pop(pivot)
        for key, d in by.items():
            row[key] = row.get(key, 0.0) + c * d
            users[key].add(other)


def _matrices(expressed: dict[int, Row], n: int, m: int) -> tuple[csr_array, csr_array]:
    """Return T (n, n) and S (n, m)."""
    kept = np.ones(n)
    kept[list(expressed)] = 0.0
    rows = _rows(expressed, (n, n + m))
    return csr_array(rows[:, :n] + diags_array(kept)), csr_array(rows[:, n:])


def _rows(rows: Mapping[int, Row], shape: tuple[int, int]) -> csr_array:
    """Return a matrix with rows, by their number, given by dictionaries."""
    row = np.array([number for number, entries in rows.items() for _ in entries], np.intp)
    column = np.array([key for entries in rows.values() for key in entries], np.intp)
    values = np.array([c for entries in rows.values() for c in entries.values()], np.float64)
    return csr_array((values, (row, column)), shape=shape)
