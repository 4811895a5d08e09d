"""What stands where in a result file, in the words of VTK (three components, solids only) and in our own."""

from __future__ import annotations

import unicodedata
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastcontact.mesh import elements, topology
from fastcontact.mesh.mesh import Mesh
from fastcontact.results.step import StepResult

Array = NDArray[np.float64]
Flags = NDArray[np.int8]

# 1: until the restart state came in. 2: restart state of the last step, any number of run records.
SCHEMA = 2

# Point data by name, with the number of components that viewers expect; stress is a symmetric tensor.
POINT_FIELDS = {
    "displacement": 3,
    "stress": 6,
    "von_mises": 1,
    "von_mises_signed": 1,
    "reaction": 3,
    "contact_pressure": 1,
}

# Element codes of the XDMF format by VTK cell type. Its readers take the nodes of all of them in VTK's order.
XDMF_TYPES = {
    **{5: 0x4, 9: 0x5, 22: 0x24, 23: 0x25, 28: 0x23},  # triangles and quadrangles
    **{10: 0x6, 14: 0x7, 13: 0x8, 12: 0x9},  # tet4, pyramid5, wedge6, hex8
    **{24: 0x26, 27: 0x27, 26: 0x28, 32: 0x29, 25: 0x30, 29: 0x32},  # tet10, pyramid13, wedge15, wedge18, hex20, hex27
}

STEP_ROW = np.dtype([("index", "<i8"), ("load_factor", "<f8"), ("notes_first", "<i8"), ("notes_count", "<i8")])

# How a run ended: the steps that were complete then, and where its record stands among the notes.
RUN_ROW = np.dtype([("n_steps", "<i8"), ("first", "<i8"), ("count", "<i8")])


def restart_table(number: int) -> str:
    """Return the name of the table for the restart state of a step: two take turns, so that the last one stays whole."""
    return f"restart{number % 2}"


def contact_row(dim: int) -> np.dtype[Any]:
    """Return the type of one row of a contact table: one secondary node in one step."""
    scalars = [(name, "<f8") for name in ("abscissa", "gap", "pressure", "multiplier")]
    vectors = [(name, "<f8", (dim,)) for name in ("coordinates", "force_vectors", "normal", "shear")]
    return np.dtype([("points", "<i4"), ("active", "i1"), ("sticking", "i1"), *scalars, *vectors])


def contact_step(dim: int) -> np.dtype[Any]:
    """Return the type of the row that a contact pair has for each step: its rows, resultant, radius, work, obstacle."""
    sums = [("force", "<f8", (dim,)), ("radius", "<f8", (2,)), ("dissipation", "<f8")]
    sums.append(("obstacle_displacement", "<f8", (dim,)))  # NaN between bodies
    return np.dtype([("first", "<i8"), ("count", "<i8"), *sums])


@dataclass(frozen=True, eq=False)
class SolidCells:
    """The solid cells as VTK wants them.

    Attributes
    ----------
    connectivity : ndarray of int64 (n,)
        Point numbers of all cells, one after the other.
    offsets : ndarray of int64 (n_cells + 1,)
        Where each cell starts in `connectivity`, and its end.
    types : ndarray of uint8 (n_cells,)
        VTK cell types.
    """

    connectivity: NDArray[np.int64]
    offsets: NDArray[np.int64]
    types: NDArray[np.uint8]


def solid_cells(mesh: Mesh) -> SolidCells:
    """Return the solid cells of a mesh in the order of its elements."""
    blocks = mesh.solids
    sizes = [np.full(len(block), block.shape[1], np.int64) for block in blocks.values()]
    types = [np.full(len(block), elements.get(name).vtk, np.uint8) for name, block in blocks.items()]
    nodes = [block.ravel().astype(np.int64) for block in blocks.values()]
    return SolidCells(
        connectivity=np.concatenate([np.empty(0, np.int64), *nodes]),
        offsets=np.concatenate([[0], np.cumsum(np.concatenate([np.empty(0, np.int64), *sizes]))]).astype(np.int64),
        types=np.concatenate([np.empty(0, np.uint8), *types]),
    )


def xdmf_topology(mesh: Mesh) -> NDArray[np.int32] | None:
    """Return each solid cell's XDMF code and nodes in one sequence; None if XDMF lacks an element."""
    codes = [XDMF_TYPES.get(elements.get(name).vtk) for name in mesh.solids]
    known = [code for code in codes if code is not None]
    if not codes or len(known) < len(codes):
        return None
    blocks = [np.insert(block, 0, code, axis=1).ravel() for code, block in zip(known, mesh.solids.values())]
    return np.concatenate(blocks).astype(np.int32)


def padded(values: Array, width: int) -> Array:
    """Return `values` (n, k) with zero columns up to `width`; a width of 1 leaves a vector (n,) as it is."""
    values = np.asarray(values, np.float64)
    if width == 1 or values.shape[1] == width:
        return values
    return np.concatenate([values, np.zeros((len(values), width - values.shape[1]))], axis=1)


def contact_pressure(mesh: Mesh, step: StepResult) -> Array:
    """Return the contact pressure at every point (n_points,), 0 off the contact [pressure]."""
    pressure = np.zeros(mesh.n_points)
    for contact in step.contact.values():
        np.maximum.at(pressure, contact.points, contact.pressure)
    return pressure


def point_fields(mesh: Mesh, step: StepResult) -> dict[str, Array]:
    """Return the point data of a step by name, padded to the components of `POINT_FIELDS`."""
    values = {name: getattr(step, name) for name in POINT_FIELDS if name != "contact_pressure"}
    values["contact_pressure"] = contact_pressure(mesh, step)
    return {name: padded(values[name], width) for name, width in POINT_FIELDS.items()}


def point_flags(mesh: Mesh) -> dict[str, Flags]:
    """Return 1 inside and 0 outside for each group of points or facets, as ``group_<name>``."""
    members = {}
    for name in mesh.group_names:
        if name in mesh.point_groups:
            members[name] = mesh.point_groups[name]
        elif blocks := list(mesh.cells_of(name, dim=mesh.dim - 1).values()):
            members[name] = np.concatenate([block.ravel() for block in blocks])
    return _flags(members, mesh.n_points)


def cell_fields(mesh: Mesh) -> dict[str, NDArray[Any]]:
    """Return the body of each solid cell, and 1 inside and 0 outside for each group of solids."""
    first = np.concatenate([np.empty(0, np.int32), *(block[:, 0] for block in mesh.solids.values())])
    starts, total = {}, 0
    for name, block in mesh.solids.items():
        starts[name] = total
        total += len(block)
    members = {}
    for group, numbers in mesh.cell_groups.items():
        rows = [starts[name] + rows for name, rows in mesh.split(numbers).items() if name in starts]
        if rows:
            members[group] = np.concatenate(rows)
    return {"body": topology.bodies(mesh)[1][first], **_flags(members, total)}


def _plain(name: str) -> str:
    """Return an ASCII name, as old viewers want it, without slashes, which HDF5 takes for folders."""
    letters = unicodedata.normalize("NFKD", name.replace("/", "_"))
    return "".join(c if c.isascii() else "_" for c in letters if not unicodedata.combining(c))


def _flags(members: dict[str, NDArray[Any]], count: int) -> dict[str, Flags]:
    flags: dict[str, Flags] = {}
    for group, numbers in members.items():
        name = f"group_{_plain(group)}"
        while name in flags:
            name += "_"
        flags[name] = np.zeros(count, np.int8)
        flags[name][numbers] = 1
    return flags
