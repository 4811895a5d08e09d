"""Immutable meshes of points, cells by element type, and named groups."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Mapping, Sized
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fastcontact._tools.argument_types import typed
from fastcontact._tools.html_table import html_table
from fastcontact.arrays import AnyArray, Array, Indices, Mask
from fastcontact.errors import MeshError, NameSuggestions, unknown
from fastcontact.mesh import elements

# Suffixes of the names of groups that belong to another group: the facets on the other side of a cut along the group, and
# the point whose displacement is the rotation of a reference point.
OPPOSITE = " opposite"
ROTATION = " rotation"


def _read_only(values: ArrayLike, dtype: Any) -> AnyArray:
    """Return `values` as a read-only array. They are copied unless they are already such an array."""
    read_only = isinstance(values, np.ndarray) and values.base is None and not values.flags.writeable
    array = np.array(values, dtype=dtype, order="C", copy=None if read_only else True)
    array.setflags(write=False)
    return array


def _numbers(name: str, values: ArrayLike) -> AnyArray:
    """Return `values` as an array. Raises MeshError if they are not whole numbers that 32-bit integers can represent."""
    array = np.asarray(values)
    if array.size == 0:
        return array.astype(np.int32)
    if array.dtype.kind not in "iuf" or (array.dtype.kind == "f" and not np.array_equal(array, np.floor(array))):
        raise MeshError(f"{name} must be whole numbers, counted from 0, not {array.dtype} values")
    if array.min() < -(2**31) or array.max() >= 2**31:
        raise MeshError(
            f"{name} contain the number {max(array.flat, key=abs)}: the largest possible number is 2147483647"
        )
    return array


def starts_of(blocks: Mapping[str, Sized]) -> dict[str, int]:
    """Return the number of the first cell of each block by name. Cells are numbered consecutively over all blocks."""
    return dict(zip(blocks, np.cumsum([0, *map(len, blocks.values())]).tolist(), strict=False))


@typed(MeshError)
@dataclass(frozen=True, eq=False)
class Mesh(NameSuggestions):
    """Points, cells and named groups.

    A mesh contains solid cells, and facets (lines in 2D) that form groups on the boundary. Cells are numbered from 0,
    consecutively over all element types in the order of `cells`; a cell group is a sorted array of these numbers.
    Points are numbered from 0.

    Parameters
    ----------
    points : array_like (n_points, dim)
        Reference coordinates [length].
    cells : mapping of str to array_like (n_cells, n_nodes)
        Point numbers of the nodes of each cell, by element type, such as ``"tri3"`` or ``"line2"``.
    cell_groups : mapping of str to array_like (n,)
        Cell numbers of each named group of cells.
    point_groups : mapping of str to array_like (n,)
        Point numbers of each named group of points.

    Raises
    ------
    MeshError
        If an array has the wrong shape, a number is not finite, or an index is out of range.

    Examples
    --------
    >>> mesh = Mesh([[0, 0], [1, 0], [0, 1]], {"tri3": [[0, 1, 2]]}, point_groups={"origin": [0]})
    >>> mesh.n_points, mesh.dim
    (3, 2)
    """

    points: Array
    cells: Mapping[str, AnyArray]
    cell_groups: Mapping[str, AnyArray] = field(default_factory=dict)
    point_groups: Mapping[str, AnyArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        points = _read_only(self.points, np.float64)
        if points.ndim != 2 or points.shape[1] not in (2, 3):
            raise MeshError(f"points must have shape (n_points, 2) or (n_points, 3), not {points.shape}")
        invalid = np.flatnonzero(~np.isfinite(points).all(axis=1))
        if len(invalid):
            raise MeshError(
                f"point {invalid[0]} has coordinates {points[invalid[0]]}, which are not finite (number of such points: "
                f"{len(invalid)})"
            )
        cells = {name: self._checked_cells(name, block, len(points)) for name, block in self.cells.items()}
        cells = {name: block for name, block in cells.items() if len(block)}
        n_cells = sum(map(len, cells.values()))
        set_ = object.__setattr__
        set_(self, "points", points)
        set_(self, "cells", MappingProxyType(cells))
        set_(self, "cell_groups", self._checked_groups("cell", self.cell_groups, n_cells))
        set_(self, "point_groups", self._checked_groups("point", self.point_groups, len(points)))

    @staticmethod
    def _checked_cells(name: str, block: ArrayLike, n_points: int) -> AnyArray:
        """Return the cells of an element type as a read-only array. Raises MeshError for wrong shapes or point numbers."""
        element = elements.get(name)
        nodes = _read_only(_numbers(f"cells of {name}", block), np.int32)
        if nodes.shape[:1] == (0,):
            nodes = nodes.reshape(0, element.n_nodes)
        if nodes.ndim != 2 or nodes.shape[1] != element.n_nodes:
            raise MeshError(f"cells of {name} must have shape (n_cells, {element.n_nodes}), not {nodes.shape}")
        if nodes.size and (nodes.min() < 0 or nodes.max() >= n_points):
            outside = min(nodes.min(), 0) or nodes.max()
            raise MeshError(f"a cell of {name} refers to point {outside}, but there are {n_points} points (0-based)")
        return nodes

    @staticmethod
    def _checked_groups(kind: str, groups: Mapping[str, ArrayLike], count: int) -> Mapping[str, AnyArray]:
        """Return the groups as sorted, read-only arrays of numbers. Raises MeshError if a number is not below `count`."""
        groups_by_name = {}
        for name, members in groups.items():
            numbers = np.unique(_numbers(f"{kind} group '{name}'", members).astype(np.int32))
            if len(numbers) and (numbers[0] < 0 or numbers[-1] >= count):
                outside = min(numbers[0], 0) or numbers[-1]
                raise MeshError(f"{kind} group '{name}' contains {kind} {outside}, but there are {count} (0-based)")
            numbers.setflags(write=False)
            groups_by_name[name] = numbers
        return MappingProxyType(groups_by_name)

    def __reduce__(self) -> tuple[Any, ...]:
        return Mesh, (self.points, dict(self.cells), dict(self.cell_groups), dict(self.point_groups))

    def __repr__(self) -> str:
        counts = ", ".join(f"{len(block)} {name}" for name, block in self.cells.items())
        return f"Mesh({self.n_points} points, {counts}; groups: {', '.join(self.group_names) or 'none'})"

    def _repr_html_(self) -> str:
        """Return a table of cells and groups for notebooks."""
        rows = [("points", self.n_points, f"{self.dim}D")]
        rows += [(name, len(block), "cells") for name, block in self.cells.items()]
        for name, members in self.cell_groups.items():
            rows.append((name, len(members), "group of " + " and ".join(self.split(members))))
        rows += [(name, len(members), "group of points") for name, members in self.point_groups.items()]
        return html_table(rows, ("name", "number", "kind"), "Mesh")

    @property
    def n_points(self) -> int:
        """Number of points."""
        return len(self.points)

    @property
    def n_cells(self) -> int:
        """Number of cells of all dimensions."""
        return sum(map(len, self.cells.values()))

    @cached_property
    def dim(self) -> int:
        """Number of coordinates of a point, 2 or 3."""
        return int(self.points.shape[1])

    @cached_property
    def offsets(self) -> dict[str, int]:
        """Number of the first cell of each element type."""
        return starts_of(self.cells)

    @cached_property
    def solids(self) -> Mapping[str, AnyArray]:
        """Connectivity (n_cells, n_nodes) of the cells of dimension `dim`, by element type."""
        return MappingProxyType({name: c for name, c in self.cells.items() if elements.get(name).dim == self.dim})

    @property
    def facets(self) -> dict[str, AnyArray]:
        """Connectivity (n_cells, n_nodes) of the cells of dimension ``dim - 1``, by element type."""
        return {name: block for name, block in self.cells.items() if elements.get(name).dim == self.dim - 1}

    @property
    def group_names(self) -> list[str]:
        """Names of all groups, each once: cell groups, then point groups."""
        return list(self.cell_groups) + [name for name in self.point_groups if name not in self.cell_groups]

    def split(self, numbers: AnyArray) -> dict[str, Indices]:
        """Return the rows (m,) in `cells` of the cells with the given `numbers` (n,), by element type.

        Element types to which none of these cells belongs are absent.
        """
        rows = {}
        for name, start in self.offsets.items():
            in_block = (numbers >= start) & (numbers < start + len(self.cells[name]))
            if in_block.any():
                rows[name] = (numbers[in_block] - start).astype(np.intp)
        return rows

    def cells_of(self, group: str, dim: int | None = None) -> dict[str, AnyArray]:
        """Return the connectivity (n_cells, n_nodes) of a cell group by element type.

        If `dim` is given, only cells of this dimension are returned. Raises MeshError if there is no cell group of this name.
        """
        if group in self.point_groups and group not in self.cell_groups:
            similar = difflib.get_close_matches(group, self.cell_groups, n=2, cutoff=0.3) or [*self.cell_groups][:6]
            names = " or ".join(map(repr, similar))
            remedy = f": name one such as {names}" if names else ", and the mesh has no such group"
            requirement = "here a group of cells is needed (lines, faces, solids)"
            raise MeshError(f"'{group}' is a group of points, but {requirement}{remedy}")
        if group not in self.cell_groups:
            raise MeshError(self._no_group("group of cells", group, self.cell_groups))
        rows = self.split(self.cell_groups[group])
        return {name: self.cells[name][r] for name, r in rows.items() if dim is None or elements.get(name).dim == dim}

    def points_of(self, group: str) -> AnyArray:
        """Return the sorted point numbers (n,) of a point group or, if there is none of this name, of a cell group.

        The points of a cell group are the nodes of its cells. Raises MeshError, whose message lists similar names, if there
        is no group of this name.
        """
        if group in self.point_groups:
            return self.point_groups[group]
        if group not in self.cell_groups:
            raise MeshError(self._no_group("group", group, self.group_names))
        return np.unique(np.concatenate([np.empty(0, np.int32), *(b.ravel() for b in self.cells_of(group).values())]))

    def _no_group(self, kind: str, group: str, known: Iterable[str]) -> str:
        """Return the message for an unknown group; `known` contains the names of all groups of this kind."""
        if not self.group_names:
            return f"the mesh has no groups, and thus no '{group}': add groups in the mesher, or with Mesh.with_groups"
        return unknown(kind, group, known)

    def point(self, group: str) -> int:
        """Return the point number of a group with a single point.

        Raises MeshError if the group does not contain exactly one point.
        """
        numbers = self.points_of(group)
        if len(numbers) != 1:
            raise MeshError(f"group '{group}' contains {len(numbers)} points, but exactly one is required")
        return int(numbers[0])

    def replace(self, **changes: Any) -> Mesh:
        """Return a copy of the mesh in which some of `points`, `cells`, `cell_groups` and `point_groups` are replaced."""
        fields = {name: getattr(self, name) for name in ("points", "cells", "cell_groups", "point_groups")}
        return Mesh(**{**fields, **changes})

    def with_groups(
        self, cells: Mapping[str, ArrayLike] | None = None, points: Mapping[str, ArrayLike] | None = None
    ) -> Mesh:
        """Return the mesh with added or redefined groups.

        The mappings `cells` (n,) of int and `points` (n,) of int contain the cell numbers of cell groups and the point
        numbers of point groups, by name.
        """
        cell_groups, point_groups = {**self.cell_groups, **(cells or {})}, {**self.point_groups, **(points or {})}
        return self.replace(cell_groups=cell_groups, point_groups=point_groups)

    def with_facet_group(
        self, name: str, where: Callable[[Array], ArrayLike], *, between: bool = False, of: str | None = None
    ) -> Mesh:
        """Return the mesh with a new group of facets of its solid cells, which are selected by position.

        Selected facets that the mesh does not contain as cells are added. To select points by position, use
        ``with_groups(points={name: np.flatnonzero(...)})``.

        Parameters
        ----------
        name : str
            Name of the group; an existing group of this name is replaced.
        where : callable
            Function from positions (n_points, dim) [length] to booleans (n_points,). A facet belongs to the group if the
            function is True for all its nodes.
        between : bool
            Select facets between two solid cells, such as a section through a body, instead of facets on the surface.
        of : str, optional
            Group of the solid cells to which the facets belong; by default all solid cells. This option selects the
            facets of one of two coincident faces.

        Raises
        ------
        MeshError
            If no facet is selected, a point group has the name `name`, the group `of` contains no solid cells, or `where`
            returns an array of another type or shape.

        Examples
        --------
        >>> mesh = Mesh([[0, 0], [1, 0], [1, 1], [0, 1]], {"quad4": [[0, 1, 2, 3]]})
        >>> mesh.with_facet_group("TOP", lambda x: x[:, 1] > 0.99).cells_of("TOP")["line2"].tolist()
        [[2, 3]]
        """
        if name in self.point_groups:
            raise MeshError(f"'{name}' is already a group of points: give the facets another name")
        selected = np.asarray(where(np.array(self.points)))
        if selected.shape != (self.n_points,) or selected.dtype != bool:
            raise MeshError(
                f"the function of facet group '{name}' returned {selected.dtype} of shape {selected.shape}: it must return "
                f"True or False for each point, shape ({self.n_points},)"
            )
        in_group = np.ones(self.n_cells, bool)
        if of is not None:
            if not self.cells_of(of, dim=self.dim):
                remedy = "which has no solid cells: name a body's group"
                raise MeshError(f"facet group '{name}' cannot be taken from '{of}', {remedy}")
            in_group = np.isin(np.arange(self.n_cells), self.cell_groups[of])
        facets = _facets_with_nodes(self, selected, between, in_group)
        if not facets:
            group_text = f" of '{of}'" if of else ""
            raise MeshError(
                f"facet group '{name}' would be empty: its function selects {int(selected.sum())} points, but no "
                f"facet{group_text} {'between two cells' if between else 'on the outside'} has all its nodes among them; "
                "compare coordinates with a tolerance, or define a group of points with with_groups"
            )
        return self.with_facets({name: facets})

    def with_facets(self, groups: Mapping[str, Mapping[str, ArrayLike]]) -> Mesh:
        """Return the mesh with new groups of facets, which replace groups of the same names.

        `groups` (n_facets, n_nodes) of int contains the nodes of the facets, by name of the group and by element type.
        Facets that the mesh does not contain as cells are added.
        """
        cells = dict(self.cells)
        rows: dict[str, dict[str, AnyArray]] = {}
        for name, facets in groups.items():
            rows[name] = {}
            for kind, block in facets.items():
                block = np.asarray(block, np.int32)
                cells[kind], rows[name][kind] = _extended_block(cells.get(kind, block[:0]), block)
        starts = starts_of(cells)

        def numbers(rows_by_kind: Mapping[str, AnyArray]) -> AnyArray:
            return np.concatenate([starts[kind] + r for kind, r in rows_by_kind.items()] or [np.empty(0, np.intp)])

        old_groups = {group: numbers(self.split(members)) for group, members in self.cell_groups.items()}
        return self.replace(cells=cells, cell_groups={**old_groups, **{name: numbers(rows[name]) for name in rows}})

    def merged_groups(self, name: str, members: Iterable[str]) -> Mesh:
        """Return the mesh with a new cell group called `name`, which is the union of the cell groups `members`."""
        members = list(members)
        for member in members:
            self.cells_of(member)  # raises an error for an unknown group
        return self.with_groups(cells={name: np.concatenate([self.cell_groups[member] for member in members])})


def vector_text(vector: Iterable[float], digits: int = 6) -> str:
    """Return the components of a vector or position (dim,) in parentheses, for messages."""
    return f"({', '.join(f'{x:.{digits}g}' for x in vector)})"


def node_at(mesh: Mesh, node: int) -> str:
    """Return the number and the position of a node for messages."""
    return f"point {node} at {vector_text(mesh.points[node])}"


def facets_of_cells(mesh: Mesh) -> dict[str, tuple[AnyArray, AnyArray]]:
    """Return the nodes (n, n_nodes) of the facets of all solid cells and the numbers (n,) of the cells, by facet type.

    The normals of the facets point out of the cells.
    """
    facets: dict[str, list[AnyArray]] = {}
    owners: dict[str, list[AnyArray]] = {}
    for name, block in mesh.solids.items():
        element, numbers = elements.get(name), mesh.offsets[name] + np.arange(len(block), dtype=np.int32)
        for facet, kind in zip(element.facets, element.facet_elements, strict=True):
            facets.setdefault(kind, []).append(block[:, list(facet)])
            owners.setdefault(kind, []).append(numbers)
    return {kind: (np.concatenate(facets[kind]), np.concatenate(owners[kind])) for kind in facets}


def _facets_with_nodes(mesh: Mesh, selected: Mask, between: bool, in_group: Mask) -> dict[str, AnyArray]:
    """Return the facets (n_facets, n_nodes) of solid cells whose nodes are all selected, by element type of the facet.

    Each facet appears once, with the orientation of its first cell. This is outward for facets of a single cell.

    Parameters
    ----------
    mesh : Mesh
    selected : ndarray of bool (n_points,)
        Whether each point is selected.
    between : bool
        If True, return the facets between two cells; if False, the facets of a single cell.
    in_group : ndarray of bool (n_cells,)
        Whether the facets of each cell may be returned.
    """
    facets_by_kind, n_cells = {}, 2 if between else 1
    for kind, (nodes, cells) in facets_of_cells(mesh).items():
        is_candidate = selected[nodes].all(axis=1)
        facets = nodes[is_candidate]
        _, first, group, count = np.unique(
            np.sort(facets, axis=1), axis=0, return_index=True, return_inverse=True, return_counts=True
        )
        count_in_group = np.bincount(group.ravel(), in_group[cells[is_candidate]], len(count))
        rows = np.sort(first[(count == n_cells) & (count_in_group == n_cells)])
        if len(rows):
            facets_by_kind[kind] = facets[rows]
    return facets_by_kind


def _extended_block(block: AnyArray, facets: AnyArray) -> tuple[AnyArray, Indices]:
    """Return a block of facets with the missing ones of `facets` appended, and the row (n,) of each of the `facets`."""
    candidates = np.concatenate([block, facets])
    _, first, facet = np.unique(np.sort(candidates, axis=1), axis=0, return_index=True, return_inverse=True)
    row, rows = first[facet.ravel()], np.arange(len(candidates))  # row of the first facet with the same nodes
    is_new = (row == rows) & (rows >= len(block))
    new_row = np.where(rows < len(block), rows, len(block) + np.cumsum(is_new) - 1)
    return np.concatenate([block, candidates[is_new]]), new_row[row[len(block) :]].astype(np.intp)
