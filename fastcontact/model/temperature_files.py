"""Temperatures of the nodes of a model, from files."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np

from fastcontact._tools.paths import PathLike
from fastcontact.arrays import Array, Indices
from fastcontact.errors import ModelError
from fastcontact.mesh.files.mesh_fields import at_points_of, read_file_field, row_of
from fastcontact.mesh.mesh import Mesh


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
