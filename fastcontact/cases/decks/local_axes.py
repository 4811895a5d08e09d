"""Local axes of nodes and materials of a deck: *TRANSFORM and *ORIENTATION, rectangular or cylindrical."""

from __future__ import annotations

import numpy as np

from fastcontact.arrays import Array
from fastcontact.cases.decks.assembled import Assembled
from fastcontact.cases.decks.blocks import Location, folded
from fastcontact.cases.decks.content import Axes, Content

ROUND_OFF = 1e-9


def local_directions(made: Assembled) -> dict[int, Array]:
    """Return the local axes (3, 3), in rows, of the points of all nodes with *TRANSFORM [-]."""
    return {
        point: local_axes(axes, made.points[point])
        for axes in made.content.axes
        for point in made.nodes(axes.nodes, axes.location)
    }


def orientation_of(content: Content, name: str, location: Location) -> Axes:
    """Return the axes of an *ORIENTATION; CaseError if there is none of that name."""
    axes = content.orientations.get(folded(name))
    if axes is None:
        known = ", ".join(content.orientations).lower() or "none"
        raise location.refuse(f"orientation '{name}' is not defined; orientations: {known}")
    return axes


def local_axes(axes: Axes, point: Array) -> Array:
    """Return the local axes (3, 3) at a point as rows [-]; CaseError if they are not defined there."""
    a, b = np.array(axes.points[:3]), np.array(axes.points[3:])
    if axes.cylindrical:
        third, first = b - a, point - a
        third = third / max(np.linalg.norm(third), 1e-300)
        first = first - (first @ third) * third
    else:
        first, third = a, np.cross(a, b)
    lengths = np.linalg.norm(first), np.linalg.norm(third)
    if min(lengths) <= ROUND_OFF * max(1.0, float(np.abs(axes.points).max()) if not axes.cylindrical else 0.0):
        raise axes.location.refuse(f"the local axes are not defined at the point {point.tolist()}")
    first, third = first / lengths[0], third / lengths[1]
    return np.array([first, np.cross(third, first), third])
