"""Tangents along which supports allow no slip.

At a constraint on a symmetry plane or on an axis, supports prevent slip along one tangent or along both. Such a tangent is
called held. The functions detect held tangents by the compliance of each constraint, and rotate the two tangents of a
constraint in 3D so that one of them is the direction in which slip is prevented.

The compliance of m constraints, without their coupling, is an array (1 + k, 1 + k, m): the changes of the gap and of the k
slips of a constraint by its normal force and its k tangential forces [length / force], in this order.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import block_array, csr_array, diags_array

from fastcontact.arrays import Array, Mask
from fastcontact.linear.protocol import TOLERANCE
from fastcontact.round_off import LENGTH_ROUND_OFF, TINY

# Compliance of a prescribed slip relative to the compliance of its gap. It is negligible, but with it the equation of stick
# has a solution. The force of this solution lies outside the friction cone, so that the constraint slides.
SLIP_COMPLIANCE = LENGTH_ROUND_OFF


def compliance_of_each(F: Array, parts: int) -> Array:
    """Return the compliance (parts, parts, m) of each constraint, given the compliance F (parts m, parts m) of all.

    `parts` is 1 + k; F has the normal components of all constraints first, then the components along each tangent.
    """
    m = len(F) // parts
    index = np.arange(parts * m).reshape(parts, m)
    return np.asarray(F[index[:, None], index[None]])


def compliance_of_rows(rows: tuple[csr_array, ...], unknown_compliance: Array) -> Array:
    """Return the compliance (1 + k, 1 + k, m) of each constraint for a diagonal stiffness matrix.

    Parameters
    ----------
    rows : tuple of csr_array (m, n)
        Derivatives of the gaps, and of the slips along each of k tangents, with respect to the n unknowns [-].
    unknown_compliance : ndarray (n,)
        Compliance of each unknown, the reciprocal of its stiffness [length / force].
    """
    weighted = [csr_array((R.data * unknown_compliance[R.indices], R.indices, R.indptr), shape=R.shape) for R in rows]
    return np.array([[weighted_rows.multiply(R).sum(axis=1) for R in rows] for weighted_rows in weighted])


def aligning(compliance: Array, directions: tuple[Array, ...] = ()) -> csr_array | None:
    """Return the matrix that rotates the two tangents of each constraint in 3D so that one is held if possible.

    If supports leave one slip direction free, both tangents may be oblique to it, and neither is held before the rotation.

    Parameters
    ----------
    compliance : ndarray (3, 3, m)
        Compliance of each constraint [length / force].
    directions : tuple of two ndarray (m, 3), optional
        The tangents. If they are given, the tangents of the other constraints are rotated, too, so that the first one is
        perpendicular to one of the coordinate axes: the elimination of displacements, which are components along these axes,
        then does not depend on the choice of tangents.

    Returns
    -------
    csr_array (3 m, 3 m) or None
        Q, for components of normals and then of both tangents. None if no tangent needs a rotation.
    """
    m = compliance.shape[2]
    gap = np.maximum(compliance[0, 0], TINY)
    first, second = compliance[1, 1] - compliance[1, 0] ** 2 / gap, compliance[2, 2] - compliance[2, 0] ** 2 / gap
    mixed = compliance[1, 2] - compliance[1, 0] * compliance[2, 0] / gap
    radius = np.hypot(0.5 * (first - second), mixed)
    largest, least = 0.5 * (first + second) + radius, 0.5 * (first + second) - radius
    oblique = (least <= TOLERANCE * np.maximum(largest, gap)) & (np.abs(mixed) > TOLERANCE * np.maximum(largest, gap))
    if not oblique.any() and not directions:
        return None
    angle = np.where(oblique, 0.5 * np.arctan2(2 * mixed, first - second), _to_axes(*directions) if directions else 0.0)
    c, s, zero = diags_array(np.cos(angle)), diags_array(np.sin(angle)), csr_array((m, m))
    return csr_array(block_array([[diags_array(np.ones(m)), zero, zero], [zero, c, s], [zero, -s, c]], format="csr"))


def _to_axes(tangent: Array, second_tangent: Array) -> Array:
    """Return angles (m,) by which the tangents (m, 3) rotate until the first is perpendicular to a coordinate axis [rad].

    The axis is the one with the largest angle to the normal.
    """
    normal = np.cross(tangent, second_tangent)
    aligned = np.cross(np.eye(3)[np.argmin(np.abs(normal), axis=1)], normal)
    return np.asarray(np.arctan2((aligned * second_tangent).sum(axis=1), (aligned * tangent).sum(axis=1)))


def held_tangents(compliance: Array) -> Mask:
    """Return which tangents (k, m) are held, given the `compliance` (1 + k, 1 + k, m) of each constraint.

    Along a held tangent, supports allow no motion, or only a motion that is proportional to the change of the gap, so that
    the equation of its slip would be empty or linearly dependent. The tolerance is that of iterative solvers, whose
    solutions determine the compliance.
    """
    k = len(compliance) - 1
    of_slips, normal = compliance[np.arange(1, k + 1), np.arange(1, k + 1)], compliance[0, 0]
    bound = TOLERANCE * normal * np.maximum(of_slips, normal)
    return np.asarray(of_slips * normal - compliance[1:, 0] ** 2 <= bound)
