"""Layout of result files, and the arrays that are written to them.

A result file is an HDF5 file with two groups. Viewers read the first group, which has the layout of VTKHDF files:

    VTKHDF/Points, Connectivity, Offsets, Types     the mesh: solid cells only, three coordinates
    VTKHDF/PointData, CellData                      fields; each data set contains one field at all steps in sequence
    VTKHDF/Steps                                    NSteps, load factors, and offsets of the fields of each step

The second group contains the data that VTKHDF does not support:

    fastcontact/mesh                                points, cells of all dimensions, groups
    fastcontact/kinematics, case, versions, units   JSON texts; units if the model defines them
    fastcontact/steps                               a row for each step (STEP_ROW) with the position of its notes
    fastcontact/contact/0, 1, ...                   for each pair: its name, a row for each secondary node and step, a row for
                                                    each primary node and step, and a row for each step
    fastcontact/materials                           material of each cell, nodal stress by material at interfaces, and a row
                                                    for each step (MATERIAL_STEP_ROW); only with material interfaces
    fastcontact/notes                               JSON texts in sequence: iterations, warnings, ends of runs
    fastcontact/runs                                a row for each run (RUN_ROW) with the position of its record in the notes
    fastcontact/restart0, restart1                  packed restart data of the last two steps

A new nodal array requires an attribute of `step.StepResult`, its value in `analysis.load_step`, its name in
POINT_FIELDS, a check in `check_step`, and code in `reader`. A new array of contact pairs requires an attribute of
`step.ContactResult`, its value in `analysis.contact_result`, and a column in `contact_row` or `contact_step_row`. To be
shown on the mesh, it also needs its names in POINT_FIELDS and CONTACT_FIELDS.
"""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastcontact.arrays import AnyArray, Array, Numbers
from fastcontact.elasticity.material_sides import material_sides
from fastcontact.elasticity.recovery import von_mises
from fastcontact.errors import FileError
from fastcontact.mesh import elements, topology
from fastcontact.mesh.mesh import Mesh, starts_of
from fastcontact.results.step import ContactResult, StepResult


def cut_at_interfaces(mesh: Mesh, step: StepResult) -> tuple[Mesh, Numbers, Array]:
    """Return the mesh cut along material interfaces, and the node (m,) and the stress (m, n_components) of each point.

    The first points of the cut mesh are those of `mesh`. The cut mesh has only solid cells and no groups. Stress components
    are those of `StepResult.stress` [pressure]. Without interfaces, `mesh` itself is returned.
    """
    material_stress = step.material_stress
    if material_stress is None:
        return mesh, np.arange(mesh.n_points, dtype=np.int32), step.stress
    sides = material_sides(mesh, cells_by_element(mesh, material_stress.cells))
    stress = step.stress[sides.node]
    stress[sides.slot] = material_stress.stress
    return Mesh(mesh.points[sides.node], sides.cells), sides.node, stress


def cells_by_element(mesh: Mesh, values: AnyArray) -> dict[str, AnyArray]:
    """Return the values (n_solids,) of solid cells by element type."""
    ends = np.cumsum([len(block) for block in mesh.solids.values()])[:-1]
    return dict(zip(mesh.solids, np.split(values, ends), strict=True))


def mean_in_cells(mesh: Mesh, step: StepResult) -> Array:
    """Return the stress (n_solids, n_components) of each cell, the mean stress of its material at its nodes [pressure]."""
    separate_mesh, _, stress = cut_at_interfaces(mesh, step)
    return np.concatenate([stress[block].mean(axis=1) for block in separate_mesh.solids.values()])


Flags = NDArray[np.int8]

# Version of the layout. Version 2 added the restart data and the records of runs, version 3 the middle of a contact, and
# version 4 the slip.
SCHEMA = 4
# Oldest version of files to which a resumed analysis can append steps.
OLDEST_RESUMABLE = 2

# Number of components of point data in files, by name: 3 for vectors and 6 for symmetric tensors, as viewers expect. 2D
# models have 2 and 4 of these components, and the others are zero.
POINT_FIELDS = {
    "displacement": 3, "stress": 6, "von_mises": 1, "von_mises_signed": 1, "reaction": 3,
    "contact_pressure": 1, "contact_slip": 3, "contact_slip_total": 3,
    "temperature": 1, "heat_reaction": 1, "contact_wear": 1, "contact_damage": 1, "contact_fluid_pressure": 1,
}  # fmt: skip
# Captions of the point data of contact pairs, and the quantities that determine their units.
CONTACT_FIELDS = {
    "contact_pressure": ("contact pressure", "pressure"),
    "contact_slip": ("slip of the step", "length"),
    "contact_slip_total": ("total slip", "length"),
    "contact_wear": ("wear depth", "length"),
    "contact_damage": ("damage", ""),
    "contact_fluid_pressure": ("fluid pressure", "pressure"),
}
# Point data that are zero at most nodes.
SPARSE_FIELDS = ("reaction", "heat_reaction", *CONTACT_FIELDS)
# Point data that only some models have: heat conduction, wear, cohesive layers or adhesion, and fluid pressures.
OPTIONAL_FIELDS = ("temperature", "heat_reaction", "contact_wear", "contact_damage", "contact_fluid_pressure")
# Optional columns of contact tables, and optional vectors of contact pairs.
OPTIONAL_COLUMNS = ("wear", "heat_flux", "damage", "fluid_pressure", "sliding_load")
OPTIONAL_VECTORS = ("displacement", "fluid_force_vectors")

# Number of components of the cell data of models with material interfaces: the nodal stress of the material of a cell,
# averaged over the nodes of the cell, and its von Mises stress.
CELL_STRESS = "stress_in_cell"
CELL_VON_MISES = "von_mises_in_cell"
MATERIAL_FIELDS = {CELL_STRESS: 6, CELL_VON_MISES: 1}

STEP_ROW = np.dtype([("index", "<i8"), ("load_factor", "<f8"), ("notes_first", "<i8"), ("notes_count", "<i8")])

# Columns that contain the first row and the number of rows of the secondary and of the primary nodes of a pair at a step.
ROW_COLUMNS = ("first", "count", "primary_first", "primary_count")

# Row of a step in the table of materials: the first row and the number of rows of its nodal stress by material.
MATERIAL_STEP_ROW = np.dtype([("first", "<i8"), ("count", "<i8")])

# Row of a run: number of completed steps, and the position of its record in the notes.
RUN_ROW = np.dtype([("n_steps", "<i8"), ("first", "<i8"), ("count", "<i8")])


# Objects of a file, in addition to the steps, that are needed to resume an analysis.
NEEDED_TO_RESUME = (
    "fastcontact/runs", "fastcontact/notes", "fastcontact/contact", "VTKHDF/CellData", "VTKHDF/Types", "VTKHDF/Steps/Values",
    "VTKHDF/Steps/PointDataOffsets", "VTKHDF/Steps/CellDataOffsets",
)  # fmt: skip


def restart_table(number: int) -> str:
    """Return the name of the table for the restart data of the step with a given number.

    Steps use two tables alternately, so that the restart data of the previous step are complete while those of a step are
    written.
    """
    return f"restart{number % 2}"


def optional_columns(contact: ContactResult) -> tuple[str, ...]:
    """Return the names of the `OPTIONAL_COLUMNS` and `OPTIONAL_VECTORS` for which a pair has values."""
    return tuple(name for name in (*OPTIONAL_COLUMNS, *OPTIONAL_VECTORS) if getattr(contact, name) is not None)


def contact_row(dim: int, optional: Iterable[str] = ()) -> np.dtype[Any]:
    """Return the data type of the row of a secondary node of a pair at a step; `optional` are its `optional_columns`."""
    names = ("coordinates", "force_vectors", "normal", "shear", "slip", "slip_total")
    vectors = [(name, "<f8", (dim,)) for name in (*names, *(name for name in optional if name in OPTIONAL_VECTORS))]
    optional_scalars = (name for name in optional if name in OPTIONAL_COLUMNS)
    scalars = [(name, "<f8") for name in ("abscissa", "place", "gap", "pressure", "multiplier", *optional_scalars)]
    return np.dtype([("points", "<i4"), ("active", "i1"), ("sticking", "i1"), *scalars, *vectors])


def primary_row(dim: int) -> np.dtype[Any]:
    """Return the data type of the row of a primary node of a pair at a step, with its contact force."""
    return np.dtype([("points", "<i4"), ("force_vectors", "<f8", (dim,))])


def contact_step_row(dim: int) -> np.dtype[Any]:
    """Return the data type of the row of a contact pair at a step.

    The row contains the ROW_COLUMNS, which locate the rows of its nodes, and attributes of `step.ContactResult`, with NaN for
    None. Some files of schema 2 have neither the table with the type `primary_row` nor the columns that refer to it.
    """
    sums = [("force", "<f8", (dim,)), ("radius", "<f8", (2,)), ("dissipation", "<f8")]
    sums.append(("obstacle_displacement", "<f8", (dim,)))  # NaN for contact between bodies
    sums += [("obstacle_angle", "<f8"), ("torque", "<f8")]  # NaN without a rotation
    sums += [("middle", "<f8", (dim,)), ("tangent", "<f8", (dim,))]  # NaN without a tangent
    sums += [("stick_bounds", "<f8", (2,)), ("direction", "<f8", (dim,))]  # NaN in 2D
    return np.dtype([*((name, "<i8") for name in ROW_COLUMNS), *sums])


def material_row(dim: int) -> np.dtype[Any]:
    """Return the data type of the row of the stress of one material at a node on an interface at a step."""
    return np.dtype([("points", "<i4"), ("material", "<i4"), ("stress", "<f8", (4 if dim == 2 else 6,))])


def material_fields(mesh: Mesh, step: StepResult) -> dict[str, Array]:
    """Return the `MATERIAL_FIELDS`: stress (n_solids, 6) and von Mises stress (n_solids,) of cells [pressure]."""
    stress = mean_in_cells(mesh, step)
    return {CELL_STRESS: pad_columns(stress, 6), CELL_VON_MISES: von_mises(stress)}


class SolidCells(NamedTuple):
    """Solid cells in the layout of VTK: the nodes of all cells in sequence, the offsets of cells, and the VTK cell types."""

    connectivity: NDArray[np.int64]
    offsets: NDArray[np.int64]
    types: NDArray[np.uint8]


def solid_cells(mesh: Mesh) -> SolidCells:
    """Return the solid cells of a mesh, ordered by element type."""
    blocks = mesh.solids
    counts = [len(block) for block in blocks.values()]
    sizes = np.repeat([block.shape[1] for block in blocks.values()], counts)
    nodes = [block.ravel() for block in blocks.values()]
    connectivity = np.concatenate([np.empty(0, np.int64), *nodes], dtype=np.int64)
    offsets = np.concatenate([[0], np.cumsum(sizes)], dtype=np.int64, casting="unsafe")
    types = np.repeat(np.array([elements.get(name).vtk for name in blocks], np.uint8), counts)
    return SolidCells(connectivity, offsets, types)


def xdmf_topology(mesh: Mesh) -> Numbers | None:
    """Return, in sequence, the XDMF code and the nodes of each solid cell, or None if there are no solid cells.

    XDMF readers use the node order of VTK.
    """
    if not mesh.solids:
        return None
    blocks = [np.insert(block, 0, elements.get(name).xdmf, axis=1).ravel() for name, block in mesh.solids.items()]
    return np.concatenate(blocks).astype(np.int32)


def pad_columns(values: Array, width: int) -> Array:
    """Return `values` (n, k) padded with zero columns to `width`; a width of 1 leaves a vector (n,) unchanged."""
    values = np.asarray(values, np.float64)
    if width == 1 or values.shape[1] == width:
        return values
    return np.concatenate([values, np.zeros((len(values), width - values.shape[1]))], axis=1)


def contact_fields(mesh: Mesh, step: StepResult, names: Iterable[str] = tuple(CONTACT_FIELDS)) -> dict[str, Array]:
    """Return the contact fields in `names` that a step has, as scalars (n_points,) and vectors (n_points, dim) by name.

    Fields are zero outside the contact. At a point that belongs to several pairs, a scalar is the largest value that is not
    negative, and a vector is the one with the largest component.
    """
    fields = {}
    for name in names:
        columns = {pair: getattr(contact, name.removeprefix("contact_")) for pair, contact in step.contact.items()}
        if name in OPTIONAL_FIELDS and all(values is None for values in columns.values()):
            continue
        fields[name] = field = np.zeros(_shape(mesh, POINT_FIELDS[name]))
        for pair, values in columns.items():
            if values is not None:
                points = step.contact[pair].points
                larger = ~(_size(values) < _size(field[points]))
                field[points[larger]] = values[larger]
    return fields


def _size(values: Array) -> Array:
    """Return scalars (n,) unchanged, and for vectors (n, dim) the magnitude of their largest component."""
    return values if values.ndim == 1 else np.abs(values).max(axis=1)


def _shape(mesh: Mesh, width: int) -> tuple[int, ...]:
    """Return the shape of a nodal array whose point data have `width` components."""
    return mesh.n_points, *{1: (), 3: (mesh.dim,), 6: (4 if mesh.dim == 2 else 6,)}[width]


def step_shapes(mesh: Mesh) -> dict[str, tuple[int, ...]]:
    """Return the shape of each nodal array of a `StepResult`, by name."""
    return {name: _shape(mesh, width) for name, width in POINT_FIELDS.items() if name not in CONTACT_FIELDS}


def point_fields(mesh: Mesh, step: StepResult) -> dict[str, Array]:
    """Return the point data of a step by name, padded to the components of `POINT_FIELDS`."""
    values = {name: getattr(step, name) for name in step_shapes(mesh) if getattr(step, name) is not None}
    values |= contact_fields(mesh, step)
    return {name: pad_columns(values[name], width) for name, width in POINT_FIELDS.items() if name in values}


def point_flags(mesh: Mesh) -> dict[str, Flags]:
    """Return a flag (n_points,) for each group of points or facets, called ``group_<name>``, which is 1 in the group."""
    members = {}
    for name in mesh.group_names:
        if name in mesh.point_groups:
            members[name] = mesh.point_groups[name]
        elif blocks := list(mesh.cells_of(name, dim=mesh.dim - 1).values()):
            members[name] = np.concatenate([block.ravel() for block in blocks])
    return _flags(members, mesh.n_points)


def cell_fields(mesh: Mesh) -> dict[str, AnyArray]:
    """Return the number of the body of each solid cell, and a flag for each group of solids as in `point_flags`."""
    first = np.concatenate([np.empty(0, np.int32), *(block[:, 0] for block in mesh.solids.values())])
    starts = starts_of(mesh.solids)
    members = {}
    for group, numbers in mesh.cell_groups.items():
        rows = [starts[name] + rows for name, rows in mesh.split(numbers).items() if name in starts]
        if rows:
            members[group] = np.concatenate(rows)
    return {"body": topology.bodies(mesh)[1][first], **_flags(members, len(first))}


def _ascii(name: str) -> str:
    """Return a name in ASCII, which old viewers require, without slashes, which separate groups in HDF5."""
    letters = unicodedata.normalize("NFKD", name.replace("/", "_"))
    return "".join(c if c.isascii() else "_" for c in letters if not unicodedata.combining(c))


def _flags(members: dict[str, AnyArray], count: int) -> dict[str, Flags]:
    flags: dict[str, Flags] = {}
    for group, numbers in members.items():
        name = f"group_{_ascii(group)}"
        while name in flags:
            name += "_"
        flags[name] = np.zeros(count, np.int8)
        flags[name][numbers] = 1
    return flags


def check_step(mesh: Mesh, step: StepResult, cell_fields: Iterable[str]) -> None:
    """Raise FileError if an array of a step does not match the mesh, or a declared cell field is missing."""
    for name, shape in step_shapes(mesh).items():
        field = getattr(step, name)
        if field is None and name in OPTIONAL_FIELDS:
            continue
        if np.ma.isMaskedArray(field):
            raise FileError(f"step {step.index}: {name} is a masked array, which files cannot store: fill it first")
        actual_shape = np.shape(field)
        if actual_shape != shape:
            raise FileError(
                f"step {step.index}: {name} has shape {actual_shape}, but the mesh of the file needs {shape}"
            )
    for name, contact in step.contact.items():
        check_contact(f"step {step.index}, contact '{name}'", contact, mesh)
    count = sum(map(len, mesh.solids.values()))
    for name in cell_fields:
        actual_shape = np.shape(step.cell_fields.get(name, ()))
        if actual_shape != (count,):
            raise FileError(
                f"step {step.index}: the declared cell field '{name}' has shape {actual_shape}, but ({count},) is "
                "needed, a number for each solid cell"
            )


def check_contact(caption: str, contact: ContactResult, mesh: Mesh) -> None:
    """Raise FileError if arrays of a pair are inconsistent or do not fit the mesh; the message begins with `caption`."""
    row, row_of_primary = contact_row(mesh.dim, optional_columns(contact)), primary_row(mesh.dim)
    columns = [(name, len(contact.points), row[name]) for name in row.names or ()]
    columns.append(("primary_force_vectors", len(contact.primary_points), row_of_primary["force_vectors"]))
    for name, n_points, kind in columns:
        actual_shape, shape = np.shape(getattr(contact, name)), (n_points, *kind.shape)
        if actual_shape != shape:
            raise FileError(f"{caption}: {name} has shape {actual_shape}, but {shape} is needed")
    points = np.concatenate([contact.points, contact.primary_points])
    outside = points[(points < 0) | (points >= mesh.n_points)]
    if len(outside):
        raise FileError(f"{caption}: point {outside[0]} is not in the mesh of {mesh.n_points} points")
