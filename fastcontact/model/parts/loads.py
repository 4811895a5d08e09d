"""The loads of a model: forces on its surfaces, volumes and points.

A `Value` is a number, or a function from reference positions (n, dim) [length] to numbers (n,) [unit of the quantity].
"""

from __future__ import annotations

from collections.abc import Sequence

from fastcontact._tools.argument_types import typed
from fastcontact.arrays import Array
from fastcontact.elasticity.following_pressure import FollowingPressure
from fastcontact.elasticity.inertia_loads import Centrifugal, Densities, Gravity, InertiaLoad
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
)
from fastcontact.errors import ModelError
from fastcontact.model.checks import check_forces
from fastcontact.model.couplings import Moment, SpreadForce, spread_of
from fastcontact.model.parts.base import group_names
from fastcontact.model.parts.heat import ModelHeat
from fastcontact.model.ramp import History, Table, table_of


@typed(ModelError)
class ModelLoads(ModelHeat):
    """A model with loads."""

    def add_pressure(self, group: str, value: Value, *, ramp: History = None) -> None:
        """Apply a pressure to a group of outer facets.

        Parameters
        ----------
        group : str
        value : float or callable
            Positive in compression, that is along the inward normal: a number, or a function from reference positions
            (n, dim) [length] to pressures (n,) [pressure]. In finite strain it follows the deformed surface.
        ramp : Ramp or iterable of (float, float), optional
            History of the pressure.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.add_pressure("TOP", 2.0)
        >>> model.add_pressure("RIGHT", lambda points: 10.0 * (1.0 - points[:, 1]))
        """
        self._add(Pressure(group, value, table_of(ramp, f"the ramp of the pressure on '{group}'")))

    def add_traction(
        self,
        group: str,
        *,
        x: Value | None = None,
        y: Value | None = None,
        z: Value | None = None,
        ramp: History = None,
    ) -> None:
        """Apply a traction, force per reference area, to a group of facets.

        Parameters
        ----------
        group : str
        x, y, z : float or callable
            Components, as `value` of `add_pressure` [pressure].
        ramp : Ramp or iterable of (float, float), optional
            History of the traction.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.add_traction("TOP", x=1.0, y=-5.0)
        """
        axes = axes_of(f"the traction on '{group}'", {"x": x, "y": y, "z": z}, self.mesh.dim)
        self._add(Traction(group, axes, table_of(ramp, f"the ramp of the traction on '{group}'")))

    def add_body_force(
        self,
        groups: Sequence[str] | str | None = None,
        *,
        x: Value | None = None,
        y: Value | None = None,
        z: Value | None = None,
        ramp: History = None,
    ) -> None:
        """Apply a body force to groups of solid cells.

        Parameters
        ----------
        groups : str or sequence of str, optional
            By default all solid cells.
        x, y, z : float or callable
            Force per volume, as `value` of `add_pressure` [force / length^3].
        ramp : Ramp or iterable of (float, float), optional
            History of the force.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.add_body_force(y=-7.7e-5)
        >>> model.add_body_force("BLOCK", x=lambda points: 1e-6 * points[:, 0])
        """
        names = group_names(groups)
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
        """Apply the weight of groups of solid cells, from the densities of their materials.

        Parameters
        ----------
        groups : str or sequence of str, optional
            By default all solid cells.
        x, y, z : float
            Gravitational acceleration [length / time^2], in units consistent with the others: -9810 with N, mm, MPa,
            tonnes and seconds.
        ramp : Ramp or iterable of (float, float), optional
            History of the acceleration.

        Examples
        --------
        Steel in mm, tonnes and seconds, so that forces are in N:

        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.add_material(fc.LinearElastic(E=210_000.0, nu=0.3, density=7.85e-9))
        >>> model.add_gravity(y=-9810.0)
        """
        names = group_names(groups)
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
        """Apply the centrifugal force of a rotation to groups of solid cells, from the densities of their materials.

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
            History of the force, which is proportional to the square of the speed.

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
        """Apply the pressure of a liquid, `weight` times the depth below its level, to a group of outer facets.

        Parameters
        ----------
        group : str
        weight : float
            Weight of the liquid per volume [force / length^3].
        level : float
            Coordinate of its free surface, above which there is no pressure [length].
        axis : str, optional
            Vertical axis, positive upwards: by default the last one, y or z.
        ramp : Ramp or iterable of (float, float), optional

        Examples
        --------
        Water in N and mm, filled to y = 0.8:

        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.add_hydrostatic_pressure("RIGHT", weight=9.81e-6, level=0.8)
        """
        name = "xyz"[self.mesh.dim - 1] if axis is None else axis
        (along,) = axes_of(f"the hydrostatic pressure on '{group}'", {name: 1.0}, self.mesh.dim)
        for quantity, value in (("weight", weight), ("level", level)):
            check_number(f"the {quantity} of the hydrostatic pressure on '{group}'", value)
        self.add_pressure(group, Hydrostatic(float(weight), float(level), along), ramp=ramp)

    def add_force(
        self,
        group: str,
        *,
        x: Value | None = None,
        y: Value | None = None,
        z: Value | None = None,
        distribute: bool | None = None,
        at: Sequence[float] | None = None,
        weighting: str = "uniform",
        radius: float | None = None,
        ramp: History = None,
    ) -> None:
        """Apply a force to a group.

        Parameters
        ----------
        group : str
        x, y, z : float or callable
            Components: numbers, or functions of position for forces on nodes, as in `prescribe` [force]. In axisymmetry they
            are those over the full circle; a radial force on facets is refused.
        distribute : bool, optional
            True: the components are the resultant, applied as a uniform traction to the facets of the group. False: they
            act on every node of the group. By default True for a group of facets and False for a group of points.
        at : sequence of float (dim,), optional
            Point through which the resultant acts [length]. It is distributed over the group in proportion to area and
            distance from this point; linear terms balance the remaining moment.
        weighting : str
            How the force decays with the distance from `at`: ``"uniform"``, or to zero at the radius by a ``"linear"``,
            ``"quadratic"`` or ``"cubic"`` function.
        radius : float, optional
            Distance from `at` beyond which no force acts [length]; by default that of the farthest node.
        ramp : Ramp or iterable of (float, float), optional

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.add_force("TOP", y=-100.0)  # in all, as a uniform traction
        >>> model.add_force("TOP_RIGHT", x=1.0)  # on the node
        >>> model.add_force("TOP", y=-100.0, at=(0.25, 1.0))  # off the centre
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
        if distribute is None and group in self.mesh.cell_groups and self.mesh.cells_of(group, dim=self.mesh.dim):
            raise ModelError(
                f"'{group}' is a group of solid cells: name facets or points for the force, or take add_body_force; "
                "distribute=False loads every node of the cells with it"
            )
        if distribute is None:
            distribute = group in self.mesh.cell_groups and bool(self.mesh.cells_of(group, dim=self.mesh.dim - 1))
        if distribute and any(callable(component) for component in (x, y, z)):
            raise ModelError(
                f"the total force on '{group}' must be a number: a function of position is the force on each node, with "
                "distribute=False; or take add_traction"
            )
        kind: type[TotalForce] | type[NodalForce] = TotalForce if distribute else NodalForce
        axes = axes_of(f"the force on '{group}'", {"x": x, "y": y, "z": z}, self.mesh.dim)
        self._add(kind(group, axes, table_of(ramp, f"the ramp of the force on '{group}'")))

    def add_moment(
        self,
        group: str,
        *,
        x: float | None = None,
        y: float | None = None,
        z: float | None = None,
        ramp: History = None,
    ) -> None:
        """Apply a moment to a reference point or to a group.

        Parameters
        ----------
        group : str
            On a group of facets the moment is distributed in proportion to area and distance from the centroid, without a
            resultant force.
        x, y, z : float
            Components [force times length]; in the plane z alone.
        ramp : Ramp or iterable of (float, float), optional
            History of the moment.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.add_moment("TOP", z=20.0)
        """
        name = f"the moment on '{group}'"
        components = {"x": x, "y": y, "z": z}
        if self.mesh.dim == 2 and (x is not None or y is not None):
            raise ModelError(f"{name}: in the plane moments are about z")
        axes = axes_of(name, components, 3)
        self._add(Moment(group, axes, table_of(ramp, f"the ramp of {name}")))

    def _add(self, load: Load) -> None:
        load.check(self.mesh, self.kinematics)
        self.loads.append(load)

    def forces_by_ramp(self) -> dict[Table | None, Array]:
        """Return the nodal forces (n_points, dim) of all loads at multiplier 1, by history [force]."""
        related = self.related_points()
        by_ramp: dict[Table | None, Array] = {}
        for load in self.loads:
            forces = self.load_vector(load)
            check_forces(self.mesh, forces, related, load.name)
            by_ramp[load.ramp] = by_ramp.get(load.ramp, 0.0) + forces
        return by_ramp

    def following_pressures(self) -> list[tuple[FollowingPressure, Table | None]]:
        """Return the follower pressures of finite strain with their histories."""
        if self.strain == "small":
            return []
        pressures = [load for load in self.loads if isinstance(load, Pressure)]
        return [(FollowingPressure(self.mesh, self.kinematics, load), load.ramp) for load in pressures]

    def load_vector(self, load: Load) -> Array:
        """Return the nodal forces (n_points, dim) of a load at multiplier 1 [force]."""
        density = None
        if isinstance(load, InertiaLoad):
            density = Densities([m for m, _ in self.materials], self.material_of_cells())
        return load.vector(self.mesh, self.kinematics, density)
