"""Conversion of the plain data read by meshio to a Mesh: node orders, groups from tags, sets and arrays of 0 and 1."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any
from urllib.parse import unquote

import numpy as np

from fastcontact.arrays import AnyArray
from fastcontact.mesh import elements
from fastcontact.mesh.files.blocks import VERTEX, Block, build_mesh, check_kinds, merged, without_duplicates
from fastcontact.mesh.files.meshio_process import CELL_PREFIX, POINT_PREFIX, TAGS
from fastcontact.mesh.mesh import Mesh

# Gmsh's names for entities of dimension 0 to 3: a tag without a name becomes a group like "curve_7".
SHAPES = ("point", "curve", "surface", "volume")
# Cells with a different node order in meshio: our node k is its node NODE_ORDER[format][element][k]. meshio mirrors the
# linear wedge of VTK, as in old documentation of VTK but not in VTK 9.7, and does not reorder Gmsh's wedge of 18 nodes.
Orders = Mapping[str, tuple[int, ...]]
NODE_ORDER: dict[str, Orders] = {
    **{key: {"wedge6": elements.get("wedge6").reversed} for key in ("vtk", "vtu")},
    **{key: {"wedge18": (0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11, 15, 17, 16)} for key in ("gmsh", "gmsh22")},
}

# Errors caused by inconsistent arrays, which meshio reads without checks.
UNFIT = (ArithmeticError, AttributeError, LookupError, TypeError, ValueError)


def mesh_of(content: Mapping[str, Any], file_format: str = "") -> tuple[Mesh, dict[str, int]]:
    """Return a mesh with its groups, and the numbers of cells left out as vertices and as duplicates.

    Parameters
    ----------
    content : mapping
        See `meshio_process.plain_content`.
    file_format : str
        meshio's name of the original format.

    Raises
    ------
    MeshError
        If it has no cells, or cells of an unknown kind. Inconsistent arrays raise one of the exceptions `UNFIT`.
    """
    blocks = merged(_blocks(content, NODE_ORDER.get(file_format, {})))
    n_duplicates = sum(len(block.nodes) for block in blocks)
    if file_format == "gmsh":  # version 2 of that format repeats a cell for each of its groups
        blocks = [block if block.kind == VERTEX else without_duplicates(block) for block in blocks]
    n_duplicates -= sum(len(block.nodes) for block in blocks)
    mesh = build_mesh(content["points"], blocks, _point_groups(content), _cell_group_names(content, file_format))
    n_vertices = sum(len(block.nodes) for block in blocks if block.kind == VERTEX)
    return mesh, {"vertex": n_vertices, "duplicate": n_duplicates}


def _cell_group_names(content: Mapping[str, Any], file_format: str) -> list[str]:
    """Return the names of all groups of cells, including empty ones."""
    names = [name for name in content["cell_sets"] if not name.startswith("gmsh:")]
    names += [unquote(key[len(CELL_PREFIX) :]) for key in content["cell_data"] if key.startswith(CELL_PREFIX)]
    if file_format == "gmsh":
        names += [name for name, (_, dim) in content["field_data"].items() if dim > 0]
    return names


def _blocks(content: Mapping[str, Any], order: Orders) -> list[Block]:
    foreign: dict[str, int] = {}
    for kind, count, _ in content["cells"]:
        if kind not in elements.BY_MESHIO and kind != VERTEX:
            foreign[kind] = foreign.get(kind, 0) + count
    check_kinds(foreign, elements.BY_MESHIO)
    return [_block(content, index, kind, nodes, order) for index, (kind, _, nodes) in enumerate(content["cells"])]


def _block(content: Mapping[str, Any], index: int, kind: str, nodes: AnyArray, order: Orders) -> Block:
    kind = VERTEX if kind == VERTEX else elements.BY_MESHIO[kind].name
    dim = 0 if kind == VERTEX else elements.get(kind).dim
    groups: dict[str, AnyArray] = {}
    for key, parts in content["cell_data"].items():
        if key in TAGS:
            _add(groups, _tagged(parts[index], dim, content["field_data"]))
        else:
            _add(groups, {unquote(key[len(CELL_PREFIX) :]): np.flatnonzero(parts[index])})
    for name, sets in content["cell_sets"].items():
        if not name.startswith("gmsh:") and index < len(sets):
            _add(groups, {name: np.asarray(sets[index], np.intp).reshape(-1)})
    nodes = nodes[:, order[kind]] if kind in order else nodes
    return Block(kind, nodes, {name: rows for name, rows in groups.items() if len(rows)})


def _add(groups: dict[str, AnyArray], more: Mapping[str, AnyArray]) -> None:
    for name, rows in more.items():
        groups[name] = np.union1d(groups[name], rows) if name in groups else rows


def _tagged(tags: AnyArray, dim: int, field_data: Mapping[str, Any]) -> dict[str, AnyArray]:
    """Return the members of each tag, by its name for this dimension or a name derived from the tag."""
    if tags.ndim != 1 or tags.dtype.kind not in "iu":
        return {}
    names = {(int(entry[0]), int(entry[1])): name for name, entry in field_data.items() if np.size(entry) == 2}
    return {
        names.get((tag, dim), f"{SHAPES[dim]}_{tag}"): np.flatnonzero(tags == tag)
        for tag in np.unique(tags).tolist()
        if tag
    }


def _point_groups(content: Mapping[str, Any]) -> dict[str, AnyArray]:
    groups: dict[str, AnyArray] = {}
    for key, data in content["point_data"].items():
        if key in TAGS:
            _add(groups, _tagged(data, 0, {}))
        else:
            _add(groups, {unquote(key[len(POINT_PREFIX) :]): np.flatnonzero(data)})
    for name, members in content["point_sets"].items():
        _add(groups, {name: np.asarray(members, np.intp).reshape(-1)})
    return groups
