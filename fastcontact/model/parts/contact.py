"""The contact pairs of a model, with bodies and with rigid obstacles.

A `Value` is a number, or a function from reference positions (n, dim) [length] to numbers (n,) [unit of the quantity].
"""

from __future__ import annotations

import copy
import dataclasses
import logging
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from fastcontact._tools.argument_types import check_fields, typed
from fastcontact.arrays import Mask
from fastcontact.contact.default_formulation import default_against_obstacle, default_formulation
from fastcontact.contact.formulations import FORMULATIONS, Formulation
from fastcontact.contact.held_motions import HeldMotions
from fastcontact.contact.obstacles import Obstacle
from fastcontact.contact.obstacles.rigid_side import RigidSide
from fastcontact.contact.pair_options import PairOptions
from fastcontact.contact.side_checks import check_obstacle, check_sides
from fastcontact.contact.surface import Surface, surface
from fastcontact.elasticity.loads import Value, axis_values, check_number
from fastcontact.errors import ContactError, ModelError, check_known
from fastcontact.model.contact_pair import ContactPair, DrivingForce, FluidPressure, method, rotation_of
from fastcontact.model.force_driven_obstacles import ForceDrivenObstacles
from fastcontact.model.pair_options import SHARED_OPTIONS, ContactOptions, pair_options
from fastcontact.model.parts.connections import ModelConnections
from fastcontact.model.periodicity import representatives
from fastcontact.model.ramp import History, table_of
from fastcontact.model.repeated_pairs import check_repeated_facets, share_facets

if TYPE_CHECKING:
    from fastcontact.contact.found_contacts import FoundContacts

log = logging.getLogger("fastcontact")


@typed(ModelError)
class ModelContact(ModelConnections):
    """A model with contact pairs."""

    def add_contact(
        self,
        name: str,
        *,
        secondary: str,
        primary: str,
        formulation: str | None = None,
        **options: Unpack[ContactOptions],
    ) -> None:
        """Add a contact pair: the facets of group `secondary` may touch those of group `primary`.

        Parameters
        ----------
        name : str
            Name of the pair in the results.
        secondary, primary : str
            Groups of facets of the two sides. Nodes or integration points of the secondary side carry the contact
            constraints and are projected onto the primary side. Facets may be listed in either orientation; their normals
            point out of the adjacent solid cells.
        formulation : str, optional
            ``"node_to_segment"``, ``"continuous"`` or ``"mortar"``; by default mortar with dual Lagrange multipliers, which
            suits any two surfaces. ``repr(model)`` and the log state the formulation.
        **options
            The options below apply to all formulations; each formulation has further options. None means the default.

            - ``friction``: coefficient of Coulomb friction.
            - ``kind``: the kinematic condition.

              ``"unilateral"``, the default: contact opens and closes.
              ``"bilateral"``: all secondary points that have an opposite point are in frictionless contact from the
              beginning and never separate.
              ``"bilateral_once_closed"``: nodes that are closed at the end of a load step do not separate afterwards.
              ``"tied"``: the sides neither separate nor slide. They are paired once, in the reference configuration, and
              their relative displacement is zero. An initial gap is kept and acts as a rigid arm that rotates with the
              primary facet.
              ``"gap_only"``: gaps are computed, negative where the sides penetrate, but no forces act.
            - ``clearance``: length that is added to the gap, positive for a clearance and negative for an interference,
              for example of a press fit [length]. It is a number or a function from reference positions (n, dim) on the
              secondary side to lengths (n,).
            - ``clearance_primary``: the same quantity as a function of positions on the primary side.
            - ``clearance_ramp``: history of both clearances, as pairs (load factor, multiplier); by default they are
              constant.
            - ``friction_ramp``: history of the coefficient of friction, as pairs (load factor, multiplier).
            - ``surface_smoothing``: whether gaps are measured between the smooth surfaces that facets of curved sides
              approximate; True by default, except for node-to-segment contact and at rigid obstacles.
            - ``excluded``: groups whose nodes carry no contact pressure. In the node-to-segment formulation and in mortar
              contact with one gap per node, the tributary areas of these nodes carry no pressure; in the other
              formulations, integration points whose nearest node is excluded carry none. The two sides may share excluded
              nodes.
            - ``frictionless``: groups whose nodes, or the integration points nearest to them, carry no friction.
            - ``frictionless_along``: vector (dim,) along which there is neither friction nor slip, at the nodes of
              ``frictionless`` or, without that option, at all nodes; friction and slip normal to the vector remain [-].
            - ``penalty``: pressure per unit penetration [pressure / length]; by default the constraints are enforced
              exactly. Alternatively a table of pairs (overclosure, pressure) [length, pressure], ascending from zero
              pressure, or ``{"clearance": c, "pressure": p}``, an exponential law with the pressure p at zero gap and
              p / 100 at the gap c. Friction is not regularised by this option.
            - ``tangential_penalty``: shear traction per unit tangential displacement of sticking nodes, a number or a
              function of the secondary position [pressure / length]; by default nodes stick exactly.
            - ``cohesion``: bilinear cohesive law, as a mapping. ``strength`` [pressure] and fracture ``energy`` per unit
              area [pressure length] are required. ``shear_strength`` and ``shear_energy`` default to the values in opening,
              ``stiffness`` [pressure / length] to a value with which the strength is reached at a hundredth of the opening
              at failure. ``mixed_mode`` is ``"bk"`` (Benzeggagh and Kenane, 1996) or ``"power"``, with an ``exponent``
              [-], by default 2; ``initiation`` is ``"bk"``, ``"quadratic"`` or ``"maximum"``. The layer is stress-free in
              the reference configuration, also across gaps, and keeps its stiffness in compression.
            - ``adhesion``: reversible attraction without tangential resistance, as a mapping of the ``work`` of adhesion
              per unit area [pressure length], the ``strength`` [pressure] and the ``stiffness`` [pressure / length].
            - ``slip``: definition of the slip. ``"symmetric"``, the default: a relative displacement that closes a gap
              along the mean normal of both sides is not slip. ``"primary"``: any relative displacement tangential to the
              primary side is slip, as in code_aster.
            - ``wear``: Archard's wear coefficient divided by the hardness [1 / pressure]. In each load step, the depth
              ``wear * pressure * slip`` is removed from the secondary side.
            - ``conductance``: heat flux per unit temperature difference [power / (area temperature)]: a number, which
              applies at closed points; a function of pressures and gaps (m,); pairs (pressure, conductance); or a mapping
              of ``"pressure"`` and ``"gap"`` to pairs. By default the contact is insulated.
            - ``friction_heat``: fraction of the frictional work that becomes heat [-]. Half of this heat flows into
              each side. The heating power is computed with the load factor as time.
            - ``obstacle_temperature``: temperature of a rigid obstacle [temperature].
            - ``search_distance``: largest distance, and largest penetration, at which a point is paired with an
              opposite point, either in the current configuration or at the beginning of the load step [length].
            - ``normals``: the normal field. ``"facet"``: normals of the primary facets. ``"averaged"``: averages over the
              facets that meet at a node at less than 48 degrees, which conforming curved sides need. ``"secondary"``:
              normals of the secondary side. A vector (dim,): the outward normal of the entire primary side [-].
            - ``projection_tolerance``: distance, relative to the length of a facet, by which the projection of a point may
              lie beyond the end of the primary side while the point still carries force [-].

        Raises
        ------
        MeshError, ModelError, ContactError
            If a group does not exist, an option is unknown or out of range, or the sides do not fit each other.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.half_spheres(size=10.0), kinematics="axisymmetric")
        >>> model.add_contact("hertz", secondary="CONT1", primary="CONT2", friction=0.2)
        >>> model.contact[0].formulation
        'mortar'
        """
        given_options: dict[str, Any] = {option: value for option, value in options.items() if value is not None}
        if formulation is None:
            formulation, given_options, reason = default_formulation(self.mesh.dim, given_options)
            log.info("contact '%s': %s, since %s", name, method(formulation, given_options), reason)
        self._add_pair(ContactPair(name, secondary, primary, formulation, given_options))

    def add_contacts(
        self,
        *,
        distance: float | None = None,
        angle: float = 45.0,
        groups: Sequence[str] | None = None,
        formulation: str | None = None,
        **options: Unpack[ContactOptions],
    ) -> FoundContacts:
        """Find the surfaces of different bodies that face each other, and add a contact pair for every two such surfaces.

        Groups with the facets of these surfaces are added to the mesh of the model. Surfaces of existing pairs and of
        pretension sections are skipped. If materials have been assigned, the choice of the secondary side takes their
        moduli into account.

        Parameters
        ----------
        distance : float, optional
            Largest distance between surfaces that face each other; see `find_contacts` [length].
        angle : float
            Largest deviation of the two normals from opposite directions; see `find_contacts` [degrees].
        groups : sequence of str, optional
            Groups of solid cells that form the bodies; by default the connected sets of cells.
        formulation : str, optional
            Formulation of all pairs; see `add_contact`.
        **options
            Options of all pairs, such as ``friction=0.2`` or ``kind="tied"``; see `add_contact`.

        Returns
        -------
        FoundContacts
            The pairs that were added.

        Raises
        ------
        ContactError
            If no bodies face each other; the message states their distance.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block_on_block(), kinematics="plane_strain")
        >>> len(model.add_contacts(friction=0.2))
        1
        """
        from fastcontact.contact.found_contacts import FoundContacts, find_contacts, no_contacts_message

        moduli = self.contact_moduli() if self.materials else None
        contacts = find_contacts(self.mesh, distance=distance, angle=angle, groups=groups, moduli=moduli)
        if not contacts.pairs:
            raise ContactError(no_contacts_message(self.mesh, distance, angle, groups))
        self.mesh, added = contacts.mesh, []
        for pair in contacts:
            secondary, primary = pair.secondary, pair.primary
            sides = [self.mesh.points_of(group) for group in (secondary, primary)]
            if any(np.isin(side, [cut.nodes, cut.opposite]).all() for cut in self.pretensions for side in sides):
                continue
            if any(share_facets(self.mesh, (secondary, primary), earlier_pair) for earlier_pair in self.contact):
                log.info("contact '%s' is left out, since another contact pairs its facets already", pair.name)
                continue
            self.add_contact(pair.name, secondary=secondary, primary=primary, formulation=formulation, **options)
            self.contact[-1] = dataclasses.replace(self.contact[-1], detected_gap=pair.gap[0])
            added.append(pair)
        if not added and options:  # invalid options raise an error even if no pair is added
            trial = copy.copy(self)
            trial.contact = []
            trial.add_contact("contacts", formulation=formulation, secondary=secondary, primary=primary, **options)
        return FoundContacts(self.mesh, tuple(added), self.units)

    def add_fluid_pressure(self, contact: str, pressure: float, *, source: str, ramp: History = None) -> None:
        """Apply a fluid pressure to both sides of a contact pair, wherever the fluid can penetrate from a source.

        Starting at the source, the fluid advances from facet to facet where the sides are open, or where the contact
        pressure does not exceed the fluid pressure. There the fluid pressure acts on both sides, along the normals of each
        side: on the secondary side also where it faces no primary facet, and on the primary side on the area that faces the
        wetted part of the secondary side. At finite strain, normals and areas are those of the deformed surfaces. The
        pressure at each secondary node is the attribute ``fluid_pressure`` of the contact result. To apply the fluid pressure
        to other surfaces, use `add_pressure`.

        Parameters
        ----------
        contact : str
            Name of a contact pair or an obstacle.
        pressure : float
            Fluid pressure at multiplier 1 [pressure].
        source : str
            Group of the nodes of the secondary side where the fluid enters: the edge of that side, or all its nodes.
        ramp : Ramp or iterable of (float, float), optional
            History of the fluid pressure.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.block_on_block(), kinematics="plane_strain")
        >>> model.add_contact("seal", secondary="CONT_UPPER", primary="CONT_LOWER")
        >>> model.add_fluid_pressure("seal", 5.0, source="UPPER_BOTTOM_LEFT", ramp=[(0, 0), (1, 0), (2, 1)])
        """
        check_number(f"the fluid pressure in contact '{contact}'", pressure)
        if pressure < 0.0:
            raise ModelError(f"the fluid pressure {pressure} in contact '{contact}' must not be negative")
        names = [pair.name for pair in self.contact]
        check_known("contact", contact, names, ModelError)
        fluid = FluidPressure(float(pressure), source, table_of(ramp, f"the ramp of the fluid in contact '{contact}'"))
        index = names.index(contact)
        pair_with_fluid = dataclasses.replace(self.contact[index], fluid=fluid)
        self.bind(pair_with_fluid)
        self.contact[index] = pair_with_fluid

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
        **options: Unpack[ContactOptions],
    ) -> None:
        """Add contact of the facets of group `secondary` with a rigid obstacle.

        Parameters
        ----------
        name : str
            Name of the contact in the results.
        secondary : str
            Group of the facets that may touch the obstacle.
        obstacle : Obstacle
            A shape of `fastcontact.obstacles`, or any object with the ``distance`` method of these shapes.
        motion : mapping of str to float, optional
            Displacement of the obstacle at multiplier 1, such as ``{"y": -0.1}``; by default zero [length].
        force : mapping of str to float, optional
            Force on the obstacle at multiplier 1, such as ``{"y": -100.0}`` [force], in axisymmetry integrated over the
            full circle. In these components the obstacle is a free rigid body that only contact restrains; in the other
            components it follows `motion`. To guide an obstacle along an oblique direction, rotate the model such that this
            direction is an axis. The results contain the displacement of the obstacle.
        rotation : mapping, optional
            Rotation of the obstacle about an axis that moves with `motion`. ``angle``: angle at multiplier 1 [radian].
            ``centre``: a point (dim,) on the axis before any motion [length]. ``axis``, in 3D: direction of the axis.
            ``ramp``, optional: history of the angle. The results contain the torque about the axis. Axisymmetric models
            do not support rotation.
        ramp : Ramp or iterable of (float, float), optional
            History of motion and force, and of the rotation if it has no ``ramp``.
        formulation : str, optional
            ``"node_to_segment"`` (nodes against the obstacle), ``"mortar"`` with one weighted gap per node, or
            ``"continuous"``. The default is node-to-segment on linear triangles and, in 3D, on facets whose nodes all
            carry pressure (tri3, quad4, quad9). On other quadratic facets in 3D it is mortar if there is friction. In
            all other cases it is continuous.
        **options
            Options of `add_contact`.

        Raises
        ------
        MeshError, ModelError, ContactError
            If a group does not exist, an argument is invalid, or the obstacle and the mesh differ in dimension.

        Examples
        --------
        A rigid ball pressed into a block with 100 N:

        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.graded_block(), kinematics="axisymmetric")
        >>> model.add_material(fc.LinearElastic(E=70_000.0, nu=0.33))
        >>> model.fix("BOTTOM", "y")
        >>> ball = fc.obstacles.Sphere(R=10.0, centre=(0.0, 10.0))
        >>> model.add_obstacle("ball", secondary="CONTACT", obstacle=ball, force={"y": -100.0})
        >>> step = fc.solve(model, 1)[-1]
        >>> round(float(step.contact["ball"].force[1]), 6)
        -100.0
        """
        from fastcontact.contact.obstacles.meshed import MeshedSurface

        for option in ("axes", "direction", "guide"):
            if option in options:
                axes = " or ".join("xyz"[: self.mesh.dim])
                raise ModelError(
                    f"'{option}' of obstacle '{name}': obstacles are moved, pushed and guided along {axes}: give 'motion' or "
                    "'force' by components, or rotate the points of the mesh such that the guided direction is an axis"
                )
        components = axis_values(f"the motion of obstacle '{name}'", dict(motion), self.mesh.dim) if motion else {}
        displacement = tuple(float(components.get(axis, 0.0)) for axis in range(self.mesh.dim))  # type: ignore[arg-type]
        if not np.isfinite(displacement).all():
            raise ModelError(f"the motion {motion} of obstacle '{name}' must be finite numbers")
        if isinstance(obstacle, MeshedSurface):
            obstacle.check_apart(self.mesh)
        obstacle.distance(self.mesh.points[:1])  # raises an error for a wrong dimension
        history = table_of(ramp, f"the ramp of the motion of obstacle '{name}'")
        given_options: dict[str, Any] = {option: value for option, value in options.items() if value is not None}
        if formulation is None:
            kinds = self._facet_kinds(secondary)
            formulation, given_options, reason = default_against_obstacle(self.mesh.dim, *kinds, given_options)
            log.info("contact '%s': %s, since %s", name, method(formulation, given_options), reason)
        if formulation == "mortar":
            given_options.setdefault("multipliers", "dual")
        obstacle_force = self._driving_force(name, components, force)
        rotation_and_ramp = rotation_of(f"the rotation of obstacle '{name}'", rotation, self.kinematics)
        motion_of_obstacle = displacement, history, obstacle_force, *rotation_and_ramp
        self._add_pair(ContactPair(name, secondary, "", formulation, given_options, obstacle, *motion_of_obstacle))

    def _fluid_source(self, pair: ContactPair, side: Surface, options: PairOptions) -> Mask | None:
        """Return the mask (n_points,) of the points at which fluid enters a contact pair, or None if it has no fluid."""
        if pair.fluid is None:
            return None
        mask = np.zeros(self.mesh.n_points, bool)
        mask[self.mesh.points_of(pair.fluid.source)] = True
        if not mask[side.points].any():
            raise ContactError(
                f"the source '{pair.fluid.source}' of the fluid in contact '{pair.name}' has no nodes of the secondary side "
                f"'{side.group}': name a group that does"
            )
        if options.kind != "unilateral" or options.cohesion is not None:
            raise ContactError(
                f"contact '{pair.name}' is {'glued' if options.cohesion else options.kind}, which no fluid can enter: name "
                "another pair"
            )
        return mask

    def _facet_kinds(self, group: str) -> tuple[list[str], bool]:
        """Return the element types of the facets of a group, and whether all belong to linear triangles or tetrahedra."""
        facets = self.mesh.cells_of(group, self.mesh.dim - 1) if group in self.mesh.cell_groups else {}
        if not facets:  # `bind` raises the error
            return [], False
        simplices = [block for name, block in self.mesh.solids.items() if name in ("tri3", "tet4")]
        only_simplices = any(np.isin(self.mesh.points_of(group), block).all() for block in simplices)
        return list(facets), only_simplices

    def _driving_force(self, name: str, motion: Mapping[int, Value], force: Mapping[str, float] | None) -> DrivingForce:
        """Return the components of the force on obstacle `name`, None where its motion is prescribed.

        The result is empty if no force is given.
        """
        if not force:
            return ()
        forces = axis_values(f"the force on obstacle '{name}'", dict(force), self.mesh.dim)
        for axis, value in forces.items():
            check_number(f"the force {'xyz'[axis]} on obstacle '{name}'", value)
            if axis in motion:
                raise ModelError(
                    f"obstacle '{name}' is both moved and pushed along {'xyz'[axis]}: name this component either in its "
                    "motion or, unless a guide carries it, in its force"
                )
        if 0 in forces and self.kinematics == "axisymmetric":
            raise ModelError(f"a force cannot move obstacle '{name}' along the radius x: in axisymmetry give y only")
        return tuple(float(forces[k]) if k in forces else None for k in range(self.mesh.dim))  # type: ignore[arg-type]

    @property
    def force_driven(self) -> ForceDrivenObstacles:
        """The force-driven rigid obstacles."""
        return ForceDrivenObstacles([pair for pair in self.contact if pair.force], (self.mesh.n_points, self.mesh.dim))

    def _add_pair(self, pair: ContactPair) -> None:
        """Add a contact pair after checking it alone and together with the other pairs."""
        if pair.name in {earlier_pair.name for earlier_pair in self.contact}:
            raise ContactError(f"there is already a contact pair '{pair.name}': names must differ")
        bound = self.bind(pair)
        if isinstance(bound.primary, RigidSide):
            check_obstacle(self.mesh, pair.name, bound.secondary, bound.primary)
        for earlier_pair in self.contact:
            check_repeated_facets(self.mesh, pair, earlier_pair)
        self.contact.append(pair)

    def bind(self, pair: ContactPair, motions: HeldMotions | None = None, *, sectors_alike: bool = True) -> Formulation:
        """Return the formulation of a contact pair on this mesh. Raises the errors of `add_contact`.

        `motions` contains the nodal motions that supports and multi-point constraints prescribe, if they are known.
        `sectors_alike` states whether pressures are equal at both ends of a sector. This holds in static analyses, but not
        necessarily in vibration modes.
        """
        check_known("contact formulation", pair.formulation, FORMULATIONS, ContactError)
        variant = FORMULATIONS[pair.formulation].variant(self.mesh.dim, pair.options)
        internal = ("secondary", "primary", "points", "axisymmetric", "modulus", "options", "held_motions")
        known = [*SHARED_OPTIONS, *(f.name for f in dataclasses.fields(variant) if f.init and f.name not in internal)]
        known += ["motion", "rotation", "force"] * (pair.obstacle is not None)  # arguments of `add_obstacle`
        for option in pair.options:
            check_known(f"option of {pair.formulation}", option, known, ContactError)
        own_options = {key: value for key, value in pair.options.items() if key not in SHARED_OPTIONS}
        check_fields(f"contact '{pair.name}'", own_options, variant, ContactError)
        identity = np.eye(self.mesh.dim)
        ends = [(i.first, i.second, identity if i.turn is None else i.turn) for i in self.periodic_interfaces]
        secondary = surface(self.mesh, pair.secondary).with_periodic_ends(ends)
        has_obstacle = pair.obstacle is not None
        options = pair_options(pair.name, pair.options, self.mesh, secondary, has_obstacle)
        primary: Surface | RigidSide
        if pair.obstacle is not None:
            if not variant.allows_obstacles:
                raise ContactError(f"contact '{pair.name}': mortar in 2D needs multipliers='dual' at an obstacle")
            primary = RigidSide(pair.obstacle, np.array(pair.motion), pair.rotation)
            own_options.setdefault("surface_smoothing", False)
        else:
            primary = surface(self.mesh, pair.primary).with_periodic_ends(ends)
            check_sides(self.mesh, pair.name, secondary, primary, options.excluded)
        modulus = min((m.contact_modulus for m, _ in self.materials), default=1.0)
        axisymmetric = self.kinematics == "axisymmetric"
        interfaces = [interface for interface in self.periodic_interfaces if interface.turn is None or sectors_alike]
        points = secondary.points
        sector_rotation = next((e.rotation for e in interfaces if e.rotation and np.isin(e.second, points).any()), None)
        options = dataclasses.replace(
            options, representatives=representatives(interfaces, self.mesh.n_points), sector_rotation=sector_rotation,
            source=self._fluid_source(pair, secondary, options),
        )  # fmt: skip
        sides = secondary, primary, self.mesh.points
        return variant(*sides, axisymmetric, modulus, options=options, held_motions=motions, **own_options)
