"""Facets and nodes shared by two contact pairs, for which the distribution of the contact force is not unique."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from fastcontact.arrays import Array, Numbers
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.projection import CORNER, nodal_normals
from fastcontact.contact.side_checks import nodes_of_shared_facets
from fastcontact.contact.surface import Surface
from fastcontact.errors import ContactError
from fastcontact.mesh.mesh import Mesh
from fastcontact.model.contact_pair import ContactPair
from fastcontact.round_off import LENGTH_ROUND_OFF, SINGLE_PRECISION


def check_repeated(mesh: Mesh, pair: ContactPair, other: ContactPair) -> None:
    """Raise ContactError if two pairs share facets on both sides, in either role, or the same facets and the same obstacle.

    A surface may face several other surfaces, because the opposite side of each pair then differs.
    """
    if pair.obstacle is not None or other.obstacle is not None:
        _check_obstacles(mesh, pair, other)
    elif {pair.secondary, pair.primary} == {other.secondary, other.primary}:
        raise ContactError(
            f"contact '{pair.name}' has the sides '{pair.secondary}' and '{pair.primary}', like contact '{other.name}': "
            "remove one of the two"
        )
    else:
        for facing, opposite in ((other.secondary, other.primary), (other.primary, other.secondary)):
            nodes = nodes_of_shared_facets(mesh, pair.secondary, facing)
            if len(nodes) and len(nodes_of_shared_facets(mesh, pair.primary, opposite)):
                raise ContactError(
                    f"contact '{pair.name}' pairs facets of '{pair.secondary}' and '{pair.primary}' that are also paired by "
                    f"contact '{other.name}': '{pair.secondary}' and '{facing}' share facets with {len(nodes)} nodes "
                    f"(first: point {nodes[0]}), and '{pair.primary}' and '{opposite}' share facets, too. Remove one of the "
                    "two contacts, or separate their groups"
                )


def share_facets(mesh: Mesh, sides: tuple[str, str], other: ContactPair) -> bool:
    """Return whether the two `sides` share facets with the two sides of the pair `other`, in either role.

    The result is False if `other` has an obstacle.
    """
    if other.obstacle is not None:
        return False
    roles = (other.secondary, other.primary), (other.primary, other.secondary)
    return any(all(len(nodes_of_shared_facets(mesh, *groups)) for groups in zip(sides, role)) for role in roles)


def _check_obstacles(mesh: Mesh, pair: ContactPair, other: ContactPair) -> None:
    """Raise ContactError if the obstacles of both pairs have equal gaps, normals and motions on shared secondary facets.

    Two obstacles that form a corner differ there.
    """
    if pair.obstacle is None or other.obstacle is None:
        return
    if any(getattr(pair, key) != getattr(other, key) for key in ("motion", "ramp", "rotation", "rotation_ramp")):
        return
    nodes = nodes_of_shared_facets(mesh, pair.secondary, other.secondary)
    if not len(nodes):
        return
    points = mesh.points[nodes]
    (gap, normal), (other_gap, other_normal) = pair.obstacle.distance(points), other.obstacle.distance(points)
    size = float(np.ptp(mesh.points, axis=0).max())
    same_gap = np.allclose(gap, other_gap, rtol=0.0, atol=LENGTH_ROUND_OFF * size)
    if same_gap and np.allclose(normal, other_normal, atol=SINGLE_PRECISION):
        raise ContactError(
            f"contact '{pair.name}' presses facets of '{pair.secondary}' against the same rigid obstacle as contact "
            f"'{other.name}', with {len(nodes)} nodes (first: point {nodes[0]}): leave out one of the two"
        )


def split_side_warnings(pairs: Sequence[tuple[ContactPair, Formulation]]) -> Iterator[str]:
    """Yield a warning for every two contact pairs whose sides adjoin each other at common nodes, on both bodies.

    Each pair has a separate pressure at such a node, but the gap determines only the sum of the two pressures. Their
    ratio, and with it the pressure at neighbouring nodes, is arbitrary. Node-to-segment contact divides the force of a
    node in the ratio of the areas, which is correct if both pairs have the same primary side. If the primary side is
    divided as well, each pair faces only a part of this side.
    """
    for (pair, sides), (other, other_sides) in combinations(pairs, 2):
        if not isinstance(sides.primary, Surface) or not isinstance(other_sides.primary, Surface):
            continue
        if {pair.formulation, other.formulation} == {"node_to_segment"} and pair.primary == other.primary:
            continue
        roles = ((other_sides.secondary, other_sides.primary), (other_sides.primary, other_sides.secondary))
        for secondary, primary in roles:
            nodes = _common_smooth_nodes(sides.points, sides.secondary, secondary)
            if len(nodes) and len(_common_smooth_nodes(sides.points, sides.primary, primary)):
                yield (
                    f"contacts '{pair.name}' and '{other.name}' adjoin each other at common nodes of their sides "
                    f"(number: {len(nodes)}, first: point {nodes[0]}): the pressure near them is not unique; combine "
                    "the two contacts into one, with one group for each side"
                )


def _common_smooth_nodes(points: Array, side: Surface, other: Surface) -> Numbers:
    """Return the common nodes of two surfaces at which their normals differ by less than CORNER."""
    nodes, side_index, other_index = np.intersect1d(side.points, other.points, return_indices=True)
    if not len(nodes):
        return nodes
    normals = [nodal_normals(surface, points)[index] for surface, index in ((side, side_index), (other, other_index))]
    return np.asarray(nodes[np.einsum("nd,nd->n", *normals) > np.cos(np.radians(CORNER))])
