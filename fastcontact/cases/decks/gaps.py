"""Gap elements and springs of a deck; gap elements become contact of facets with a rigid plane or with another body."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fastcontact.arrays import Array, Indices
from fastcontact.cases.decks.assembled import Assembly, facet_points
from fastcontact.cases.decks.blocks import Block, errors_at, key_of
from fastcontact.cases.decks.conditions import Conditions
from fastcontact.cases.decks.content import Content, Gap, Spring
from fastcontact.cases.decks.meshing import DeckMesh
from fastcontact.contact.obstacles.shapes import HalfSpace
from fastcontact.model.model import Model
from fastcontact.model.ramp import Table

# Tolerance of gaps and distances, relative to the size of the model.
GAP_TOLERANCE = 1e-6


def gap(content: Content, block: Block) -> None:
    """Read *GAP: the clearance [length] and the direction [-] of gap elements."""
    row = block.only_row()
    direction = tuple(row.number(i, 0.0) for i in (1, 2, 3))
    if not any(direction):
        raise row.error("the direction of the gap elements is missing")
    content.gaps[key_of(block.required("ELSET"))] = Gap(block.location, row.number(0), direction)


def spring(content: Content, block: Block) -> None:
    """Read *SPRING: the axial stiffness [force / length] of springs."""
    rows = block.rows
    if len(rows) != 1:
        raise block.error("linear springs along their axis need an empty line, followed by a line with the stiffness")
    if rows[0].text(1):
        raise rows[0].error("only linear springs are supported: one stiffness")
    content.springs[key_of(block.required("ELSET"))] = Spring(block.location, rows[0].positive(0, "stiffness"))


def check_discrete(assembly: Assembly, kind: str, properties: Mapping[str, Gap | Spring], keyword: str) -> None:
    """Raise CaseError if `keyword` gives properties to elements not of type `kind`, or not to all elements of this type."""
    with_properties = set()
    for name, entry in properties.items():
        for element in assembly.elements_of(name, entry.location):
            if element.cell.type != kind:
                raise entry.error(f"element {element.number} is not of type {kind}")
            with_properties.add(element)
    for element in assembly.discrete:
        if element.cell.type == kind and element not in with_properties:
            raise element.cell.error(f"element {element.number} of type {kind} has no {keyword}")


def add_gap_facets(deck_mesh: DeckMesh) -> None:
    """Create groups of the facets with the first nodes of gap elements, and with the second nodes if these belong to solids.

    Raises CaseError if the nodes do not fill whole facets.
    """
    check_discrete(deck_mesh, "GAPUNI", deck_mesh.content.gaps, "*GAP")
    for key, gap in deck_mesh.content.gaps.items():
        name, ends = _name_and_ends(deck_mesh, key, gap)
        _add_facets(deck_mesh, f"{name} facets", ends[:, 0], gap)
        if deck_mesh.solid_points.issuperset(ends[:, 1].tolist()):
            _add_facets(deck_mesh, f"{name} opposite facets", ends[:, 1], gap)


def _name_and_ends(deck_mesh: DeckMesh, key: str, gap: Gap) -> tuple[str, Indices]:
    """Return the name of a set of gap elements and the points (n, 2) of their first and second nodes."""
    ends = [element.points for element in deck_mesh.elements_of(key, gap.location)]
    return deck_mesh.content.root.set_names.get(key, key), np.array(ends, np.intp)


def _add_facets(deck_mesh: DeckMesh, group: str, points: Indices, gap: Gap) -> None:
    """Make a group of the facets whose nodes are all in `points`. Raises CaseError if a point belongs to no such facet."""
    selected = set(points.tolist())
    faces = deck_mesh.faces_within(selected)
    if {p for face in faces for p in facet_points(*face)} != selected:
        raise gap.error(
            "gap elements are supported on all nodes of whole faces only, from a body to another or to held nodes"
        )
    deck_mesh.add_facets(group, faces)


def add_gaps(model: Model, deck_mesh: DeckMesh, conditions: Conditions) -> dict[str, dict[int, int]]:
    """Add the contact of gap elements to a model.

    Returns, by the name of each contact with a rigid plane, the second node of each first node. Raises CaseError if the nodes
    are not in planes normal to the direction of the elements.
    """
    points, gap_ends = model.mesh.points, {}
    tolerance = GAP_TOLERANCE * float(np.ptp(points, axis=0).max())
    for key, gap in deck_mesh.content.gaps.items():
        name, ends = _name_and_ends(deck_mesh, key, gap)
        direction = np.array(gap.direction)[: deck_mesh.dim] / np.linalg.norm(gap.direction)
        if np.ptp(points[ends[:, 0]] @ direction) > tolerance:
            raise gap.error("gap elements are supported if their nodes lie in a plane normal to their direction")
        if (opposite := f"{name} opposite facets") in deck_mesh.groups:
            distance = _distance(points[ends[:, 1]] - points[ends[:, 0]], direction, tolerance, gap)
            with errors_at(gap):
                model.add_contact(
                    name, secondary=f"{name} facets", primary=opposite, formulation="node_to_segment",
                    clearance=gap.clearance - distance,
                )  # fmt: skip
            continue
        level = float((points[ends[:, 0]] @ direction).mean()) + gap.clearance
        plane = HalfSpace(tuple(level * direction), tuple(-direction))
        history = _motion(gap, ends, direction, conditions)
        motion: dict[str, Any] = {}
        if any(value for _, value in history):
            motion = {"motion": dict(zip("xyz", direction.tolist(), strict=False)), "ramp": history}
        model.add_obstacle(name, secondary=f"{name} facets", obstacle=plane, formulation="node_to_segment", **motion)
        gap_ends[name] = dict(ends.tolist())
    return gap_ends


def _distance(vectors: Array, direction: Array, tolerance: float, gap: Gap) -> float:
    """Return the common length [length] of the `vectors` (n, dim) from first to second nodes.

    Raises CaseError unless they are equal and parallel to the direction.
    """
    distances = vectors @ direction
    tangential = np.abs(vectors - np.outer(distances, direction)).max()
    if max(np.ptp(distances), tangential, -distances.mean()) > tolerance:
        raise gap.error("gap elements between bodies are supported along their direction, in planes normal to it only")
    return float(distances.mean())


def _motion(gap: Gap, ends: Indices, direction: Array, conditions: Conditions) -> Table:
    """Return the motion [length] of the second nodes along the direction.

    Raises CaseError unless it is prescribed and uniform.
    """
    supports = conditions.supports
    by_axis: list[tuple[float, Array]] = []
    for axis in np.flatnonzero(direction).tolist():
        components = [(end, axis, False) for end in ends[:, 1].tolist()]
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
