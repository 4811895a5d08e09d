"""MED files, as Salome and code_aster read and write them: meshes with groups, and fields at nodes or cells.

Only h5py is needed. Arrays are stored component by component ("no interlace"), and node numbers start at 1. Meshes of MED 2.3
to 4.x are read. Files are written in version 3.0.0, which all later libraries read, or in 4.0.0, the first version with
18-node wedges.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact._tools.hdf5 import attribute, check_size, new_hdf5, open_hdf5, values
from fastcontact._tools.paths import PathLike, replacing
from fastcontact.arrays import AnyArray, Array, Indices, Numbers
from fastcontact.errors import FileError, MeshError, check_known, warn
from fastcontact.mesh import elements
from fastcontact.mesh.files.meshio_content import VERTEX, Block, FileContent, build_mesh, check_kinds
from fastcontact.mesh.mesh import Mesh

# Elements whose node order differs in MED: node k here is node NODE_ORDER[code][k] of MED. MED numbers the base of a solid as
# seen from outside, fastcontact as seen from inside.
NODE_ORDER = {element.med: element.reversed for element in elements.ELEMENTS.values() if element.dim == 3}
# MED orders the face centres as bottom, the four sides in turn, top; fastcontact as -x, +x, -y, +y, bottom, top.
_FACES_OF_H27 = dict(zip(range(20, 26), (24, 22, 21, 23, 20, 25)))
NODE_ORDER["H27"] = tuple(_FACES_OF_H27.get(node, node) for node in NODE_ORDER["H27"])
# Sizes of the names of meshes and of components in MED files [bytes].
NAME_SIZE = 64
COMPONENT_SIZE = 16
NO_PROFILE = "MED_NO_PROFILE_INTERNAL"
NO_STEP = -1
FLOAT64 = 6  # code of the type of a field
AXES = ("X", "Y", "Z")
# Suffixes of MED files, including code_aster's for meshes and results.
MED_SUFFIXES = (".med", ".mmed", ".rmed")
# Sizes of the names of groups and of families [bytes].
GROUP_NAME_SIZE = 80
FAMILY_NAME_SIZE = 64
# Largest number of folder levels between a mesh and its families. MED has one, with separate folders for points and cells.
LEVELS = 2
Families = dict[int, tuple[str, ...]]


def read_med(path: PathLike, mesh_name: str | None = None) -> FileContent:
    """Read a mesh with its groups; the orientation of the cells is that of the file.

    If the file contains several meshes, `mesh_name` is read; if the mesh has several time steps, the first one is read.
    """
    with open_hdf5(path) as file:
        name = _mesh_to_read(file, path, mesh_name)
        try:
            mesh, omitted = _read_mesh(file, file["ENS_MAA"][name])
        except MeshError as error:
            raise MeshError(f"mesh '{name}' of '{path}': {error}") from None
        info = file.get("INFOS_GENERALES", file)
        version = [str(int(attribute(info, key))) for key in ("MAJ", "MIN", "REL") if key in info.attrs]
        return FileContent(mesh, omitted, f"MED {'.'.join(version)}".strip(), name)


def _mesh_to_read(file: Any, path: PathLike, mesh_name: str | None) -> str:
    """Return the name of the mesh to read. Raises FileError if there is no mesh, or several and no `mesh_name`."""
    names = list(file["ENS_MAA"]) if "ENS_MAA" in file else []
    if not names:
        raise FileError(f"'{path}' contains no MED mesh (no entry in ENS_MAA): name a MED file that has one")
    if mesh_name is not None:
        check_known("mesh", mesh_name, names, FileError, f"'{path}': ")
        return mesh_name
    if len(names) > 1:
        listed = ", ".join(f"'{name[:NAME_SIZE]}'" for name in names[:12]) + (", ..." if len(names) > 12 else "")
        raise FileError(f"'{path}' contains {len(names)} meshes ({listed}): choose one with mesh_name")
    return str(names[0])


def _read_mesh(file: Any, group: Any) -> tuple[Mesh, dict[str, int]]:
    """Return the mesh stored in an HDF5 group, and the numbers of omitted cells by kind."""
    if int(attribute(group, "TYP", 0)) != 0:
        raise MeshError("it is a structured grid: convert it to an unstructured mesh")
    step = _first_step(group)
    points = _read_points(step, group)
    name = group.name.rsplit("/", 1)[-1]
    folders = [folder for folder in (group.get("FAS"), file.get(f"FAS/{name}")) if folder is not None]
    families = {number: names for folder in folders for number, names in read_families(folder).items()}
    blocks = list(_read_blocks(step, families))
    point_groups: dict[str, Any] = dict.fromkeys(_group_names(families, +1), ())
    point_groups.update(_members(step["NOE"], len(points), families))
    for block in blocks:
        if len(block.nodes) and (block.nodes.min() < 0 or block.nodes.max() >= len(points)):
            raise MeshError(f"a cell refers to node {block.nodes.max() + 1}, but nodes go from 1 to {len(points)}")
    return build_mesh(points, blocks, point_groups, _group_names(families, -1))


def _group_names(families: Families, sign: int) -> list[str]:
    """Return the groups of all families of points (+1) or cells (-1), including empty ones."""
    return [name for number in sorted(families, key=abs) if number * sign > 0 for name in families[number]]


def _first_step(group: Any) -> Any:
    """Return the HDF5 group with points and cells: the mesh itself in MED 2, its first time step in later versions."""
    if "NOE" in group:
        return group
    steps = [entry for entry in group.values() if "NOE" in entry]
    if not steps:
        raise MeshError("it has no nodes: check that the file is complete")
    return min(steps, key=_order)


def _order(step: Any) -> tuple[int, int]:
    """Return the numbers of a time step and of its iteration, by which steps are sorted."""
    return int(attribute(step, "NDT")), int(attribute(step, "NOR"))


def _read_points(step: Any, mesh: Any) -> Array:
    """Return the node coordinates (n_points, dim) [length]. Raises MeshError unless they are Cartesian and complete."""
    flat = values(step["NOE"], "COO")
    dataset = step["NOE"]["COO"]
    system = int(attribute(mesh if "REP" in mesh.attrs else dataset, "REP", 0))
    if system != 0:
        kind = {1: "cylindrical", 2: "spherical"}.get(system, f"of kind {system}")
        raise MeshError(f"its coordinates are {kind}: convert them to Cartesian ones")
    count = int(attribute(dataset, "NBR"))
    dim = len(flat) // max(count, 1)
    if count == 0 or dim * count != len(flat):
        raise MeshError(f"it has {len(flat)} coordinates for {count} nodes: check that the file is complete")
    if dim == 1:
        raise MeshError("its points have one coordinate: two or three are needed")
    return np.asarray(flat, np.float64).reshape(dim, count).T


def _read_blocks(step: Any, families: Families) -> Iterator[Block]:
    """Yield the cells of each type with their groups."""
    # MED 2 stores faces and edges in separate folders (FAC, ARE), and later versions store all cells in the folder MAI.
    folders = [step[name] for name in ("MAI", "FAC", "ARE") if name in step]
    entries = [entry for folder in folders for entry in folder.items()]
    unknown = {code: _cell_count(entry) for code, entry in entries if code not in elements.BY_MED and code != "PO1"}
    check_kinds(unknown, elements.BY_MED)
    for code, entry in entries:
        if "NOD" not in entry:
            raise MeshError(f"its {code} cells have no nodal connectivity: write the mesh with nodal connectivity")
        nodes = _read_nodes(entry, code)
        kind = VERTEX if code == "PO1" else elements.BY_MED[code].name
        yield Block(kind, nodes, _members(entry, len(nodes), families))


def _members(entry: Any, count: int, families: Families) -> dict[str, Indices]:
    """Return the rows of each group among `count` cells or nodes of an HDF5 group."""
    if "FAM" not in entry:
        return {}
    numbers = values(entry, "FAM")
    if numbers.shape != (count,):
        raise MeshError(f"it has {numbers.size} family numbers for {count} cells or nodes: write the file again")
    return family_members(numbers, families)


def _cell_count(entry: Any) -> int:
    """Return the number of cells of a type, also of types that are not supported."""
    index = entry.get("INN")
    if index is not None:
        return max(len(index) - 1, 0)
    return int(attribute(entry["NOD"], "NBR", 0)) if "NOD" in entry else 0


def _read_nodes(entry: Any, code: str) -> AnyArray:
    """Return the connectivity (n_cells, n_nodes) of the cells of a type, in the node order of this package."""
    flat = values(entry, "NOD")
    size = 1 if code == "PO1" else elements.BY_MED[code].n_nodes
    if len(flat) % size:
        raise MeshError(f"its {code} cells have {len(flat)} node numbers, which is not a multiple of {size}")
    nodes = flat.reshape(size, -1).T - 1
    return nodes[:, NODE_ORDER[code]] if code in NODE_ORDER else nodes


def write_med_mesh(path: PathLike, mesh: Mesh, *, mesh_name: str = "mesh") -> None:
    """Write a mesh with all its groups; the file appears only when it is complete.

    The element types may be in another order when the file is read. The name of the mesh may have up to 64 bytes, and those
    of groups up to 80. Raises FileError if a name is not admissible or the file cannot be written.
    """
    with new_file(path, mesh) as file:
        add_mesh(file, mesh, mesh_name)


@contextmanager
def new_file(path: PathLike, mesh: Mesh) -> Iterator[Any]:
    """Open a new MED file, which appears at `path` when it is complete; `mesh` determines the version."""
    version = 4 if "wedge18" in mesh.cells else 3
    with replacing(path) as temporary, _tracking_order(version >= 4), new_hdf5(temporary) as file:
        _set(file.create_group("INFOS_GENERALES"), MAJ=version, MIN=0, REL=0)
        yield file


@contextmanager
def _tracking_order(enabled: bool) -> Iterator[None]:
    """Make new HDF5 groups track the order of their members if `enabled`; the MED library requires it in version 4."""
    import h5py

    settings = h5py.get_config()
    previous, settings.track_order = settings.track_order, enabled
    try:
        yield
    finally:
        settings.track_order = previous


def _set(group: Any, **attributes: Any) -> None:
    """Set attributes with the types of the MED library: 32-bit integers, doubles, strings of fixed length."""
    for name, value in attributes.items():
        if isinstance(value, int):
            value = np.int32(value)
        group.attrs[name] = np.bytes_(value) if isinstance(value, (str, bytes)) else value


def _fixed_width(names: Iterable[str]) -> str:
    """Return names that are padded with blanks to COMPONENT_SIZE characters and joined."""
    return "".join(f"{name:<{COMPONENT_SIZE}}" for name in names)


def add_mesh(file: Any, mesh: Mesh, mesh_name: str) -> None:
    """Write a mesh with its groups into an open file."""
    checked_name("mesh", mesh_name, NAME_SIZE)
    if "/" in mesh_name:
        raise FileError(f"mesh name '{mesh_name}' contains a slash, which separates folders in a MED file: rename it")
    group = file.create_group(f"ENS_MAA/{mesh_name}")
    _set(group, DIM=max((elements.get(name).dim for name in mesh.cells), default=mesh.dim), ESP=mesh.dim)
    _set(group, REP=0, SRT=0, TYP=0, NXT=NO_STEP, NXI=NO_STEP, UNT="", DES="fastcontact")
    _set(group, NOM=_fixed_width(AXES[: mesh.dim]), UNI=_fixed_width([""] * mesh.dim))
    step = group.create_group(_step_key(NO_STEP, NO_STEP))
    _set(step, CGT=1, NDT=NO_STEP, NOR=NO_STEP, PDT=-1.0, NXT=NO_STEP, NXI=NO_STEP, PVT=NO_STEP, PVI=NO_STEP)
    folder = file.create_group(f"FAS/{mesh_name}")
    _set(folder.create_group("FAMILLE_ZERO"), NUM=0)
    _write_points(step, mesh, folder)
    _write_cells(step, mesh, folder)


def _write_points(step: Any, mesh: Mesh, folder: Any) -> None:
    """Write the points of a mesh and the families of its point groups."""
    numbers, families = families_of(mesh.point_groups, mesh.n_points, +1)
    points = step.create_group("NOE")
    _set(points, CGT=1, CGS=1, PFL=NO_PROFILE)
    _write_array(points, "COO", mesh.points.T, mesh.n_points)
    _write_array(points, "FAM", numbers, mesh.n_points)
    if families:
        write_families(folder.create_group("NOEUD"), families)


def _write_cells(step: Any, mesh: Mesh, folder: Any) -> None:
    """Write the cells of a mesh and the families of its cell groups."""
    numbers, families = families_of(mesh.cell_groups, mesh.n_cells, -1)
    cells = step.create_group("MAI")
    _set(cells, CGT=1)
    for name, start in mesh.offsets.items():
        element, block = elements.get(name), mesh.cells[name]
        entry = cells.create_group(element.med)
        _set(entry, CGT=1, CGS=1, GEO=100 * element.dim + element.n_nodes, PFL=NO_PROFILE)
        if element.med in NODE_ORDER:
            block = block[:, np.argsort(NODE_ORDER[element.med])]
        _write_array(entry, "NOD", block.T + np.int32(1), len(block))
        _write_array(entry, "FAM", numbers[start : start + len(block)], len(block))
    if families:
        write_families(folder.create_group("ELEME"), families)


def _write_array(group: Any, name: str, array: AnyArray, count: int) -> None:
    """Write an array in flat form, with the number of its entities."""
    dataset = group.create_dataset(name, data=np.ascontiguousarray(array).ravel())
    _set(dataset, CGT=1, NBR=count)


def _step_key(number: int, iteration: int) -> str:
    """Return the name of the HDF5 group of a time step."""
    return f"{number:020d}{iteration:020d}"


def add_field(
    file: Any, name: str, components: tuple[str, ...], field: Array, instant: tuple[int, float], mesh_name: str
) -> None:
    """Add a nodal field (n_points, n_components) to an open file, at an instant given by its number and time."""
    number, time = instant
    path = f"CHA/{name}"
    if path not in file:
        _set(file.create_group(path), MAI=mesh_name, TYP=FLOAT64, NCO=len(components), UNT="")
        _set(file[path], NOM=_fixed_width(components), UNI=_fixed_width([""] * len(components)))
    group = file[path].create_group(_step_key(number, NO_STEP))
    _set(group, NDT=number, NOR=NO_STEP, PDT=float(time), RDT=NO_STEP, ROR=NO_STEP)
    support = group.create_group("NOE")
    _set(support, GAU="", PFL=NO_PROFILE)
    profile = support.create_group(NO_PROFILE)
    _set(profile, GAU="", NBR=len(field), NGA=1)
    profile.create_dataset("CO", data=np.asarray(field, np.float64).T.ravel())


@typed(FileError)
def read_med_field(path: PathLike, field: str) -> tuple[Array, Array]:
    """Read a nodal field at all its instants, from a file of MED 3 or later.

    Parameters
    ----------
    path : path-like
    field : str
        Name of the field, e.g. ``"DEPL"``.

    Returns
    -------
    times : ndarray (n_instants,)
        Times in the order of the step numbers [time, as in the file]; load factors [-] in files of fastcontact.
    values : ndarray (n_instants, n_points, n_components)
        NaN at points without a value; in the unit of the field, e.g. [length] for ``"DEPL"``.

    Raises
    ------
    FileError
        If the file cannot be read, has no such field, or the field is not given at nodes.

    Examples
    --------
    See `write_med_results`.

    >>> import fastcontact as fc
    >>> times, displacements = fc.read_med_field("blocks.med", "DEPL")  # doctest: +SKIP
    """
    return read_field(path, field, at_points=True)[:2]


def read_field(path: PathLike, field: str, at_points: bool) -> tuple[Array, Array, Array | None]:
    """Return a field at points or cells from a file of MED 3 or later: times, values and positions.

    Times (n_instants,) are in the order of the step numbers [time, as in the file]. Values (n_instants, n, n_components) are
    NaN where the field has none [unit of the field]. Positions (n, dim) are those of the points, or None if the mesh is in
    another file, or the means of the nodes of each cell [length]. Raises FileError if the file cannot be read, has no such
    field, or the field does not have one value per point or cell.
    """
    with open_hdf5(path) as file:
        check_known("field", field, list(file["CHA"]) if "CHA" in file else [], FileError, f"'{path}': ")
        group = file["CHA"][field]
        name = decoded(bytes(attribute(group, "MAI")))
        mesh = file.get(f"ENS_MAA/{name}")
        if mesh is None and not at_points:
            raise FileError(f"field '{field}' of '{path}' is on the mesh '{name}', which is in another file")
        instants = sorted((e for e in group.values() if "PDT" in e.attrs and _supports(e, at_points)), key=_order)
        if not instants:
            kind = "nodes" if at_points else "cells"
            raise FileError(f"field '{field}' of '{path}' has no values at {kind} in the layout of MED 3 or 4")
        step = None if mesh is None else _first_step(mesh)
        points, width = None if mesh is None else _read_points(step, mesh), int(attribute(group, "NCO"))
        fields, positions = [], []  # type: list[Array], list[Array]
        for support in sorted({support for entry in instants for support in _supports(entry, at_points)}):
            if points is None:
                n_values = max(values(p, "CO").size // width for e in instants for p in e[support].values())
            else:
                positions.append(points if at_points else _cell_centres(path, field, step, points, support))
                n_values = len(positions[-1])
            check_size(f"field '{field}' of '{path}'", (len(instants), n_values, width), file)
            fields.append(np.stack([_read_instant(file, entry.get(support), n_values, width) for entry in instants]))
        times = np.array([attribute(entry, "PDT") for entry in instants], np.float64)
        return times, np.concatenate(fields, axis=1), np.concatenate(positions) if positions else None


def _supports(entry: Any, at_points: bool) -> list[str]:
    """Return the names of the HDF5 groups with values of a field at the nodes, or at the cells of each element type."""
    return [key for key in entry if (key == "NOE" if at_points else key.startswith("MAI."))]


def _cell_centres(path: PathLike, field: str, step: Any, points: Array, support: str) -> Array:
    """Return the means (n_cells, dim) of the nodes of the cells of an element type with values of a field [length]."""
    code = support.removeprefix("MAI.")
    if code not in elements.BY_MED or code not in step.get("MAI", {}):
        raise FileError(f"field '{field}' of '{path}' is on {code} cells, which its mesh does not have")
    nodes = _read_nodes(step["MAI"][code], code)
    if len(nodes) and (nodes.min() < 0 or nodes.max() >= len(points)):
        raise FileError(f"a cell of '{path}' refers to a missing point: write the file again")
    return np.asarray(points[nodes].mean(axis=1))


def _read_instant(file: Any, support: Any, n_values: int, n_components: int) -> Array:
    """Return a field (n_values, n_components) at an instant, NaN where it has no value."""
    field = np.full((n_values, n_components), np.nan)
    for name, profile in () if support is None else support.items():
        if (count := int(attribute(profile, "NGA", 1))) != 1:
            raise FileError(
                f"a field of '{file.filename}' has {count} values per cell, at integration points: one per cell is needed"
            )
        values_of_profile = values(profile, "CO").reshape(n_components, -1).T
        if name == NO_PROFILE:
            field[:] = values_of_profile
            continue
        rows = values(file["PROFILS"][name], "PFL").astype(np.int64) - 1
        if rows.min(initial=0) < 0 or rows.max(initial=0) >= n_values:
            raise FileError(f"profile '{name}' refers to point {rows.max() + 1} of {n_values}: write the file again")
        field[rows] = values_of_profile
    return field


def checked_name(kind: str, name: str, size: int) -> bytes:
    """Return a name encoded for MED. Raises FileError if it is empty, too long, or cannot be read back unchanged."""
    encoded = name.encode("utf-8")
    if not encoded or len(encoded) > size:
        raise FileError(f"{kind} name '{name}' has {len(encoded)} bytes, but MED allows 1 to {size}: rename it")
    if name.endswith(" ") or "\0" in name:
        fault = "ends with a blank or has a zero byte, which MED does not keep"
        raise FileError(f"{kind} name '{name}' {fault}: rename it")
    return encoded


def decoded(padded: bytes) -> str:
    """Return the name in a field of fixed size that is padded with blanks or zero bytes."""
    name = padded.split(b"\0")[0].rstrip(b" ")
    try:
        return name.decode("utf-8")
    except UnicodeDecodeError:
        return name.decode("latin-1")


def read_families(folder: Any, level: int = 0) -> Families:
    """Return the group names of each family number, from an HDF5 group and its subfolders."""
    families: Families = {}
    for entry in folder.values():
        if "NUM" in entry.attrs:
            families[int(attribute(entry, "NUM"))] = _group_names_of(entry)
        elif hasattr(entry, "values") and level < LEVELS:
            families.update(read_families(entry, level + 1))
    return families


def _group_names_of(family: Any) -> tuple[str, ...]:
    """Return the names of the groups of a family."""
    if "GRO" not in family:
        return ()
    groups = family["GRO"]
    padded_names = values(groups, "NOM").tobytes()
    # MED 2 stores one string for all names, later versions one row per name. The bytes differ only by a zero at the end.
    count = -(-len(padded_names) // GROUP_NAME_SIZE)
    if "NBR" in groups.attrs:
        count = min(count, int(attribute(groups, "NBR")))
    fields = (padded_names[i * GROUP_NAME_SIZE : (i + 1) * GROUP_NAME_SIZE] for i in range(count))
    return tuple(name for name in map(decoded, fields) if name)


def family_members(numbers: AnyArray, families: Families) -> dict[str, Indices]:
    """Return the rows of each group, from the family number of each row."""
    members_by_group: dict[str, list[Indices]] = {}
    order = np.argsort(np.abs(numbers), kind="stable")
    starts = np.flatnonzero(np.diff(numbers[order])) + 1
    for rows in np.split(order, starts) if len(numbers) else []:
        number = int(numbers[rows[0]])
        if number and number not in families:
            remark = f"family {number}, which the MED file does not describe: they are in no group"
            warn(f"{len(rows)} cells or points belong to {remark}")
        for name in families.get(number, ()):
            members_by_group.setdefault(name, []).append(rows)
    return {name: np.unique(np.concatenate(blocks)) for name, blocks in members_by_group.items()}


def families_of(groups: Mapping[str, AnyArray], count: int, sign: int) -> tuple[Numbers, Families]:
    """Return the family number of each of `count` cells or points, and the groups of each family.

    There is one family for each combination of groups that occurs, and one for all groups without members. With `sign` = +1
    for points and -1 for cells, the families have the numbers `sign`, 2 `sign`, ...; 0 means no group.
    """
    labels = np.zeros(count, np.intp)
    combinations: list[tuple[str, ...]] = [()]
    for name, rows in groups.items():
        # Only the labels of members change, so that the cost is proportional to the size of the groups, not of the mesh.
        old_labels, position = np.unique(labels[rows], return_inverse=True)
        labels[rows] = len(combinations) + position
        combinations += [(*combinations[label], name) for label in old_labels]
    used_labels, numbers = np.unique(np.append(labels, 0), return_inverse=True)
    families = {sign * number: combinations[label] for number, label in enumerate(used_labels.tolist()) if number}
    empty = tuple(name for name, rows in groups.items() if not len(rows))
    if empty:
        families[sign * len(used_labels)] = empty
    return (sign * numbers[:-1]).astype(np.int32), families


def write_families(folder: Any, families: Families) -> None:
    """Write the families into an HDF5 group."""
    for number, names in families.items():
        label = re.sub(r"[^A-Za-z0-9_]", "_", f"FAM_{number}_" + "_".join(names)).replace("FAM__", "FAM_-", 1)
        family = folder.create_group(label[:FAMILY_NAME_SIZE])
        family.attrs["NUM"] = np.int32(number)
        group = family.create_group("GRO")
        group.attrs["NBR"] = np.int32(len(names))
        rows = np.zeros((len(names), GROUP_NAME_SIZE), np.int8)
        for row, name in zip(rows, names, strict=True):
            encoded = checked_name("group", name, GROUP_NAME_SIZE)
            row[: len(encoded)] = np.frombuffer(encoded, np.int8)
        dataset = group.create_dataset("NOM", (len(names),), np.dtype((np.int8, (GROUP_NAME_SIZE,))))
        dataset[...] = rows
