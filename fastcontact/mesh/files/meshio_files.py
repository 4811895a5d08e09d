"""Reading and writing of mesh files in the formats of meshio, with warnings about data that a format cannot store."""

from __future__ import annotations

import contextlib
import difflib
import io
import logging
import tempfile
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from fastcontact._tools import hdf5
from fastcontact._tools.paths import existing_file
from fastcontact.arrays import AnyArray, Numbers
from fastcontact.errors import FileError, MeshError, unknown, warn
from fastcontact.mesh import elements
from fastcontact.mesh.files import abaqus, gmsh_versions
from fastcontact.mesh.files.meshio_content import INCONSISTENCY_ERRORS, NODE_ORDER, VERTEX, FileContent, Orders, mesh_of
from fastcontact.mesh.files.meshio_process import CELL_PREFIX, POINT_PREFIX, library, read_in_process
from fastcontact.mesh.mesh import Mesh

logger = logging.getLogger("fastcontact")

# Writers of meshio print to the standard streams, which only one thread at a time may redirect.
_STREAMS = threading.Lock()

# Formats with named arrays, in which every group is an array.
ARRAY_FORMATS = ("vtk", "vtu", "xdmf")
# Formats whose writers are known to keep all cells. Files of other formats are read back.
COMPLETE_FORMATS = ("vtk", "vtu", "gmsh22", "abaqus")
# Formats that support points with two coordinates. In other formats the third coordinate is zero and is removed on reading.
FLAT_FORMATS = ("gmsh22", "abaqus", "medit", "su2", "dolfin-xml")
# Formats that are HDF5 files.
HDF5_FORMATS = ("cgns", "h5m", "hmf", "exodus")

# Largest length of meshio's output in a message.
LONGEST_OUTPUT = 300
LOSSLESS_FORMAT = "write a .med file to keep them"
COMMON_FORMATS = ".med, .msh, .vtu, .vtk, .inp, .xdmf, .mesh or another format of meshio"
OTHER_FORMATS = "write .med, .vtu or .msh instead"


def _error(action: str, path: Path, reason: str) -> FileError:
    """Return the error for an `action` of meshio that failed."""
    reason = " ".join(reason.split())
    reason = reason if len(reason) <= LONGEST_OUTPUT else f"{reason[:LONGEST_OUTPUT]}..."
    remedy = "check the file, or convert it to .med" if action == "read" else OTHER_FORMATS
    return FileError(f"meshio cannot {action} '{path}' ({reason}): {remedy}")


def _log(action: str, path: Path, output: str) -> None:
    """Log the output of meshio, if there is any."""
    if output:
        logger.info("meshio, to %s %s: %s", action, path, " ".join(output.split()))


@contextlib.contextmanager
def _captured_output(action: str, path: Path) -> Iterator[None]:
    """Prevent meshio from printing and from ending the process. Its output goes to the log or to the message of the error."""
    output = io.StringIO()
    try:
        with _STREAMS, contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
            yield
    except (Exception, SystemExit) as error:
        reason = output.getvalue() if isinstance(error, SystemExit) else str(error)
        raise _error(action, path, reason or type(error).__name__) from error
    _log(action, path, output.getvalue())


def _format(path: Path, writing: bool) -> str:
    """Return meshio's name of the format of a file, which its suffix determines."""
    suffixes = ["".join(path.suffixes[i:]).lower() for i in range(len(path.suffixes))]
    formats = library().extension_to_filetypes
    names = next((formats[suffix] for suffix in suffixes if suffix in formats), None)
    if names is None:
        similar = difflib.get_close_matches(path.suffix, formats, n=1, cutoff=0.7)
        remedy = f"did you mean '{similar[0]}'?" if similar else f"use {COMMON_FORMATS}"
        raise FileError(f"'{path}': unknown mesh file suffix '{path.suffix}': {remedy}")
    if "gmsh" not in names:
        return str(names[0])
    if writing:
        return "gmsh22"
    # Ansys uses the same suffix, and meshio's reader of Ansys files does not terminate on a damaged file.
    with open(path, "rb") as file:
        if file.read(1) != b"$":
            raise FileError(f"'{path}' is not a Gmsh file, which starts with $MeshFormat: convert it to .med")
    return "gmsh"


def _read_content(path: Path, readable: Path, file_format: str, field: str = "") -> dict[str, Any]:
    """Return the content of a file, read from `readable`, which is the file or a converted copy of it.

    Raises FileError if meshio cannot read the file.
    """
    _check_input(path, file_format)
    content = read_in_process(readable, file_format, field)
    if "error" in content:
        raise _error("read", path, content["error"])
    return content


def read_data(path: Path, field: str, at_points: bool) -> tuple[AnyArray, AnyArray]:
    """Return the values (n, ...) of a field at points or cells [unit of the field], and their positions (n, dim) [length].

    The position of a cell is the mean of its nodes. Raises FileError if meshio cannot read the file, or the file has no such
    field.
    """
    file_format = _format(path, writing=False)
    if file_format == "gmsh":
        raise FileError(f"'{path}': fields of Gmsh files are not read: write the field to a .vtu or .med file")
    content = _read_content(path, path, file_format, field)
    names, points = content["fields" if at_points else "cell_fields"], content["points"]
    if field not in names:
        raise FileError(f"'{path}': {unknown('field' if at_points else 'field of cells', field, names)}")
    values = [content["field"]] if at_points else content["cell_field"]
    nodes = [points] if at_points else [block for _, _, block in content["cells"]]
    complete = [a is not None and b is not None and len(a) == len(b) for a, b in zip(values, nodes, strict=True)]
    if points is None or not all(complete) or not complete:
        item = "point" if at_points else "cell"
        raise FileError(f"field '{field}' of '{path}' has no number for each {item}: write the file again")
    if at_points:
        return values[0], points
    if any(len(block) and (block.min() < 0 or block.max() >= len(points)) for block in nodes):
        raise FileError(f"a cell of '{path}' refers to a missing point: write the file again")
    return np.concatenate(values), np.concatenate([points[block].mean(axis=1) for block in nodes])


def read(path: Path) -> FileContent:
    """Return the content of a file; see `meshio_content.mesh_of`."""
    file_format = _format(path, writing=False)
    if file_format == "gmsh":
        with tempfile.TemporaryDirectory() as folder:
            content = _read_content(path, gmsh_versions.readable_file(path, Path(folder)), file_format)
    else:
        content = _read_content(path, path, file_format)
    _log("read", path, content["output"])
    try:
        return FileContent(*mesh_of(content, file_format), file_format)
    except MeshError as error:
        raise MeshError(f"'{path}': {error}") from None
    except INCONSISTENCY_ERRORS as error:
        raise FileError(f"the parts of '{path}' are inconsistent: check the file, or convert it to .med") from error


def _check_input(path: Path, file_format: str) -> None:
    """Raise FileError for a file that refers to files in other folders, or that meshio would read only in part."""
    import h5py

    if file_format == "abaqus":
        abaqus.check_readable(path)
    elif file_format in HDF5_FORMATS and (file_format != "exodus" or h5py.is_hdf5(path)):
        with hdf5.open_hdf5(path):
            pass
    elif file_format == "xdmf":
        _check_references(path)


def files_of(path: Path) -> list[Path]:
    """Return a mesh file and all files that are read with it. Raises FileError if an XDMF file cannot be read."""
    if path.suffix.lower() in (".xdmf", ".xmf"):
        return [path, *(reference for reference, _ in _references(path))]
    partner = {".node": ".ele", ".ele": ".node"}.get(path.suffix)  # TetGen's pair of files
    return [path, path.with_suffix(partner)] if partner else [path]


def _references(path: Path) -> Iterator[tuple[Path, str]]:
    """Yield the files referenced by an XDMF file, and their formats."""
    from xml.etree import ElementTree

    try:
        items = [item for item in ElementTree.parse(path).iter() if item.get("Format") in ("HDF", "Binary")]
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise _error("read", path, f"it is not XML: {error}") from error
    except OSError as error:
        raise FileError(f"cannot read '{path}': {error.strerror or error}") from error
    for item in items:
        name, kind = (item.text or "").strip(), item.get("Format", "")
        yield path.resolve().parent / (name.partition(":")[0] if kind == "HDF" else name), kind


def _check_references(path: Path) -> None:
    """Raise FileError for an XDMF file that refers to files in other folders, also by links in HDF5 files."""
    folder = path.resolve().parent
    for reference, kind in _references(path):
        if folder not in (reference.resolve().parent, reference.resolve()):
            raise _error("read", path, f"it refers to the file '{reference.resolve()}', which is not beside it")
        existing_file(reference)
        if kind == "HDF":
            with hdf5.open_hdf5(reference):
                pass


def write(path: Path, temporary: Path, mesh: Mesh) -> None:
    """Write a mesh to `temporary` in the format of the suffix of `path`.

    Raises FileError if meshio cannot write the file or the format cannot store all points and cells.
    """
    meshio = library()
    file_format = _format(path, writing=True)
    if file_format in ("tetgen", "svg"):
        raise FileError(f"'{path}': {file_format} is not a single-file mesh format; {OTHER_FORMATS}")
    content = _arguments(mesh, file_format)
    # By default meshio writes the arrays of XDMF to a second file, which cannot be replaced atomically with the first.
    options = {"data_format": "XML"} if file_format == "xdmf" else {}
    with _captured_output("write", path):
        meshio.write(temporary, meshio.Mesh(**content), file_format=file_format, **options)
    if file_format == "abaqus":
        abaqus.append_cell_sets(temporary, mesh)
    if file_format not in COMPLETE_FORMATS:
        _check_complete(path, temporary, file_format, mesh)


def _arguments(mesh: Mesh, file_format: str) -> dict[str, Any]:
    """Return the arguments of ``meshio.Mesh``, with groups in the form that the format supports."""
    width = mesh.dim if file_format in FLAT_FORMATS else 3
    points = np.pad(mesh.points, [(0, 0), (0, width - mesh.dim)])
    content: dict[str, Any] = {"points": points, "cells": _meshio_cells(mesh, NODE_ORDER.get(file_format, {}))}
    if file_format in ARRAY_FORMATS:
        return _add_arrays(content, mesh)
    if file_format == "gmsh22":
        return _add_tags(content, mesh)
    if file_format == "abaqus":
        return {**content, "point_sets": dict(mesh.point_groups)}
    n_groups = len(mesh.cell_groups) + len(mesh.point_groups)
    if n_groups:
        warn(f"{file_format} files have no named groups: {n_groups} groups are left out; {LOSSLESS_FORMAT}")
    return content


def _meshio_cells(mesh: Mesh, order: Orders) -> list[tuple[str, AnyArray]]:
    """Return the name and the connectivity of each cell type in the node order of meshio."""
    return [
        (elements.get(name).meshio, block[:, np.argsort(order[name])] if name in order else np.array(block))
        for name, block in mesh.cells.items()
    ]


def _add_arrays(content: dict[str, Any], mesh: Mesh) -> dict[str, Any]:
    """Return the arguments with an array of 0 and 1 for each group."""
    cell_data = {}
    for name, members in mesh.cell_groups.items():
        flags = _mask_of(members, mesh.n_cells)
        cell_data[CELL_PREFIX + quote(name)] = np.split(flags, list(mesh.offsets.values())[1:])
    point_data = {POINT_PREFIX + quote(name): _mask_of(m, mesh.n_points) for name, m in mesh.point_groups.items()}
    return {**content, "cell_data": cell_data, "point_data": point_data}


def _mask_of(members: AnyArray, count: int) -> Numbers:
    """Return an array (count,) of integers, 1 for the members of a group and 0 otherwise."""
    return np.bincount(members, minlength=count).astype(np.int32)


def _add_tags(content: dict[str, Any], mesh: Mesh) -> dict[str, Any]:
    """Return the arguments with a physical tag for each cell, and a vertex cell for each point in a group."""
    dims = np.concatenate([np.full(len(block), elements.get(name).dim) for name, block in mesh.cells.items()])
    tags = np.zeros(mesh.n_cells, np.int32)
    field_data: dict[str, AnyArray] = {}
    # Small groups overwrite large ones, so that a group of all cells does not hide the others.
    for name, members in sorted(mesh.cell_groups.items(), key=lambda item: -len(item[1])):
        if len(members):
            dim, tag = int(dims[members].max()), len(field_data) + 1
            tags[members[dims[members] == dim]] = tag
            field_data[name] = np.array([tag, dim])
    saved = {name: int((tags[mesh.cell_groups[name]] == tag).sum()) for name, (tag, _) in field_data.items()}
    lost = {name: len(rows) - saved[name] for name, rows in mesh.cell_groups.items() if len(rows) > saved.get(name, 0)}
    if lost:
        warn(
            f"Gmsh files of version 2.2 store one group per cell: {sum(lost.values())} memberships of the groups "
            f"{', '.join(lost)} are left out; {LOSSLESS_FORMAT}"
        )
    blocks = np.split(tags, list(mesh.offsets.values())[1:])
    cells, blocks = _add_vertices(content["cells"], blocks, mesh.point_groups, field_data)
    data = {"gmsh:physical": blocks, "gmsh:geometrical": [np.maximum(block, 1) for block in blocks]}
    return {**content, "cells": cells, "cell_data": data, "field_data": field_data}


def _add_vertices(
    cells: list[Any], blocks: list[Any], point_groups: Mapping[str, Any], field_data: dict[str, Any]
) -> tuple[list[Any], list[Any]]:
    """Return cells and tags with additional vertices for the groups of points, and add the names of these to `field_data`."""
    groups = {name: members for name, members in point_groups.items() if len(members) and name not in field_data}
    repeated = [name for name in point_groups if name in field_data]
    if repeated:
        warn(
            f"{len(repeated)} groups of points have the name of a group of cells ({', '.join(repeated)}), which "
            f"Gmsh files cannot tell apart: they are left out; {LOSSLESS_FORMAT}"
        )
    if not groups:
        return cells, blocks
    tags = {name: len(field_data) + 1 + i for i, name in enumerate(groups)}
    field_data.update({name: np.array([tag, 0]) for name, tag in tags.items()})
    vertices = np.concatenate(list(groups.values()))[:, None]
    vertex_tags = np.concatenate([np.full(len(members), tags[name], np.int32) for name, members in groups.items()])
    return [*cells, (VERTEX, vertices)], [*blocks, vertex_tags]


def _check_complete(path: Path, temporary: Path, file_format: str, mesh: Mesh) -> None:
    """Read the written file and raise FileError if it differs, because some writers of meshio drop or change cells."""
    with _captured_output("read back", path):
        content = library().read(temporary, file_format=file_format)
    cells = _meshio_cells(mesh, {})
    differing_kinds = [kind for kind, block in cells if not np.array_equal(content.get_cells_type(kind), block)]
    if differing_kinds or len(content.points) != mesh.n_points:
        listed = f"the {', '.join(differing_kinds)} cells" if differing_kinds else "the points"
        raise FileError(f"'{path}': meshio's {file_format} format does not keep {listed}; {OTHER_FORMATS}")
