"""Checks of a model before any numerics: supports, loads, overlapping bodies."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from fastcontact.errors import ModelError
from fastcontact.mesh import Mesh
from fastcontact.overlap import penetration
from fastcontact.ramp import Table
from fastcontact.rigid_motions import FreeMotions, body_name
from fastcontact.topology import bodies

Array = NDArray[np.float64]


def check_motions(motions: FreeMotions) -> None:
    """Raise ModelError if bodies can move without deforming, naming bodies and motions."""
    if not len(motions):
        return
    total = len(motions)
    listing = "; ".join(f"{name}: {', '.join(found)}" for name, found in motions.by_body().items())
    raise ModelError(
        f"{total} rigid-body motion{'s are' if total > 1 else ' is'} not supported: {listing}. "
        "Fix or prescribe a displacement component that stops each, or let a load press the body against a contact"
    )


def check_ramps(ramped: Iterable[tuple[str, Table | None]], instants: Iterable[float]) -> None:
    """Raise ModelError if the table of a load, support or relation (name, table) does not cover the instants."""
    instants = list(instants)
    for name, table in ramped:
        outside = [t for t in instants if table is not None and not table[0][0] <= t <= table[-1][0]]
        if outside and table is not None:
            raise ModelError(
                f"the ramp of {name} covers {table[0][0]:g} to {table[-1][0]:g}, but the analysis has the instant "
                f"{outside[0]:g}: extend the table"
            )


def check_forces(mesh: Mesh, forces: Array, related: NDArray[np.bool_], name: str) -> None:
    """Raise ModelError if forces (n_points, dim) act on points that no solid cell or relation (n_points,) holds."""
    carried = related.copy()
    for block in mesh.solids.values():
        carried[block] = True
    lost = np.flatnonzero(forces.any(axis=1) & ~carried)
    if len(lost):
        raise ModelError(
            f"{name} acts on {len(lost)} points that belong to no solid cell (first: point {lost[0]}): "
            "name a group of the body, or tie the points to it with couple or relate"
        )


def check_overlap(mesh: Mesh, kinematics: str, paired: Iterable[tuple[str, str]]) -> None:
    """Raise ModelError if bodies overlap in the reference configuration and no contact pair joins them.

    `paired` holds the (secondary, primary) groups of the contact pairs.
    """
    _, body = bodies(mesh)
    joined = {frozenset((int(body[mesh.points_of(a)[0]]), int(body[mesh.points_of(b)[0]]))) for a, b in paired}
    size = float(np.ptp(mesh.points, axis=0).max())
    for number, other, depth, where in penetration(mesh, kinematics, mesh.points):
        if depth > 1e-6 * size and frozenset((number, other)) not in joined:
            names = body_name(mesh, body, number), body_name(mesh, body, other)
            raise ModelError(
                f"body {names[0]} overlaps body {names[1]} by {depth:.3g} near {where} before any load, "
                "and no contact pair joins them: add the contact or move one of them"
            )
