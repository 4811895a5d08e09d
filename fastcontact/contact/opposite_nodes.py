"""Whether two surface meshes are conforming."""

from __future__ import annotations

import numpy as np

from fastcontact.arrays import Array
from fastcontact.contact.projection import places
from fastcontact.contact.search.closest import BESIDE, closest_of_kinds
from fastcontact.contact.surface import Surface

# Tolerances in facet lengths: the distance from a node within which a projection is opposite to it, and the distance beyond
# that of the closest points within which points decide whether the sides match.
OPPOSITE, NEAR = 0.2, 0.5


def opposite(secondary: Surface, primary: Surface, points: Array) -> bool:
    """Return whether the nodes of two surfaces at reference `points` (n_points, dim) lie opposite to each other."""
    return _opposite(secondary, primary, points) and _opposite(primary, secondary, points)


def _opposite(side: Surface, other: Surface, points: Array) -> bool:
    """Return whether the nodes of `side` that are nearly closest to `other` project on its nodes."""
    closest = closest_of_kinds(points[side.points], other.corners(points))
    facing = points[places(other, closest.facet, closest.xi).nodes]
    size = np.linalg.norm(np.ptp(facing, axis=1), axis=1)
    away = np.linalg.norm(facing - closest.position[:, None], axis=2).min(axis=1)
    within = closest.overhang <= BESIDE
    near = within & (closest.distance <= closest.distance[within].min(initial=np.inf) + NEAR * size)
    return bool(near.any() and (away[near] <= OPPOSITE * size[near]).all())
