"""Constraints of periodic cells and of sectors with cyclic symmetry, whose two ends are tied."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array, kron, vstack
from scipy.sparse.csgraph import connected_components

from fastcontact._tools.neighbours import nearest
from fastcontact.arrays import AnyArray, Array, Indices
from fastcontact.contact.obstacles.rigid_side import Rotation
from fastcontact.contact.projection import Closest, closest_of_types, facet_points
from fastcontact.contact.surface import Surface, surface
from fastcontact.elasticity.multipoint_constraints import MultiPointConstraint
from fastcontact.errors import ModelError
from fastcontact.linear.sparse_rows import nodal_rows, shapes_at
from fastcontact.mesh.mesh import Mesh
from fastcontact.model.ramp import Table
from fastcontact.model.relation_rows import coincident_nodes, matching_nodes, relative_to_first, vectors_to_facets
from fastcontact.round_off import ROUND_OFF

# Largest distance, relative to facet size, by which a rotated node of one end may deviate from the facets of the other
# end, or lie outside their edges. Facets of curved ends with different meshes deviate from each other by less.
LARGEST_DISTANCE = 0.02


class PeriodicInterface(NamedTuple):
    """Matching nodes of the two ends of a periodic part, `first` (m,) and `second` (m,).

    In a ring of several `sectors`, a vector at a second node is `turn` (dim, dim), the matrix of `rotation`, times that at
    the first node; the constraint `relation` enforces this for displacements. `turn`, `rotation` and `relation` are None
    without a rotation; `relation` is also None if other nodes of the ends do not match and are tied to facets.
    """

    first: Indices
    second: Indices
    turn: Array | None = None
    rotation: Rotation | None = None
    sectors: int = 1
    relation: MultiPointConstraint | None = None


def representatives(interfaces: Sequence[PeriodicInterface], n_points: int) -> Indices | None:
    """Return for each node (n_points,) the lowest number of the nodes that coincide with it.

    The result is None if there are no interfaces.
    """
    if not interfaces:
        return None
    ends = tuple(np.concatenate(side) for side in zip(*(interface[:2] for interface in interfaces), strict=True))
    graph = csr_array((np.ones(len(ends[0])), ends), shape=(n_points, n_points))
    label = connected_components(graph, directed=False)[1]
    return np.unique(label, return_index=True)[1][label]


def periodic(
    mesh: Mesh, ends: tuple[str, str], jump: Mapping[int, float], free: Sequence[int],
    translation: Sequence[float] | None, ramp: Table | None,
) -> tuple[list[MultiPointConstraint], PeriodicInterface]:  # fmt: skip
    """Return the constraints of two ends a period apart, and the nodes that they tie.

    Parameters
    ----------
    mesh : Mesh
    ends : (str, str)
        Groups.
    jump : mapping of int to float
        Displacement of the second end relative to the first one at multiplier 1, by component [length].
    free : sequence of int
        Components in which the jump is equal for all nodes, but unknown.
    translation : sequence of float (dim,), optional
        Vector from the first end to the second; by default between the centres of their bounding boxes [length].
    ramp : Table, optional
        Ramp of the jump.

    Raises
    ------
    ModelError
        If the nodes of the ends do not coincide after the translation.
    """
    name = f"the periodicity of '{ends[0]}' and '{ends[1]}'"
    first, second = (mesh.points_of(end).astype(np.intp) for end in ends)
    if not len(first):
        raise ModelError(f"{name}: group '{ends[0]}' is empty")
    match = matching_nodes(mesh, (ends[0], first), (ends[1], second), translation)
    interface = PeriodicInterface(first, second[match])
    if (common := interface.first[interface.first == interface.second]).size:
        raise ModelError(f"{name}: both groups contain point {common[0]}: a period has two ends")
    relations = []
    for axis in range(mesh.dim):
        unit = np.eye(mesh.dim)[axis]
        rows = _rows(interface, unit, -unit, mesh)
        if axis in free:
            rows = relative_to_first(rows)
        if rows.shape[0]:
            relations.append(MultiPointConstraint(name, rows, float(jump.get(axis, 0.0)), ramp))
    return relations, interface


def cyclic(
    mesh: Mesh, ends: tuple[str, str], sectors: int, origin: Sequence[float], direction: Sequence[float]
) -> tuple[list[MultiPointConstraint], PeriodicInterface]:
    """Return the constraints of the two ends of a sector, and their coincident nodes.

    Parameters
    ----------
    mesh : Mesh
    ends : (str, str)
        Groups.
    sectors : int
        Number of sectors in the ring.
    origin, direction : sequence of float
        A point on the axis (dim,) [length] and its direction (3,) [-].

    Raises
    ------
    ModelError
        If, after the rotation, neither the nodes nor the surfaces of the ends coincide.
    """
    name = f"the cyclic symmetry of '{ends[0]}' and '{ends[1]}'"
    first, second = (mesh.points_of(end).astype(np.intp) for end in ends)
    if not len(first) or not len(second):
        raise ModelError(f"{name}: one of the groups is empty")
    rotation = Rotation(tuple(map(float, origin)), tuple(map(float, direction)), 2.0 * math.pi / sectors)  # type: ignore[arg-type]
    turn, shift = min(
        (_motion(rotation, sign) for sign in (1.0, -1.0)),
        key=lambda motion: float(nearest(mesh.points[second], mesh.points[first] @ motion[0].T + motion[1])[0].max()),
    )
    match, distance, tolerance = coincident_nodes(mesh, (ends[0], first), (ends[1], second), turn, shift)
    worst = int(np.argmax(distance))
    is_matched = distance <= tolerance
    interface = PeriodicInterface(first[is_matched], second[match[is_matched]], turn, rotation, sectors)
    if len(first) == len(second) == len(np.unique(match)) and is_matched.all():
        relation = MultiPointConstraint(name, turned_rows(interface, 1.0, mesh))
        return [relation], interface._replace(relation=relation)
    dependent, facets = (ends[0], ends[1]) if len(first) >= len(second) else (ends[1], ends[0])
    if all(mesh.cells_of(end, dim=mesh.dim - 1) for end in ends):
        for sign in (1.0, -1.0):
            if (rows := _rows_to_facets(mesh, dependent, facets, rotation, sign)) is not None:
                return [MultiPointConstraint(name, _without_zeros(rows))], interface
    raise ModelError(
        f"{name}: point {first[worst]} of '{ends[0]}', turned by 1/{sectors} of a turn, lies {distance[worst]:.3g} from the "
        f"nearest node of '{ends[1]}', and the groups do not consist of facets that coincide: check axis and sectors"
    )


def turned_rows(interface: PeriodicInterface, phase: complex, mesh: Mesh) -> csr_array:
    """Return the rows (m, n_dofs) of ``u_second = phase Q u_first``, where Q is the matrix `turn` of an interface.

    Rows of zeros are left out, such as that of the axial component of a point on the axis with a phase of 1.
    """
    assert interface.turn is not None
    Q = interface.turn
    rows = [_rows(interface, unit, -phase * Q.T @ unit, mesh) for unit in np.eye(mesh.dim)]
    return _without_zeros(csr_array(vstack(rows)))


def _rows_to_facets(mesh: Mesh, dependent: str, facets: str, rotation: Rotation, sign: float) -> csr_array | None:
    """Return rows that tie the rotated displacements of the nodes of one end to those of the opposite facets of the other.

    Returns None if the rotated nodes do not lie on these facets. Linear fields satisfy the rows exactly.
    """
    side, nodes = surface(mesh, facets), mesh.points_of(dependent).astype(np.intp)
    turn, shift = _motion(rotation, sign)
    nodes_by_type = side.node_positions(mesh.points)
    near = _closest(mesh.points[nodes] @ turn.T + shift, vectors_to_facets(mesh, nodes) @ turn.T, side, nodes_by_type)
    sizes = np.concatenate([np.ptp(block, axis=1).max(axis=1) for block in nodes_by_type])
    if (near.distance > LARGEST_DISTANCE * sizes[near.facet]).any() or (near.overhang > LARGEST_DISTANCE).any():
        return None
    projected = facet_points(side, near.facet, near.xi)
    m, dim, n = len(nodes), mesh.dim, mesh.n_points
    weights, identity = shapes_at(projected.shape, projected.nodes, n), shapes_at(np.ones((m, 1)), nodes[:, None], n)
    return csr_array(kron(identity, turn) - kron(weights, np.eye(dim)))


def _motion(rotation: Rotation, sign: float) -> tuple[Array, Array]:
    """Return the matrix (dim, dim) [-] and translation (dim,) [length] of a rotation by one sector in direction `sign`."""
    turn, centre = rotation.matrix(sign * rotation.angle), np.array(rotation.centre)
    return turn, centre - turn @ centre


def _closest(positions: Array, inward: Array, facets: Surface, nodes_by_type: list[Array]) -> Closest:
    """Return the projections of positions (n, dim) [length] on the closest facets of a surface.

    `nodes_by_type` are the node positions (m, n_nodes, dim) of its facets [length], see `Surface.node_positions`.

    Where two bodies are in contact, a position lies on facets of both. It is assigned to the body into which `inward`
    (n, dim) points.
    """
    near, shifted = (closest_of_types(positions + shift, nodes_by_type) for shift in (0.0, LARGEST_DISTANCE * inward))
    nodes, shifted_nodes = (facet_points(facets, closest.facet, closest.xi).nodes for closest in (near, shifted))
    first_facet = np.cumsum([0] + [len(block) for block in nodes_by_type])
    for row in np.flatnonzero((nodes[:, :, None] != shifted_nodes[:, None]).all(axis=(1, 2))):
        block = int(np.searchsorted(first_facet, shifted.facet[row], side="right")) - 1
        on_facet = closest_of_types(positions[[row]], [nodes_by_type[block][[shifted.facet[row] - first_facet[block]]]])
        for values, value in zip(near, on_facet, strict=True):
            values[row] = value[0]
        near.facet[row] = shifted.facet[row]
    return near


def _without_zeros(rows: csr_array) -> csr_array:
    """Return rows without entries below round-off, and without the rows that are then empty."""
    rows.sum_duplicates()
    rows.data[np.abs(rows.data) < ROUND_OFF] = 0.0
    rows.eliminate_zeros()
    return csr_array(rows[np.diff(rows.indptr) > 0])


def _rows(interface: PeriodicInterface, at_second: AnyArray, at_first: AnyArray, mesh: Mesh) -> csr_array:
    """Return the rows (m, n_dofs) of ``at_second . u_second + at_first . u_first`` for all pairs of coincident nodes."""
    nodes = np.column_stack([interface.second, interface.first])
    return nodal_rows(nodes, np.tile([at_second, at_first], (len(nodes), 1, 1)), mesh.points.size)
