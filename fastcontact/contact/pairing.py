"""Who faces whom: evaluation points of the secondary side projected on the primary facets, and their gap rows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from fastcontact import elements
from fastcontact.contact.surface import Surface
from fastcontact.search import closest

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Candidates:
    """Points of the secondary side where the gap is measured: combinations of its nodes.

    Attributes
    ----------
    nodes : ndarray of int (n, k)
        Point numbers.
    shape : ndarray (n, k)
        Weight of each node.
    """

    nodes: NDArray[np.int32]
    shape: Array

    def positions(self, coordinates: Array) -> Array:
        """Return the positions (n, dim) for nodal `coordinates` (n_points, dim)."""
        return np.einsum("nk,nkd->nd", self.shape, coordinates[self.nodes])


@dataclass(frozen=True, eq=False)
class Pairing:
    """The primary facet that each candidate faces.

    Attributes
    ----------
    facet : ndarray of int (n,)
        Row in the primary facets.
    xi : ndarray (n,)
        Reference coordinate of the projection.
    normal : ndarray (n, dim)
        Unit outward normal of the primary facet there.
    paired : ndarray of bool (n,)
        False where a candidate stands out beyond the end of the primary surface.
    """

    facet: NDArray[np.intp]
    xi: Array
    normal: Array
    paired: NDArray[np.bool_]


def pair(
    candidates: Array,
    primary: Surface,
    coordinates: Array,
    projection_tolerance: float,
    normals: str = "facet",
) -> Pairing:
    """Project candidate positions (n, 2) on the closest facet of `primary` at nodal `coordinates`.

    A candidate farther out than `projection_tolerance` facet lengths beyond the end of its facet is not paired
    (TOLE_PROJ_EXT of code_aster). With `normals` ``"averaged"``, the normal is interpolated between nodal means of
    the facets' normals, so that it does not jump where facets meet.
    """
    corners = coordinates[primary.facets]
    found = closest(candidates, corners)
    normal = found.normal
    if normals == "averaged":
        normal = _interpolated_normals(primary, corners, found.facet, found.xi)
    return Pairing(found.facet, found.xi, normal, found.overhang <= projection_tolerance)


def _interpolated_normals(primary: Surface, corners: Array, facet: NDArray[np.intp], xi: Array) -> Array:
    """Return unit normals (n, 2) at `xi` on `facet`, interpolated from nodal means."""
    element = elements.get(primary.element)
    tangent = np.einsum("ak,fkd->fad", element.gradient(element.nodes)[:, :, 0], corners)
    at_nodes = np.stack([tangent[..., 1], -tangent[..., 0]], axis=2)
    at_nodes /= np.linalg.norm(at_nodes, axis=2, keepdims=True)
    total = np.zeros((len(primary.points), 2))
    np.add.at(total, primary.local, at_nodes)
    total /= np.linalg.norm(total, axis=1, keepdims=True)
    normal = np.einsum("nk,nkd->nd", element.shape(xi[:, None]), total[primary.local[facet]])
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def gap_rows(candidates: Candidates, pairing: Pairing, primary: Surface, reference: Array) -> tuple[csr_array, Array]:
    """Return (G, gap0): gap of the candidates = gap0 + G u; rows of unpaired candidates are empty.

    ``gap = n . (x_secondary - x_primary(xi))`` with the facet, xi and normal of `pairing` held fixed; `reference`
    (n_points, dim) are undeformed coordinates, u the displacements of all points, point by point.
    """
    G = rows_along(pairing.normal, candidates, pairing, primary, reference.size)
    return G, G @ reference.ravel()


def tangents(normal: Array) -> list[Array]:
    """Return unit tangents (n, dim) that complete `normal` (n, dim): one in 2D, two in 3D."""
    if normal.shape[1] == 2:
        return [np.column_stack([normal[:, 1], -normal[:, 0]])]
    smallest = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    first = np.cross(smallest, normal)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return [first, np.cross(normal, first)]


def rows_along(
    direction: Array, candidates: Candidates, pairing: Pairing, primary: Surface, n_dofs: int
) -> csr_array:
    """Return rows (n, n_dofs): motion of the candidates along `direction` (n, dim) relative to what they face.

    Rows of unpaired candidates are empty.
    """
    dim = direction.shape[1]
    rows = np.flatnonzero(pairing.paired)
    facing = primary.facets[pairing.facet[rows]]
    shape = elements.get(primary.element).shape(pairing.xi[rows, None])
    nodes = np.hstack([candidates.nodes[rows], facing])
    weights = np.hstack([candidates.shape[rows], -shape])
    values = weights[:, :, None] * direction[rows][:, None, :]
    columns = nodes[:, :, None] * dim + np.arange(dim)
    row = np.broadcast_to(rows[:, None, None], values.shape)
    size = (len(candidates.nodes), n_dofs)
    return csr_array(coo_array((values.ravel(), (row.ravel(), columns.ravel())), shape=size).tocsr())
