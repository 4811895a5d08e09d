"""Tables of results as NumPy structured arrays and CSV files, and conversion of results to PyVista, pandas and xarray."""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact._tools.lazy import import_library
from fastcontact._tools.paths import PathLike, replacing
from fastcontact.arrays import AnyArray, Array
from fastcontact.errors import CaseError, check_known
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.topology import ordered_line
from fastcontact.results import layout
from fastcontact.results.step import ContactResult, StepResult
from fastcontact.results.units import column_units

Columns = dict[str, AnyArray]

AXES = ("x", "y", "z")
# Quantities that determine the units of the nodal arrays of steps in datasets.
NODAL_QUANTITIES = {
    "displacement": "length", "stress": "pressure", "von_mises": "pressure", "von_mises_signed": "pressure",
    "reaction": "force",
}  # fmt: skip
STRESS_COMPONENTS = ("xx", "yy", "zz", "xy", "yz", "xz")


@typed(CaseError)
def contact_table(contact: ContactResult, step: StepResult | None = None) -> AnyArray:
    """Return the state of a contact pair as a table with a row for each secondary node.

    In 2D the nodes are ordered along the surface, in 3D by their numbers.

    Parameters
    ----------
    contact : ContactResult
        Result of a contact pair.
    step : StepResult, optional
        The step to which the result belongs, for columns with the fields of the body.

    Returns
    -------
    structured ndarray (m,)
        Table with the columns

        - ``point``: number of the node;
        - ``x``, ``y`` and, in 3D, ``z``: reference coordinates [length];
        - ``abscissa``, ``place`` and ``gap``, described for `ContactResult` [length]; the gap may be infinite;
        - ``radius``: distance from the middle of the contact, the magnitude of ``place`` [length];
        - ``pressure`` and ``multiplier`` [pressure];
        - ``force_x`` etc. [force], ``shear_x`` etc. [pressure], ``slip_x`` and ``slip_total_x`` etc. [length];
        - ``wear``, ``heat_flux``, ``damage``, ``fluid_pressure`` and ``sliding_load``, if the pair has these quantities,
          described for `ContactResult`;
        - ``active`` and ``sticking``: booleans.

        With `step` there are also ``displacement_x`` etc. [length] and ``stress_xx`` etc., ``normal_stress``,
        ``von_mises`` and ``von_mises_signed`` [pressure].

    Examples
    --------
    >>> import fastcontact as fc
    >>> mesh = fc.generate.block_on_block()
    >>> model = fc.Model(mesh, kinematics="plane_strain")
    >>> model.add_material(fc.LinearElastic(E=1000.0, nu=0.0))
    >>> model.fix("LOWER_BOTTOM", "xy")
    >>> model.fix("UPPER_LEFT", "x")
    >>> model.add_pressure("UPPER_TOP", 2.0)
    >>> model.add_contact("joint", secondary="CONT_UPPER", primary="CONT_LOWER")
    >>> steps = fc.solve(model, 2)
    >>> table = fc.contact_table(steps[-1].contact["joint"], steps[-1])
    >>> table["pressure"].round(9)
    array([2., 2., 2., 2., 2., 2., 2.])
    """
    columns = {
        **_positions(contact.points, contact.coordinates, contact.abscissa),
        "radius": np.abs(contact.place),
        "place": contact.place,
        "gap": contact.gap,
        "pressure": contact.pressure,
        "multiplier": contact.multiplier,
        **_components("force_", contact.force_vectors),
        **_components("shear_", contact.shear),
        **_components("slip_", contact.slip),
        **_components("slip_total_", contact.slip_total),
        **{name: values for name in layout.OPTIONAL_COLUMNS if (values := getattr(contact, name)) is not None},
        "active": contact.active,
        "sticking": contact.sticking,
    }
    if step is not None:
        fields = _fields(step, contact.points)
        equivalent = {name: fields.pop(name) for name in ("von_mises", "von_mises_signed")}
        columns |= fields | {"normal_stress": normal_stress(contact, step)} | equivalent
    table = structured(columns)
    if contact.abscissa.any() or contact.coordinates.shape[1] == 3:
        return table
    # Without an abscissa, as on closed lines and lines of several pieces, the nodes are sorted by their position.
    return table[np.argsort(contact.place, kind="stable")]


@typed(CaseError)
def normal_stress(contact: ContactResult, step: StepResult) -> Array:
    """Return the normal stress ``n . sigma . n`` at the secondary nodes of a contact pair.

    n is the normal of the opposite primary facet, and sigma the nodal stress. At closed nodes the normal stress equals the
    negative contact pressure up to the discretisation error.

    Parameters
    ----------
    contact : ContactResult
        Result of a contact pair.
    step : StepResult
        The step to which the result belongs.

    Returns
    -------
    ndarray (m,)
        Normal stress [pressure]; NaN at nodes without an opposite facet.

    Examples
    --------
    >>> import fastcontact as fc
    >>> mesh = fc.generate.block_on_block()
    >>> model = fc.Model(mesh, kinematics="plane_strain")
    >>> model.add_material(fc.LinearElastic(E=1000.0, nu=0.0))
    >>> model.fix("LOWER_BOTTOM", "xy")
    >>> model.fix("UPPER_LEFT", "x")
    >>> model.add_pressure("UPPER_TOP", 2.0)
    >>> model.add_contact("joint", secondary="CONT_UPPER", primary="CONT_LOWER")
    >>> steps = fc.solve(model, 2)
    >>> fc.normal_stress(steps[-1].contact["joint"], steps[-1]).round(9)
    array([-2., -2., -2., -2., -2., -2., -2.])
    """
    stress, (x, y) = step.stress[contact.points].T, contact.normal.T[:2]
    normal_component = x * x * stress[0] + y * y * stress[1] + 2.0 * x * y * stress[3]
    if len(stress) == 6:
        z = contact.normal[:, 2]
        normal_component += z * z * stress[2] + 2.0 * (y * z * stress[4] + x * z * stress[5])
    return np.where(np.linalg.norm(contact.normal, axis=1) > 0.5, normal_component, np.nan)


@typed(CaseError)
def line_table(mesh: Mesh, step: StepResult, group: str, start: str | int | None = None) -> AnyArray:
    """Return the fields along a line as a table with a row for each node, in order along the line.

    Parameters
    ----------
    mesh : Mesh
        The mesh of the step.
    step : StepResult
        The step with the fields.
    group : str
        Group of line cells that form a single open line.
    start : str or int, optional
        End of the line at which the table begins: the name of a point group or the number of a point. By default it is the
        end nearest to x = 0.

    Returns
    -------
    structured ndarray (m,)
        Table with the columns

        - ``point``: number of the node;
        - ``x``, ``y`` and, in 3D, ``z``: reference coordinates [length];
        - ``abscissa``: arc length from the first node [length];
        - ``radius``: distance from the line x = 0, in 3D from the y axis [length];
        - ``displacement_x`` etc. [length];
        - ``stress_xx`` etc., ``von_mises`` and ``von_mises_signed`` [pressure].

    Raises
    ------
    MeshError
        If the group does not exist or is not a single open line.

    Examples
    --------
    >>> import fastcontact as fc
    >>> mesh = fc.generate.block(divisions=(2, 2))
    >>> model = fc.Model(mesh, kinematics="plane_stress")
    >>> model.add_material(fc.LinearElastic(E=1000.0, nu=0.0))
    >>> model.fix("BOTTOM", "xy")
    >>> model.add_pressure("TOP", 2.0)
    >>> table = fc.line_table(mesh, fc.solve(model, 1)[-1], "RIGHT", start="BOTTOM_RIGHT")
    >>> table["displacement_y"].round(9)
    array([ 0.   , -0.001, -0.002])
    """
    line = ordered_line(mesh, group, start)
    x = mesh.points[line.points]
    radius = np.abs(x[:, 0]) if mesh.dim == 2 else np.hypot(x[:, 0], x[:, 2])
    columns = {**_positions(line.points, x, line.abscissa), "radius": radius}
    return structured(columns | _fields(step, line.points))


def with_column(table: AnyArray, name: str, values: AnyArray) -> AnyArray:
    """Return a table (m,) with an additional column called `name`, which contains `values` (m,)."""
    return structured({**_columns(table), name: values})


@typed(CaseError)
def write_csv(path: PathLike, table: AnyArray, units: Mapping[str, str] | None = None) -> None:
    """Write a table as comma-separated values (RFC 4180) with one header line.

    Floating-point numbers are written with 17 significant digits, from which they are recovered exactly.

    Parameters
    ----------
    path : path-like
        File to write; an existing file is replaced.
    table : structured ndarray (m,)
        The table, for example the result of `contact_table`.
    units : mapping of str to str, optional
        Names of units by column, which are appended to the names of the columns in brackets.

    Raises
    ------
    CaseError
        If `units` contains an unknown column.
    FileError
        If the file cannot be written.

    Examples
    --------
    >>> import fastcontact as fc
    >>> mesh = fc.generate.block_on_block()
    >>> model = fc.Model(mesh, kinematics="plane_strain")
    >>> model.add_material(fc.LinearElastic(E=1000.0, nu=0.0))
    >>> model.fix("LOWER_BOTTOM", "xy")
    >>> model.fix("UPPER_LEFT", "x")
    >>> model.add_pressure("UPPER_TOP", 2.0)
    >>> model.add_contact("joint", secondary="CONT_UPPER", primary="CONT_LOWER")
    >>> steps = fc.solve(model, 2)
    >>> fc.write_csv("joint.csv", fc.contact_table(steps[-1].contact["joint"]), units={"pressure": "MPa"})
    """
    columns, units = _columns(table), dict(units or {})
    for name in units:
        check_known("column", name, columns, CaseError)
    header = [f"{name} [{units[name]}]" if name in units else name for name in columns]
    texts = [[_text(value) for value in column.tolist()] for column in columns.values()]
    with replacing(path) as temporary, open(temporary, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(header)
        writer.writerows(zip(*texts))


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        text = f"{value:.17g}"
        return text if text.strip("-0123456789") else text + ".0"  # without it, readers would parse an integer
    return str(value)


def structured(columns: Mapping[str, AnyArray | Sequence[Any]]) -> AnyArray:
    """Return columns (m,) of equal length, given by name, as one structured array (m,)."""
    arrays = {name: np.asarray(column) for name, column in columns.items()}
    table = np.empty(len(next(iter(arrays.values()))), dtype=[(name, array.dtype) for name, array in arrays.items()])
    for name, array in arrays.items():
        table[name] = array
    return table


def _columns(table: AnyArray) -> Columns:
    if not isinstance(table, np.ndarray) or table.dtype.names is None:
        raise CaseError(
            f"a table is an array with named columns, such as contact_table returns, not an object of {type(table)}"
        )
    return {name: table[name] for name in table.dtype.names}


def _components(prefix: str, vectors: AnyArray) -> Columns:
    return {f"{prefix}{axis}": vectors[:, i] for i, axis in enumerate(AXES[: vectors.shape[1]])}


def _positions(points: AnyArray, coordinates: AnyArray, abscissa: AnyArray) -> Columns:
    return {"point": points, **_components("", coordinates), "abscissa": abscissa}


def _fields(step: StepResult, points: AnyArray) -> Columns:
    """Return the columns of displacement, stress and von Mises stress at `points` (m,)."""
    stress = step.stress[points]
    return {
        **_components("displacement_", step.displacement[points]),
        **{f"stress_{name}": stress[:, i] for i, name in enumerate(STRESS_COMPONENTS[: stress.shape[1]])},
        "von_mises": step.von_mises[points],
        "von_mises_signed": step.von_mises_signed[points],
    }


if TYPE_CHECKING:
    import pandas

# Columns that `contact_frame` places before those of contact tables.
STEP_COLUMNS = ("step", "load_factor", "contact")


def _pyvista() -> Any:
    return import_library("pyvista", "PyVista", "'fastcontact[view]'")


def grid(mesh: Mesh, step: StepResult) -> Any:
    """Return a ``pyvista.UnstructuredGrid`` of the solid cells, with the fields of a step and flags of the groups."""
    pyvista = _pyvista()
    cells = layout.solid_cells(mesh)
    # The older layout of VTK, with the size of each cell before its nodes, is supported by all versions of PyVista.
    flat = np.insert(cells.connectivity, cells.offsets[:-1], np.diff(cells.offsets))
    unstructured_grid = pyvista.UnstructuredGrid(flat, cells.types, layout.pad_columns(mesh.points, 3))
    for name, values in (layout.point_fields(mesh, step) | layout.point_flags(mesh)).items():
        unstructured_grid.point_data[name] = values
    by_cell: dict[str, Any] = layout.cell_fields(mesh) | step.cell_fields
    if step.material_stress is not None:
        by_cell |= {"material": step.material_stress.cells, **layout.material_fields(mesh, step)}
    for name, values in by_cell.items():
        unstructured_grid.cell_data[name] = values
    unstructured_grid.field_data["load_factor"] = np.array([step.load_factor])
    return unstructured_grid


def series(mesh: Mesh, steps: Iterable[StepResult]) -> Any:
    """Return a ``pyvista.MultiBlock`` with a block for each step, named ``"step 1"`` and so on."""
    blocks = _pyvista().MultiBlock()
    for step in steps:
        blocks.append(grid(mesh, step), f"step {step.index}")
    return blocks


def data_frame(table: Any, units: Mapping[str, str], columns: Sequence[str] | None = None) -> pandas.DataFrame:
    """Return a table as a ``pandas.DataFrame``; its ``attrs["units"]`` contains the known units by column."""
    frame = import_library("pandas", "pandas", "'fastcontact[table]'").DataFrame(table, columns=columns)
    if known := {name: text for name, text in units.items() if text}:
        frame.attrs["units"] = known
    return cast("pandas.DataFrame", frame)


def contact_frame(steps: Iterable[StepResult], units: Mapping[str, str]) -> pandas.DataFrame:
    """Return the contact tables of all steps as one ``pandas.DataFrame``, in which the `STEP_COLUMNS` come first."""
    concat = import_library("pandas", "pandas", "'fastcontact[table]'").concat
    frames = []
    for step in steps:
        for name, contact in step.contact.items():
            frame = data_frame(contact_table(contact, step), {})
            for column, value in (("contact", name), ("load_factor", step.load_factor), ("step", step.index)):
                frame.insert(0, column, value)
            frames.append(frame)
    combined = concat(frames, ignore_index=True) if frames else None
    columns = () if combined is None else combined.columns
    return data_frame(combined, column_units(columns, units), None if frames else STEP_COLUMNS)


def dataset(mesh: Mesh, steps: Iterable[StepResult], units: dict[str, str]) -> Any:
    """Return an ``xarray.Dataset`` of steps with the dimensions step, point, axis, stress_component and contact."""
    xarray, all_steps, dim = import_library("xarray", "xarray", "xarray"), list(steps), mesh.dim
    pairs = list(dict.fromkeys(name for step in all_steps for name in step.contact))
    components = list(STRESS_COMPONENTS[: 4 if dim == 2 else 6])
    sizes = {"point": mesh.n_points, "axis": dim, "stress_component": len(components), "contact": len(pairs)}
    data = {}

    def add(name: str, dims: tuple[str, ...], quantity: str, values: list[Any]) -> None:
        shape = len(all_steps), *(sizes[axis] for axis in dims)
        data[name] = ("step", *dims), np.array(values, np.float64).reshape(shape), _unit(units, quantity)

    quantities = NODAL_QUANTITIES | {name: quantity for name, (_, quantity) in layout.CONTACT_FIELDS.items()}
    fields = [step.__dict__ | layout.contact_fields(mesh, step) for step in all_steps]
    for name, quantity in quantities.items():
        if all(name in of_step for of_step in fields):
            dims = ("point", *{1: (), 3: ("axis",), 6: ("stress_component",)}[layout.POINT_FIELDS[name]])
            add(name, dims, quantity, [of_step[name] for of_step in fields])
    contacts = [[step.contact.get(pair) for pair in pairs] for step in all_steps]
    force = [[np.full(dim, np.nan) if c is None else c.force for c in of_step] for of_step in contacts]
    pressure = [[np.nan if c is None else c.pressure_max for c in of_step] for of_step in contacts]
    add("contact_force", ("contact", "axis"), "force", force)
    add("contact_pressure_max", ("contact",), "pressure", pressure)
    coordinates = {
        "step": [step.index for step in all_steps],
        "load_factor": ("step", [step.load_factor for step in all_steps]),
        "axis": list(AXES[:dim]),
        "stress_component": components,
        "contact": pairs,
    }
    positions = {AXES[k]: (("point",), mesh.points[:, k], _unit(units, "length")) for k in range(dim)}
    return xarray.Dataset(data, coordinates | positions)


def _unit(units: dict[str, str], quantity: str) -> dict[str, str]:
    """Return the attributes of a field: its unit, if known."""
    return {"units": units[quantity]} if units.get(quantity) else {}
