"""Pretension sections of bolts in a deck, with their locks, and cyclic sectors with their end surfaces."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.sparse import csr_array

from fastcontact.cases.decks.assembled import Assembly, facet_points
from fastcontact.cases.decks.blocks import Block, errors_at, key_of
from fastcontact.cases.decks.conditions import Conditions
from fastcontact.cases.decks.content import Content, PretensionSection, SectorEnds
from fastcontact.cases.decks.meshing import DeckMesh, group_of_surface
from fastcontact.elasticity.multipoint_constraints import MultiPointConstraint
from fastcontact.mesh.generate.cut import cut
from fastcontact.mesh.mesh import Mesh
from fastcontact.model.model import Model


def pretension_section(content: Content, block: Block) -> None:
    """Read *PRE-TENSION SECTION: a surface across a bolt, and the node with the shortening and the force of the bolt."""
    if len(block.rows) > 1:
        raise block.error(f"{len(block.rows)} data lines, but at most one is allowed, the normal")
    row = block.rows[0] if block.rows else None
    normal = None if row is None else (row.number(0), row.number(1, 0.0), row.number(2, 0.0))
    if normal is not None and not any(normal):
        raise block.error("the normal is zero")
    names = block.required("SURFACE"), block.required("NODE")
    content.pretension_sections.append(PretensionSection(block.location, *names, normal))


def sections_by_point(assembly: Assembly) -> dict[int, PretensionSection]:
    """Return the pretension sections by the points of their nodes.

    Raises CaseError if the node of a section belongs to a body or to another section.
    """
    sections: dict[int, PretensionSection] = {}
    for section in assembly.content.pretension_sections:
        point = assembly.node(section.node, section.location)
        if point in assembly.solid_points:
            raise section.error(f"node {section.node} belongs to an element: a section needs a separate node")
        if point in sections:
            line = sections[point].location.line
            raise section.error(f"node {section.node} has a section already, in line {line}")
        sections[point] = section
    return sections


def _locked_from(point: int, section: PretensionSection, conditions: Conditions) -> float | None:
    """Return the load factor from which FIXED locks a section, or None. Raises CaseError if a later step releases it."""
    track = conditions.supports.tracks.get((point, 0, False))
    for period in (period for period in track.periods if period.fixed) if track else ():
        if period.ends < np.inf:
            step = conditions.assembly.content.steps[int(period.ends)]
            supports = [block for block in step.conditions if block.keyword == "BOUNDARY"]
            raise max(supports, key=lambda block: block.removes_earlier).error(
                f"node {section.node} of a pretension section is released here: a locked section stays locked"
            )
        return period.begins
    return None


def cut_sections(deck_mesh: DeckMesh, mesh: Mesh) -> Mesh:
    """Return the mesh cut along all pretension sections.

    Raises CaseError if a cut is impossible, or if a surface has two sections.
    """
    sections: set[str] = set()
    for section in deck_mesh.content.pretension_sections:
        deck_mesh.faces(section.surface, section.location)
        group = group_of_surface(deck_mesh, section.surface)
        if group in sections:
            raise section.error(f"surface '{group}' has a pretension section already")
        sections.add(group)
        normal = None if section.normal is None else section.normal[: deck_mesh.dim]
        with errors_at(section):
            mesh = cut(mesh, group, normal)
    return mesh


def add_sections(
    model: Model, deck_mesh: DeckMesh, sections: Mapping[int, PretensionSection], conditions: Conditions
) -> None:
    """Add the pretension `sections`, by the points of their nodes, to a model."""
    links = []
    for point, section in sections.items():
        group, location = group_of_surface(deck_mesh, section.surface), section.location
        normal = None if section.normal is None else section.normal[: deck_mesh.dim]
        locked_from = _locked_from(point, section, conditions)
        model.add_pretension(group, group, force=0.0, locked_from=locked_from, normal=normal)
        row = _orientation_sign(deck_mesh, section) * model.pretensions[-1].row(model.n_dofs)
        node = csr_array((np.ones(1), ([0], [point * deck_mesh.dim])), shape=row.shape)
        links.append(MultiPointConstraint(f"*{location.keyword} of line {location.line}", csr_array(row - node)))
    model.relations.extend(links)


def _orientation_sign(deck_mesh: DeckMesh, section: PretensionSection) -> float:
    """Return 1.0 if the normal of a section points out of the elements of its surface, and -1.0 if it points into them.

    A positive force in the deck acts on these elements along the normal, and tightens the bolt only if the normal points out.
    """
    if section.normal is None:
        return 1.0
    points, outward = deck_mesh.points, np.zeros(3)
    for solid, facet in deck_mesh.faces(section.surface, section.location):
        outward += points[list(facet_points(solid, facet))].mean(axis=0) - points[list(solid.points)].mean(axis=0)
    return float(np.copysign(1.0, outward @ np.array(section.normal)))


# Largest number of cyclic sectors. A larger number is treated as an error.
MOST_SECTORS = 100_000


def cyclic_symmetry_model(content: Content, block: Block) -> None:
    """Store *CYCLIC SYMMETRY MODEL: the number of sectors, and two points of the axis."""
    content.sectors.append(block)


def add_sectors(model: Model, deck_mesh: DeckMesh) -> None:
    """Add the cyclic symmetries of a deck to the model."""
    unused = list(deck_mesh.content.sector_ends)
    for block in deck_mesh.content.sectors:
        text = block.required("N")
        if not text.isdecimal() or not 2 <= int(text) <= MOST_SECTORS:
            raise block.error(f"N={text[:40]}: a whole number of sectors, 2 to {MOST_SECTORS}, is needed")
        row = block.only_row()
        first, second = np.reshape([row.number(i) for i in range(6)], (2, 3))
        if (first == second).all():
            raise block.error("the two points of the axis are the same")
        direction = (second - first) / np.linalg.norm(second - first)
        if model.mesh.dim == 2 and np.abs(direction[:2]).max() > 1e-9:
            raise block.error("the axis of a plane model is along z: give two points that differ in z only")
        ends = _ends(deck_mesh.content, block)
        unused = [candidate for candidate in unused if candidate is not ends]
        for name in ends.surfaces:
            deck_mesh.faces(name, ends.location)
        first_end, second_end = (group_of_surface(deck_mesh, name) for name in ends.surfaces)
        with errors_at(block):
            model.add_cyclic_symmetry(
                first_end, second_end, sectors=int(text), origin=tuple(first[: model.mesh.dim].tolist()),
                direction=tuple(direction.tolist()),
            )  # fmt: skip
    for ends in unused:
        raise ends.error("no *CYCLIC SYMMETRY MODEL defines the number of sectors and the axis")


def _ends(content: Content, block: Block) -> SectorEnds:
    """Return the sector ends of a *CYCLIC SYMMETRY MODEL: those of its TIE, or the only ones of the deck."""
    tie = block.get("TIE")
    matching = [ends for ends in content.sector_ends if not tie or key_of(ends.name) == key_of(tie)]
    if len(matching) != 1:
        names = ", ".join(ends.name or f"that of line {ends.location.line}" for ends in content.sector_ends) or "none"
        parameter = f"TIE={tie[:80]}" if tie else "TIE is not given"
        raise block.error(f"{parameter}, and the ties with CYCLIC SYMMETRY are: {names}")
    return matching[0]
