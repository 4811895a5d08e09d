"""Connections of a model: multi-point constraints, couplings, periodicity, springs, pretension sections."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from fastcontact._tools.argument_types import typed
from fastcontact.elasticity.loads import axis_values, check_number
from fastcontact.elasticity.multipoint_constraints import MultiPointConstraint
from fastcontact.elasticity.springs import connecting_springs, ground_springs
from fastcontact.errors import ModelError
from fastcontact.model.couplings import Term, coupling, relation
from fastcontact.model.parts.initial_states import ModelInitialStates
from fastcontact.model.periodicity import cyclic, periodic
from fastcontact.model.pretension import PretensionForce, pretension
from fastcontact.model.ramp import History, table_of
from fastcontact.model.relation_rows import NORMAL, directions_of, matching_nodes, relative_to_first, rows_along


@typed(ModelError)
class ModelConnections(ModelInitialStates):
    """A model with multi-point constraints, couplings, periodicity, springs and pretension sections."""

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
        """Tighten a bolt by a pretension section.

        The bolt is cut at the section. The two sides of the cut are displaced uniformly towards each other along the
        bolt, without relative displacement normal to it. `fastcontact.generate.cut` cuts the mesh. The results are in
        ``step.pretension[name]``.

        Parameters
        ----------
        name : str
            Name of the section in the results.
        section : str
            Group of facets on one side of the cut.
        force : float, optional
            Bolt force at multiplier 1, positive in tension [force]; in axisymmetry integrated over the full circle.
        shortening : float, optional
            Relative displacement of the two sides towards each other at multiplier 1 [length]. Give either `force` or
            `shortening`.
        locked_from : float, optional
            Load factor, the end of a load step, after which the shortening is kept constant and the bolt force is a
            result [-].
        opposite : str, optional
            Group of facets on the other side of the cut; by default ``"<section> opposite"``.
        normal : sequence of float (dim,), optional
            Axis of the bolt [-]; by default the normal of the plane through the nodes of the section.
        ramp : Ramp or iterable of (float, float), optional
            History of the force or of the shortening; by default that of the analysis.

        Raises
        ------
        MeshError, ModelError
            If the two sides share points or do not coincide, or the arguments are inconsistent.

        Examples
        --------
        >>> import fastcontact as fc
        >>> bar = fc.generate.block()
        >>> bar = bar.with_facet_group("CUT", lambda points: abs(points[:, 1] - 0.5) < 1e-9, between=True)
        >>> mesh = fc.generate.cut(bar, "CUT")
        >>> model = fc.Model(mesh, kinematics="plane_stress")
        >>> model.add_material(fc.LinearElastic(E=210_000.0, nu=0.3))
        >>> model.fix("BOTTOM", "xy")
        >>> model.fix("TOP", "xy")
        >>> model.add_pretension("bolt", "CUT", force=1000.0)
        >>> step = fc.solve(model, 1)[-1]
        >>> {name: float(f"{value:.6g}") for name, value in step.pretension["bolt"].items()}
        {'force': 1000.0, 'shortening': 0.00461044}
        """
        if name in {other.label for other in self.pretensions}:
            raise ModelError(f"there is already a pretension '{name}': names must differ")
        table = table_of(ramp, f"the ramp of pretension '{name}'")
        bolt = pretension(self.mesh, name, section, opposite, normal, (force, shortening, locked_from), table)
        for other in self.pretensions:
            if np.isin(bolt.nodes, [other.nodes, other.opposite]).any():
                raise ModelError(f"{bolt.name} and {other.name} act on the same section, which can have one force only")
        self.pretensions.append(bolt)
        self.relations.extend(bolt.relations(self.n_dofs))
        if force is not None:
            self._add(PretensionForce(bolt))

    def couple(self, group: str, component: str) -> None:
        """Constrain all nodes of a group to have equal displacement components.

        Parameters
        ----------
        group : str
        component : str
            One or several components, such as ``"y"`` or ``"xy"``; or ``"normal"``, the component along the normal at each
            node of a group of facets.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.couple("TOP", "y")  # stays straight and level
        """
        nodes = self.mesh.points_of(group)
        if len(nodes) < 2:
            raise ModelError(f"group '{group}' contains {len(nodes)} points: at least two are needed to couple")
        directions = [component] if component == NORMAL else list(dict.fromkeys(component))
        if component != NORMAL:
            axis_values(f"couple('{group}')", dict.fromkeys(component, 1.0), self.mesh.dim)
        for name in directions:
            ((nodes, vectors),) = directions_of(self.mesh, group, name)
            rows = relative_to_first(rows_along(nodes, vectors, self.n_dofs))
            self.relations.append(MultiPointConstraint(f"couple('{group}', '{name}')", rows))

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
        """Couple the displacement of each node of a group linearly to that of the corresponding node of another group.

        The constraint is ``coefficients[0] * u_first + coefficients[1] * u_second = value``, where ``u_first`` and
        ``u_second`` are displacement components of the two nodes. With the default coefficients and value they are equal,
        for example at the two ends of a period.

        Parameters
        ----------
        first, second : str
            Groups with equal numbers of nodes, whose nodes coincide after a translation.
        component : str
            One or several components, such as ``"x"`` or ``"xy"``; or ``"normal"``, the components along the outward normals
            of the facets of each group.
        coefficients : (float, float)
            Coefficients of the two displacements.
        value : float
            Value of the linear combination at multiplier 1 [length times the unit of the coefficients].
        translation : sequence of float (dim,), optional
            Vector that maps the first group onto the second; by default it joins the centres of their bounding boxes
            [length].
        ramp : Ramp or iterable of (float, float), optional
            History of the value; by default that of the analysis.

        Raises
        ------
        MeshError, ModelError
            If a group does not exist, nodes do not coincide after the translation, or an argument is invalid.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.relate_groups("LEFT", "RIGHT", "xy")
        """
        name = f"the relation of {component} of '{first}' and '{second}'"
        if len(coefficients) != 2:
            raise ModelError(f"{name} needs two coefficients, not {coefficients!r}")
        for number in (value, *coefficients):
            check_number(f"a number of {name}", number)
        if component != NORMAL:
            axis_values(name, dict.fromkeys(component, 1.0), self.mesh.dim)
        table = table_of(ramp, f"the ramp of {name}")
        sides = [directions_of(self.mesh, group, component) for group in (first, second)]
        for (nodes, vectors), (opposite, opposite_vectors) in zip(*sides, strict=True):
            match = matching_nodes(self.mesh, (first, nodes), (second, opposite), translation)
            rows = coefficients[0] * rows_along(nodes, vectors, self.n_dofs)
            rows = csr_array(rows + coefficients[1] * rows_along(opposite[match], opposite_vectors[match], self.n_dofs))
            rows.eliminate_zeros()
            self.relations.append(MultiPointConstraint(name, rows[np.diff(rows.indptr) > 0], float(value), table))

    def add_periodicity(
        self,
        first: str,
        second: str,
        *,
        free: str = "",
        translation: Sequence[float] | None = None,
        ramp: History = None,
        **components: float,
    ) -> None:
        """Model one period of a periodic structure, whose two ends have equal displacements up to a uniform difference.

        Rigid-body translations remain possible and must be prevented by supports. Where contact reaches the ends, two nodes
        represent the same point and share one contact constraint; in the continuous formulation only the sum of their
        forces is determined, and the pressures of neighbouring nodes may oscillate.

        Parameters
        ----------
        first, second : str
            Groups of the two ends, whose nodes coincide after a translation.
        free : str
            Components, such as ``"x"`` or ``"xy"``, in which the uniform relative displacement of the ends is unknown and
            results from the loads.
        translation : sequence of float (dim,), optional
            Vector from the first end to the second one; by default it joins the centres of their bounding boxes [length].
        ramp : Ramp or iterable of (float, float), optional
            History of x, y and z; by default that of the analysis.
        **components : float
            Displacement ``x``, ``y`` and ``z`` of the second end relative to the first one at multiplier 1, that is the mean
            strain times the length of the period, by default zero [length].

        Raises
        ------
        MeshError, ModelError
            If a group does not exist, or nodes do not coincide after the translation; the message states the largest
            distance.

        Examples
        --------
        One period of an infinite layer, stretched by 0.1 %:

        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.add_periodicity("LEFT", "RIGHT", x=0.001)
        """
        name = f"the periodicity of '{first}' and '{second}'"
        prescribed = {key: value for key, value in components.items() if value != 0.0}
        for key, value in prescribed.items():
            check_number(f"{key} of {name}", value)
        jump: Any = axis_values(name, prescribed, self.mesh.dim) if prescribed else {}
        free_axes = sorted(axis_values(name, dict.fromkeys(free, 1.0), self.mesh.dim)) if free else []
        if any(axis in jump for axis in free_axes):
            raise ModelError(f"{name}: '{free}' is free, so no displacement can be prescribed there")
        table = table_of(ramp, f"the ramp of {name}")
        relations, interface = periodic(self.mesh, (first, second), jump, free_axes, translation, table)
        self.relations.extend(relations)
        self.periodic_interfaces.append(interface)

    def add_cyclic_symmetry(
        self,
        first: str,
        second: str,
        *,
        sectors: int,
        origin: Sequence[float] | None = None,
        direction: Sequence[float] = (0.0, 0.0, 1.0),
    ) -> None:
        """Model one of several identical sectors of a ring, whose two ends have equal cylindrical displacement components.

        Loads are the same on all sectors, and resultant forces are those of the modelled sector. Rotation about the
        axis and, in 3D, translation along it remain possible and must be prevented by supports. The ends may be curved
        and may meet on the axis. The remark on contact at the ends, see `add_periodicity`, applies here as well.

        Parameters
        ----------
        first, second : str
            Groups of the two ends, whose nodes coincide after a rotation by the angle of a sector, in either direction. If
            the meshes of the ends differ, give groups of facets; nodes of the finer end are then tied to the facets of the
            coarser one.
        sectors : int
            Number of sectors in the ring.
        origin : sequence of float (dim,), optional
            A point on the axis; by default the origin of the coordinates [length].
        direction : sequence of float (3,)
            Direction of the axis in 3D [-]; in 2D the axis is normal to the plane of the model.

        Raises
        ------
        MeshError, ModelError
            If a group does not exist, the ends do not coincide after the rotation (the message states the largest
            distance), or the kinematics are axisymmetric.

        Examples
        --------
        A quarter of a ring represents the entire ring:

        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.rings(), kinematics="plane_strain")
        >>> model.add_cyclic_symmetry("SYMMETRY_Y", "SYMMETRY_X", sectors=4)
        """
        name = f"the cyclic symmetry of '{first}' and '{second}'"
        if self.kinematics == "axisymmetric":
            raise ModelError(f"{name}: an axisymmetric model already represents the entire ring")
        point = (0.0,) * self.mesh.dim if origin is None else tuple(origin)
        axis = (0.0, 0.0, 1.0) if self.mesh.dim == 2 else tuple(direction)
        valid_axis = len(point) == self.mesh.dim and len(axis) == 3 and any(axis)
        if sectors < 2 or sectors != int(sectors) or not valid_axis:
            raise ModelError(
                f"{name} needs at least two sectors (a whole number), an origin of {self.mesh.dim} numbers, and a direction "
                f"of three numbers, not {sectors}, {point} and {axis}"
            )
        relations, interface = cyclic(self.mesh, (first, second), sectors, point, axis)
        self.relations.extend(relations)
        if len(interface.first):
            self.periodic_interfaces.append(interface)
        if interface.relation is None:
            nodes = np.union1d(*(self.mesh.points_of(end) for end in (first, second)))
            self.nodes_on_facets[name] = np.setdiff1d(nodes, interface[:2])

    def relate(
        self, terms: Iterable[tuple[str | int, str, float]], value: float = 0.0, *, ramp: History = None
    ) -> None:
        """Constrain a linear combination of displacement components to a value (multi-point constraint).

        Parameters
        ----------
        terms : iterable of (str or int, str, float)
            For each term the name of a group or the number of a point, the component and the coefficient. A group of
            several nodes represents the sum over these nodes. Sums over many nodes are expensive, because they couple
            all of these displacements.
        value : float
            Value of the linear combination at multiplier 1 [length times the unit of the coefficients].
        ramp : Ramp or iterable of (float, float), optional
            History of the value; by default that of the analysis.

        Raises
        ------
        MeshError, ModelError
            If a group or a component does not exist, or all coefficients are zero.

        Examples
        --------
        The vertical displacement of one corner is twice that of another one:

        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.relate([("TOP_LEFT", "y", 1.0), ("TOP_RIGHT", "y", -2.0)])
        """
        terms_of_nodes: list[Term] = []
        terms = list(terms)
        name = "the relation of " + ", ".join(f"{component} of '{point}'" for point, component, _ in terms)
        check_number(f"the value of {name}", value)
        for point, component, coefficient in terms:
            check_number(f"a coefficient of {name}", coefficient)
            (axis,) = axis_values(name, {component: coefficient}, self.mesh.dim)
            terms_of_nodes += [(int(node), axis, float(coefficient)) for node in self._nodes(point)]
        table = table_of(ramp, f"the ramp of {name}")
        constraint = relation(name, [terms_of_nodes], self.mesh.points.shape, float(value), table)
        if not constraint.rows.nnz:
            raise ModelError("a relation needs at least one displacement with a coefficient other than zero")
        self.relations.append(constraint)

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
        """Couple a reference point to the nodes of a group.

        Forces, moments and supports at the reference point are transferred to the group; see `add_force` and `add_moment`.
        `fastcontact.generate.with_reference_points` adds reference points to a mesh. The coupling is linear and
        therefore valid for small rotations only.

        Parameters
        ----------
        reference : str
            Name of the reference point.
        group : str
            Group of the coupled nodes.
        kind : str
            With ``"rigid"`` the nodes move as a rigid body with the reference point (known as RBE2). With
            ``"distributing"`` the reference point follows the mean motion of the group, weighted by tributary area for
            groups of facets, and the group can deform freely (known as RBE3).
        components : str, optional
            Displacement components of a rigid coupling, such as ``"z"``; by default all components.
        weighting : str
            Additional weight of the nodes of a distributing coupling as a function of their distance from the reference
            point, as described for `add_force`.
        radius : float, optional
            Distance from the reference point beyond which the weight is zero, as described for `add_force` [length].

        Raises
        ------
        MeshError, ModelError
            If a group does not exist, or the kinematics are axisymmetric.

        Examples
        --------
        A moment is applied to the end of a block through a reference point:

        >>> import fastcontact as fc
        >>> mesh = fc.generate.with_reference_points(fc.generate.block(), {"HANDLE": (1.5, 0.5)})
        >>> model = fc.Model(mesh, kinematics="plane_strain")
        >>> model.add_coupling("HANDLE", "RIGHT", kind="distributing")
        >>> model.add_moment("HANDLE", z=20.0)
        """
        letters = "xyz"[: self.mesh.dim] if components is None else components
        axes = axis_values(f"the coupling of '{reference}'", dict.fromkeys(letters, 1.0), self.mesh.dim)
        weights = weighting, radius
        self.relations.append(coupling(self.mesh, self.kinematics, (reference, group), kind, sorted(axes), weights))

    def add_spring(
        self,
        group: str | int,
        to: str | int | None = None,
        *,
        axial: float | None = None,
        transverse: float | None = None,
        direction: Sequence[float] | None = None,
        translation: Sequence[float] | None = None,
        **components: float | None,
    ) -> None:
        """Connect the nodes of a group by springs to the ground or to other nodes.

        Parameters
        ----------
        group : str or int
            Name of a group or number of a point.
        to : str or int, optional
            Name of a group or number of a point; without it the springs are fixed to the ground. Each node of `group` is
            connected to the node of this group with which it coincides after `translation`. If one of the two groups has a
            single node, this node is connected to all nodes of the other group.
        axial, transverse : float
            Stiffness of each spring along the line between its two nodes, and along every direction normal to this line
            [force / length]. The line keeps its direction in the reference configuration.
        direction : sequence of float (dim,), optional
            Vector of any length that replaces the direction of the line between the two nodes [-].
        translation : sequence of float (dim,), optional
            Vector that maps the first group onto the second; by default it joins the centres of their bounding boxes
            [length].
        **components : float
            Stiffness ``x``, ``y`` and ``z`` of each spring along the axes [force / length]; in axisymmetry integrated over
            the full circle.

        Raises
        ------
        MeshError, ModelError
            If a group does not exist, nodes do not coincide after the translation, or a stiffness is not positive.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block(), kinematics="plane_strain")
        >>> model.add_spring("BOTTOM", y=1000.0)  # an elastic foundation, with a stiffness of 1000 at every node
        >>> model.add_spring("TOP_LEFT", "BOTTOM_RIGHT", axial=50.0)
        """
        name = f"the spring on '{group}'" if to is None else f"the spring between '{group}' and '{to}'"
        stiffness, dim = {"axial": axial, "transverse": transverse}, self.mesh.dim
        along_line = {key: value for key, value in stiffness.items() if value is not None}
        vector = self._direction(name, along_line, to is not None, direction)
        along_axes = {} if along_line and {*components.values()} <= {None} else axis_values(name, components, dim)
        for value in [*along_axes.values(), *along_line.values()]:
            check_number(f"the stiffness of {name}", value)
            if not value > 0:
                raise ModelError(f"{name}: the stiffness {value:g} must be positive")
        nodes, opposite = self._nodes(group), None if to is None else self._nodes(to)
        for end, points in ((group, nodes), (to, opposite)):
            if points is not None and not len(points):
                raise ModelError(f"group '{end}' is empty: no spring can act on it")
        if opposite is None:
            if translation is not None:
                raise ModelError(f"{name} acts on the ground: leave out the translation, or name the second group")
            self.springs.append(ground_springs(name, nodes, along_axes, self.n_dofs, dim, along_line, vector))
            return
        if len(nodes) > 1 < len(opposite):
            match = matching_nodes(self.mesh, (str(group), nodes), (str(to), opposite), translation)
            opposite = opposite[match]
        elif translation is not None:
            raise ModelError(f"{name} connects all nodes with a single one: leave out the translation")
        first, second = np.broadcast_arrays(nodes, opposite)
        self.springs.append(connecting_springs(name, self.mesh.points, (first, second), along_axes, along_line, vector))
