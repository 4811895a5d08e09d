"""A Mesh from the blocks of cells of a mesh file, each with its own groups."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from fastcontact.arrays import AnyArray, Indices
from fastcontact.errors import MeshError, warn
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import Mesh

VERTEX = "vertex"
# Largest number of unknown kinds of cells in a message, and of characters of each name.
SHOWN = 12

Groups = dict[str, AnyArray]


@dataclass(frozen=True, eq=False)
class Block:
    """Cells of one kind, an element or ``"vertex"``: connectivity (n_cells, n_nodes), and the rows of it in each group."""

    kind: str
    nodes: AnyArray
    groups: Mapping[str, Indices] = field(default_factory=dict)


def build_mesh(
    points: AnyArray, blocks: Iterable[Block], point_groups: Mapping[str, AnyArray], names: Iterable[str] = ()
) -> Mesh:
    """Return one Mesh of all blocks, with `points` (n_points, 2 or 3) [length].

    Blocks of the same kind are joined, groups of vertex cells become groups of points, `names` without any cell become
    empty groups, and a flat mesh in 3D coordinates becomes a 2D one.
    """
    try:
        places = np.asarray(points, np.float64)
    except (TypeError, ValueError):
        raise MeshError("its coordinates are not numbers: check that the file is complete") from None
    joined = merged(blocks)
    solid = [block for block in joined if block.kind != VERTEX and len(block.nodes)]
    vertices = [block for block in joined if block.kind == VERTEX]
    if not solid:
        raise MeshError("the mesh has no cells: nothing can be computed on points alone")
    cell_groups: Groups = {name: np.empty(0, np.intp) for name in names} | _numbered(solid)
    all_point_groups = {name: np.asarray(members, np.intp) for name, members in point_groups.items()}
    for block in vertices:
        for name in _add_vertices(all_point_groups, block, solid):
            cell_groups.pop(name, None)
    dim = max(elements.get(block.kind).dim for block in solid)
    cells = {block.kind: block.nodes for block in solid}
    return Mesh(_without_flat_z(places, dim), cells, cell_groups, all_point_groups)


def check_kinds(foreign: Mapping[str, int], known: Iterable[str]) -> None:
    """Raise MeshError if there are cells of any unknown kind in `foreign`, numbers of cells by kind."""
    if foreign:
        listed = [f"{count} cells of kind {kind[:SHOWN]}" for kind, count in list(foreign.items())[:SHOWN]]
        more = [f"{len(foreign) - SHOWN} kinds more"] if len(foreign) > SHOWN else []
        raise MeshError(
            f"it has {', '.join([*listed, *more])}, which fastcontact does not know: use only {', '.join(sorted(known))}"
        )


def merged(blocks: Iterable[Block]) -> list[Block]:
    """Return one block of each kind, in the order in which the kinds first appear."""
    by_kind: dict[str, list[Block]] = {}
    for block in blocks:
        by_kind.setdefault(block.kind, []).append(block)
    return [
        Block(kind, np.concatenate([part.nodes for part in parts]), _numbered(parts)) for kind, parts in by_kind.items()
    ]


def without_duplicates(block: Block) -> Block:
    """Return the block with duplicate cells, and their groups, merged."""
    if not len(block.nodes):
        return block
    _, first, inverse = np.unique(np.sort(block.nodes, axis=1), axis=0, return_index=True, return_inverse=True)
    if len(first) == len(block.nodes):
        return block
    unique = np.sort(first)
    position = np.searchsorted(unique, first)[inverse.reshape(-1)]
    groups = {name: np.unique(position[rows]) for name, rows in block.groups.items()}
    return Block(block.kind, block.nodes[unique], groups)


def _numbered(blocks: list[Block]) -> Groups:
    """Return the groups as numbers of cells in the sequence of all blocks."""
    groups: dict[str, list[Indices]] = {}
    start = 0
    for block in blocks:
        for name, rows in block.groups.items():
            groups.setdefault(name, []).append(np.asarray(rows, np.intp) + start)
        start += len(block.nodes)
    return {name: np.concatenate(parts) for name, parts in groups.items()}


def _add_vertices(point_groups: Groups, block: Block, solid: list[Block]) -> list[str]:
    """Convert groups of vertex cells to groups of points; return the names of those without other cells."""
    turned = []
    for name, rows in block.groups.items():
        points = block.nodes[rows, 0]
        carried = [other.nodes[other.groups[name]].ravel() for other in solid if name in other.groups]
        if not carried:
            point_groups[name] = np.union1d(point_groups.get(name, points[:0]), points)
            turned.append(name)
            continue
        lost = np.setdiff1d(points, np.concatenate(carried))
        if len(lost):
            warn(
                f"group '{name}' mixes cells with single points: {len(lost)} points that its cells do "
                "not have are left out; give them a group of their own"
            )
    return turned


def _without_flat_z(points: AnyArray, dim: int) -> AnyArray:
    """Drop the third coordinate of a flat mesh."""
    if points.ndim != 2 or points.shape[1] != 3 or dim == 3 or not len(points):
        return points
    size = np.ptp(points[:, :2], axis=0).max()
    return points[:, :2] if np.ptp(points[:, 2]) <= 1e-12 * size else points
