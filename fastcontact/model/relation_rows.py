"""Rows of multi-point constraints along given directions and surface normals, and the matching of nodes of two groups."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_array, vstack

from fastcontact._tools.argument_types import finite_vector
from fastcontact._tools.neighbours import nearest
from fastcontact.arrays import Array, Indices
from fastcontact.contact.projection import nodal_normals
from fastcontact.contact.surface import FacetBlock, Surface
from fastcontact.elasticity.loads import facets_of, outward
from fastcontact.errors import ModelError
from fastcontact.linear.sparse_rows import nodal_rows
from fastcontact.mesh.mesh import Mesh
from fastcontact.round_off import ROUND_OFF, SINGLE_PRECISION

NORMAL = "normal"


def normals_of(mesh: Mesh, group: str) -> tuple[Indices, Array]:
    """Return the nodes (m,) of a group of outer facets, and their unit normals (m, dim), averaged over adjacent facets.

    Raises the same errors as a pressure on the group.
    """
    facets = {name: outward(mesh, group, name, block) for name, block in facets_of(mesh, group).items()}
    points = np.unique(np.concatenate([block.ravel() for block in facets.values()]))
    position = np.full(mesh.n_points, -1, np.intp)
    position[points] = np.arange(len(points))
    blocks = tuple(FacetBlock(name, block, position[block]) for name, block in facets.items())
    normal = nodal_normals(Surface(group, blocks, points, np.zeros(len(points))), mesh.points)
    normal[np.abs(normal) < ROUND_OFF] = 0.0
    return points.astype(np.intp), normal / np.linalg.norm(normal, axis=1, keepdims=True)


def directions_of(mesh: Mesh, group: str, component: str) -> list[tuple[Indices, Array]]:
    """Return the nodes (m,) of a group and unit vectors (m, dim) for each direction that `component` names.

    `component` is ``"normal"``, or some of the letters x, y and z.
    """
    if component == NORMAL:
        return [normals_of(mesh, group)]
    nodes = mesh.points_of(group).astype(np.intp)
    return [(nodes, np.tile(np.eye(mesh.dim)["xyz".index(axis)], (len(nodes), 1))) for axis in component]


def along(nodes: Indices, directions: Array, n_dofs: int) -> csr_array:
    """Return the rows (m, n_dofs) of the displacement of each node (m,) along its unit vector (m, dim) [-]."""
    return nodal_rows(nodes[:, None], directions[:, None], n_dofs)


def less_first(rows: csr_array) -> csr_array:
    """Return the rows (m, n) after the first, less the first one, (m - 1, n)."""
    return csr_array(rows[1:] - csr_array(vstack([rows[[0]]] * (rows.shape[0] - 1), format="csr")))


def matched(
    mesh: Mesh, first: tuple[str, Indices], second: tuple[str, Indices], translation: Sequence[float] | None
) -> Indices:
    """Return, for each node of the first group, the index of the node of the second with which it coincides when moved.

    The first group is moved by `translation` (dim,) [length], by default from the centre of its bounding box to that of the
    second group. Each group is given as (name, nodes).

    Raises
    ------
    ModelError
        If the groups have different numbers of nodes, or do not coincide.
    """
    (name, nodes), (other, opposite) = first, second
    if len(nodes) != len(opposite):
        raise ModelError(f"groups '{name}' and '{other}' have {len(nodes)} and {len(opposite)} nodes: they must match")
    x, target = mesh.points[nodes], mesh.points[opposite]
    shift: Array | None = 0.5 * (target.min(axis=0) + target.max(axis=0) - x.min(axis=0) - x.max(axis=0))
    if translation is not None:
        shift = finite_vector(translation, mesh.dim)
    if shift is None:
        raise ModelError(f"the translation {translation} of '{name}' must be {mesh.dim} numbers")
    distance, match = nearest(target, x + shift)
    size = max(float(np.ptp(x, axis=0).max()), 1e-3 * float(np.ptp(mesh.points, axis=0).max()))
    worst = int(np.argmax(distance))
    if distance[worst] > SINGLE_PRECISION * size or len(np.unique(match)) < len(match):
        raise ModelError(
            f"point {nodes[worst]} of '{name}', moved by {shift}, lies {distance[worst]:.3g} from the nearest node of "
            f"'{other}': groups are joined node by node; give the translation between them, or use another mesh"
        )
    return match
