"""Fields of one number at cells, from files of other programs: MED, VTKHDF, and what meshio reads."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from fastcontact.arrays import AnyArray, Array
from fastcontact.errors import FileError, MeshError, unknown
from fastcontact.mesh.files import med, meshio_files
from fastcontact.mesh.files.hdf5 import opened, values
from fastcontact.mesh.files.paths import PathLike, existing_file
from fastcontact.mesh.files.point_fields import MED_SUFFIXES, SAME_PLACE, VTKHDF_SUFFIXES


class CellField(NamedTuple):
    """A field of one number at cells.

    Attributes
    ----------
    times : ndarray (n_instants,) or None
        Of its instants [-]; None where the file has no times.
    values : ndarray (n_instants, n_cells)
        NaN where there is none [unit of the field].
    middles : ndarray (n_cells, 2) or (n_cells, 3)
        Means of the nodes of the cells [length].
    """

    times: Array | None
    values: Array
    middles: Array


def read_cell_field(path: PathLike, name: str) -> CellField:
    """Read a field of one number at cells.

    FileError if the file cannot be read, or has no such field, or one of several components.
    """
    file = Path(existing_file(path))
    suffix = file.suffix.lower()
    if suffix in MED_SUFFIXES:
        times, field, middles = med.read_med_cell_field(file, name)
        return CellField(times, _one(path, name, field), middles)
    if suffix in VTKHDF_SUFFIXES:
        field, middles = _vtkhdf(file, name)
    else:
        field, middles = meshio_files.read_cell_data(file, name)
    return CellField(None, _one(path, name, field[None]), middles)


def _one(path: PathLike, name: str, field: AnyArray) -> Array:
    """Return a field (n_instants, n_cells, ...) with one component as (n_instants, n_cells)."""
    count = int(np.prod(field.shape[2:], dtype=np.int64))
    if count != 1:
        raise FileError(f"field '{name}' of '{path}' has {count} components: one with a single number a cell is needed")
    return np.asarray(field, np.float64).reshape(field.shape[:2])


def _vtkhdf(path: Path, name: str) -> tuple[AnyArray, Array]:
    """Read a field at the cells of an unstructured grid in the format of VTK in HDF5, of one instant and one part."""
    with opened(path) as file:
        grid = file.get("VTKHDF", {})
        if not {"Points", "Connectivity", "Offsets", "NumberOfCells"} <= set(grid):
            raise FileError(f"'{path}' holds no unstructured grid of VTK")
        fields = grid.get("CellData", {})
        if name not in fields:
            raise FileError(f"'{path}': {unknown('field of cells', name, list(fields))}")
        field, points = values(fields, name), np.asarray(values(grid, "Points"), np.float64)
        nodes, starts = (np.asarray(values(grid, key), np.int64) for key in ("Connectivity", "Offsets"))
        counts = np.diff(starts)
        if len(values(grid, "NumberOfCells")) != 1 or len(field) != len(counts):
            raise FileError(f"field '{name}' of '{path}' has several instants or parts: write the cells once")
        bad = not len(counts) or counts.min() < 1 or starts[0] != 0 or starts[-1] != len(nodes)
        if bad or nodes.min() < 0 or nodes.max() >= len(points):
            raise FileError(f"a cell of '{path}' names a point that is not there: write it anew")
        return field, np.add.reduceat(points[nodes], starts[:-1], axis=0) / counts[:, None]


def at_cells(field: CellField, middles: Array, size: float, name: str) -> Array:
    """Return the values (n_instants, n_cells) of a field at cells of a mesh, by the places of their middles.

    Parameters
    ----------
    field : CellField
    middles : ndarray (n_cells, dim)
        Of the cells wanted [length].
    size : float
        Of the mesh [length].
    name : str
        Names the field, for messages.

    Raises
    ------
    MeshError
        If a cell has no value, or two of different size.
    """
    from scipy.spatial import cKDTree

    theirs, ours = (np.zeros((len(given), 3)) for given in (field.middles, middles))
    theirs[:, : field.middles.shape[1]], ours[:, : middles.shape[1]] = field.middles, middles
    distance, rows = cKDTree(theirs).query(ours)
    off = np.flatnonzero(~(distance <= SAME_PLACE * size))
    if len(off):
        raise MeshError(
            f"{name} has no cell where {len(off)} cells of the mesh are (first: {middles[off[0]]}, {distance[off[0]]:.3g} "
            "from the next): write it on the cells of this mesh"
        )
    values = field.values[:, rows]
    missing = np.flatnonzero(~np.isfinite(values).all(axis=0))
    if len(missing):
        raise MeshError(f"{name} has no value at {len(missing)} cells (first: at {middles[missing[0]]})")
    return values
