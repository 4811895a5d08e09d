"""Conversion of results to objects of PyVista, pandas and xarray, which are imported at first use."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from fastcontact.errors import FileError
from fastcontact.mesh.mesh import Mesh
from fastcontact.results import layout
from fastcontact.results.step import StepResult
from fastcontact.results.tables import AXES, STRESS_COMPONENTS, contact_table
from fastcontact.results.units import column_units

if TYPE_CHECKING:
    import pandas

# Columns that precede those of contact tables.
LEADING = ("step", "load_factor", "contact")


def library(name: str, title: str, install: str) -> Any:
    """Import a library; FileError with the installation command if it is missing."""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise FileError(f"{title} is not installed: pip install {install}") from error


def _pyvista() -> Any:
    return library("pyvista", "PyVista", "'fastcontact[view]'")


def grid(mesh: Mesh, step: StepResult) -> Any:
    """Return a ``pyvista.UnstructuredGrid`` of the solid cells with the fields of a step and the groups."""
    pyvista = _pyvista()
    cells = layout.solid_cells(mesh)
    # The older layout of VTK, with the size of each cell before its nodes, is supported by all versions of PyVista.
    flat = np.insert(cells.connectivity, cells.offsets[:-1], np.diff(cells.offsets))
    made = pyvista.UnstructuredGrid(flat, cells.types, layout.padded(mesh.points, 3))
    for name, values in (layout.point_fields(mesh, step) | layout.point_flags(mesh)).items():
        made.point_data[name] = values
    by_cell: dict[str, Any] = layout.cell_fields(mesh) | step.cell_fields
    if step.material_stress is not None:
        by_cell |= {"material": step.material_stress.cells, **layout.material_fields(mesh, step)}
    for name, values in by_cell.items():
        made.cell_data[name] = values
    made.field_data["load_factor"] = np.array([step.load_factor])
    return made


def series(mesh: Mesh, steps: Iterable[StepResult]) -> Any:
    """Return a ``pyvista.MultiBlock`` with a block for each step, named ``"step 1"`` and so on."""
    blocks = _pyvista().MultiBlock()
    for step in steps:
        blocks.append(grid(mesh, step), f"step {step.index}")
    return blocks


def data_frame(table: Any, units: Mapping[str, str], columns: Sequence[str] | None = None) -> pandas.DataFrame:
    """Return a table as a ``pandas.DataFrame``; its ``attrs["units"]`` contains the known units by column."""
    frame = library("pandas", "pandas", "'fastcontact[table]'").DataFrame(table, columns=columns)
    if named := {name: text for name, text in units.items() if text}:
        frame.attrs["units"] = named
    return cast("pandas.DataFrame", frame)


def contact_frame(steps: Iterable[StepResult], units: Mapping[str, str]) -> pandas.DataFrame:
    """Return the contact tables of all steps as one ``pandas.DataFrame``, with the columns `LEADING` before the others."""
    concat = library("pandas", "pandas", "'fastcontact[table]'").concat
    frames = []
    for step in steps:
        for name, contact in step.contact.items():
            frame = data_frame(contact_table(contact, step), {})
            for column, value in (("contact", name), ("load_factor", step.load_factor), ("step", step.index)):
                frame.insert(0, column, value)
            frames.append(frame)
    whole = concat(frames, ignore_index=True) if frames else None
    return data_frame(whole, column_units(() if whole is None else whole.columns, units), None if frames else LEADING)


def dataset(mesh: Mesh, steps: Iterable[StepResult], units: dict[str, str]) -> Any:
    """Return an ``xarray.Dataset`` of steps with the dimensions step, point, axis, stress_component and contact."""
    xarray, read, dim = library("xarray", "xarray", "xarray"), list(steps), mesh.dim
    pairs = list(dict.fromkeys(name for step in read for name in step.contact))
    components = list(STRESS_COMPONENTS[: 4 if dim == 2 else 6])

    def of_pairs(step: StepResult, name: str, missing: Any) -> list[Any]:
        return [getattr(step.contact[pair], name) if pair in step.contact else missing for pair in pairs]

    fields: dict[str, tuple[tuple[str, ...], str, Callable[[StepResult], Any]]] = {
        "displacement": (("point", "axis"), "length", lambda step: step.displacement),
        "stress": (("point", "stress_component"), "pressure", lambda step: step.stress),
        "von_mises": (("point",), "pressure", lambda step: step.von_mises),
        "von_mises_signed": (("point",), "pressure", lambda step: step.von_mises_signed),
        "reaction": (("point", "axis"), "force", lambda step: step.reaction),
        "contact_pressure": (("point",), "pressure", lambda step: layout.contact_pressure(mesh, step)),
        "contact_force": (("contact", "axis"), "force", lambda step: of_pairs(step, "force", np.full(dim, np.nan))),
        "contact_pressure_max": (("contact",), "pressure", lambda step: of_pairs(step, "pressure_max", np.nan)),
    }
    sizes = {"point": mesh.n_points, "axis": dim, "stress_component": len(components), "contact": len(pairs)}
    data = {}
    for name, (dims, quantity, of_step) in fields.items():
        values = np.array([of_step(step) for step in read], np.float64)
        shaped = values.reshape(len(read), *(sizes[name_of_dim] for name_of_dim in dims))
        data[name] = (("step", *dims), shaped, _unit(units, quantity))
    coordinates = {
        "step": [step.index for step in read],
        "load_factor": ("step", [step.load_factor for step in read]),
        "axis": list(AXES[:dim]),
        "stress_component": components,
        "contact": pairs,
    }
    places = {AXES[k]: (("point",), mesh.points[:, k], _unit(units, "length")) for k in range(dim)}
    return xarray.Dataset(data, coordinates | places)


def _unit(units: dict[str, str], quantity: str) -> dict[str, str]:
    """Return the attributes of a field: its unit, if known."""
    return {"units": units[quantity]} if units.get(quantity) else {}
