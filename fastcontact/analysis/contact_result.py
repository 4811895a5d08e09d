"""The state of a contact pair as plain data."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastcontact.analysis.active_set import State
from fastcontact.analysis.friction.friction import FrictionalEquilibrium
from fastcontact.contact.constraints import Constraints
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.obstacles.rigid_side import RigidSide
from fastcontact.contact.pairing import normals
from fastcontact.results.step import ContactResult

Array = NDArray[np.float64]
# Penetration under a penalty that is worth a warning, relative to the largest displacement.
DEEP = 0.01


def contact_result(
    name: str, pair: Formulation, part: Constraints, state: State, displacement: Array, rows: slice
) -> ContactResult:
    """Return the state of one pair, whose constraints `part` are the `rows` of the solution."""
    points, dim = pair.secondary.points, pair.points.shape[1]
    multiplier, active = state.multiplier[rows], state.active[rows]
    excluded = pair.terms.excluded_nodes(pair.secondary)
    own = pair.forces(multiplier)
    field = np.where(excluded, 0.0, pair.pressure(own))
    gap, normal = pair.nodal_gap(displacement)
    closed = _closed_nodes(pair, part, active, gap, field) & ~excluded
    forces = part.B.T @ multiplier
    shear, sticking, dissipation = np.zeros((len(points), dim)), closed.copy(), 0.0
    if pair.tie is not None:
        normal = pair.nodal_gap(np.zeros_like(displacement))[1]  # the equations are those of the bodies at rest
        shear = _nodal_shear(pair, pair.tie.directions, pair.tie.forces(multiplier)[1], normal)
    if isinstance(state, FrictionalEquilibrium) and part.tangents:
        tangential, slip = state.tangential[rows], state.slip[rows]
        for rows_along, along in zip(part.tangents, tangential.T, strict=True):
            forces = forces + rows_along.T @ along
        dissipation = float(-(tangential * slip).sum())
        shear = _nodal_shear(pair, part.directions, tangential, normal, own)
        sticking = closed & _mostly_sticking(pair, state.sticking[rows], multiplier, field)
    forces = forces.reshape(-1, dim)[points]
    total = forces.sum(axis=0)
    if pair.axisymmetric:
        total[0] = 0.0  # radial forces cancel over the full circle
    return ContactResult(
        name=name,
        formulation=pair.name,
        points=points,
        coordinates=pair.points[points],
        abscissa=pair.secondary.abscissa if dim == 2 else _distance(pair, pair.points[points]),
        gap=gap,
        pressure=np.where(closed, field if part.held is not None else np.maximum(field, 0.0), 0.0),
        multiplier=field,
        force_vectors=forces,
        normal=normal,
        active=closed,
        force=total,
        radius=_radius(_distance(pair, part.positions), active),
        shear=np.where(closed[:, None], shear, 0.0),
        sticking=sticking,
        dissipation=dissipation,
        obstacle_displacement=pair.primary.now.copy() if isinstance(pair.primary, RigidSide) else None,
    )


def deep(pair: Formulation, contact: ContactResult, displacement: Array) -> list[str]:
    """Return a warning where a penalty lets the sides penetrate by much of the largest displacement."""
    size = float(np.abs(displacement).max(initial=0.0))
    penalty, depth = pair.terms.penalty, contact.penetration
    if penalty is None or depth <= DEEP * size:
        return []
    return [
        f"contact '{contact.name}' penetrates by {depth:.4g}, which is {depth / size:.1%} of the largest displacement: "
        f"raise its penalty from {penalty:.4g} to about {penalty * depth / (DEEP * size):.2g}, or leave it out"
    ]


def _closed_nodes(
    pair: Formulation, part: Constraints, active: NDArray[np.bool_], gap: Array, field: Array
) -> NDArray[np.bool_]:
    """Return which secondary nodes are in contact: by their pressure, or because they never open again."""
    if pair.terms.always_closed:
        return np.isfinite(gap)
    closed = pair.closed_nodes(active, gap, field)
    for_good = pair.closed_for_good(pair.points[pair.secondary.points])
    return closed if for_good is None else closed | for_good


def _nodal_shear(
    pair: Formulation,
    directions: tuple[Array, ...],
    tangential: Array,
    normal: Array,
    along_normal: Array | None = None,
) -> Array:
    """Return the tangential traction on the secondary nodes (n_nodes, dim) [pressure].

    Frames turn from point to point: the traction is that of the Cartesian components of the forces, and its part along
    the nodal normals is no shear.
    """
    forces = np.einsum("nk,ndk->nd", tangential, np.stack(directions, axis=2))
    if along_normal is not None:
        forces += along_normal[:, None] * normals(directions)
    traction = np.column_stack([pair.pressure(component) for component in forces.T])
    return traction - np.einsum("nd,nd->n", traction, normal)[:, None] * normal


def _mostly_sticking(
    pair: Formulation, sticking: NDArray[np.bool_], multiplier: Array, field: Array
) -> NDArray[np.bool_]:
    """Return the nodes to which more force comes from sticking constraints than from sliding ones."""
    if len(sticking) == len(field):
        return sticking
    return pair.pressure(np.where(sticking, multiplier, 0.0)) > 0.5 * field


def _distance(pair: Formulation, positions: Array) -> Array:
    """Return the distances (n,) of reference positions from the axis x = 0; in 3D from that of the first contact."""
    if positions.shape[1] == 2:
        return np.abs(positions[:, 0])
    foot, axis = pair.first_contact
    arm = positions - foot
    return np.linalg.norm(arm - (arm @ axis)[:, None] * axis, axis=1)


def _radius(distance: Array, active: NDArray[np.bool_]) -> tuple[float, float]:
    """Return the distance of the outermost active constraint and of the next one beyond it."""
    if not active.any():
        return float("nan"), float("nan")
    inside = distance[active].max()
    return float(inside), float(distance[distance > inside].min(initial=np.inf))
