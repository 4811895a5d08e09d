"""Whether a step fits the mesh of a result file, before anything of it is written."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from fastcontact.errors import FileError
from fastcontact.mesh.mesh import Mesh
from fastcontact.results import _layout as layout
from fastcontact.results.step import ContactResult, StepResult


def check_shapes(mesh: Mesh, step: StepResult) -> None:
    n, dim = mesh.n_points, mesh.dim
    vector, scalar = (n, dim), (n,)
    expected = {
        "displacement": vector,
        "reaction": vector,
        "stress": (n, 4 if dim == 2 else 6),
        "von_mises": scalar,
        "von_mises_signed": scalar,
    }
    for name, shape in expected.items():
        found = np.shape(getattr(step, name))
        if found != shape:
            raise FileError(f"step {step.index}: {name} has shape {found}, but the mesh of the file needs {shape}")
    for name, contact in step.contact.items():
        check_contact(f"step {step.index}, contact '{name}'", contact, mesh)


def checked_fields(names: Iterable[str], mesh: Mesh) -> tuple[str, ...]:
    """Return names of cell fields that neither stand in a file already nor cannot be written."""
    found = tuple(names)
    for name in found:
        if name in layout.cell_fields(mesh) or not name.isidentifier():
            raise FileError(
                f"'{name}' cannot be the name of a cell field: it is taken or no plain word; choose another"
            )
    return found


def check_cell_fields(mesh: Mesh, step: StepResult, names: Iterable[str]) -> None:
    count = sum(map(len, mesh.solids.values()))
    for name in names:
        found = np.shape(step.cell_fields.get(name, ()))
        if found != (count,):
            raise FileError(
                f"step {step.index}: the cell field '{name}' that was announced has shape {found}, but ({count},) is "
                "needed, a number for each solid cell"
            )


def check_contact(where: str, contact: ContactResult, mesh: Mesh) -> None:
    """Refuse the state of a pair whose arrays do not fit one another or name points that are not in the mesh."""
    row = layout.contact_row(mesh.dim)
    for name in row.names or ():
        found, shape = np.shape(getattr(contact, name)), (len(contact.points), *row[name].shape)
        if found != shape:
            raise FileError(f"{where}: {name} has shape {found}, but {shape} is needed")
    outside = np.asarray(contact.points)[(contact.points < 0) | (contact.points >= mesh.n_points)]
    if len(outside):
        raise FileError(f"{where}: point {outside[0]} is not in the mesh of {mesh.n_points} points")
