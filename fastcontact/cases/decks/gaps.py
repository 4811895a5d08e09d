"""Gap elements and springs of a deck; gap elements become contact of facets with a rigid plane or with another body."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fastcontact.arrays import Array, Indices
from fastcontact.cases.decks.assembled import Assembly, facet_points
from fastcontact.cases.decks.blocks import Block, Located, Location, key_of, refusing
from fastcontact.cases.decks.conditions import Conditions
from fastcontact.cases.decks.content import Content
from fastcontact.cases.decks.meshing import DeckMesh
from fastcontact.contact.obstacles.shapes import HalfSpace
from fastcontact.model.model import Model
from fastcontact.model.ramp import Table

# Tolerance of distances relative to the size of the model.
TOUCHING = 1e-6


@dataclass(frozen=True, eq=False)
class GapGroup(Located):
    """The gap elements of a set.

    Attributes
    ----------
    name : str
        Name of the element set.
    location : Location
        Line of the keyword *GAP.
    clearance : float
        Initial clearance [length].
    direction : ndarray (dim,)
        Unit vector from the first node to the second node [-].
    ends : ndarray (n, 2) of int
        Point numbers of the first and the second node of each element.
    facets : str
        Group of the facets with the first nodes.
    opposite : str
        Group of the facets with the second nodes; empty unless all second nodes belong to solids.
    """

    name: str
    location: Location
    clearance: float
    direction: Array
    ends: Indices
    facets: str
    opposite: str


def gap(content: Content, block: Block) -> None:
    """Read *GAP: the clearance [length] and the direction [-] of gap elements."""
    row = block.only()
    direction = tuple(row.number(i, 0.0) for i in (1, 2, 3))
    if not any(direction):
        raise row.refuse("the direction of the gap elements is missing")
    content.gaps[key_of(block.required("ELSET"))] = (block.location, row.number(0), direction)


def spring(content: Content, block: Block) -> None:
    """Read *SPRING: the axial stiffness [force / length] of springs."""
    rows = block.rows
    if len(rows) != 1:
        raise block.refuse("linear springs along their axis need an empty line, followed by a line with the stiffness")
    if rows[0].text(1):
        raise rows[0].refuse("only linear springs are supported: one stiffness")
    content.springs[key_of(block.required("ELSET"))] = (block.location, rows[0].positive(0, "stiffness"))


def check_discrete(assembly: Assembly, kind: str, properties: Mapping[str, Any], keyword: str) -> None:
    """Raise CaseError if an element of the type `kind` is in none of the sets to which `keyword` gives properties."""
    complete = {element for name, entry in properties.items() for element in assembly.elements_of(name, entry[0])}
    for element in assembly.discrete:
        if element.cell.type == kind and element not in complete:
            raise element.cell.refuse(f"element {element.number} of type {kind} has no {keyword}")


def gap_groups(deck_mesh: DeckMesh) -> list[GapGroup]:
    """Create groups of the facets with the nodes of gap elements. Raises CaseError if the nodes do not fill whole facets."""
    groups = []
    check_discrete(deck_mesh, "GAPUNI", deck_mesh.content.gaps, "*GAP")
    for name, (location, clearance, vector) in deck_mesh.content.gaps.items():
        gap_elements = deck_mesh.elements_of(name, location)
        if any(element.cell.type != "GAPUNI" for element in gap_elements):
            raise location.refuse("acts on elements of type GAPUNI only")
        set_name = deck_mesh.content.root.set_names.get(name, name)
        ends = np.array([element.points for element in gap_elements], np.intp)
        bodies = all(point in deck_mesh.solid_points for point in ends[:, 1].tolist())
        groups.append(
            GapGroup(
                set_name, location, clearance, np.array(vector)[: deck_mesh.dim] / np.linalg.norm(vector), ends,
                _facet_group(deck_mesh, f"{set_name} facets", ends[:, 0], location),
                _facet_group(deck_mesh, f"{set_name} opposite facets", ends[:, 1], location) if bodies else "",
            )
        )  # fmt: skip
    return groups


def _facet_group(deck_mesh: DeckMesh, group: str, points: Indices, location: Location) -> str:
    """Make a group of the facets whose nodes are all in `points`. Raises CaseError if a point belongs to no such facet."""
    selected = set(points.tolist())
    faces = deck_mesh.faces_within(selected)
    if {p for face in faces for p in facet_points(*face)} != selected:
        raise location.refuse(
            "gap elements are supported on all nodes of whole faces only, from a body to another or to held nodes"
        )
    return deck_mesh.add_facets(group, faces)


def add_gap(model: Model, deck_mesh: DeckMesh, gap: GapGroup, conditions: Conditions) -> dict[str, dict[int, int]]:
    """Add the contact of gap elements to a model.

    Returns, by the name of the contact, the second node of each first node, or an empty dictionary if the second nodes belong
    to solids. Raises CaseError if the nodes are not in planes normal to the direction of the elements.
    """
    first, second = model.mesh.points[gap.ends[:, 0]], model.mesh.points[gap.ends[:, 1]]
    size = TOUCHING * float(np.ptp(model.mesh.points, axis=0).max())
    if np.ptp(first @ gap.direction) > size:
        raise gap.refuse("gap elements are supported if their nodes lie in a plane normal to their direction")
    if gap.opposite:
        vectors = second - first
        distances = vectors @ gap.direction
        tangential = np.abs(vectors - np.outer(distances, gap.direction)).max()
        if max(np.ptp(distances), tangential, -distances.mean()) > size:
            raise gap.refuse(
                "gap elements between bodies are supported along their direction, in planes normal to it only"
            )
        with refusing(gap):
            model.add_contact(
                gap.name, secondary=gap.facets, primary=gap.opposite, formulation="node_to_segment",
                clearance=gap.clearance - float(distances.mean()),
            )  # fmt: skip
        return {}
    history = _prescribed_motion(gap, conditions)
    wall = HalfSpace(
        point=tuple((first @ gap.direction).mean() * gap.direction + gap.clearance * gap.direction),
        normal=tuple(-gap.direction),
    )
    motion: dict[str, Any] = {}
    if any(value for _, value in history):
        motion = {"motion": dict(zip("xyz", gap.direction.tolist(), strict=False)), "ramp": history}
    model.add_obstacle(gap.name, secondary=gap.facets, obstacle=wall, formulation="node_to_segment", **motion)
    return {gap.name: dict(gap.ends.tolist())}


def _prescribed_motion(gap: GapGroup, conditions: Conditions) -> Table:
    """Return the motion [length] of the second nodes along the direction.

    Raises CaseError unless it is prescribed and uniform.
    """
    supports = conditions.supports
    by_axis: list[tuple[float, Array]] = []
    for axis in np.flatnonzero(gap.direction).tolist():
        names = [(end, axis, False) for end in gap.ends[:, 1].tolist()]
        prescribed = [name for name in names if name in supports.tracks and supports.tracks[name].periods[-1].always]
        tables = {supports.table(name) for name in prescribed}
        if len(tables) != 1 or len(prescribed) < len(names):
            raise gap.refuse(
                "gap elements need second nodes that are fixed, or have the same prescribed motion, along their direction"
            )
        by_axis.append((float(gap.direction[axis]), np.array(tables.pop())))
    times = np.unique(np.concatenate([table[:, 0] for _, table in by_axis]))
    motion = sum((cosine * np.interp(times, *table.T) for cosine, table in by_axis), np.zeros(len(times)))
    return tuple(zip(times.tolist(), motion.tolist(), strict=True))
