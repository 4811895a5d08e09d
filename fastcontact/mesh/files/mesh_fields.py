"""Fields of files as arrays over the points or cells of a mesh, such as constants of materials take."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fastcontact.arrays import Array, Numbers
from fastcontact.errors import FileError, MeshError, unknown
from fastcontact.mesh.argument_types import typed
from fastcontact.mesh.files.cell_fields import at_cells, read_cell_field
from fastcontact.mesh.files.paths import PathLike
from fastcontact.mesh.files.point_fields import at_points_of, read_point_field
from fastcontact.mesh.mesh import Mesh

OVER = ("cells", "points")
# How far a time of a file may lie from the one that is wanted, relative to the latest.
SAME_TIME = 1e-9


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

    It can serve as a constant of a material: ``fc.LinearElastic(E=fc.read_field(mesh, "scan.vtu", "E"), nu=0.3)``. Points and
    cells are matched by position, so that the file may contain others, in any order.

    Parameters
    ----------
    mesh : Mesh
    file : path-like
        MED, VTKHDF, ``.vtu``, ``.vtk`` or another format of meshio.
    field : str
        Its name in the file.
    over : {"cells", "points"}
        Where the values of the field are.
    groups : str or sequence of str, optional
        Groups of solid cells that the file has values for; all by default.
    instant : float, optional
        Which time of a file with several [-].

    Returns
    -------
    ndarray (n_cells, 1) or (n_points,)
        Of the solid cells of the groups, or of all points; where the groups have none, the mean [unit of the field].

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
    cells = _cells(mesh, groups)
    if over == "cells":
        by_cell = read_cell_field(file, field)
        middles = np.concatenate([mesh.points[block].mean(axis=1) for block in cells])
        size = float(np.ptp(mesh.points, axis=0).max())
        return at_cells(by_cell, middles, size, name)[_row(by_cell.times, by_cell.values, instant, name)][:, None]
    by_point = read_point_field(file, field)
    wanted = np.unique(np.concatenate([block.ravel() for block in cells])).astype(np.intp)
    values = at_points_of(by_point, mesh, wanted, name)[_row(by_point.times, by_point.values, instant, name)]
    return np.where(np.isfinite(values), values, values[wanted].mean())


def _cells(mesh: Mesh, groups: Sequence[str] | str | None) -> list[Numbers]:
    """Return the nodes of the solid cells of groups, by element in the order of the mesh."""
    if groups is None:
        return list(mesh.solids.values())
    names = [groups] if isinstance(groups, str) else list(groups)
    for name in names:
        if name not in mesh.cell_groups:
            raise MeshError(unknown("group of cells", name, list(mesh.cell_groups)))
    rows = mesh.split(np.unique(np.concatenate([mesh.cell_groups[name] for name in names])))
    blocks = [block[rows[name]] for name, block in mesh.solids.items() if name in rows]
    if not blocks:
        raise MeshError(f"the groups {', '.join(names)} hold no solid cells")
    return blocks


def _row(times: Array | None, values: Array, instant: float | None, name: str) -> int:
    """Return which instant of a field is wanted."""
    if instant is None:
        if len(values) != 1:
            raise FileError(f"{name} has {len(values)} instants: say which with instant")
        return 0
    if times is None:
        raise FileError(f"{name} has no times: leave out instant")
    row = int(np.abs(times - instant).argmin())
    if abs(times[row] - instant) > SAME_TIME * np.abs(times).max():
        raise FileError(f"{name} has no instant {instant:g}, the next is {times[row]:g}")
    return row
