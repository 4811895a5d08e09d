"""Blocks that represent half-planes and half-spaces: under an indenter, under a flat punch, crowned against each other."""

from __future__ import annotations

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.arrays import Array
from fastcontact.errors import MeshError
from fastcontact.mesh import elements
from fastcontact.mesh.generate._check import FACES, QUADRANGLES, growth_of, one_of, positive, segments, unused
from fastcontact.mesh.generate._spacing import Spacing, graded, growing
from fastcontact.mesh.generate.box import SOLIDS, on_lines
from fastcontact.mesh.generate.transform import mirrored, renamed, union, with_cells_inside, with_points_at
from fastcontact.mesh.mesh import Mesh

_NAMES_2D = {"LEFT": "SYMMETRY_X", "RIGHT": "SIDE", "TOP": "TOP", "BOTTOM": "BOTTOM"}
_NAMES_3D = {
    "XMIN": "SYMMETRY_X", "YMIN": "SYMMETRY_Y", "XMAX": "SIDE", "YMAX": "SIDE", "ZMAX": "TOP", "ZMIN": "BOTTOM",
}  # fmt: skip
_CORNERS = ("BOTTOM_LEFT", "BOTTOM_RIGHT", "TOP_RIGHT", "TOP_LEFT")
_NAMES_CROWNED = {"LOWER": "LOWER", "TOP": "CONT_LOWER", "BOTTOM": "FAR_LOWER"}


@typed(MeshError)
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

    It represents a half-plane or half-space in contact with a rigid obstacle: with a width and depth of 8 contact
    radii the error of the pressure is a few thousandths. The height is the last coordinate, as for obstacles. Groups
    of cells: BLOCK, TOP, CONTACT (the finely meshed part of the top), BOTTOM, SIDE, SYMMETRY_X (x = 0) and, in three
    dimensions, SYMMETRY_Y (y = 0). Group of points: POLE (the origin).

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
        by default. Below the surface `contact_size` holds to half of this distance. Choose them a little wider than the
        contact [length].
    contact_size : float, optional
        Edges at the contact, a tenth of the smaller radius by default [length].
    size : float, optional
        Longest edges far from the contact, width/4 by default [length].
    growth : float
        Increase of the edge length per unit of distance outside this region, until it reaches `size`.

    Returns
    -------
    Mesh

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
    # Up to the first grid line at or beyond the radius.
    edges = np.array(
        [places[places >= min(radius, places[-1]) * (1 - 1e-9)][0] for places, radius in zip(lines, radii)]
    )
    fine = edges * (1 + 1e-9)
    mesh = with_cells_inside(mesh, "CONTACT", "TOP", lambda points: np.all(points[:, :-1] <= fine, axis=1))
    return with_points_at(mesh, {"POLE": [0.0] * mesh.dim})


@typed(MeshError)
def punched_block(
    element: str = "quad4",
    *,
    punch_radius: float = 1.0,
    extent: float = 100.0,
    edge_size: float | None = None,
    growth: float = 1.3,
) -> Mesh:
    """Block under a flat punch, the half x >= 0, its top at y = 0, finest at the punch's edge.

    A grid line passes through the edge. The body represents a half-plane or half-space: its finite size changes the
    results by about `punch_radius` over `extent`, in plane problems by twice as much. Groups of cells: BLOCK, TOP,
    PUNCHED (the top under the punch), BOTTOM, SIDE, SYMMETRY_X (x = 0). Groups of points: POLE (the origin) and EDGE.

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
        Ratio of the lengths of adjacent edges away from the punch's edge, more than 1.

    Returns
    -------
    Mesh

    Examples
    --------
    >>> mesh = punched_block(punch_radius=2.0)
    >>> float(mesh.points[mesh.point("EDGE"), 0])
    2.0
    """
    one_of("element", element, QUADRANGLES)
    radius = positive("punch_radius", punch_radius)
    width, rate = positive("extent", extent), growth_of("growth", growth)
    if width < 2 * radius:
        raise MeshError(f"extent = {width:g} is out of range: it must be at least 2 punch_radius = {2 * radius:g}")
    size = radius / 200 if edge_size is None else positive("edge_size", edge_size, radius, "punch_radius")
    inward, outward = growing(radius, size, rate), growing(width - radius, size, rate)
    x = np.concatenate([radius - inward[::-1], radius + outward[1:]])
    x[0], x[-1] = 0.0, width
    mesh = on_lines(element, [x, -growing(width, size, rate)[::-1]])
    mesh = renamed(mesh, dict.fromkeys(_CORNERS) | _NAMES_2D)
    mesh = with_cells_inside(mesh, "PUNCHED", "TOP", lambda points: points[:, 0] <= radius)
    return with_points_at(mesh, {"POLE": (0.0, 0.0), "EDGE": (radius, 0.0)})


@typed(MeshError)
def crowned_blocks(
    element: str = "quad4",
    *,
    R: float = 500.0,
    extent: float = 40.0,
    contact_radius: float = 1.1,
    contact_size: float = 0.05,
    growth: float = 1.25,
) -> Mesh:
    """Two blocks above each other whose facing sides are parabolas of radius R that touch at the origin.

    Both represent half-planes. They include x < 0, for tangential loads, and mirror each other, so that nodes match
    and equal materials do not couple pressure and shear. Groups of cells: LOWER, UPPER, CONT_LOWER, CONT_UPPER (their
    facing sides around the origin), FAR_LOWER, FAR_UPPER (the flat sides far from it). Groups of points: POLE_LOWER,
    POLE_UPPER (two points at the origin).

    Parameters
    ----------
    element : {"quad4", "quad8", "quad9"}
        Element of both solids.
    R : float
        Radius at the origin of each facing side [length].
    extent : float
        Height and half the width of each block [length].
    contact_radius : float
        Distance from the origin up to which edges have their smallest length. Choose it a little wider than the contact
        [length].
    contact_size : float
        Smallest length of edges [length].
    growth : float
        Ratio of the lengths of adjacent edges outside `contact_radius`, more than 1.

    Returns
    -------
    Mesh

    Examples
    --------
    >>> mesh = crowned_blocks(contact_size=0.1)
    >>> mesh.point("POLE_LOWER") == mesh.point("POLE_UPPER")
    False
    """
    one_of("element", element, QUADRANGLES)
    R, width, rate = positive("R", R), positive("extent", extent), growth_of("growth", growth)
    if width > R:
        raise MeshError(f"extent = {width:g} is out of range: it must be at most R = {R:g}")
    fine = positive("contact_radius", contact_radius, width / 2, "extent/2")
    size = positive("contact_size", contact_size, fine, "contact_radius")
    right, down = _lines(size, fine, width, rate), _lines(size, size, width, rate)
    lattice = on_lines(element, [np.concatenate([-right[:0:-1], right]), -down[::-1]], "LOWER")
    across, up = lattice.points.T
    crown = across**2 / (2 * R) * (1 + up / width)  # decays downward
    lower = renamed(lattice.replace(points=np.column_stack([across, up - crown])), _NAMES_CROWNED.get)
    lower = with_cells_inside(lower, "CONT_LOWER", "CONT_LOWER", lambda points: np.abs(points[:, 0]) <= 1.2 * fine)
    lower = with_points_at(lower, {"POLE_LOWER": (0.0, 0.0)})
    upper = mirrored(lower, "y", rename=lambda name: name.replace("LOWER", "UPPER"))
    return union(lower, upper)


def _lines(size: float, fine: float, length: float, growth: float) -> Array:
    """Return positions (n + 1,) [length] from 0 to `length`: about `size` apart up to `fine`, then growing."""
    equal = np.linspace(0.0, fine, segments(round(fine / size)) + 1)
    return np.concatenate([equal, fine + growing(length - fine, size * growth, growth)[1:]])
