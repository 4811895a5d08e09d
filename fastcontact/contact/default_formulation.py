"""Which formulation suits a pair of surfaces: mortar where facets are quadratic or do not match, else node-to-segment."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastcontact.contact.projection import places
from fastcontact.contact.search.closest import closest_of_kinds
from fastcontact.contact.surface import Surface

Array = NDArray[np.float64]
# In facet lengths: how far from a node a projection may lie and still be opposite to it; how much farther apart than
# the closest points others may be and still tell whether the sides match; and how far beyond an edge they may lie.
OPPOSITE, NEAR, BESIDE = 0.2, 0.5, 0.05


def default_formulation(secondary: Surface, primary: Surface, points: Array) -> tuple[str, str]:
    """Return the name of the formulation for a pair of surfaces at reference `points` (n_points, dim), and why."""
    if points.shape[1] == 2 and max(len(secondary.blocks), len(primary.blocks)) > 1:
        return "continuous", "a side mixes linear and quadratic facets"
    if max(secondary.order, primary.order) == 2:
        return "mortar", "facets are quadratic"
    if not opposite(secondary, primary, points):
        return "mortar", "the nodes of the two sides do not lie opposite to each other"
    return "node_to_segment", "facets are linear and the nodes of the two sides lie opposite to each other"


def opposite(secondary: Surface, primary: Surface, points: Array) -> bool:
    """Return whether the nodes of two surfaces at reference `points` (n_points, dim) lie opposite to each other."""
    return _opposite(secondary, primary, points) and _opposite(primary, secondary, points)


def _opposite(side: Surface, other: Surface, points: Array) -> bool:
    """Return whether the nodes of `side` that are nearly closest to `other` project on its nodes."""
    found = closest_of_kinds(points[side.points], other.corners(points))
    facing = points[places(other, found.facet, found.xi).nodes]
    size = np.linalg.norm(np.ptp(facing, axis=1), axis=1)
    away = np.linalg.norm(facing - found.position[:, None], axis=2).min(axis=1)
    within = found.overhang <= BESIDE
    near = within & (found.distance <= found.distance[within].min(initial=np.inf) + NEAR * size)
    return bool(near.any() and (away[near] <= OPPOSITE * size[near]).all())
