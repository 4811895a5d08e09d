"""A block under a flat punch: finest at the edge of the punch, where the pressure is singular."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastcontact.errors import MeshError
from fastcontact.mesh.generate._check import QUADRANGLES, one_of, positive, segments
from fastcontact.mesh.generate._places import with_points_at
from fastcontact.mesh.generate.blocks import block
from fastcontact.mesh.generate.transform import renamed
from fastcontact.mesh.mesh import Mesh

Array = NDArray[np.float64]


def punched_block(
    element: str = "quad4",
    *,
    punch_radius: float = 1.0,
    extent: float = 100.0,
    edge_size: float | None = None,
    growth: float = 1.3,
) -> Mesh:
    """Block under a flat punch, the half x >= 0, its top at y = 0, finest at the punch's edge.

    A grid line stands at the edge. The body stands for a half plane or half space: its far sides are felt as
    `punch_radius` over `extent`, in plane problems twice as much. Groups of cells: BLOCK, TOP, PUNCHED (the top under
    the punch), BOTTOM, SIDE, SYMMETRY_X (x = 0). Groups of points: POLE (the origin) and EDGE.

    Parameters
    ----------
    element : {"quad4", "quad8", "quad9"}
        Element of the solid.
    punch_radius : float
        Radius of the punch, half its width in plane problems [length].
    extent : float
        Width and depth of the block [length].
    edge_size : float, optional
        Edges at the punch's edge and below the whole top, punch_radius/200 by default [length].
    growth : float
        Length of an edge over that of its neighbour nearer to the punch's edge, more than 1.

    Raises
    ------
    MeshError
        If an argument is out of range.

    Examples
    --------
    >>> mesh = punched_block(punch_radius=2.0)
    >>> float(mesh.points[mesh.point("EDGE"), 0])
    2.0
    """
    one_of("element", element, QUADRANGLES)
    radius = positive("punch_radius", punch_radius)
    whole = positive("extent", extent)
    if whole < 2 * radius:
        raise MeshError(f"extent = {whole:g} is out of range: it must be at least 2 punch_radius = {2 * radius:g}")
    size = radius / 200 if edge_size is None else positive("edge_size", edge_size, radius, "punch_radius")
    if not (rate := positive("growth", growth)) > 1.0:
        raise MeshError(f"growth = {growth:g} is out of range: it must be more than 1")
    inward, outward = _growing(radius, size, rate), _growing(whole - radius, size, rate)
    x = np.concatenate([radius - inward[::-1], radius + outward[1:]])
    y = -_growing(whole, size, rate)[::-1]
    x[0], x[-1] = 0.0, whole
    lattice = block((len(x) - 1.0, len(y) - 1.0), (len(x) - 1, len(y) - 1), element)
    places = [np.interp(p, np.arange(len(lines)), lines) for p, lines in zip(lattice.points.T, (x, y), strict=True)]
    names = {"BLOCK": "BLOCK", "TOP": "TOP", "BOTTOM": "BOTTOM", "RIGHT": "SIDE", "LEFT": "SYMMETRY_X"}
    mesh = renamed(lattice.replace(points=np.column_stack(places)), names.get)
    ((kind, rows),) = mesh.split(mesh.cell_groups["TOP"]).items()
    beneath = (mesh.points[mesh.cells[kind][rows], 0] <= radius).all(axis=1)
    mesh = mesh.with_groups(cells={"PUNCHED": mesh.offsets[kind] + rows[beneath]})
    return with_points_at(mesh, {"POLE": (0.0, 0.0), "EDGE": (radius, 0.0)})


def _growing(length: float, first: float, growth: float) -> Array:
    """Return places (n + 1,) from 0 to `length`: a segment of about `first`, each next one `growth` times as long."""
    n = segments(np.log1p(length * (growth - 1.0) / first) / np.log(growth))
    places = np.concatenate([[0.0], np.cumsum(growth ** np.arange(n))])
    return np.asarray(length * places / places[-1])
