"""Connections of a model: multi-point constraints, couplings, periodicity, springs, pretension sections."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from fastcontact.elasticity.loads import axes_of, check_number
from fastcontact.elasticity.multipoint_constraints import MultiPointConstraint
from fastcontact.elasticity.springs import grounded, joined
from fastcontact.errors import ModelError
from fastcontact.mesh.argument_types import typed
from fastcontact.model.couplings import coupling
from fastcontact.model.parts.initial_states import ModelInitialStates
from fastcontact.model.periodicity import cyclic, periodic
from fastcontact.model.pretension import PretensionForce, pretension
from fastcontact.model.ramp import History, table_of
from fastcontact.model.relation_rows import NORMAL, along, directions_of, less_first, matched


class ModelConnections(ModelInitialStates):
    """A model with relations, couplings, springs and pretension."""

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
        section_of_bolt = pretension(
            self.mesh, name, section, opposite, normal, (force, shortening, locked_from), table
        )
        for other in self.pretensions:
            if np.isin(section_of_bolt.nodes, [other.nodes, other.opposite]).any():
                raise ModelError(f"{section_of_bolt.name} and {other.name} are in one section, which has one force")
        self.pretensions.append(section_of_bolt)
        self.relations.extend(section_of_bolt.relations(self.n_dofs))
        if force is not None:
            self._add(PretensionForce(section_of_bolt))

    @typed(ModelError)
    def couple(self, group: str, component: str) -> None:
        """Let all nodes of a group move together in one displacement component, or several (``"xy"``).

        ``"normal"``: by the same along the normals of a group of facets.
        """
        nodes = self.mesh.points_of(group)
        if len(nodes) < 2:
            raise ModelError(f"group '{group}' holds {len(nodes)} points: at least two are needed to couple")
        directions = [component] if component == NORMAL else list(dict.fromkeys(component))
        if component != NORMAL:
            axes_of(f"couple('{group}')", dict.fromkeys(component, 1.0), self.mesh.dim)
        for name in directions:
            ((nodes, vectors),) = directions_of(self.mesh, group, name)
            rows = less_first(along(nodes, vectors, self.n_dofs))
            self.relations.append(MultiPointConstraint(f"couple('{group}', '{name}')", rows))

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
            match = matched(self.mesh, (first, nodes), (second, opposite), translation)
            rows = coefficients[0] * along(nodes, ours, self.n_dofs)
            rows = csr_array(rows + coefficients[1] * along(opposite[match], theirs[match], self.n_dofs))
            rows.eliminate_zeros()
            self.relations.append(
                MultiPointConstraint(
                    name, rows[np.diff(rows.indptr) > 0], float(value), table_of(ramp, f"the ramp of {name}")
                )
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
        relations, interface = periodic(
            self.mesh, (first, second), jump, loose, translation, table_of(ramp, f"the ramp of {name}")
        )
        self.relations.extend(relations)
        self.periodic_interfaces.append(interface)

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
            The ends: groups whose nodes lie upon each other after the turn, either way. Where meshes differ, groups of facets
            that do: nodes of the end with more of them then follow the facets of the other one.
        sectors : int
            How many make the whole.
        origin : sequence of float (dim,), optional
            A point of the axis, by default the origin [length].
        direction : sequence of float (3,)
            Along the axis [-]; in the plane always z.

        Raises
        ------
        MeshError, ModelError
            If there are no such groups, they do not lie upon each other (the largest distance is told), or
            kinematics are axisymmetric.
        """
        name = f"the cyclic symmetry of '{first}' and '{second}'"
        if self.kinematics == "axisymmetric":
            raise ModelError(f"{name}: an axisymmetric model is the whole ring already")
        origin_given = (0.0,) * self.mesh.dim if origin is None else tuple(origin)
        along = (0.0, 0.0, 1.0) if self.mesh.dim == 2 else tuple(direction)
        if (
            sectors < 2
            or sectors != int(sectors)
            or len(origin_given) != self.mesh.dim
            or len(along) != 3
            or not any(along)
        ):
            raise ModelError(
                f"{name} needs two sectors at least, a whole number, an origin of {self.mesh.dim} numbers and a direction of "
                f"three, not {sectors}, {origin_given} and {along}"
            )
        relations, interface = cyclic(self.mesh, (first, second), sectors, origin_given, along)
        self.relations.extend(relations)
        if interface is None:
            self.interpolated.append(name)
        else:
            self.periodic_interfaces.append(interface)

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
        listed = [(point, component, coefficient) for point, component, coefficient in terms]
        name = "the relation of " + ", ".join(f"{component} of '{point}'" for point, component, _ in listed)
        check_number(f"the value of {name}", value)
        for point, component, coefficient in listed:
            check_number(f"a coefficient of {name}", coefficient)
            (axis,) = axes_of(name, {component: coefficient}, self.mesh.dim)
            for node in self._nodes(point):
                dof = int(node) * self.mesh.dim + axis
                row[dof] = row.get(dof, 0.0) + float(coefficient)
        row = {dof: coefficient for dof, coefficient in row.items() if coefficient}
        if not row:
            raise ModelError("a relation needs at least one displacement with a coefficient other than zero")
        dofs = np.array(sorted(row), np.intp)
        values = np.array([row[dof] for dof in dofs])
        rows = csr_array((values, dofs, np.array([0, len(dofs)])), shape=(1, self.n_dofs))
        self.relations.append(MultiPointConstraint(name, rows, float(value), table_of(ramp, f"the ramp of {name}")))

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
        stiffness = {"axial": axial, "transverse": transverse}
        along = {key: value for key, value in stiffness.items() if value is not None}
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
            if translation is not None:
                raise ModelError(f"{name} goes to the ground: leave out the translation, or name the group to join")
            self.springs.append(grounded(name, nodes, axes, self.n_dofs, self.mesh.dim, along, vector))
            return
        opposite = self._nodes(to)
        if not len(opposite):
            raise ModelError(f"group '{to}' is empty: no spring can be there")
        if len(nodes) > 1 < len(opposite):
            match = matched(self.mesh, (str(group), nodes), (str(to), opposite), translation)
            opposite = opposite[match]
        elif translation is not None:
            raise ModelError(f"{name} joins all nodes with a single one: leave out the translation")
        first, second = np.broadcast_arrays(nodes, opposite)
        self.springs.append(joined(name, self.mesh.points, (first, second), axes, along, vector))
