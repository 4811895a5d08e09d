"""Conversion of cells, and of data that meshio has read, to a `Mesh`, with the node orders and groups of all formats."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple
from urllib.parse import unquote

import numpy as np

from fastcontact._tools.grouping import grouped
from fastcontact._tools.records import field, record
from fastcontact.arrays import AnyArray, Indices
from fastcontact.errors import MeshError, warn
from fastcontact.mesh import elements
from fastcontact.mesh.files.meshio_process import CELL_PREFIX, POINT_PREFIX, TAGS
from fastcontact.mesh.mesh import Mesh

# Gmsh's names for entities of dimension 0 to 3. A tag without a name becomes a group such as "curve_7".
SHAPES = ("point", "curve", "surface", "volume")
# Cells whose node order differs in meshio: node k here is node NODE_ORDER[format][element][k] of meshio. meshio mirrors the
# linear wedge of VTK, as in old documentation of VTK but not in VTK 9.7, and does not reorder Gmsh's 18-node wedge.
Orders = Mapping[str, tuple[int, ...]]
NODE_ORDER: dict[str, Orders] = {
    **{key: {"wedge6": elements.get("wedge6").reversed} for key in ("vtk", "vtu")},
    **{key: {"wedge18": (0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11, 15, 17, 16)} for key in ("gmsh", "gmsh22")},
}
# Exceptions due to inconsistent arrays, which meshio reads without checks.
INCONSISTENCY_ERRORS = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError)
VERTEX = "vertex"
# Largest number of unknown kinds of cells in a message, and of characters of each name.
MAX_SHOWN = 12
Groups = dict[str, AnyArray]


class FileContent(NamedTuple):
    """A mesh, the numbers of omitted cells by kind, see `build_mesh`, the format, and the name of the mesh in the file."""

    mesh: Mesh
    omitted: Mapping[str, int]
    format: str
    name: str = ""


def mesh_of(content: Mapping[str, Any], file_format: str = "") -> tuple[Mesh, dict[str, int]]:
    """Return a mesh with its groups, and the numbers of omitted cells, ``"vertex"`` and ``"duplicate"``.

    Parameters
    ----------
    content : mapping
        See `meshio_process.plain_content`.
    file_format : str
        Name of the format of the file in meshio.

    Raises
    ------
    MeshError
        If there are no cells, or cells of an unknown kind. Inconsistent arrays raise one of the
        INCONSISTENCY_ERRORS.
    """
    # Version 2 of Gmsh's format repeats a cell for each of its groups.
    is_gmsh, blocks = file_format == "gmsh", _blocks(content, NODE_ORDER.get(file_format, {}))
    names = _cell_group_names(content, file_format)
    point_groups = _groups(content["point_data"], content["point_sets"], POINT_PREFIX, 0, {})
    return build_mesh(content["points"], blocks, point_groups, names, repeats=is_gmsh)


def _cell_group_names(content: Mapping[str, Any], file_format: str) -> list[str]:
    """Return the names of all groups of cells, including empty ones."""
    names = [name for name in content["cell_sets"] if not name.startswith("gmsh:")]
    names += [unquote(key[len(CELL_PREFIX) :]) for key in content["cell_data"] if key.startswith(CELL_PREFIX)]
    if file_format == "gmsh":
        names += [name for name, (_, dim) in content["field_data"].items() if dim > 0]
    return names


def _blocks(content: Mapping[str, Any], order: Orders) -> list[Block]:
    """Return the cells of each block with their groups. Raises MeshError for cells of an unknown type."""
    unknown: dict[str, int] = {}
    for kind, count, _ in content["cells"]:
        if kind not in elements.BY_MESHIO and kind != VERTEX:
            unknown[kind] = unknown.get(kind, 0) + count
    check_kinds(unknown, elements.BY_MESHIO)
    return [_block(content, index, kind, nodes, order) for index, (kind, _, nodes) in enumerate(content["cells"])]


def _block(content: Mapping[str, Any], index: int, kind: str, nodes: AnyArray, order: Orders) -> Block:
    """Return the cells of block number `index` with their groups, in the node order of this package."""
    kind = VERTEX if kind == VERTEX else elements.BY_MESHIO[kind].name
    dim = 0 if kind == VERTEX else elements.get(kind).dim
    arrays = {key: blocks[index] for key, blocks in content["cell_data"].items()}
    sets = {k: v[index] for k, v in content["cell_sets"].items() if not k.startswith("gmsh:") and index < len(v)}
    groups = _groups(arrays, sets, CELL_PREFIX, dim, content["field_data"])
    nodes = nodes[:, order[kind]] if kind in order else nodes
    return Block(kind, nodes, {name: rows for name, rows in groups.items() if len(rows)})


def _groups(
    arrays: Mapping[str, AnyArray], sets: Mapping[str, Any], prefix: str, dim: int, field_data: Mapping[str, Any]
) -> Groups:
    """Return the groups of cells or points that arrays and sets define; groups of the same name are united.

    Arrays contain tags of entities of dimension `dim`, see `_groups_of_tags`, or they have names with the given `prefix` and
    are nonzero in a group.
    """
    parts = [
        _groups_of_tags(values, dim, field_data)
        if key in TAGS
        else {unquote(key[len(prefix) :]): np.flatnonzero(values)}
        for key, values in arrays.items()
    ]
    parts += [{name: np.asarray(members, np.intp).reshape(-1)} for name, members in sets.items()]
    groups: Groups = {}
    for name, rows in (item for part in parts for item in part.items()):
        groups[name] = np.union1d(groups[name], rows) if name in groups else rows
    return groups


def _groups_of_tags(tags: AnyArray, dim: int, field_data: Mapping[str, Any]) -> dict[str, AnyArray]:
    """Return the members of each nonzero tag, by the name of the tag for this dimension, or a name such as "curve_7"."""
    if tags.ndim != 1 or tags.dtype.kind not in "iu":
        return {}
    names = {(int(entry[0]), int(entry[1])): name for name, entry in field_data.items() if np.size(entry) == 2}
    groups = {tag: names.get((tag, dim), f"{SHAPES[dim]}_{tag}") for tag in np.unique(tags).tolist() if tag}
    return {name: np.flatnonzero(tags == tag) for tag, name in groups.items()}


@record
class Block:
    """Cells of one kind, an element type or ``"vertex"``: the nodes (n_cells, n_nodes), and the rows of each group."""

    kind: str
    nodes: AnyArray
    groups: Mapping[str, Indices] = field(default_factory=dict)


def build_mesh(
    points: AnyArray, blocks: Iterable[Block], point_groups: Mapping[str, AnyArray], names: Iterable[str] = (), *,
    repeats: bool = False,
) -> tuple[Mesh, dict[str, int]]:  # fmt: skip
    """Return a `Mesh` of all blocks, with `points` (n_points, 2 or 3) [length], and the numbers of omitted cells.

    Blocks of the same kind are joined, and cells given several times are merged if `repeats` is true. Groups of vertex cells
    become groups of points, and `names` without cells become empty groups. A flat mesh with three coordinates becomes a 2D
    mesh. The omitted cells are ``"vertex"`` and ``"duplicate"``.
    """
    try:
        coordinates = np.asarray(points, np.float64)
    except (TypeError, ValueError):
        raise MeshError("its coordinates are not numbers: check that the file is complete") from None
    nonempty = [block for block in merge_blocks(blocks) if len(block.nodes)]
    original = [block for block in nonempty if block.kind != VERTEX]
    cell_blocks = list(map(without_duplicates, original)) if repeats else original
    vertices = [block for block in nonempty if block.kind == VERTEX]
    if not cell_blocks:
        raise MeshError("the mesh has no cells: nothing can be computed on points alone")
    cell_groups: Groups = {name: np.empty(0, np.intp) for name in names} | _renumbered(cell_blocks)
    all_point_groups = {name: np.asarray(members, np.intp) for name, members in point_groups.items()}
    for block in vertices:
        for name in _add_vertices(all_point_groups, block, cell_blocks):
            cell_groups.pop(name, None)
    dim = max(elements.get(block.kind).dim for block in cell_blocks)
    cells = {block.kind: block.nodes for block in cell_blocks}
    n_duplicates = sum(len(block.nodes) - len(cells[block.kind]) for block in original)
    omitted = {"vertex": sum(len(block.nodes) for block in vertices), "duplicate": n_duplicates}
    return Mesh(_without_flat_z(coordinates, dim), cells, cell_groups, all_point_groups), omitted


def check_kinds(unknown: Mapping[str, int], known_kinds: Iterable[str]) -> None:
    """Raise MeshError if there are cells of unknown kinds, whose numbers `unknown` contains by kind."""
    if unknown:
        listed = [f"{count} cells of kind {kind[:MAX_SHOWN]}" for kind, count in list(unknown.items())[:MAX_SHOWN]]
        more = [f"{len(unknown) - MAX_SHOWN} kinds more"] if len(unknown) > MAX_SHOWN else []
        kinds = ", ".join([*listed, *more])
        raise MeshError(f"it has {kinds}, which fastcontact does not know: use only {', '.join(sorted(known_kinds))}")


def merge_blocks(blocks: Iterable[Block]) -> list[Block]:
    """Return one block for each kind, in the order in which the kinds first appear."""
    by_kind = grouped((block.kind, block) for block in blocks)
    return [Block(kind, np.concatenate([b.nodes for b in same]), _renumbered(same)) for kind, same in by_kind.items()]


def without_duplicates(block: Block) -> Block:
    """Return a block in which duplicate cells are merged; each cell is in the groups of all its duplicates."""
    _, first, inverse = np.unique(np.sort(block.nodes, axis=1), axis=0, return_index=True, return_inverse=True)
    unique = np.sort(first)
    position = np.searchsorted(unique, first)[inverse.reshape(-1)]
    groups = {name: np.unique(position[rows]) for name, rows in block.groups.items()}
    return Block(block.kind, block.nodes[unique], groups)


def _renumbered(blocks: list[Block]) -> Groups:
    """Return the members of all groups as numbers of cells in the sequence of the blocks."""
    starts = np.cumsum([0, *(len(block.nodes) for block in blocks)])
    groups = [(name, rows + start) for block, start in zip(blocks, starts) for name, rows in block.groups.items()]
    return {name: np.concatenate(arrays) for name, arrays in grouped(groups).items()}


def _add_vertices(point_groups: Groups, block: Block, cell_blocks: list[Block]) -> list[str]:
    """Convert groups of vertex cells to groups of points, and return the names of the groups that have no other cells."""
    converted = []
    for name, rows in block.groups.items():
        points = block.nodes[rows, 0]
        nodes_of_cells = [cells.nodes[cells.groups[name]].ravel() for cells in cell_blocks if name in cells.groups]
        if not nodes_of_cells:
            point_groups[name] = np.union1d(point_groups.get(name, points[:0]), points)
            converted.append(name)
            continue
        omitted_points = np.setdiff1d(points, np.concatenate(nodes_of_cells))
        if len(omitted_points):
            warn(
                f"group '{name}' mixes cells with single points: {len(omitted_points)} points that its cells do "
                "not have are left out; put them into a separate group"
            )
    return converted


def _without_flat_z(points: AnyArray, dim: int) -> AnyArray:
    """Return points without their third coordinate if it is constant and the cells are not three-dimensional."""
    if points.ndim != 2 or points.shape[1] != 3 or dim == 3 or not len(points):
        return points
    size = np.ptp(points[:, :2], axis=0).max()
    return points[:, :2] if np.ptp(points[:, 2]) <= 1e-12 * size else points
