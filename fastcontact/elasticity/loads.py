"""Loads and their nodal forces in the reference configuration.

Each kind of load is a subclass of `Load` and has a method ``add_...`` of the model. Nodal forces are work-equivalent: they
are the integrals of the load times the shape functions. In axisymmetry, forces refer to the full circle.

A `Value` is a number, or a function from positions (n, dim) [length] in the reference configuration to numbers (n,) [unit of
the load]. `Components` map the numbers of axes to values.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any, ClassVar, Protocol

import numpy as np

from fastcontact._tools.argument_types import values_at
from fastcontact.arrays import Array, Indices, Numbers
from fastcontact.elasticity.energy import cell_volumes
from fastcontact.elasticity.symmetry_axis import axis_nodes
from fastcontact.errors import ModelError, check_known
from fastcontact.mesh import elements, quadrature
from fastcontact.mesh.area_vectors import area_vectors
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.topology import outer_facets, outer_rows

Table = tuple[tuple[float, float], ...]
Value = float | Callable[[Array], Array]
# Name of the cells of a load without groups, in messages and results.
EVERYWHERE = "all solid cells"
# Largest admissible magnitude of a number in a model. The square of the product of two such numbers is finite.
LARGEST = 1e60
Components = Mapping[int, Value]

# Number of points of the product rule in each direction of lines, triangles, tetrahedra and pyramids, and in the Cartesian
# directions of squares, cubes and prisms; see `quadrature.product_rule`. The rules are exact at least to degree 7, which
# suffices for constant loads on curved quadratic cells in axisymmetry and for quadratic loads on straight facets.
LOAD_POINTS = 5, 4


class DensityField(Protocol):
    """Densities of solid cells."""

    def at(self, name: str, rows: Indices, N: Array) -> Array:
        """Return the densities (n_rows, n) [mass / length^3] at n points of cells of an element, NaN where there are none.

        `rows` (n_rows,) of int contains the numbers of the cells, and `N` (n, n_nodes) [-] the shape functions at the points.
        """


class Load:
    """Base class of the loads of a model.

    `ramp` contains the points (load factor, multiplier) of the ramp; None means the ramp of the analysis.
    """

    KIND: ClassVar[str]
    CONSTANT: ClassVar[bool] = False  # whether values must be numbers instead of functions of position
    group: str
    components: Components
    value: Value  # value of a load without components
    ramp: Table | None

    @property
    def name(self) -> str:
        """Kind of the load and its group, for messages."""
        return f"{self.KIND} on '{self.group}'"

    @property
    def group_names(self) -> tuple[str, ...]:
        """Names of the groups on which the load acts."""
        return (self.group,)

    @property
    def values(self) -> list[Value]:
        """Values of all components, or the value of a load without components."""
        return [self.value] if hasattr(self, "value") else list(self.components.values())

    def check(self, mesh: Mesh, kinematics: str) -> None:
        """Raise MeshError or ModelError if the load cannot act on this mesh."""
        self._check_groups(mesh, kinematics)
        for value in self.values:
            (check_number if self.CONSTANT else check_value)(self.name, value)

    def vector(self, mesh: Mesh, kinematics: str, density: DensityField | None = None) -> Array:
        """Return the nodal forces (n_points, dim) at multiplier 1 [force]; the errors are those of `check`.

        Parameters
        ----------
        mesh : Mesh
        kinematics : str
        density : DensityField, optional
            Densities of the solid cells, which only the loads of `inertia_loads` need.
        """
        forces = np.zeros((mesh.n_points, mesh.dim))
        self._add_to(forces, mesh, kinematics)
        return forces

    def cells(self, mesh: Mesh) -> dict[str, Numbers]:
        """Return the facets or solid cells (n, n_nodes) on which the load acts, by element type."""
        return facets_of(mesh, self.group)

    def _check_groups(self, mesh: Mesh, kinematics: str) -> None:
        self.cells(mesh)

    def _add_to(self, forces: Array, mesh: Mesh, kinematics: str) -> None:
        """Add the nodal forces due to the `_force_density` on all cells to `forces` (n_points, dim)."""
        for element, cells in self.cells(mesh).items():
            x, N, measure = quadrature_points(mesh, element, cells, kinematics)
            add_forces(forces, cells, N, self._force_density(x) * measure[:, :, None])

    def _force_density(self, x: Array) -> Array:
        """Return the force per unit area or volume (c, q, dim) at positions `x` (c, q, dim) [length]."""
        force_density = np.zeros(x.shape)
        for axis, value in self.components.items():
            force_density[:, :, axis] = evaluated(value, x, self.name)
        return force_density


@dataclass(frozen=True)
class ValueLoad(Load):
    """Base class of loads with one value on a group."""

    group: str
    value: Value
    ramp: Table | None = None


class Pressure(ValueLoad):
    """A pressure [pressure] on a group of outer facets. If it is positive, it acts against their outward normals."""

    KIND = "the pressure"

    def cells(self, mesh: Mesh) -> dict[str, Numbers]:
        """Return the facets (n, n_nodes) of int by element type, with outward normals."""
        return {name: outward(mesh, self.group, name, block) for name, block in facets_of(mesh, self.group).items()}

    def _add_to(self, forces: Array, mesh: Mesh, kinematics: str) -> None:
        for element, facets in self.cells(mesh).items():
            x, N, vectors = facet_points(mesh, element, facets, kinematics)
            add_forces(forces, facets, N, -evaluated(self.value, x, self.name)[:, :, None] * vectors)


@dataclass(frozen=True)
class Hydrostatic:
    """Pressure of a liquid with the specific weight `weight` [force / length^3], whose surface is at `level` [length].

    The level is the coordinate of the surface along the axis with the number `axis`, which points upwards.
    """

    weight: float
    level: float
    axis: int

    def __call__(self, points: Array) -> Array:
        """Return the pressure (n,) [pressure] at `points` (n, dim) [length]."""
        return np.asarray(self.weight * np.maximum(self.level - points[:, self.axis], 0.0))


@dataclass(frozen=True)
class ComponentLoad(Load):
    """Base class of loads with components on a group."""

    group: str
    components: Components
    ramp: Table | None = None


class Traction(ComponentLoad):
    """A force per unit area on a group of facets, given by its components [pressure]."""

    KIND = "the traction"


class VolumeLoad(Load):
    """A load on groups of solid cells, or on all solid cells."""

    groups: tuple[str, ...] | None

    @property
    def name(self) -> str:
        """Kind of the load and its groups, for messages."""
        return f"{self.KIND} on {listed(self.groups)}"

    @property
    def group_names(self) -> tuple[str, ...]:
        """Names of the groups on which the load acts."""
        return (EVERYWHERE,) if self.groups is None else self.groups

    def cells(self, mesh: Mesh) -> dict[str, Numbers]:
        """Return the solid cells (n, n_nodes) of int by element type."""
        return {name: mesh.cells[name][rows] for name, rows in solid_rows(mesh, self.groups).items()}

    def _check_groups(self, mesh: Mesh, kinematics: str) -> None:
        check_solids(mesh, self.groups, f": no {self.KIND.removeprefix('the ')} can act on it")


@dataclass(frozen=True)
class BodyForce(VolumeLoad):
    """A force per unit volume on groups of solid cells, or on all solid cells, given by its components [force / length^3]."""

    KIND = "the body force"
    groups: tuple[str, ...] | None
    components: Components
    ramp: Table | None = None


class NodalForce(ComponentLoad):
    """A force on each node of a group, given by its components [force]."""

    KIND = "the nodal force"

    def _check_groups(self, mesh: Mesh, kinematics: str) -> None:
        check_points(mesh, self.group, "no force can act on it")
        if kinematics == "axisymmetric" and 0 in self.components:
            on_axis = np.intersect1d(mesh.points_of(self.group), axis_nodes(mesh))
            if len(on_axis):
                raise ModelError(
                    f"{self.name} has a radial component x on the axis of symmetry (number of points: {len(on_axis)}, first: "
                    f"point {on_axis[0]}), where the circumference is zero: leave out the points at x = 0"
                )

    def _add_to(self, forces: Array, mesh: Mesh, kinematics: str) -> None:
        nodes = mesh.points_of(self.group)
        for axis, value in self.components.items():
            forces[nodes, axis] = evaluated(value, mesh.points[nodes], self.name)


class TotalForce(ComponentLoad):
    """A force given by its components [force], which acts as a uniform traction on a group of facets."""

    KIND, CONSTANT = "the total force", True
    components: Mapping[int, float]

    def _check_groups(self, mesh: Mesh, kinematics: str) -> None:
        super()._check_groups(mesh, kinematics)
        if kinematics == "axisymmetric" and 0 in self.components:
            raise ModelError(
                f"{self.name} has a radial component x, but radial forces cancel over the full circle: "
                "use add_pressure or add_traction for a radial load"
            )

    def _add_to(self, forces: Array, mesh: Mesh, kinematics: str) -> None:
        nodal_areas, area = np.zeros((mesh.n_points, 1)), 0.0
        for element, facets in self.cells(mesh).items():
            _, N, measure = quadrature_points(mesh, element, facets, kinematics)
            add_forces(nodal_areas, facets, N, measure[:, :, None])
            area += float(measure.sum())
        for axis, value in self.components.items():
            forces[:, axis] = nodal_areas[:, 0] * (value / area)


def listed(groups: Sequence[str] | None) -> str:
    """Return the names of groups of solid cells as text, for messages; None means all solid cells."""
    return EVERYWHERE if groups is None else ", ".join(f"'{group}'" for group in groups)


def solid_rows(mesh: Mesh, groups: Sequence[str] | None) -> dict[str, Indices]:
    """Return the numbers (n,) of the solid cells of groups, or of all solid cells, by element type."""
    if groups is None:
        return {name: np.arange(len(block)) for name, block in mesh.solids.items()}
    rows = mesh.split(np.unique(np.concatenate([mesh.cell_groups[group] for group in groups])))
    return {name: rows[name] for name in mesh.solids if name in rows}


def solid_points(mesh: Mesh, groups: Sequence[str] | None) -> Indices:
    """Return the points (n,) of int of the solid cells of groups, or of all solid cells, in ascending order."""
    rows = solid_rows(mesh, groups)
    return np.unique(np.concatenate([mesh.cells[name][rows[name]].ravel() for name in rows]))


def check_solids(mesh: Mesh, groups: Sequence[str] | None, consequence: str) -> None:
    """Raise ModelError if one of the groups contains no solid cells; the message ends with `consequence`."""
    for group in groups or ():
        if not mesh.cells_of(group, dim=mesh.dim):
            raise ModelError(f"group '{group}' contains no solid cells{consequence}")


def check_points(mesh: Mesh, group: str, consequence: str) -> None:
    """Raise ModelError if a group is empty; the message ends with `consequence`."""
    if not len(mesh.points_of(group)):
        raise ModelError(f"group '{group}' is empty: {consequence}")


def facets_of(mesh: Mesh, group: str) -> dict[str, Numbers]:
    """Return the facets (n, n_nodes) of a group by element type, without duplicates.

    Raises MeshError if there is no such group of cells, ModelError if it has no facets.
    """
    if group in mesh.point_groups and group not in mesh.cell_groups:
        raise ModelError(f"group '{group}' contains only points: this load needs a group of facets")
    blocks = mesh.cells_of(group, dim=mesh.dim - 1)
    if not blocks:
        raise ModelError(f"group '{group}' contains no facets (cells of dimension {mesh.dim - 1}) for a load to act on")
    first = {name: np.unique(np.sort(block, axis=1), axis=0, return_index=True)[1] for name, block in blocks.items()}
    return {name: block[np.sort(first[name])] for name, block in blocks.items()}


def outward(mesh: Mesh, group: str, element: str, block: Numbers) -> Numbers:
    """Return facets (n, n_nodes), given as `block` (n, n_nodes), with normals that point out of the solid.

    Raises ModelError, with the name of the `group`, if a facet does not lie on the outside of a solid.
    """
    remedy = ", where a pressure has no direction: use a traction there"
    rows = outer_rows(mesh, group, element, block, ModelError, remedy)
    return np.ascontiguousarray(outer_facets(mesh)[element][rows])


def evaluated(value: Value, points: Array, name: str) -> Array:
    """Return the value (...) [unit of the load] at `points` (..., dim) [length].

    Raises ModelError if a function returns an array of a different shape, or numbers that are too large or not finite.
    """
    if not callable(value):
        return np.full(points.shape[:-1], float(value))
    flat = np.ascontiguousarray(points.reshape(-1, points.shape[-1]))
    array = np.asarray(values_at(value, flat, name, ModelError))
    if array.shape != (len(flat),) or array.dtype.kind not in "fiu":
        raise ModelError(
            f"{name} is a function that returned {array.dtype} numbers of shape {array.shape} for {len(flat)} points: "
            f"it must return one real number per point, shape ({len(flat)},)"
        )
    not_finite = np.flatnonzero(~np.isfinite(array))
    if len(not_finite):
        raise ModelError(f"{name} is {array[not_finite[0]]} at {flat[not_finite[0]]}: it must be finite everywhere")
    if np.abs(array).max(initial=0.0) > LARGEST:
        raise ModelError(
            f"{name} is out of range: its magnitude must be at most {LARGEST:g} everywhere, whatever its unit"
        )
    return array.astype(np.float64).reshape(points.shape[:-1])


def check_number(name: str, value: Any) -> None:
    """Raise ModelError, with the `name` of the value, if it is not a finite number or its magnitude exceeds LARGEST."""
    number: Any = value if isinstance(value, Real) and not isinstance(value, bool) else math.nan
    if not abs(number) < math.inf:
        raise ModelError(f"{name} is {value!r}, which is not a finite number")
    if abs(number) > LARGEST:
        raise ModelError(f"{name} is out of range: its magnitude must be at most {LARGEST:g}, whatever its unit")


def check_value(name: str, value: Any) -> None:
    """Raise ModelError, with the `name` of the value, if it is neither a finite number nor a function."""
    if not callable(value):
        check_number(name, value)


def axis_values(caption: str, components: Mapping[str, Any], dim: int) -> dict[int, Any]:
    """Return the components that are not None by axis number, given `components` by the axis names x, y and z.

    Raises ModelError if all components are None, or if an axis does not exist in `dim` dimensions. The message begins with
    `caption`.
    """
    specified = {name: value for name, value in components.items() if value is not None}
    if not specified:
        raise ModelError(f"{caption} has no component: specify, for example, y=-1.0")
    for name in specified:
        check_known("component", name, "xyz"[:dim], ModelError, f"{caption}: ")
    return {"xyz".index(name): value for name, value in specified.items()}


def _quadrature(mesh: Mesh, element: str, cells: Numbers) -> tuple[Array, Array, Array, Array]:
    """Return positions (c, q, dim), shape functions (q, n), their derivatives (q, n, cell dim) and weights (q,)."""
    reference = elements.get(element)
    xi, weights = quadrature.product_rule(reference.linear, *LOAD_POINTS)
    N = reference.shape(xi)
    return np.einsum("qn,cnd->cqd", N, mesh.points[cells]), N, reference.gradient(xi), weights


def facet_points(mesh: Mesh, element: str, facets: Numbers, kinematics: str) -> tuple[Array, Array, Array]:
    """Return positions (f, q, dim) [length], shape functions (q, n) [-] and area vectors (f, q, dim) [length^2] of facets.

    The values are those at the quadrature points of `facets` (f, n) of int of an element type. Area vectors include the
    weight of a point and, in axisymmetry, the circumference.
    """
    x, N, dN, weights = _quadrature(mesh, element, facets)
    vectors = area_vectors(mesh.points[facets], dN) * weights[:, None]
    return x, N, vectors if kinematics != "axisymmetric" else vectors * (2.0 * np.pi * x[:, :, :1])


def quadrature_points(mesh: Mesh, element: str, cells: Numbers, kinematics: str) -> tuple[Array, Array, Array]:
    """Return positions (c, q, dim) [length], shape functions (q, n) [-] and volumes or areas (c, q) [length^dim].

    The values are those at the quadrature points of cells or facets, `cells` (c, n) of int. Volumes and areas include the
    weight of a point and, in axisymmetry, the circumference.
    """
    if elements.get(element).dim < mesh.dim:
        x, N, vectors = facet_points(mesh, element, cells, kinematics)
        return x, N, np.linalg.norm(vectors, axis=2)
    x, N, dN, weights = _quadrature(mesh, element, cells)
    return x, N, cell_volumes(mesh.points[cells], N, dN, kinematics == "axisymmetric") * weights


def add_forces(forces: Array, cells: Numbers, N: Array, point_forces: Array) -> None:
    """Distribute forces at quadrature points to the nodes with the shape functions, and add them to nodal `forces`, in place.

    `forces` (n_points, dim) [force] and `point_forces` (c, q, dim) [force] may also have another unit, the same for both.
    `cells` (c, n) of int contains the nodes of the cells, and `N` (q, n) [-] the shape functions.
    """
    np.add.at(forces, cells, np.einsum("qn,cqd->cnd", N, point_forces))
