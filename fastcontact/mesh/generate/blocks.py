"""Meshes of rectangular blocks, of a block on a block, and of a cylinder on a block in 2D."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.arrays import Array
from fastcontact.errors import MeshError
from fastcontact.mesh.generate._check import FACES, TRIANGLES, count, each, number, one_of, positive, within
from fastcontact.mesh.generate._spacing import (
    Spacing,
    divide,
    grid_mesh,
    progression,
    rectangular_grid,
    segments_for,
    straight_side,
)
from fastcontact.mesh.generate._triangulate import triangulated_body
from fastcontact.mesh.generate.half_spheres import quarter_disc
from fastcontact.mesh.generate.quadratic import converted_to
from fastcontact.mesh.generate.transform import renamed, union, with_points_at
from fastcontact.mesh.mesh import Mesh


@typed(MeshError)
def block(
    size: tuple[float, float] = (1.0, 1.0),
    divisions: tuple[int, int] = (4, 4),
    element: str = "quad4",
    origin: tuple[float, float] = (0.0, 0.0),
    *,
    name: str = "BLOCK",
    distortion: float = 0.0,
) -> Mesh:
    """Rectangle of equal cells; `box` is the corresponding generator in 3D.

    Groups of cells: `name` (all solid cells) and the sides BOTTOM, RIGHT, TOP, LEFT. Groups of points: the corners
    BOTTOM_LEFT, BOTTOM_RIGHT, TOP_RIGHT, TOP_LEFT.

    Parameters
    ----------
    size : (float, float)
        Width and height [length].
    divisions : (int, int)
        Numbers of quadrangles along the width and the height; for triangles each quadrangle is divided in two.
    element : {"tri3", "tri6", "quad4", "quad8", "quad9"}
        Element type of the solid cells.
    origin : (float, float)
        Lower left corner [length].
    name : str
        Name of the group of all solid cells.
    distortion : float
        Largest displacement of inner nodes in an irregular but fixed pattern, relative to the size of a cell; from 0 to
        0.24 [-].

    Returns
    -------
    Mesh

    Examples
    --------
    >>> from fastcontact import generate
    >>> generate.block((2.0, 1.0), (8, 4), "quad8").cells["quad8"].shape
    (32, 8)
    """
    one_of("element", element, FACES)
    width, height = each(positive, "size", size)
    n, m = each(count, "divisions", divisions)
    left, bottom = each(number, "origin", origin)
    amplitude = within("distortion", distortion, 0.0, 0.24)
    grid = rectangular_grid(left + width * np.linspace(0, 1, n + 1), bottom + height * np.linspace(0, 1, m + 1))
    grid += _distortion_pattern(n, m) * amplitude * np.array([width / n, height / m])
    return _block_mesh(grid, element, name)


def _block_mesh(grid: Array, element: str, name: str) -> Mesh:
    """Return the mesh of a grid with cells of type `element` and with groups for its sides and corners."""
    sides = {side: side for side in ("BOTTOM", "RIGHT", "TOP", "LEFT")}
    mesh = converted_to(grid_mesh(grid, name, sides, triangles=element in TRIANGLES), element)
    corners = {"BOTTOM_LEFT": grid[0, 0], "BOTTOM_RIGHT": grid[-1, 0]}
    return with_points_at(mesh, {**corners, "TOP_RIGHT": grid[-1, -1], "TOP_LEFT": grid[0, -1]})


def _distortion_pattern(n: int, m: int) -> Array:
    """Return irregular but reproducible displacements (n + 1, m + 1, 2) [-] from -1 to 1, which vanish on the sides."""
    i, j = np.indices((n + 1, m + 1))
    shift = np.stack([np.sin(5.1 * i + 2.3 * j + 0.7), np.cos(3.7 * i - 4.3 * j)], axis=2)
    shift[0] = shift[-1] = shift[:, 0] = shift[:, -1] = 0.0
    return shift


@typed(MeshError)
def block_on_block(
    element: str = "quad4",
    *,
    size_lower: tuple[float, float] = (10.0, 5.0),
    size_upper: tuple[float, float] = (10.0, 5.0),
    divisions_lower: tuple[int, int] = (8, 4),
    divisions_upper: tuple[int, int] = (6, 3),
    shift: float = 0.0,
    distortion: float = 0.0,
) -> Mesh:
    """Two rectangular blocks that touch along y = 0; their nodes need not coincide.

    Groups of cells: LOWER, UPPER, CONT_LOWER (top of the lower block), CONT_UPPER (bottom of the upper block) and the
    other sides LOWER_BOTTOM, LOWER_LEFT, LOWER_RIGHT, UPPER_TOP, UPPER_LEFT, UPPER_RIGHT. Groups of points: the eight
    corners, from LOWER_BOTTOM_LEFT to UPPER_TOP_RIGHT.

    Parameters
    ----------
    element : {"tri3", "tri6", "quad4", "quad8", "quad9"}
        Element type of both solids.
    size_lower, size_upper : (float, float)
        Width and height of each block [length].
    divisions_lower, divisions_upper : (int, int)
        Numbers of quadrangles along the width and the height of each block; for triangles each is divided in two.
    shift : float
        Coordinate x of the left side of the upper block; the left side of the lower block is at x = 0 [length]. The blocks
        must overlap in x.
    distortion : float
        Largest displacement of inner nodes in an irregular but fixed pattern, relative to the size of a cell; from 0 to
        0.24 [-].

    Returns
    -------
    Mesh

    Examples
    --------
    >>> from fastcontact import generate
    >>> generate.block_on_block("tri3", divisions_lower=(2, 1), divisions_upper=(3, 1)).n_cells
    24
    """
    width_lower, height = each(positive, "size_lower", size_lower)
    width_upper, _ = each(positive, "size_upper", size_upper)
    if not -width_upper < number("shift", shift) < width_lower:
        limits = f"{-width_upper:g} and {width_lower:g}"
        raise MeshError(f"shift = {shift:g} is out of range: the blocks face each other between {limits}")
    lower = block(size_lower, divisions_lower, element, (0.0, -height), name="LOWER", distortion=distortion)
    upper = block(size_upper, divisions_upper, element, (shift, 0.0), name="UPPER", distortion=distortion)
    return union(_named_block(lower, "LOWER", "TOP"), _named_block(upper, "UPPER", "BOTTOM"))


def _named_block(mesh: Mesh, body: str, contact: str) -> Mesh:
    """Return one block of `block_on_block`, with its groups renamed for the body and its side in contact."""
    names = {name: f"{body}_{name}" for name in mesh.group_names}
    return renamed(mesh, {**names, body: body, contact: f"CONT_{body}"})


@typed(MeshError)
def cylinder_on_block(
    element: str = "quad4",
    *,
    R: float = 50.0,
    block_size: tuple[float, float] | None = None,
    size: float | None = None,
    contact_size: float | None = None,
) -> Mesh:
    """Lower half of a cylinder on a block, the half x >= 0 of both, for plane strain.

    The cylinder is a quarter disc that touches the block at the origin, where both meshes are finest. Groups of cells:
    CYLINDER, BLOCK, AXIS (x = 0 of both bodies), CYLINDER_TOP, CONT_CYLINDER (the arc from the pole to 45 degrees),
    CYLINDER_SIDE (the rest of the arc), CONT_BLOCK (top of the block), BLOCK_SIDE, BLOCK_BOTTOM. Groups of points:
    POLE_CYLINDER, POLE_BLOCK (two points at the origin), CENTRE (of the cylinder).

    Parameters
    ----------
    element : {"tri3", "tri6", "quad4", "quad8", "quad9"}
        Element type of both solids.
    R : float
        Radius of the cylinder [length].
    block_size : (float, float), optional
        Width of the modelled half of the block, and its height; by default both are 2 R [length].
    size : float, optional
        Largest length of the edges far from the contact; by default R/10 [length].
    contact_size : float, optional
        Length of the edges along the surfaces at the contact; by default R/100 [length].

    Returns
    -------
    Mesh

    Examples
    --------
    >>> from fastcontact import generate
    >>> mesh = generate.cylinder_on_block("quad8", R=50.0, size=10.0, contact_size=1.0)
    >>> "CONT_CYLINDER" in mesh.group_names
    True
    """
    one_of("element", element, FACES)
    R = positive("R", R)
    far = R / 10 if size is None else positive("size", size, R / 2, "R/2")
    near = min(R / 100, far) if contact_size is None else positive("contact_size", contact_size, far, "size")
    width, height = each(positive, "block_size", (2 * R, 2 * R) if block_size is None else block_size)
    if element in TRIANGLES:
        foundation = _free_block(element, width, height, Spacing(near, far, reach=R))
    else:
        foundation = _graded_block(element, width, height, near, far)
    return union(_cylinder(element, R, near, far), foundation)


def _cylinder(element: str, R: float, near: float, far: float) -> Mesh:
    """Return the quarter disc above the block, with the group names of the cylinder."""
    if element in TRIANGLES:
        disc = quarter_disc(element, body="upper", R=R, size=far, contact_size=near)
    else:
        n = segments_for(R / 2, far)
        disc = quarter_disc(element, body="upper", R=R, arc_sizes=(near, far), radial_sizes=(near, far), segments=n)
    names = {"SPHHAU": "CYLINDER", "A1A2": "AXIS", "A2B2": "CYLINDER_TOP", "CONT2": "CONT_CYLINDER"}
    names |= {"D2B2": "CYLINDER_SIDE", "C2": "POLE_CYLINDER", "A2": "CENTRE"}
    return renamed(disc, names.get)


_BLOCK_NAMES = {
    "BLOCK": "BLOCK", "BOTTOM": "BLOCK_BOTTOM", "RIGHT": "BLOCK_SIDE", "TOP": "CONT_BLOCK", "LEFT": "AXIS",
    "TOP_LEFT": "POLE_BLOCK",
}  # fmt: skip


def _graded_block(element: str, width: float, height: float, near: float, far: float) -> Mesh:
    """Return a block of quadrangles whose edges along the axes form geometric progressions from the pole."""
    x = width * progression(width, near, far)
    y = -height * progression(height, near, far)[::-1]
    return renamed(_block_mesh(rectangular_grid(x, y + 0.0), element, "BLOCK"), _BLOCK_NAMES.get)


def _free_block(element: str, width: float, height: float, spacing: Spacing) -> Mesh:
    """Return a block of triangles, whose size varies with the distance from the pole in the same way as in the cylinder."""
    corners = [(0.0, 0.0), (0.0, -height), (width, -height), (width, 0.0)]
    names = ["LEFT", "BOTTOM", "RIGHT", "TOP"]
    sides = [
        (name, divide(partial(straight_side, start, end), math.dist(start, end), spacing))
        for name, start, end in zip(names, corners, corners[1:] + corners[:1], strict=True)
    ]
    mesh = converted_to(triangulated_body("BLOCK", sides, spacing), element)
    return renamed(with_points_at(mesh, {"TOP_LEFT": (0.0, 0.0)}), _BLOCK_NAMES.get)
