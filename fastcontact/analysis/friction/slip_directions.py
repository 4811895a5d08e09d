"""Slip directions left free by supports: tangents are aligned with them, the others are held.

The functions use the compliance block of each single constraint (1 + k, 1 + k, m), normal part first.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import block_array, csr_array, diags_array

from fastcontact.arrays import Array, Mask
from fastcontact.round_off import TINY

# A slip direction is held if its compliance relative to that of the gap is less than this.
IDLE = 1e-10
# Compliance of a prescribed slip relative to that of its gap: negligible, but it gives sticking an equation, which no
# force in the cone satisfies.
GIVING = 1e-8


def own_compliance(F: Array, parts: int) -> Array:
    """Return the compliance (parts, parts, m) of each constraint from that of all, F (parts m, parts m)."""
    m = len(F) // parts
    index = np.arange(parts * m).reshape(parts, m)
    return np.asarray(F[index[:, None], index[None]])


def compliance_of_rows(rows: tuple[csr_array, ...], yielding: Array) -> Array:
    """Return the compliance (parts, parts, m) of each constraint for a diagonal stiffness matrix.

    Parameters
    ----------
    rows : tuple of csr_array (m, n)
        Rows of the gaps, and of the slips along each tangent.
    yielding : ndarray (n,)
        Compliance of each unknown [length / force].
    """
    weighted = [csr_array((R.data * yielding[R.indices], R.indices, R.indptr), shape=R.shape) for R in rows]
    return np.array([[weighted_rows.multiply(R).sum(axis=1) for R in rows] for weighted_rows in weighted])


def aligning(compliance: Array, directions: tuple[Array, ...] = ()) -> csr_array | None:
    """Return Q (3 m, 3 m) that rotates two tangents so that one is idle where supports leave one slip direction free.

    In a plane of symmetry both tangents may be oblique to it; then neither is idle by itself. If `directions`, two of (m, 3),
    are given, the other tangents are rotated so that the first is perpendicular to the coordinate axis nearest to the tangent
    plane: otherwise the choice of tangents would decide which displacements, along axes, are eliminated. None without
    rotation.
    """
    m = compliance.shape[2]
    gap = np.maximum(compliance[0, 0], TINY)
    first, second = compliance[1, 1] - compliance[1, 0] ** 2 / gap, compliance[2, 2] - compliance[2, 0] ** 2 / gap
    mixed = compliance[1, 2] - compliance[1, 0] * compliance[2, 0] / gap
    radius = np.hypot(0.5 * (first - second), mixed)
    largest, least = 0.5 * (first + second) + radius, 0.5 * (first + second) - radius
    across = (least <= IDLE * np.maximum(largest, gap)) & (np.abs(mixed) > IDLE * np.maximum(largest, gap))
    if not across.any() and not directions:
        return None
    angle = np.where(across, 0.5 * np.arctan2(2 * mixed, first - second), _to_axes(*directions) if directions else 0.0)
    c, s, zero = diags_array(np.cos(angle)), diags_array(np.sin(angle)), csr_array((m, m))
    return csr_array(block_array([[diags_array(np.ones(m)), zero, zero], [zero, c, s], [zero, -s, c]], format="csr"))


def _to_axes(one: Array, other: Array) -> Array:
    """Return the angles (m,) of rotation from the tangents (m, 3) to those along axes."""
    normal = np.cross(one, other)
    first = np.cross(np.eye(3)[np.argmin(np.abs(normal), axis=1)], normal)
    return np.asarray(np.arctan2((first * other).sum(axis=1), (first * one).sum(axis=1)))


def idle(directions: Array) -> Mask:
    """Return the tangents (k, m) along which supports allow no motion, or none except that of the gap.

    This is the case at an axis and in a plane of symmetry, where the equation of friction would be empty.
    """
    k = len(directions) - 1
    along = directions[np.arange(1, k + 1), np.arange(1, k + 1)]
    return np.asarray(
        along * directions[0, 0] - directions[1:, 0] ** 2
        <= IDLE * directions[0, 0] * np.maximum(along, directions[0, 0])
    )
