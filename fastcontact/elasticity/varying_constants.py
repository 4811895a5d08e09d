"""Material constants that vary with position, given as functions or as values for cells or points."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact._tools.records import record
from fastcontact.arrays import Array, Indices, Numbers
from fastcontact.elasticity.loads import check_number, evaluated
from fastcontact.errors import ModelError
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import Mesh

Rows = Mapping[str, Indices]
AXES = ("x", "y", "z", "radius")


@typed(ModelError)
@dataclass(frozen=True)
class Tabulated:
    """A piecewise linear function of one coordinate, given by a table and constant beyond both ends of the table.

    It can be used for material constants, temperatures, pressures and other quantities that may be functions of position.

    Parameters
    ----------
    along : {"x", "y", "z", "radius"}
        Name of the coordinate; ``"radius"`` is the distance from the z axis in 3D, and from the origin in plane models. In
        axisymmetry, where the radius is x, it is refused.
    table : sequence of (float, float)
        Coordinate [length] and value [unit of the quantity] of each point of the table.

    Raises
    ------
    ModelError
        If a number is not finite, or the coordinates are not in ascending order.

    Examples
    --------
    >>> import fastcontact as fc
    >>> coating = fc.Tabulated("y", [(-0.2, 210e3), (0.0, 400e3)])
    >>> material = fc.LinearElastic(E=coating, nu=0.3)
    """

    along: str
    table: Sequence[Sequence[float]]

    def __post_init__(self) -> None:
        if self.along not in AXES:
            raise ModelError(f"a table is along {', '.join(AXES[:3])} or {AXES[3]}, not along {self.along!r}")
        try:
            rows = tuple((_number(abscissa), _number(value)) for abscissa, value in self.table)
        except (TypeError, ValueError):
            raise ModelError(f"the table along {self.along} must be pairs [coordinate, value] of numbers") from None
        for number in (number for row in rows for number in row):
            check_number(f"a number of the table along {self.along}", number)
        if not rows or any(b[0] <= a[0] for a, b in itertools.pairwise(rows)):
            raise ModelError(f"the table along {self.along} must have ascending coordinates, at least one")
        object.__setattr__(self, "table", rows)

    def __call__(self, points: Array) -> Array:
        """Return the values (n,) [unit of the quantity] at `points` (n, dim) [length]."""
        if self.along == "radius":
            coordinate = np.hypot(points[:, 0], points[:, 1])
        elif AXES.index(self.along) < points.shape[1]:
            coordinate = points[:, AXES.index(self.along)]
        else:
            raise ModelError("a table is along z, but the mesh is plane: use x, y or radius")
        return np.interp(coordinate, *np.transpose(self.table))


def is_along_radius(value: Any) -> bool:
    """Return whether a value, or one that it contains, is a table along ``"radius"``."""
    if isinstance(value, Tabulated):
        return value.along == "radius"
    if isinstance(value, Varying):
        return is_along_radius(value.source)
    if isinstance(value, Mapping):
        return any(map(is_along_radius, value.values()))
    if isinstance(value, list | tuple):
        return any(map(is_along_radius, value))
    return dataclasses.is_dataclass(value) and any(map(is_along_radius, vars(value).values()))


def _number(value: Any) -> float:
    """Return a number as a float; raise TypeError for text, and TypeError or ValueError for other values."""
    if isinstance(value, str | bytes):
        raise TypeError(value)
    return float(value)


@record
class Cells:
    """A set of solid cells of a mesh; `rows` contains their numbers (m,) of int by element type."""

    mesh: Mesh
    rows: Rows

    @property
    def count(self) -> int:
        """Number of cells."""
        return sum(map(len, self.rows.values()))

    def samples(self) -> Iterator[tuple[str, Indices, Array]]:
        """Yield element types, numbers of cells and shape functions (n, n_nodes) [-] at points of the cells.

        The points are first the centres of the cells, then the quadrature points.
        """
        for shapes in (centre_weights, lambda name: elements.get(name).tables[0]):
            for name, rows in self.rows.items():
                yield name, rows, shapes(name)


def centre_weights(name: str) -> Array:
    """Return the weights (1, n_nodes) [-] of the nodes of a cell at its centre, which is the mean of their positions."""
    n = elements.get(name).n_nodes
    return np.full((1, n), 1.0 / n)


class Varying:
    """A material constant that varies with position.

    Two objects are equal if they refer to the same function or array.

    Parameters
    ----------
    source : callable or ndarray
        A function from positions (n, dim) [length] to numbers (n,), or an array with a number for each cell or point.
    cells : Cells, optional
        Cells of the material; None before the material is assigned to cells.
    name : str
        Name of the constant in messages.
    """

    def __init__(self, source: Any, cells: Cells | None = None, name: str = "the constant") -> None:
        self.source, self.cells, self._name = source, cells, name
        self._nodal: Array | None = None
        self._by_cell: dict[str, Array] | None = None
        if cells is not None and not callable(source):
            self._assign(np.asarray(source), cells)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Varying) and self.source is other.source

    def __hash__(self) -> int:
        return id(self.source)

    def __repr__(self) -> str:
        return "a function of the position" if callable(self.source) else f"an array of {len(self.source)} numbers"

    def __format__(self, spec: str) -> str:
        if self.cells is None:
            return repr(self)
        low, high = self.range
        return f"{low:{spec}} to {high:{spec}}"

    def _assign(self, values: Array, cells: Cells) -> None:
        """Assign the values of an array to cells or to points, according to its length."""
        mesh = cells.mesh
        total = sum(map(len, mesh.solids.values()))
        lengths = {"cells": cells.count, "solid cells of the mesh": total, "points of the mesh": mesh.n_points}
        counts = ", ".join(f"{count} {unit}" for unit, count in lengths.items())
        column = values.ndim == 2 and values.shape[1] == 1
        if column:
            values = values[:, 0]
            del lengths["points of the mesh"]
        if values.ndim != 1 or values.dtype.kind not in "fiu" or len(values) not in lengths.values():
            raise ModelError(
                f"{self._name} is an array of {values.dtype} of shape {values.shape}: it must have a number for each cell of "
                f"the material or of the mesh, or for each point ({counts})"
            )
        if not column and len(values) == mesh.n_points and len(values) in (cells.count, total):
            raise ModelError(
                f"{self._name} has {len(values)} numbers, but there are as many cells as points: give values of cells as a "
                "column, shape (n, 1), and values of points as a function"
            )
        if not np.isfinite(values).all():
            raise ModelError(f"{self._name} is not finite at row {int(np.flatnonzero(~np.isfinite(values))[0])}")
        if len(values) == mesh.n_points and not column:
            self._nodal = values.astype(float)
        else:
            self._by_cell = _by_cell(values, cells)

    @property
    def varies_within_cells(self) -> bool:
        """Whether the constant varies within cells."""
        return self._by_cell is None

    @cached_property
    def range(self) -> tuple[float, float]:
        """The smallest and the largest value at the centres and quadrature points of the cells of the material."""
        assert self.cells is not None
        samples = [self.at(*sample) for sample in self.cells.samples()]
        return float(min(values.min() for values in samples)), float(max(values.max() for values in samples))

    def at(self, name: str, rows: Indices, N: Array) -> Array:
        """Return the values (n_rows * n,) [unit of the constant] at n points in each of the given cells, cell by cell.

        `name` is the element type of the cells, `rows` (n_rows,) of int contains their numbers, and `N` (n, n_nodes) [-] the
        shape functions at the points.
        """
        assert self.cells is not None
        mesh = self.cells.mesh
        if self._by_cell is not None:
            return np.repeat(self._by_cell[name][rows], len(N))
        nodes = mesh.cells[name][rows]
        if self._nodal is not None:
            return (self._nodal[nodes] @ N.T).ravel()
        return evaluated(self.source, positions(mesh, nodes, N), self._name).ravel()


class CellAxes(Varying):
    """Material axes of cells, given as unit vectors in rows (n_cells, 3, 3) [-].

    The array contains axes for each cell of the material or for each solid cell of the mesh.
    """

    def _assign(self, values: Array, cells: Cells) -> None:
        """Assign the axes to the cells of the material or of the mesh, according to the length of the array."""
        total = sum(map(len, cells.mesh.solids.values()))
        if len(values) not in (cells.count, total):
            raise ModelError(
                f"a material has {len(values)} axes: there must be one for each of its cells, {cells.count}, or of the cells "
                f"of the mesh, {total}"
            )
        self._by_cell = _by_cell(values, cells)

    def at(self, name: str, rows: Indices, N: Array) -> Array:
        """Return the axes (n_rows * n, 3, 3) [-] at points of cells; the parameters are described for `Varying.at`."""
        if self._by_cell is None:
            raise ModelError("axes given by cell can be evaluated only for the material of a model")
        return np.repeat(self._by_cell[name][rows], len(N), axis=0)


def _by_cell(values: Array, cells: Cells) -> dict[str, Array]:
    """Return arrays by element type of values that are given for `cells` or for all solid cells, with NaN for other cells."""
    blocks, first = {}, 0
    for name, block in cells.mesh.solids.items():
        blocks[name] = np.full((len(block), *values.shape[1:]), np.nan)
        rows = np.arange(len(block)) if len(values) != cells.count else cells.rows.get(name, np.empty(0, np.intp))
        blocks[name][rows] = values[first : first + len(rows)]
        first += len(rows)
    return blocks


def positions(mesh: Mesh, nodes: Numbers, N: Array) -> Array:
    """Return the positions (n_cells * n, dim) [length] of n points in each cell, given the shape functions there.

    `nodes` (n_cells, n_nodes) of int are the nodes of the cells, and `N` (n, n_nodes) [-] the shape functions at the points.
    """
    return np.einsum("qa,cad->cqd", N, mesh.points[nodes]).reshape(-1, mesh.dim)


def wrap_varying(value: Any, vector: bool = False) -> Any:
    """Return functions and arrays as `Varying`, and numbers and None unchanged.

    If `vector` is true, a sequence of constants is converted item by item. Raises ModelError if an array does not contain
    real numbers.
    """
    if vector and isinstance(value, Sequence) and not isinstance(value, str):
        return tuple(wrap_varying(v) for v in value)
    if isinstance(value, np.ndarray) and value.ndim == 0 and value.dtype.kind in "fiu":
        return float(value)
    if isinstance(value, list | tuple):
        try:
            value = np.asarray(value, float)
        except (TypeError, ValueError, OverflowError):
            raise ModelError(
                f"a constant of a material must be a number, or numbers for all cells or points, not {value!r}"
            ) from None
    if isinstance(value, np.ndarray) and value.dtype.kind not in "fiu":
        raise ModelError(f"a constant of a material must be real numbers, not an array of {value.dtype}")
    if isinstance(value, Varying) or not (callable(value) or (isinstance(value, np.ndarray) and value.ndim > 0)):
        return value
    return Varying(value)


def map_constants(value: Any, function: Callable[[Any], Any]) -> Any:
    """Apply `function` to a constant, or to each item of a tuple of constants."""
    return tuple(function(v) for v in value) if isinstance(value, tuple) else function(value)


def varying_items(value: Any) -> list[Varying]:
    """Return, from a constant or a tuple of constants, those that vary with position."""
    return [v for v in (value if isinstance(value, tuple) else (value,)) if isinstance(v, Varying)]
