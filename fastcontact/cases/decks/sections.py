"""Pretension sections of bolts in a deck, with their locks, and cyclic sectors with their end surfaces."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from fastcontact.cases.decks.assembled import Assembly
from fastcontact.cases.decks.blocks import Block, Item, errors_at, key_of
from fastcontact.cases.decks.conditions import Conditions
from fastcontact.cases.decks.content import Content
from fastcontact.cases.decks.meshing import DeckMesh, group_of_surface
from fastcontact.elasticity.multipoint_constraints import MultiPointConstraint
from fastcontact.mesh.generate.cut import cut
from fastcontact.mesh.mesh import Mesh
from fastcontact.model.model import Model


@dataclass(frozen=True)
class PretensionSection(Item):
    """A pretension section of a bolt: its surface, the node whose displacement is the shortening, and its normal [-]."""

    surface: str
    node: str
    normal: tuple[float, ...] | None


def sections_by_point(assembly: Assembly) -> dict[int, PretensionSection]:
    """Return the pretension sections by the points of their nodes.

    Raises CaseError if a normal is invalid, or if the node of a section belongs to a body or to another section.
    """
    sections: dict[int, PretensionSection] = {}
    for block in assembly.content.blocks["PRE-TENSION SECTION"]:
        rows = block.rows
        if len(rows) > 1:
            raise block.error(f"{len(rows)} data lines, but at most one is allowed, the normal")
        normal = (rows[0].number(0), rows[0].number(1, 0.0), rows[0].number(2, 0.0)) if rows else None
        if normal is not None and not any(normal):
            raise block.error("the normal is zero")
        section = PretensionSection(block.location, block.required("SURFACE"), block.required("NODE"), normal)
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


def cut_sections(deck_mesh: DeckMesh, mesh: Mesh, sections: Iterable[PretensionSection]) -> Mesh:
    """Return the mesh cut along the pretension `sections`.

    Raises CaseError if a cut is impossible, or if a surface has two sections.
    """
    groups: set[str] = set()
    for section in sections:
        deck_mesh.faces(section.surface, section.location)
        group = group_of_surface(deck_mesh, section.surface)
        if group in groups:
            raise section.error(f"surface '{group}' has a pretension section already")
        groups.add(group)
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
    for face in deck_mesh.faces(section.surface, section.location):
        outward += points[list(face.points)].mean(axis=0) - points[list(face.solid.points)].mean(axis=0)
    return float(np.copysign(1.0, outward @ np.array(section.normal)))


# Largest number of cyclic sectors. A larger number is treated as an error.
MOST_SECTORS = 100_000


def add_sectors(model: Model, deck_mesh: DeckMesh) -> None:
    """Add the cyclic symmetries of a deck to the model."""
    content = deck_mesh.content
    unused = list(content.sector_ends)
    for block in content.blocks["CYCLIC SYMMETRY MODEL"]:
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
        ends = _ends(content, block)
        unused = [candidate for candidate in unused if candidate is not ends]
        tie, *names = ends
        for name in names:
            deck_mesh.faces(name, tie.location)
        first_end, second_end = (group_of_surface(deck_mesh, name) for name in names)
        with errors_at(block):
            model.add_cyclic_symmetry(
                first_end, second_end, sectors=int(text), origin=tuple(first[: model.mesh.dim].tolist()),
                direction=tuple(direction.tolist()),
            )  # fmt: skip
    for tie, *_ in unused:
        raise tie.error("no *CYCLIC SYMMETRY MODEL defines the number of sectors and the axis")


def _ends(content: Content, block: Block) -> tuple[Block, str, str]:
    """Return the sector ends that a *CYCLIC SYMMETRY MODEL names by its TIE, or the only ones of the deck."""
    name = block.get("TIE")
    matching = [ends for ends in content.sector_ends if not name or key_of(ends[0].get("NAME")) == key_of(name)]
    if len(matching) != 1:
        ties = [tie for tie, *_ in content.sector_ends]
        names = ", ".join(tie.get("NAME") or f"that of line {tie.location.line}" for tie in ties) or "none"
        parameter = f"TIE={name[:80]}" if name else "TIE is not given"
        raise block.error(f"{parameter}, and the ties with CYCLIC SYMMETRY are: {names}")
    return matching[0]
