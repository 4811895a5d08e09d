"""Scalar fields at points or cells from MED files, VTKHDF files, and formats of meshio."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from fastcontact._tools.hdf5 import check_size, opened, values
from fastcontact._tools.paths import PathLike, existing_file
from fastcontact.arrays import AnyArray, Array
from fastcontact.errors import FileError, unknown
from fastcontact.mesh.files import med, meshio_files

MED_SUFFIXES = (".med", ".rmed", ".mmed")
VTKHDF_SUFFIXES = (".vtkhdf", ".hdf")


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
    if suffix in MED_SUFFIXES:
        times, field, places = med.read_point_field(file, name) if at_points else med.read_cell_field(file, name)
    elif suffix in VTKHDF_SUFFIXES:
        times, field, places = _vtkhdf(file, name, at_points)
    else:
        read = meshio_files.read_point_data if at_points else meshio_files.read_cell_data
        field, places = read(file, name)
        field = field[None]
    count = int(np.prod(field.shape[2:], dtype=np.int64))
    if field.ndim > 3 or count != 1:
        single = f"one with a single number a {over.removesuffix('s')} is needed"
        raise FileError(f"field '{name}' of '{path}' has {count} components: {single}")
    if not len(field):
        raise FileError(f"field '{name}' of '{path}' has no instant")
    return FileField(times, np.asarray(field, np.float64).reshape(field.shape[:2]), places)


def _vtkhdf(path: Path, name: str, at_points: bool) -> tuple[Array | None, AnyArray, Array]:
    """Read a field of an unstructured grid in VTKHDF: at the points of all steps, or at the cells of one."""
    needed = {"Points", "NumberOfPoints"} if at_points else {"Points", "Connectivity", "Offsets", "NumberOfCells"}
    with opened(path) as file:
        grid = file.get("VTKHDF", {})
        if not needed <= set(grid):
            raise FileError(f"'{path}' holds no unstructured grid of VTK")
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
            raise FileError(f"'{path}' has a mesh that changes, or of several parts: write one mesh for all instants")
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
        raise FileError(f"a cell of '{path}' names a point that is not there: write it anew")
    return np.asarray(np.add.reduceat(points[nodes], starts[:-1], axis=0) / counts[:, None])
