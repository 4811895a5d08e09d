"""Facets that two contact pairs press on each other: their forces would be shared out at will."""

from __future__ import annotations

import numpy as np

from fastcontact.contact.side_checks import shared_facets
from fastcontact.errors import ContactError
from fastcontact.mesh.mesh import Mesh
from fastcontact.model.contact_pair import ContactPair


def check_repeated(mesh: Mesh, pair: ContactPair, other: ContactPair) -> None:
    """Raise ContactError if two pairs join the same facets, in whichever roles, or press them on the same obstacle.

    One side may meet several others: each pair then has an opposite side of its own.
    """
    if pair.obstacle is not None or other.obstacle is not None:
        _check_obstacles(mesh, pair, other)
    elif {pair.secondary, pair.primary} == {other.secondary, other.primary}:
        raise ContactError(
            f"contact '{pair.name}' joins '{pair.secondary}' and '{pair.primary}', which contact '{other.name}' joins "
            "already: leave out one of the two"
        )
    else:
        for ours, theirs in ((other.secondary, other.primary), (other.primary, other.secondary)):
            _check_sides(mesh, pair, other, ours, theirs)


def _check_sides(mesh: Mesh, pair: ContactPair, other: ContactPair, ours: str, theirs: str) -> None:
    """Compare the secondary side of `pair` with the side `ours` of `other`, the primary one with `theirs`."""
    secondary = shared_facets(mesh, pair.secondary, ours)
    if len(secondary) and len(shared_facets(mesh, pair.primary, theirs)):
        raise ContactError(
            f"contact '{pair.name}' joins facets of '{pair.secondary}' and '{pair.primary}' that contact '{other.name}' "
            f"joins already: '{pair.secondary}' and '{ours}' share facets with {len(secondary)} nodes (first: point "
            f"{secondary[0]}), '{pair.primary}' and '{theirs}' share facets, too. Leave out one of the two contacts, or make "
            "their groups apart"
        )


def _check_obstacles(mesh: Mesh, pair: ContactPair, other: ContactPair) -> None:
    """Compare the obstacles where the two sides share facets; at a corner between two obstacles they differ."""
    if pair.obstacle is None or other.obstacle is None or (pair.motion, pair.ramp) != (other.motion, other.ramp):
        return
    nodes = shared_facets(mesh, pair.secondary, other.secondary)
    if not len(nodes):
        return
    points = mesh.points[nodes]
    (gap, normal), (gap_there, normal_there) = pair.obstacle.distance(points), other.obstacle.distance(points)
    size = float(np.ptp(mesh.points, axis=0).max())
    if np.allclose(gap, gap_there, rtol=0.0, atol=1e-9 * size) and np.allclose(normal, normal_there, atol=1e-6):
        raise ContactError(
            f"contact '{pair.name}' presses facets of '{pair.secondary}' on the rigid obstacle on which contact "
            f"'{other.name}' presses them already, with {len(nodes)} nodes (first: point {nodes[0]}): leave out one of the "
            "two"
        )
