"""Integration over the secondary surface: points, weights, nodal areas."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from fastcontact.arrays import Array, Numbers
from fastcontact.contact.surface import Surface
from fastcontact.linear.sparse_rows import Entries
from fastcontact.mesh import elements, quadrature
from fastcontact.mesh.area_vectors import area_vectors


def facet_measure(facets: Numbers, element: str, points: Array, xi: Array, axisymmetric: bool) -> Array:
    """Return the length or area per unit of xi, (n_facets, n_q), at `xi` (n_q, dim - 1).

    In axisymmetry, the area over the full circle.
    """
    reference = elements.get(element)
    corners = points[facets]
    measure = np.linalg.norm(area_vectors(corners, reference.gradient(xi)), axis=2)
    if axisymmetric:
        measure = measure * (2 * np.pi * np.einsum("qk,fk->fq", reference.shape(xi), corners[:, :, 0]))
    return measure


def gauss_rule(element: str, n: int) -> quadrature.Rule:
    """Return the Gauss rule of a facet: `n` points in each direction, exact to degree 2n - 1.

    On triangles the symmetric rule of degree 2n - 2.

    Raises
    ------
    ValueError
        If `n` is larger than 5 on triangles.
    """
    if elements.get(element).dim == 1:
        return quadrature.gauss_line(n)
    if elements.get(element).n_corners == 4:
        return quadrature.gauss_square(n)
    return quadrature.triangle(2 * n - 2)


def fine_rule(element: str) -> quadrature.Rule:
    """Return a rule that integrates products of two shape functions over slightly curved facets."""
    return gauss_rule(element, elements.get(element).order + 2)


def all_nodes_carry(element: str) -> bool:
    """Return whether all nodal forces under a uniform pressure are compressive; at corners of quad8 and tri6 they are not."""
    xi, weights = fine_rule(element)
    areas = weights @ elements.get(element).shape(xi)
    return bool(areas.min() >= 1e-6 * areas.max())


def mass_matrix(surface: Surface, points: Array, axisymmetric: bool) -> csr_array:
    """Return the surface mass matrix (m, m) in the order of ``surface.points`` [area]."""
    entries = Entries()
    for block in surface.blocks:
        xi, weights = fine_rule(block.element)
        N = elements.get(block.element).shape(xi)
        dA = facet_measure(block.facets, block.element, points, xi, axisymmetric) * weights
        entries.add(block.local, block.local, np.einsum("fq,qa,qb->fab", dA, N, N))
    return entries.matrix((len(surface.points), len(surface.points)))


def nodal_areas(surface: Surface, points: Array, axisymmetric: bool) -> Array:
    """Return the integral of each node's shape function (m,) [area]."""
    return np.asarray(mass_matrix(surface, points, axisymmetric).sum(axis=1)).ravel()


def lumped_areas(side: Surface, points: Array, axisymmetric: bool) -> Array:
    """Return the share of each node (m,) of a surface in the area of its facets, positive for all elements [length^2].

    Shares are proportional to the squares of the shape functions, as for lumped masses (Hinton, Rock and Zienkiewicz, Earthq.
    Eng. Struct. Dyn. 4, 1976). `points` (n_points, dim) [length].
    """
    areas = np.zeros(len(side.points))
    for block in side.blocks:
        xi, weights = fine_rule(block.element)
        measure = facet_measure(block.facets, block.element, points, xi, axisymmetric) * weights
        shares = measure @ elements.get(block.element).shape(xi) ** 2
        shares *= (measure.sum(axis=1) / shares.sum(axis=1))[:, None]
        np.add.at(areas, block.local, shares)
    return areas
