"""Rectangular and cylindrical local axes of a deck, of nodes (*TRANSFORM) and materials (*ORIENTATION, *DISTRIBUTION)."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from fastcontact.arrays import Array
from fastcontact.cases.decks.assembled import Assembly, Element, qualified
from fastcontact.cases.decks.blocks import Block, Location, key_of, look_up, register, unquoted
from fastcontact.cases.decks.content import Axes, Content, Part
from fastcontact.mesh.mesh import starts_of
from fastcontact.round_off import LENGTH_ROUND_OFF, TINY


def orientation(content: Content, part: Part, block: Block) -> None:
    """Read *ORIENTATION: local axes of materials and couplings."""
    name, system = block.required("NAME"), block.choice("SYSTEM", ("RECTANGULAR", "CYLINDRICAL"))
    block.choice("DEFINITION", ("COORDINATES",))
    rows = block.rows
    points: tuple[float, ...] = ()
    if not rows:
        raise block.error("a data line with six coordinates is needed")
    distribution = unquoted(rows[0].text(0)) if re.match("[A-Za-z_]", rows[0].text(0)) else ""
    if distribution and system == "CYLINDRICAL":
        raise block.error("a distribution of axes is supported with SYSTEM=RECTANGULAR only")
    if not distribution:
        points = tuple(rows[0].number(i) for i in range(6))
        if any(rows[0].entries[6:]) and any(rows[0].number(6 + i, 0.0) for i in range(3)):
            raise rows[0].error("an origin of the axes is not supported: give points relative to 0, 0, 0")
    if len(rows) > 1 and rows[1].number(1, 0.0):
        raise rows[1].error("a further rotation of the axes is not supported: rotate the points of the first line")
    axes = Axes(block.location, name, system == "CYLINDRICAL", points, distribution, part)
    register("orientation", name, content.orientations, axes, block)


def distribution_table(content: Content, part: Part, block: Block) -> None:
    """Read *DISTRIBUTION TABLE: the kind of a distribution. Raises CaseError unless it consists of the axes of elements."""
    kinds = [entry.upper() for row in block.rows for entry in row.entries if entry]
    if kinds != ["COORD3D", "COORD3D"]:
        raise block.error(f"a distribution of {', '.join(kinds)[:80]} is not supported, only COORD3D, COORD3D of axes")


def distribution(content: Content, part: Part, block: Block) -> None:
    """Read *DISTRIBUTION: two points that define the axes of an element or, on a line without element, the default axes."""
    block.choice("LOCATION", ("ELEMENT",))
    register("distribution", block.required("NAME"), content.distributions, block, block)


def local_directions(assembly: Assembly) -> dict[int, Array]:
    """Return the local axes (3, 3) [-], in rows, of each point with *TRANSFORM."""
    directions: dict[int, Array] = {}
    for block in assembly.content.blocks["TRANSFORM"]:
        row, name = block.only_row(), block.required("NSET")
        points = tuple(row.number(i) for i in range(6))
        axes = Axes(block.location, name, block.choice("TYPE", ("R", "C")) == "C", points)
        nodes = assembly.nodes(name, block.location)
        directions |= {point: local_axes(axes, assembly.points[point]) for point in nodes}
    return directions


def orientation_of(content: Content, name: str, location: Location) -> Axes:
    """Return the axes of an *ORIENTATION.

    Raises CaseError if it is undefined, or varies by element and is not used in a section.
    """
    axes: Axes = look_up("orientation", name, content.orientations, location)
    if axes.distribution and location.keyword != "SOLID SECTION":
        raise location.error(
            f"orientation '{name}' varies by element, by a distribution: it can be used in sections only"
        )
    return axes


def axes_by_cell(assembly: Assembly, axes: Axes, members: Sequence[Element]) -> Array:
    """Return the material axes (n, 3, 3) [-] of all solids: for `members` those of a *DISTRIBUTION, else the global axes.

    Raises CaseError if a member has no axes and there is no default.
    """
    block = assembly.content.distributions.get(key_of(axes.distribution))
    if block is None:
        raise axes.error(f"distribution '{axes.distribution[:80]}' is not defined")
    scopes = [scope for scope in assembly.scopes if assembly.part(scope) is axes.part]
    default, frame_of = None, {}  # type: Array | None, dict[int, Array]
    for row in block.iter_rows():
        points = tuple(row.number(index) for index in range(1, 7))
        frame = local_axes(Axes(row.location, "", False, points), np.zeros(3))
        if not row.text(0):
            default = frame
            continue
        for scope in scopes:
            for element in assembly.elements_of(qualified(scope, row.text(0)), row.location):
                frame_of[id(element)] = frame
    starts = starts_of(assembly.solids_by_type)
    frames = np.tile(np.eye(3), (len(assembly.solids), 1, 1))
    for element in members:
        axes_of_element = frame_of.get(id(element), default)
        if axes_of_element is None:
            raise block.error(f"element {element.number} has no axes, and there is no default line without an element")
        frames[starts[element.type.element] + element.row] = axes_of_element
    return frames


def local_axes(axes: Axes, point: Array) -> Array:
    """Return the local axes (3, 3) [-], in rows, at a point. Raises CaseError if they are not defined there."""
    a, b = np.reshape(axes.points, (2, 3))
    if axes.cylindrical:  # the first axis is radial, the third one along the axis of the cylinder
        first, third = point - a, b - a
        first = first - (first @ third) / max(third @ third, TINY) * third
        scales = np.linalg.norm(a) + np.linalg.norm(point), np.linalg.norm(a) + np.linalg.norm(b)
    else:
        first, third = a, np.cross(a, b)
        scales = np.linalg.norm(a), np.linalg.norm(a) * np.linalg.norm(b)
    lengths = np.linalg.norm(first), np.linalg.norm(third)
    if any(length <= LENGTH_ROUND_OFF * scale for length, scale in zip(lengths, scales, strict=True)):
        raise axes.error(f"the local axes are not defined at the point {point.tolist()}")
    first, third = first / lengths[0], third / lengths[1]
    return np.array([first, np.cross(third, first), third])
