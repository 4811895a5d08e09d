"""Fields that are read from files as arrays over the points or cells of a mesh, for example as material constants."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact._tools.hdf5 import check_size, open_hdf5, values
from fastcontact._tools.neighbours import nearest, pairs_within
from fastcontact._tools.paths import PathLike, existing_file
from fastcontact.arrays import AnyArray, Array, Indices, Numbers
from fastcontact.errors import FastcontactError, FileError, MeshError, ModelError, check_known, unknown
from fastcontact.mesh.files import med, meshio_files
from fastcontact.mesh.mesh import Mesh

# Largest distance of coincident points of a file and of a mesh, relative to the size of the mesh.
LENGTH_TOLERANCE = 1e-6
ENTITIES = ("cells", "points")
# Largest difference of equal times, relative to the latest time of a file.
TIME_TOLERANCE = 1e-9
VTKHDF_SUFFIXES = (".vtkhdf", ".hdf")


@typed(FileError)
def read_field(
    mesh: Mesh,
    file: PathLike,
    field: str,
    *,
    over: str = "cells",
    groups: Sequence[str] | str | None = None,
    instant: float | None = None,
) -> Array:
    """Return a field of a file as an array over the cells or points of a mesh.

    The array can be a material constant: ``fc.LinearElastic(E=fc.read_field(mesh, "scan.vtu", "E"), nu=0.3)``. Points
    and cells are matched by position, so that the file may contain other points and cells, in any order.

    Parameters
    ----------
    mesh : Mesh
    file : path-like
        MED, VTKHDF, ``.vtu``, ``.vtk`` or another format of meshio.
    field : str
        Name of the field in the file.
    over : {"cells", "points"}
        Whether the field of the file has values for cells or for points.
    groups : str or sequence of str, optional
        Groups of solid cells for which the file has values; by default all.
    instant : float, optional
        Time of the values if the field has several instants [-].

    Returns
    -------
    ndarray (n_cells, 1) or (n_points,)
        Values of the solid cells of the groups, or of all points. Points outside the groups have the mean of the others
        [unit of the field].

    Raises
    ------
    FileError, MeshError
        If the file cannot be read, or has no such field or instant; if a cell or point has no value, or two different
        values.

    Examples
    --------
    >>> import fastcontact as fc
    >>> E = fc.read_field(mesh, "scan.vtu", "E")  # doctest: +SKIP
    >>> model.add_material(fc.LinearElastic(E=E, nu=0.3))  # doctest: +SKIP
    """
    if over not in ENTITIES:
        raise FileError(f"over must be {' or '.join(ENTITIES)}, not '{over}'")
    name = f"field '{field}' of '{file}'"
    cells, file_field = _cells(mesh, groups), read_file_field(file, field, over)
    if instant is None and len(file_field.values) != 1:
        raise FileError(f"{name} has {len(file_field.values)} instants: select one with instant")
    row = 0 if instant is None else row_of(instant, file_field.times, name)
    if over == "cells":
        centres = np.concatenate([mesh.points[block].mean(axis=1) for block in cells])
        numbers = np.arange(len(centres))
        rows, _ = _nearest_rows(file_field, centres, numbers, mesh, ("cell", "cells"), name)
        return _check_complete(file_field.values[:, rows], centres, numbers, "cell", name)[row][:, None]
    points = np.unique(np.concatenate([block.ravel() for block in cells])).astype(np.intp)
    values = nodal_values(file_field, mesh, points, name)[row]
    return np.where(np.isfinite(values), values, values[points].mean())


def _cells(mesh: Mesh, groups: Sequence[str] | str | None) -> list[Numbers]:
    """Return the solid cells (n_cells, n_nodes) of groups for each element type, in the order of the mesh."""
    if groups is None:
        return list(mesh.solids.values())
    names = [groups] if isinstance(groups, str) else list(groups)
    for name in names:
        check_known("group of cells", name, list(mesh.cell_groups), MeshError)
    rows = mesh.split(np.unique(np.concatenate([mesh.cell_groups[name] for name in names])))
    blocks = [block[rows[name]] for name, block in mesh.solids.items() if name in rows]
    if not blocks:
        raise MeshError(f"the groups {', '.join(names)} contain no solid cells")
    return blocks


def row_of(instant: float, times: Array | None, name: str, error: type[FastcontactError] = FileError) -> int:
    """Return the index of an instant in the `times` (n_instants,) of a field. Raises `error` if there is no such instant."""
    if times is None:
        raise error(f"{name} has no times: omit instant")
    row = int(np.abs(times - instant).argmin())
    if abs(times[row] - instant) > TIME_TOLERANCE * np.abs(times).max():
        available = f"the nearest is {times[row]:g}, of {times[0]:g} to {times[-1]:g}"
        raise error(f"{name} has no instant {instant:g}, {available}")
    return row


def nodal_values(field: FileField, mesh: Mesh, points: Indices, name: str) -> Array:
    """Return the values (n_instants, n_points) of a field at the given points (k,) of a mesh, with NaN at other points.

    If the file has the points of the mesh in the same order, values are assigned by number, otherwise by position.

    Raises
    ------
    MeshError
        If a point has no value, or two different values. The message contains the `name` of the field.
    """
    rows = points
    if field.positions is None and field.values.shape[1] != mesh.n_points:
        raise MeshError(f"{name} has {field.values.shape[1]} points and no coordinates, the mesh has {mesh.n_points}")
    if field.positions is not None and not _same_points(field.positions, mesh):
        rows, tolerance = _nearest_rows(field, mesh.points[points], points, mesh, ("point", "nodes"), name)
        _check_unique(field, mesh.points[points], tolerance, name)
    values = np.full((len(field.values), mesh.n_points), np.nan)
    values[:, points] = _check_complete(field.values[:, rows], mesh.points[points], points, "point", name)
    return values


def _in_3d(positions: Array) -> Array:
    """Return positions (n, 2) or (n, 3) as an array (n, 3), with z = 0 in 2D."""
    return np.pad(positions, ((0, 0), (0, 3 - positions.shape[1])))


def _same_points(positions: Array, mesh: Mesh) -> bool:
    """Return whether the points of a file are those of a mesh in the same order."""
    if len(positions) != mesh.n_points:
        return False
    difference = np.abs(_in_3d(positions) - _in_3d(mesh.points)).max(initial=0.0)
    return bool(difference <= LENGTH_TOLERANCE * np.ptp(mesh.points, axis=0).max())


def _nearest_rows(
    field: FileField, positions: Array, numbers: Indices, mesh: Mesh, nouns: tuple[str, str], name: str
) -> tuple[Indices, float]:
    """Return the rows (n,) of a field at positions (n, dim) in a mesh, and the tolerance of the distance [length].

    `numbers` (n,) are the numbers of the points or cells at these positions. The two `nouns` appear in messages: the
    name of such an item, and the name of the items on which the field should be written.
    """
    assert field.positions is not None
    tolerance = LENGTH_TOLERANCE * float(np.ptp(mesh.points, axis=0).max())
    distance, rows = nearest(_in_3d(field.positions), _in_3d(positions))
    far = np.flatnonzero(~(distance <= tolerance))
    if len(far):
        raise MeshError(
            f"{name} has no {nouns[0]} where {len(far)} {nouns[0]}s of the mesh are (first: {nouns[0]} {numbers[far[0]]} "
            f"{positions[far[0]]}, {distance[far[0]]:.3g} from the nearest): write it on the {nouns[1]} of this mesh"
        )
    return rows, tolerance


def _check_complete(values: Array, positions: Array, numbers: Indices, noun: str, name: str) -> Array:
    """Return `values` (n_instants, n) at positions (n, dim) unchanged. Raises MeshError if a value is missing."""
    missing = np.flatnonzero(~np.isfinite(values).all(axis=0))
    if len(missing):
        first = f"{noun} {numbers[missing[0]]} {positions[missing[0]]}"
        raise MeshError(f"{name} has no value at {len(missing)} {noun}s (first: {first})")
    return values


def _check_unique(field: FileField, positions: Array, tolerance: float, name: str) -> None:
    """Raise MeshError if the file has different values at coincident points at one of the positions (n, dim)."""
    assert field.positions is not None
    row, index = pairs_within(_in_3d(field.positions), _in_3d(positions), np.full(len(positions), tolerance))
    ends = np.searchsorted(index, np.arange(len(positions) + 1))
    for point, first, end in zip(positions, ends[:-1], ends[1:], strict=True):
        rows = row[first:end]
        if len(rows) > 1 and np.ptp(field.values[:, rows], axis=1).max() > 0.0:
            raise MeshError(
                f"{name} has {len(rows)} different values at {_in_3d(point[None])[0]}, where bodies touch: write it on "
                "the nodes of this mesh, in their order"
            )


class FileField(NamedTuple):
    """A scalar field at points or cells.

    Attributes
    ----------
    times : ndarray (n_instants,) or None
        Times of the instants [-]; None if the file has no times.
    values : ndarray (n_instants, n)
        Values, and NaN where the field has no value [unit of the field].
    positions : ndarray (n, 2) or (n, 3), or None
        Coordinates of the points, or means of the nodes of the cells [length]; None if the file has no coordinates.
    """

    times: Array | None
    values: Array
    positions: Array | None


def read_file_field(path: PathLike, name: str, over: str) -> FileField:
    """Read a scalar field `over` the ``"points"`` or ``"cells"`` of the file.

    Raises FileError if the file cannot be read, has no such field, or the field has several components.
    """
    file, at_points = Path(existing_file(path)), over == "points"
    suffix, times = file.suffix.lower(), None
    if suffix in med.MED_SUFFIXES:
        times, field, positions = med.read_field(file, name, at_points)
    elif suffix in VTKHDF_SUFFIXES:
        times, field, positions = _read_vtkhdf(file, name, at_points)
    else:
        field, positions = meshio_files.read_data(file, name, at_points)
        field = field[None]
    count = int(np.prod(field.shape[2:], dtype=np.int64))
    if field.ndim > 3 or count != 1:
        single = f"a field with a single number per {over.removesuffix('s')} is needed"
        raise FileError(f"field '{name}' of '{path}' has {count} components: {single}")
    if not len(field):
        raise FileError(f"field '{name}' of '{path}' has no instants")
    return FileField(times, np.asarray(field, np.float64).reshape(field.shape[:2]), positions)


def read_temperatures(
    mesh: Mesh, file: PathLike | Sequence[PathLike], field: str, points: Indices, instant: float | None
) -> tuple[Array, Array | None]:
    """Return temperatures (n_instants, n_points) at the given points (k,), with NaN at other points, and their times.

    Temperatures are in the unit of the file [temperature]. Times (n_instants,) are load factors [-]; they are None if the
    file has no times, if several files are given, or with an `instant`.

    Raises
    ------
    FileError, MeshError, ModelError
        If a file cannot be read or lacks the field, one of the points has no value, or there is no such instant.
    """
    files = [file] if isinstance(file, (str, os.PathLike)) else list(file)
    if not files:
        raise ModelError("no file is given for the temperature")
    fields, times = [], []
    for path in files:
        file_field = read_file_field(path, field, "points")
        values = nodal_values(file_field, mesh, points, f"field '{field}' of '{path}'")
        if len(files) > 1 and len(values) > 1:
            raise ModelError(
                f"'{path}' has {len(values)} instants: each of several files must have one, or give a single file"
            )
        fields.append(values)
        times.append(file_field.times)
    values, time = np.concatenate(fields), times[0] if len(files) == 1 else None
    if instant is None:
        return values, time
    row = row_of(instant, time, f"field '{field}' of '{files[0]}'", ModelError)
    return values[row : row + 1], None


def _read_vtkhdf(path: Path, name: str, at_points: bool) -> tuple[Array | None, AnyArray, Array]:
    """Return the times, the values and the positions of a field of an unstructured grid in VTKHDF.

    Fields at points are read at all steps, fields of cells only from files without steps.
    """
    required = {"Points", "NumberOfPoints"} if at_points else {"Points", "Connectivity", "Offsets", "NumberOfCells"}
    with open_hdf5(path) as file:
        grid = file.get("VTKHDF", {})
        if not required <= set(grid):
            raise FileError(f"'{path}' contains no unstructured grid of VTK")
        fields = grid.get("PointData" if at_points else "CellData", {})
        if name not in fields:
            raise FileError(f"'{path}': {unknown('field' if at_points else 'field of cells', name, list(fields))}")
        field, points = values(fields, name), np.asarray(values(grid, "Points"), np.float64)
        if not at_points:
            return None, field[None], _cell_centres(path, name, grid, len(field), points)
        if "Steps" not in grid:
            return None, field[None], points
        n_points, n_steps = len(points), int(grid["Steps"].attrs["NSteps"])
        times = np.asarray(values(grid["Steps"], "Values"), np.float64)[:n_steps]
        starts = np.asarray(values(grid["Steps/PointDataOffsets"], name), np.int64)[:n_steps]
        if len(np.unique(values(grid, "NumberOfPoints"))) != 1 or int(values(grid, "NumberOfPoints")[0]) != n_points:
            raise FileError(f"'{path}' has a mesh that changes or has several parts: write one mesh for all instants")
        check_size(f"field '{name}' of '{path}'", (n_steps, n_points), file)
        if len(starts) and (starts.min() < 0 or starts.max() + n_points > len(field)):
            raise FileError(f"field '{name}' of '{path}' has fewer numbers than its steps need: write the file again")
        steps = np.array([field[start : start + n_points] for start in starts])
        return times, steps.reshape(len(starts), n_points, *field.shape[1:]), points


def _cell_centres(path: Path, name: str, grid: Any, n_values: int, points: Array) -> Array:
    """Return the means (n_cells, 3) of the nodes of the cells of a grid of one part [length].

    Raises FileError if field `name` does not have one value for each cell.
    """
    nodes, starts = (np.asarray(values(grid, key), np.int64) for key in ("Connectivity", "Offsets"))
    counts = np.diff(starts)
    if len(values(grid, "NumberOfCells")) != 1 or n_values != len(counts):
        raise FileError(f"field '{name}' of '{path}' has several instants or parts: write the cells once")
    damaged = not len(counts) or counts.min() < 1 or starts[0] != 0 or starts[-1] != len(nodes)
    if damaged or nodes.min() < 0 or nodes.max() >= len(points):
        raise FileError(f"a cell of '{path}' refers to a missing point: write the file again")
    return np.asarray(np.add.reduceat(points[nodes], starts[:-1], axis=0) / counts[:, None])
