"""The state of a contact pair as plain data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fastcontact.analysis.solution import FrictionalEquilibrium, Solution
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.obstacles.rigid_side import RigidSide
from fastcontact.contact.pairing import normals
from fastcontact.results.step import ContactResult

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def contact_result(
    name: str, pair: Formulation, part: Constraints, solution: Solution, rows: slice, at: Configuration,
    axis: tuple[Array, Array] | None = None,
) -> ContactResult:  # fmt: skip
    """Return the state of one pair at the end of a load step.

    Parameters
    ----------
    name : str
    pair : Formulation
    part : Constraints
        Those of the pair in the last pairing.
    solution : Solution
        Of all pairs; those of this one are its `rows`.
    rows : slice
    at : Configuration
        At the end of the step.
    axis : (ndarray (dim,), ndarray (dim,)), optional
        In space, where the bodies met first [length] and the normal there [-].
    """
    points, dim = pair.secondary.points, pair.points.shape[1]
    multiplier, active = solution.multiplier[rows], solution.active[rows]
    excluded = pair.options.excluded_nodes(pair.secondary)
    pressure = np.where(excluded, 0.0, part.pressure(multiplier))
    gap, normal = pair.nodal_gap(at)
    closed = _closed_nodes(pair, part, active, gap, pressure, at) & ~excluded
    tangential = None
    shear, sticking, dissipation = np.zeros((len(points), dim)), closed.copy(), 0.0
    if part.tied is not None:
        normal = pair.nodal_gap(replace(at, displacement=np.zeros_like(at.displacement)))[
            1
        ]  # the bodies at rest are tied
        shear = _nodal_shear(part, part.tied.directions, part.tied.forces(multiplier)[1], normal)
    if isinstance(solution, FrictionalEquilibrium) and part.tangents:
        tangential, slip = solution.tangential[rows], solution.slip[rows]
        dissipation = float(-(tangential * slip).sum())
        shear = _nodal_shear(part, part.directions, tangential, normal, part.normal_forces(multiplier))
        sticking = closed & _mostly_sticking(part, solution.sticking[rows], multiplier, pressure)
    forces = _nodal_forces(part, multiplier, tangential).reshape(-1, dim)[points]
    total = forces.sum(axis=0)
    if pair.axisymmetric:
        total[0] = 0.0  # radial forces cancel over the full circle
    coordinates = pair.points[points]
    return ContactResult(
        name=name,
        formulation=pair.name,
        points=points,
        coordinates=coordinates,
        abscissa=pair.secondary.abscissa if axis is None else _distance(coordinates, axis),
        gap=gap,
        pressure=np.where(closed, pressure if part.equality is not None else np.maximum(pressure, 0.0), 0.0),
        multiplier=pressure,
        force_vectors=forces,
        normal=normal,
        active=closed,
        force=total,
        radius=_radius(_distance(part.positions, axis), active),
        shear=np.where(closed[:, None], shear, 0.0),
        sticking=sticking,
        dissipation=dissipation,
        obstacle_displacement=at.obstacle.copy() if isinstance(pair.primary, RigidSide) else None,
    )


def _nodal_forces(part: Constraints, multiplier: Array, tangential: Array | None) -> Array:
    """Return the nodal contact forces (n_dofs,) of a pair, with friction if there are tangential forces (m, k)."""
    forces = part.B.T @ multiplier
    for rows, along in zip(part.tangents, () if tangential is None else tangential.T):
        forces = forces + rows.T @ along
    return np.asarray(forces)


def _closed_nodes(
    pair: Formulation, part: Constraints, active: Mask, gap: Array, pressure: Array, at: Configuration
) -> Mask:
    """Return which secondary nodes are in contact: by their pressure, or because they never open again."""
    if pair.options.always_closed:
        return np.isfinite(gap)
    assert part.nodal is not None
    closed = part.nodal.closed_nodes(active, gap, pressure)
    for_good = pair.never_opening(pair.points[pair.secondary.points], at)
    return closed if for_good is None else closed | for_good


def _nodal_shear(
    part: Constraints,
    directions: tuple[Array, ...],
    tangential: Array,
    normal: Array,
    along_normal: Array | None = None,
) -> Array:
    """Return the tangential traction on the secondary nodes (n_nodes, dim) [pressure].

    Frames turn from point to point: the traction is that of the Cartesian components of the forces, and its part along
    the nodal normals is no shear.
    """
    assert part.nodal is not None
    forces = np.einsum("nk,ndk->nd", tangential, np.stack(directions, axis=2))
    if along_normal is not None:
        forces += along_normal[:, None] * normals(directions)
    traction = np.column_stack([part.nodal.pressure(component) for component in forces.T])
    return traction - np.einsum("nd,nd->n", traction, normal)[:, None] * normal


def _mostly_sticking(part: Constraints, sticking: Mask, multiplier: Array, pressure: Array) -> Mask:
    """Return the nodes to which more force comes from sticking constraints than from sliding ones."""
    if len(sticking) == len(pressure):
        return sticking
    assert part.nodal is not None
    return part.nodal.pressure(np.where(sticking, multiplier, 0.0)) > 0.5 * pressure


def _distance(positions: Array, axis: tuple[Array, Array] | None) -> Array:
    """Return the distances (n,) of reference positions from the axis x = 0, or from another axis (place, direction)."""
    if axis is None:
        return np.abs(positions[:, 0])
    foot, direction = axis
    arm = positions - foot
    return np.linalg.norm(arm - (arm @ direction)[:, None] * direction, axis=1)


def _radius(distance: Array, active: Mask) -> tuple[float, float]:
    """Return the distance of the outermost active constraint and of the next one beyond it."""
    if not active.any():
        return float("nan"), float("nan")
    inside = distance[active].max()
    return float(inside), float(distance[distance > inside].min(initial=np.inf))
