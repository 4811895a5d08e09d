"""Multi-point constraints PLANE, STRAIGHT and MEANROT of many nodes, for small displacements."""

from __future__ import annotations

import numpy as np

from fastcontact.arrays import Array
from fastcontact.cases.decks.content import MultiPoint
from fastcontact.cases.decks.meshing import DeckMesh
from fastcontact.model.couplings import Term

# Least numbers of nodes by kind.
LEAST = {"PLANE": 4, "STRAIGHT": 3, "MEANROT": 3}
# Points closer to a line or point than this fraction of their extent have no direction from it.
FLAT = 1e-9


def multi_point_rows(deck_mesh: DeckMesh, constraint: MultiPoint) -> list[list[Term]]:
    """Return the equations of a multi-point constraint; raises CaseError if its nodes do not determine it."""
    nodes = [point for name in constraint.nodes for point in deck_mesh.made.nodes(name, constraint.location)]
    nodes = [*dict.fromkeys(nodes[:-1] if constraint.kind == "MEANROT" else nodes), *nodes[-1:]]
    nodes = nodes if constraint.kind == "MEANROT" else nodes[:-1]
    if len(nodes) < LEAST[constraint.kind] or deck_mesh.dim == 2:
        raise constraint.refuse(f"{constraint.kind} needs {LEAST[constraint.kind]} different nodes or more, in 3D")
    where = deck_mesh.made.points[nodes]
    if constraint.kind == "MEANROT":
        return [_mean_rotation(constraint, nodes, where)]
    first = where[1] - where[0]
    if constraint.kind == "STRAIGHT":
        across = _directions(constraint, first)
        along = (where - where[0]) @ first / (first @ first)
        weights = np.column_stack([1.0 - along, along])
    else:
        across = np.cross(first, where[2] - where[0])[None]
        if np.linalg.norm(across) <= FLAT * (first @ first):
            raise constraint.refuse("the first three nodes of PLANE lie on a line")
        edges = np.array([first, where[2] - where[0]])
        inside = np.linalg.lstsq(edges.T, (where - where[0]).T, rcond=None)[0].T
        weights = np.column_stack([1.0 - inside.sum(axis=1), inside])
    k = weights.shape[1]
    across = across / np.linalg.norm(across, axis=1, keepdims=True)
    return [
        _terms([nodes[i], *nodes[:k]], np.outer([1.0, *-weights[i]], normal))
        for i in range(k, len(nodes))
        for normal in across
    ]


def _directions(constraint: MultiPoint, line: Array) -> Array:
    """Return two directions (2, 3) normal to a line [-]."""
    if not line.any():
        raise constraint.refuse("the first two nodes of STRAIGHT are at one place")
    return np.asarray(np.linalg.svd(line[None])[2][1:])


def _mean_rotation(constraint: MultiPoint, nodes: list[int], where: Array) -> list[Term]:
    """Return the equation that sets the first component of the last node to the mean rotation of the others about an axis.

    The mean rotation is the mean of the nodal angles about the centre, as in CalculiX: ``mean(a . (p x u) / p . p)`` with the
    axis a and the offsets p from the centre normal to it. The coordinates of the last node are the direction of the axis.
    """
    axis, places = where[-1], where[:-1] - where[:-1].mean(axis=0)
    length = np.linalg.norm(axis)
    if length == 0.0:
        raise constraint.refuse(
            "the coordinates of the last node of MEANROT are the direction of the axis, and all zero"
        )
    axis = axis / length
    offset = places - np.outer(places @ axis, axis)
    squared = np.einsum("nd,nd->n", offset, offset)
    if squared.min() <= FLAT * squared.max():
        raise constraint.refuse("a node of MEANROT lies in the middle of the others, where it has no angle")
    arms = np.cross(axis, offset) / squared[:, None] / len(offset)
    arms -= arms.mean(axis=0)
    return [*_terms(nodes[:-1], arms), (nodes[-1], 0, -1.0)]


def _terms(points: list[int], coefficients: Array) -> list[Term]:
    """Return the terms of an equation with coefficients (n, 3) for the displacements of points."""
    return [
        (point, axis, value)
        for point, row in zip(points, coefficients.tolist(), strict=True)
        for axis, value in enumerate(row)
        if value
    ]
