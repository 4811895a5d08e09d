"""Facets and nodes shared by two contact pairs, for which the distribution of the contact force is not unique."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from fastcontact.arrays import Array, Numbers
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.projection import CORNER, DeformedSide
from fastcontact.contact.side_checks import nodes_of_shared_facets
from fastcontact.contact.surface import Surface
from fastcontact.errors import ContactError
from fastcontact.mesh.mesh import Mesh
from fastcontact.model.contact_pair import ContactPair
from fastcontact.round_off import LENGTH_ROUND_OFF, SINGLE_PRECISION


def check_repeated_facets(mesh: Mesh, first: ContactPair, second: ContactPair) -> None:
    """Raise ContactError if two pairs share facets on both sides, in either role, or the same facets and the same obstacle.

    A surface may face several other surfaces, because the opposite side of each pair then differs.
    """
    if first.obstacle is not None or second.obstacle is not None:
        _check_obstacles(mesh, first, second)
    elif {first.secondary, first.primary} == {second.secondary, second.primary}:
        raise ContactError(
            f"contact '{first.name}' has the sides '{first.secondary}' and '{first.primary}', like contact "
            f"'{second.name}': remove one of the two"
        )
    else:
        for partner, opposite in ((second.secondary, second.primary), (second.primary, second.secondary)):
            nodes = nodes_of_shared_facets(mesh, first.secondary, partner)
            if len(nodes) and len(nodes_of_shared_facets(mesh, first.primary, opposite)):
                raise ContactError(
                    f"contact '{first.name}' pairs facets of '{first.secondary}' and '{first.primary}' that are also paired "
                    f"by contact '{second.name}': '{first.secondary}' and '{partner}' share facets with {len(nodes)} nodes "
                    f"(first: point {nodes[0]}), and '{first.primary}' and '{opposite}' share facets, too. Remove one of the "
                    "two contacts, or separate their groups"
                )


def share_facets(mesh: Mesh, sides: tuple[str, str], pair: ContactPair) -> bool:
    """Return whether the two `sides` share facets with the two sides of `pair`, in either role.

    The result is False if `pair` has an obstacle.
    """
    if pair.obstacle is not None:
        return False
    roles = (pair.secondary, pair.primary), (pair.primary, pair.secondary)
    return any(all(len(nodes_of_shared_facets(mesh, *groups)) for groups in zip(sides, role)) for role in roles)


def _check_obstacles(mesh: Mesh, first: ContactPair, second: ContactPair) -> None:
    """Raise ContactError if the obstacles of both pairs have equal gaps, normals and motions on shared secondary facets.

    Two obstacles that form a corner differ there.
    """
    if first.obstacle is None or second.obstacle is None:
        return
    if any(getattr(first, key) != getattr(second, key) for key in ("motion", "ramp", "rotation", "rotation_ramp")):
        return
    nodes = nodes_of_shared_facets(mesh, first.secondary, second.secondary)
    if not len(nodes):
        return
    points = mesh.points[nodes]
    (gap, normal), (second_gap, second_normal) = first.obstacle.distance(points), second.obstacle.distance(points)
    size = float(np.ptp(mesh.points, axis=0).max())
    same_gap = np.allclose(gap, second_gap, rtol=0.0, atol=LENGTH_ROUND_OFF * size)
    if same_gap and np.allclose(normal, second_normal, atol=SINGLE_PRECISION):
        raise ContactError(
            f"contact '{first.name}' presses facets of '{first.secondary}' against the same rigid obstacle as contact "
            f"'{second.name}', with {len(nodes)} nodes (first: point {nodes[0]}): leave out one of the two"
        )


def split_side_warnings(pairs: Sequence[tuple[ContactPair, Formulation]]) -> Iterator[str]:
    """Yield a warning for every two contact pairs whose sides adjoin each other at common nodes, on both bodies.

    Each pair has a separate pressure at such a node, but the gap determines only the sum of the two pressures. Their
    ratio, and with it the pressure at neighbouring nodes, is arbitrary. Node-to-segment contact divides the force of a
    node in the ratio of the areas, which is correct if both pairs have the same primary side. This does not
    hold if the primary side is divided as well, because each pair then faces only a part of this side.
    """
    for (first, first_bound), (second, second_bound) in combinations(pairs, 2):
        if not isinstance(first_bound.primary, Surface) or not isinstance(second_bound.primary, Surface):
            continue
        if {first.formulation, second.formulation} == {"node_to_segment"} and first.primary == second.primary:
            continue
        roles = ((second_bound.secondary, second_bound.primary), (second_bound.primary, second_bound.secondary))
        for secondary, primary in roles:
            nodes = _common_smooth_nodes(first_bound.points, first_bound.secondary, secondary)
            if len(nodes) and len(_common_smooth_nodes(first_bound.points, first_bound.primary, primary)):
                yield (
                    f"contacts '{first.name}' and '{second.name}' adjoin each other at common nodes of their sides "
                    f"(number: {len(nodes)}, first: point {nodes[0]}): the pressure near them is not unique; combine "
                    "the two contacts into one, with one group for each side"
                )


def _common_smooth_nodes(points: Array, first: Surface, second: Surface) -> Numbers:
    """Return the common nodes of two surfaces at which their normals differ by less than CORNER."""
    nodes, *rows = np.intersect1d(first.points, second.points, return_indices=True)
    if not len(nodes):
        return nodes
    sides = zip((first, second), rows, strict=True)
    normals = [DeformedSide(side, points).nodal_normals[index] for side, index in sides]
    return np.asarray(nodes[np.einsum("nd,nd->n", *normals) > np.cos(np.radians(CORNER))])
