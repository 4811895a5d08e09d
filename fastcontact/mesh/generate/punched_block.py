"""A block under a flat punch: finest at the edge of the punch, where the pressure is singular."""

from __future__ import annotations

import numpy as np

from fastcontact.errors import MeshError
from fastcontact.mesh.generate._check import QUADRANGLES, growth_of, one_of, positive
from fastcontact.mesh.generate._lattice import growing, on_lines
from fastcontact.mesh.generate._places import with_cells_inside, with_points_at
from fastcontact.mesh.generate.transform import renamed
from fastcontact.mesh.mesh import Mesh


def punched_block(
    element: str = "quad4",
    *,
    punch_radius: float = 1.0,
    extent: float = 100.0,
    edge_size: float | None = None,
    growth: float = 1.3,
) -> Mesh:
    """Block under a flat punch, the half x >= 0, its top at y = 0, finest at the punch's edge.

    A grid line stands at the edge. The body stands for a half plane or half space: its far sides change the results by about
    `punch_radius` over `extent`, in plane problems by twice as much. Groups of cells: BLOCK, TOP, PUNCHED (the top under the
    punch), BOTTOM, SIDE, SYMMETRY_X (x = 0). Groups of points: POLE (the origin) and EDGE.

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

    Examples
    --------
    >>> mesh = punched_block(punch_radius=2.0)
    >>> float(mesh.points[mesh.point("EDGE"), 0])
    2.0
    """
    one_of("element", element, QUADRANGLES)
    radius = positive("punch_radius", punch_radius)
    whole, rate = positive("extent", extent), growth_of("growth", growth)
    if whole < 2 * radius:
        raise MeshError(f"extent = {whole:g} is out of range: it must be at least 2 punch_radius = {2 * radius:g}")
    size = radius / 200 if edge_size is None else positive("edge_size", edge_size, radius, "punch_radius")
    inward, outward = growing(radius, size, rate), growing(whole - radius, size, rate)
    x = np.concatenate([radius - inward[::-1], radius + outward[1:]])
    x[0], x[-1] = 0.0, whole
    names = {"BLOCK": "BLOCK", "TOP": "TOP", "BOTTOM": "BOTTOM", "RIGHT": "SIDE", "LEFT": "SYMMETRY_X"}
    mesh = renamed(on_lines(element, [x, -growing(whole, size, rate)[::-1]]), names.get)
    mesh = with_cells_inside(mesh, "PUNCHED", "TOP", lambda points: points[:, 0] <= radius)
    return with_points_at(mesh, {"POLE": (0.0, 0.0), "EDGE": (radius, 0.0)})
