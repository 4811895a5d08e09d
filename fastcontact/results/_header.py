"""The beginning of a result file: the mesh for viewers and for us, and empty tables for the steps."""

from __future__ import annotations

import contextlib
import json
import sys
from collections.abc import Sequence
from functools import cache
from importlib import metadata
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastcontact.mesh.mesh import Mesh
from fastcontact.results import _layout as layout

# Rows of a growing table that are allocated together.
ROWS, BYTES = 64, 4096


def write_geometry(file: Any, mesh: Mesh, growing: Sequence[str] = ()) -> None:
    """Write /VTKHDF with the solid cells, the static arrays, and room for the steps and their `growing` cell fields."""
    root = file.create_group("VTKHDF")
    root.attrs["Version"] = np.array([2, 0], np.int64)
    root.attrs["Type"] = np.bytes_("UnstructuredGrid")  # readers want a fixed-length ASCII string
    cells = layout.solid_cells(mesh)
    root["NumberOfPoints"] = np.array([mesh.n_points], np.int64)
    root["NumberOfCells"] = np.array([len(cells.types)], np.int64)
    root["NumberOfConnectivityIds"] = np.array([len(cells.connectivity)], np.int64)
    _packed(root, "Points", layout.padded(mesh.points, 3))
    _packed(root, "Connectivity", cells.connectivity)
    _packed(root, "Offsets", cells.offsets)
    _packed(root, "Types", cells.types)
    point_data, cell_data = root.create_group("PointData"), root.create_group("CellData")
    for name, width in layout.POINT_FIELDS.items():
        _growing_field(point_data, name, mesh.n_points, width)
    point_flags, cell_fields = layout.point_flags(mesh), layout.cell_fields(mesh)
    for name, values in point_flags.items():
        _packed(point_data, name, values)
    for name, values in cell_fields.items():
        _packed(cell_data, name, values)
    for name in growing:
        _growing_field(cell_data, name, len(cells.types), 1)
    _write_steps_group(root, list(point_flags), list(cell_fields), growing)


def _write_steps_group(root: Any, static_point: list[str], static_cell: list[str], growing: Sequence[str]) -> None:
    """Write the empty step tables; equal ones are one data set under several names."""
    steps = root.create_group("Steps")
    steps.attrs["NSteps"] = np.int64(0)
    growing_table(steps, "Values", np.float64)
    growing_table(steps, "NumberOfParts", np.int64)
    zeros = growing_table(steps, "PartOffsets", np.int64)
    steps["PointOffsets"] = zeros
    steps["CellOffsets"] = growing_table(steps, "ConnectivityIdOffsets", np.int64, width=1)
    point_offsets, cell_offsets = (
        steps.create_group("PointDataOffsets"),
        steps.create_group("CellDataOffsets"),
    )
    rows = growing_table(point_offsets, "displacement", np.int64)
    for name in layout.POINT_FIELDS:
        if name != "displacement":
            point_offsets[name] = rows
    for name in static_point:
        point_offsets[name] = zeros
    for name in static_cell:
        cell_offsets[name] = zeros
    for name in growing:
        growing_table(cell_offsets, name, np.int64)


def write_own(file: Any, mesh: Mesh, kinematics: str, case_text: str) -> None:
    """Write /fastcontact: the mesh as we know it, where it comes from, and room for the steps."""
    own = file.create_group("fastcontact")
    own.attrs["schema"] = np.int64(layout.SCHEMA)
    own["kinematics"] = as_json(kinematics)
    own["case"] = as_json(case_text)
    own["versions"] = as_json(_versions())
    stored = own.create_group("mesh")
    stored.attrs["dim"] = np.int64(mesh.dim)
    stored["points"] = file["VTKHDF/Points"]
    stored["elements"] = as_json(list(mesh.cells))
    blocks = stored.create_group("cells")
    for name, block in mesh.cells.items():
        _packed(blocks, name, block)
    _write_groups(stored, "cell_groups", mesh.cell_groups)
    _write_groups(stored, "point_groups", mesh.point_groups)
    topology = layout.xdmf_topology(mesh)
    if topology is not None:
        _packed(stored, "xdmf_topology", topology)
    own.create_group("contact")
    growing_table(own, "steps", layout.STEP_ROW)
    growing_table(own, "notes", np.uint8, rows=BYTES)
    growing_table(own, "runs", layout.RUN_ROW)
    for number in (0, 1):
        growing_table(own, layout.restart_table(number), np.uint8, rows=int(np.clip(8 * mesh.n_points, BYTES, 1 << 20)))


def _write_groups(parent: Any, name: str, groups: Any) -> None:
    """Write named groups as their names, their sizes and all their members, one group after the other."""
    group = parent.create_group(name)
    group["names"] = as_json(list(groups))
    group["sizes"] = np.array([len(members) for members in groups.values()], np.int64)
    _packed(group, "members", np.concatenate([np.empty(0, np.int32), *groups.values()]))


@cache
def _versions() -> dict[str, str]:
    import h5py

    packages = ("fastcontact", "numpy", "scipy", "numba", "pyamg", "h5py")
    found = {"python": ".".join(map(str, sys.version_info[:3])), "hdf5": h5py.version.hdf5_version}
    for package in packages:
        with contextlib.suppress(metadata.PackageNotFoundError):
            found[package] = metadata.version(package)
    return found


def _packed(parent: Any, name: str, values: NDArray[Any]) -> None:
    """Write a fixed array, compressed with the one filter that all readers know."""
    if values.size:
        parent.create_dataset(name, data=values, compression="gzip", compression_opts=1, chunks=values.shape)
    else:
        parent.create_dataset(name, data=values)


def _growing_field(parent: Any, name: str, length: int, width: int) -> None:
    tail = () if width == 1 else (width,)
    parent.create_dataset(
        name,
        shape=(0, *tail),
        maxshape=(None, *tail),
        chunks=(max(length, 1), *tail),
        dtype=np.float64,
        compression="gzip",
        compression_opts=1,
    )


def growing_table(parent: Any, name: str, dtype: Any, width: int = 0, rows: int = ROWS) -> Any:
    """Create an empty table; uncompressed, so that growing never moves the rows that are there."""
    tail = (width,) if width else ()
    return parent.create_dataset(name, shape=(0, *tail), maxshape=(None, *tail), chunks=(rows, *tail), dtype=dtype)


def as_json(value: Any) -> str:
    """Return `value` as ASCII JSON; arrays become lists, NaN stays NaN."""
    return json.dumps(value, default=_plain)


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    return str(value)
