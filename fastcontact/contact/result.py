"""The state of a contact pair as plain data."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastcontact.active_set import State
from fastcontact.contact.constraints import Constraints
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.pairing import tangents
from fastcontact.friction import FrictionalEquilibrium
from fastcontact.results import ContactResult

Array = NDArray[np.float64]


def contact_result(
    name: str, pair: Formulation, part: Constraints, state: State, displacement: Array, rows: slice
) -> ContactResult:
    """Return the state of one pair, whose constraints `part` are the `rows` of the solution."""
    points, dim = pair.secondary.points, pair.points.shape[1]
    multiplier, active = state.multiplier[rows], state.active[rows]
    field = pair.pressure(multiplier)
    gap, normal = pair.nodal_gap(displacement)
    closed = pair.closed_nodes(active, gap, field)
    forces = part.B.T @ multiplier
    shear, sticking, dissipation = np.zeros((len(points), dim)), closed.copy(), 0.0
    if isinstance(state, FrictionalEquilibrium) and part.tangents:
        tangential, slip = state.tangential[rows], state.slip[rows]
        for rows_along, along in zip(part.tangents, tangential.T, strict=True):
            forces = forces + rows_along.T @ along
        dissipation = float(-(tangential * slip).sum())
        shear = _nodal_shear(pair, part, tangential, normal)
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
        pressure=np.where(closed, np.maximum(field, 0.0), 0.0),
        multiplier=field,
        force_vectors=forces,
        normal=normal,
        active=closed,
        force=total,
        radius=_radius(_distance(pair, part.positions), active),
        shear=np.where(closed[:, None], shear, 0.0),
        sticking=sticking,
        dissipation=dissipation,
    )


def _nodal_shear(pair: Formulation, part: Constraints, tangential: Array, normal: Array) -> Array:
    """Return the tangential traction on the secondary nodes (n_nodes, dim) [pressure]."""
    at_nodes = tangents(normal)
    if normal.shape[1] == 2:
        return pair.pressure(tangential[:, 0])[:, None] * at_nodes[0]
    # In three dimensions the tangents turn from point to point: take the Cartesian components of the forces.
    directions = np.stack(part.directions, axis=2)
    cartesian = np.einsum("nk,ndk->nd", tangential, directions)
    return np.column_stack([pair.pressure(component) for component in cartesian.T])


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
