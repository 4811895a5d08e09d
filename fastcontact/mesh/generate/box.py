"""Meshes of rectangular boxes in 3D: hexahedra, or hexahedra that are divided into tetrahedra, wedges or pyramids."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.arrays import Array, Indices
from fastcontact.errors import MeshError
from fastcontact.mesh import elements
from fastcontact.mesh.elements import Element
from fastcontact.mesh.generate._check import check_size, count, each, number, one_of, positive
from fastcontact.mesh.generate.blocks import block as rectangle
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.topology import outer_facets

# Steps per edge of a hexahedron of the lattice that contains the nodes of all elements, even the mid-side nodes of pyramids.
STEPS = 4
_HEX = elements.get("hex8")
_CORNERS = ((_HEX.nodes + 1) / 2 * STEPS).astype(np.int64)
# Corners of the cells into which a hexahedron is divided, where 8 is its centre. Adjacent hexahedra are compatible, because
# opposite faces are divided in the same way.
_DIVISIONS = {
    "hex8": [list(range(8))],
    "tet4": [[0, 1, 2, 6], [0, 2, 3, 6], [0, 3, 7, 6], [0, 7, 4, 6], [0, 4, 5, 6], [0, 5, 1, 6]],
    "wedge6": [[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]],
    "pyramid5": [[*reversed(facet), 8] for facet in _HEX.facets],
}
SOLIDS = tuple(name for name, element in elements.ELEMENTS.items() if element.linear in _DIVISIONS)


@typed(MeshError)
def box(
    size: tuple[float, float, float] = (1.0, 1.0, 1.0),
    divisions: tuple[int, int, int] = (4, 4, 4),
    element: str = "hex8",
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0),
    *,
    name: str = "BOX",
) -> Mesh:
    """Box of equal hexahedra, which may be divided into 6 tetrahedra, 2 wedges with axes along z, or 6 pyramids each.

    Groups of cells: `name` (all solid cells) and the outer facets XMIN, XMAX, YMIN, YMAX, ZMIN, ZMAX.

    Parameters
    ----------
    size : (float, float, float)
        Lengths of the box along x, y, z [length].
    divisions : (int, int, int)
        Numbers of hexahedra along x, y, z.
    element : {"hex8", "hex20", "hex27", "tet4", "tet10", "wedge6", "wedge15", "wedge18", "pyramid5", "pyramid13"}
        Element type of the solid cells.
    origin : (float, float, float)
        Corner with the smallest coordinates [length].
    name : str
        Name of the group of all solid cells.

    Returns
    -------
    Mesh

    Examples
    --------
    >>> mesh = box((2.0, 1.0, 1.0), (2, 1, 1), "wedge6")
    >>> mesh.n_points, len(mesh.cells["wedge6"]), sorted(mesh.cells)
    (12, 4, ['quad4', 'tri3', 'wedge6'])
    """
    solid = elements.get(one_of("element", element, SOLIDS))
    lengths, corner = np.array(each(positive, "size", size)), np.array(each(number, "origin", origin))
    shape = np.array(each(count, "divisions", divisions))
    block, lattice = _solids(solid, shape)
    mesh = Mesh(corner + lattice / (STEPS * shape) * lengths, {element: block}, {name: np.arange(len(block))})
    sides = {}
    for axis, letter in enumerate("XYZ"):
        x = mesh.points[:, axis]
        for end, on_side in (("MIN", x == x.min()), ("MAX", x == x.max())):
            facets = {kind: block[on_side[block].all(axis=1)] for kind, block in outer_facets(mesh).items()}
            sides[letter + end] = {kind: block for kind, block in facets.items() if len(block)}
    return mesh.with_facets(sides)


def _solids(solid: Element, shape: Indices) -> tuple[Indices, Indices]:
    """Return the cells (n_cells, n_nodes), and the positions (n_points, 3) of their nodes in steps of the lattice."""
    check_size(float(np.prod(shape, dtype=float)) * len(_DIVISIONS[solid.linear]))
    corners = np.vstack([_CORNERS, _CORNERS.mean(axis=0, keepdims=True).astype(np.int64)])
    local = solid.corner_shape(solid.nodes) @ corners[_DIVISIONS[solid.linear]]
    # Positions in the lattice are numbered, so that coincident nodes have equal numbers.
    n_y, n_z = STEPS * shape[1:] + 1
    weights = np.array([n_y * n_z, n_z, 1])
    first = STEPS * np.indices(tuple(shape.tolist())).reshape(3, -1).T @ weights
    positions = first[:, None, None] + np.rint(local).astype(np.int64) @ weights
    used_positions, block = np.unique(positions, return_inverse=True)
    lattice = np.column_stack([used_positions // (n_y * n_z), used_positions // n_z % n_y, used_positions % n_z])
    return block.reshape(-1, solid.n_nodes), lattice


def mesh_on_lines(element: str, lines: Sequence[Array], name: str = "BLOCK") -> Mesh:
    """Return a mesh with the given grid lines, and with the groups of `block` in 2D and of `box` in 3D.

    Parameters
    ----------
    element : str
        Element type of the solid cells.
    lines : sequence of ndarray (n + 1,)
        Ascending coordinates of the grid lines of each axis [length].
    name : str
        Name of the group of all solid cells.
    """
    make: Callable[..., Mesh] = rectangle if len(lines) == 2 else box
    divisions = tuple(len(line) - 1 for line in lines)
    lattice = make(divisions, divisions, element, name=name)
    points = [np.interp(x, np.arange(len(line)), line) for x, line in zip(lattice.points.T, lines, strict=True)]
    return lattice.replace(points=np.column_stack(points))
