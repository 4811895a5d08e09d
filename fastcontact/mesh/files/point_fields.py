"""Fields of numbers at points, from files of other programs and of fastcontact: MED, VTKHDF, and what meshio reads."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from fastcontact.arrays import AnyArray, Array, Indices
from fastcontact.errors import FileError, MeshError, unknown
from fastcontact.mesh.files import med, meshio_files
from fastcontact.mesh.files.hdf5 import check_size, opened, values
from fastcontact.mesh.files.paths import PathLike, existing_file
from fastcontact.mesh.mesh import Mesh

MED_SUFFIXES = (".med", ".rmed", ".mmed")
VTKHDF_SUFFIXES = (".vtkhdf", ".hdf")
# How far points of a file may lie from those of a mesh, relative to its size, and count as the same.
SAME_PLACE = 1e-6


class PointField(NamedTuple):
    """A field of one number at points.

    Attributes
    ----------
    times : ndarray (n_instants,) or None
        Of its instants [-]; None where the file has no times.
    values : ndarray (n_instants, n_points)
        NaN where there is none [unit of the field].
    points : ndarray (n_points, 2) or (n_points, 3), or None
        Where the file has them [length].
    """

    times: Array | None
    values: Array
    points: Array | None


def read_point_field(path: PathLike, name: str) -> PointField:
    """Read a field of one number at points.

    FileError if the file cannot be read, or has no such field, or one of several components.
    """
    file = Path(existing_file(path))
    suffix = file.suffix.lower()
    if suffix in MED_SUFFIXES:
        times, field = med.read_med_field(file, name)
        result = PointField(times, _one(path, name, field), med.read_field_points(file, name))
    elif suffix in VTKHDF_SUFFIXES:
        result = _vtkhdf(file, name)
    else:
        field, points = meshio_files.read_point_data(file, name)
        result = PointField(None, _one(path, name, field[None]), points)
    if not result.values.shape[0]:
        raise FileError(f"field '{name}' of '{path}' has no instant")
    return result


def _one(path: PathLike, name: str, field: AnyArray) -> Array:
    """Return a field (n_instants, n_points, ...) with one component as (n_instants, n_points)."""
    count = int(np.prod(field.shape[2:], dtype=np.int64))
    if field.ndim > 3 or count != 1:
        raise FileError(
            f"field '{name}' of '{path}' has {count} components: one with a single number a point is needed"
        )
    return np.asarray(field, np.float64).reshape(field.shape[:2])


def _vtkhdf(path: Path, name: str) -> PointField:
    """Read a field of an unstructured grid in the format of VTK in HDF5, at all its steps."""
    with opened(path) as file:
        if "VTKHDF" not in file or "Points" not in file["VTKHDF"] or "NumberOfPoints" not in file["VTKHDF"]:
            raise FileError(f"'{path}' holds no unstructured grid of VTK")
        grid = file["VTKHDF"]
        fields = grid.get("PointData", {})
        if name not in fields:
            raise FileError(f"'{path}': {unknown('field', name, list(fields))}")
        flat, points = values(fields, name), np.asarray(values(grid, "Points"), np.float64)
        if "Steps" not in grid:
            return PointField(None, _one(path, name, flat[None]), points)
        n_points, n_steps = len(points), int(grid["Steps"].attrs["NSteps"])
        times = np.asarray(values(grid["Steps"], "Values"), np.float64)[:n_steps]
        first = np.asarray(values(grid["Steps/PointDataOffsets"], name), np.int64)[:n_steps]
        if len(np.unique(values(grid, "NumberOfPoints"))) != 1 or int(values(grid, "NumberOfPoints")[0]) != n_points:
            raise FileError(f"'{path}' has a mesh that changes, or of several parts: write one mesh for all instants")
        check_size(f"field '{name}' of '{path}'", (n_steps, n_points), file)
        if len(first) and (first.min() < 0 or first.max() + n_points > len(flat)):
            raise FileError(f"field '{name}' of '{path}' has fewer numbers than its steps need: write it anew")
        parts = [flat[start : start + n_points] for start in first]
        return PointField(
            times, _one(path, name, np.array(parts).reshape(len(parts), n_points, *flat.shape[1:])), points
        )


def at_points_of(field: PointField, mesh: Mesh, wanted: Indices, name: str) -> Array:
    """Return the values (n_instants, n_points) of a field at the `wanted` (k,) points of a mesh, elsewhere NaN.

    A file with the points of the mesh, in its order, gives the value of each point itself, any other one that of the point
    at the same place.

    Raises
    ------
    MeshError
        If a point has no value, or two of different size; `name` names the field.
    """
    values = np.full((len(field.values), mesh.n_points), np.nan)
    rows = _rows(field, mesh, wanted, name)
    values[:, wanted] = field.values[:, rows]
    missing = wanted[~np.isfinite(values[:, wanted]).all(axis=0)]
    if len(missing):
        raise MeshError(
            f"{name} has no value at {len(missing)} points (first: point {missing[0]} {mesh.points[missing[0]]})"
        )
    return values


def _rows(field: PointField, mesh: Mesh, wanted: Indices, name: str) -> Indices:
    """Return the rows (k,) of a field for the wanted points."""
    from scipy.spatial import cKDTree

    n_points = field.values.shape[1]
    size = float(np.ptp(mesh.points, axis=0).max())
    if field.points is None:
        if n_points != mesh.n_points:
            raise MeshError(f"{name} has {n_points} points and no coordinates, the mesh has {mesh.n_points}")
        return wanted
    places = np.zeros((len(field.points), 3))
    places[:, : field.points.shape[1]] = field.points
    coordinates = np.zeros((mesh.n_points, 3))
    coordinates[:, : mesh.dim] = mesh.points
    if n_points == mesh.n_points and np.abs(places - coordinates).max(initial=0.0) <= SAME_PLACE * size:
        return wanted
    distance, rows = cKDTree(places).query(coordinates[wanted])
    off = np.flatnonzero(~(distance <= SAME_PLACE * size))
    if len(off):
        first = wanted[off[0]]
        raise MeshError(
            f"{name} has no point where {len(off)} points of the mesh are (first: point {first} {mesh.points[first]}, "
            f"{distance[off[0]]:.3g} from the next): write it on the nodes of this mesh"
        )
    _refuse_two(field, places, coordinates[wanted], SAME_PLACE * size, name)
    return np.asarray(rows, np.intp)


def _refuse_two(field: PointField, places: Array, wanted: Array, reach: float, name: str) -> None:
    """Raise MeshError where points of the file at one place have different values."""
    from scipy.spatial import cKDTree

    near = cKDTree(places).query_ball_point(wanted, reach)
    for point, members in zip(wanted, near, strict=True):
        if len(members) > 1 and np.ptp(field.values[:, members], axis=1).max() > 0.0:
            raise MeshError(
                f"{name} has {len(members)} different values at {point}, where bodies touch: write it on the nodes of this "
                "mesh, in their order"
            )
