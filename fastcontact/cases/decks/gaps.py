"""Gap elements and springs of a deck; gap elements become contact of facets with a rigid plane or with another body."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from fastcontact.arrays import Array, Indices
from fastcontact.cases.decks.assembled import Assembly
from fastcontact.cases.decks.blocks import Block, Item, errors_at, key_of
from fastcontact.cases.decks.conditions import Conditions
from fastcontact.cases.decks.meshing import DeckMesh
from fastcontact.contact.obstacles.shapes import HalfSpace
from fastcontact.model.model import Model
from fastcontact.model.ramp import Table

# Tolerance of gaps and distances, relative to the size of the model.
GAP_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class Gaps(Item):
    """Gap elements of a set: points (n, 2) of their nodes, clearance [length], direction (3,) from first to second [-]."""

    name: str
    ends: Indices
    clearance: float
    direction: Array


def blocks_by_set(assembly: Assembly, keyword: str, kind: str) -> dict[str, Block]:
    """Return the last block of a keyword for each element set.

    Raises CaseError if the blocks give properties to elements not of type `kind`, or not to all elements of this type.
    """
    blocks = {key_of(block.required("ELSET")): block for block in assembly.content.blocks[keyword]}
    with_properties = set()
    for name, block in blocks.items():
        for element in assembly.elements_of(name, block.location):
            if element.cell.type != kind:
                raise block.error(f"element {element.number} is not of type {kind}")
            with_properties.add(element)
    for element in assembly.discrete:
        if element.cell.type == kind and element not in with_properties:
            raise element.cell.error(f"element {element.number} of type {kind} has no *{keyword}")
    return blocks


def add_springs(model: Model, assembly: Assembly, thickness: float) -> None:
    """Add the springs; their stiffness is divided by the thickness [length].

    Raises CaseError if an element of *SPRING is not a spring, or if a spring has no stiffness or more than one.
    """
    for name, block in blocks_by_set(assembly, "SPRING", "SPRINGA").items():
        rows = block.rows
        if len(rows) != 1:
            raise block.error(
                "linear springs along their axis need an empty line, followed by a line with the stiffness"
            )
        if rows[0].text(1):
            raise rows[0].error("only linear springs are supported: one stiffness")
        stiffness = rows[0].positive(0, "stiffness") / thickness
        for element in assembly.elements_of(name, block.location):
            model.add_spring(element.points[0], element.points[1], axial=stiffness)


def add_gap_facets(deck_mesh: DeckMesh) -> list[Gaps]:
    """Return the gap elements by set, and create groups of the facets at their first nodes and, in solids, second nodes.

    Raises CaseError if a direction is missing, if an element is not a gap element, or if the nodes do not fill whole facets.
    """
    gaps = []
    for key, block in blocks_by_set(deck_mesh, "GAP", "GAPUNI").items():
        row = block.only_row()
        direction = np.array([row.number(i, 0.0) for i in (1, 2, 3)])
        if not direction.any():
            raise row.error("the direction of the gap elements is missing")
        ends = np.array([element.points for element in deck_mesh.elements_of(key, block.location)], np.intp)
        name = deck_mesh.content.root.set_names.get(key, key)
        gaps.append(Gaps(block.location, name, ends, row.number(0), direction / np.linalg.norm(direction)))
        _add_facets(deck_mesh, f"{name} facets", ends[:, 0], block)
        if deck_mesh.solid_points.issuperset(ends[:, 1].tolist()):
            _add_facets(deck_mesh, f"{name} opposite facets", ends[:, 1], block)
    return gaps


def _add_facets(deck_mesh: DeckMesh, group: str, points: Indices, block: Block) -> None:
    """Make a group of the facets whose nodes are all in `points`. Raises CaseError if a point belongs to no such facet."""
    selected = set(points.tolist())
    faces = [face for face in deck_mesh.faces_touching(selected) if face.corners <= selected]
    if {p for face in faces for p in face.points} != selected:
        raise block.error(
            "gap elements are supported on all nodes of whole faces only, from a body to another or to held nodes"
        )
    deck_mesh.add_facets(group, faces)


def add_gaps(
    model: Model, deck_mesh: DeckMesh, gaps: Iterable[Gaps], conditions: Conditions
) -> dict[str, dict[int, int]]:
    """Add the contact of gap elements to a model.

    Returns, by the name of each contact with a rigid plane, the second node of each first node. Raises CaseError if the nodes
    are not in planes normal to the direction of the elements.
    """
    points, gap_ends = model.mesh.points, {}
    tolerance = GAP_TOLERANCE * float(np.ptp(points, axis=0).max())
    for gap in gaps:
        name, (first, second), direction = gap.name, points[gap.ends.T], gap.direction[: deck_mesh.dim]
        if np.ptp(first @ direction) > tolerance:
            raise gap.error("gap elements are supported if their nodes lie in a plane normal to their direction")
        options: dict[str, Any] = {"secondary": f"{name} facets", "formulation": "node_to_segment"}
        if (opposite := f"{name} opposite facets") in deck_mesh.groups:
            distance = _distance(second - first, direction, tolerance, gap)
            with errors_at(gap):
                model.add_contact(name, primary=opposite, clearance=gap.clearance - distance, **options)
            continue
        level = float((first @ direction).mean()) + gap.clearance
        plane = HalfSpace(tuple(level * direction), tuple(-direction))
        history = _motion(gap, direction, conditions)
        if any(value for _, value in history):
            options |= {"motion": dict(zip("xyz", direction.tolist(), strict=False)), "ramp": history}
        model.add_obstacle(name, obstacle=plane, **options)
        gap_ends[name] = dict(gap.ends.tolist())
    return gap_ends


def _distance(vectors: Array, direction: Array, tolerance: float, gap: Gaps) -> float:
    """Return the common length [length] of the `vectors` (n, dim) from first to second nodes.

    Raises CaseError unless they are equal and parallel to the direction.
    """
    distances = vectors @ direction
    tangential = np.abs(vectors - np.outer(distances, direction)).max()
    if max(np.ptp(distances), tangential, -distances.mean()) > tolerance:
        raise gap.error("gap elements between bodies are supported along their direction, in planes normal to it only")
    return float(distances.mean())


def _motion(gap: Gaps, direction: Array, conditions: Conditions) -> Table:
    """Return the motion [length] of the second nodes along the direction.

    Raises CaseError unless it is prescribed and uniform.
    """
    supports = conditions.supports
    by_axis: list[tuple[float, Array]] = []
    for axis in np.flatnonzero(direction).tolist():
        components = [(end, axis, False) for end in gap.ends[:, 1].tolist()]
        prescribed = [c for c in components if c in supports.tracks and supports.tracks[c].periods[-1].permanent]
        tables = {supports.table(component) for component in prescribed}
        if len(tables) != 1 or len(prescribed) < len(components):
            raise gap.error(
                "gap elements need second nodes that are fixed, or have the same prescribed motion, along their direction"
            )
        by_axis.append((float(direction[axis]), np.array(tables.pop())))
    times = np.unique(np.concatenate([table[:, 0] for _, table in by_axis]))
    motion = sum((cosine * np.interp(times, *table.T) for cosine, table in by_axis), np.zeros(len(times)))
    return tuple(zip(times.tolist(), motion.tolist(), strict=True))
