"""Immutable meshes: points, cells by element type, named groups."""

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
from fastcontact.errors import MeshError, unknown
from fastcontact.mesh import elements
from fastcontact.mesh.facet_search import added, facets_with_nodes


def _read_only(values: ArrayLike, dtype: Any) -> AnyArray:
    frozen = isinstance(values, np.ndarray) and values.base is None and not values.flags.writeable
    array = np.array(values, dtype=dtype, order="C", copy=None if frozen else True)
    array.setflags(write=False)
    return array


def _numbers(name: str, values: ArrayLike) -> AnyArray:
    """Return whole numbers as an array that can be converted to 32 bits."""
    array = np.asarray(values)
    if array.size == 0:
        return array.astype(np.int32)
    if array.dtype.kind not in "iuf" or (array.dtype.kind == "f" and not np.array_equal(array, np.floor(array))):
        raise MeshError(f"{name} must be whole numbers, counted from 0, not {array.dtype} values")
    if array.min() < -(2**31) or array.max() >= 2**31:
        raise MeshError(f"{name} contain the number {array.max()}: the largest that a mesh can hold is 2147483647")
    return array


def starts_of(blocks: Mapping[str, Sized]) -> dict[str, int]:
    """Return the number of the first cell of each block, where cells are numbered over all blocks, by name."""
    return dict(zip(blocks, np.cumsum([0, *map(len, blocks.values())]).tolist(), strict=False))


@typed(MeshError)
@dataclass(frozen=True, eq=False)
class Mesh:
    """Points, cells and named groups.

    A mesh has cells of several dimensions: solids, and facets (lines in 2D) for groups of the boundary. Cells are
    numbered consecutively over all element types in the order of `cells`; a cell group is a sorted array of these numbers.
    MeshError if an array has the wrong shape, a number is not finite, or an index is out of range.

    Parameters
    ----------
    points : array_like (n_points, dim)
        Reference coordinates [length].
    cells : mapping of str to array_like (n_cells, n_nodes)
        Connectivity by element type (``"tri3"``, ``"line2"``, ...).
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
        bad = np.flatnonzero(~np.isfinite(points).all(axis=1))
        if len(bad):
            raise MeshError(
                f"point {bad[0]} has coordinates {points[bad[0]]}: {len(bad)} points are not finite numbers"
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
        element = elements.get(name)
        conn = _read_only(_numbers(f"cells of {name}", block), np.int32)
        if conn.shape[:1] == (0,):
            conn = conn.reshape(0, element.n_nodes)
        if conn.ndim != 2 or conn.shape[1] != element.n_nodes:
            raise MeshError(f"cells of {name} must have shape (n_cells, {element.n_nodes}), not {conn.shape}")
        if conn.size and (conn.min() < 0 or conn.max() >= n_points):
            wrong = min(conn.min(), 0) or conn.max()
            raise MeshError(f"a cell of {name} refers to point {wrong}, but there are {n_points} points (0-based)")
        return conn

    @staticmethod
    def _checked_groups(kind: str, groups: Mapping[str, ArrayLike], count: int) -> Mapping[str, AnyArray]:
        checked = {}
        for name, members in groups.items():
            numbers = np.unique(_numbers(f"{kind} group '{name}'", members).astype(np.int32))
            if len(numbers) and (numbers[0] < 0 or numbers[-1] >= count):
                wrong = min(numbers[0], 0) or numbers[-1]
                raise MeshError(f"{kind} group '{name}' contains {kind} {wrong}, but there are {count} (0-based)")
            numbers.setflags(write=False)
            checked[name] = numbers
        return MappingProxyType(checked)

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

    @property
    def dim(self) -> int:
        """Dimension of the space, 2 or 3."""
        return int(self.points.shape[1])

    @cached_property
    def offsets(self) -> dict[str, int]:
        """Number of the first cell of each element type."""
        return starts_of(self.cells)

    @property
    def solids(self) -> dict[str, AnyArray]:
        """Connectivity (n_cells, n_nodes) of the cells that have the dimension of the space, by element type."""
        return {name: block for name, block in self.cells.items() if elements.get(name).dim == self.dim}

    @property
    def facets(self) -> dict[str, AnyArray]:
        """Connectivity (n_cells, n_nodes) of the cells one dimension below the space, by element type."""
        return {name: block for name, block in self.cells.items() if elements.get(name).dim == self.dim - 1}

    @property
    def group_names(self) -> list[str]:
        """Names of all groups: cell groups, then point groups not already named."""
        return list(self.cell_groups) + [name for name in self.point_groups if name not in self.cell_groups]

    def split(self, numbers: AnyArray) -> dict[str, Indices]:
        """Return by element type the rows (m,) of the cells `numbers` (n,); types without such cells are absent."""
        rows = {}
        for name, start in self.offsets.items():
            inside = (numbers >= start) & (numbers < start + len(self.cells[name]))
            if inside.any():
                rows[name] = (numbers[inside] - start).astype(np.intp)
        return rows

    def cells_of(self, group: str, dim: int | None = None) -> dict[str, AnyArray]:
        """Return the connectivity (n_cells, n_nodes) of a cell group by element type, only of the dimension `dim` if given.

        MeshError if there is no cell group of that name.
        """
        if group in self.point_groups and group not in self.cell_groups:
            near = difflib.get_close_matches(group, self.cell_groups, n=2, cutoff=0.3) or [*self.cell_groups][:6]
            remedy = (
                f": name one such as {' or '.join(map(repr, near))}" if near else ", and the mesh has none of cells"
            )
            raise MeshError(
                f"'{group}' is a group of points, but here one of cells is needed (lines, faces, solids){remedy}"
            )
        if group not in self.cell_groups:
            raise MeshError(self._no_group("group of cells", group, self.cell_groups))
        rows = self.split(self.cell_groups[group])
        return {name: self.cells[name][r] for name, r in rows.items() if dim is None or elements.get(name).dim == dim}

    def points_of(self, group: str) -> AnyArray:
        """Return the sorted point numbers (n,) of a group: a point group, or else all nodes of a cell group.

        MeshError if there is no such group; the message lists similar names.
        """
        if group in self.point_groups:
            return self.point_groups[group]
        if group not in self.cell_groups:
            raise MeshError(self._no_group("group", group, self.group_names))
        if group not in self._nodes_of_groups:
            blocks = [block.ravel() for block in self.cells_of(group).values()]
            self._nodes_of_groups[group] = np.unique(np.concatenate(blocks)) if blocks else np.empty(0, np.int32)
        return self._nodes_of_groups[group].copy()

    @cached_property
    def _nodes_of_groups(self) -> dict[str, AnyArray]:
        return {}

    def _no_group(self, kind: str, group: str, known: Iterable[str]) -> str:
        if not self.group_names:
            return f"the mesh has no groups, and thus no '{group}': name groups in the mesher, or with Mesh.with_groups"
        return unknown(kind, group, known)

    def point(self, group: str) -> int:
        """Return the number of the only point of a group.

        MeshError if the group does not hold exactly one point.
        """
        numbers = self.points_of(group)
        if len(numbers) != 1:
            raise MeshError(f"group '{group}' holds {len(numbers)} points where exactly one is needed")
        return int(numbers[0])

    def replace(self, **changes: Any) -> Mesh:
        """Return a mesh with some of `points`, `cells`, `cell_groups`, `point_groups` replaced."""
        fields = {name: getattr(self, name) for name in ("points", "cells", "cell_groups", "point_groups")}
        return Mesh(**{**fields, **changes})

    def with_groups(
        self, cells: Mapping[str, ArrayLike] | None = None, points: Mapping[str, ArrayLike] | None = None
    ) -> Mesh:
        """Return the mesh with added or redefined groups, by name: `cells` (n,) of int, `points` (n,) of int."""
        return self.replace(
            cell_groups={**self.cell_groups, **(cells or {})},
            point_groups={**self.point_groups, **(points or {})},
        )

    def with_facet_group(
        self,
        name: str,
        where: Callable[[Array], ArrayLike],
        *,
        between: bool = False,
        of: str | None = None,
    ) -> Mesh:
        """Return the mesh with a new group of facets of its solids, selected by position; missing facets are added as cells.

        For groups of points use ``with_groups(points={name: np.flatnonzero(...)})``.

        Parameters
        ----------
        name : str
            Name of the group; an existing group of this name is replaced.
        where : callable
            From positions (n_points, dim) [length] to bool (n_points,). A facet belongs to the group if all its nodes are
            True.
        between : bool
            Select facets between two cells, such as a section through a body, instead of those on the outer surface.
        of : str, optional
            Group of the solid cells to which the facets belong, by default all. It distinguishes coinciding faces of
            two bodies.

        Raises
        ------
        MeshError
            If there is no such facet, a point group has this name, `of` holds no solid cells, or `where` returns an
            array of another type or shape.

        Examples
        --------
        >>> mesh = Mesh([[0, 0], [1, 0], [1, 1], [0, 1]], {"quad4": [[0, 1, 2, 3]]})
        >>> mesh.with_facet_group("TOP", lambda x: x[:, 1] > 0.99).cells_of("TOP")["line2"].tolist()
        [[2, 3]]
        """
        if name in self.point_groups:
            raise MeshError(f"'{name}' is a group of points already: give the facets another name")
        chosen = np.asarray(where(np.array(self.points)))
        if chosen.shape != (self.n_points,) or chosen.dtype != bool:
            raise MeshError(
                f"the function of facet group '{name}' returned {chosen.dtype} of shape {chosen.shape}: it must return True "
                f"or False for each point, shape ({self.n_points},)"
            )
        facets = facets_with_nodes(self.solids, chosen, between, None if of is None else self._cells_inside(name, of))
        if not facets:
            inside = f" of '{of}'" if of else ""
            raise MeshError(
                f"facet group '{name}' would be empty: its function chooses {int(chosen.sum())} points, but no facet{inside} "
                f"{'between two cells' if between else 'on the outside'} has all its nodes among them; compare coordinates "
                "with a tolerance, or make a group of points by with_groups"
            )
        return self.with_facets({name: facets})

    def _cells_inside(self, name: str, group: str) -> dict[str, Mask]:
        """Return which solid cells (n_cells,) a group has, by element type; MeshError, with facet group `name`, if none."""
        if not self.cells_of(group, dim=self.dim):
            raise MeshError(
                f"facet group '{name}' cannot be taken from '{group}', which has no solid cells: name a body's group"
            )
        rows = self.split(self.cell_groups[group])
        return {kind: np.isin(np.arange(len(block)), rows.get(kind, [])) for kind, block in self.solids.items()}

    def with_facets(self, groups: Mapping[str, Mapping[str, ArrayLike]]) -> Mesh:
        """Return the mesh with new groups of facets; missing facets are added, groups of the same names are replaced.

        `groups` (n_facets, n_nodes) of int holds the nodes of the facets, by name of the group and by element type.
        """
        cells = dict(self.cells)
        rows: dict[str, dict[str, AnyArray]] = {}
        for name, facets in groups.items():
            rows[name] = {}
            for kind, block in facets.items():
                block = np.asarray(block, np.int32)
                cells[kind], rows[name][kind] = added(cells.get(kind, block[:0]), block)
        starts = starts_of(cells)

        def numbers(of: Mapping[str, AnyArray]) -> AnyArray:
            return np.concatenate([starts[kind] + place for kind, place in of.items()] or [np.empty(0, np.intp)])

        renewed = {group: numbers(self.split(members)) for group, members in self.cell_groups.items()}
        return self.replace(cells=cells, cell_groups={**renewed, **{name: numbers(rows[name]) for name in rows}})

    def merged_groups(self, name: str, members: Iterable[str]) -> Mesh:
        """Return the mesh with a new cell group `name`, the union of the cell groups `members`."""
        cells = []
        for member in members:
            self.cells_of(member)
            cells.append(self.cell_groups[member])
        return self.with_groups(cells={name: np.concatenate(cells)})
