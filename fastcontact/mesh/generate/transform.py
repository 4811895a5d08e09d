"""Operations on meshes: mirror images, transformations, unions, merged points, renamed groups and reference points."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fastcontact._tools.argument_types import typed
from fastcontact._tools.grouping import grouped
from fastcontact._tools.neighbours import close_pairs
from fastcontact.arrays import AnyArray, Array, Mask
from fastcontact.errors import MeshError
from fastcontact.mesh import elements
from fastcontact.mesh.generate._check import number, one_of
from fastcontact.mesh.mesh import ROTATION, Mesh, starts_of

Groups = dict[str, AnyArray]
Names = Mapping[str, str | None] | Callable[[str], str | None]

_AXES = ("x", "y", "z")


@typed(MeshError)
def renamed(mesh: Mesh, names: Names) -> Mesh:
    """Return the mesh with its groups renamed.

    Parameters
    ----------
    mesh : Mesh
    names : mapping or callable
        New names by old names. Groups that are not keys of a mapping keep their names; the new name None removes a
        group. Groups with the same new name are united.

    Returns
    -------
    Mesh

    Examples
    --------
    >>> from fastcontact import generate
    >>> generate.renamed(generate.block(), {"TOP": "LID"}).group_names[:4]
    ['BLOCK', 'BOTTOM', 'RIGHT', 'LID']
    """

    def groups(old_groups: Mapping[str, AnyArray]) -> Groups:
        new_groups: Groups = {}
        for name, members in old_groups.items():
            target = names(name) if callable(names) else names.get(name, name)
            if target is not None:
                new_groups[target] = np.union1d(new_groups[target], members) if target in new_groups else members
        return new_groups

    return mesh.replace(cell_groups=groups(mesh.cell_groups), point_groups=groups(mesh.point_groups))


@typed(MeshError)
def mirrored(mesh: Mesh, axis: str, at: float = 0.0, rename: Names | None = None) -> Mesh:
    """Return the mirror image of a mesh, in which nodes are reordered to keep cells and facets positively oriented.

    Parameters
    ----------
    mesh : Mesh
    axis : {"x", "y", "z"}
        Axis normal to the mirror plane.
    at : float
        Coordinate of the mirror plane on this axis [length].
    rename : mapping or callable, optional
        New names of groups, as described for `renamed`.

    Returns
    -------
    Mesh

    Raises
    ------
    MeshError
        If the mesh has no such axis.

    Examples
    --------
    >>> from fastcontact import generate
    >>> whole = generate.mirrored(generate.block(), "x")
    >>> float(whole.points[:, 0].min())
    -1.0
    """
    column = _AXES.index(one_of("axis", axis, _AXES[: mesh.dim]))
    points = mesh.points.copy()
    points[:, column] = 2.0 * number("at", at) - points[:, column]
    cells = {name: block[:, elements.get(name).reversed] for name, block in mesh.cells.items()}
    image = mesh.replace(points=points, cells=cells)
    return image if rename is None else renamed(image, rename)


@typed(MeshError)
def transformed(mesh: Mesh, *, translate: ArrayLike | None = None, scale: float = 1.0, rotate: float = 0.0) -> Mesh:
    """Return the mesh scaled about the origin, then rotated about the origin (only in 2D), then translated.

    Parameters
    ----------
    mesh : Mesh
    translate : array_like (dim,), optional
        Translation vector; by default zero [length].
    scale : float
        Scale factor, greater than 0 [-].
    rotate : float
        Counter-clockwise angle of rotation [degrees].

    Returns
    -------
    Mesh

    Raises
    ------
    MeshError
        If a number is out of range, or a 3D mesh is to be rotated.

    Examples
    --------
    >>> from fastcontact import generate
    >>> moved = generate.transformed(generate.block(), translate=(1.0, 0.0), rotate=90.0)
    >>> moved.points.min(axis=0).round(12).tolist()
    [0.0, 0.0]
    """
    if not number("scale", scale) > 0.0:
        raise MeshError(f"scale = {scale:g} is out of range: it must be greater than 0 (use mirrored for a reflection)")
    points = mesh.points * scale
    if number("rotate", rotate) != 0.0:
        if mesh.dim != 2:
            raise MeshError("rotate turns 2D meshes only: in 3D, use mesh.replace(points=mesh.points @ R.T)")
        cosine, sine = np.cos(np.radians(rotate)), np.sin(np.radians(rotate))
        points = points @ np.array([[cosine, sine], [-sine, cosine]])
    if translate is not None:
        shift = np.asarray(translate, dtype=float)
        if shift.shape != (mesh.dim,):
            raise MeshError(f"translate must be {mesh.dim} numbers, not {translate!r}")
        points = points + shift
    return mesh.replace(points=points)


@typed(MeshError)
def union(*meshes: Mesh) -> Mesh:
    """Return the union of several meshes, in which no points are merged and groups of the same name are united.

    Raises
    ------
    MeshError
        If no mesh is given, or the dimensions of the meshes differ.

    Examples
    --------
    Two bodies in one mesh share no points, and their groups keep their names:

    >>> from fastcontact import generate
    >>> lower = generate.block(name="LOWER")
    >>> upper = generate.block(name="UPPER", origin=(0.0, 1.0))
    >>> generate.union(lower, upper).n_points
    50
    """
    if not meshes:
        raise MeshError("union needs at least one mesh")
    if len({mesh.dim for mesh in meshes}) > 1:
        raise MeshError(f"union needs meshes of one dimension, not {[mesh.dim for mesh in meshes]}")
    first_numbers = np.cumsum([0] + [mesh.n_points for mesh in meshes])[:-1]
    shifted = list(zip(meshes, first_numbers, strict=True))
    cells = _merge({name: block + shift for name, block in mesh.cells.items()} for mesh, shift in shifted)
    starts = starts_of(cells)
    numbers = [(mesh, _renumbering(mesh, starts)) for mesh in meshes]
    cell_groups = ({name: new[members] for name, members in mesh.cell_groups.items()} for mesh, new in numbers)
    point_groups = ({name: members + n for name, members in mesh.point_groups.items()} for mesh, n in shifted)
    return Mesh(np.concatenate([mesh.points for mesh in meshes]), cells, _merge(cell_groups), _merge(point_groups))


def _merge(groups_of_meshes: Iterable[Groups]) -> Groups:
    """Return the concatenated arrays of several meshes by name."""
    by_name = grouped(entry for groups in groups_of_meshes for entry in groups.items())
    return {name: np.concatenate(arrays) for name, arrays in by_name.items()}


def _renumbering(mesh: Mesh, starts: dict[str, int]) -> AnyArray:
    """Return the number of each cell of `mesh` in the union, and advance `starts` by the numbers of its cells, in place."""
    numbers = [np.empty(0, np.int64)]
    for name, block in mesh.cells.items():
        numbers.append(starts[name] + np.arange(len(block)))
        starts[name] += len(block)
    return np.concatenate(numbers)


@typed(MeshError)
def merge_points(mesh: Mesh, tolerance: float) -> Mesh:
    """Return the mesh in which points at a distance of at most `tolerance` are merged.

    Points of different bodies that touch are merged as well. A chain of points, each close to the next, becomes a single
    point at the position of the one with the lowest number.

    Parameters
    ----------
    mesh : Mesh
    tolerance : float
        Largest distance of points that are merged, at least 0 [length].

    Returns
    -------
    Mesh

    Raises
    ------
    MeshError
        If two nodes of one cell would be merged, because the tolerance exceeds the length of an edge.

    Examples
    --------
    >>> from fastcontact import generate
    >>> first = generate.block(name="A")
    >>> second = generate.block(name="B", origin=(1.0, 0.0))
    >>> generate.merge_points(generate.union(first, second), 1e-9).n_points
    45
    """
    if not number("tolerance", tolerance) >= 0.0:
        raise MeshError(f"tolerance = {tolerance:g} is out of range: it must be at least 0")
    pairs = close_pairs(mesh.points, tolerance)
    if not len(pairs):
        return mesh
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(mesh.n_points,) * 2)
    _, cluster = connected_components(links, directed=False)
    _, first = np.unique(cluster, return_index=True)
    unique = np.sort(first)
    target = np.searchsorted(unique, first)[cluster]
    cells = {name: target[block] for name, block in mesh.cells.items()}
    for name, block in cells.items():
        nodes = np.sort(block, axis=1)
        collapsed = np.flatnonzero((nodes[:, 1:] == nodes[:, :-1]).any(axis=1))
        if len(collapsed):
            raise MeshError(
                f"tolerance = {tolerance:g} merges two nodes of cell {mesh.offsets[name] + collapsed[0]} ({name}): "
                "it must be smaller than the shortest edge"
            )
    point_groups = {name: target[members] for name, members in mesh.point_groups.items()}
    return mesh.replace(points=mesh.points[unique], cells=cells, point_groups=point_groups)


def with_points_at(mesh: Mesh, positions: Mapping[str, Sequence[float]]) -> Mesh:
    """Return the mesh with point groups that contain the point nearest to each of the `positions` [length], by name."""
    nearest = {name: [int(((mesh.points - np.asarray(x)) ** 2).sum(axis=1).argmin())] for name, x in positions.items()}
    return mesh.with_groups(points=nearest)


def with_cells_inside(mesh: Mesh, name: str, group: str, inside: Callable[[Array], Mask]) -> Mesh:
    """Return the mesh with a cell group called `name`, which contains the cells of `group` whose nodes all lie in a region.

    The function `inside` (n,) of positions (n, dim) [length] returns whether they are in the region.
    """
    in_region, rows_of = inside(mesh.points), mesh.split(mesh.cell_groups[group])
    rows_inside = {kind: rows[in_region[mesh.cells[kind][rows]].all(axis=1)] for kind, rows in rows_of.items()}
    return mesh.with_groups(cells={name: np.concatenate([mesh.offsets[k] + rows_inside[k] for k in rows_inside])})


@typed(MeshError)
def with_reference_points(mesh: Mesh, places: Mapping[str, ArrayLike]) -> Mesh:
    """Return the mesh with additional reference points, to which `Model.add_coupling` couples groups.

    Parameters
    ----------
    mesh : Mesh
    places : mapping of str to array_like (dim,)
        Position of each reference point by name [length].

    Returns
    -------
    Mesh
        For each reference point the mesh has two groups with a single point each. The group ``"<name>"`` is the reference
        point. The displacement of the point of ``"<name> rotation"`` is the rotation vector [radian]; in 2D its first
        component is the angle.

    Raises
    ------
    MeshError
        If a group with one of these names exists, or a position has a wrong dimension or is not finite.

    Examples
    --------
    >>> from fastcontact.mesh.generate import block
    >>> mesh = with_reference_points(block(), {"HANDLE": (0.5, 3.0)})
    >>> mesh.points[mesh.point("HANDLE")].tolist()
    [0.5, 3.0]
    """
    points = [mesh.points]
    groups: dict[str, list[int]] = {}
    for name, coordinates in places.items():
        position = np.asarray(coordinates, float)
        if position.shape != (mesh.dim,) or not np.isfinite(position).all():
            raise MeshError(f"the place {coordinates!r} of reference point '{name}' must be {mesh.dim} numbers")
        for group in (name, name + ROTATION):
            if group in mesh.group_names:
                raise MeshError(f"there is already a group '{group}': give the reference point another name")
            groups[group] = [mesh.n_points + len(groups)]
            points.append(position[None])
    return mesh.replace(points=np.concatenate(points), point_groups={**mesh.point_groups, **groups})
