"""Functions that write the arrays of a result file: groups and empty tables when it is created, and the data of each step.

The data of a step become valid when the writer increments the number of steps, which is its last action.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastcontact._tools.versions import versions
from fastcontact.arrays import AnyArray
from fastcontact.mesh.mesh import Mesh
from fastcontact.results import layout
from fastcontact.results.step import ContactResult, MaterialStress, StepResult

# Sizes of the chunks of growing tables [rows] and of growing texts [bytes].
ROWS, BYTES = 64, 4096
# Largest size of a chunk that contains the fields of several steps [bytes].
MAX_SHARED = 4096


def write_geometry(
    file: Any, mesh: Mesh, varying: Sequence[str] = (), material: AnyArray | None = None, optional: Sequence[str] = ()
) -> None:
    """Write the group /VTKHDF with the solid cells, the constant arrays and empty tables for the steps.

    `varying` contains the names of the cell fields that vary from step to step, and `optional` those of the
    `layout.OPTIONAL_FIELDS` that steps have. `material` (n_solids,) contains the material number of each cell, if the model
    has material interfaces. The steps of such a model also have the `layout.MATERIAL_FIELDS`.
    """
    root = file.create_group("VTKHDF")
    root.attrs["Version"] = np.array([2, 0], np.int64)
    root.attrs["Type"] = np.bytes_("UnstructuredGrid")  # readers require a fixed-length ASCII string
    cells = layout.solid_cells(mesh)
    root["NumberOfPoints"] = np.array([mesh.n_points], np.int64)
    root["NumberOfCells"] = np.array([len(cells.types)], np.int64)
    root["NumberOfConnectivityIds"] = np.array([len(cells.connectivity)], np.int64)
    _write_constant(root, "Points", layout.pad_columns(mesh.points, 3))
    _write_constant(root, "Connectivity", cells.connectivity)
    _write_constant(root, "Offsets", cells.offsets)
    _write_constant(root, "Types", cells.types)
    point_data, cell_data = root.create_group("PointData"), root.create_group("CellData")
    names = [name for name in layout.POINT_FIELDS if name in optional or name not in layout.OPTIONAL_FIELDS]
    for name in names:
        _growing_field(point_data, name, mesh.n_points, layout.POINT_FIELDS[name])
    point_flags, cell_fields = layout.point_flags(mesh), layout.cell_fields(mesh)
    for name, values in point_flags.items():
        _write_constant(point_data, name, values)
    for name, values in cell_fields.items():
        _write_constant(cell_data, name, values)
    widths = dict.fromkeys(varying, 1)
    if material is not None:
        _write_constant(cell_data, "material", material)
        cell_fields = {**cell_fields, "material": material}
        widths |= layout.MATERIAL_FIELDS
    for name, width in widths.items():
        _growing_field(cell_data, name, len(cells.types), width)
    _write_steps_group(root, names, point_flags, cell_fields, widths)


def _write_steps_group(
    root: Any, point: Iterable[str], static_point: Iterable[str], static_cell: Iterable[str], cell: Iterable[str]
) -> None:
    """Write the empty tables of steps. Tables with equal contents are stored as one data set with several names.

    `point` and `cell` contain the names of the point and cell data of each step, `static_point` and `static_cell` those of
    the arrays that are the same in all steps.
    """
    steps = root.create_group("Steps")
    steps.attrs["NSteps"] = np.int64(0)
    growing_table(steps, "Values", np.float64)
    growing_table(steps, "NumberOfParts", np.int64)
    zeros = growing_table(steps, "PartOffsets", np.int64)
    steps["PointOffsets"] = zeros
    steps["CellOffsets"] = growing_table(steps, "ConnectivityIdOffsets", np.int64, width=1)
    point_offsets, cell_offsets = steps.create_group("PointDataOffsets"), steps.create_group("CellDataOffsets")
    rows = growing_table(point_offsets, "displacement", np.int64)
    for name in point:
        if name != "displacement":
            point_offsets[name] = rows
    for name in static_point:
        point_offsets[name] = zeros
    for name in static_cell:
        cell_offsets[name] = zeros
    for name in cell:
        growing_table(cell_offsets, name, np.int64)


def write_case(file: Any, mesh: Mesh, kinematics: str, case_text: str, units: Mapping[str, str]) -> None:
    """Write the group /fastcontact with the mesh, all its cells and groups, the case, and empty tables for the steps."""
    import h5py

    group = file.create_group("fastcontact")
    group.attrs["schema"] = np.int64(layout.SCHEMA)
    group["kinematics"] = as_json(kinematics)
    group["case"] = as_json(case_text)
    group["versions"] = as_json({**versions(), "hdf5": h5py.version.hdf5_version})
    if units:
        group["units"] = as_json(dict(units))
    mesh_group = group.create_group("mesh")
    mesh_group.attrs["dim"] = np.int64(mesh.dim)
    mesh_group["points"] = file["VTKHDF/Points"]
    mesh_group["elements"] = as_json(list(mesh.cells))
    blocks = mesh_group.create_group("cells")
    for name, block in mesh.cells.items():
        _write_constant(blocks, name, block)
    _write_groups(mesh_group, "cell_groups", mesh.cell_groups)
    _write_groups(mesh_group, "point_groups", mesh.point_groups)
    topology = layout.xdmf_topology(mesh)
    if topology is not None:
        _write_constant(mesh_group, "xdmf_topology", topology)
    group.create_group("contact")
    growing_table(group, "steps", layout.STEP_ROW)
    growing_table(group, "notes", np.uint8, rows=BYTES)
    growing_table(group, "runs", layout.RUN_ROW)
    for number in (0, 1):
        growing_table(group, layout.restart_table(number), np.uint8, rows=min(max(8 * mesh.n_points, BYTES), 1 << 20))


def _write_groups(parent: Any, name: str, groups: Any) -> None:
    """Write groups as their names, their sizes and the members of all groups in sequence."""
    group = parent.create_group(name)
    group["names"] = as_json(list(groups))
    group["sizes"] = np.array([len(members) for members in groups.values()], np.int64)
    _write_constant(group, "members", np.concatenate([np.empty(0, np.int32), *groups.values()]))


def _write_constant(parent: Any, name: str, values: AnyArray) -> None:
    """Write a constant array, compressed with gzip, the only filter that all readers support."""
    if values.size:
        parent.create_dataset(name, data=values, compression="gzip", compression_opts=1, chunks=values.shape)
    else:
        parent.create_dataset(name, data=values)


def _growing_field(parent: Any, name: str, length: int, width: int) -> None:
    """Create an empty field.

    A chunk contains a small field at several steps, because the chunk index would otherwise be larger than the fields. Only
    chunks of a single step are compressed, because a compressed chunk moves in the file when data are added to it, and only
    those of `layout.SPARSE_FIELDS`. Other fields would shrink by 30 % only, and their compression
    would take up to half of the writing time.
    """
    tail, rows = () if width == 1 else (width,), max(length, 1)
    steps = MAX_SHARED // (8 * rows * width)
    packed = {"compression": "gzip", "compression_opts": 1} if steps <= 1 and name in layout.SPARSE_FIELDS else {}
    chunks = (max(steps, 1) * rows, *tail)
    parent.create_dataset(name, shape=(0, *tail), maxshape=(None, *tail), chunks=chunks, dtype=np.float64, **packed)


def growing_table(parent: Any, name: str, dtype: Any, width: int = 0, rows: int = ROWS) -> Any:
    """Create an empty table, which is not compressed, so that existing rows do not move in the file when it grows."""
    tail = (width,) if width else ()
    return parent.create_dataset(name, shape=(0, *tail), maxshape=(None, *tail), chunks=(rows, *tail), dtype=dtype)


def as_json(value: Any) -> str:
    """Return `value` as JSON in ASCII; arrays become lists, and NaN is written as NaN."""
    return json.dumps(value, default=_json_default)


def _json_default(value: Any) -> Any:
    """Return NumPy numbers and arrays as numbers and lists, and all other objects as strings."""
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    return str(value)


class OpenObjects(dict[str, Any]):
    """Groups and data sets of a file by path, each opened once; None for an object that the file does not contain."""

    def __init__(self, file: Any) -> None:
        self.file = file

    def __missing__(self, path: str) -> Any:
        self[path] = opened = self.file.get(path)
        return opened


def append_fields(file: OpenObjects, mesh: Mesh, number: int, step: StepResult, cell_fields: Sequence[str]) -> None:
    """Write the point and cell fields of step `number`, which replace those of a step that was not completed."""
    by_cell = {name: step.cell_fields[name] for name in cell_fields}
    by_cell |= layout.material_fields(mesh, step) if _has_material_stress(file) else {}
    for group, fields in (("PointData", layout.point_fields(mesh, step)), ("CellData", by_cell)):
        for name, values in fields.items():
            table = file[f"VTKHDF/{group}/{name}"]
            if table is not None:
                _extend(table, values, number * len(values))


def _has_material_stress(file: OpenObjects) -> bool:
    return file[f"VTKHDF/CellData/{layout.CELL_STRESS}"] is not None


def append_tables(
    file: OpenObjects, mesh: Mesh, number: int, step: StepResult, pairs: dict[str, Any], notes: Mapping[str, Any]
) -> None:
    """Write contact tables, iterations, warnings and other `notes` of step `number`; new pairs are added to `pairs`."""
    for name in step.contact:
        if name not in pairs:
            columns = layout.optional_columns(step.contact[name])
            pairs[name] = _new_pair(file["fastcontact/contact"], name, mesh.dim, columns)
    for name, pair in pairs.items():
        _append_contact(pair, number, step.contact.get(name))
    if step.material_stress is not None:
        _append_material_stress(file["fastcontact"], mesh, number, step.material_stress)
    contact = [[name, contact.formulation] for name, contact in step.contact.items()]
    text = as_json({**notes, "contact": contact, "iterations": step.iterations, "warnings": list(step.warnings)})
    table = file["fastcontact/notes"]
    row = (step.index, step.load_factor, len(table), len(text))
    _extend(table, np.frombuffer(text.encode("ascii"), np.uint8))
    _set_row(file["fastcontact/steps"], number, np.array(row, layout.STEP_ROW))


def append_offsets(file: OpenObjects, mesh: Mesh, number: int, step: StepResult, cell_fields: Sequence[str]) -> None:
    """Write the rows of step `number` that contain the positions of its fields, for viewers."""
    rows = {"Values": step.load_factor, "NumberOfParts": 1, "PartOffsets": 0, "CellOffsets": 0}
    for name, value in {**rows, "PointDataOffsets/displacement": number * mesh.n_points}.items():
        _set_row(file[f"VTKHDF/Steps/{name}"], number, value)
    optional = layout.MATERIAL_FIELDS if _has_material_stress(file) else ()
    for name in (*cell_fields, *optional):
        _set_row(file[f"VTKHDF/Steps/CellDataOffsets/{name}"], number, number * len(file["VTKHDF/Types"]))


def append_run(file: OpenObjects, n_steps: int, run: Any, flush: Callable[[], None]) -> None:
    """Write the record of a run that ended after `n_steps` steps as JSON.

    `flush` is called after the text and after the row with its position have been written.
    """
    notes, runs, text = file["fastcontact/notes"], file["fastcontact/runs"], as_json(run)
    row = np.array((n_steps, len(notes), len(text)), layout.RUN_ROW)
    _extend(notes, np.frombuffer(text.encode("ascii"), np.uint8))
    flush()
    _set_row(runs, len(runs), row)
    flush()


def set_restart(file: OpenObjects, number: int, state: NDArray[np.uint8]) -> None:
    """Write the packed restart data of step `number`. The table never shrinks, because HDF5 could overwrite freed space."""
    table = file[f"fastcontact/{layout.restart_table(number)}"]
    if len(table) < len(state):
        table.resize(len(state), axis=0)
    _write(table, state, 0)


def _new_pair(parent: Any, name: str, dim: int, optional: Iterable[str]) -> dict[str, Any]:
    pair = parent.create_group(None)  # gets its name when it is complete, in case of an interrupt
    pair["name"] = as_json(name)
    growing_table(pair, "rows", layout.contact_row(dim, optional))
    growing_table(pair, "primary", layout.primary_row(dim))
    growing_table(pair, "steps", layout.contact_step_row(dim))
    parent[str(len(parent))] = pair
    return dict(pair)


def _append_contact(pair: dict[str, Any], number: int, contact: ContactResult | None) -> None:
    """Append the state of a pair, or a row of zeros for a step without the pair."""
    rows, steps = pair["rows"], pair["steps"]
    row = np.zeros((), steps.dtype)
    if contact is not None:
        row["first"], row["count"] = _append_rows(rows, contact)
        for name in set(row.dtype.names or ()).difference(layout.ROW_COLUMNS):
            value = getattr(contact, name)
            row[name] = np.nan if value is None else value
        if "primary" in pair:  # files of earlier versions do not have this table
            row["primary_first"], row["primary_count"] = _append_rows(pair["primary"], contact, "primary_")
    _set_row(steps, number, row)


def _append_material_stress(parent: Any, mesh: Mesh, number: int, sides: MaterialStress) -> None:
    """Append the stress of each material at interfaces; the first call creates the tables."""
    if "materials" not in parent:
        group = parent.create_group(None)  # gets its name when it is complete, in case of an interrupt
        _write_constant(group, "cells", np.asarray(sides.cells, np.int32))
        growing_table(group, "rows", layout.material_row(mesh.dim))
        growing_table(group, "steps", layout.MATERIAL_STEP_ROW)
        parent["materials"] = group
    group = parent["materials"]
    _set_row(group["steps"], number, np.array((len(group["rows"]), len(sides.points)), layout.MATERIAL_STEP_ROW))
    _append_rows(group["rows"], sides)


def _append_rows(table: Any, source: ContactResult | MaterialStress, prefix: str = "") -> tuple[int, int]:
    """Append a row for each point, with the arrays of `source` as columns; return the first row and the number of rows."""
    rows = np.zeros(len(getattr(source, f"{prefix}points")), table.dtype)
    for name in table.dtype.names:
        rows[name] = getattr(source, prefix + name)
    first = len(table)
    _extend(table, rows)
    return first, len(rows)


def _extend(table: Any, values: AnyArray, first: int | None = None) -> None:
    """Write values from row `first`, by default after the last row."""
    first = table.id.shape[0] if first is None else first
    table.id.set_extent((first + len(values), *values.shape[1:]))
    _write(table, values, first)


def _set_row(table: Any, number: int, value: Any) -> None:
    _extend(table, np.full((1, *table.id.shape[1:]), value, table.id.dtype), number)


def _write(table: Any, values: AnyArray, first: int) -> None:
    """Write values to the rows from `first`, without the indexing of h5py, which would take longer for small tables."""
    from h5py import h5s

    if values.size:
        rows = table.id.get_space()
        rows.select_hyperslab((first, *[0] * (values.ndim - 1)), values.shape)
        # Without an explicit type, h5py would construct one from the types of all columns in each call.
        memory = np.ascontiguousarray(values, table.id.dtype), table.id.get_type()
        table.id.write(h5s.create_simple(values.shape), rows, *memory)
