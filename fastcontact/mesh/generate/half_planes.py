"""Meshes of half-planes and half-spaces: a block under an indenter, a block under a punch, and two crowned blocks."""

from __future__ import annotations

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.arrays import Array
from fastcontact.errors import MeshError
from fastcontact.mesh import elements
from fastcontact.mesh.generate._check import FACES, QUADRANGLES, growth_of, one_of, positive, refuse, segments
from fastcontact.mesh.generate._spacing import Spacing, graded_positions, growing_positions
from fastcontact.mesh.generate.box import SOLIDS, mesh_on_lines
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
    """Block under an indenter, with its top at height 0 and a mesh that is refined at the origin.

    Only the part x >= 0 is modelled, in 3D also y >= 0. The block represents a half-plane or half-space in contact with a
    rigid obstacle. If its width and depth are 8 contact radii, the error of the pressure is a few thousandths. The height
    is the last coordinate, y in 2D and z in 3D. Groups of cells: BLOCK, TOP, CONTACT (the finely meshed part of the top),
    BOTTOM, SIDE, SYMMETRY_X (x = 0) and, in 3D, SYMMETRY_Y (y = 0). Group of points: POLE (the origin).

    Parameters
    ----------
    element : str
        Any element type of solid cells; its dimension is the dimension of the mesh.
    width : float
        Extent along x, in 3D also along y [length].
    depth : float, optional
        Extent downward; by default `width` [length].
    contact_radius : float, optional
        Distance from the origin along x up to which edges have the length `contact_size`; by default width/10 [length].
        Choose it slightly larger than the contact radius. The depth of this fine region is half the smaller of its extents
        along x and y.
    contact_radius_y : float, optional
        The corresponding distance along y, in 3D; by default `contact_radius` [length].
    contact_size : float, optional
        Length of the edges at the contact; by default a tenth of the smaller of the two radii [length].
    size : float, optional
        Largest length of the edges far from the contact; by default width/4 [length].
    growth : float
        Increase of the edge length per unit distance outside the fine region, until `size` is reached [-].

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
            refuse(element, contact_radius_y=contact_radius_y)
        radii[1] = positive("contact_radius_y", contact_radius_y, width, "width")
    size = width / 4 if size is None else positive("size", size, width, "width")
    # h is the edge length at the contact, and `size` that far from it.
    h = min(min(radii) / 10, size) if contact_size is None else positive("contact_size", contact_size, size, "size")
    reach = max(size - h, h) / positive("growth", growth, 1.0)

    def coordinates(length: float, plateau: float) -> Array:
        return graded_positions(length, Spacing(h, size, plateau=plateau, reach=plateau + reach))

    lines = [*(coordinates(width, radius) for radius in radii), -coordinates(depth, min(*radii, 2 * depth) / 2)[::-1]]
    return _with_groups(mesh_on_lines(element, lines), lines, radii)


def _with_groups(mesh: Mesh, lines: list[Array], radii: list[float]) -> Mesh:
    """Return the mesh with the groups of `graded_block`."""
    mesh = renamed(mesh, dict.fromkeys(_CORNERS) | (_NAMES_2D if mesh.dim == 2 else _NAMES_3D))
    # The fine region ends at the first grid line at or beyond the radius.
    ends = np.array([x[x >= min(radius, x[-1]) * (1 - 1e-9)][0] for x, radius in zip(lines, radii)])
    limits = ends * (1 + 1e-9)
    mesh = with_cells_inside(mesh, "CONTACT", "TOP", lambda points: np.all(points[:, :-1] <= limits, axis=1))
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
    """Block under a flat punch, with its top at y = 0 and the finest mesh at the edge of the punch.

    Only the half x >= 0 is modelled. A grid line passes through the edge of the punch. The block represents a half-plane or
    half-space. Its finite size changes the results by a relative amount of about `punch_radius` / `extent`, in plane problems
    by twice this amount. Groups of cells: BLOCK, TOP, PUNCHED (the part of the top under the punch), BOTTOM, SIDE, SYMMETRY_X
    (x = 0). Groups of points: POLE (the origin) and EDGE (the edge of the punch).

    Parameters
    ----------
    element : {"quad4", "quad8", "quad9"}
        Element type of the solid cells.
    punch_radius : float
        Radius of the punch, in plane problems half its width [length].
    extent : float
        Width and depth of the block [length].
    edge_size : float, optional
        Length of the element edges next to the edge of the punch, and of the vertical element edges along the entire top; by
        default punch_radius/200 [length].
    growth : float
        Ratio of the lengths of adjacent edges with increasing distance from the edge of the punch, greater than 1.

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
    width, ratio = positive("extent", extent), growth_of("growth", growth)
    if width < 2 * radius:
        raise MeshError(f"extent = {width:g} is out of range: it must be at least 2 punch_radius = {2 * radius:g}")
    size = radius / 200 if edge_size is None else positive("edge_size", edge_size, radius, "punch_radius")
    inward, outward = growing_positions(radius, size, ratio), growing_positions(width - radius, size, ratio)
    x = np.concatenate([radius - inward[::-1], radius + outward[1:]])
    x[0], x[-1] = 0.0, width
    mesh = mesh_on_lines(element, [x, -growing_positions(width, size, ratio)[::-1]])
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
    """Two blocks, one above the other, whose facing sides are parabolas that touch at the origin.

    The blocks represent half-planes. They are modelled on both sides of x = 0, which tangential loads require. The upper
    block is the mirror image of the lower one, so that their nodes coincide and, with equal materials, pressure and shear
    are not coupled. Groups of cells: LOWER, UPPER, CONT_LOWER, CONT_UPPER (the facing sides around the origin), FAR_LOWER,
    FAR_UPPER (the flat bottom of the lower and the flat top of the upper block). Groups of points: POLE_LOWER, POLE_UPPER
    (two points at the origin).

    Parameters
    ----------
    element : {"quad4", "quad8", "quad9"}
        Element type of both solids.
    R : float
        Radius of curvature of each facing side at the origin [length].
    extent : float
        Height and half the width of each block [length].
    contact_radius : float
        Distance from the origin up to which edges have the length `contact_size` [length]. Choose it slightly larger than
        the contact.
    contact_size : float
        Smallest length of the edges [length].
    growth : float
        Ratio of the lengths of adjacent edges outside `contact_radius`, greater than 1.

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
    R, width, ratio = positive("R", R), positive("extent", extent), growth_of("growth", growth)
    if width > R:
        raise MeshError(f"extent = {width:g} is out of range: it must be at most R = {R:g}")
    radius = positive("contact_radius", contact_radius, width / 2, "extent/2")
    size = positive("contact_size", contact_size, radius, "contact_radius")
    right, down = _positions(size, radius, width, ratio), _positions(size, size, width, ratio)
    lattice = mesh_on_lines(element, [np.concatenate([-right[:0:-1], right]), -down[::-1]], "LOWER")
    x, y = lattice.points.T
    crown = x**2 / (2 * R) * (1 + y / width)  # the displacement of the nodes decays downward
    lower = renamed(lattice.replace(points=np.column_stack([x, y - crown])), _NAMES_CROWNED.get)
    lower = with_cells_inside(lower, "CONT_LOWER", "CONT_LOWER", lambda points: np.abs(points[:, 0]) <= 1.2 * radius)
    lower = with_points_at(lower, {"POLE_LOWER": (0.0, 0.0)})
    upper = mirrored(lower, "y", rename=lambda name: name.replace("LOWER", "UPPER"))
    return union(lower, upper)


def _positions(size: float, radius: float, length: float, growth: float) -> Array:
    """Return positions (n + 1,) [length] from 0 to `length`, with a spacing near `size` up to `radius` that grows beyond."""
    equal = np.linspace(0.0, radius, segments(round(radius / size)) + 1)
    return np.concatenate([equal, radius + growing_positions(length - radius, size * growth, growth)[1:]])
