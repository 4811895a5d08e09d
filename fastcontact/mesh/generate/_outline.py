"""A body bounded by named sides, filled with triangles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fastcontact.mesh.generate._spacing import Spacing
from fastcontact.mesh.generate._triangulate import triangulated
from fastcontact.mesh.mesh import Mesh

Array = NDArray[np.float64]


def filled(solid: str, sides: Sequence[tuple[str, Array]], spacing: Spacing) -> Mesh:
    """Return a triangle mesh of a convex body, its cells in the group `solid`.

    The names and the nodes of its `sides` (n, 2) [length] run counter-clockwise, each from the end of the one before.
    `spacing` gives the longest inner edges.
    """
    outline = np.vstack([nodes[:-1] for _, nodes in sides])
    points, triangles = triangulated(outline, spacing)
    here = np.arange(len(outline))
    lines = np.column_stack([here, np.roll(here, -1)])
    groups, first = {solid: np.arange(len(triangles))}, len(triangles)
    for name, nodes in sides:
        groups[name] = first + np.arange(len(nodes) - 1)
        first += len(nodes) - 1
    return Mesh(points, {"tri3": triangles, "line2": lines}, groups)


def straight(start: Sequence[float], end: Sequence[float], relative: Array) -> Array:
    """Return points (n, 2) [length] of a straight side at the abscissae `relative` (n,) [-], its ends exact."""
    a, b, s = np.asarray(start, float), np.asarray(end, float), relative[:, None]
    return np.where(s < 1.0, a + s * (b - a), b)


def arc(centre: Sequence[float], radius: float, angles: Array) -> Array:
    """Return points (n, 2) [length] of a circle at `angles` (n,) [radian] from its topmost point, clockwise."""
    return np.asarray(centre, float) + radius * np.column_stack([np.sin(angles), np.cos(angles)])
