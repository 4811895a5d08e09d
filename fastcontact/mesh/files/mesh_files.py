"""Reading and writing of mesh files: MED and code_aster's text format directly, all other formats with meshio."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from fastcontact._tools.argument_types import typed
from fastcontact._tools.paths import PathLike, checked_target, existing_file, replacing
from fastcontact.errors import FileError
from fastcontact.mesh import topology
from fastcontact.mesh.files import aster_mail, med, meshio_files
from fastcontact.mesh.mesh import Mesh

logger = logging.getLogger("fastcontact")

# Suffix of code_aster's text format, which can only be read.
MAIL_SUFFIX = ".mail"


@dataclass(frozen=True)
class MeshReport:
    """Report on a mesh file: its format with the version, the name of the mesh, and the changes made while reading.

    `n_turned` is the number of inverted solid cells (clockwise in 2D) whose nodes were reordered. `dropped` contains the
    numbers of omitted cells: ``"vertex"`` for cells of one node, whose groups became groups of points, and ``"duplicate"``
    for cells that Gmsh repeats for each of their groups.
    """

    path: str
    format: str
    mesh_name: str = ""
    n_turned: int = 0
    dropped: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))

    def __str__(self) -> str:
        name = f", mesh '{self.mesh_name}'" if self.mesh_name else ""
        left_out = "".join(f", {count} {kind} cells left out" for kind, count in self.dropped.items())
        return f"{self.path} ({self.format}{name}): {self.n_turned} cells turned{left_out}"


@typed(FileError)
def read_mesh(path: PathLike, *, mesh_name: str | None = None, orient: bool = True) -> Mesh:
    """Read a mesh with its named groups.

    The suffix determines the format: MED (``.med``, ``.mmed``, ``.rmed``), code_aster's text (``.mail``), Gmsh of any
    version (``.msh``), Abaqus (``.inp``), VTK (``.vtk``, ``.vtu``), XDMF, Medit (``.mesh``) and all others of meshio.
    MED groups, Gmsh physical groups, Medit references and Abaqus sets are converted to groups of cells and points. A flat
    mesh with three coordinates is converted to a 2D mesh. Points without cells are kept. The number of reoriented cells
    is logged by the logger ``fastcontact`` at level INFO, and returned by `read_mesh_report`.

    Parameters
    ----------
    path : path-like
    mesh_name : str, optional
        Name of the mesh in a MED file with several meshes.
    orient : bool
        Whether inverted solid cells (clockwise in 2D) are reoriented; see `fastcontact.topology.oriented`.

    Returns
    -------
    Mesh

    Raises
    ------
    FileError
        If the file is missing, damaged, of an unknown format, or contains no mesh or several meshes.
    MeshError
        If the mesh has no cells or an unknown type of cells.

    Examples
    --------
    >>> mesh = read_mesh("blocks.med")                        # doctest: +SKIP
    """
    return read_mesh_report(path, mesh_name=mesh_name, orient=orient)[0]


def read_mesh_report(path: PathLike, *, mesh_name: str | None = None, orient: bool = True) -> tuple[Mesh, MeshReport]:
    """Return a mesh and a report on its file. Parameters and errors are those of `read_mesh`."""
    file = existing_file(path)
    if file.suffix.lower() in med.MED_SUFFIXES:
        content = med.read_med(file, mesh_name)
    elif mesh_name is not None:
        raise FileError(f"'{path}' is not a MED file, so its mesh has no name: omit mesh_name='{mesh_name}'")
    else:
        content = (aster_mail if file.suffix.lower() == MAIL_SUFFIX else meshio_files).read(file)
    mesh, n_turned = topology.oriented(content.mesh) if orient else (content.mesh, 0)
    left_out = MappingProxyType({kind: count for kind, count in content.omitted.items() if count})
    report = MeshReport(str(path), content.format, content.name, n_turned, left_out)
    logger.info("read %s", report)
    return mesh, report


@typed(FileError)
def write_mesh(path: PathLike, mesh: Mesh) -> None:
    """Write a mesh in the format of the suffix; the file appears only when it is complete.

    Formats differ in the groups that they can store:

    - ``.med``: all groups.
    - ``.vtk``, ``.vtu``, ``.xdmf``: all groups, as arrays of 0 and 1 named ``cell_group:...`` and
      ``point_group:...``.
    - ``.inp`` (Abaqus): all groups, as sets. Element types are those that meshio uses for each shape.
    - ``.msh`` (Gmsh 2.2): for each cell only the smallest group that contains it. Groups of mixed dimension keep the cells
      of the highest dimension. Empty groups and point groups with the name of a cell group are omitted. A warning states
      what is omitted.
    - other formats: no groups; a warning states their number.

    Parameters
    ----------
    path : path-like
    mesh : Mesh

    Raises
    ------
    FileError
        If the folder is missing, the format is unknown, or the format cannot store all cells or names.

    Warns
    -----
    FastcontactWarning
        If the format cannot store all groups.

    Examples
    --------
    >>> import fastcontact as fc
    >>> mesh = fc.generate.half_spheres("tri6", size=2.0)
    >>> fc.write_mesh("half-spheres.med", mesh)
    >>> fc.read_mesh("half-spheres.med").n_points == mesh.n_points
    True
    """
    target = checked_target(path)
    if target.suffix.lower() in med.MED_SUFFIXES:
        med.write_med_mesh(target, mesh)
        return
    with replacing(target) as temporary:
        meshio_files.write(target, temporary, mesh)
