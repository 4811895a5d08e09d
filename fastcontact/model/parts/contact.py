"""The contact pairs of a model, with bodies and with rigid obstacles.

A `Value` is a number, or a function from reference positions (n, dim) [length] to numbers (n,) [unit of the quantity].
"""

from __future__ import annotations

import copy
import dataclasses
import logging
from collections.abc import Mapping, Sequence
from typing import Any, Unpack

import numpy as np

from fastcontact._tools.argument_types import check_fields, typed
from fastcontact.arrays import Mask
from fastcontact.contact.default_formulation import against_obstacle, default_formulation
from fastcontact.contact.formulations import FORMULATIONS, Formulation
from fastcontact.contact.found_contacts import FoundContacts, find_contacts, nothing_found
from fastcontact.contact.held_motions import HeldMotions
from fastcontact.contact.obstacles import MeshedSurface, Obstacle
from fastcontact.contact.obstacles.rigid_side import RigidSide
from fastcontact.contact.pair_options import PairOptions
from fastcontact.contact.side_checks import check_obstacle, check_sides
from fastcontact.contact.surface import Surface, surface
from fastcontact.elasticity.loads import Value, axes_of, check_number
from fastcontact.errors import ContactError, ModelError, check_known
from fastcontact.model.contact_pair import ContactPair, Driving, FluidPressure, method
from fastcontact.model.force_driven_obstacles import ForceDrivenObstacles
from fastcontact.model.obstacle_rotation import rotation_of
from fastcontact.model.pair_options import SHARED_OPTIONS, ContactOptions, pair_options
from fastcontact.model.parts.connections import ModelConnections
from fastcontact.model.periodicity import same_place
from fastcontact.model.ramp import History, table_of
from fastcontact.model.repeated_pairs import check_repeated, joined_already

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
            The side whose nodes or integration points are projected and carry the constraints, and the side
            projected upon. Facets are oriented from the solid behind them.
        formulation : str, optional
            ``"node_to_segment"``, ``"continuous"`` or ``"mortar"``. By default mortar with dual Lagrange multipliers, which
            suits any two surfaces; ``repr(model)`` and the log state it.
        **options
            Options of all formulations, in addition to those of the formulation itself; None is the default:

            - ``friction``: coefficient of Coulomb friction.
            - ``kind``: ``"unilateral"`` (default): contact opens and closes. ``"bilateral"``: all gaps that have an opposite
              side are closed from the beginning and stay so (no separation), with frictionless sliding.
              ``"bilateral_once_closed"``: no separation of nodes that are closed at the end of a load step.
              ``"tied"``: neither separation nor sliding; the sides are paired once, in the reference configuration,
              and their relative displacement is zero. An initial gap is kept and acts as a rigid arm that rotates with
              the primary facet. ``"gap_only"``: gaps are evaluated, negative where the sides penetrate, without forces.
            - ``clearance``: added to the gap, a number or a function from reference positions (n, dim) on the secondary
              side to lengths (n,): positive for a clearance, negative for an interference, as of a press fit [length].
              ``clearance_primary``: the same on the primary side, at the opposite positions. ``clearance_ramp``: their
              ramp, pairs (instant, multiplier), by default constant. ``friction_ramp``: the ramp of the coefficient of
              friction.
            - ``surface_smoothing``: whether gaps are measured between the smooth surfaces that straight facets of curved
              sides approximate; by default with mortar alone.
            - ``excluded``: groups whose nodes carry no contact. Their tributary area carries no pressure (node-to-segment,
              mortar with one gap per node), nor do integration points nearer to such a node than to any other. Both sides
              may share such nodes. ``frictionless``: groups whose nodes carry no friction, likewise.
              ``frictionless_along``: a vector (dim,) along which these nodes, or without ``frictionless`` all, have neither
              friction nor slip; across it they keep both [-].
            - ``penalty``: pressure per penetration [pressure / length], by default exact constraints; or a table of
              pairs (overclosure, pressure), ascending from zero pressure [length, pressure]; or ``{"clearance": c,
              "pressure": p}``, an exponential law with the pressure p at zero gap and p / 100 at the gap c. It does
              not regularise friction;
              ``tangential_penalty`` does: shear per tangential displacement of sticking nodes, a number or a function of
              the secondary position [pressure / length].
            - ``cohesion``: bilinear cohesive zone, a mapping of ``strength`` [pressure] and fracture ``energy`` per
              area [pressure length], and optionally ``shear_strength``, ``shear_energy`` (by default those of opening),
              ``stiffness`` (by default such that the strength is reached at a hundredth of the opening at break)
              [pressure / length], ``mixed_mode``, ``"bk"`` (Benzeggagh and Kenane) or ``"power"``, with its ``exponent`` (2)
              [-], and ``initiation``: ``"bk"``, ``"quadratic"`` or ``"maximum"``. It is stress-free in the reference
              configuration, also across gaps, and keeps its stiffness in compression. ``adhesion``: reversible attraction,
              a mapping of the ``work`` of adhesion per area, ``strength`` and ``stiffness``, without tangential resistance.
            - ``slip``: ``"symmetric"`` (default): closing a gap along the mean normal of both sides is no slip;
              ``"primary"``: all relative motion tangential to the primary side is slip, as in code_aster.
            - ``wear``: Archard's coefficient divided by the hardness: ``coefficient * pressure * slip`` is removed from the
              secondary side at the end of each load step [1 / pressure].
            - ``conductance``: heat flux per temperature difference: a number, valid in contact; a function of pressures and
              gaps (m,); pairs (pressure, conductance); or a mapping of ``"pressure"`` and ``"gap"`` to pairs. By default the
              contact is insulated. ``friction_heat``: fraction of the work of friction that becomes heat, half of it on each
              side, with load factors as times [-]. ``obstacle_temperature``: of a rigid obstacle [temperature].
            - ``search_distance``: largest distance, and largest penetration, at which points have an opposite side, both now
              and at the beginning of the load step [length].
            - ``normals``: ``"facet"``; ``"averaged"`` over the facets that meet at a node at less than 45 degrees, which
              conforming curved sides need; ``"secondary"``: those of the secondary side; or a vector (dim,), the outward
              normal of the whole primary side [-]. ``projection_tolerance``: how far points may project beyond the end of
              the primary side and still carry force, in facet lengths.

        Examples
        --------
        >>> import fastcontact as fc
        >>> model = fc.Model(fc.generate.half_spheres(size=10.0), kinematics="axisymmetric")
        >>> model.add_contact("hertz", secondary="CONT1", primary="CONT2", friction=0.2)
        >>> model.contact[0].formulation
        'mortar'
        """
        chosen: dict[str, Any] = {option: value for option, value in options.items() if value is not None}
        if formulation is None:
            formulation, chosen, reason = default_formulation(self.mesh.dim, chosen)
            log.info("contact '%s': %s, since %s", name, method(formulation, chosen), reason)
        self._add_pair(ContactPair(name, secondary, primary, formulation, chosen))

    def add_contacts(
        self,
        *,
        distance: float | None = None,
        angle: float = 45.0,
        groups: Sequence[str] | None = None,
        formulation: str | None = None,
        **options: Unpack[ContactOptions],
    ) -> FoundContacts:
        """Find the surfaces of different bodies that face each other, and add a contact pair for each two of them.

        Groups of their facets are added to the mesh of the model. Surfaces of pairs that were added before and pretension
        sections are skipped.

        Parameters
        ----------
        distance, angle, groups
            As in `find_contacts`. Between equally fine sides, that of the softer material is secondary if materials have been
            assigned.
        formulation, **options
            Of all pairs, as in `add_contact`: ``friction=0.2``, ``kind="tied"``.

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
        moduli = None
        if self.materials:
            stiffness = np.array([material.contact_modulus for material, _ in self.materials])
            moduli = {name: stiffness[rows] for name, rows in self.material_of_cells().items()}
        contacts = find_contacts(self.mesh, distance=distance, angle=angle, groups=groups, moduli=moduli)
        if not contacts.pairs:
            raise ContactError(nothing_found(self.mesh, distance, angle, groups))
        self.mesh, added = contacts.mesh, []
        for pair in contacts:
            secondary, primary = pair.secondary, pair.primary
            ends = [self.mesh.points_of(group) for group in (secondary, primary)]
            if any(np.isin(side, [cut.nodes, cut.opposite]).all() for cut in self.pretensions for side in ends):
                continue
            if any(joined_already(self.mesh, (pair.secondary, pair.primary), other) for other in self.contact):
                log.info("contact '%s' is left out, since another one joins its facets already", pair.name)
                continue
            self.add_contact(pair.name, secondary=secondary, primary=primary, formulation=formulation, **options)
            self.contact[-1] = dataclasses.replace(self.contact[-1], found_gap=pair.gap[0])
            added.append(pair)
        if not added and options:  # check the options anyway
            checked = copy.copy(self)
            checked.contact = []
            checked.add_contact("contacts", formulation=formulation, secondary=secondary, primary=primary, **options)
        return FoundContacts(self.mesh, tuple(added))

    def add_fluid_pressure(self, contact: str, pressure: float, *, source: str, ramp: History = None) -> None:
        """Let a fluid penetrate a contact pair: it acts on both sides wherever they are open and connected to its source.

        Starting at the source, the fluid advances from facet to facet where the sides are open, or where their contact
        pressure does not exceed its own. There it acts on the secondary side along its own normals, in finite strain those
        of the deformed surface, and on the primary side along its own (``fluid_pressure`` of the results). Its action on
        other surfaces is a load, see `add_pressure`.

        Parameters
        ----------
        contact : str
            Name of a contact pair or an obstacle.
        pressure : float
            Fluid pressure at multiplier 1 [pressure].
        source : str
            Group with the nodes of the secondary side where the fluid enters: its edge, or all of it.
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
        changed = dataclasses.replace(self.contact[index], fluid=fluid)
        self.bind(changed)
        self.contact[index] = changed

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
        name, secondary
            As in `add_contact`.
        obstacle : Obstacle
            A shape of `fastcontact.obstacles`, or any object with their ``distance`` method.
        motion : mapping of str to float, optional
            Its displacement at multiplier 1, e.g. ``{"y": -0.1}``; by default zero [length].
        force : mapping of str to float, optional
            The force on it at multiplier 1, e.g. ``{"y": -100.0}`` [force], in axisymmetry over the full circle. In these
            components the obstacle is a free rigid body, held by contact alone; in the others it follows `motion`. Its
            displacement is in the results.
        rotation : mapping, optional
            Rotation about an axis: ``angle`` at multiplier 1 [radian]; ``centre``, a point on the axis (dim,) before any
            motion, which the axis follows [length]; in 3D ``axis``, its direction; ``ramp``, a history of its own. The
            torque about the axis is in the results. Not in axisymmetry.
        ramp : Ramp or iterable of (float, float), optional
            History of motion and force, and of a rotation without its own.
        formulation : str, optional
            ``"node_to_segment"`` (node against obstacle), the default on linear triangles and, in 3D, on facets whose nodes
            all carry pressure (tri3, quad4, quad9); ``"mortar"`` with one weighted gap per node, the default in 3D on
            other quadratic facets with friction; or ``"continuous"``, the default elsewhere.
        **options
            As in `add_contact`.

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
        moves = axes_of(f"the motion of obstacle '{name}'", dict(motion), self.mesh.dim) if motion else {}
        displacement = tuple(float(moves.get(axis, 0.0)) for axis in range(self.mesh.dim))  # type: ignore[arg-type]
        if not np.isfinite(displacement).all():
            raise ModelError(f"the motion {motion} of obstacle '{name}' must be finite numbers")
        if isinstance(obstacle, MeshedSurface):
            obstacle.check_apart(self.mesh)
        obstacle.distance(self.mesh.points[:1])  # raises an error for a wrong dimension
        history = table_of(ramp, f"the ramp of the motion of obstacle '{name}'")
        chosen: dict[str, Any] = {option: value for option, value in options.items() if value is not None}
        if formulation is None:
            kinds = self._facet_kinds(secondary)
            formulation, chosen, reason = against_obstacle(self.mesh.dim, *kinds, chosen)
            log.info("contact '%s': %s, since %s", name, method(formulation, chosen), reason)
        if formulation == "mortar":
            chosen.setdefault("multipliers", "dual")
        driving = self._driving(name, moves, force)
        turned = rotation_of(f"the rotation of obstacle '{name}'", rotation, self.kinematics)
        self._add_pair(
            ContactPair(name, secondary, "", formulation, chosen, obstacle, displacement, history, driving, *turned)
        )

    def _source(self, pair: ContactPair, side: Surface, options: PairOptions) -> Mask | None:
        """Return the source nodes (n_points,) of the fluid in a pair, None without a fluid."""
        if pair.fluid is None:
            return None
        mask = np.zeros(self.mesh.n_points, bool)
        mask[self.mesh.points_of(pair.fluid.source)] = True
        if not mask[side.points].any():
            raise ContactError(
                f"the source '{pair.fluid.source}' of the fluid in contact '{pair.name}' has no nodes of the secondary side "
                f"'{side.group}': name a group that has"
            )
        if options.kind != "unilateral" or options.cohesion is not None:
            raise ContactError(
                f"contact '{pair.name}' is {'glued' if options.cohesion else options.kind}, which lets no fluid in: name "
                "another pair"
            )
        return mask

    def _facet_kinds(self, group: str) -> tuple[list[str], bool]:
        """Return the kinds of facets of a group, and whether all belong to linear triangles or tetrahedra."""
        facets = self.mesh.cells_of(group, self.mesh.dim - 1) if group in self.mesh.cell_groups else {}
        if not facets:  # reported by `check`
            return [], False
        simplices = [block for name, block in self.mesh.solids.items() if name in ("tri3", "tet4")]
        of_simplices = any(np.isin(self.mesh.points_of(group), block).all() for block in simplices)
        return list(facets), of_simplices

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
        """The force-driven rigid obstacles."""
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

    def bind(self, pair: ContactPair, held: HeldMotions | None = None, *, sectors_alike: bool = True) -> Formulation:
        """Return the formulation of a contact pair on this mesh; see `add_contact` for the errors.

        `held` are the nodal motions that supports and multi-point constraints prescribe, if known; `sectors_alike`
        states whether pressures are equal at both ends of a sector.
        """
        check_known("contact formulation", pair.formulation, FORMULATIONS, ContactError)
        kind = FORMULATIONS[pair.formulation].variant(self.mesh.dim, pair.options)
        set_here = ("secondary", "primary", "points", "axisymmetric", "modulus", "options", "held")
        known = [*SHARED_OPTIONS, *(f.name for f in dataclasses.fields(kind) if f.init and f.name not in set_here)]
        for option in pair.options:
            check_known(f"option of {pair.formulation}", option, known, ContactError)
        specific = {key: value for key, value in pair.options.items() if key not in SHARED_OPTIONS}
        check_fields(f"contact '{pair.name}'", specific, kind, ContactError)
        ends = [
            (interface.first, interface.second, np.eye(self.mesh.dim) if interface.turn is None else interface.turn)
            for interface in self.periodic_interfaces
        ]
        secondary = surface(self.mesh, pair.secondary).with_periodic_ends(ends)
        options = pair_options(
            pair.name, pair.options, self.mesh, secondary, against_obstacle=pair.obstacle is not None
        )
        primary: Surface | RigidSide
        if pair.obstacle is not None:
            if not kind.against_obstacles:
                raise ContactError(
                    f"contact '{pair.name}': mortar in two dimensions needs multipliers='dual' at an obstacle"
                )
            primary = RigidSide(pair.obstacle, np.array(pair.motion), pair.rotation)
            specific.setdefault("surface_smoothing", False)
        else:
            primary = surface(self.mesh, pair.primary).with_periodic_ends(ends)
            check_sides(self.mesh, pair.name, secondary, primary, options.excluded)
        modulus = min((m.contact_modulus for m, _ in self.materials), default=1.0)
        axisymmetric = self.kinematics == "axisymmetric"
        interfaces = [interface for interface in self.periodic_interfaces if interface.turn is None or sectors_alike]
        turning = next(
            (e.rotation for e in interfaces if e.rotation and np.isin(e.second, secondary.points).any()), None
        )
        options = dataclasses.replace(
            options, same_place=same_place(interfaces, self.mesh.n_points), turning=turning,
            source=self._source(pair, secondary, options),
        )  # fmt: skip
        return kind(secondary, primary, self.mesh.points, axisymmetric, modulus, options=options, held=held, **specific)
