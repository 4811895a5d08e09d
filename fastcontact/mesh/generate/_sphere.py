"""Mesh of a quarter of a sphere on a quarter of a block in 3D, composed of mapped boxes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.arrays import Array
from fastcontact.errors import MeshError
from fastcontact.mesh.generate._check import count, each, one_of, positive
from fastcontact.mesh.generate._spacing import Spacing, graded_positions, segments_for
from fastcontact.mesh.generate.box import mesh_on_lines
from fastcontact.mesh.generate.transform import merge_points, renamed, union, with_points_at
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.quality import check_cells

Map = Callable[[Array, Array, Array], Array]

# Wedges are excluded because the facets of adjacent blocks would not match, and pyramids because the apex of a pyramid would
# lie outside a thin curved hexahedron.
SOLIDS = ("hex8", "hex20", "hex27", "tet4", "tet10")

# Distance of the face centres of the inner block from the centre of the sphere, relative to the radius.
INNER = 0.45
# Curvature of the faces of the inner block, from 0 for planes to 1 for spheres.
BULGE = 0.5


@typed(MeshError)
def sphere_on_block(
    element: str = "hex8",
    *,
    R: float = 50.0,
    block_size: tuple[float, float] | None = None,
    size: float | None = None,
    contact_size: float | None = None,
    contact_radius: float | None = None,
    growth: float = 0.4,
) -> Mesh:
    """Lower half of a sphere on a block, the quarter x >= 0, z >= 0 of both.

    The sphere touches the block at the origin; its centre is (0, R, 0). The meshes of the two bodies are finest at the
    contact and have different nodes there. Groups of cells: SPHERE, BLOCK, SYMMETRY_X and SYMMETRY_Z (x = 0 and z = 0 of
    both bodies), SPHERE_TOP (y = R), CONT_SPHERE (the surface around the pole, up to 45 degrees along x and along z),
    SPHERE_SIDE (the rest of the spherical surface), CONT_BLOCK (top of the block), BLOCK_SIDE, BLOCK_BOTTOM. Groups of
    points: POLE_SPHERE, POLE_BLOCK (two points at the origin), CENTRE (of the sphere).

    Parameters
    ----------
    element : {"hex8", "hex20", "hex27", "tet4", "tet10"}
        Element type of both solids. All surface nodes of the sphere, including mid-side nodes, lie on it.
    R : float
        Radius of the sphere [length].
    block_size : (float, float), optional
        Extent of the quarter of the block along x and z, and its height along y; by default both are R [length].
    size : float, optional
        Largest length of the edges far from the contact; by default R/4 [length].
    contact_size : float, optional
        Length of the edges at the contact; by default R/50 [length].
    contact_radius : float, optional
        Distance from the pole up to which edges have the length `contact_size`; by default R/10 [length]. The depth of
        this fine region below the surfaces is half this distance.
    growth : float
        Increase of the edge length per unit distance outside this region, until `size` is reached [-]. The growth limits
        the accuracy that a smaller `contact_size` alone can achieve.

    Returns
    -------
    Mesh

    Examples
    --------
    >>> mesh = sphere_on_block("tet4", contact_size=5.0)
    >>> mesh.point("POLE_SPHERE") == mesh.point("POLE_BLOCK")
    False
    """
    one_of("element", element, SOLIDS)
    R = positive("R", R)
    width, height = each(positive, "block_size", (R, R) if block_size is None else block_size)
    sizes: Any = {"size": size, "contact_size": contact_size, "contact_radius": contact_radius, "growth": growth}
    sphere, spacing = sphere_octant(element, R=R, **sizes), _spacing(R, **sizes)
    horizontal, vertical = graded_positions(width, spacing), graded_positions(height, _depth_spacing(spacing))
    names = {"BLOCK": "BLOCK", "XMIN": "SYMMETRY_X", "YMIN": "SYMMETRY_Z", "ZMIN": "CONT_BLOCK", "ZMAX": "BLOCK_BOTTOM"}
    names |= {"XMAX": "BLOCK_SIDE", "YMAX": "BLOCK_SIDE"}
    grid = horizontal, horizontal, vertical
    block = _mapped_box(element, grid, lambda x, z, depth: np.column_stack([x, -depth, z]), "BLOCK", names)
    return union(sphere, with_points_at(block, {"POLE_BLOCK": (0.0, 0.0, 0.0)}))


@typed(MeshError)
def sphere_octant(
    element: str = "hex8",
    *,
    R: float = 50.0,
    size: float | None = None,
    contact_size: float | None = None,
    contact_radius: float | None = None,
    growth: float = 0.4,
) -> Mesh:
    """Lower half of a sphere, the quarter x >= 0, z >= 0, with the groups that this body has in `sphere_on_block`.

    The mesh consists of a rounded cube at the centre, and of three blocks between the cube and the spherical surface.

    Parameters
    ----------
    element, R, size, contact_size, contact_radius, growth
        Described for `sphere_on_block`.

    Returns
    -------
    Mesh

    Examples
    --------
    >>> from fastcontact import generate
    >>> generate.sphere_octant("hex8", R=50.0, size=20.0).n_cells
    2868
    """
    one_of("element", element, SOLIDS)
    R = positive("R", R)
    spacing = _spacing(R, size, contact_size, contact_radius, growth)
    eighth = math.pi / 4
    angles = graded_positions(R * eighth, spacing) / R
    radial_lines = 1.0 - graded_positions((1.0 - INNER) * R, _depth_spacing(spacing))[::-1] / ((1.0 - INNER) * R)
    vertical_lines = np.linspace(0.0, eighth, count("segments", segments_for(R * eighth, spacing.far)) + 1)

    def map_of_block(face: int) -> Map:
        """Return the map of the inner block for ``face = -1``, otherwise of the block at its face number `face`."""

        def place(*parameters: Array) -> Array:
            coordinates = np.column_stack(parameters)
            outward = np.zeros(len(coordinates)) if face < 0 else coordinates[:, face].copy()  # 1 on the sphere
            if face >= 0:
                coordinates[:, face] = eighth
            cube = np.tan(coordinates)
            length = np.linalg.norm(cube, axis=1, keepdims=True)
            direction = np.divide(cube, length, out=np.zeros_like(cube), where=length > 0)
            rounded = (1.0 - BULGE) * cube + BULGE * _to_ball(cube)
            x, z, down = (R * ((1.0 - outward[:, None]) * INNER * rounded + outward[:, None] * direction)).T
            return np.column_stack([x, R - down, z])

        return place

    names = {"SPHERE": "SPHERE", "XMIN": "SYMMETRY_X", "YMIN": "SYMMETRY_Z", "ZMIN": "SPHERE_TOP"}
    grids = {-1: {}, 0: {"XMAX": "SPHERE_SIDE"}, 1: {"YMAX": "SPHERE_SIDE"}, 2: {"ZMAX": "CONT_SPHERE"}}
    blocks = []
    for face, outer in grids.items():
        grid = [angles, angles, vertical_lines]
        names_of_block = dict(names)
        if face >= 0:
            grid[face] = radial_lines
            del names_of_block[("XMIN", "YMIN", "ZMIN")[face]]
        blocks.append(_mapped_box(element, grid, map_of_block(face), "SPHERE", names_of_block | outer))
    mesh = merge_points(union(*blocks), 1e-6 * R * float(np.diff(angles).min()))
    check_cells(mesh)
    return with_points_at(mesh, {"POLE_SPHERE": (0.0, 0.0, 0.0), "CENTRE": (0.0, R, 0.0)})


def _to_ball(cube: Array) -> Array:
    """Map points (n, 3) of the cube [-1, 1]^3 smoothly to the unit ball, and its faces to the sphere (Nowell, 2005)."""
    square = cube * cube
    second, third = np.roll(square, -1, axis=1), np.roll(square, -2, axis=1)
    return cube * np.sqrt(1.0 - second / 2 - third / 2 + second * third / 3)


def _spacing(
    R: float, size: float | None, contact_size: float | None, contact_radius: float | None, growth: float
) -> Spacing:
    """Return the spacing along the surfaces, after a check of the arguments of `sphere_on_block`."""
    far = R / 4 if size is None else positive("size", size, R / 2, "R/2")
    near = min(R / 50, far) if contact_size is None else positive("contact_size", contact_size, far, "size")
    plateau = R / 10 if contact_radius is None else positive("contact_radius", contact_radius, R / 2, "R/2")
    return Spacing(near, far, plateau=plateau, reach=plateau + max(far - near, near) / positive("growth", growth, 1.0))


def _depth_spacing(spacing: Spacing) -> Spacing:
    """Return the spacing normal to the surface, whose fine region is half as long as that along the surface."""
    shift = 0.5 * spacing.plateau
    return Spacing(spacing.near, spacing.far, plateau=spacing.plateau - shift, reach=spacing.reach - shift)


def _mapped_box(element: str, grid: Sequence[Array], mapping: Map, solid: str, names: Mapping[str, str]) -> Mesh:
    """Return a box with the given grid lines, mapped by `mapping`. It has the groups that are keys of `names`, renamed."""
    lattice = mesh_on_lines(element, grid, solid)
    sides = {side: lattice.cells_of(side) for side in lattice.cell_groups if side in names and side != solid}
    body = Mesh(mapping(*lattice.points.T), lattice.solids, {solid: lattice.cell_groups[solid]})
    mesh = body.with_facets(sides)
    return renamed(mesh.replace(cell_groups={name: mesh.cell_groups[name] for name in names}), dict(names))
