"""Integration over the secondary surface: points, weights, nodal areas."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from fastcontact import elements
from fastcontact.contact.surface import Surface
from fastcontact.quadrature import gauss_line

Array = NDArray[np.float64]


def facet_measure(facets: NDArray[np.int32], element: str, points: Array, xi: Array, axisymmetric: bool) -> Array:
    """Return the length (or, axisymmetric, the full-circle area) per unit of xi, (n_facets, n_q), at `xi` (n_q, 1)."""
    reference = elements.get(element)
    corners = points[facets]
    tangent = np.einsum("qk,fkd->fqd", reference.gradient(xi)[:, :, 0], corners)
    measure = np.linalg.norm(tangent, axis=2)
    if axisymmetric:
        measure = measure * (2 * np.pi * np.einsum("qk,fk->fq", reference.shape(xi), corners[:, :, 0]))
    return measure


def mass_matrix(surface: Surface, points: Array, axisymmetric: bool) -> csr_array:
    """Return the surface mass matrix (m, m) in the order of ``surface.points`` [area]."""
    element = elements.get(surface.element)
    xi, weights = gauss_line(element.n_nodes + 1)
    N = element.shape(xi)
    dA = facet_measure(surface.facets, surface.element, points, xi, axisymmetric) * weights
    local = np.einsum("fq,qa,qb->fab", dA, N, N)
    row = np.broadcast_to(surface.local[:, :, None], local.shape)
    column = np.broadcast_to(surface.local[:, None, :], local.shape)
    size = len(surface.points)
    return coo_array((local.ravel(), (row.ravel(), column.ravel())), shape=(size, size)).tocsr()


def nodal_areas(surface: Surface, points: Array, axisymmetric: bool) -> Array:
    """Return the integral of each node's shape function (m,) [area]."""
    return np.asarray(mass_matrix(surface, points, axisymmetric).sum(axis=1)).ravel()
