"""What a step adds to a result file, table by table; nothing of it counts before the number of steps does."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastcontact.mesh.mesh import Mesh
from fastcontact.results import _layout as layout
from fastcontact.results._header import BYTES, ROWS, as_json, growing_table
from fastcontact.results.step import ContactResult, StepResult


def append_fields(file: Any, mesh: Mesh, number: int, step: StepResult, cell_fields: Sequence[str]) -> None:
    """Write point and cell fields as those of step `number`, over what a dead writer may have left of it."""
    first = number * mesh.n_points
    data = file["VTKHDF/PointData"]
    for name, values in layout.point_fields(mesh, step).items():
        data[name].resize(first + len(values), axis=0)
        data[name][first:] = values
    for name in cell_fields:
        field, values = file["VTKHDF/CellData"][name], step.cell_fields[name]
        field.resize((number + 1) * len(values), axis=0)
        field[number * len(values) :] = values


def append_tables(
    file: Any, mesh: Mesh, number: int, step: StepResult, pairs: dict[str, Any], notes: Mapping[str, Any]
) -> None:
    """Write contact tables, iterations, warnings and further `notes`; `pairs` (by name) learns the pairs that are new."""
    own = file["fastcontact"]
    for name in step.contact:
        if name not in pairs:
            pairs[name] = _new_pair(own["contact"], name, mesh.dim)
    for name, pair in pairs.items():
        _append_contact(pair, number, step.contact.get(name))
    told = {
        **notes,
        "contact": [[name, contact.formulation] for name, contact in step.contact.items()],
        "iterations": step.iterations,
        "warnings": list(step.warnings),
    }
    text = np.frombuffer(as_json(told).encode("ascii"), np.uint8)
    row = (step.index, step.load_factor, len(own["notes"]), len(text))
    _extend(own["notes"], text)
    _set_row(own["steps"], number, np.array(row, layout.STEP_ROW))


def append_rows(file: Any, mesh: Mesh, number: int, step: StepResult, cell_fields: Sequence[str]) -> None:
    """Write where viewers find the fields of step `number`."""
    steps = file["VTKHDF/Steps"]
    _set_row(steps["Values"], number, step.load_factor)
    _set_row(steps["NumberOfParts"], number, 1)
    _set_row(steps["PartOffsets"], number, 0)
    _set_row(steps["CellOffsets"], number, 0)
    _set_row(steps["PointDataOffsets/displacement"], number, number * mesh.n_points)
    for name in cell_fields:
        _set_row(steps["CellDataOffsets"][name], number, number * len(file["VTKHDF/Types"]))


def append_run(file: Any, n_steps: int, run: Any, flush: Callable[[], None]) -> None:
    """Write how a run ended after `n_steps` steps: whatever JSON can hold; `flush` sees it to the file."""
    own, text = file["fastcontact"], np.frombuffer(as_json(run).encode("ascii"), np.uint8)
    row = np.array((n_steps, len(own["notes"]), len(text)), layout.RUN_ROW)
    _extend(own["notes"], text)
    flush()
    _set_row(own["runs"], len(own["runs"]), row)
    flush()


def set_restart(file: Any, number: int, state: NDArray[np.uint8]) -> None:
    """Write the packed restart state of step `number`; the table never shrinks: HDF5 would give the room away."""
    table = file["fastcontact"][layout.restart_table(number)]
    if len(table) < len(state):
        table.resize(len(state), axis=0)
    table[: len(state)] = state


def header_size(mesh: Mesh) -> int:
    """Return an upper bound for what a file without steps takes [bytes]."""
    n_groups = len(mesh.cell_groups) + len(mesh.point_groups)
    arrays: list[NDArray[Any]] = [mesh.points]
    for named in (mesh.cells, mesh.cell_groups, mesh.point_groups):
        arrays.extend(named.values())
    return 6 * sum(array.nbytes for array in arrays) + n_groups * (mesh.n_cells + mesh.n_points + BYTES)


def step_size(mesh: Mesh, step: StepResult) -> int:
    """Return an upper bound for what a step takes in the file, but for its restart state [bytes]."""
    fields = 8 * sum(layout.POINT_FIELDS.values()) * mesh.n_points
    row = layout.contact_row(mesh.dim).itemsize
    fields += 8 * sum(map(np.size, step.cell_fields.values()))
    contact = sum((len(pair.points) + 2 * ROWS) * row + BYTES for pair in step.contact.values())
    return int(1.01 * fields) + contact + len(as_json([step.iterations, step.warnings]))


def _new_pair(parent: Any, name: str, dim: int) -> Any:
    pair = parent.create_group(None)  # without a name until it is whole: the program may be interrupted
    pair["name"] = as_json(name)
    growing_table(pair, "rows", layout.contact_row(dim))
    growing_table(pair, "steps", layout.contact_step(dim))
    parent[str(len(parent))] = pair
    return pair


def _append_contact(pair: Any, number: int, contact: ContactResult | None) -> None:
    """Append a pair's state; a step without it gets a row of zeros."""
    row = np.zeros((), pair["steps"].dtype)
    if contact is not None:
        table = np.zeros(len(contact.points), pair["rows"].dtype)
        for name in table.dtype.names or ():
            table[name] = getattr(contact, name)
        row["first"], row["count"] = len(pair["rows"]), len(table)
        row["force"], row["radius"] = contact.force, contact.radius
        row["dissipation"] = contact.dissipation
        row["obstacle_displacement"] = (
            np.nan if contact.obstacle_displacement is None else contact.obstacle_displacement
        )
        _extend(pair["rows"], table)
    _set_row(pair["steps"], number, row)


def _extend(table: Any, values: NDArray[Any]) -> None:
    first = len(table)
    table.resize(first + len(values), axis=0)
    table[first:] = values


def _set_row(table: Any, number: int, value: Any) -> None:
    table.resize(number + 1, axis=0)
    table[number] = value
