"""Mesh files in the formats of meshio, in and out: their groups, node orders and losses."""

from __future__ import annotations

import contextlib
import difflib
import io
import logging
import threading
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from fastcontact.errors import FastcontactWarning, FileError, MeshError
from fastcontact.mesh import elements
from fastcontact.mesh.files import abaqus, hdf5
from fastcontact.mesh.files.blocks import VERTEX, Block, build_mesh, check_known, merged, without_duplicates
from fastcontact.mesh.files.meshio_process import CELL_PREFIX, POINT_PREFIX, TAGS, library, read_in_process
from fastcontact.mesh.files.paths import existing_file
from fastcontact.mesh.mesh import Mesh

logger = logging.getLogger("fastcontact")

# meshio's writers print through the standard streams; only one thread at a time may divert them.
_STREAMS = threading.Lock()

# What Gmsh calls things of dimension 0 to 3: a tag without a name becomes a group like "curve_7".
SHAPES = ("point", "curve", "surface", "volume")
# Formats with named arrays: every group is one.
ARRAY_FORMATS = ("vtk", "vtu", "xdmf")
# Formats whose writers are known to keep all our cells; of the others, the result is read back.
COMPLETE_FORMATS = ("vtk", "vtu", "gmsh22", "abaqus")
# Formats that know points of two coordinates; the others get a zero, and reading drops it again.
FLAT_FORMATS = ("gmsh22", "abaqus", "medit", "su2", "dolfin-xml")
# Formats that are HDF5 files.
HDF5_FORMATS = ("cgns", "h5m", "hmf", "exodus")

# Cells that meshio gets in another order than ours: our node k is its node NODE_ORDER[format][element][k]. It mirrors
# the linear wedge of VTK, as old documents of VTK want and VTK 9.7 does not, and leaves Gmsh's wedge of 18 nodes alone.
Orders = Mapping[str, tuple[int, ...]]
NODE_ORDER: dict[str, Orders] = {
    **{key: {"wedge6": elements.get("wedge6").reversed} for key in ("vtk", "vtu")},
    **{key: {"wedge18": (0, 1, 2, 3, 4, 5, 6, 9, 7, 12, 14, 13, 8, 10, 11, 15, 17, 16)} for key in ("gmsh", "gmsh22")},
}

# How much of what meshio says goes into a message.
LONGEST = 300
KEEPS_ALL = "write a .med file to keep them"
USUAL = (".med", ".msh", ".vtu", ".vtk", ".inp", ".xdmf", ".mesh")
OTHER_FORMATS = "write .med, .vtu or .msh instead"


def _refusal(action: str, path: Path, reason: str) -> FileError:
    reason = " ".join(reason.split())
    reason = reason if len(reason) <= LONGEST else f"{reason[:LONGEST]}..."
    remedy = "check the file, or convert it to .med" if action == "read" else OTHER_FORMATS
    return FileError(f"meshio cannot {action} '{path}' ({reason}): {remedy}")


def _log(action: str, path: Path, said: str) -> None:
    if said:
        logger.info("meshio, to %s %s: %s", action, path, " ".join(said.split()))


@contextlib.contextmanager
def _contained(action: str, path: Path) -> Iterator[None]:
    """Keep meshio from printing and from ending the process; what it says goes to the log or the error."""
    said = io.StringIO()
    try:
        with _STREAMS, contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            yield
    except (Exception, SystemExit) as error:
        reason = said.getvalue() if isinstance(error, SystemExit) else str(error)
        raise _refusal(action, path, reason or type(error).__name__) from error
    _log(action, path, said.getvalue())


def _format(path: Path, writing: bool) -> str:
    """Return meshio's name of the format of a file, by its suffix."""
    suffixes = ["".join(path.suffixes[i:]).lower() for i in range(len(path.suffixes))]
    formats = library().extension_to_filetypes
    names = next((formats[suffix] for suffix in suffixes if suffix in formats), None)
    if names is None:
        near = difflib.get_close_matches(path.suffix, formats, n=1, cutoff=0.7)
        remedy = f"did you mean '{near[0]}'?" if near else f"use {', '.join(USUAL)} or another format of meshio"
        raise FileError(f"'{path}': unknown mesh file suffix '{path.suffix}': {remedy}")
    if "gmsh" not in names:
        return str(names[0])
    if writing:
        return "gmsh22"
    # Ansys has the same suffix, and meshio's reader of its files never ends on a damaged one.
    with open(path, "rb") as file:
        if file.read(1) != b"$":
            raise FileError(f"'{path}' is no Gmsh file, which starts with $MeshFormat: convert it to .med")
    return "gmsh"


def read(path: Path) -> tuple[Mesh, str, dict[str, int]]:
    """Return a mesh with its groups, the format, and the numbers of cells left out as vertices and as duplicates."""
    file_format = _format(path, writing=False)
    _check_before(path, file_format)
    found = read_in_process(path, file_format)
    if "error" in found:
        raise _refusal("read", path, found["error"])
    _log("read", path, found["said"])
    try:
        blocks = merged(_blocks(found, NODE_ORDER.get(file_format, {})))
        n_duplicates = sum(len(block.nodes) for block in blocks)
        if file_format == "gmsh":  # version 2 of that format repeats a cell for each of its groups
            blocks = [block if block.kind == VERTEX else without_duplicates(block) for block in blocks]
        n_duplicates -= sum(len(block.nodes) for block in blocks)
        mesh = build_mesh(found["points"], blocks, _point_groups(found), _cell_group_names(found, file_format))
    except MeshError as error:
        raise MeshError(f"'{path}': {error}") from None
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        # meshio has taken what stands in the file as it is: arrays of any shape and kind.
        raise FileError(f"the parts of '{path}' do not fit together: check the file, or convert it to .med") from error
    n_vertices = sum(len(block.nodes) for block in blocks if block.kind == VERTEX)
    return mesh, file_format, {"vertex": n_vertices, "duplicate": n_duplicates}


def _check_before(path: Path, file_format: str) -> None:
    """Refuse files that lead meshio to other files, or of which it would lose something."""
    import h5py

    if file_format == "abaqus":
        abaqus.check_readable(path)
    elif file_format in HDF5_FORMATS and (file_format != "exodus" or h5py.is_hdf5(path)):
        with hdf5.opened(path):
            pass
    elif file_format == "xdmf":
        _check_references(path)


def _check_references(path: Path) -> None:
    """Refuse an XDMF file that refers to files in other folders, or to HDF5 files that do."""
    try:
        items = [item for item in ElementTree.parse(path).iter() if item.get("Format") in ("HDF", "Binary")]
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise _refusal("read", path, f"it is no XML: {error}") from error
    folder = path.resolve().parent
    for item in items:
        name = (item.text or "").strip()
        beside = folder / (name.partition(":")[0] if item.get("Format") == "HDF" else name)
        if folder not in (beside.resolve().parent, beside.resolve()):
            raise _refusal("read", path, f"it refers to the file '{beside.resolve()}', which is not beside it")
        existing_file(beside)
        if item.get("Format") == "HDF":
            with hdf5.opened(beside):
                pass


def _cell_group_names(found: Mapping[str, Any], file_format: str) -> list[str]:
    """Return the names of all groups of cells, also of those without any."""
    names = [name for name in found["cell_sets"] if not name.startswith("gmsh:")]
    names += [unquote(key[len(CELL_PREFIX) :]) for key in found["cell_data"] if key.startswith(CELL_PREFIX)]
    if file_format == "gmsh":
        names += [name for name, (_, dim) in found["field_data"].items() if dim > 0]
    return names


def _blocks(found: Mapping[str, Any], order: Orders) -> list[Block]:
    foreign: dict[str, int] = {}
    for kind, count, _ in found["cells"]:
        if kind not in elements.BY_MESHIO and kind != VERTEX:
            foreign[kind] = foreign.get(kind, 0) + count
    check_known(foreign, elements.BY_MESHIO)
    return [_block(found, index, kind, nodes, order) for index, (kind, _, nodes) in enumerate(found["cells"])]


def _block(found: Mapping[str, Any], index: int, kind: str, nodes: NDArray[Any], order: Orders) -> Block:
    kind = VERTEX if kind == VERTEX else elements.BY_MESHIO[kind].name
    dim = 0 if kind == VERTEX else elements.get(kind).dim
    groups: dict[str, NDArray[Any]] = {}
    for key, parts in found["cell_data"].items():
        if key in TAGS:
            _add(groups, _tagged(parts[index], dim, found["field_data"]))
        else:
            _add(groups, {unquote(key[len(CELL_PREFIX) :]): np.flatnonzero(parts[index])})
    for name, sets in found["cell_sets"].items():
        if not name.startswith("gmsh:") and index < len(sets):
            _add(groups, {name: np.asarray(sets[index], np.intp).reshape(-1)})
    nodes = nodes[:, order[kind]] if kind in order else nodes
    return Block(kind, nodes, {name: rows for name, rows in groups.items() if len(rows)})


def _add(groups: dict[str, NDArray[Any]], more: Mapping[str, NDArray[Any]]) -> None:
    for name, rows in more.items():
        groups[name] = np.union1d(groups[name], rows) if name in groups else rows


def _tagged(tags: NDArray[Any], dim: int, field_data: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
    """Return the members of each tag, by its name for this dimension or else by a name made of the tag."""
    if tags.ndim != 1 or tags.dtype.kind not in "iu":
        return {}
    names = {(int(entry[0]), int(entry[1])): name for name, entry in field_data.items() if np.size(entry) == 2}
    return {
        names.get((tag, dim), f"{SHAPES[dim]}_{tag}"): np.flatnonzero(tags == tag)
        for tag in np.unique(tags).tolist()
        if tag
    }


def _point_groups(found: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
    groups: dict[str, NDArray[Any]] = {}
    for key, data in found["point_data"].items():
        if key in TAGS:
            _add(groups, _tagged(data, 0, {}))
        else:
            _add(groups, {unquote(key[len(POINT_PREFIX) :]): np.flatnonzero(data)})
    for name, members in found["point_sets"].items():
        _add(groups, {name: np.asarray(members, np.intp).reshape(-1)})
    return groups


def write(path: Path, temporary: Path, mesh: Mesh) -> None:
    """Write a mesh to `temporary` in the format of `path`'s suffix, or raise FileError if that would leave out cells."""
    meshio = library()
    file_format = _format(path, writing=True)
    if file_format in ("tetgen", "svg"):
        raise FileError(f"'{path}': {file_format} is no mesh format of one file; {OTHER_FORMATS}")
    parts = _parts(mesh, file_format)
    # By default XDMF puts the numbers into a second file, which cannot be replaced together with the first.
    options = {"data_format": "XML"} if file_format == "xdmf" else {}
    with _contained("write", path):
        meshio.write(temporary, meshio.Mesh(**parts), file_format=file_format, **options)
    if file_format == "abaqus":
        abaqus.append_cell_sets(temporary, mesh)
    if file_format not in COMPLETE_FORMATS:
        _check_complete(path, temporary, file_format, mesh)


def _parts(mesh: Mesh, file_format: str) -> dict[str, Any]:
    """Return the arguments of meshio's Mesh, groups as the format can take them."""
    width = mesh.dim if file_format in FLAT_FORMATS else 3
    points = np.pad(mesh.points, [(0, 0), (0, width - mesh.dim)])
    parts: dict[str, Any] = {"points": points, "cells": _meshio_cells(mesh, NODE_ORDER.get(file_format, {}))}
    if file_format in ARRAY_FORMATS:
        return _with_arrays(parts, mesh)
    if file_format == "gmsh22":
        return _with_tags(parts, mesh)
    if file_format == "abaqus":
        return {**parts, "point_sets": dict(mesh.point_groups)}
    lost = len(mesh.cell_groups) + len(mesh.point_groups)
    if lost:
        _warn(f"{file_format} files have no named groups: {lost} groups are left out; {KEEPS_ALL}")
    return parts


def _meshio_cells(mesh: Mesh, order: Orders) -> list[tuple[str, NDArray[Any]]]:
    return [
        (elements.get(name).meshio, block[:, np.argsort(order[name])] if name in order else np.array(block))
        for name, block in mesh.cells.items()
    ]


def _warn(message: str) -> None:
    warnings.warn(message, FastcontactWarning, stacklevel=2)


def _with_arrays(parts: dict[str, Any], mesh: Mesh) -> dict[str, Any]:
    """Return the parts with an array of 0 and 1 for each group."""
    cell_data = {}
    for name, members in mesh.cell_groups.items():
        flags = _flags(members, mesh.n_cells)
        cell_data[CELL_PREFIX + quote(name)] = np.split(flags, list(mesh.offsets.values())[1:])
    point_data = {POINT_PREFIX + quote(name): _flags(m, mesh.n_points) for name, m in mesh.point_groups.items()}
    return {**parts, "cell_data": cell_data, "point_data": point_data}


def _flags(members: NDArray[Any], count: int) -> NDArray[np.int32]:
    flags = np.zeros(count, np.int32)
    flags[members] = 1
    return flags


def _with_tags(parts: dict[str, Any], mesh: Mesh) -> dict[str, Any]:
    """Return the parts with a physical tag for each cell, and a vertex cell for each point in a group."""
    dims = np.concatenate([np.full(len(block), elements.get(name).dim) for name, block in mesh.cells.items()])
    tags = np.zeros(mesh.n_cells, np.int32)
    field_data: dict[str, NDArray[Any]] = {}
    # Small groups overwrite large ones, so that a group of everything does not hide all others.
    for name, members in sorted(mesh.cell_groups.items(), key=lambda item: -len(item[1])):
        if len(members):
            dim, tag = int(dims[members].max()), len(field_data) + 1
            tags[members[dims[members] == dim]] = tag
            field_data[name] = np.array([tag, dim])
    kept = {name: int((tags[mesh.cell_groups[name]] == tag).sum()) for name, (tag, _) in field_data.items()}
    cut = {name: len(rows) - kept[name] for name, rows in mesh.cell_groups.items() if len(rows) > kept.get(name, 0)}
    if cut:
        _warn(
            f"Gmsh files of version 2.2 hold one group a cell: {sum(cut.values())} memberships of the groups "
            f"{', '.join(cut)} are left out; {KEEPS_ALL}"
        )
    blocks = np.split(tags, list(mesh.offsets.values())[1:])
    cells, blocks = _with_vertices(parts["cells"], blocks, mesh.point_groups, field_data)
    data = {"gmsh:physical": blocks, "gmsh:geometrical": [np.maximum(block, 1) for block in blocks]}
    return {**parts, "cells": cells, "cell_data": data, "field_data": field_data}


def _with_vertices(
    cells: list[Any], blocks: list[Any], point_groups: Mapping[str, Any], field_data: dict[str, Any]
) -> tuple[list[Any], list[Any]]:
    named = {name: members for name, members in point_groups.items() if len(members) and name not in field_data}
    twice = [name for name in point_groups if name in field_data]
    if twice:
        _warn(
            f"{len(twice)} groups of points have the name of a group of cells ({', '.join(twice)}), which "
            f"Gmsh files cannot tell apart: they are left out; {KEEPS_ALL}"
        )
    if not named:
        return cells, blocks
    tags = {name: len(field_data) + 1 + i for i, name in enumerate(named)}
    field_data.update({name: np.array([tag, 0]) for name, tag in tags.items()})
    vertices = np.concatenate(list(named.values()))[:, None]
    vertex_tags = np.concatenate([np.full(len(members), tags[name], np.int32) for name, members in named.items()])
    return [*cells, (VERTEX, vertices)], [*blocks, vertex_tags]


def _check_complete(path: Path, temporary: Path, file_format: str, mesh: Mesh) -> None:
    """Read back what was written: several of meshio's writers leave out or change cells without an error."""
    with _contained("read back", path):
        found = library().read(temporary, file_format=file_format)
    wrong = [kind for kind, block in _meshio_cells(mesh, {}) if not np.array_equal(found.get_cells_type(kind), block)]
    if wrong or len(found.points) != mesh.n_points:
        listed = f"the {', '.join(wrong)} cells" if wrong else "the points"
        raise FileError(f"'{path}': meshio's {file_format} format does not keep {listed}; {OTHER_FORMATS}")
