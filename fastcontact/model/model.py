"""Model: a mesh with kinematics, materials, supports, loads and contact pairs; checked whole before any numerics.

A `Value` is a number, or a function from reference positions (n, dim) [length] to numbers (n,) [unit of the quantity].
"""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack

from fastcontact.contact.configuration import Configuration
from fastcontact.contact.default_formulation import against_obstacle, default_formulation
from fastcontact.contact.formulations import FORMULATIONS, Formulation
from fastcontact.contact.obstacles import MeshedSurface, Obstacle
from fastcontact.contact.obstacles.rigid_side import RigidSide
from fastcontact.contact.side_checks import check_obstacle, check_sides
from fastcontact.contact.surface import Surface, surface
from fastcontact.elasticity.constrained_system import ConstrainedMotion
from fastcontact.elasticity.inertia_loads import Centrifugal, Densities, Gravity, InertiaLoad
from fastcontact.elasticity.initial_states import InitialState, StressOffset, initial_state
from fastcontact.elasticity.loads import (
    BodyForce,
    Hydrostatic,
    Load,
    NodalForce,
    Pressure,
    TotalForce,
    Traction,
    Value,
    axes_of,
    check_number,
    check_value,
    evaluated,
)
from fastcontact.elasticity.material_axes import Axes
from fastcontact.elasticity.material_field import MaterialField, material_field
from fastcontact.elasticity.materials import KINEMATICS, Constant, Material
from fastcontact.elasticity.recovery import internal_force, stress_at_points
from fastcontact.elasticity.relations import Relation, stacked_rows
from fastcontact.elasticity.springs import Springs, grounded, joined, stacked
from fastcontact.elasticity.stiffness import stiffness
from fastcontact.elasticity.symmetry_axis import ON_AXIS, axis_nodes
from fastcontact.elasticity.temperature import Temperature, checked_value, histories
from fastcontact.elasticity.varying_constants import Cells
from fastcontact.errors import ContactError, ModelError, unknown
from fastcontact.mesh.argument_types import check_fields, typed
from fastcontact.mesh.files.paths import PathLike
from fastcontact.mesh.html_table import html_table
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.quality import check_cells
from fastcontact.model.checks import (
    check_forces,
    check_motions,
    check_overlap,
    check_penetration,
    check_ramps,
    check_supports,
)
from fastcontact.model.contact_pair import ContactPair, Driving, method
from fastcontact.model.couplings import Moment, coupling
from fastcontact.model.description import sentences
from fastcontact.model.force_driven_obstacles import ForceDrivenObstacles
from fastcontact.model.obstacle_rotation import check_turns, rotation_of
from fastcontact.model.pair_options import SHARED_OPTIONS, pair_options
from fastcontact.model.periodicity import Seam, cyclic, periodic
from fastcontact.model.prescribed_overlap import Supports, check_prescribed
from fastcontact.model.pretension import Pretension, PretensionForce, check_locks, pretension
from fastcontact.model.ramp import History, Ramp, Table, combined, multiplier, table_of
from fastcontact.model.relation_rows import NORMAL, along, directions_of, matched, normals_of
from fastcontact.model.repeated_pairs import check_repeated
from fastcontact.model.rigid_motions import free_motions, generalised, resisting, unstopped
from fastcontact.model.spread_forces import SpreadForce, spread_of
from fastcontact.model.temperature_files import read_temperatures

Array = NDArray[np.float64]
log = logging.getLogger("fastcontact")
# Formulations that need no facets on the primary side.
AGAINST_OBSTACLES = ("node_to_segment", "continuous")


@dataclass(frozen=True)
class Support:
    """A prescribed displacement component of all nodes of a group: `value` [length] times the ramp.

    `value` is a number or a function of position, `ramp` a history of its own or None.
    """

    group: str
    component: int
    value: Value
    ramp: Table | None = None

    @property
    def name(self) -> str:
        """What it is and where it acts, for messages."""
        return f"the displacement {'xyz'[self.component]} prescribed on '{self.group}'"


class Model:
    """An elastic contact problem.

    Methods check what they are given at once, and `check` the whole: a MeshError, ModelError or ContactError says in one
    line what is wrong and how to mend it. Prescribed values are numbers, or functions from reference positions (n, dim)
    [length] to numbers (n,). A `ramp` is a history of its own, as pairs (instant, multiplier) or a `Ramp`, whose table
    counts; without one the history is that of the analysis. Normals and areas are those of the reference configuration.

    Parameters
    ----------
    mesh : Mesh
    kinematics : str
        ``"axisymmetric"`` (x is the radius, y the axis, on which x is held at zero without a support),
        ``"plane_strain"``, ``"plane_stress"`` or ``"3d"``.
    case_text : str
        Text kept in result files beside the numbers, usually the case file.

    Examples
    --------
    >>> import fastcontact as fc
    >>> model = fc.Model(fc.generate.half_spheres(size=10.0), kinematics="axisymmetric")
    >>> model.add_material(fc.LinearElastic(E=20_000.0, nu=0.3))
    >>> model.fix("A1A2", "x")
    >>> model.prescribe("A2B2", y=-2.0)
    >>> model.prescribe("A1B1", y=+2.0)
    >>> model.add_contact("hertz", secondary="CONT1", primary="CONT2")
    """

    @typed(ModelError)
    def __init__(self, mesh: Mesh, kinematics: str, case_text: str = "") -> None:
        if kinematics not in KINEMATICS:
            raise ModelError(unknown("kinematics", kinematics, KINEMATICS))
        if (kinematics == "3d") != (mesh.dim == 3):
            fitting = ", ".join(f"'{name}'" for name in KINEMATICS if (name == "3d") == (mesh.dim == 3))
            raise ModelError(f"kinematics '{kinematics}' do not fit a mesh in {mesh.dim} dimensions: use {fitting}")
        if not mesh.solids:
            raise ModelError(f"the mesh has no solid cells, only {', '.join(mesh.cells) or 'points'}")
        check_cells(mesh)
        if kinematics == "axisymmetric":
            radius = mesh.points[:, 0].min()
            if radius < -1e-9 * np.abs(mesh.points).max():
                raise ModelError(
                    f"point {int(mesh.points[:, 0].argmin())} has the radius x = {radius:.6g} < 0: "
                    "an axisymmetric model lies at x >= 0, with y along the axis"
                )
        self.mesh = mesh
        self.kinematics = kinematics
        self.case_text = case_text
        self.units: dict[str, str] = {}  # names of the units of length, force, pressure where they are known
        self.materials: list[tuple[Material, tuple[str, ...] | None]] = []
        self.supports: list[Support] = []
        self.loads: list[Load] = []
        self.temperatures: list[Temperature] = []
        self.initial_states: list[InitialState] = []
        self.relations: list[Relation] = []
        self.springs: list[Springs] = []
        self.pretensions: list[Pretension] = []
        self.seams: list[Seam] = []  # nodes that are one place of a part that repeats itself
        self.contact: list[ContactPair] = []

    def __repr__(self) -> str:
        pairs = ", ".join(f"{p.name}: {p.secondary} on {p.opposite}, {p.method}" for p in self.contact)
        return f"Model({self.kinematics}, {self.mesh!r}, {self.n_dofs} degrees of freedom; contact: {pairs or 'none'})"

    def _repr_html_(self) -> str:
        """Return `describe` as a table for notebooks."""
        head, *parts = sentences(self)
        rows = [part.split(": ", 1) for part in parts if ": " in part]
        return html_table(rows, caption=head)

    def describe(self) -> str:
        """Return in words what will be solved: kinematics, materials, supports, loads, contact, a line each."""
        return "\n".join(sentences(self))

    @property
    def n_dofs(self) -> int:
        """Number of displacement components of all points."""
        return self.mesh.n_points * self.mesh.dim

    @typed(ModelError)
    def add_material(self, material: Material, groups: Sequence[str] | str | None = None) -> None:
        """Give a material to groups of solid cells, by default to all; groups override what was given to all before."""
        names = (groups,) if isinstance(groups, str) else groups if groups is None else tuple(groups)
        for name in names or ():
            if not self.mesh.cells_of(name, dim=self.mesh.dim):
                raise ModelError(f"group '{name}' holds no solid cells, so it cannot have a material")
        if not isinstance(material, Material):
            raise ModelError(
                f"{material!r} is no material: give LinearElastic(E=..., nu=...), Orthotropic(...) or Anisotropic(...)"
            )
        self.materials.append((material.bound(self._cells_of(names)), names))

    def _cells_of(self, groups: Sequence[str] | None) -> Cells:
        """Return the solid cells of groups, or all."""
        if groups is None:
            return Cells(self.mesh, {name: np.arange(len(block)) for name, block in self.mesh.solids.items()})
        found = self.mesh.split(np.unique(np.concatenate([self.mesh.cell_groups[name] for name in groups])))
        return Cells(self.mesh, {name: found[name] for name in self.mesh.solids if name in found})

    @typed(ModelError)
    def fix(self, group: str, components: str) -> None:
        """Hold displacement components (``"x"``, ``"y"``, ``"xy"``, in 3D also ``"z"``) of a group's nodes at zero.

        ``"normal"``: those along the normals of a group of facets.
        """
        if not components:
            raise ModelError(f"fix('{group}', ...) names no component: give for example 'x' or 'xy'")
        if components == NORMAL:
            self.prescribe(group, normal=0.0)
        else:
            self._support(group, dict.fromkeys(components, 0.0), None)

    @typed(ModelError)
    def prescribe(self, group: str, *, normal: Value | None = None, ramp: History = None, **components: Value) -> None:
        """Prescribe displacement components of all nodes of a group, e.g. ``y=-2.0`` [length], times the ramp.

        A component is a number, or a function from reference positions (n, dim) [length] to displacements (n,) [length].
        `normal` is the displacement out of the body along the mean normal of the facets at each node, for groups of facets.
        """
        if normal is not None:
            name = f"the displacement normal prescribed on '{group}'"
            check_value(name, normal)
            nodes, directions = normals_of(self.mesh, group)
            values = evaluated(normal, self.mesh.points[nodes], name)
            table = table_of(ramp, f"the ramp of {name}")
            self.relations.append(Relation(name, along(nodes, directions, self.n_dofs), values, table))
        if components or normal is None:
            self._support(group, components, ramp)

    def _support(self, group: str, components: Mapping[str, Value], ramp: History) -> None:
        if not len(self.mesh.points_of(group)):
            raise ModelError(f"group '{group}' is empty: no displacement can be prescribed on it")
        for axis, value in axes_of(f"prescribe('{group}')", components, self.mesh.dim).items():
            support = Support(
                group, axis, value, table_of(ramp, f"the ramp of the displacement prescribed on '{group}'")
            )
            check_value(support.name, value)
            self.supports.append(support)

    @typed(ModelError)
    def add_pressure(self, group: str, value: Value, *, ramp: History = None) -> None:
        """Press on a group of outer facets with `value` [pressure], positive along their normals into the body.

        It is a number, or a function from reference positions (n, dim) [length] to pressures (n,) [pressure].
        """
        self._add(Pressure(group, value, table_of(ramp, f"the ramp of the pressure on '{group}'")))

    @typed(ModelError)
    def add_traction(
        self,
        group: str,
        *,
        x: Value | None = None,
        y: Value | None = None,
        z: Value | None = None,
        ramp: History = None,
    ) -> None:
        """Load a group of facets with forces per reference area [pressure]; values as in `add_pressure`."""
        axes = axes_of(f"the traction on '{group}'", {"x": x, "y": y, "z": z}, self.mesh.dim)
        self._add(Traction(group, axes, table_of(ramp, f"the ramp of the traction on '{group}'")))

    @typed(ModelError)
    def add_body_force(
        self,
        groups: Sequence[str] | str | None = None,
        *,
        x: Value | None = None,
        y: Value | None = None,
        z: Value | None = None,
        ramp: History = None,
    ) -> None:
        """Load groups of solid cells, by default all, with forces per volume [force / length^3], such as the weight."""
        names = (groups,) if isinstance(groups, str) else groups if groups is None else tuple(groups)
        axes = axes_of("the body force", {"x": x, "y": y, "z": z}, self.mesh.dim)
        self._add(BodyForce(names, axes, table_of(ramp, "the ramp of the body force")))

    def add_gravity(
        self,
        groups: Sequence[str] | str | None = None,
        *,
        x: float | None = None,
        y: float | None = None,
        z: float | None = None,
        ramp: History = None,
    ) -> None:
        """Load groups of solid cells, by default all, with their weight: density times acceleration [length / time^2].

        The densities are those of the materials; units must fit, as do N, mm, MPa with tonnes, seconds and y=-9810.0.
        """
        names = (groups,) if isinstance(groups, str) else groups if groups is None else tuple(groups)
        axes = axes_of("gravity", {"x": x, "y": y, "z": z}, self.mesh.dim)
        self._add(Gravity(names, axes, table_of(ramp, "the ramp of gravity")))

    def add_centrifugal(
        self,
        speed: float,
        groups: Sequence[str] | str | None = None,
        *,
        origin: Sequence[float] = (0.0, 0.0, 0.0),
        direction: Sequence[float] | None = None,
        ramp: History = None,
    ) -> None:
        """Load groups of solid cells with the centrifugal force of a rotation, from the densities of the materials.

        Parameters
        ----------
        speed : float
            Angular speed [radian / time].
        groups : str or sequence of str, optional
            By default all solid cells.
        origin : sequence of 2 or 3 floats
            A point of the axis [length].
        direction : sequence of 3 floats, optional
            Along the axis, of any length [-]. By default (0, 0, 1), in axisymmetry the axis (0, 1, 0).
        ramp : Ramp or iterable of (float, float), optional
            History of the force, that is of the square of the speed.
        """
        names = (groups,) if isinstance(groups, str) else groups if groups is None else tuple(groups)
        if direction is None:
            direction = (0.0, 1.0, 0.0) if self.kinematics == "axisymmetric" else (0.0, 0.0, 1.0)
        place = (*origin, 0.0) if len(origin) == 2 else tuple(origin)
        if len(place) != 3 or len(direction) != 3:
            raise ModelError(
                f"the axis of the centrifugal force needs three components, not origin {origin} and direction {direction}"
            )
        table = table_of(ramp, "the ramp of the centrifugal force")
        self._add(Centrifugal(names, speed, place, tuple(direction), table))  # type: ignore[arg-type]

    def add_temperature(
        self,
        value: Value | Array,
        groups: Sequence[str] | str | None = None,
        *,
        reference: float = 0.0,
        times: Sequence[float] | None = None,
        ramp: History = None,
    ) -> None:
        """Heat or cool groups of solid cells, by default all; their materials expand by their `expansion`.

        Temperatures are those of the nodes: cells beside a group have a gradient where they share nodes with it. The rises of
        several add up.

        Parameters
        ----------
        value : float, callable or ndarray (n_points,) or (n_instants, n_points)
            A number, a function from reference positions (n, dim) [length] to temperatures (n,), one for each point of the
            mesh, or that at several instants [temperature].
        groups : str or sequence of str, optional
        reference : float
            At which there is no thermal strain [temperature].
        times : sequence of float (n_instants,), optional
            Load factors of the instants, between which temperatures follow linearly [-].
        ramp : Ramp or iterable of (float, float), optional
            History of the rise, value minus reference.
        """
        names = (groups,) if isinstance(groups, str) else groups if groups is None else tuple(groups)
        checked = checked_value(value)
        if times is not None:
            if ramp is not None:
                raise ModelError("a temperature has either times of its instants or a ramp, not both")
            if not isinstance(checked, np.ndarray) or checked.ndim != 2:
                raise ModelError("a temperature with times must be an array (n_instants, n_points)")
            found = histories(names, checked, reference, times)
        else:
            found = [Temperature(names, checked, reference, table_of(ramp, "the ramp of the temperature"))]
        for own in found:
            own.check(self.mesh)
        self.temperatures += found

    @typed(ModelError)
    def add_temperature_file(
        self,
        file: PathLike | Sequence[PathLike],
        field: str,
        groups: Sequence[str] | str | None = None,
        *,
        reference: float = 0.0,
        instant: float | None = None,
        times: Sequence[float] | None = None,
        ramp: History = None,
    ) -> None:
        """Heat or cool groups of solid cells, by default all, by a nodal field of a file, or of several files.

        Read are MED, VTKHDF, such as result files, and what meshio reads, such as .vtu. A file with the points of the mesh in
        their order gives the temperature of each; otherwise it is that of the point at the same place.

        Parameters
        ----------
        file : path-like or sequence of them
            One file, with one instant or several; or a file for each instant.
        field : str
            Its name.
        groups : str or sequence of str, optional
        reference : float
            At which there is no thermal strain [temperature].
        instant : float, optional
            Time of the file to take alone.
        times : sequence of float (n_instants,), optional
            Load factors of the instants [-]; by default the times of the file. Between them temperatures follow linearly.
        ramp : Ramp or iterable of (float, float), optional
            History of the rise of a single instant.

        Raises
        ------
        FileError, MeshError, ModelError
            If a file cannot be read or lacks the field, a point has no temperature, or instants and times do not fit.
        """
        names = (groups,) if isinstance(groups, str) else groups if groups is None else tuple(groups)
        for name in names or ():
            if not self.mesh.cells_of(name, dim=self.mesh.dim):
                raise ModelError(f"group '{name}' holds no solid cells: it has no temperature")
        values, own = read_temperatures(self.mesh, file, field, self._points_of_cells(names), instant)
        values = np.where(np.isfinite(values), values, reference)
        if len(values) == 1:
            if times is not None:
                raise ModelError(f"field '{field}' has one instant, so it has no times: give it a ramp")
            self.add_temperature(values[0], names, reference=reference, ramp=ramp)
            return
        if ramp is not None:
            raise ModelError(f"field '{field}' has {len(values)} instants and thus no ramp: give times, or one instant")
        when = times if own is None or times is not None else own.tolist()
        if when is None:
            raise ModelError(f"field '{field}' has {len(values)} instants without times: give the load factor of each")
        self.add_temperature(values, names, reference=reference, times=when)

    def _points_of_cells(self, groups: Sequence[str] | None) -> NDArray[np.intp]:
        """Return the points of the solid cells of groups, or of all."""
        cells = self._cells_of(groups)
        return np.unique(np.concatenate([self.mesh.cells[name][rows].ravel() for name, rows in cells.rows.items()]))

    @typed(ModelError)
    def add_initial_stress(
        self,
        groups: Sequence[str] | str | None = None,
        *,
        xx: Constant | None = None,
        yy: Constant | None = None,
        zz: Constant | None = None,
        xy: Constant | None = None,
        yz: Constant | None = None,
        xz: Constant | None = None,
        axes: Axes = None,
        ramp: History = None,
    ) -> None:
        """Give groups of solid cells, by default all, a stress that they have where nothing is displaced.

        What of it is not in balance deforms the bodies. In axisymmetry x, y, z are radius, axis and circumference.

        Parameters
        ----------
        groups : str or sequence of str, optional
        xx, yy, zz, xy, yz, xz : float, callable or ndarray (n,), optional
            Components, zero where not given; numbers, functions or arrays as E of `LinearElastic` [pressure].
        axes : sequence or callable, optional
            What they are along, as of `Orthotropic`: unit vectors in rows (3, 3) [-], or a function, taken at each place.
        ramp : Ramp or iterable of (float, float), optional
            History; by default the whole of it is there from the first step on.
        """
        given = {"xx": xx, "yy": yy, "zz": zz, "xy": xy, "yz": yz, "xz": xz}
        self._add_initial("stress", groups, given, axes, ramp)

    @typed(ModelError)
    def add_initial_strain(
        self,
        groups: Sequence[str] | str | None = None,
        *,
        xx: Constant | None = None,
        yy: Constant | None = None,
        zz: Constant | None = None,
        xy: Constant | None = None,
        yz: Constant | None = None,
        xz: Constant | None = None,
        axes: Axes = None,
        ramp: History = None,
    ) -> None:
        """Give groups of solid cells, by default all, a strain that costs no stress: shrinkage, swelling, misfit.

        Parameters
        ----------
        groups : str or sequence of str, optional
        xx, yy, zz, xy, yz, xz : float, callable or ndarray (n,), optional
            Components, as of `add_initial_stress`; xy, yz and xz are shears, twice those of the tensor [-].
        axes : sequence or callable, optional
            What they are along: unit vectors in rows (3, 3) [-], or a function.
        ramp : Ramp or iterable of (float, float), optional
            History; by default the whole of it is there from the first step on.
        """
        given = {"xx": xx, "yy": yy, "zz": zz, "xy": xy, "yz": yz, "xz": xz}
        self._add_initial("strain", groups, given, axes, ramp)

    def _add_initial(
        self, kind: str, groups: Sequence[str] | str | None, given: Mapping[str, Any], axes: Axes, ramp: History
    ) -> None:
        names = (groups,) if isinstance(groups, str) else groups if groups is None else tuple(groups)
        for name in names or ():
            if not self.mesh.cells_of(name, dim=self.mesh.dim):
                raise ModelError(f"group '{name}' holds no solid cells: it has no initial {kind}")
        table = table_of(ramp, f"the ramp of the initial {kind}")
        self.initial_states.append(
            initial_state(kind, names, self._cells_of(names), given, axes, self.kinematics, table)
        )

    def temperature_rise(self, factors: Sequence[float]) -> Array | None:
        """Return the rise of the temperature (n_points,) [temperature], None without temperatures.

        `factors` has a multiplier for each that was added, as ``step.iterations["temperature_factors"]`` of a step result.
        """
        if not self.temperatures or not len(factors):
            return None
        rises = [factor * own.rise(self.mesh) for factor, own in zip(factors, self.temperatures, strict=True)]
        return np.asarray(np.sum(rises, axis=0))

    def stress_offset(
        self, temperature_factors: Sequence[float] = (), initial_factors: Sequence[float] = (),
        field: MaterialField | None = None,
    ) -> StressOffset | None:  # fmt: skip
        """Return what stresses have beside those of the displacements, by temperatures and initial states; None without any.

        The factors are those of a step result, `StepResult.iterations`; `field` is the `material_field`, where it is known.
        """
        rise, states = self.temperature_rise(temperature_factors), []
        if len(initial_factors):
            states = list(zip(initial_factors, self.initial_states, strict=True))
        if rise is None and not states:
            return None
        return (field or self.material_field()).offset(rise, states, self.mesh.n_points)

    def thermal_forces_by_ramp(self) -> dict[Table | None, Array]:
        """Return by history the nodal forces (n_points, dim) at multiplier 1 by which temperatures load the cells [force].

        ModelError if a material that is heated has no expansion.
        """
        by_ramp: dict[Table | None, Array] = {}
        if not self.temperatures:
            return by_ramp
        field = self.material_field()
        for own in self.temperatures:
            rise = own.rise(self.mesh)
            missing = field.without_expansion(self.mesh, rise)
            if missing:
                raise ModelError(
                    f"{own.name} acts on {missing} solid cells whose material has no coefficient of thermal expansion: give "
                    "it expansion=..., 0.0 if it does not expand"
                )
            by_ramp[own.ramp] = by_ramp.get(own.ramp, 0.0) + self._forces_of(field, field.offset(rise))
        return by_ramp

    def initial_forces_by_ramp(self) -> dict[Table | None, Array]:
        """Return by history the nodal forces (n_points, dim) of initial stresses and strains at multiplier 1 [force]."""
        by_ramp: dict[Table | None, Array] = {}
        field = self.material_field() if self.initial_states else None
        for state in self.initial_states:
            assert field is not None
            forces = self._forces_of(field, field.offset(None, [(1.0, state)], self.mesh.n_points))
            by_ramp[state.ramp] = by_ramp.get(state.ramp, 0.0) + forces
        return by_ramp

    def _forces_of(self, field: MaterialField, offset: StressOffset | None) -> Array:
        """Return the nodal forces (n_points, dim) [force] of what stresses have beside those of the displacements."""
        held = stress_at_points(
            self.mesh,
            self.kinematics,
            field.moduli,
            field.loops,
            np.zeros(self.mesh.points.shape),
            field.treatment,
            offset,
        )
        return -internal_force(self.mesh, self.kinematics, held)

    @typed(ModelError)
    def add_force(
        self,
        group: str,
        *,
        x: float | None = None,
        y: float | None = None,
        z: float | None = None,
        distribute: bool | None = None,
        at: Sequence[float] | None = None,
        weighting: str = "uniform",
        radius: float | None = None,
        ramp: History = None,
    ) -> None:
        """Load a group with forces [force].

        Parameters
        ----------
        group : str
        x, y, z : float
            Components. In axisymmetry forces are those over the full circle; on facets a radial one is refused.
        distribute : bool, optional
            True: the total force, spread as a uniform traction over the facets of the group. False: the force on every
            node of the group. By default True for a group of facets and False for a group of points.
        at : sequence of float (dim,), optional
            Place through which the total force acts, spread over the group by area and distance from there, with the arms of
            the group for what moment is left [length].
        weighting : str
            Of the force spread about `at`: ``"uniform"``, or falling to zero at the radius as ``"linear"``, ``"quadratic"``
            or ``"cubic"`` functions of the distance.
        radius : float, optional
            Beyond which the group bears nothing [length]; by default the distance of its farthest node.
        ramp : Ramp or iterable of (float, float), optional
        """
        self.mesh.points_of(group)
        spread = spread_of(f"the force on '{group}'", at, weighting, radius)
        if spread is not None:
            if distribute is False:
                raise ModelError(
                    f"the force on '{group}' acts through a place or on every node: leave out at or distribute"
                )
            axes = axes_of(f"the force on '{group}'", {"x": x, "y": y, "z": z}, self.mesh.dim)
            self._add(SpreadForce(group, axes, spread, table_of(ramp, f"the ramp of the force on '{group}'")))  # type: ignore[arg-type]
            return
        if distribute is None:
            distribute = group in self.mesh.cell_groups and bool(self.mesh.cells_of(group, dim=self.mesh.dim - 1))
        kind: type[TotalForce] | type[NodalForce] = TotalForce if distribute else NodalForce
        axes = axes_of(f"the force on '{group}'", {"x": x, "y": y, "z": z}, self.mesh.dim)
        self._add(kind(group, axes, table_of(ramp, f"the ramp of the force on '{group}'")))

    @typed(ModelError)
    def add_pretension(
        self,
        name: str,
        section: str,
        *,
        force: float | None = None,
        shortening: float | None = None,
        locked_from: float | None = None,
        opposite: str | None = None,
        normal: Sequence[float] | None = None,
        ramp: History = None,
    ) -> None:
        """Tighten a bolt across a section through it: its sides approach each other along the bolt, without shear.

        The mesh is cut there, see `fastcontact.generate.cut`. Results are in ``step.pretension[name]``.

        Parameters
        ----------
        name : str
        section : str
            Group on one side of the cut.
        force : float, optional
            In the bolt, positive in tension [force]; in axisymmetry over the full circle.
        shortening : float, optional
            By how much the sides approach, instead of the force [length].
        locked_from : float, optional
            Instant, the end of a load step, from which the bolt keeps the length that the force has brought it to.
        opposite : str, optional
            Group on the other side, by default ``"<section> opposite"``.
        normal : sequence of float (dim,), optional
            Along the bolt [-]; by default across the plane of the nodes.
        ramp : Ramp or iterable of (float, float), optional
            History of the force or the shortening.

        Raises
        ------
        MeshError, ModelError
            If the sides do not lie upon each other, share points, or the numbers do not fit.
        """
        if name in {other.label for other in self.pretensions}:
            raise ModelError(f"there is already a pretension '{name}': names must differ")
        table = table_of(ramp, f"the ramp of pretension '{name}'")
        own = pretension(self.mesh, name, section, opposite, normal, (force, shortening, locked_from), table)
        self.pretensions.append(own)
        self.relations.extend(own.relations(self.n_dofs))
        if force is not None:
            self._add(PretensionForce(own))

    def _add(self, load: Load) -> None:
        load.check(self.mesh, self.kinematics)
        self.loads.append(load)

    @typed(ModelError)
    def couple(self, group: str, component: str) -> None:
        """Let all nodes of a group move together in one displacement component, or several (``"xy"``).

        ``"normal"``: by the same along the normals of a group of facets.
        """
        nodes = self.mesh.points_of(group)
        if len(nodes) < 2:
            raise ModelError(f"group '{group}' holds {len(nodes)} points: at least two are needed to couple")
        if component == NORMAL:
            rows = along(*normals_of(self.mesh, group), self.n_dofs)
            first = csr_array(vstack([rows[[0]]] * (rows.shape[0] - 1), format="csr"))
            self.relations.append(Relation(f"couple('{group}', 'normal')", csr_array(rows[1:] - first)))
            return
        for axis in axes_of(f"couple('{group}')", dict.fromkeys(component, 1.0), self.mesh.dim):
            m = len(nodes) - 1
            dofs = np.column_stack([np.full(m, nodes[0]), nodes[1:]]).astype(np.intp) * self.mesh.dim + axis
            rows = csr_array((np.tile([-1.0, 1.0], m), dofs.ravel(), 2 * np.arange(m + 1)), shape=(m, self.n_dofs))
            self.relations.append(Relation(f"couple('{group}', '{'xyz'[axis]}')", rows))

    @typed(ModelError)
    def relate_groups(
        self,
        first: str,
        second: str,
        component: str,
        *,
        coefficients: Sequence[float] = (1.0, -1.0),
        value: float = 0.0,
        translation: Sequence[float] | None = None,
        ramp: History = None,
    ) -> None:
        """Relate the displacements of every node of a group to those of the node of another group that lies upon it.

        By default both move together, as the two ends of a part that repeats itself do.

        Parameters
        ----------
        first, second : str
            Groups with equally many nodes.
        component : str
            ``"x"``, ``"xy"``, ... or ``"normal"``: along the outward normals of each group's own facets.
        coefficients : (float, float)
            ``coefficients[0] * u_first + coefficients[1] * u_second = value``.
        value : float
            Times the ramp [length times the unit of the coefficients].
        translation : sequence of float, optional
            What brings the first group upon the second; by default the way from middle to middle [length].
        ramp : Ramp or iterable of (float, float), optional
        """
        name = f"the relation of {component} of '{first}' and '{second}'"
        if len(coefficients) != 2:
            raise ModelError(f"{name} needs two coefficients, not {coefficients!r}")
        for number in (value, *coefficients):
            check_number(f"a number of {name}", number)
        if component != NORMAL:
            axes_of(name, dict.fromkeys(component, 1.0), self.mesh.dim)
        sides = [directions_of(self.mesh, group, component) for group in (first, second)]
        for (nodes, ours), (opposite, theirs) in zip(*sides, strict=True):
            place = matched(self.mesh, (first, nodes), (second, opposite), translation)
            rows = coefficients[0] * along(nodes, ours, self.n_dofs)
            rows = csr_array(rows + coefficients[1] * along(opposite[place], theirs[place], self.n_dofs))
            rows.eliminate_zeros()
            self.relations.append(
                Relation(name, rows[np.diff(rows.indptr) > 0], float(value), table_of(ramp, f"the ramp of {name}"))
            )

    @typed(ModelError)
    def add_periodicity(
        self,
        first: str,
        second: str,
        *,
        x: float = 0.0,
        y: float = 0.0,
        z: float = 0.0,
        free: str = "",
        translation: Sequence[float] | None = None,
        ramp: History = None,
    ) -> None:
        """Let the model be one period of a part that repeats itself: its two ends deform alike.

        Rigid translations stay free and need supports. Contact is best open at the ends: of two nodes that are one place
        only the sum of the forces follows from the gap, and pressures of their neighbours may waver.

        Parameters
        ----------
        first, second : str
            The ends: groups whose nodes lie upon each other after a translation.
        x, y, z : float
            How much farther the second end moves than the first, at multiplier 1: the mean strain times the period [length].
        free : str
            Components (``"x"``, ``"xy"``, ...) in which that is the same everywhere, but follows from the loads.
        translation : sequence of float (dim,), optional
            From the first end to the second one; by default from middle to middle [length].
        ramp : Ramp or iterable of (float, float), optional
            History of x, y, z.

        Raises
        ------
        MeshError, ModelError
            If there are no such groups, or their nodes do not lie upon each other; the largest distance is told.
        """
        name = f"the periodicity of '{first}' and '{second}'"
        given = {key: value for key, value in {"x": x, "y": y, "z": z}.items() if value != 0.0}
        for key, value in given.items():
            check_number(f"{key} of {name}", value)
        jump: Any = axes_of(name, given, self.mesh.dim) if given else {}
        loose = sorted(axes_of(name, dict.fromkeys(free, 1.0), self.mesh.dim)) if free else []
        if any(axis in jump for axis in loose):
            raise ModelError(f"{name}: '{free}' is free, so no displacement can be given there")
        relations, seam = periodic(
            self.mesh, (first, second), jump, loose, translation, table_of(ramp, f"the ramp of {name}")
        )
        self.relations.extend(relations)
        self.seams.append(seam)

    @typed(ModelError)
    def add_cyclic_symmetry(
        self,
        first: str,
        second: str,
        *,
        sectors: int,
        origin: Sequence[float] | None = None,
        direction: Sequence[float] = (0.0, 0.0, 1.0),
    ) -> None:
        """Let the model be one of equal sectors round an axis: its two ends deform alike, turned by the angle of a sector.

        Loads repeat themselves, too; forces are those of one sector. The rotation about the axis, and in space the way along
        it, stay free and need supports. Ends may be curved, and may meet on the axis. Contact at the ends: as in
        `add_periodicity`.

        Parameters
        ----------
        first, second : str
            The ends: groups whose nodes lie upon each other after the turn, either way.
        sectors : int
            How many make the whole.
        origin : sequence of float (dim,), optional
            A point of the axis, by default the origin [length].
        direction : sequence of float (3,)
            Along the axis [-]; in the plane always z.

        Raises
        ------
        MeshError, ModelError
            If there are no such groups, their nodes do not lie upon each other (the largest distance is told), or
            kinematics are axisymmetric.
        """
        name = f"the cyclic symmetry of '{first}' and '{second}'"
        if self.kinematics == "axisymmetric":
            raise ModelError(f"{name}: an axisymmetric model is the whole ring already")
        place = (0.0,) * self.mesh.dim if origin is None else tuple(origin)
        along = (0.0, 0.0, 1.0) if self.mesh.dim == 2 else tuple(direction)
        if sectors < 2 or len(place) != self.mesh.dim or len(along) != 3 or not any(along):
            raise ModelError(
                f"{name} needs two sectors at least, an origin of {self.mesh.dim} numbers and a direction of three, not "
                f"{sectors}, {place} and {along}"
            )
        relations, seam = cyclic(self.mesh, (first, second), sectors, place, along)
        self.relations.extend(relations)
        self.seams.append(seam)

    @typed(ModelError)
    def relate(
        self, terms: Iterable[tuple[str | int, str, float]], value: float = 0.0, *, ramp: History = None
    ) -> None:
        """Hold a linear combination of displacement components at `value` times the ramp.

        Parameters
        ----------
        terms : iterable of (str or int, str, float)
            Group or point number, component, coefficient. A group of several nodes stands for their sum; a long sum
            costs much, since it ties every displacement in it to every other.
        value : float
            [length times the unit of the coefficients].
        """
        row: dict[int, float] = {}
        listed = [(place, component, coefficient) for place, component, coefficient in terms]
        name = "the relation of " + ", ".join(f"{component} of '{place}'" for place, component, _ in listed)
        check_number(f"the value of {name}", value)
        for place, component, coefficient in listed:
            check_number(f"a coefficient of {name}", coefficient)
            (axis,) = axes_of(name, {component: coefficient}, self.mesh.dim)
            for node in self._nodes(place):
                dof = int(node) * self.mesh.dim + axis
                row[dof] = row.get(dof, 0.0) + float(coefficient)
        row = {dof: coefficient for dof, coefficient in row.items() if coefficient}
        if not row:
            raise ModelError("a relation needs at least one displacement with a coefficient other than zero")
        dofs = np.array(sorted(row), np.intp)
        values = np.array([row[dof] for dof in dofs])
        rows = csr_array((values, dofs, np.array([0, len(dofs)])), shape=(1, self.n_dofs))
        self.relations.append(Relation(name, rows, float(value), table_of(ramp, f"the ramp of {name}")))

    @typed(ModelError)
    def add_coupling(
        self,
        reference: str,
        group: str,
        *,
        kind: str = "rigid",
        components: str | None = None,
        weighting: str = "uniform",
        radius: float | None = None,
    ) -> None:
        """Couple a reference point with the nodes of a group, for small rotations.

        Forces, moments and supports at the reference point then act on the group; see
        `fastcontact.generate.with_reference_points`, `add_force` and `add_moment`.

        Parameters
        ----------
        reference : str
            Name of the reference point.
        group : str
        kind : str
            ``"rigid"``: all nodes follow the reference point and its rotation as one stiff body (RBE2).
            ``"distributing"``: it follows the mean motion of the group, by area where that is one of facets, and stiffens
            nothing (RBE3).
        components : str, optional
            Displacements that follow in a rigid coupling, such as ``"z"``; by default all.
        weighting : str
            Of a distributing coupling, by the distance from the reference point, as of `add_force`.
        radius : float, optional
            As of `add_force` [length].

        Raises
        ------
        MeshError, ModelError
            If there are no such groups, or kinematics are axisymmetric.
        """
        letters = "xyz"[: self.mesh.dim] if components is None else components
        axes = axes_of(f"the coupling of '{reference}'", dict.fromkeys(letters, 1.0), self.mesh.dim)
        self.relations.append(
            coupling(self.mesh, self.kinematics, (reference, group), kind, sorted(axes), (weighting, radius))
        )

    @typed(ModelError)
    def add_moment(
        self,
        group: str,
        *,
        x: float | None = None,
        y: float | None = None,
        z: float | None = None,
        ramp: History = None,
    ) -> None:
        """Load a reference point, or a group, with a moment [force times length]; in the plane about z.

        On a group of facets it is spread in proportion to area and distance from the middle, without a resultant force.
        """
        name = f"the moment on '{group}'"
        given = {"x": x, "y": y, "z": z}
        if self.mesh.dim == 2 and (x is not None or y is not None):
            raise ModelError(f"{name}: in the plane moments are about z")
        axes = axes_of(name, given, 3)
        self._add(Moment(group, axes, table_of(ramp, f"the ramp of {name}")))

    @typed(ModelError)
    def add_hydrostatic_pressure(
        self, group: str, *, weight: float, level: float, axis: str | None = None, ramp: History = None
    ) -> None:
        """Press on a group of outer facets as a liquid does: `weight` times the depth below its level.

        Parameters
        ----------
        group : str
        weight : float
            Of the liquid by volume [force / length^3].
        level : float
            Coordinate of its surface; above it nothing presses [length].
        axis : str, optional
            Along which the level is measured, upwards: by default the last one, y or z.
        ramp : Ramp or iterable of (float, float), optional
        """
        name = "xyz"[self.mesh.dim - 1] if axis is None else axis
        (along,) = axes_of(f"the hydrostatic pressure on '{group}'", {name: 1.0}, self.mesh.dim)
        for what, value in (("weight", weight), ("level", level)):
            check_number(f"the {what} of the hydrostatic pressure on '{group}'", value)
        self.add_pressure(group, Hydrostatic(float(weight), float(level), along), ramp=ramp)

    @typed(ModelError)
    def add_spring(
        self,
        group: str | int,
        to: str | int | None = None,
        *,
        x: float | None = None,
        y: float | None = None,
        z: float | None = None,
        axial: float | None = None,
        transverse: float | None = None,
        direction: Sequence[float] | None = None,
        translation: Sequence[float] | None = None,
    ) -> None:
        """Hang every node of a group on the ground by springs, or join two nodes or two groups by them.

        Parameters
        ----------
        group : str or int
            Group or point number.
        to : str or int, optional
            Group or point number: springs then join each node of `group` with the one of this group that lies upon it after a
            `translation`, as of `relate_groups`; a single node is joined with all of the other group.
        x, y, z : float
            Stiffness along the axes [force / length]; in axisymmetry over the full circle.
        axial, transverse : float
            Stiffness along the line between the two nodes, and along every direction across it [force / length]. The line
            keeps its reference direction.
        direction : sequence of float, optional
            Takes the place of the line between the two nodes: a vector of any length.
        translation : sequence of float (dim,), optional
            What brings the first group upon the second; by default the way from middle to middle [length].
        """
        name = f"the spring on '{group}'" if to is None else f"the spring between '{group}' and '{to}'"
        given = {"x": x, "y": y, "z": z}
        own = {"axial": axial, "transverse": transverse}
        along = {key: value for key, value in own.items() if value is not None}
        vector = self._direction(name, along, to is not None, direction)
        axes = {} if along and set(given.values()) == {None} else axes_of(name, given, self.mesh.dim)
        for value in [*axes.values(), *along.values()]:
            check_number(f"the stiffness of {name}", value)
            if not value > 0:
                raise ModelError(f"{name}: the stiffness {value:g} must be positive")
        nodes = self._nodes(group)
        if not len(nodes):
            raise ModelError(f"group '{group}' is empty: no spring can be there")
        if to is None:
            self.springs.append(grounded(name, nodes, axes, self.n_dofs, self.mesh.dim, along, vector))
            return
        opposite = self._nodes(to)
        if not len(opposite):
            raise ModelError(f"group '{to}' is empty: no spring can be there")
        if len(nodes) > 1 < len(opposite):
            place = matched(self.mesh, (str(group), nodes), (str(to), opposite), translation)
            opposite = opposite[place]
        elif translation is not None:
            raise ModelError(f"{name} joins all nodes with a single one: leave out the translation")
        first, second = np.broadcast_arrays(nodes, opposite)
        self.springs.append(joined(name, self.mesh.points, (first, second), axes, along, vector))

    def _direction(
        self, name: str, along: Mapping[str, float], joined: bool, direction: Sequence[float] | None
    ) -> Array | None:
        """Return the unit vector (dim,) along which a spring is axial; None for the line between its nodes, or for none."""
        if direction is None:
            if along and not joined:
                raise ModelError(
                    f"{name} has an axial or transverse stiffness but no second node: name it by `to`, give a direction, "
                    "or x, y or z"
                )
            return None
        if not along:
            raise ModelError(f"{name} has a direction, but no axial or transverse stiffness that would use it")
        vector = np.asarray(direction, float)
        length = np.linalg.norm(vector)
        if vector.shape != (self.mesh.dim,) or not (np.isfinite(length) and length > 0):
            raise ModelError(
                f"the direction {direction} of {name} must be a vector of {self.mesh.dim} numbers, not all zero"
            )
        return np.asarray(vector / length)

    def holding_rows(self) -> csr_array:
        """Return the rows (m, n_dofs) [unit of the caller] of relations and springs; their product with free motions is 0."""
        relations = stacked_rows(self.relations, self.n_dofs)
        return csr_array(vstack([relations, stacked(self.springs, self.n_dofs)], format="csr"))

    def _nodes(self, place: str | int) -> NDArray[Any]:
        if isinstance(place, str):
            return self.mesh.points_of(place)
        if not 0 <= place < self.mesh.n_points:
            raise ModelError(f"point {place} is not in the mesh of {self.mesh.n_points} points (numbers from 0)")
        return np.array([place])

    @typed(ModelError)
    def add_contact(
        self, name: str, *, secondary: str, primary: str, formulation: str | None = None, **options: Any
    ) -> None:
        """Let the facets of group `secondary` come into contact with those of group `primary`.

        Parameters
        ----------
        name : str
            Name of the pair in the results.
        secondary, primary : str
            The side whose nodes or integration points are projected and carry the constraints, and the side
            projected upon. Facets are oriented from the solid behind them.
        formulation : str, optional
            ``"node_to_segment"``, ``"continuous"`` or ``"mortar"``. By default mortar with dual multipliers, which is right
            on any two surfaces; ``repr(model)`` and the log tell it.
        **options
            What every formulation takes, in addition to the fields of the formulation itself:

            - ``friction``: coefficient of Coulomb friction.
            - ``kind``: ``"unilateral"`` (default) contact closes and opens. ``"bilateral"`` closes every gap that faces
              the other side from the beginning and never opens, but slides without friction. In
              ``"bilateral_once_closed"`` what is closed at the end of a load step never opens again. ``"tied"`` neither
              opens nor slides: the two sides are paired once, as they lie, and their relative displacement stays zero,
              also across initial gaps, which are kept (a rotation then strains by its angle times the gap).
              ``"gap_only"`` watches the gaps, negative where the sides penetrate, and has no forces.
            - ``clearance``: added to the gap, a number or a function from reference positions (n, dim) on the secondary
              side to lengths (n,); positive opens the gap, negative is an interference, as of a press fit [length].
              ``clearance_primary``: the same on the primary side, at the positions faced. ``clearance_ramp``: their
              history, as pairs (instant, multiplier); without one they are there from the beginning.
            - ``excluded``: groups whose nodes carry no contact. Where the formulation has integration points, those
              nearer to such a node than to any other take no part. The two sides may share such nodes. ``frictionless``:
              groups whose nodes carry no friction, likewise.
            - ``penalty``: pressure by penetration [pressure / length], instead of none at all; results tell the
              penetration. It does not soften friction; ``tangential_penalty`` does: shear by slip of what sticks, a number
              or a function of the secondary position [pressure / length].
            - ``slip``: ``"symmetric"`` (default): closing a gap along the mean of both sides' normals is no slip;
              ``"primary"``: all relative motion along the tangents to the primary side is, as in code_aster.
            - ``wear``: Archard's coefficient by hardness: ``coefficient * pressure * slip`` is worn off the secondary side in
              each load step, and the next one begins with it; depths are in the results [1 / pressure].
            - ``search_distance``: what is farther off than this, or deeper inside, now and as the load step begins, is not
              faced [length].
            - ``normals``: ``"facet"`` or ``"averaged"`` between the facets that meet at a node at less than 45 degrees, which
              curved sides that fit closely need; ``"secondary"``: those of the secondary side; a vector out of the primary
              side's body: one normal for all of it. ``projection_tolerance``: how far points may stand out beyond the end of
              the primary side and still carry force, in facet lengths.
        """
        if formulation is None:
            formulation, options, reason = default_formulation(self.mesh.dim, options)
            log.info("contact '%s': %s, since %s", name, method(formulation, options), reason)
        self._add_pair(ContactPair(name, secondary, primary, formulation, options))

    @typed(ModelError)
    def add_obstacle(
        self,
        name: str,
        *,
        secondary: str,
        obstacle: Obstacle,
        motion: Mapping[str, float] | None = None,
        force: Mapping[str, float] | None = None,
        rotation: Mapping[str, Any] | None = None,
        ramp: History = None,
        formulation: str | None = None,
        **options: Any,
    ) -> None:
        """Let the facets of group `secondary` come into contact with a rigid obstacle.

        Parameters
        ----------
        name, secondary
            As in `add_contact`.
        obstacle : Obstacle
            A shape of `fastcontact.obstacles`, or any object with their ``distance`` method.
        motion : mapping of str to float, optional
            Its displacement at multiplier 1, e.g. ``{"y": -0.1}`` [length]; it stands still without.
        force : mapping of str to float, optional
            The force on it at multiplier 1, e.g. ``{"y": -100.0}`` [force], in axisymmetry over the full circle. In
            these components the obstacle is a rigid body that moves freely until contact holds it; in the others it
            follows `motion`. Results tell where it is.
        rotation : mapping, optional
            How it turns: ``angle`` at multiplier 1 [radian]; ``centre``, a point of the axis (dim,) before any motion, with
            which it moves [length]; in space ``axis``, the direction; ``ramp``, a history of its own. Results tell the torque
            on the obstacle's axis. Not in axisymmetry.
        ramp : Ramp or iterable of (float, float), optional
            History of motion and force, and of a rotation without one of its own.
        formulation : str, optional
            ``"node_to_segment"`` (then: node against obstacle), by default on linear triangles and, in space, on
            facets whose nodes all carry pressure (tri3, quad4, quad9), or ``"continuous"``, by default on all others.
        **options
            Fields of the formulation.
        """
        moves = axes_of(f"the motion of obstacle '{name}'", dict(motion), self.mesh.dim) if motion else {}
        displacement = tuple(float(moves.get(axis, 0.0)) for axis in range(self.mesh.dim))  # type: ignore[arg-type]
        if not np.isfinite(displacement).all():
            raise ModelError(f"the motion {motion} of obstacle '{name}' must be finite numbers")
        if isinstance(obstacle, MeshedSurface):
            obstacle.check_apart(self.mesh)
        obstacle.distance(self.mesh.points[:1])  # what does not fit this dimension shows at once
        history = table_of(ramp, f"the ramp of the motion of obstacle '{name}'")
        if formulation is None:
            formulation, reason = against_obstacle(self.mesh.dim, *self._facet_kinds(secondary), options)
            log.info("contact '%s': %s, since %s", name, method(formulation, options), reason)
        driving = self._driving(name, moves, force)
        turned = (None, None) if rotation is None else rotation_of(name, rotation, self.kinematics)
        self._add_pair(
            ContactPair(name, secondary, "", formulation, options, obstacle, displacement, history, driving, *turned)
        )

    def _facet_kinds(self, group: str) -> tuple[list[str], bool]:
        """Return the kinds of facets of a group, and whether linear triangles or tetrahedra alone have them."""
        facets = self.mesh.cells_of(group, self.mesh.dim - 1) if group in self.mesh.cell_groups else {}
        if not facets:  # which `check` tells
            return [], False
        simplices = [block for name, block in self.mesh.solids.items() if name in ("tri3", "tet4")]
        theirs = any(np.isin(self.mesh.points_of(group), block).all() for block in simplices)
        return list(facets), theirs

    def _driving(self, name: str, moves: Mapping[int, Value], force: Mapping[str, float] | None) -> Driving:
        """Return the force on obstacle `name` by component, None for prescribed ones; empty without any."""
        if not force:
            return ()
        forces = axes_of(f"the force on obstacle '{name}'", dict(force), self.mesh.dim)
        for axis, value in forces.items():
            check_number(f"the force {'xyz'[axis]} on obstacle '{name}'", value)
            if axis in moves:
                raise ModelError(
                    f"obstacle '{name}' is both moved and pushed along {'xyz'[axis]}: name this component either in its "
                    "motion or in its force"
                )
            if axis == 0 and self.kinematics == "axisymmetric":
                raise ModelError(
                    f"a force cannot move obstacle '{name}' along x, the radius: in axisymmetry give y only"
                )
        return tuple(float(forces[k]) if k in forces else None for k in range(self.mesh.dim))  # type: ignore[arg-type]

    @property
    def force_driven(self) -> ForceDrivenObstacles:
        """The rigid obstacles that forces drive."""
        return ForceDrivenObstacles([pair for pair in self.contact if pair.force], (self.mesh.n_points, self.mesh.dim))

    def _add_pair(self, pair: ContactPair) -> None:
        if pair.name in {other.name for other in self.contact}:
            raise ContactError(f"there is already a contact pair '{pair.name}': names must differ")
        bound = self.bind(pair)
        if isinstance(bound.primary, RigidSide):
            check_obstacle(self.mesh, pair.name, bound.secondary, bound.primary)
        for other in self.contact:
            check_repeated(self.mesh, pair, other)
        self.contact.append(pair)

    def bind(self, pair: ContactPair, supported: NDArray[np.bool_] | None = None) -> Formulation:
        """Return the formulation of a contact pair on this mesh; see `add_contact` for the errors.

        `supported` (n_points, dim) are the displacement components that supports prescribe, where they are known.
        """
        if pair.formulation not in FORMULATIONS:
            raise ContactError(unknown("contact formulation", pair.formulation, FORMULATIONS))
        kind = FORMULATIONS[pair.formulation].variant(self.mesh.dim, pair.options)
        given = ("secondary", "primary", "points", "axisymmetric", "modulus", "options", "supported")
        known = [*SHARED_OPTIONS, *(f.name for f in dataclasses.fields(kind) if f.init and f.name not in given)]
        for option in pair.options:
            if option not in known:
                raise ContactError(unknown(f"option of {pair.formulation}", option, known))
        own = {key: value for key, value in pair.options.items() if key not in SHARED_OPTIONS}
        check_fields(f"contact '{pair.name}'", own, kind, ContactError)
        secondary = surface(self.mesh, pair.secondary)
        options = pair_options(
            pair.name, pair.options, self.mesh, secondary, against_obstacle=pair.obstacle is not None
        )
        primary: Surface | RigidSide
        if pair.obstacle is not None:
            if pair.formulation not in AGAINST_OBSTACLES:
                raise ContactError(
                    unknown("contact formulation for a rigid obstacle", pair.formulation, AGAINST_OBSTACLES)
                )
            primary = RigidSide(pair.obstacle, np.array(pair.motion), pair.rotation)
        else:
            primary = surface(self.mesh, pair.primary)
            check_sides(self.mesh, pair.name, secondary, primary, options.excluded)
        modulus = min((m.contact_modulus for m, _ in self.materials), default=1.0)
        axisymmetric = self.kinematics == "axisymmetric"
        return kind(
            secondary, primary, self.mesh.points, axisymmetric, modulus, options=options, supported=supported, **own
        )

    def material_numbers(self) -> tuple[Array, dict[str, NDArray[np.int32]]]:
        """Return moduli (n_moduli, 4, 4), in 3D (n_moduli, 6, 6) [pressure], and by element every solid cell's number there.

        The first are those of the materials; materials that vary have further ones, for the middle of each cell.
        """
        field = self.material_field()
        return field.moduli, field.rows

    def material_field(self) -> MaterialField:
        """Return the materials of all solid cells; ModelError if a cell has none, or two."""
        return material_field(
            self.mesh, self.kinematics, [material for material, _ in self.materials], self._material_of_cells()
        )

    def _material_of_cells(self) -> dict[str, NDArray[np.int32]]:
        """Return by element every solid cell's material (n_cells,)."""
        if not self.materials:
            raise ModelError("no material: call add_material(LinearElastic(E=..., nu=...)) for the solid cells")
        numbers = {name: np.full(len(block), -1, np.int32) for name, block in self.mesh.solids.items()}
        for index, (_, groups) in enumerate(self.materials):
            for name in numbers if groups is None else ():
                self._check_material(index, None, numbers[name])
                numbers[name][:] = index
            for group in groups or ():
                for name, rows in self.mesh.split(self.mesh.cell_groups[group]).items():
                    if name in numbers:
                        self._check_material(index, group, numbers[name][rows])
                        numbers[name][rows] = index
        self._check_all_have_material(numbers)
        return numbers

    def averaged_materials(self) -> NDArray[np.bool_]:
        """Return which moduli (n_moduli,) have a mean dilatation; none in plane stress, where none locks."""
        return self.material_field().averaged

    def _check_material(self, index: int, group: str | None, given: NDArray[np.int32]) -> None:
        """Refuse a material for cells that have another one already, which was not given to all cells."""
        new = self.materials[index][0]
        for number in np.unique(given[given >= 0]):
            old, groups = self.materials[number]
            if old != new and (groups is not None or group is None):
                raise ModelError(
                    f"{int((given == number).sum())} cells of {'the mesh' if group is None else repr(group)} have two "
                    f"materials, {old.described} and {new.described}: give each group one; "
                    "one for all other cells comes first, without groups"
                )

    def _check_all_have_material(self, numbers: dict[str, NDArray[np.int32]]) -> None:
        without = {name: np.flatnonzero(values < 0) for name, values in numbers.items()}
        total = sum(map(len, without.values()))
        if not total:
            return
        offsets = self.mesh.offsets
        cells = np.concatenate([rows + offsets[name] for name, rows in without.items()])
        groups = [g for g, members in self.mesh.cell_groups.items() if np.isin(members, cells).any()]
        named = f", in {', '.join(repr(g) for g in groups)}" if groups else ""
        raise ModelError(f"{total} solid cells have no material{named}: add_material for their groups")

    @typed(ModelError)
    def internal_forces(self, displacement: Array) -> Array:
        """Return the nodal forces (n_points, dim) [force] that hold the solid cells deformed by `displacement`.

        They are in balance with loads, contact, supports, relations, springs and the forces of heat and initial states
        (`thermal_forces_by_ramp`, `initial_forces_by_ramp`); axisymmetric: over the full circle.

        Parameters
        ----------
        displacement : ndarray (n_points, dim)
            Of a step result [length].
        """
        field = self.material_field()
        if np.size(displacement) != self.n_dofs:
            raise ModelError(
                f"the displacement has the shape {np.shape(displacement)}, but the mesh {self.mesh.points.shape}"
            )
        K = stiffness(self.mesh, self.kinematics, field.moduli, field.loops, None, field.treatment)
        return np.asarray(K @ np.ravel(displacement)).reshape(-1, self.mesh.dim)

    def prescribed(self) -> tuple[NDArray[np.bool_], Array]:
        """Return (fixed, values), both (n_points, dim): supported components, and their displacement at ramp value 1."""
        fixed, by_ramp = self.prescribed_by_ramp()
        return fixed, sum(by_ramp.values(), np.zeros(self.mesh.points.shape))

    def prescribed_by_ramp(self) -> tuple[NDArray[np.bool_], dict[Table | None, Array]]:
        """Return supported components (n_points, dim), and by history their displacement at multiplier 1 [length]."""
        fixed = np.zeros(self.mesh.points.shape, bool)
        by_ramp: dict[Table | None, Array] = {}
        owner: dict[tuple[int, int], Support] = {}
        for support in self.supports:
            nodes, k = self.mesh.points_of(support.group), support.component
            values = evaluated(support.value, self.mesh.points[nodes], support.name)
            for node, value in zip(nodes[fixed[nodes, k]], values[fixed[nodes, k]], strict=True):
                other = owner[int(node), k]
                found = by_ramp[other.ramp][node, k]
                if found != value or (other.ramp != support.ramp and value != 0.0):
                    raise ModelError(
                        f"'{support.group}' prescribes {'xyz'[k]} = {value:g} at point {node}, but "
                        f"'{other.group}' prescribes {found:g} there"
                        f"{' with another ramp' if found == value else ''}: remove one of the two"
                    )
            new = ~fixed[nodes, k]
            total = by_ramp.setdefault(support.ramp, np.zeros(self.mesh.points.shape))
            fixed[nodes, k], total[nodes[new], k] = True, values[new]
            owner.update({(int(node), k): support for node in nodes[new]})
        self._hold_axis(fixed, by_ramp)
        return fixed, by_ramp

    def _hold_axis(self, fixed: NDArray[np.bool_], by_ramp: Mapping[Table | None, Array]) -> None:
        """Add the symmetry at the axis of an axisymmetric model to the supports, and refuse those that contradict it."""
        axis = self.axis_nodes
        for values in by_ramp.values():
            off = axis[np.abs(values[axis, 0]) > ON_AXIS * np.abs(values).max()]
            if len(off):
                raise ModelError(
                    f"x = {values[off[0], 0]:g} is prescribed at point {off[0]} on the axis of symmetry, where the radial "
                    "displacement is zero: leave the points at x = 0 out of the group"
                )
            values[axis, 0] = 0.0
        fixed[axis, 0] = True

    @property
    def axis_nodes(self) -> NDArray[np.intp]:
        """Nodes (k,) on the axis of an axisymmetric model, where x is held at zero without any support; none in others."""
        return axis_nodes(self.mesh) if self.kinematics == "axisymmetric" else np.empty(0, np.intp)

    def forces_by_ramp(self) -> dict[Table | None, Array]:
        """Return by history the nodal forces (n_points, dim) of all loads at multiplier 1 [force]."""
        related = self._related()
        by_ramp: dict[Table | None, Array] = {}
        for load in self.loads:
            forces = self.load_vector(load)
            check_forces(self.mesh, forces, related, load.name)
            by_ramp[load.ramp] = by_ramp.get(load.ramp, 0.0) + forces
        return by_ramp

    def load_vector(self, load: Load) -> Array:
        """Return the nodal forces (n_points, dim) of a load at multiplier 1 [force]."""
        density = None
        if isinstance(load, InertiaLoad):
            density = Densities([m for m, _ in self.materials], self._material_of_cells())
        return load.vector(self.mesh, self.kinematics, density)

    def _related(self) -> NDArray[np.bool_]:
        """Return which points (n_points,) relations and springs hold."""
        related = np.zeros(self.mesh.n_points, bool)
        related[self.holding_rows().indices // self.mesh.dim] = True
        return related

    @typed(ModelError)
    def check(self, ramp: Ramp | None = None) -> None:
        """Check the whole model, and its histories against `ramp`; `solve` does so before any numerics."""
        self.material_numbers()
        fixed, prescribed = self.prescribed_by_ramp()
        self._tell_axis()
        forces = self.forces_by_ramp()
        self.thermal_forces_by_ramp()
        if ramp is not None:
            items: list[Support | Load | Relation | Temperature | InitialState] = [
                *self.supports, *self.loads, *self.relations, *self.temperatures, *self.initial_states
            ]  # fmt: skip
            named = [(item.name, item.ramp) for item in items]
            named += [(f"the motion of obstacle '{p.name}'", p.ramp) for p in self.contact]
            named += [(f"the clearance of contact '{p.name}'", p.clearance_ramp) for p in self.contact]
            named += [(f"the rotation of obstacle '{p.name}'", p.rotation_ramp) for p in self.contact]
            check_ramps(named, ramp.instants)
            check_turns(self.contact, ramp)
            check_locks(self.pretensions, ramp.instants)
        self._check_relations(fixed, prescribed, ramp or Ramp((1.0,)))
        check_supports(self.mesh, [(s.name, s.group) for s in self.supports], self._related())
        bound = [(pair, self.bind(pair)) for pair in self.contact]
        for pair, formulation in bound:
            check_penetration(pair.name, formulation)
        check_prescribed(bound, Supports(fixed, prescribed, ramp or Ramp((1.0,))))
        check_overlap(
            self.mesh, self.kinematics, [(p.secondary, p.primary) for p in self.contact if p.obstacle is None]
        )
        self._check_motions(fixed, list(self.force_driven.forces(forces).values()))

    def _tell_axis(self) -> None:
        """Log what is held on the axis although no support names it."""
        named = [self.mesh.points_of(support.group) for support in self.supports if support.component == 0]
        held = np.setdiff1d(self.axis_nodes, np.concatenate(named)) if named else self.axis_nodes
        if len(held):
            log.info("axis of symmetry: x is held at zero at %d nodes with x = 0 (first: point %d)", len(held), held[0])

    def _check_relations(self, fixed: NDArray[np.bool_], prescribed: Mapping[Table | None, Array], ramp: Ramp) -> None:
        if not self.relations:
            return
        motion = ConstrainedMotion(fixed.ravel(), self.relations)
        for instant in ramp.instants:
            lift = combined(prescribed, ramp, instant, fixed.shape)
            motion.lift(lift.ravel(), motion.values([multiplier(r.ramp, ramp, instant) for r in self.relations]))

    def _check_motions(self, fixed: NDArray[np.bool_], forces: Sequence[Array]) -> None:
        """Refuse motions without deformation that no supports, relations, springs or loads against a contact stop."""
        driven = self.force_driven
        motions = driven.motions(free_motions(self.mesh, self.kinematics, fixed, self.holding_rows()))
        if not len(motions):
            return
        at_rest, still = Configuration.undeformed(self.mesh.points), np.zeros(self.mesh.dim)
        parts = [driven.constraints(pair.name, self.bind(pair).constraints(at_rest), still) for pair in self.contact]
        rows = [resisting(part)[0] @ motions.displacement for part in parts]
        works = [generalised(motions, force.ravel()) for force in forces]
        k = len(motions)
        gaps, driven_by = np.vstack([*rows, np.empty((0, k))]), np.vstack([*works, np.empty((0, k))])
        check_motions(self.mesh, motions.combined(unstopped(gaps, driven_by)))
