"""Results as tables: NumPy structured arrays with a row for each node, and CSV files of them."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastcontact.errors import CaseError, FileError, unknown
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
        "point": contact.points,
        **_by_axis("", contact.coordinates),
        "abscissa": contact.abscissa,
        "radius": _radius(contact.coordinates),
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
    coordinates = mesh.points[line.points]
    columns = {
        "point": line.points,
        **_by_axis("", coordinates),
        "abscissa": line.abscissa,
        "radius": _radius(coordinates),
    }
    return _table(columns | _fields(step, line.points))


def with_column(table: Table, name: str, values: NDArray[Any]) -> Table:
    """Return a table (m,) with one column more, `values` (m,) under `name`."""
    return _table({**_columns(table), name: values})


def write_csv(path: PathLike, table: Table, units: Mapping[str, str] | None = None) -> None:
    """Write a table as comma-separated values (RFC 4180) with one header line.

    Numbers are written so that `read_csv` returns the same bits.

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


def read_csv(path: PathLike) -> tuple[Table, dict[str, str]]:
    """Read a table (m,) that `write_csv` wrote, and the units of the columns that have one.

    Columns are int64, float64, bool or str, whichever fits their values.

    Raises
    ------
    FileError
        If the file cannot be read, is empty, two columns have one name or one has none, or a line has another number of
        values than the header.
    """
    try:
        with open(Path(path), encoding="utf-8", newline="") as file:
            lines = [line for line in csv.reader(file) if line]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise FileError(f"'{path}' cannot be read ({error}): name a CSV file in UTF-8") from error
    if not lines:
        raise FileError(f"'{path}' is empty: a CSV file starts with the names of its columns")
    header, rows = lines[0], lines[1:]
    for number, row in enumerate(rows, start=2):
        if len(row) != len(header):
            raise FileError(f"'{path}': line {number} has {len(row)} values, but the header names {len(header)}")
    columns, units = {}, {}
    for position, title in enumerate(header):
        named = re.fullmatch(r"(.*) \[(.*)\]", title, flags=re.DOTALL)
        name = named[1] if named else title
        if not name or name in columns:
            raise FileError(f"'{path}': column {position + 1} has {f'the name {name!r} again' if name else 'no name'}")
        if named:
            units[name] = named[2]
        texts = [row[position] for row in rows]
        columns[name] = _values(texts)
    return _table(columns), units


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        text = f"{value:.17g}"
        return text if text.strip("-0123456789") else text + ".0"  # so that it stays a float
    return str(value)


def _values(texts: list[str]) -> NDArray[Any]:
    """Return the values of a column as the narrowest of bool, int64, float64, str that holds them all."""
    if texts and set(texts) <= {"true", "false"}:
        return np.array([text == "true" for text in texts])
    for kind in (np.int64, np.float64):
        try:
            return np.array([kind(text) for text in texts], dtype=kind if texts else np.float64)
        except (ValueError, OverflowError):
            continue
    return np.array(texts, dtype=np.str_)


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


def _radius(coordinates: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the distance from the axis: of x = 0 in 2D, of the y axis in 3D [length]."""
    return np.hypot.reduce(coordinates[:, ::2], axis=1) if coordinates.shape[1] == 3 else np.abs(coordinates[:, 0])


def _fields(step: StepResult, points: NDArray[Any]) -> Columns:
    """Return displacement, stress and von Mises stress at some points."""
    stress = step.stress[points]
    return {
        **_by_axis("displacement_", step.displacement[points]),
        **{f"stress_{name}": stress[:, i] for i, name in enumerate(STRESS_COMPONENTS[: stress.shape[1]])},
        "von_mises": step.von_mises[points],
        "von_mises_signed": step.von_mises_signed[points],
    }
