"""What a contact pair asks of the displacements: ``gap >= 0, multiplier >= 0, product 0``, row by row."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack

Array = NDArray[np.float64]


class Compliance(Protocol):
    """A symmetric positive semidefinite matrix C (m, m) over all constraints."""

    def block(self, rows: NDArray[np.intp]) -> Array:
        """Return the dense rows and columns `rows` of C."""
        ...

    def apply(self, multiplier: Array) -> Array:
        """Return ``C multiplier`` (m,)."""
        ...


class Forces(Protocol):
    """What the solution of an inequality problem says about forces; see `analysis.active_set.State`."""

    @property
    def multiplier(self) -> Array:
        """Normal forces (m,) [force]."""
        ...


@dataclass(frozen=True, eq=False)
class Constraints:
    """Inequality constraints ``gap = gap0 + B u + C multiplier >= 0``, each with a multiplier >= 0.

    Attributes
    ----------
    B : csr_array (m, n_dofs)
        Rows; an empty row is a constraint that cannot close now.
    gap0 : ndarray (m,)
        Gap at u = 0 [length].
    positions : ndarray (m, dim)
        Where the gap is measured, on the reference surface [length].
    compliance : Compliance, optional
        C; None stands for zero.
    tangents : tuple of csr_array (m, n_dofs)
        Tangential motion relative to the primary side, a matrix for each tangent; empty without friction.
    directions : tuple of ndarray (m, dim)
        The tangents themselves.
    drift : ndarray (len(tangents), m), optional
        Slip of the step that the motion of a rigid primary side makes by itself [length]; None stands for zero.
    friction : ndarray (m,), optional
        Coefficient of friction of each constraint; None stands for zero.
    held : ndarray of bool (m,), optional
        Constraints that hold as equations, with multipliers of either sign; None stands for none.
    softness : ndarray (m,), optional
        Compliance of each constraint along its normal alone, beside C [length / force]; None stands for zero.
    loose : ndarray (1 + len(tangents), m, h), optional
        Z of a compliance ``Z Z.T`` beside C, of normal forces and then of tangential ones; None stands for zero.
    """

    B: csr_array
    gap0: Array
    positions: Array
    compliance: Compliance | None = None
    tangents: tuple[csr_array, ...] = ()
    directions: tuple[Array, ...] = ()
    friction: Array | None = None
    drift: Array | None = None
    held: NDArray[np.bool_] | None = None
    softness: Array | None = None
    loose: Array | None = None

    @property
    def normal_compliance(self) -> Compliance | None:
        """All compliance along the normals: C and `softness`."""
        return self.compliance if self.softness is None else _Softened(self.compliance, self.softness)

    def force(self, state: Forces) -> Array:
        """Return the nodal contact forces (n_dofs,) of a solution."""
        total: Array = self.B.T @ state.multiplier
        for tangent, along in zip(self.tangents, getattr(state, "tangential", np.empty((0, 0))).T, strict=True):
            total += tangent.T @ along
        return total


def stacked(parts: list[Constraints]) -> Constraints:
    """Return the constraints of several pairs as one."""
    if len(parts) == 1:
        return parts[0]
    compliance = None
    if any(part.compliance is not None for part in parts):
        compliance = _BlockDiagonal(parts)
    return Constraints(
        csr_array(vstack([part.B for part in parts], format="csr")),
        np.concatenate([part.gap0 for part in parts]),
        np.vstack([part.positions for part in parts]),
        compliance,
        _stacked_tangents(parts),
        _stacked_directions(parts),
        np.concatenate([np.zeros(len(p.gap0)) if p.friction is None else p.friction for p in parts]),
        _stacked_drift(parts),
        _stacked_vectors([part.held for part in parts], parts, bool),
        _stacked_vectors([part.softness for part in parts], parts, float),
        _stacked_loose(parts),
    )


def _stacked_vectors(found: Sequence[NDArray[Any] | None], parts: list[Constraints], kind: type) -> Any:
    """Return vectors (m,) of all parts as one, zero where a part has none; None where no part has one."""
    if all(vector is None for vector in found):
        return None
    zero: list[NDArray[Any]] = [np.zeros(len(part.gap0), kind) for part in parts]
    return np.concatenate([own if vector is None else vector for own, vector in zip(zero, found, strict=True)])


def _stacked_drift(parts: list[Constraints]) -> Array | None:
    """Return the drift of all parts, zero where a part has none."""
    count = max(len(part.tangents) for part in parts)
    if all(part.drift is None for part in parts):
        return None
    return np.hstack([np.zeros((count, len(p.gap0))) if p.drift is None else p.drift for p in parts])


def _stacked_tangents(parts: list[Constraints]) -> tuple[csr_array, ...]:
    """Return the tangential rows of all parts; empty rows stand for parts without friction."""
    count = max(len(part.tangents) for part in parts)
    return tuple(
        csr_array(vstack([p.tangents[j] if p.tangents else csr_array(p.B.shape) for p in parts], format="csr"))
        for j in range(count)
    )


def _stacked_directions(parts: list[Constraints]) -> tuple[Array, ...]:
    """Return the tangents of all parts, zero where a part has none."""
    count = max(len(part.directions) for part in parts)
    return tuple(
        np.vstack([p.directions[j] if p.directions else np.zeros_like(p.positions) for p in parts])
        for j in range(count)
    )


def _stacked_loose(parts: list[Constraints]) -> Array | None:
    """Return the compliances beside C side by side."""
    if all(part.loose is None for part in parts):
        return None
    count = 1 + max(len(part.tangents) for part in parts)
    none = [np.zeros((count, len(part.gap0), 0)) for part in parts]
    own = [empty if part.loose is None else part.loose for part, empty in zip(parts, none, strict=True)]
    total, first, last = np.zeros((count, sum(z.shape[1] for z in own), sum(z.shape[2] for z in own))), 0, 0
    for z in own:
        total[:, first : first + z.shape[1], last : last + z.shape[2]] = z
        first, last = first + z.shape[1], last + z.shape[2]
    return total


class _Softened:
    """A compliance, or none, and a diagonal one; see `Compliance`."""

    def __init__(self, inner: Compliance | None, softness: Array) -> None:
        self._inner, self._softness = inner, softness

    def block(self, rows: NDArray[np.intp]) -> Array:
        own = np.diag(self._softness[rows])
        return own if self._inner is None else own + self._inner.block(rows)

    def apply(self, multiplier: Array) -> Array:
        own = self._softness * multiplier
        return own if self._inner is None else own + self._inner.apply(multiplier)


class _BlockDiagonal:
    """The compliances of several pairs side by side; see `Compliance`."""

    def __init__(self, parts: list[Constraints]) -> None:
        self._parts = [part.compliance for part in parts]
        self._start = np.cumsum([0] + [len(part.gap0) for part in parts])

    def block(self, rows: NDArray[np.intp]) -> Array:
        values = np.zeros((len(rows), len(rows)))
        for part, first, end in zip(self._parts, self._start[:-1], self._start[1:], strict=True):
            mine = np.flatnonzero((rows >= first) & (rows < end))
            if part is not None and len(mine):
                values[np.ix_(mine, mine)] = part.block(rows[mine] - first)
        return values

    def apply(self, multiplier: Array) -> Array:
        values = np.zeros(len(multiplier))
        for part, first, end in zip(self._parts, self._start[:-1], self._start[1:], strict=True):
            if part is not None:
                values[first:end] = part.apply(multiplier[first:end])
        return values
