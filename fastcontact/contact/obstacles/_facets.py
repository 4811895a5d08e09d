"""Facets of a rigid surface: orientation, adjacency and averaged normals.

Each block contains the facets of one element type, and facets are numbered consecutively through all blocks. A ridge is an
end of a line in 2D, and an edge of a face in 3D. Adjacent facets share a ridge.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fastcontact.arrays import Indices, Mask, mask_at
from fastcontact.contact.projection import DeformedSide
from fastcontact.contact.surface import FacetBlock, Surface
from fastcontact.errors import ContactError
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.topology import outer_facets, same_facets


def rigid_facets(mesh: Mesh, group: str, flip: bool, crease: float) -> tuple[DeformedSide, Mask]:
    """Return the facets of a group, with their normals, and the nodes (m,) at which the surface ends.

    Facets that meet at the angle `crease` [degrees] or less form a smooth surface. Raises ContactError if the facets do not
    form an orientable surface.
    """
    side, numbers = _oriented(mesh, group, flip)
    return DeformedSide(side, mesh.points, crease), _border(mesh, side, numbers)


def _oriented(mesh: Mesh, group: str, flip: bool) -> tuple[Surface, Indices]:
    """Return the facets of a group and their cell numbers. With `flip`, the orientation of all facets is reversed.

    Before that, facets on the outside of solid cells point out of these cells, independently of the order of their nodes in
    the group.
    """
    by_type = mesh.split(mesh.cell_groups[group]) if mesh.cells_of(group, dim=mesh.dim - 1) else {}
    by_type = {name: rows for name, rows in by_type.items() if elements.get(name).dim == mesh.dim - 1}
    if not by_type:
        raise ContactError(
            f"group '{group}' contains no facets (cells of dimension {mesh.dim - 1}), so it is not a rigid surface: "
            "name a group of lines in 2D, of triangles or quadrangles in 3D"
        )
    outer = outer_facets(mesh) if mesh.solids else {}
    points = np.unique(np.concatenate([mesh.cells[name][rows].ravel() for name, rows in by_type.items()]))
    blocks = []
    for name, rows in by_type.items():
        facets = mesh.cells[name][rows]
        if name in outer:  # facets of solids are oriented outwards
            outer_rows = same_facets(outer[name], facets)
            facets = np.where((outer_rows >= 0)[:, None], outer[name][outer_rows], facets)
        if flip:
            facets = facets[:, list(elements.get(name).reversed)]
        blocks.append(FacetBlock(name, np.ascontiguousarray(facets), np.searchsorted(points, facets)))
        side = Surface(group, (blocks[-1],), points, np.zeros(len(points)))
        lengths = np.linalg.norm(DeformedSide(side, mesh.points).facet_normals, axis=2)
        degenerate = np.flatnonzero(~(lengths.min(axis=1) > 0.0))
        if len(degenerate):
            raise ContactError(
                f"{_description(mesh, int(rows[degenerate[0]]) + mesh.offsets[name])} of the rigid surface '{group}' has no "
                "area, or none at one of its nodes: remove it or repair the mesh there"
            )
    numbers = np.concatenate([rows + mesh.offsets[name] for name, rows in by_type.items()])
    return Surface(group, tuple(blocks), points, np.zeros(len(points))), numbers


def _description(mesh: Mesh, number: int) -> str:
    """Return a description of a cell with its number, element type and position."""
    ((name, rows),) = mesh.split(np.array([number])).items()
    corners = mesh.cells[name][rows, : elements.get(name).n_corners]
    position = ", ".join(f"{x:.6g}" for x in mesh.points[corners[0]].mean(axis=0))
    return f"facet {number} ({name} near ({position}))"


def _border(mesh: Mesh, side: Surface, numbers: Indices) -> Mask:
    """Return whether the surface ends at its nodes (m,); `numbers` are the cell numbers of the facets.

    A surface ends at ridges that belong to one facet only.

    Raises ContactError, with the number of a facet, if the surface branches or adjacent facets have opposite orientations.
    """
    facet, nodes, sign = _ridges(side)
    _, ridge, count = np.unique(nodes[:, :2], axis=0, return_inverse=True, return_counts=True)
    ridge = ridge.ravel()
    branches = np.flatnonzero(count[ridge] > 2)
    if len(branches):
        raise ContactError(
            f"{_description(mesh, int(numbers[facet[branches[0]]]))} of the rigid surface '{side.group}' shares an edge with "
            "more than one other facet: a surface must not branch, so split it into several groups"
        )
    by_ridge = np.argsort(ridge, kind="stable")
    first, second = by_ridge[count[ridge[by_ridge]] == 2].reshape(-1, 2).T
    _check_orientation(mesh, side, numbers, facet[first], facet[second], sign[first] != sign[second])
    return mask_at(nodes[count[ridge] == 1], len(side.points))


def _ridges(side: Surface) -> tuple[Indices, Indices, Indices]:
    """Return the facet (n,), the nodes (n, 3) and the orientation (n,) of all ridges.

    The nodes are both ends and the middle. An end takes the place of a missing middle node, and in 2D all three are the same.
    """
    facets, nodes, signs = [], [], []
    for block, start in zip(side.blocks, side.offsets):
        element = elements.get(block.element)
        ridges = block.local[:, np.array([(0, 0), (1, 1)] if element.dim == 1 else element.edges)]
        sign = np.sign(ridges[..., 1] - ridges[..., 0])
        signs.append((np.broadcast_to([1, -1], sign.shape) if element.dim == 1 else sign).ravel())
        facets.append(np.repeat(start + np.arange(len(ridges)), ridges.shape[1]))
        end, middles = ridges[..., 0], slice(element.n_corners, element.n_corners + len(element.edges))
        middle = block.local[:, middles] if element.dim == 2 and element.order == 2 else end
        nodes.append(np.stack([*np.sort(ridges, axis=2).transpose(2, 0, 1), middle], axis=2).reshape(-1, 3))
    return np.concatenate(facets), np.concatenate(nodes), np.concatenate(signs)


def _check_orientation(
    mesh: Mesh, side: Surface, numbers: Indices, first: Indices, second: Indices, consistent: Mask
) -> None:
    """Raise ContactError if neighbours have opposite orientations; the message names a facet of the smaller part.

    `first` and `second` (m,) are pairs of neighbours, and `consistent` (m,) marks those with the same orientation.
    """
    if consistent.all():
        return
    graph = coo_array((np.ones(consistent.sum()), (first[consistent], second[consistent])), shape=(side.n_facets,) * 2)
    _, component = connected_components(graph, directed=False)
    size = np.bincount(component)
    wrong = int(np.flatnonzero(~consistent)[0])
    pair = sorted((int(first[wrong]), int(second[wrong])), key=lambda facet: (size[component[facet]], facet))
    raise ContactError(
        f"{_description(mesh, int(numbers[pair[0]]))} of the rigid surface '{side.group}' has the opposite orientation to "
        f"its neighbour facet {numbers[pair[1]]}: reverse it, so that all normals point out of the obstacle"
    )
