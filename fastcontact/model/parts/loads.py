"""The loads of a model: forces on surfaces, volumes and points.

A `Value` is a number, or a function from reference positions (n, dim) [length] to numbers (n,) [unit of the quantity].
"""

from __future__ import annotations

from collections.abc import Sequence

from fastcontact._tools.argument_types import typed
from fastcontact.arrays import Array
from fastcontact.elasticity import loads
from fastcontact.elasticity.following_loads import FollowerCentrifugal, FollowerLoad, FollowerPressure
from fastcontact.elasticity.inertia_loads import Centrifugal, Densities, Gravity, InertiaLoad
from fastcontact.elasticity.loads import Load, Pressure, Value, axis_values, check_number
from fastcontact.errors import ModelError
from fastcontact.model.checks import check_forces
from fastcontact.model.couplings import Moment, Spread, SpreadForce
from fastcontact.model.parts.base import Groups, group_names
from fastcontact.model.parts.heat import ModelHeat
from fastcontact.model.ramp import History, Table, sums_by_ramp, table_of


@typed(ModelError)
class ModelLoads(ModelHeat):
    """A model with loads."""

    def add_pressure(self, group: str, value: Value, *, ramp: History = None) -> None:
        """Apply a pressure to a group of outer facets.

        Parameters
        ----------
        group : str
        value : float or callable
            Pressure at multiplier 1, positive in compression, that is along the inward normal: a number, or a function from
            reference positions (n, dim) [length] to pressures (n,) [pressure]. In finite strain the pressure follows the
            deformed surface.
        ramp : Ramp or iterable of (float, float), optional
            History of the pressure; by default that of the analysis.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.add_pressure("TOP", 2.0)
        >>> model.add_pressure("RIGHT", lambda points: 10.0 * (1.0 - points[:, 1]))
        """
        self._add(Pressure(group, value, table_of(ramp, f"the ramp of the pressure on '{group}'")))

    def add_traction(self, group: str, *, ramp: History = None, **components: Value | None) -> None:
        """Apply a traction, that is a force per unit reference area, to a group of facets.

        Parameters
        ----------
        group : str
        ramp : Ramp or iterable of (float, float), optional
            History of the traction; by default that of the analysis.
        **components : float or callable
            Components ``x``, ``y`` and ``z`` of the traction at multiplier 1: numbers, or functions from reference positions
            (n, dim) [length] to tractions (n,) [pressure].

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.add_traction("TOP", x=1.0, y=-5.0)
        """
        axes = axis_values(f"the traction on '{group}'", components, self.mesh.dim)
        self._add(loads.Traction(group, axes, table_of(ramp, f"the ramp of the traction on '{group}'")))

    def add_body_force(self, groups: Groups = None, *, ramp: History = None, **components: Value | None) -> None:
        """Apply a body force to groups of solid cells.

        Parameters
        ----------
        groups : str or sequence of str, optional
            Groups of solid cells; by default all solid cells.
        ramp : Ramp or iterable of (float, float), optional
            History of the force; by default that of the analysis.
        **components : float or callable
            Components ``x``, ``y`` and ``z`` of the force per unit volume at multiplier 1: numbers, or functions from
            reference positions (n, dim) [length] to numbers (n,) [force / length^3].

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.add_body_force(y=-7.7e-5)
        >>> model.add_body_force("BLOCK", x=lambda points: 1e-6 * points[:, 0])
        """
        names = group_names(groups)
        axes = axis_values("the body force", components, self.mesh.dim)
        self._add(loads.BodyForce(names, axes, table_of(ramp, "the ramp of the body force")))

    def add_gravity(self, groups: Groups = None, *, ramp: History = None, **components: float | None) -> None:
        """Apply the weight of groups of solid cells, computed from the densities of their materials.

        Parameters
        ----------
        groups : str or sequence of str, optional
            Groups of solid cells; by default all solid cells.
        ramp : Ramp or iterable of (float, float), optional
            History of the acceleration; by default that of the analysis.
        **components : float
            Components ``x``, ``y`` and ``z`` of the gravitational acceleration at multiplier 1, in units consistent with the
            other quantities: for example -9810 with N, mm, MPa, tonnes and seconds [length / time^2].

        Examples
        --------
        Weight of a steel block in mm, tonnes and seconds, so that forces are in N:

        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.add_material(fc.LinearElastic(E=210_000.0, nu=0.3, density=7.85e-9))
        >>> model.add_gravity(y=-9810.0)
        """
        names = group_names(groups)
        axes = axis_values("gravity", components, self.mesh.dim)
        self._add(Gravity(names, axes, table_of(ramp, "the ramp of gravity")))

    def add_centrifugal(
        self,
        speed: float,
        groups: Groups = None,
        *,
        origin: Sequence[float] = (0.0, 0.0, 0.0),
        direction: Sequence[float] | None = None,
        ramp: History = None,
    ) -> None:
        """Apply centrifugal forces to groups of solid cells, computed from the densities of their materials.

        In finite strain, the forces are proportional to the distances of the deformed positions from the axis.

        Parameters
        ----------
        speed : float
            Angular speed [radian / time].
        groups : str or sequence of str, optional
            Groups of solid cells; by default all solid cells.
        origin : sequence of 2 or 3 floats
            A point on the axis of rotation [length].
        direction : sequence of 3 floats, optional
            Vector of any length along the axis of rotation [-]; by default (0, 0, 1), and (0, 1, 0) in axisymmetry.
        ramp : Ramp or iterable of (float, float), optional
            History of the force; by default that of the analysis. The force is proportional to the square of the speed.

        Examples
        --------
        A ring at 6000 revolutions per minute:

        >>> import math
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.rings(), kinematics="plane_strain")
        >>> model.add_material(fc.LinearElastic(E=210_000.0, nu=0.3, density=7.85e-9))
        >>> model.add_centrifugal(6000.0 / 60.0 * 2.0 * math.pi)
        """
        names = group_names(groups)
        if direction is None:
            direction = (0.0, 1.0, 0.0) if self.kinematics == "axisymmetric" else (0.0, 0.0, 1.0)
        origin_in_space = (*origin, 0.0) if len(origin) == 2 else tuple(origin)
        if len(origin_in_space) != 3 or len(direction) != 3:
            raise ModelError(
                f"the axis of the centrifugal force needs three components, not origin {origin} and direction {direction}"
            )
        table = table_of(ramp, "the ramp of the centrifugal force")
        self._add(Centrifugal(names, speed, origin_in_space, tuple(direction), table))  # type: ignore[arg-type]

    def add_hydrostatic_pressure(
        self, group: str, *, weight: float, level: float, axis: str | None = None, ramp: History = None
    ) -> None:
        """Apply the pressure of a liquid at rest to a group of outer facets.

        The pressure is `weight` times the depth below the free surface, and zero above it. In finite strain, the depth is
        that of the undeformed position.

        Parameters
        ----------
        group : str
        weight : float
            Weight of the liquid per unit volume [force / length^3].
        level : float
            Coordinate of the free surface along `axis` [length].
        axis : str, optional
            Vertical axis, ``"x"``, ``"y"`` or ``"z"``, positive upwards; by default the last axis of the mesh.
        ramp : Ramp or iterable of (float, float), optional
            History of the pressure; by default that of the analysis.

        Examples
        --------
        Pressure of water with a free surface at y = 0.8, in N and mm:

        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.add_hydrostatic_pressure("RIGHT", weight=9.81e-6, level=0.8)
        """
        name = "xyz"[self.mesh.dim - 1] if axis is None else axis
        (vertical,) = axis_values(f"the hydrostatic pressure on '{group}'", {name: 1.0}, self.mesh.dim)
        for quantity, value in (("weight", weight), ("level", level)):
            check_number(f"the {quantity} of the hydrostatic pressure on '{group}'", value)
        self.add_pressure(group, loads.Hydrostatic(float(weight), float(level), vertical), ramp=ramp)

    def add_force(
        self,
        group: str,
        *,
        distribute: bool | None = None,
        at: Sequence[float] | None = None,
        weighting: str = "uniform",
        radius: float | None = None,
        ramp: History = None,
        **components: Value | None,
    ) -> None:
        """Apply a force to a group.

        Parameters
        ----------
        group : str
        distribute : bool, optional
            If True, the components are the resultant, which is applied as a uniform traction to the facets of the group.
            If False, the components act on every node of the group. The default is True for a group of facets and False
            for a group of points.
        at : sequence of float (dim,), optional
            Point through which the resultant acts [length]. The force on each node of the group is proportional to its
            tributary area and to the weight of its distance from this point (see `weighting`). Additional forces, which
            are linear in the position, make the moment about this point vanish.
        weighting : str
            Weight as a function of the distance from `at`: ``"uniform"``, or ``"linear"``, ``"quadratic"`` or ``"cubic"``,
            which decrease to zero at `radius`.
        radius : float, optional
            Distance from `at` beyond which no force acts [length]; by default the distance of the farthest node.
        ramp : Ramp or iterable of (float, float), optional
            History of the force; by default that of the analysis.
        **components : float or callable
            Components ``x``, ``y`` and ``z`` of the force at multiplier 1 [force]: numbers or, for forces on nodes, functions
            from reference positions (n, dim) [length] to forces (n,). In axisymmetry they are integrated over the full
            circle, and a radial force on facets raises an error.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.add_force("TOP", y=-100.0)  # a resultant of 100, applied as a uniform traction
        >>> model.add_force("TOP_RIGHT", x=1.0)  # a nodal force
        >>> model.add_force("TOP", y=-100.0, at=(0.25, 1.0))  # an eccentric resultant
        """
        self.mesh.points_of(group)
        table = table_of(ramp, f"the ramp of the force on '{group}'")
        axes = axis_values(f"the force on '{group}'", components, self.mesh.dim)
        if at is None and (weighting != "uniform" or radius is not None):
            raise ModelError(
                f"the force on '{group}' has a weighting or a radius, but no point from which distances are measured: give "
                "at=..."
            )
        if at is not None:
            if distribute is False:
                remedy = "leave out 'at' or 'distribute'"
                raise ModelError(f"the force on '{group}' acts through a point or on every node: {remedy}")
            self._add(SpreadForce(group, axes, Spread(tuple(float(v) for v in at), weighting, radius), table))
            return
        if distribute is None and group in self.mesh.cell_groups and self.mesh.cells_of(group, dim=self.mesh.dim):
            raise ModelError(
                f"'{group}' is a group of solid cells: name facets or points for the force, or use add_body_force; "
                "with distribute=False it acts on every node of the cells"
            )
        if distribute is None:
            distribute = group in self.mesh.cell_groups and bool(self.mesh.cells_of(group, dim=self.mesh.dim - 1))
        if distribute and any(map(callable, axes.values())):
            raise ModelError(
                f"the total force on '{group}' must be a number: a function of position gives the force on each node, with "
                "distribute=False; or use add_traction"
            )
        kind: type[loads.TotalForce] | type[loads.NodalForce] = loads.TotalForce if distribute else loads.NodalForce
        self._add(kind(group, axes, table))

    def add_moment(self, group: str, *, ramp: History = None, **moments: float | None) -> None:
        """Apply a moment to a reference point or to a group.

        Parameters
        ----------
        group : str
            Name of a reference point or of a group. On a group of facets the moment is applied by nodal forces with a
            zero resultant, which are proportional to the tributary area and to the distance from the centroid.
        ramp : Ramp or iterable of (float, float), optional
            History of the moment; by default that of the analysis.
        **moments : float
            Components ``x``, ``y`` and ``z`` of the moment at multiplier 1 [force times length]; in 2D only ``z``.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.add_moment("TOP", z=20.0)
        """
        name = f"the moment on '{group}'"
        axes = axis_values(name, moments, 3)
        if self.mesh.dim == 2 and set(axes) != {2}:
            raise ModelError(f"{name}: in two dimensions a moment has the component z only")
        self._add(Moment(group, axes, table_of(ramp, f"the ramp of {name}")))

    def _add(self, load: Load) -> None:
        """Add a load after checking it."""
        load.check(self.mesh, self.kinematics)
        self.loads.append(load)

    def forces_by_ramp(self) -> dict[Table | None, Array]:
        """Return the nodal forces (n_points, dim) [force] of all loads at multiplier 1, by history."""
        related, vectors = self.related_points(), [self.load_vector(load) for load in self.loads]
        for load, forces in zip(self.loads, vectors, strict=True):
            check_forces(self.mesh, forces, related, load.name)
        return sums_by_ramp((load.ramp, forces) for load, forces in zip(self.loads, vectors, strict=True))

    def following_loads(self) -> list[tuple[FollowerLoad, Table | None]]:
        """Return the loads that depend on displacements, pressures before centrifugal forces, with their histories."""
        of_mesh, spins = (self.mesh, self.kinematics), [load for load in self.loads if isinstance(load, Centrifugal)]
        following: list[tuple[FollowerLoad, Table | None]] = [
            (FollowerPressure(*of_mesh, load), load.ramp) for load in self.loads if isinstance(load, Pressure)
        ]
        return [*following, *((FollowerCentrifugal(*of_mesh, load, self.densities()), load.ramp) for load in spins)]

    def load_vector(self, load: Load) -> Array:
        """Return the nodal forces (n_points, dim) [force] of a load at multiplier 1."""
        return load.vector(self.mesh, self.kinematics, self.densities() if isinstance(load, InertiaLoad) else None)

    def densities(self) -> Densities:
        """Return the densities of all solid cells."""
        return Densities([material for material, _ in self.materials], self.material_of_cells())
