"""What a contact pair asks of the displacements: ``gap >= 0, multiplier >= 0, product 0``, row by row."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack

from fastcontact.active_set import Compliance, State

Array = NDArray[np.float64]


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
    """

    B: csr_array
    gap0: Array
    positions: Array
    compliance: Compliance | None = None
    tangents: tuple[csr_array, ...] = ()
    directions: tuple[Array, ...] = ()
    friction: Array | None = None
    drift: Array | None = None

    def force(self, state: State) -> Array:
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
        (),
        np.concatenate([np.zeros(len(p.gap0)) if p.friction is None else p.friction for p in parts]),
        _stacked_drift(parts),
    )


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


class _BlockDiagonal:
    """The compliances of several pairs side by side; see `active_set.Compliance`."""

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
