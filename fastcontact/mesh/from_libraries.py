"""Conversion of meshes in memory from the libraries gmsh, meshio and PyVista, which are imported only when needed."""

from __future__ import annotations

import importlib
import tempfile
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from fastcontact.arrays import MASKED_ENTRIES, is_masked
from fastcontact.errors import FileError, MeshError, warn
from fastcontact.mesh import elements, topology
from fastcontact.mesh.files.mesh_files import read_mesh
from fastcontact.mesh.files.meshio_content import INCONSISTENCY_ERRORS, VERTEX, mesh_of
from fastcontact.mesh.files.meshio_process import CELL_PREFIX, POINT_PREFIX, TAGS, plain_mesh
from fastcontact.mesh.mesh import Mesh

# Prefix of the arrays of 0 and 1 that represent groups in result files.
RESULT_PREFIX = "group_"
# Options with which gmsh writes the open model: version 4.1 of the format, and only cells in physical groups if there are
# any such groups.
GMSH_OPTIONS = {"Mesh.MshFileVersion": 4.1, "Mesh.Binary": 1.0, "Mesh.SaveAll": 0.0, "Mesh.SaveParametric": 0.0}


def from_meshio(mesh: Any) -> Mesh:
    """Return a mesh of meshio, with its groups, as a `Mesh`.

    Groups are the cell and point sets of the mesh, the tags of Gmsh and Medit, and arrays of 0 and 1 with names that begin
    with ``cell_group:`` or ``point_group:``. Inverted cells are reoriented. A plane mesh with three coordinates is converted
    to two coordinates.

    Parameters
    ----------
    mesh : meshio.Mesh
        The mesh to convert.

    Returns
    -------
    Mesh

    Raises
    ------
    MeshError
        If the mesh has no cells or cells of an unknown type, or its arrays are inconsistent.

    Examples
    --------
    >>> import meshio
    >>> import fastcontact as fc
    >>> triangle = meshio.Mesh([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], {"triangle": [[0, 1, 2]]})
    >>> fc.from_meshio(triangle)
    Mesh(3 points, 1 tri3; groups: none)
    """
    if not all(hasattr(mesh, name) for name in ("points", "cells", "cell_data", "cell_sets", "field_data")):
        raise MeshError(f"from_meshio takes a meshio.Mesh, not {type(mesh).__name__}")
    sets = [mesh.cell_data, mesh.cell_sets, getattr(mesh, "point_data", {}), getattr(mesh, "point_sets", {})]
    if is_masked([mesh.points, *(block.data for block in mesh.cells), *sets]):
        raise MeshError(f"meshio's mesh {MASKED_ENTRIES}")
    # For files of Gmsh, meshio keeps the dimension with the names of tags, and a cell occurs once for each of its groups.
    file_format = "gmsh" if any(key.startswith("gmsh:") for key in mesh.cell_data) else ""
    return _mesh_of(plain_mesh(mesh), file_format, "meshio's mesh")


def from_pyvista(grid: Any) -> Mesh:
    """Return a data set of PyVista, with its groups, as a `Mesh`.

    Groups are the boolean arrays of the data set, and arrays of 0 and 1 with names that begin with ``cell_group:`` or
    ``point_group:`` (from mesh files) or with ``group_`` (from result files). Inverted cells are reoriented. A plane mesh
    with three coordinates is converted to two coordinates. Usually a data set contains no facets of its solid cells;
    `Mesh.with_facet_group` adds them.

    Parameters
    ----------
    grid : pyvista.UnstructuredGrid, or another data set that PyVista can cast to one

    Returns
    -------
    Mesh

    Raises
    ------
    MeshError
        If the data set has no cells, or cells of an unknown type.

    Examples
    --------
    >>> import pyvista  # doctest: +SKIP
    >>> mesh = fc.from_pyvista(pyvista.read("part.vtu"))  # doctest: +SKIP
    """
    if not hasattr(grid, "celltypes") and hasattr(grid, "cast_to_unstructured_grid"):
        grid = grid.cast_to_unstructured_grid()
    if not all(hasattr(grid, name) for name in ("points", "celltypes", "cells_dict", "cell_data", "point_data")):
        raise MeshError(f"from_pyvista takes a pyvista.UnstructuredGrid, not {type(grid).__name__}")
    types = np.asarray(grid.celltypes)
    kinds = {int(kind): np.flatnonzero(types == kind) for kind in dict.fromkeys(types.tolist())}
    known = {1: VERTEX} | {kind: element.meshio for kind, element in elements.BY_VTK.items()}
    names = {kind: known[kind] for kind in kinds if kind in known}
    if len(names) < len(kinds):
        unknown = ", ".join(f"{len(kinds[kind])} of VTK's type {kind}" for kind in kinds if kind not in names)
        raise MeshError(
            f"PyVista's data set has cells that fastcontact does not know ({unknown}): use {', '.join(elements.ELEMENTS)}"
        )
    content = {
        "points": np.asarray(grid.points, np.float64),
        "cells": [[names[kind], len(rows), np.asarray(grid.cells_dict[kind])] for kind, rows in kinds.items()],
        "cell_data": {k: [v[rows] for rows in kinds.values()] for k, v in _group_arrays(grid.cell_data, CELL_PREFIX).items()},
        "point_data": _group_arrays(grid.point_data, POINT_PREFIX),
        "cell_sets": {}, "point_sets": {}, "field_data": {},
    }  # fmt: skip
    return _mesh_of(content, "", "PyVista's data set")


def from_gmsh() -> Mesh:
    """Return the mesh of the model that is open in gmsh, with its physical groups, as a `Mesh`.

    If the model has physical groups, cells that belong to none of them are omitted, as in files of Gmsh. Inverted cells are
    reoriented. A plane mesh with three coordinates is converted to two coordinates.

    Returns
    -------
    Mesh

    Raises
    ------
    FileError
        If the package gmsh is not installed.
    MeshError
        If no model is open, or the model has no mesh or cells of an unknown type.

    Warns
    -----
    FastcontactWarning
        If solid cells are omitted; the message states their number.

    Examples
    --------
    >>> import gmsh  # doctest: +SKIP
    >>> gmsh.initialize()  # doctest: +SKIP
    >>> gmsh.open("part.geo")  # doctest: +SKIP
    >>> gmsh.model.mesh.generate(3)  # doctest: +SKIP
    >>> mesh = fc.from_gmsh()  # doctest: +SKIP
    """
    try:
        gmsh = importlib.import_module("gmsh")
    except (ImportError, OSError) as error:
        raise FileError(f"gmsh cannot be imported ({error}): pip install gmsh") from error
    if not gmsh.isInitialized():
        raise MeshError("no model is open in gmsh: call gmsh.initialize() and make one")
    dim = gmsh.model.getDimension()
    if dim < 0 or not any(map(len, gmsh.model.mesh.getElements(dim)[1])):
        raise MeshError("the model that is open in gmsh has no mesh: call gmsh.model.mesh.generate(2) or (3)")
    _warn_about_omissions(gmsh, dim)
    previous = {name: gmsh.option.getNumber(name) for name in GMSH_OPTIONS}
    try:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "model.msh"
            for name, value in GMSH_OPTIONS.items():
                gmsh.option.setNumber(name, value)
            gmsh.write(str(path))
            return read_mesh(path)
    finally:
        for name, value in previous.items():
            gmsh.option.setNumber(name, value)


def _warn_about_omissions(gmsh: Any, dim: int) -> None:
    """Warn of solid cells without a physical group, which gmsh omits if the model has physical groups."""
    if not gmsh.model.getPhysicalGroups():
        return
    groups_of = gmsh.model.getPhysicalGroupsForEntity
    ungrouped = [tag for _, tag in gmsh.model.getEntities(dim) if not len(groups_of(dim, tag))]
    count = sum(sum(map(len, gmsh.model.mesh.getElements(dim, tag)[1])) for tag in ungrouped)
    if count:
        kind = "volumes" if dim == 3 else "surfaces"
        warn(
            f"{count} solid cells belong to no physical group and are left out (those of the {kind} "
            f"{', '.join(map(str, ungrouped[:6]))}): give every body a group"
        )


def _group_arrays(data: Any, prefix: str) -> dict[str, Any]:
    """Return the arrays of PyVista that define groups, with the names that `mesh_of` expects."""
    groups = {}
    for name in data.keys():  # noqa: SIM118, the data of PyVista are not a mapping
        values = np.asarray(data[name])
        if name in TAGS or name.startswith(prefix):
            groups[name] = values
        elif values.ndim == 1 and values.dtype == bool:
            groups[prefix + quote(name)] = values
        elif name.startswith(RESULT_PREFIX) and values.ndim == 1 and np.isin(values, (0, 1)).all():
            groups[prefix + quote(name.removeprefix(RESULT_PREFIX))] = values
    return groups


def _mesh_of(content: dict[str, Any], file_format: str, library: str) -> Mesh:
    """Return the mesh with the given content, with inverted cells reoriented. Messages name the `library`."""
    try:
        mesh, _ = mesh_of(content, file_format)
    except MeshError as error:
        raise MeshError(f"{library}: {error}") from None
    except INCONSISTENCY_ERRORS as error:
        raise MeshError(f"the arrays of {library} do not fit together: {error}") from error
    return topology.oriented(mesh)[0]
