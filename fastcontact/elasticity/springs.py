"""Linear springs at nodes, which add the positive semidefinite matrix ``R.T diag(k) R`` to the stiffness.

A spring with the stiffness k has the energy ``k (r u)^2 / 2``, where the product of the row r of R and the displacements u is
the elongation of the spring. The direction of springs along a line is that of the undeformed line.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from scipy.sparse import bsr_array, csr_array, diags_array, vstack

from fastcontact._tools.records import record
from fastcontact.arrays import AnyArray, Array
from fastcontact.errors import ModelError
from fastcontact.linear.sparse_rows import nodal_rows, stacked_rows, sum_of_blocks
from fastcontact.round_off import ROUND_OFF

# Ratios of the stiffness of a spring between nodes to that of the bodies at its ends above which a warning is issued and an
# error is raised.
WARNING_RATIO, ERROR_RATIO = 1e5, 1e12
DIGITS = 16  # number of decimal digits in double precision


@record
class Springs:
    """Springs that are defined together under one name.

    Attributes
    ----------
    name : str
        Name for messages.
    rows : csr_array (m, n_dofs)
        Rows R of the springs, which map displacements to elongations [-].
    stiffness : ndarray (m,)
        Stiffness [force / length]; in axisymmetry, it refers to the full circle.
    grounded : bool
        Whether the springs connect nodes to the ground instead of to other nodes.
    """

    name: str
    rows: csr_array
    stiffness: Array
    grounded: bool

    def tension(self, displacement: Array) -> Array:
        """Return the force (m,) [force] in each spring, positive in tension, for `displacement` (n_points, dim) [length]."""
        return self.stiffness * (self.rows @ displacement.ravel())


def ground_springs(
    name: str, nodes: AnyArray, stiffness: Mapping[int, float], n_dofs: int, dim: int,
    line_stiffness: Mapping[str, float] | None = None, direction: Array | None = None,
) -> Springs:  # fmt: skip
    """Return springs from each of the `nodes` (n,) to the ground.

    A spring with the stiffness ``stiffness[axis]`` [force / length] acts along each axis in `stiffness`. Springs with the
    stiffnesses ``line_stiffness["axial"]`` and ``line_stiffness["transverse"]`` [force / length] act parallel and
    perpendicular to the unit vector `direction` (dim,) [-].
    """
    directions, values = _directions(stiffness, line_stiffness or {}, direction, dim)
    rows = nodal_rows(np.tile(nodes, len(values))[:, None], np.repeat(directions, len(nodes), axis=0)[:, None], n_dofs)
    return Springs(name, rows, np.repeat(values, len(nodes)), True)


def connecting_springs(
    name: str, points: Array, ends: tuple[AnyArray, AnyArray], stiffness: Mapping[int, float],
    line_stiffness: Mapping[str, float], direction: Array | None = None,
) -> Springs:  # fmt: skip
    """Return springs between pairs of the `points` (n_points, dim) [length].

    The two arrays `ends` (n,) of int contain the first and the second points of the pairs. Springs act along each axis in
    `stiffness` [force / length]. Springs with the stiffnesses ``line_stiffness["axial"]`` and
    ``line_stiffness["transverse"]`` [force / length] act parallel and perpendicular to the line of a pair, or to the unit
    vector `direction` (dim,) [-]. Raises ModelError if the points of a pair are identical, or if they coincide and the line
    between them is needed.
    """
    rows, values = [], []
    for first, second in np.transpose(ends).tolist():
        if first == second:
            raise ModelError(f"{name}: both ends are point {first}; a spring to the ground has no second node")
        axial = _line(name, points, first, second) if line_stiffness and direction is None else direction
        directions, k = _directions(stiffness, line_stiffness, axial, points.shape[1])
        ends_of_rows = np.tile([first, second], (len(k), 1))
        rows.append(nodal_rows(ends_of_rows, np.stack([-directions, directions], axis=1), points.size))
        values.append(k)
    return Springs(name, csr_array(vstack(rows, format="csr")), np.concatenate(values), False)


def _line(name: str, points: Array, first: int, second: int) -> Array:
    """Return the unit vector (dim,) from one point to another."""
    line = points[second] - points[first]
    length = float(np.linalg.norm(line))
    if length <= ROUND_OFF * np.abs(points).max():
        raise ModelError(
            f"{name}: points {first} and {second} coincide, so that no line connects them: give x, y or z instead of "
            "axial, or a direction"
        )
    return np.asarray(line / length)


def _directions(
    stiffness: Mapping[int, float], line_stiffness: Mapping[str, float], direction: Array | None, dim: int
) -> tuple[Array, Array]:
    """Return the directions (m, dim) in which springs act, and their stiffness (m,) [force / length]."""
    directions = [np.eye(dim)[axis] for axis in stiffness]
    values = list(stiffness.values())
    if direction is not None:
        basis = np.vstack([direction, np.linalg.svd(direction[None])[2][1:]])  # the unit vector and its normals
        kinds = ["axial", *["transverse"] * (dim - 1)]
        directions += [vector for vector, kind in zip(basis, kinds, strict=True) if kind in line_stiffness]
        values += [line_stiffness[kind] for kind in kinds if kind in line_stiffness]
    return np.array(directions), np.array(values, float)


def with_springs(K: bsr_array, springs: Sequence[Springs]) -> bsr_array:
    """Return the sum (n, n) [force / length] of the stiffness matrix `K` (n, n) [force / length] and that of the springs."""
    if not springs:
        return K
    return sum_of_blocks(K, spring_stiffness(springs, K.shape[0]))


def spring_stiffness(springs: Sequence[Springs], n: int) -> csr_array:
    """Return the stiffness (n, n) of springs [force / length]."""
    R = stacked_rows(springs, n)
    return csr_array(R.T @ diags_array(np.concatenate([spring.stiffness for spring in springs])) @ R)


def spring_force(springs: Sequence[Springs], u: Array) -> Array:
    """Return the nodal forces (n,) [force] of springs at the displacements `u` (n,) [length]."""
    if not springs:
        return np.zeros_like(u)
    R = stacked_rows(springs, len(u))
    return np.asarray(R.T @ (np.concatenate([spring.stiffness for spring in springs]) * (R @ u)))


def stiffness_warnings(K: bsr_array, springs: Sequence[Springs]) -> list[str]:
    """Return a warning for each set of springs that are too stiff, compared with the bodies at their ends.

    The sum of the stiffnesses of a body and a spring has the absolute accuracy of the larger one, so that digits of the
    results are lost. Springs along an axis to the ground only add to the diagonal of K, like a penalty for a support, which
    does not impair the results.

    Parameters
    ----------
    K : bsr_array (n, n)
        Stiffness without springs [force / length].
    springs : sequence of Springs

    Raises
    ------
    ModelError
        If a ratio of stiffnesses exceeds ERROR_RATIO, so that about four digits or fewer would remain.
    """
    dim, warnings = K.blocksize[0], []
    for spring in springs:
        ratio, body = _stiffness_ratio(spring, K.diagonal(), dim)
        if ratio <= WARNING_RATIO:
            continue
        text = f"{spring.name} is {ratio:.1e} times as stiff as the body at one of its ends ({body:.3g})"
        softer = 0.1 * WARNING_RATIO * body
        remedy = f"use {softer:.0e} or less, or a multi-point constraint (relate, relate_groups), which is exact"
        n_lost = round(math.log10(ratio))
        if ratio > ERROR_RATIO:
            remaining = "no correct digit" if n_lost >= DIGITS else f"only {DIGITS - n_lost} of {DIGITS} correct digits"
            raise ModelError(f"{text}: results would have {remaining}; {remedy}")
        warnings.append(
            f"{text}: results lose up to {n_lost} of {DIGITS} digits, and with contact its force is accurate only to this "
            f"ratio times the convergence criteria; {remedy}"
        )
    return warnings


def _stiffness_ratio(spring: Springs, diagonal: Array, dim: int) -> tuple[float, float]:
    """Return the largest ratio of a spring stiffness to the stiffness of a body at an end of the spring, and the latter."""
    rows = spring.rows.tocoo()
    row, node = rows.coords[0], rows.coords[1] // dim
    ends, index = np.unique(np.stack([row, node]), axis=1, return_inverse=True)
    body = np.bincount(index.ravel(), weights=rows.data**2 * diagonal[rows.coords[1]])
    # Springs that only add to the diagonal of K are ignored, as are points that belong to no body.
    relevant = (np.diff(spring.rows.indptr)[ends[0]] > 1) & (body > 0.0)
    if not relevant.any():
        return 0.0, 0.0
    ratio = spring.stiffness[ends[0][relevant]] / body[relevant]
    return float(ratio.max()), float(body[relevant][ratio.argmax()])


def ground_force(springs: Sequence[Springs], u: Array) -> Array:
    """Return the nodal forces (n_dofs,) [force] of springs to the ground at the displacements `u` (n_dofs,) [length]."""
    return -spring_force([spring for spring in springs if spring.grounded], u)
