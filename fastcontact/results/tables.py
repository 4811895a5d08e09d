"""Results as tables: NumPy structured arrays with a row for each node, and CSV files of them."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastcontact.errors import CaseError, unknown
from fastcontact.mesh.files.paths import PathLike, replacing
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.topology import ordered_line
from fastcontact.results.step import ContactResult, StepResult

Table = NDArray[Any]
Columns = dict[str, NDArray[Any]]

AXES = ("x", "y", "z")
STRESS_COMPONENTS = ("xx", "yy", "zz", "xy", "yz", "xz")


def contact_table(contact: ContactResult, step: StepResult | None = None) -> Table:
    """Return the state of a contact pair, one row for each secondary node in order along the surface.

    Parameters
    ----------
    contact : ContactResult
    step : StepResult, optional
        The step the pair belongs to, for the fields at its nodes.

    Returns
    -------
    structured ndarray (m,)
        ``point``; ``x``, ``y`` (``z``), ``abscissa``, ``radius`` (distance from the axis), ``gap`` [length];
        ``pressure`` [pressure]; ``multiplier`` [force or pressure]; ``force_x`` ... [force]; ``shear_x`` ...
        [pressure]; ``active``, ``sticking`` (true or false). With `step` also ``displacement_x`` ... [length],
        ``stress_xx`` ..., ``von_mises``, ``von_mises_signed`` [pressure].
    """
    columns = {
        **_places(contact.points, contact.coordinates, contact.abscissa),
        "gap": contact.gap,
        "pressure": contact.pressure,
        "multiplier": contact.multiplier,
        **_by_axis("force_", contact.force_vectors),
        **_by_axis("shear_", contact.shear),
        "active": contact.active,
        "sticking": contact.sticking,
    }
    return _table(columns | (_fields(step, contact.points) if step is not None else {}))


def line_table(mesh: Mesh, step: StepResult, group: str, start: str | int | None = None) -> Table:
    """Return the fields along a line of nodes, one row a node, in order.

    Parameters
    ----------
    mesh : Mesh
    step : StepResult
    group : str
        A group of line cells that form one open line.
    start : str or int, optional
        The end to start from, as for ``topology.ordered_line``; by default the one nearest to x = 0.

    Returns
    -------
    structured ndarray (m,)
        ``point``; ``x``, ``y`` (``z``), ``abscissa``, ``radius``, ``displacement_x`` ... [length];
        ``stress_xx`` ..., ``von_mises``, ``von_mises_signed`` [pressure].

    Raises
    ------
    MeshError
        If there is no such group, or it is no open line.
    """
    line = ordered_line(mesh, group, start)
    return _table(_places(line.points, mesh.points[line.points], line.abscissa) | _fields(step, line.points))


def with_column(table: Table, name: str, values: NDArray[Any]) -> Table:
    """Return a table (m,) with one column more, `values` (m,) under `name`."""
    return _table({**_columns(table), name: values})


def write_csv(path: PathLike, table: Table, units: Mapping[str, str] | None = None) -> None:
    """Write a table as comma-separated values (RFC 4180) with one header line.

    Numbers are written with all their digits: whoever reads them gets the same bits.

    Parameters
    ----------
    path : path-like
        File to write, replaced if it exists.
    table : structured ndarray (m,)
    units : mapping of str to str, optional
        Units by column, which the header then shows in brackets.

    Raises
    ------
    CaseError
        If `units` names a column that is not there.
    FileError
        If the file cannot be written.
    """
    columns, units = _columns(table), dict(units or {})
    for name in units:
        if name not in columns:
            raise CaseError(unknown("column", name, columns))
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
        return text if text.strip("-0123456789") else text + ".0"  # so that it stays a float
    return str(value)


def _table(columns: Mapping[str, NDArray[Any]]) -> Table:
    """Return columns of equal length as one structured array."""
    table = np.empty(len(next(iter(columns.values()))), dtype=[(name, c.dtype) for name, c in columns.items()])
    for name, column in columns.items():
        table[name] = column
    return table


def _columns(table: Table) -> Columns:
    return {name: table[name] for name in table.dtype.names or ()}


def _by_axis(prefix: str, vectors: NDArray[Any]) -> Columns:
    return {f"{prefix}{axis}": vectors[:, i] for i, axis in enumerate(AXES[: vectors.shape[1]])}


def _places(points: NDArray[Any], coordinates: NDArray[Any], abscissa: NDArray[Any]) -> Columns:
    """Return where the nodes are; the radius is the distance from x = 0 in 2D, from the y axis in 3D."""
    flat = coordinates.shape[1] == 2
    radius = np.abs(coordinates[:, 0]) if flat else np.hypot.reduce(coordinates[:, ::2], axis=1)
    return {"point": points, **_by_axis("", coordinates), "abscissa": abscissa, "radius": radius}


def _fields(step: StepResult, points: NDArray[Any]) -> Columns:
    """Return displacement, stress and von Mises stress at some points."""
    stress = step.stress[points]
    return {
        **_by_axis("displacement_", step.displacement[points]),
        **{f"stress_{name}": stress[:, i] for i, name in enumerate(STRESS_COMPONENTS[: stress.shape[1]])},
        "von_mises": step.von_mises[points],
        "von_mises_signed": step.von_mises_signed[points],
    }
