"""The state of a contact pair as plain data."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastcontact.active_set import Equilibrium
from fastcontact.contact.constraints import Constraints
from fastcontact.contact.formulations import Formulation
from fastcontact.results import ContactResult

Array = NDArray[np.float64]


def contact_result(
    name: str,
    pair: Formulation,
    constraints: Constraints,
    state: Equilibrium,
    displacement: Array,
    rows: slice,
) -> ContactResult:
    """Return the part of a solution that belongs to one pair, whose constraints are `rows`."""
    points, dim = pair.secondary.points, pair.points.shape[1]
    multiplier, active = state.multiplier[rows], state.active[rows]
    field = pair.pressure(multiplier)
    gap, normal = pair.nodal_gap(displacement)
    closed = pair.closed_nodes(active, gap, field)
    forces = (constraints.B[rows].T @ multiplier).reshape(-1, dim)[points]
    total = forces.sum(axis=0)
    if pair.axisymmetric:
        total[0] = 0.0  # radial forces cancel over the full circle
    return ContactResult(
        name=name,
        formulation=pair.name,
        points=points,
        coordinates=pair.points[points],
        abscissa=pair.secondary.abscissa,
        gap=gap,
        pressure=np.where(closed, np.maximum(field, 0.0), 0.0),
        multiplier=field,
        force_vectors=forces,
        normal=normal,
        active=closed,
        force=total,
        radius=_radius(np.abs(constraints.positions[rows, 0]), active),
    )


def _radius(distance: Array, active: NDArray[np.bool_]) -> tuple[float, float]:
    """Return the distances from x = 0 of the outermost active constraint and of the next one beyond it."""
    if not active.any():
        return float("nan"), float("nan")
    inside = distance[active].max()
    return float(inside), float(distance[distance > inside].min(initial=np.inf))
