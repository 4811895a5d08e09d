"""Periodic cells and cyclic sectors: their two ends are tied node by node."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array, vstack
from scipy.sparse.csgraph import connected_components

from fastcontact.arrays import Array, Indices
from fastcontact.contact.obstacles.rotation import Rotation
from fastcontact.elasticity.multipoint_constraints import MultiPointConstraint
from fastcontact.errors import ModelError
from fastcontact.mesh.mesh import Mesh
from fastcontact.model.ramp import Table
from fastcontact.model.relation_rows import APART, matched

# Part of a row of a relation that has cancelled.
CANCELLED = 1e-12


class PeriodicInterface(NamedTuple):
    """Nodes of two groups that are one and the same place of a part that repeats itself: each (m,).

    Vectors at the second node are those at the first one times `turn` (dim, dim); None where nothing turns.
    """

    first: Indices
    second: Indices
    turn: Array | None = None


def same_place(interfaces: Sequence[PeriodicInterface], n_points: int) -> Indices | None:
    """Return for each node (n_points,) the first of those at its place; None without any."""
    if not interfaces:
        return None
    ends = tuple(np.concatenate(side) for side in zip(*(interface[:2] for interface in interfaces), strict=True))
    label = connected_components(csr_array((np.ones(len(ends[0])), ends), shape=(n_points, n_points)), directed=False)[
        1
    ]
    return np.unique(label, return_index=True)[1][label]


def periodic(
    mesh: Mesh, ends: tuple[str, str], jump: Mapping[int, float], free: Sequence[int],
    translation: Sequence[float] | None, ramp: Table | None,
) -> tuple[list[MultiPointConstraint], PeriodicInterface]:  # fmt: skip
    """Return the relations of two ends a period apart, and which nodes they tie.

    Parameters
    ----------
    mesh : Mesh
    ends : (str, str)
        Groups.
    jump : mapping of int to float
        By component, how much farther the second end moves than the first one at multiplier 1 [length].
    free : sequence of int
        Components in which this is the same for all nodes, but not known.
    translation : sequence of float (dim,), optional
        From the first end to the second one; by default from middle to middle [length].
    ramp : Table, optional
        History of the jump.

    ModelError if the nodes of the ends do not lie upon each other.
    """
    name = f"the periodicity of '{ends[0]}' and '{ends[1]}'"
    first, second = (mesh.points_of(end).astype(np.intp) for end in ends)
    if not len(first):
        raise ModelError(f"{name}: group '{ends[0]}' is empty")
    match = matched(mesh, (ends[0], first), (ends[1], second), translation)
    interface = PeriodicInterface(first, second[match])
    if (common := interface.first[interface.first == interface.second]).size:
        raise ModelError(f"{name}: both have point {common[0]}: a period has two ends")
    relations = []
    for axis in range(mesh.dim):
        rows = _differences(interface, np.eye(mesh.dim)[axis][:, None], mesh)
        if axis in free:
            rows = csr_array(rows[1:] - csr_array(vstack([rows[[0]]] * (len(first) - 1), format="csr")))
        if rows.shape[0]:
            relations.append(MultiPointConstraint(name, rows, float(jump.get(axis, 0.0)), ramp))
    return relations, interface


def cyclic(
    mesh: Mesh, ends: tuple[str, str], sectors: int, origin: Sequence[float], direction: Sequence[float]
) -> tuple[list[MultiPointConstraint], PeriodicInterface]:
    """Return the relations of the two ends of a sector, and which nodes they tie.

    Parameters
    ----------
    mesh : Mesh
    ends : (str, str)
        Groups.
    sectors : int
        How many make the whole.
    origin, direction : sequence of float
        A point of the axis (dim,) [length] and its direction (3,) [-].

    ModelError if the nodes of one end do not lie upon those of the other one after the turn.
    """
    name = f"the cyclic symmetry of '{ends[0]}' and '{ends[1]}'"
    first, second = (mesh.points_of(end).astype(np.intp) for end in ends)
    if not len(first) or len(first) != len(second):
        raise ModelError(
            f"{name}: the groups have {len(first)} and {len(second)} nodes, but need as many, one at least"
        )
    rotation = Rotation(tuple(map(float, origin)), tuple(map(float, direction)), 2.0 * math.pi / sectors)  # type: ignore[arg-type]
    turns = [_turned(mesh, first, second, rotation, sign) for sign in (1.0, -1.0)]
    distance, match, turn = min(turns, key=lambda one: float(one[0].max()))
    size = float(np.ptp(mesh.points[first], axis=0).max())
    far = int(np.argmax(distance))
    if distance[far] > APART * size or len(np.unique(match)) < len(match):
        raise ModelError(
            f"{name}: point {first[far]} of '{ends[0]}', turned by 1/{sectors} of a turn, lies {distance[far]:.3g} from the "
            f"nearest node of '{ends[1]}': the ends need nodes upon nodes; check axis and sectors, or mesh them alike"
        )
    interface = PeriodicInterface(first, second[match], turn)
    # u_second = Q u_first: rows (u_second - Q u_first) along the axes of the mesh, none for what lies along the axis on it.
    rows = csr_array(
        vstack([_differences(interface, np.column_stack([unit, -turn.T @ unit]), mesh) for unit in np.eye(mesh.dim)])
    )
    rows.data[np.abs(rows.data) < CANCELLED] = 0.0
    rows.eliminate_zeros()
    return [MultiPointConstraint(name, csr_array(rows[np.diff(rows.indptr) > 0]))], interface


def _turned(
    mesh: Mesh, first: Indices, second: Indices, rotation: Rotation, sign: float
) -> tuple[Array, Indices, Array]:
    """Return how far each node of the first end lies from the nearest one of the second [length], which, and the matrix."""
    from scipy.spatial import cKDTree

    turn, centre = rotation.matrix(sign * rotation.angle), np.array(rotation.centre)
    distance, match = cKDTree(mesh.points[second]).query((mesh.points[first] - centre) @ turn.T + centre)
    return np.asarray(distance), np.asarray(match, np.intp), turn


def _differences(interface: PeriodicInterface, directions: Array, mesh: Mesh) -> csr_array:
    """Return rows (m, n_dofs): second nodes along the first column of `directions` (dim, 1 or 2), plus first nodes along the
    last one; with one column less first nodes along it.
    """
    m, dim = len(interface.first), mesh.dim
    theirs = directions[:, 1] if directions.shape[1] > 1 else -directions[:, 0]
    values = np.tile(np.concatenate([directions[:, 0], theirs]), (m, 1))
    dofs = np.hstack(
        [interface.second[:, None] * dim + np.arange(dim), interface.first[:, None] * dim + np.arange(dim)]
    )
    start = 2 * dim * np.arange(m + 1)
    rows = csr_array((values.ravel(), dofs.ravel(), start), shape=(m, mesh.n_points * dim))
    rows.sum_duplicates()
    rows.eliminate_zeros()
    return rows
