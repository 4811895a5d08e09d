"""From the content of a deck to a model and a ramp."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from scipy.sparse import csr_array, vstack
from scipy.spatial import cKDTree

from fastcontact.arrays import Array
from fastcontact.cases.decks.assembled import Assembled, Element, assembled, facet_points
from fastcontact.cases.decks.blocks import Location, folded
from fastcontact.cases.decks.conditions import Acting, Component, Conditions, Distributed
from fastcontact.cases.decks.content import Content, Interaction, Material, Pair, Section, Step
from fastcontact.cases.decks.cyclic_symmetry import add_sectors
from fastcontact.cases.decks.histories import JUMP, shape_of
from fastcontact.cases.decks.initial_stresses import add_initial_stresses
from fastcontact.cases.decks.local_axes import local_axes, orientation_of
from fastcontact.cases.decks.meshing import DeckMesh, begun, group_of_surface, secondary_group
from fastcontact.cases.decks.nonlinear import strain_of
from fastcontact.cases.decks.pretension import add_sections, cut_sections
from fastcontact.cases.decks.relating import make_rotations, relations_of
from fastcontact.cases.decks.stepping import MOST_PARTS
from fastcontact.cases.decks.temperatures import add_temperatures
from fastcontact.contact.integration import all_nodes_carry
from fastcontact.contact.obstacles.shapes import HalfSpace
from fastcontact.elasticity.anisotropic_materials import Orthotropic
from fastcontact.elasticity.material_axes import CylindricalAxes
from fastcontact.elasticity.materials import LinearElastic
from fastcontact.elasticity.multipoint_constraints import MultiPointConstraint, TemporaryConstraint
from fastcontact.elasticity.nonlinear_materials import NonlinearElastic
from fastcontact.errors import FastcontactError
from fastcontact.model.model import Model
from fastcontact.model.ramp import Ramp, Table

# What a gap of the undeformed sides may be, relative to the size of the model, and still count as none.
TOUCHING = 1e-6
LONGEST_RAMP = 100_000


class Building:
    """A model in the making.

    Attributes
    ----------
    made, found : the assembly and its mesh
    model : Model
    thickness : float
        Of a plane model; forces of the model are those of a unit of it [length].
    local_supports : list of MultiPointConstraint
        Relations that are supports: those along local axes, and those that come or go between steps.
    linearised : str
        Why small strains are solved although a step has NLGEOM; empty where not.
    gap_ends : dict of str to dict of int to int
        By the name of a contact made of gap elements: its nodes, and the nodes behind the gaps.
    """

    def __init__(self, content: Content, case_text: str) -> None:
        self.content = content
        self.made: Assembled = assembled(content)
        self.found: DeckMesh = begun(self.made)
        make_rotations(self.found)
        materials, self.thickness = self._materials()
        conditions = Conditions(self.found)
        self._check_pairs()
        conditions.run()
        groups = self._groups(conditions)
        gaps = self._gap_groups()
        mesh = cut_sections(self.found, self.found.mesh())
        strain, self.linearised = strain_of(content, [law for law, _ in materials])
        self.model = Model(mesh, self.found.kinematics, case_text, strain=strain)
        for material, group in materials:
            self.model.add_material(material, group)
        self.local_supports: list[MultiPointConstraint] = []
        self._supports(conditions)
        self.links = relations_of(self.found, self.model.mesh)
        self.model.relations.extend(self.links)
        self.links += add_sections(self.model, self.found, conditions.locks)
        self.links += add_sectors(self.model, self.found)
        self._forces(conditions)
        self._pressures(groups)
        self._body_forces(conditions)
        add_temperatures(self.model, conditions.temperatures)
        add_initial_stresses(self.model, self.found)
        self._springs()
        self._contact()
        self.gap_ends = self._gaps(gaps, conditions)
        self.ramp = self._ramp(conditions)

    def _materials(self) -> tuple[list[tuple[Any, str]], float]:
        """Return materials with groups of solids, and the thickness; every solid needs a section."""
        thickness: float | None = None
        for scope in self.made.scopes:
            for section in self.made.part(scope).sections:
                self._material(section)
                if self.found.dim == 2 and self.found.kinematics != "axisymmetric":
                    section_thickness = 1.0 if section.thickness is None else section.thickness
                    if thickness is not None and section_thickness != thickness:
                        raise section.location.refuse(
                            f"thickness {section_thickness:g} after {thickness:g}: plane models have one thickness"
                        )
                    thickness = section_thickness
                name = f"{scope}.{section.elements}" if scope else section.elements
                for element in self.made.elements_of(name, section.location):
                    if element.section not in (None, section):
                        raise section.location.refuse(
                            f"element {element.number} has a section already, in line {element.section.location.line}"
                        )
                    element.section = section
        self._check_sections()
        by_material: dict[tuple[str, str, bool], list[Any]] = {}
        for element in self.made.solids:
            given = element.given_section
            key = (folded(given.material), folded(given.orientation), element.solid.modes)
            by_material.setdefault(key, []).append(element)
        materials = []
        for (name, turned, modes), members in by_material.items():
            material = self.content.materials[name]
            axes = self._axes(members[0].section)
            group = f"material {material.name}" + (f" along {turned.lower()}" if turned else "")
            group += " with incompatible modes" if modes else ""
            materials.append(
                (
                    _law(self.content, material, axes, modes),
                    self.found.add_solids(group, members),
                )
            )
        return materials, thickness or 1.0

    def _axes(self, section: Section) -> Any:
        """Return the axes of the material of a section, None for those of the mesh."""
        if not section.orientation:
            return None
        axes = orientation_of(self.content, section.orientation, section.location)
        if axes.cylindrical:
            a, b = np.array(axes.points[:3]), np.array(axes.points[3:])
            return CylindricalAxes(tuple(a.tolist()), tuple((b - a).tolist()))
        return tuple(tuple(row) for row in local_axes(axes, np.zeros(3)).tolist())

    def _material(self, section: Section) -> Material:
        material = self.content.materials.get(folded(section.material))
        if material is None:
            known = ", ".join(m.name for m in self.content.materials.values()) or "none"
            raise section.location.refuse(f"material '{section.material}' is not defined; materials: {known}")
        if material.law is None:
            raise material.location.refuse(f"material '{material.name}' has no *ELASTIC")
        return material

    def _check_sections(self) -> None:
        without = [element for element in self.made.solids if element.section is None]
        if without:
            cell = without[0].cell
            many = "1 element" if len(without) == 1 else f"{len(without)} elements"
            named = f" of set '{cell.set}'" if cell.set else ""
            raise cell.location.refuse(f"{many} ({without[0].number}){named} has no section, so no material")

    def _check_pairs(self) -> None:
        """Refuse pairs whose surfaces or interaction are not there."""
        seen: set[str] = set()
        for pair in self.content.pairs:
            secondary_group(self.found, pair.secondary, pair.location)
            self.made.faces(pair.primary, pair.location)
            if not pair.tied and folded(pair.interaction) not in self.content.interactions:
                known = ", ".join(i.name for i in self.content.interactions.values()) or "none"
                raise pair.location.refuse(
                    f"surface interaction '{pair.interaction}' is not defined; interactions: {known}"
                )
            if folded(pair.name) in seen:
                raise pair.location.refuse(f"the pair {pair.name} stands there twice")
            seen.add(folded(pair.name))

    def _groups(self, conditions: Conditions) -> list[tuple[str, Table]]:
        """Make groups of the facets with the same history of pressure; return them."""
        by_table: dict[tuple[str, Table], list[Any]] = {}
        for table, names in conditions.loads.alike():
            for name in names:
                if name.face is not None:
                    by_table.setdefault((name.keyword, table), []).append(name.face)
        return [
            (self.found.add_facets(f"pressure {number}", faces), table)
            for number, ((_, table), faces) in enumerate(by_table.items(), start=1)
        ]

    def _point_group(self, kind: str, points: Iterable[int]) -> str:
        """Return the name of a group of points of the mesh, which is made where there is none."""
        before = len(self.found.point_groups)
        name = self.found.add_points(f"{kind} {before}", points)
        if name not in self.model.mesh.point_groups:
            self.model.mesh = self.model.mesh.with_groups(points={name: sorted(set(points))})
        return name

    def _supports(self, conditions: Conditions) -> None:
        mesh, alike = self.model.mesh, {}  # type: tuple[Any, dict[tuple[int, Table], list[int]]]
        temporary = conditions.temporary()
        self._temporary_supports(conditions, temporary)
        at_times = {name for name, _ in temporary}
        for table, names in conditions.supports.alike():
            for name in (name for name in names if name not in at_times):
                point, axis, local = name
                if local:
                    self._local_support(conditions, name, table)
                else:
                    alike.setdefault((axis, table), []).append(point)
        for axis, points, value, table in _by_shape(alike):
            group = self._point_group("support", points)
            if callable(value) or any(factor for _, factor in table):
                self.model.prescribe(group, ramp=table, **{"xyz"[axis]: value})
            else:
                self.model.fix(group, "xyz"[axis])
        if mesh.dim == 2 and self.found.rotations:
            self.model.fix(self._point_group("rotation", self.found.rotations.values()), "y")

    def _temporary_supports(self, conditions: Conditions, temporary: Sequence[tuple[Component, Acting]]) -> None:
        """Add the supports that come or go between steps: those alike as one relation."""
        alike: dict[tuple[Acting, Table], list[Component]] = {}
        for name, acting in (entry for entry in temporary if entry[1].begins < entry[1].ends):
            alike.setdefault((acting, conditions.supports.table(name)), []).append(name)
        for (acting, table), names in alike.items():
            ends = "" if acting.ends == np.inf else f" to {acting.ends:g}"
            label = f"the support of {conditions.named(names[0])}, line {acting.location.line}, from {acting.begins:g}{ends}"
            rows = csr_array(vstack([self._support_row(conditions, name) for name in names]))
            self._relate_support(
                TemporaryConstraint(label, rows, 1.0, table, acting.begins, acting.ends, keeps=acting.keeps)
            )

    def _local_support(self, conditions: Conditions, name: Component, table: Table) -> None:
        label = f"the support of {conditions.named(name)} on local axes"
        self._relate_support(MultiPointConstraint(label, self._support_row(conditions, name), 1.0, table))

    def _relate_support(self, made: MultiPointConstraint) -> None:
        self.local_supports.append(made)
        self.model.relations.append(made)

    def _support_row(self, conditions: Conditions, name: Component) -> csr_array:
        """Return the row (1, n_dofs) of the displacement that a support prescribes [-]."""
        point, axis, local = name
        dim = self.found.dim
        direction = (conditions.directions[point] if local else np.eye(3))[axis][:dim]
        columns = point * dim + np.arange(dim)
        return csr_array((direction, (np.zeros(dim, int), columns)), shape=(1, self.model.n_dofs))

    def _forces(self, conditions: Conditions) -> None:
        alike: dict[tuple[int, Table], list[int]] = {}
        for table, names in conditions.forces.alike():
            along: dict[tuple[int, float], list[int]] = {}
            for point, axis, local in names:
                direction = conditions.directions[point][axis] if local else np.eye(3)[axis]
                for k in np.flatnonzero(np.abs(direction[: self.found.dim]) > 1e-12).tolist():
                    along.setdefault((k, float(direction[k])), []).append(point)
            for (k, cosine), points in along.items():
                scaled = tuple((t, v * cosine / self.thickness) for t, v in table)
                alike.setdefault((k, scaled), []).extend(points)
        for axis, points, value, table in _by_shape(alike):
            if any(factor for _, factor in table):
                group = self._point_group("force", points)
                self.model.add_force(group, distribute=False, ramp=table, **{"xyz"[axis]: value})

    def _pressures(self, groups: list[tuple[str, Table]]) -> None:
        for group, table in groups:
            if any(value for _, value in table):
                self.model.add_pressure(group, 1.0, ramp=table)

    def _body_forces(self, conditions: Conditions) -> None:
        for number, name in enumerate(conditions.loads.tracks, start=1):
            if name.face is not None:
                continue
            track = conditions.loads.tracks[name]
            by_density: dict[float, list[Any]] = {}
            for element in name.elements:
                if element.type is not None:
                    by_density.setdefault(self._density(element, name, track.location), []).append(element)
            for density, members in by_density.items():
                group = self.found.add_solids(f"load {number} of density {density:g}", members)
                self._name_solids(group)
                values = _body_force(name, density, self.found.dim)
                self.model.add_body_force(group, ramp=conditions.loads.table(name), **values)

    def _density(self, element: Element, name: Distributed, location: Location) -> float:
        if name.kind[0] == "B":
            return 1.0
        material = self._material(element.given_section)
        if material.density is None:
            raise location.refuse(f"material '{material.name}' has no *DENSITY, so {name.kind} is no force")
        return material.density

    def _name_solids(self, group: str) -> None:
        """Add a group of solids to the mesh that is made already; elements begin the numbers of cells."""
        offsets = self.model.mesh.offsets
        numbers = [offsets[name] + row for name, rows in self.found.groups[group].items() for row in rows]
        self.model.mesh = self.model.mesh.with_groups(cells={group: numbers})

    def _springs(self) -> None:
        for name, (location, stiffness) in self.content.springs.items():
            for element in self.made.elements_of(name, location):
                if element.cell.type != "SPRINGA":
                    raise location.refuse(f"element {element.number} is no spring of type SPRINGA")
                self.model.add_spring(element.points[0], element.points[1], axial=stiffness / self.thickness)
        self._check_discrete("SPRINGA", self.content.springs, "*SPRING")

    def _check_discrete(self, kind: str, given: Mapping[str, Any], needed: str) -> None:
        """Refuse springs and gap elements without properties."""
        with_one = {member for name, entry in given.items() for member in self.made.elements_of(name, entry[0])}
        for element in self.made.discrete:
            if element.cell.type == kind and element not in with_one:
                raise element.cell.location.refuse(f"element {element.number} of type {kind} has no {needed}")

    def _contact(self) -> None:
        for pair in self.content.pairs:
            secondary, primary = (group_of_surface(self.found, name) for name in (pair.secondary, pair.primary))
            options = {"kind": "tied"} if pair.tied else self._options(pair)
            if secondary in self.found.loose:
                options.update(self._at_nodes(pair, secondary))
            try:
                self.model.add_contact(f"{secondary}/{primary}", secondary=secondary, primary=primary, **options)
            except FastcontactError as error:
                raise pair.location.refuse(str(error)) from error

    def _at_nodes(self, pair: Pair, secondary: str) -> dict[str, Any]:
        """Return the options by which some nodes alone of the facets around them are in contact."""
        options: dict[str, Any] = {"excluded": self._point_group("without contact", self.found.loose[secondary])}
        if all(map(all_nodes_carry, self.found.groups[secondary])):
            options["formulation"] = "node_to_segment"
        self.content.note(
            pair.location, f"the nodes of surface '{pair.secondary}' make up no whole faces: they alone of the facets around "
            "them are in contact"
        )  # fmt: skip
        return options

    def _options(self, pair: Pair) -> dict[str, Any]:
        law = self.content.interactions[folded(pair.interaction)]
        options: dict[str, Any] = {}
        if law.kind != "unilateral":
            if law.friction or law.changes:
                raise law.location.refuse(f"friction with {law.kind} contact is not supported")
            options["kind"] = law.kind
        if law.penalty is not None and law.kind != "tied":
            options["penalty"] = law.penalty
        options.update(_friction(law, len(self.content.steps)))
        if pair.adjust or pair.clearance is not None:
            options.update(self._fitted(pair))
        return options

    def _fitted(self, pair: Pair) -> dict[str, Any]:
        """Return the clearance that brings the sides to where ADJUST or *CLEARANCE say; refused where no number does."""
        secondary, primary = (group_of_surface(self.found, name) for name in (pair.secondary, pair.primary))
        gaps, places = nodal_gaps(self.model, secondary, primary, self.found.loose.get(secondary, []))
        size = TOUCHING * float(np.ptp(self.model.mesh.points, axis=0).max())
        if pair.clearance is not None:
            if np.ptp(gaps) > size:
                raise pair.location.refuse(
                    f"*CLEARANCE is supported between sides of one distance, these are {gaps.min():.6g} to "
                    f"{gaps.max():.6g} apart"
                )
            return {"clearance": pair.clearance - float(gaps.mean())}
        try:
            within = float(pair.adjust)
        except ValueError:
            raise pair.location.refuse(f"ADJUST={pair.adjust[:40]}: only a distance is supported") from None
        moved = gaps[(gaps <= within) & (np.abs(gaps) > size)]
        if not len(moved):
            return {}
        apart = (
            f"{gaps.mean():.6g}"
            if np.ptp(gaps) <= size
            else f"of {moved.min():.6g} to {moved.max():.6g} at {len(moved)} nodes"
        )
        self.content.note(pair.location, f"ADJUST: the distance {apart} of the sides counts as none")
        if np.ptp(gaps) <= size:
            return {"clearance": -float(gaps.mean())}
        nodes, closing = cKDTree(places), -np.where(gaps <= within, gaps, 0.0)
        return {"clearance": lambda points: closing[nodes.query(points)[1]]}

    def _gap_groups(self) -> dict[str, tuple[str, list[tuple[int, int]]]]:
        """Make groups of the facets behind gap elements; return their names, with the points of each element."""
        groups = {}
        self._check_discrete("GAPUNI", self.content.gaps, "*GAP")
        for name, (location, _, _) in self.content.gaps.items():
            elements = self.made.elements_of(name, location)
            if any(element.cell.type != "GAPUNI" for element in elements):
                raise location.refuse("acts on elements of type GAPUNI only")
            ends = [element.points for element in elements]
            chosen = {pair[0] for pair in ends}
            faces = self.made.faces_within(chosen)
            shown = self.content.root.set_names.get(name, name)
            group = self.found.add_facets(f"{shown} facets", faces)
            covered = {p for face in faces for p in facet_points(*face)}
            if covered != chosen:
                raise location.refuse(
                    "gap elements are supported on all nodes of whole faces only, from the body to nodes that are held"
                )
            groups[name] = (group, [(pair[0], pair[1]) for pair in ends])
        return groups

    def _gaps(self, groups: Mapping[str, Any], conditions: Conditions) -> dict[str, dict[int, int]]:
        """Make contact with a rigid plane from gap elements to nodes that are held at rest."""
        ends = {}
        dim = self.found.dim
        for name, (group, pairs) in groups.items():
            location, clearance, vector = self.content.gaps[name]
            direction = np.array(vector)[:dim] / np.linalg.norm(vector)
            for _, end in pairs:
                tracks = [
                    conditions.supports.tracks.get((end, axis, False)) for axis in np.flatnonzero(direction).tolist()
                ]
                if any(track is None or any(v for _, v in track.points) for track in tracks):
                    raise location.refuse("gap elements are supported to nodes that are held at rest only")
            places = self.model.mesh.points[[first for first, _ in pairs]] @ direction
            if np.ptp(places) > TOUCHING * float(np.ptp(self.model.mesh.points, axis=0).max()):
                raise location.refuse(
                    "gap elements are supported where their nodes lie in a plane across their direction"
                )
            point = tuple((places.mean() + clearance) * direction)
            shown = self.content.root.set_names.get(name, name)
            wall = HalfSpace(point=point, normal=tuple(-direction))
            self.model.add_obstacle(shown, secondary=group, obstacle=wall, formulation="node_to_segment")
            ends[shown] = dict(pairs)
        return ends

    def _ramp(self, conditions: Conditions) -> Ramp:
        """Return the ends of all steps, of the increments of steps with friction, and the corners of all histories."""
        steps = self.content.steps
        instants = {float(number) for number in range(1, len(steps) + 1)}
        if any(pair.options.get("friction") for pair in self.model.contact):
            for number, step in enumerate(steps):
                instants.update(number + part for part in _parts(step))
        for histories in (conditions.supports, conditions.forces, conditions.loads, conditions.temperatures):
            for track in histories.distinct():
                instants.update(round(time, 12) for time, _ in track.points if abs(time - round(time)) > 1e-6)
        if len(instants) > LONGEST_RAMP:
            raise steps[0].location.refuse(f"the histories have {len(instants)} corners, more than {LONGEST_RAMP}")
        return Ramp(tuple(sorted(instants)), ((0.0, 0.0), (float(len(steps)), 1.0)))


def _friction(law: Interaction, n_steps: int) -> dict[str, Any]:
    """Return the options of a pair for its friction, which *CHANGE FRICTION changes at the beginning of steps."""
    table, sticks = [(0.0, law.friction)], {law.stick} if law.friction else set()
    for before, changed in law.changes:
        if changed.friction < 0.0 or changed.penalty is not None or changed.kind != law.kind:
            raise changed.location.refuse("one *FRICTION must follow, and nothing else of the interaction changes")
        table += [(float(before), table[-1][1]), (before + JUMP, changed.friction)]
        sticks |= {changed.stick} if changed.friction else set()
    largest = max(value for _, value in table)
    if not largest:
        return {}
    if len(sticks) > 1:
        raise law.changes[0][1].location.refuse("a stick slope that changes is not supported: give the same one")
    options: dict[str, Any] = {"friction": largest, "tangential_penalty": sticks.pop()}
    if law.changes:
        points = {**dict(table), float(n_steps): table[-1][1]}
        options["friction_ramp"] = [(time, value / largest) for time, value in sorted(points.items())]
    return options


def _law(content: Content, material: Material, axes: Any, modes: bool) -> Any:
    """Return the material of the model along axes, with its expansion and incompatible modes where elements have them."""
    assert material.law is not None
    law, expansion = material.law(axes), material.expansion
    if isinstance(law, NonlinearElastic):
        if modes:
            content.note(
                material.location, f"material '{material.name}': incompatible modes are left out, since it is nonlinear"
            )
        law = copy.copy(law)
        object.__setattr__(law, "density", material.density)
        return law
    law = replace(law, incompatible_modes=modes, density=material.density)
    heated = any(given.block.keyword == "TEMPERATURE" for step in content.steps for given in step.given)
    if expansion is None:
        if heated:
            content.note(
                material.location, f"material '{material.name}' has no *EXPANSION: temperatures do not strain it"
            )
        return replace(law, expansion=0.0) if heated else law
    if not heated:
        content.note(material.location, f"material '{material.name}': without temperatures the expansion has no effect")
    if isinstance(law, LinearElastic) and isinstance(expansion, tuple):
        law = Orthotropic((law.E,) * 3, (law.nu,) * 3, (law.E / (2.0 * (1.0 + law.nu)),) * 3, axes)
    return replace(law, expansion=expansion)


def _parts(step: Step) -> list[float]:
    """Return the ends of equal increments inside of a step, of its length."""
    count = max(1, round(min(MOST_PARTS, step.period / min(step.increment, step.period))))
    return [k / count for k in range(1, count)]


def _body_force(name: Distributed, density: float, dim: int) -> dict[str, Any]:
    """Return the components of a body force at the value 1 of its history."""
    if name.kind[0] == "B":
        return {name.kind[1].lower(): density}
    if name.kind == "GRAV":
        direction = np.array(name.vector) / np.linalg.norm(name.vector)
        return {"xyz"[k]: density * float(direction[k]) for k in range(dim) if direction[k]}
    origin, axis = np.array(name.vector[:3]), np.array(name.vector[3:])
    axis = axis / np.linalg.norm(axis)

    def component(k: int) -> Any:
        def outward(points: Array) -> Array:
            relative = np.pad(points, ((0, 0), (0, 3 - points.shape[1]))) - origin
            return np.asarray(density * (relative - np.outer(relative @ axis, axis))[:, k])

        return outward

    return {"xyz"[k]: component(k) for k in range(dim) if abs(axis[k]) < 1.0}


def nodal_gaps(model: Model, secondary: str, primary: str, without: Sequence[int]) -> tuple[Array, Array]:
    """Return how far nodes of one side that face the other are from it (n,), and where they are (n, dim) [length].

    Those `without` contact are left out.
    """
    from fastcontact.contact.configuration import Configuration
    from fastcontact.model.contact_pair import ContactPair

    pair = ContactPair("gaps", secondary, primary, "continuous", {})
    formulation, places = model.bind(pair), model.mesh.points
    gaps, _ = formulation.nodal_gap(Configuration.undeformed(places))
    faced = np.isfinite(gaps) & ~np.isin(formulation.secondary.points, without)
    return (gaps[faced], places[formulation.secondary.points[faced]]) if faced.any() else (np.zeros(1), places[:1])


def _by_shape(alike: Mapping[tuple[int, Table], list[int]]) -> Iterator[tuple[int, list[int], Any, Table]]:
    """Yield axis, points, value and history of what points have by axis and history, once for histories of one shape.

    The value is 1, or a function that returns those of the points, ascending, where they differ.
    """
    shapes: dict[tuple[int, Table], dict[Table, float]] = {}
    for axis, table in alike:
        size, shape = shape_of(table)
        shapes.setdefault((axis, shape), {})[table] = size
    for (axis, shape), sizes in shapes.items():
        if len(sizes) == 1:
            table = next(iter(sizes))
            yield axis, alike[axis, table], 1.0, table
            continue
        values: dict[int, float] = {}
        for table, size in sizes.items():
            for point in alike[axis, table]:
                values[point] = values.get(point, 0.0) + size
        points = sorted(values)
        yield axis, points, partial(_given, np.array([values[point] for point in points])), shape


def _given(values: Array, positions: Array) -> Array:
    """Return values (n,) that nodes have whatever their positions (n, dim)."""
    return values
