"""Fields of files as arrays over the points or cells of a mesh, for example as material constants."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact._tools.hdf5 import check_size, opened, values
from fastcontact._tools.neighbours import nearest, pairs_within
from fastcontact._tools.paths import PathLike, existing_file
from fastcontact.arrays import AnyArray, Array, Indices, Numbers
from fastcontact.errors import FastcontactError, FileError, MeshError, ModelError, check_known, unknown
from fastcontact.mesh.files import med, meshio_files
from fastcontact.mesh.mesh import Mesh

# Tolerance of the positions of points in a file and in a mesh, relative to its size.
SAME_PLACE = 1e-6
OVER = ("cells", "points")
# Tolerance of the times of a file, relative to the latest.
SAME_TIME = 1e-9
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
        Whether the field is given on cells or at points.
    groups : str or sequence of str, optional
        Groups of solid cells for which the file has values; by default all.
    instant : float, optional
        Time at which to read a field with several instants [-].

    Returns
    -------
    ndarray (n_cells, 1) or (n_points,)
        Values [unit of the field] of the solid cells of the groups, or of all points; points outside the groups have
        the mean.

    Raises
    ------
    FileError, MeshError
        If the file cannot be read, or has no such field or instant; if a cell or point has no value, or two.

    Examples
    --------
    >>> import fastcontact as fc
    >>> E = fc.read_field(mesh, "scan.vtu", "E")  # doctest: +SKIP
    >>> model.add_material(fc.LinearElastic(E=E, nu=0.3))  # doctest: +SKIP
    """
    if over not in OVER:
        raise FileError(f"over must be {' or '.join(OVER)}, not '{over}'")
    name = f"field '{field}' of '{file}'"
    cells, of_file = _cells(mesh, groups), read_file_field(file, field, over)
    if instant is None and len(of_file.values) != 1:
        raise FileError(f"{name} has {len(of_file.values)} instants: select one with instant")
    row = 0 if instant is None else row_of(instant, of_file.times, name)
    if over == "cells":
        middles = np.concatenate([mesh.points[block].mean(axis=1) for block in cells])
        numbers = np.arange(len(middles))
        rows, _ = _nearest(of_file, middles, numbers, mesh, ("cell", "cells"), name)
        return _known(of_file.values[:, rows], middles, numbers, "cell", name)[row][:, None]
    wanted = np.unique(np.concatenate([block.ravel() for block in cells])).astype(np.intp)
    values = at_points_of(of_file, mesh, wanted, name)[row]
    return np.where(np.isfinite(values), values, values[wanted].mean())


def _cells(mesh: Mesh, groups: Sequence[str] | str | None) -> list[Numbers]:
    """Return the nodes of the solid cells of groups, by element type in the order of the mesh."""
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
    """Return the row of an instant among the `times` (n_instants,) of a field; raises `error` if there is none."""
    if times is None:
        raise error(f"{name} has no times: omit instant")
    row = int(np.abs(times - instant).argmin())
    if abs(times[row] - instant) > SAME_TIME * np.abs(times).max():
        among = f"the nearest is {times[row]:g}, of {times[0]:g} to {times[-1]:g}"
        raise error(f"{name} has no instant {instant:g}, {among}")
    return row


def at_points_of(field: FileField, mesh: Mesh, wanted: Indices, name: str) -> Array:
    """Return the values (n_instants, n_points) of a field at the `wanted` (k,) points of a mesh, elsewhere NaN.

    If the file has the points of the mesh in the same order, values are assigned by number, otherwise by position.

    Raises
    ------
    MeshError
        If a point has no value, or two of different size; `name` names the field.
    """
    rows = wanted
    if field.places is None and field.values.shape[1] != mesh.n_points:
        raise MeshError(f"{name} has {field.values.shape[1]} points and no coordinates, the mesh has {mesh.n_points}")
    if field.places is not None and not _same_points(field.places, mesh):
        rows, reach = _nearest(field, mesh.points[wanted], wanted, mesh, ("point", "nodes"), name)
        _refuse_two(field, mesh.points[wanted], reach, name)
    values = np.full((len(field.values), mesh.n_points), np.nan)
    values[:, wanted] = _known(field.values[:, rows], mesh.points[wanted], wanted, "point", name)
    return values


def _in_space(places: Array) -> Array:
    """Return positions (n, 2) or (n, 3) with three coordinates."""
    return np.pad(places, ((0, 0), (0, 3 - places.shape[1])))


def _same_points(places: Array, mesh: Mesh) -> bool:
    """Return whether the points of a file are those of a mesh in the same order."""
    if len(places) != mesh.n_points:
        return False
    off = np.abs(_in_space(places) - _in_space(mesh.points)).max(initial=0.0)
    return bool(off <= SAME_PLACE * np.ptp(mesh.points, axis=0).max())


def _nearest(
    field: FileField, places: Array, numbers: Indices, mesh: Mesh, nouns: tuple[str, str], name: str
) -> tuple[Indices, float]:
    """Return the rows (n,) of a field at positions (n, dim) of a mesh, and the tolerance of the distance [length].

    `numbers` (n,) are the numbers of the points or cells at the positions. In messages, `nouns` name these items, and those
    on which the field is to be written.
    """
    assert field.places is not None
    reach = SAME_PLACE * float(np.ptp(mesh.points, axis=0).max())
    distance, rows = nearest(_in_space(field.places), _in_space(places))
    off = np.flatnonzero(~(distance <= reach))
    if len(off):
        raise MeshError(
            f"{name} has no {nouns[0]} where {len(off)} {nouns[0]}s of the mesh are (first: {nouns[0]} {numbers[off[0]]} "
            f"{places[off[0]]}, {distance[off[0]]:.3g} from the nearest): write it on the {nouns[1]} of this mesh"
        )
    return rows, reach


def _known(values: Array, places: Array, numbers: Indices, noun: str, name: str) -> Array:
    """Return values (n_instants, n) at positions (n, dim); MeshError if one is missing."""
    missing = np.flatnonzero(~np.isfinite(values).all(axis=0))
    if len(missing):
        first = f"{noun} {numbers[missing[0]]} {places[missing[0]]}"
        raise MeshError(f"{name} has no value at {len(missing)} {noun}s (first: {first})")
    return values


def _refuse_two(field: FileField, wanted: Array, reach: float, name: str) -> None:
    """Raise MeshError if coincident points of the file have different values."""
    assert field.places is not None
    near, at = pairs_within(_in_space(field.places), _in_space(wanted), np.full(len(wanted), reach))
    ends = np.searchsorted(at, np.arange(len(wanted) + 1))
    for point, first, end in zip(wanted, ends[:-1], ends[1:], strict=True):
        members = near[first:end]
        if len(members) > 1 and np.ptp(field.values[:, members], axis=1).max() > 0.0:
            raise MeshError(
                f"{name} has {len(members)} different values at {_in_space(point[None])[0]}, where bodies touch: write it on "
                "the nodes of this mesh, in their order"
            )


class FileField(NamedTuple):
    """A scalar field at points or cells.

    Attributes
    ----------
    times : ndarray (n_instants,) or None
        Times of its instants [-]; None if the file has none.
    values : ndarray (n_instants, n)
        Values, NaN where there is none [unit of the field].
    places : ndarray (n, 2) or (n, 3), or None
        Coordinates of the points, or means of the nodes of the cells, if the file has them [length].
    """

    times: Array | None
    values: Array
    places: Array | None


def read_file_field(path: PathLike, name: str, over: str) -> FileField:
    """Read a scalar field `over` the ``"points"`` or ``"cells"`` of the file.

    Raises FileError if the file cannot be read, has no such field, or the field has several components.
    """
    file, at_points = Path(existing_file(path)), over == "points"
    suffix, times = file.suffix.lower(), None
    if suffix in med.MED_SUFFIXES:
        times, field, places = med.read_field(file, name, at_points)
    elif suffix in VTKHDF_SUFFIXES:
        times, field, places = _vtkhdf(file, name, at_points)
    else:
        field, places = meshio_files.read_data(file, name, at_points)
        field = field[None]
    count = int(np.prod(field.shape[2:], dtype=np.int64))
    if field.ndim > 3 or count != 1:
        single = f"a field with a single number per {over.removesuffix('s')} is needed"
        raise FileError(f"field '{name}' of '{path}' has {count} components: {single}")
    if not len(field):
        raise FileError(f"field '{name}' of '{path}' has no instant")
    return FileField(times, np.asarray(field, np.float64).reshape(field.shape[:2]), places)


def read_temperatures(
    mesh: Mesh, file: PathLike | Sequence[PathLike], field: str, wanted: Indices, instant: float | None
) -> tuple[Array, Array | None]:
    """Return a field (n_instants, n_points) at the `wanted` (k,) of int points, elsewhere NaN, and its times (n_instants,).

    Temperatures are in the unit of the file [temperature], times are load factors [-] or None.

    Raises
    ------
    FileError, MeshError, ModelError
        If a file cannot be read or lacks the field, a wanted point has no value, or there is no such instant.
    """
    files = [file] if isinstance(file, (str, os.PathLike)) else list(file)
    if not files:
        raise ModelError("no file is given for the temperature")
    fields, times = [], []
    for path in files:
        field_of_file = read_file_field(path, field, "points")
        values = at_points_of(field_of_file, mesh, wanted, f"field '{field}' of '{path}'")
        if len(files) > 1 and len(values) > 1:
            raise ModelError(
                f"'{path}' has {len(values)} instants: each of several files must have one, or give a single file"
            )
        fields.append(values)
        times.append(field_of_file.times)
    values, time = np.concatenate(fields), times[0] if len(files) == 1 else None
    if instant is None:
        return values, time
    row = row_of(instant, time, f"field '{field}' of '{files[0]}'", ModelError)
    return values[row : row + 1], None


def _vtkhdf(path: Path, name: str, at_points: bool) -> tuple[Array | None, AnyArray, Array]:
    """Read a field of an unstructured grid in VTKHDF: at the points of all steps, or at the cells of one."""
    needed = {"Points", "NumberOfPoints"} if at_points else {"Points", "Connectivity", "Offsets", "NumberOfCells"}
    with opened(path) as file:
        grid = file.get("VTKHDF", {})
        if not needed <= set(grid):
            raise FileError(f"'{path}' contains no unstructured grid of VTK")
        fields = grid.get("PointData" if at_points else "CellData", {})
        if name not in fields:
            raise FileError(f"'{path}': {unknown('field' if at_points else 'field of cells', name, list(fields))}")
        field, points = values(fields, name), np.asarray(values(grid, "Points"), np.float64)
        if not at_points:
            return None, field[None], _middles(path, name, grid, len(field), points)
        if "Steps" not in grid:
            return None, field[None], points
        n_points, n_steps = len(points), int(grid["Steps"].attrs["NSteps"])
        times = np.asarray(values(grid["Steps"], "Values"), np.float64)[:n_steps]
        first = np.asarray(values(grid["Steps/PointDataOffsets"], name), np.int64)[:n_steps]
        if len(np.unique(values(grid, "NumberOfPoints"))) != 1 or int(values(grid, "NumberOfPoints")[0]) != n_points:
            raise FileError(f"'{path}' has a mesh that changes or has several parts: write one mesh for all instants")
        check_size(f"field '{name}' of '{path}'", (n_steps, n_points), file)
        if len(first) and (first.min() < 0 or first.max() + n_points > len(field)):
            raise FileError(f"field '{name}' of '{path}' has fewer numbers than its steps need: write it anew")
        steps = np.array([field[start : start + n_points] for start in first])
        return times, steps.reshape(len(first), n_points, *field.shape[1:]), points


def _middles(path: Path, name: str, grid: Any, n_values: int, points: Array) -> Array:
    """Return the middles (n_cells, 3) of the cells of a grid of one part, for a field with a value per cell [length]."""
    nodes, starts = (np.asarray(values(grid, key), np.int64) for key in ("Connectivity", "Offsets"))
    counts = np.diff(starts)
    if len(values(grid, "NumberOfCells")) != 1 or n_values != len(counts):
        raise FileError(f"field '{name}' of '{path}' has several instants or parts: write the cells once")
    bad = not len(counts) or counts.min() < 1 or starts[0] != 0 or starts[-1] != len(nodes)
    if bad or nodes.min() < 0 or nodes.max() >= len(points):
        raise FileError(f"a cell of '{path}' refers to a missing point: write it anew")
    return np.asarray(np.add.reduceat(points[nodes], starts[:-1], axis=0) / counts[:, None])
