"""Half or quarter of a block under an indenter, finest around one corner of its top."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastcontact.mesh import elements
from fastcontact.mesh.generate._check import FACES, one_of, positive, unused
from fastcontact.mesh.generate._lattice import graded, on_lines
from fastcontact.mesh.generate._places import with_cells_inside, with_points_at
from fastcontact.mesh.generate._spacing import Spacing
from fastcontact.mesh.generate.box import SOLIDS
from fastcontact.mesh.generate.transform import renamed
from fastcontact.mesh.mesh import Mesh

Array = NDArray[np.float64]

_NAMES_2D = {"LEFT": "SYMMETRY_X", "RIGHT": "SIDE", "TOP": "TOP", "BOTTOM": "BOTTOM"}
_NAMES_3D = {"XMIN": "SYMMETRY_X", "YMIN": "SYMMETRY_Y", "XMAX": "SIDE", "YMAX": "SIDE"} | {
    "ZMAX": "TOP",
    "ZMIN": "BOTTOM",
}
_CORNERS = ("BOTTOM_LEFT", "BOTTOM_RIGHT", "TOP_RIGHT", "TOP_LEFT")


def graded_block(
    element: str = "quad4",
    *,
    width: float = 10.0,
    depth: float | None = None,
    contact_radius: float | None = None,
    contact_radius_y: float | None = None,
    contact_size: float | None = None,
    size: float | None = None,
    growth: float = 0.4,
) -> Mesh:
    """Block under an indenter: x >= 0, and y >= 0 in three dimensions, its top at height 0, finest at the origin.

    It stands for a half plane or half space in contact with a rigid obstacle: with 8 contact radii of width and depth the
    pressure is wrong by a few thousandths. The height is the last coordinate, as for obstacles. Groups of cells: BLOCK, TOP,
    CONTACT (the finely meshed part of the top), BOTTOM, SIDE, SYMMETRY_X (x = 0) and, in three dimensions, SYMMETRY_Y
    (y = 0). Group of points: POLE (the origin).

    Parameters
    ----------
    element : str
        Any solid element; its dimension is that of the mesh.
    width : float
        Extent along x, and along y in three dimensions [length].
    depth : float, optional
        Extent downward, `width` by default [length].
    contact_radius, contact_radius_y : float, optional
        Distances along x, and along y in three dimensions, up to which `contact_size` holds; width/10 and `contact_radius`
        by default; half as deep. Choose them a little wider than the contact [length].
    contact_size : float, optional
        Edges at the contact, a tenth of the smaller radius by default [length].
    size : float, optional
        Longest edges far from the contact, width/4 by default [length].
    growth : float
        Increase of the edges over the distance beyond, until they reach `size`.

    Examples
    --------
    >>> mesh = graded_block("tet4", width=8.0, contact_radius=1.0, contact_radius_y=2.0, contact_size=0.5)
    >>> mesh.dim, mesh.point("POLE") in mesh.points_of("CONTACT")
    (3, True)
    """
    dim = elements.get(one_of("element", element, (*FACES, *SOLIDS))).dim
    width = positive("width", width)
    depth = width if depth is None else positive("depth", depth)
    radius = width / 10 if contact_radius is None else positive("contact_radius", contact_radius, width, "width")
    radii = [radius] * (dim - 1)
    if contact_radius_y is not None:
        if dim == 2:
            unused(element, contact_radius_y=contact_radius_y)
        radii[1] = positive("contact_radius_y", contact_radius_y, width, "width")
    far = width / 4 if size is None else positive("size", size, width, "width")
    near = min(min(radii) / 10, far) if contact_size is None else positive("contact_size", contact_size, far, "size")
    reach = max(far - near, near) / positive("growth", growth, 1.0)

    def places(length: float, plateau: float) -> Array:
        return graded(length, Spacing(near, far, plateau=plateau, reach=plateau + reach))

    lines = [*(places(width, radius) for radius in radii), -places(depth, min(*radii, 2 * depth) / 2)[::-1]]
    return _named(on_lines(element, lines), lines, radii)


def _named(mesh: Mesh, lines: list[Array], radii: list[float]) -> Mesh:
    """Return the mesh with the groups of `graded_block`."""
    mesh = renamed(mesh, dict.fromkeys(_CORNERS) | (_NAMES_2D if mesh.dim == 2 else _NAMES_3D))
    # Grid lines rarely stand at the radius itself: up to the first one not short of it.
    edges = np.array(
        [places[places >= min(radius, places[-1]) * (1 - 1e-9)][0] for places, radius in zip(lines, radii)]
    )
    fine = edges * (1 + 1e-9)
    mesh = with_cells_inside(mesh, "CONTACT", "TOP", lambda points: np.all(points[:, :-1] <= fine, axis=1))
    return with_points_at(mesh, {"POLE": [0.0] * mesh.dim})
