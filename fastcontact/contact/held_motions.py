"""Directions in which single nodes are held, however that is said: by supports along axes, in other frames, by relations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from fastcontact.arrays import Array, Indices, Mask

# A direction is held where at least this part of it, squared, is prescribed.
HELD = 0.99
# Cosine of the angle within which directions at several nodes are taken together, as those of a curved rim are.
TOGETHER = 0.94


@dataclass(frozen=True, eq=False)
class HeldMotions:
    """The part of the displacement of nodes that is prescribed.

    Attributes
    ----------
    nodes : ndarray of int (h,)
        Nodes of which some motion is prescribed, ascending.
    projectors : ndarray (h, dim, dim)
        Orthogonal projectors on the prescribed directions [-].
    """

    nodes: Indices
    projectors: Array

    @classmethod
    def of(cls, supported: Mask, relations: csr_array) -> HeldMotions:
        """Return what `supported` components (n_points, dim) and `relations` (m, n_dofs) of single nodes hold."""
        dim = supported.shape[1]
        owners, normals = _rows_of_single_nodes(relations, dim)
        nodes = np.union1d(np.flatnonzero(supported.any(axis=1)), owners)
        projectors = np.zeros((len(nodes), dim, dim))
        projectors[:, np.arange(dim), np.arange(dim)] = supported[nodes]
        if len(owners):
            place = np.searchsorted(nodes, owners)
            np.add.at(projectors, place, np.einsum("md,me->mde", normals, normals))
            turned = np.unique(place)
            values, vectors = np.linalg.eigh(projectors[turned])
            vectors = np.where(values[:, None, :] > 1e-6, vectors, 0.0)
            projectors[turned] = vectors @ vectors.transpose(0, 2, 1)
        return cls(nodes, projectors)

    def at(self, nodes: NDArray[np.integer]) -> Array:
        """Return the projectors (..., dim, dim) of nodes (...), zero where nothing is held."""
        if not len(self.nodes):
            return np.zeros((*nodes.shape, *self.projectors.shape[1:]))
        place = np.minimum(np.searchsorted(self.nodes, nodes), len(self.nodes) - 1)
        return np.asarray(np.where((self.nodes[place] == nodes)[..., None, None], self.projectors[place], 0.0))


def _rows_of_single_nodes(relations: csr_array, dim: int) -> tuple[Indices, Array]:
    """Return the nodes (k,) of rows that relate components of one node alone, and the unit vectors (k, dim) of the rows."""
    counts = np.diff(relations.indptr)
    rows = np.flatnonzero(counts > 0)
    if not len(rows):
        return np.empty(0, np.intp), np.empty((0, dim))
    owner = (relations.indices // dim).astype(np.intp)
    first = relations.indptr[rows]
    alone = np.minimum.reduceat(owner, first) == np.maximum.reduceat(owner, first)
    normals = np.zeros((relations.shape[0], dim))
    np.add.at(normals, (np.repeat(np.arange(len(counts)), counts), relations.indices % dim), relations.data)
    length = np.linalg.norm(normals[rows], axis=1)
    alone &= length > 0.0
    return owner[first[alone]], normals[rows[alone]] / length[alone, None]


def distinct_directions(projectors: Array) -> Array:
    """Return unit vectors (c, dim) such that each prescribed direction is one of them, or lies in the plane of some.

    Axes first; then directions at nodes with a single one, those of nearly the same angle as one; then what is left.
    """
    dim = projectors.shape[-1]
    values, vectors = np.linalg.eigh(projectors)
    axes = [axis for k, axis in enumerate(np.eye(dim)) if (projectors[:, k, k] >= HELD).any()]
    found: list[Array] = axes
    for rank in range(1, dim + 1):
        of_rank = (values > 0.5).sum(axis=1) == rank
        several = vectors[of_rank][:, :, dim - rank :].swapaxes(1, 2).reshape(-1, dim)
        for direction in several[np.sort(np.unique(several.round(9), axis=0, return_index=True)[1])]:
            known = np.array(found).reshape(-1, dim)
            within = known[np.abs(known @ direction) >= TOGETHER] if rank == 1 else known
            spanned = len(within) and np.linalg.norm(np.linalg.lstsq(within.T, direction)[0] @ within) >= TOGETHER
            if not spanned:
                found.append(direction / np.linalg.norm(direction))
    return np.array(found).reshape(-1, dim)
