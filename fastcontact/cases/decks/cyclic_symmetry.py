"""Cyclic symmetry of a deck: *TIE, CYCLIC SYMMETRY (ends of a sector) and *CYCLIC SYMMETRY MODEL (axis and number)."""

from __future__ import annotations

import numpy as np

from fastcontact.cases.decks.blocks import Block, folded, refusing
from fastcontact.cases.decks.content import Content, SectorEnds, Sectors
from fastcontact.cases.decks.meshing import DeckMesh, group_of_surface
from fastcontact.elasticity.multipoint_constraints import MultiPointConstraint
from fastcontact.model.model import Model

# Largest number of sectors. A larger number is treated as an error.
MOST_SECTORS = 100_000


def cyclic_symmetry_model(content: Content, block: Block) -> None:
    """Read *CYCLIC SYMMETRY MODEL: the number of sectors, and two points of the axis."""
    text = block.required("N")
    if not text.isdecimal() or not 2 <= int(text) <= MOST_SECTORS:
        raise block.refuse(f"N={text[:40]}: a whole number of sectors, 2 to {MOST_SECTORS}, is needed")
    row = block.only()
    points = tuple(row.number(i) for i in range(6))
    if points[:3] == points[3:]:
        raise block.refuse("the two points of the axis are the same")
    content.sectors.append(Sectors(block.location, int(text), block.get("TIE"), points))


def add_sectors(model: Model, deck_mesh: DeckMesh) -> list[MultiPointConstraint]:
    """Add the cyclic symmetries of the deck to the model and return their constraints."""
    content, before = deck_mesh.content, len(model.relations)
    used: set[int] = set()
    for sectors in content.sectors:
        ends = _ends(content, sectors)
        used.add(id(ends))
        first, second = np.array(sectors.points[:3]), np.array(sectors.points[3:])
        direction = (second - first) / np.linalg.norm(second - first)
        if model.mesh.dim == 2 and np.abs(direction[:2]).max() > 1e-9:
            raise sectors.refuse("the axis of a plane model is along z: give two points that differ in z only")
        for name in ends.surfaces:
            deck_mesh.faces(name, ends.location)
        groups = [group_of_surface(deck_mesh, name) for name in ends.surfaces]
        with refusing(sectors):
            model.add_cyclic_symmetry(
                groups[0], groups[1], sectors=sectors.count, origin=tuple(first[: model.mesh.dim].tolist()),
                direction=tuple(direction.tolist()),
            )  # fmt: skip
    for ends in content.sector_ends:
        if id(ends) not in used:
            raise ends.refuse("no *CYCLIC SYMMETRY MODEL defines the number of sectors and the axis")
    return model.relations[before:]


def _ends(content: Content, sectors: Sectors) -> SectorEnds:
    """Return the sector ends of a *CYCLIC SYMMETRY MODEL: those of its TIE, or the only ones of the deck."""
    named = [ends for ends in content.sector_ends if not sectors.tie or folded(ends.name) == folded(sectors.tie)]
    if len(named) != 1:
        known = ", ".join(ends.name or f"that of line {ends.location.line}" for ends in content.sector_ends) or "none"
        which = f"TIE={sectors.tie[:80]}" if sectors.tie else "TIE is not given"
        raise sectors.refuse(f"{which}, and the ties with CYCLIC SYMMETRY are: {known}")
    return named[0]
