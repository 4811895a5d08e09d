"""Construction of the model and the ramp from the content of a deck."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.sparse import csr_array, vstack

from fastcontact._tools.neighbours import nearest
from fastcontact.arrays import Array
from fastcontact.cases.decks import constraints, interactions, loads, meshing
from fastcontact.cases.decks.assembled import Element, qualified
from fastcontact.cases.decks.axes import axes_by_cell, local_axes, orientation_of
from fastcontact.cases.decks.blocks import errors_at, key_of, look_up
from fastcontact.cases.decks.conditions import Component, Conditions
from fastcontact.cases.decks.content import Content, Material, Pair, Section
from fastcontact.cases.decks.gaps import GAP_TOLERANCE, add_gap_facets, add_gaps, add_springs
from fastcontact.cases.decks.histories import Period, ShapeGroups
from fastcontact.cases.decks.materials import law_of, strain_of
from fastcontact.cases.decks.sections import add_sections, add_sectors, cut_sections, sections_by_point
from fastcontact.cases.decks.steps import MOST_INCREMENTS
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.integration import all_nodes_carry_pressure
from fastcontact.elasticity.material_axes import CylindricalAxes
from fastcontact.elasticity.multipoint_constraints import MultiPointConstraint, TemporaryConstraint
from fastcontact.elasticity.nonlinear_materials import ElasticPlastic
from fastcontact.model.contact_pair import ContactPair
from fastcontact.model.model import Model
from fastcontact.model.ramp import Ramp, Table
from fastcontact.model.relation_rows import rows_along

# Largest number of instants of a ramp. A larger number is treated as an error.
LONGEST_RAMP = 100_000


class Building:
    """Model and ramp of a deck.

    Attributes
    ----------
    content : Content
        Content of the deck.
    assembly : DeckMesh
        Assembly of the deck, with the groups of its mesh.
    model : Model
        Model of the deck.
    ramp : Ramp
        Load steps.
    thickness : float
        Thickness of a plane model [length]. The forces in the model are per unit thickness.
    sections : dict of int to PretensionSection
        Pretension sections by the points of their nodes.
    local_supports : list of MultiPointConstraint
        Supports that are expressed as constraints, because they act along local axes or not in all steps. They are the first
        constraints of the model.
    small_strain_cause : str
        Reason why small strains are assumed although a step has NLGEOM; otherwise empty.
    prescribed_motions : dict of (int, int) to Table
        Prescribed motions [length] of nodes of gap elements that belong to no solid, by point and component.
    gap_ends : dict of str to dict of int to int
        Second node of a gap element by its first node, for each contact that consists of gap elements and an obstacle.
    """

    def __init__(self, content: Content, case_text: str) -> None:
        self.content = content
        self.assembly = meshing.deck_mesh_of(content)
        only_heat = content.heat == "uncoupled"
        if not only_heat:
            constraints.add_rotation_points(self.assembly)
        materials, self.thickness = self._materials()
        self.sections = sections_by_point(self.assembly)
        conditions = Conditions(self.assembly)
        self._check_contact_pairs()
        conditions.record()
        adders = loads.distributed_loads(self.assembly, conditions.loads)
        adders += loads.distributed_loads(self.assembly, conditions.fluxes)
        adders += loads.heat_loads(self.assembly, conditions, self.thickness)
        gaps = [] if only_heat else add_gap_facets(self.assembly)
        mesh = self.assembly.mesh()
        mesh = mesh if only_heat else cut_sections(self.assembly, mesh, self.sections.values())
        strain, self.small_strain_cause = strain_of(content, [law for law, _ in materials])
        options: dict[str, Any] = {"strain": strain, "reference_temperature": conditions.reference}
        self.model = Model(mesh, self.assembly.kinematics, case_text, **options)
        for material, group in materials:
            self.model.add_material(material, group)
        self.local_supports: list[MultiPointConstraint] = []
        self.prescribed_motions: dict[tuple[int, int], Table] = {}
        if only_heat:
            all_points = loads.point_group(self.model, self.assembly, "held", range(mesh.n_points))
            self.model.fix(all_points, "xyz"[: mesh.dim])
            add_sectors(self.model, self.assembly)
        else:
            self._add_mechanics(conditions)
        for add in adders:
            add(self.model)
        self._add_contact()
        self.gap_ends = add_gaps(self.model, self.assembly, gaps, conditions)
        self.ramp = self._ramp(conditions)

    def _add_mechanics(self, conditions: Conditions) -> None:
        """Add supports, constraints, loads, temperatures and springs to the model."""
        self._add_supports(conditions)
        self.model.relations += [*self.local_supports, *constraints.relations_of(self.assembly, self.model.mesh)]
        add_sections(self.model, self.assembly, self.sections, conditions)
        add_sectors(self.model, self.assembly)
        loads.add_forces(self.model, self.assembly, conditions, self.thickness)
        loads.add_temperatures(self.model, conditions.given_temperatures)
        loads.add_initial_stresses(self.model, self.assembly)
        add_springs(self.model, self.assembly, self.thickness)

    def _materials(self) -> tuple[list[tuple[Any, str]], float]:
        """Return the materials with their groups of solids, and the thickness [length].

        Raises CaseError for missing sections.
        """
        thickness: float | None = None
        for scope in self.assembly.scopes:
            for section in self.assembly.part(scope).sections:
                material: Material = look_up("material", section.material, self.content.materials, section)
                if material.law is None and self.content.heat != "uncoupled":
                    raise material.error(f"material '{material.name}' has no *ELASTIC")
                if self.assembly.dim == 2 and self.assembly.kinematics != "axisymmetric":
                    section_thickness = 1.0 if section.thickness is None else section.thickness
                    if thickness is not None and section_thickness != thickness:
                        raise section.error(
                            f"thickness {section_thickness:g} after {thickness:g}: plane models have one thickness"
                        )
                    thickness = section_thickness
                for element in self.assembly.elements_of(qualified(scope, section.elements), section.location):
                    if element.section not in (None, section):
                        raise section.error(
                            f"element {element.number} has a section already, in line {element.section.location.line}"
                        )
                    element.section = section
        if missing := [element for element in self.assembly.solids if element.section is None]:
            cell = missing[0].cell
            count = f"{len(missing)} element" + "s" * (len(missing) > 1)
            set_text = f" of set '{cell.element_set}'" if cell.element_set else ""
            raise cell.error(f"{count} ({missing[0].number}){set_text} has no section, so no material")
        by_material: dict[tuple[str, str, bool], list[Any]] = {}
        for element in self.assembly.solids:
            section = element.section
            key = (key_of(section.material), key_of(section.orientation), element.type.incompatible_modes)
            by_material.setdefault(key, []).append(element)
        materials = []
        for (name, orientation, incompatible_modes), members in by_material.items():
            material = self.content.materials[name]
            axes = self._axes(members[0].section, members)
            group = f"material {material.name}" + (f" along {orientation.lower()}" if orientation else "")
            group += " with incompatible modes" if incompatible_modes else ""
            law = law_of(self.content, material, axes, incompatible_modes)
            materials.append((law, self.assembly.add_solids(group, members)))
        return materials, thickness or 1.0

    def _axes(self, section: Section, members: Sequence[Element]) -> Any:
        """Return the material axes of the elements `members` of a section, or None for the global axes."""
        if not section.orientation:
            return None
        axes = orientation_of(self.content, section.orientation, section.location)
        rotated = {scope for scope, instance in self.content.instances.items() if instance.rotation}
        if axes.part is not self.content.root and any(element.scope in rotated for element in members):
            raise axes.error("axes of a part whose instance is rotated are not supported: give them in the assembly")
        if axes.distribution:
            return axes_by_cell(self.assembly, axes, members)
        if axes.cylindrical:
            a, b = np.reshape(axes.points, (2, 3))
            return CylindricalAxes(tuple(a.tolist()), tuple((b - a).tolist()))
        return tuple(tuple(row) for row in local_axes(axes, np.zeros(3)).tolist())

    def _check_contact_pairs(self) -> None:
        """Raise CaseError if a pair is defined twice or has an undefined surface or interaction."""
        pair_names: set[str] = set()
        for pair in self.content.pairs:
            meshing.check_nodes(self.assembly, pair.secondary, pair.location)
            self.assembly.faces(pair.primary, pair.location)
            if not pair.tied:
                look_up("surface interaction", pair.interaction, self.content.interactions, pair)
            if key_of(pair.name) in pair_names:
                raise pair.error(f"the pair {pair.name} is given twice")
            pair_names.add(key_of(pair.name))

    def _add_supports(self, conditions: Conditions) -> None:
        """Add the supports, and record the prescribed motions of nodes that belong to gap elements only.

        Supports that do not act in all steps share a constraint if they have the same period and history. A support that
        locks a pretension section is left to `add_sections`.
        """
        by_shape, local_supports = ShapeGroups[int](), []
        ends = {e.points[1] for e in self.assembly.discrete if e.cell.type == "GAPUNI"}
        free_ends = ends - self.assembly.solid_points if ends else ends
        for table, period, components in conditions.supports.tables_by_period():
            remaining = [c for c in components if not (period.fixed and c[1] == 0 and c[0] in self.sections)]
            if remaining and not period.permanent:
                self.local_supports.append(self._temporary_support(conditions, table, period, remaining))
            for component in remaining if period.permanent else ():
                point, axis, local = component
                if point in free_ends:
                    self.prescribed_motions[point, axis] = table
                elif local:
                    label = f"the support of {conditions.description(component)} on local axes"
                    row = self._support_row(conditions, component)
                    local_supports.append(MultiPointConstraint(label, row, 1.0, table))
                else:
                    by_shape.add(axis, table, [point])
        self.local_supports += local_supports
        for axis, points, value, table in by_shape:
            group = loads.point_group(self.model, self.assembly, "support", points)
            if callable(value) or any(factor for _, factor in table):
                self.model.prescribe(group, ramp=table, **{"xyz"[axis]: value})
            else:
                self.model.fix(group, "xyz"[axis])
        if self.assembly.dim == 2 and (rotations := self.assembly.rotations.values()):
            self.model.fix(loads.point_group(self.model, self.assembly, "rotation", rotations), "y")

    def _temporary_support(
        self, conditions: Conditions, table: Table, period: Period, components: Sequence[Component]
    ) -> TemporaryConstraint:
        """Return the constraint of displacement components that are prescribed in a period."""
        ends = "" if period.ends == np.inf else f" to {period.ends:g}"
        line = f", line {period.location.line}" if period.location else ""
        label = f"the support of {conditions.description(components[0])}{line}, from {period.begins:g}{ends}"
        rows = csr_array(vstack([self._support_row(conditions, component) for component in components]))
        return TemporaryConstraint(label, rows, 1.0, table, period.begins, period.ends, keeps=period.fixed)

    def _support_row(self, conditions: Conditions, component: Component) -> csr_array:
        """Return the constraint row (1, n_dofs) [-] of the displacement component that a support prescribes."""
        point, axis, local = component
        direction = (conditions.directions[point] if local else np.eye(3))[[axis], : self.assembly.dim]
        return rows_along(np.array([point]), direction, self.model.n_dofs)

    def _add_contact(self) -> None:
        """Add the contact pairs and ties of the deck."""
        for pair in self.content.pairs:
            secondary, primary = (
                meshing.group_of_surface(self.assembly, name) for name in (pair.secondary, pair.primary)
            )
            with errors_at(pair):
                options = self._pair_options(pair)
                if secondary in self.assembly.excluded:
                    options.update(self._node_based_options(pair, secondary))
                self.model.add_contact(f"{secondary}/{primary}", secondary=secondary, primary=primary, **options)

    def _node_based_options(self, pair: Pair, secondary: str) -> dict[str, Any]:
        """Return the options that exclude nodes from contact: those on the facets, but not in the node-based surface."""
        excluded = loads.point_group(self.model, self.assembly, "without contact", self.assembly.excluded[secondary])
        options: dict[str, Any] = {"excluded": excluded}
        if all(map(all_nodes_carry_pressure, self.assembly.groups[secondary])):
            options["formulation"] = "node_to_segment"
        self.content.note(
            pair, f"the nodes of surface '{pair.secondary}' do not form whole faces: of the facets around them, only "
            "these nodes are in contact"
        )  # fmt: skip
        return options

    def _pair_options(self, pair: Pair) -> dict[str, Any]:
        """Return the options of a contact pair or a tie. Raises CaseError if its interaction is not supported."""
        only_heat = self.content.heat == "uncoupled"
        if pair.tied:
            options: dict[str, Any] = {"kind": "gap_only" if only_heat else "tied"}
            if self.content.heat:
                options["conductance"] = interactions.perfect_conductance(self.content, self.model, pair.location)
            return options
        law = self.content.interactions[key_of(pair.interaction)]
        options = interactions.conductance_of(self.content, law) if self.content.heat else {}
        if only_heat:
            options["kind"] = "gap_only"
        elif law.cohesion:
            options |= interactions.cohesion_of(self.content, law)
        else:
            options |= interactions.kind_and_friction_of(self.content, law)
        return options | self._clearance_option(pair, glued=bool(law.cohesion) and not only_heat)

    def _clearance_option(self, pair: Pair, glued: bool = False) -> dict[str, Any]:
        """Return the option `clearance` that ADJUST or *CLEARANCE requires, or an empty dictionary if none is required.

        Raises CaseError if *CLEARANCE is given for sides whose distance varies, or if `glued` sides have a gap, across which
        the cohesive layer would not act.
        """
        if not (pair.adjust or glued) and pair.clearance is None:
            return {}
        secondary, primary = (meshing.group_of_surface(self.assembly, name) for name in (pair.secondary, pair.primary))
        gaps, positions = nodal_gaps(self.model, secondary, primary, self.assembly.excluded.get(secondary, []))
        tolerance = GAP_TOLERANCE * float(np.ptp(self.model.mesh.points, axis=0).max())
        if glued:
            if gaps.max() > tolerance or pair.clearance is not None:
                raise pair.error(f"a cohesive layer between sides that are {gaps.max():.6g} apart is not supported")
            return {}
        if pair.clearance is not None:
            if np.ptp(gaps) > tolerance:
                raise pair.error(
                    f"*CLEARANCE is supported between sides at a uniform distance only, and these are {gaps.min():.6g} to "
                    f"{gaps.max():.6g} apart"
                )
            return {"clearance": pair.clearance - float(gaps.mean())}
        try:
            adjusted = gaps <= float(pair.adjust)
        except ValueError:
            nodes = self.model.mesh.points[self.assembly.nodes(pair.adjust, pair.location)]
            adjusted = nearest(nodes, positions)[0] <= tolerance
        closed = gaps[adjusted & (np.abs(gaps) > tolerance)]
        if not len(closed):
            return {}
        uniform = np.ptp(gaps) <= tolerance and adjusted.all()
        varying = f"of {closed.min():.6g} to {closed.max():.6g} at {len(closed)} nodes"
        distance = f"{gaps.mean():.6g}" if uniform else varying
        self.content.note(pair, f"ADJUST: the distance {distance} of the sides is taken as zero")
        if uniform:
            return {"clearance": -float(gaps.mean())}
        clearances = -np.where(adjusted, gaps, 0.0)
        return {"clearance": lambda points: clearances[nearest(positions, points)[1]]}

    def _ramp(self, conditions: Conditions) -> Ramp:
        """Return the ramp, whose instants are the ends of all steps and the corners of all histories.

        In path-dependent models (friction, cohesive contact, elastic-plastic bodies) each step is divided into increments.
        """
        steps = self.content.steps
        instants = {float(number) for number in range(1, len(steps) + 1)}
        plastic = any(isinstance(law, ElasticPlastic) for law, _ in self.model.materials)
        if plastic or any(pair.options.get("friction") or "cohesion" in pair.options for pair in self.model.contact):
            for number, step in enumerate(steps):
                count = max(1, round(min(MOST_INCREMENTS, step.period / min(step.increment, step.period))))
                instants.update(number + k / count for k in range(1, count))  # ends of equal increments
        # Corners within 1e-6 of the end of a step are that end or belong to a jump, which needs no separate instant.
        for histories in conditions.histories:
            for track in set(histories.tracks.values()):
                instants.update(round(time, 12) for time, _ in track.table if abs(time - round(time)) > 1e-6)
        if len(instants) > LONGEST_RAMP:
            raise steps[0].error(f"the histories have {len(instants)} corners, more than {LONGEST_RAMP}")
        return Ramp(tuple(sorted(instants)), ((0.0, 0.0), (float(len(steps)), 1.0)))


def nodal_gaps(model: Model, secondary: str, primary: str, excluded: Sequence[int]) -> tuple[Array, Array]:
    """Return the gaps (n,) [length] of the secondary nodes that face the primary side, and their positions (n, dim) [length].

    Nodes in `excluded` are left out. If no node remains, the result is a gap of zero at the first point.
    """
    pair = ContactPair("gaps", secondary, primary, "continuous", {})
    formulation, points = model.bind(pair), model.mesh.points
    gaps, _ = formulation.nodal_gap(Configuration.undeformed(points))
    facing = np.isfinite(gaps) & ~np.isin(formulation.secondary.points, excluded)
    return (gaps[facing], points[formulation.secondary.points[facing]]) if facing.any() else (np.zeros(1), points[:1])
