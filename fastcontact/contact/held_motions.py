"""Directions in which supports or multi-point constraints hold nodes.

The held directions of a node are described by an orthogonal projector P (dim, dim): the component ``P u`` of the displacement
u of the node is prescribed. Supports at the end of a surface may represent a plane of symmetry.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree

from fastcontact._tools.records import record, replace
from fastcontact.arrays import Array, Indices, Mask, Numbers
from fastcontact.contact.projection import CORNER, DeformedSide
from fastcontact.contact.surface import Surface
from fastcontact.elasticity.multipoint_constraints import eliminate
from fastcontact.mesh.area_vectors import unit_vectors
from fastcontact.round_off import ROUND_OFF, SINGLE_PRECISION, TINY

# Cosine of the largest angle between directions at two adjacent nodes that belong to the same field, as along a curved rim.
SAME_DIRECTION = float(np.cos(np.radians(0.5 * CORNER)))
# Sine of the largest angle between the normal of a surface and a plane of symmetry at which the surface of the full model has
# no corner at the plane. Octagons, with an angle of 22.5 degrees, have corners there irrespective of round-off.
SMOOTH_INCLINATION = float(np.sin(np.radians(21.0)))
# Largest distance of nodes from a plane of symmetry, relative to the size of the surface, and smallest cosine of the angle
# between directions that are regarded as parallel. Coordinates in files may have six digits.
PLANE_TOLERANCE, PARALLEL = 2e-5, 1.0 - SINGLE_PRECISION


@record
class HeldMotions:
    """Prescribed components of the displacements of nodes.

    Attributes
    ----------
    nodes : ndarray of int (h,)
        Nodes with a prescribed displacement in at least one direction, in ascending order.
    projectors : ndarray (h, dim, dim)
        Orthogonal projectors onto the prescribed directions of each node [-].
    driven : ndarray of bool (n_points, dim)
        Components with a prescribed displacement other than zero.
    supported : ndarray of bool (n_points, dim)
        Components that supports hold.
    mpc_rows : csr_array (m, n_dofs)
        Rows of multi-point constraints.
    """

    nodes: Indices
    projectors: Array
    driven: Mask
    supported: Mask
    mpc_rows: csr_array

    @cached_property
    def restrained(self) -> Indices:
        """Nodes with supports or multi-point constraints, in ascending order."""
        return np.union1d(self.nodes, self.mpc_rows.indices // self.supported.shape[1])

    @cached_property
    def motion(self) -> csr_array:
        """Map (n_dofs, n_dofs) from the unknowns that supports and multi-point constraints leave to all displacements."""
        elimination, free = eliminate(self.mpc_rows, self.supported.ravel()), ~self.supported.ravel()
        free[elimination.pivots] = False
        return csr_array(elimination.T @ diags_array(free.astype(float)))

    @classmethod
    def of(cls, supported: Mask, mpc_rows: csr_array, driven: Mask | None = None) -> HeldMotions:
        """Return the prescribed components of supports and multi-point constraints.

        Parameters
        ----------
        supported : ndarray of bool (n_points, dim)
            Components that supports hold.
        mpc_rows : csr_array (m, n_dofs)
            Rows of multi-point constraints; only those that involve a single node are used for `projectors`.
        driven : ndarray of bool (n_points, dim), optional
            Components with a prescribed displacement other than zero; by default none.
        """
        dim = supported.shape[1]
        single_nodes, normals = _rows_of_single_nodes(mpc_rows, dim)
        nodes = np.union1d(np.flatnonzero(supported.any(axis=1)), single_nodes)
        projectors = np.zeros((len(nodes), dim, dim))
        projectors[:, np.arange(dim), np.arange(dim)] = supported[nodes]
        if len(single_nodes):
            index = np.searchsorted(nodes, single_nodes)
            np.add.at(projectors, index, np.einsum("md,me->mde", normals, normals))
            constrained = np.unique(index)
            projectors[constrained] = eigenspaces(projectors[constrained], SINGLE_PRECISION)
        driven = np.zeros_like(supported) if driven is None else driven
        return cls(nodes, projectors, driven, supported, mpc_rows)

    def projectors_at(self, nodes: NDArray[np.integer]) -> Array:
        """Return the projectors (..., dim, dim) of `nodes` (...); zero for nodes that are free."""
        if not len(self.nodes):
            return np.zeros((*nodes.shape, *self.projectors.shape[1:]))
        index = np.minimum(np.searchsorted(self.nodes, nodes), len(self.nodes) - 1)
        return np.asarray(np.where((self.nodes[index] == nodes)[..., None, None], self.projectors[index], 0.0))


def _rows_of_single_nodes(mpc_rows: csr_array, dim: int) -> tuple[Indices, Array]:
    """Return the nodes (k,) of the rows that involve only one node, and unit vectors (k, dim) along these rows."""
    entries, normals = mpc_rows.tocoo(), np.zeros((mpc_rows.shape[0], dim))
    row, column = entries.coords
    np.add.at(normals, (row, column % dim), entries.data)
    nodes = csr_array((np.ones(len(row)), (row, column // dim)), shape=mpc_rows.shape)
    single = (np.diff(nodes.indptr) == 1) & normals.any(axis=1)
    return nodes.indices[nodes.indptr[:-1][single]].astype(np.intp), unit_vectors(normals[single])


def eigenspaces(tensors: Array, threshold: float) -> Array:
    """Return projectors (n, dim, dim) onto the eigenvectors of symmetric `tensors` with eigenvalues >= `threshold`."""
    values, vectors = np.linalg.eigh(tensors)
    vectors = np.where(values[:, None, :] >= threshold, vectors, 0.0)
    return np.asarray(vectors @ vectors.transpose(0, 2, 1))


def deflate(projectors: Array, vectors: Array, threshold: Array | float) -> Array:
    """Return projectors (n, dim, dim) from which the directions of the projected `vectors` (n, dim) are removed.

    Vectors whose projection is shorter than `threshold` are ignored.
    """
    projected = np.einsum("nde,ne->nd", projectors, vectors)
    length = np.linalg.norm(projected, axis=1, keepdims=True)
    projected = np.where(length > threshold, projected / np.where(length > 0.0, length, 1.0), 0.0)
    return projectors - projected[:, :, None] * projected[:, None, :]


def direction_fields(projectors: Array, positions: Array) -> list[tuple[Array, Mask]]:
    """Return fields of directions in which nodes are held, such as the normals of a plane of symmetry or of a curved rim.

    Nodes that are held in one direction form a field if their directions are nearly equal, or if directions of other nodes
    lie in between. Nodes that are held in several directions are added to these fields. At the remaining nodes, each
    field is interpolated.

    Parameters
    ----------
    projectors : ndarray (n, dim, dim)
        Projectors onto the directions in which each node is held.
    positions : ndarray (n, dim)
        Positions of the nodes [length].

    Returns
    -------
    list of (ndarray (n, dim), ndarray of bool (n,))
        Unit vectors of each field at all nodes, and the nodes that are held in its direction.
    """
    remaining, fields = projectors.copy(), []
    while len(seeds := np.flatnonzero(rank := np.trace(remaining, axis1=1, axis2=2).round())):
        lowest_rank = rank[seeds].min()
        seeds = seeds[rank[seeds] == lowest_rank]
        # If all nodes are held in several directions, start from any node.
        seeds = seeds if lowest_rank == 1 else seeds[:1]
        axis = np.linalg.eigh(remaining[seeds])[1][:, :, -1]
        edges = np.where(np.abs(axis @ axis.T) >= SAME_DIRECTION, _distances(positions[seeds], positions[seeds]), 0.0)
        order, predecessor = breadth_first_order(minimum_spanning_tree(csr_array(edges)), 0, directed=False)
        for child in order[1:]:  # orient each vector like its predecessor in the tree of nearest neighbours
            axis[child] *= np.sign(axis[child] @ axis[predecessor[child]])
        # Elsewhere, directions are interpolated with powers of the inverse distances as weights. With this power, the
        # contributions of distant nodes decrease faster than their number increases.
        field = np.tile(axis[order][0], (len(positions), 1))
        if not (axis[order] @ axis[order][0] > 1.0 - ROUND_OFF).all():
            distance = _distances(positions, positions[seeds[order]])
            field = unit_vectors((distance.min(axis=1, keepdims=True) / distance) ** (1 + axis.shape[1]) @ axis[order])
        field[seeds[order]] = axis[order]
        held = np.einsum("nd,nde,ne->n", field, remaining, field) >= SAME_DIRECTION**2
        field[held] = unit_vectors(np.einsum("nde,ne->nd", remaining[held], field[held]))
        fields.append((field, held))
        remaining[held] = deflate(remaining[held], field[held], 0.0)
    return fields


def _distances(points: Array, other_points: Array) -> Array:
    """Return the distances (n, m) between points (n, dim) and other points (m, dim), at least TINY [length]."""
    from scipy.spatial.distance import cdist

    return np.maximum(cdist(points, other_points), TINY)


def symmetry_planes(
    motions: HeldMotions, surface: Surface, coordinates: Array, opposite: Array
) -> list[tuple[Array, Indices]]:
    """Return the planes of symmetry at the ends of the secondary surface.

    Each is given by its unit normal (dim,) and the nodes of the surface in the plane. Supports prescribe zero displacement
    along the normal, and the opposite body, with nodes at `opposite` (q, dim) [length], does not extend beyond the plane.
    `coordinates` (n_points, dim) are the reference coordinates of all points [length].
    """
    points = coordinates[surface.points]
    held, driven = motions.projectors_at(surface.points), motions.driven[surface.points]
    partly_held = np.trace(held, axis1=1, axis2=2) < points.shape[1] - 0.5
    tolerance, planes = PLANE_TOLERANCE * float(np.ptp(points, axis=0).max()), []
    # Facets may be short compared with the surface: nodes next to the plane do not belong to it.
    within = np.minimum(tolerance, 0.25 * surface.largest_diameters(coordinates))
    normals = DeformedSide(surface, coordinates).nodal_normals
    for axis in _held_directions(held[partly_held]):
        x, x_opposite = points @ axis, opposite @ axis
        components = np.abs(axis) > PLANE_TOLERANCE
        for end, outward in ((x.min(), -1.0), (x.max(), 1.0)):
            if np.ptp(x) <= tolerance or (outward * (x_opposite - end) > tolerance).any():
                continue
            nodes = np.flatnonzero(partly_held & (np.abs(x - end) <= within))
            on_plane = np.einsum("d,nde,e->n", axis, held[nodes], axis) >= SAME_DIRECTION**2
            on_plane &= ~driven[nodes][:, components].any(axis=1)
            # Otherwise the plane does not cut the surface.
            on_plane &= np.abs(normals[nodes] @ axis) < SMOOTH_INCLINATION
            if len(nodes) and on_plane.all():
                planes.append((axis, nodes))
    return planes


def reflected(side: Surface, motions: HeldMotions | None, coordinates: Array, opposite: Numbers) -> Surface:
    """Return a side whose averaged normals at planes of symmetry are those of the full model; see `symmetry_planes`.

    `coordinates` (n_points, dim) are the reference coordinates of all points [length], and `opposite` the nodes of the other
    side.
    """
    if motions is None or not np.isin(side.points, motions.nodes).any():
        return side
    dim = coordinates.shape[1]
    across = np.zeros((len(side.points), dim, dim))  # projectors onto the normals of the planes
    for axis, nodes in symmetry_planes(motions, side, coordinates, coordinates[opposite]):
        held = motions.projectors_at(side.points[nodes]) @ axis
        across[nodes] += held[:, :, None] * held[:, None]
    across = without_complete_facets(across, side)
    nodes = np.flatnonzero(across.any(axis=(1, 2)))
    if not len(nodes):
        return side
    reflections = np.eye(dim) - 2.0 * across[nodes]
    return replace(side, periodic_ends=(*side.periodic_ends, (nodes, nodes, reflections)))


def without_complete_facets(held: Array, side: Surface) -> Array:
    """Return projectors (n_nodes, dim, dim) without directions in which all nodes of a facet are held.

    `held` (n_nodes, dim, dim) are the projectors onto the directions in which the nodes of `side` are held.
    """
    span = np.zeros_like(held)
    for block in side.blocks:
        projectors = held[block.local]
        vectors = np.linalg.eigh(projectors.mean(axis=1))[1]
        is_common = np.einsum("fdk,fnde,fek->fnk", vectors, projectors, vectors).min(axis=1) >= SAME_DIRECTION**2
        vectors = np.where(is_common[:, None], vectors, 0.0)
        np.add.at(span, block.local, (vectors @ vectors.transpose(0, 2, 1))[:, None])
    return eigenspaces(held - held @ eigenspaces(span, 0.5) @ held, 0.5)


def _held_directions(projectors: Array) -> Array:
    """Return distinct unit vectors (k, dim) along which nodes are held, given their `projectors` (n, dim, dim).

    For a node that is held in several directions, the directions of other nodes are preferred, then the coordinate axes.
    """
    dim = projectors.shape[1]
    directions = np.empty((0, dim))
    distinct = np.unique(np.round(projectors, 9).reshape(-1, dim * dim), axis=0).reshape(-1, dim, dim)
    for P in distinct[np.argsort(np.trace(distinct, axis1=1, axis2=2), kind="stable")]:
        candidates = np.concatenate([directions, np.eye(dim)])
        in_range = candidates[np.linalg.norm(candidates @ P, axis=1) > PARALLEL]
        for n in [*in_range, *np.linalg.eigh(P)[1].T[::-1]]:
            if (length := np.linalg.norm(P @ n)) > 0.5:
                direction = P @ n / length * (1.0 if n[np.argmax(np.abs(n))] > 0.0 else -1.0)
                P = P - np.outer(direction, direction)
                if not (np.abs(directions @ direction) > PARALLEL).any():
                    directions = np.vstack([directions, direction])
    return directions
