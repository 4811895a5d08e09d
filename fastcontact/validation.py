"""Checks of a model before any numerics: materials, supports, overlapping bodies."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from fastcontact.assembly import rigid_modes
from fastcontact.errors import ModelError
from fastcontact.mesh import Mesh
from fastcontact.search import closest
from fastcontact.topology import bodies, outer_facets

Array = NDArray[np.float64]
MODE_NAMES = {
    "axisymmetric": ("translation along y (the axis)",),
    "plane_strain": ("translation along x", "translation along y", "rotation"),
    "plane_stress": ("translation along x", "translation along y", "rotation"),
    "3d": tuple(f"{kind} {axis}" for kind in ("translation along", "rotation about") for axis in "xyz"),
}


def body_name(mesh: Mesh, body: NDArray[np.int32], number: int) -> str:
    """Return a name for a body: a cell group whose solid cells are all of it, or its number."""
    members = np.flatnonzero(body == number)
    for group in mesh.cell_groups:
        blocks = mesh.cells_of(group, dim=mesh.dim)
        if blocks:
            nodes = np.unique(np.concatenate([block.ravel() for block in blocks.values()]))
            if np.array_equal(nodes, members):
                return f"'{group}'"
    return f"number {number + 1} (around {mesh.points[members].mean(axis=0)})"


def free_rigid_modes(mesh: Mesh, kinematics: str, fixed: NDArray[np.bool_]) -> dict[str, list[str]]:
    """Return, by body, the names of the rigid-body motions that the supports leave free.

    `fixed` (n_points, dim) marks supported degrees of freedom. A free motion that mixes several is named by them all.
    """
    count, body = bodies(mesh)
    free = {}
    for number in range(count):
        members = np.flatnonzero(body == number)
        modes = rigid_modes(mesh.points[members], kinematics)
        modes = modes / np.abs(modes).max(axis=0)
        held = modes[fixed[members].ravel()]
        _, values, right = np.linalg.svd(np.vstack([held, np.zeros((modes.shape[1],) * 2)]))
        loose = right[values < 1e-8 * max(values.max(initial=0.0), 1.0)]
        if len(loose):
            names = MODE_NAMES[kinematics]
            free[body_name(mesh, body, number)] = [
                " with ".join(names[i] for i in np.flatnonzero(np.abs(vector) > 1e-6)) for vector in loose
            ]
    return free


def check_supports(mesh: Mesh, kinematics: str, fixed: NDArray[np.bool_]) -> None:
    """Raise ModelError if a body can move without deforming, naming body and motions."""
    free = free_rigid_modes(mesh, kinematics, fixed)
    if free:
        total = sum(map(len, free.values()))
        listing = "; ".join(f"body {name}: {', '.join(modes)}" for name, modes in free.items())
        raise ModelError(
            f"{total} rigid-body motion{'s are' if total > 1 else ' is'} not supported: {listing}. "
            "Fix or prescribe a displacement component that stops each"
        )


def penetration(mesh: Mesh, kinematics: str, coordinates: Array) -> list[tuple[int, int, float, Array]]:
    """Return (body, other, depth, where) for each pair of bodies of which the first has nodes inside the second.

    Depth is the largest distance of such a node to the other body's outside [length]; two dimensions only. The axis
    of an axisymmetric body is not its outside.
    """
    count, body = bodies(mesh)
    facets = [outer[:, :2] for outer in outer_facets(mesh).values()]
    if count < 2 or mesh.dim != 2 or not facets:
        return []
    edges = np.concatenate(facets)
    found = []
    for number in range(count):
        nodes = np.unique(edges[body[edges[:, 0]] == number])
        for other in range(count):
            if other == number:
                continue
            corners = coordinates[edges[body[edges[:, 0]] == other]]
            low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
            near = nodes[((coordinates[nodes] >= low) & (coordinates[nodes] <= high)).all(axis=1)]
            near = near[_inside(coordinates[near], corners)]
            if len(near):
                on_axis = (np.abs(corners[:, :, 0]) <= 1e-9 * np.ptp(mesh.points[:, 0])).all(axis=1)
                outside = corners[~on_axis] if kinematics == "axisymmetric" else corners
                depth = _distance(coordinates[near], outside)
                deepest = int(np.argmax(depth))
                found.append((number, other, float(depth[deepest]), coordinates[near[deepest]]))
    return found


def _inside(points: Array, edges: Array) -> NDArray[np.bool_]:
    """Return which `points` (n, 2) lie inside the closed polygons of `edges` (m, 2, 2), by counting crossings."""
    inside = np.zeros(len(points), bool)
    (ax, ay), (bx, by) = edges[:, 0].T, edges[:, 1].T
    for i, (x, y) in enumerate(points):
        crossed = (ay > y) != (by > y)
        at = ax[crossed] + (y - ay[crossed]) * (bx[crossed] - ax[crossed]) / (by[crossed] - ay[crossed])
        inside[i] = np.count_nonzero(at > x) % 2 == 1
    return inside


def _distance(points: Array, edges: Array) -> Array:
    """Return the distances (n,) of `points` (n, 2) to the closest of `edges` (m, 2, 2)."""
    found = closest(points, edges)
    at = 0.5 * (1 - found.xi)[:, None] * edges[found.facet, 0] + 0.5 * (1 + found.xi)[:, None] * edges[found.facet, 1]
    return np.linalg.norm(points - at, axis=1)


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
                f"body {names[0]} overlaps body {names[1]} by {depth:.3g} near {where} before any load, and no contact pair joins them: add the contact or move one of them"
            )
