"""Integration over surfaces: quadrature rules of facets, mass matrices, and nodal areas."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_array, eye_array

from fastcontact.arrays import AnyArray, Array, Indices, Mask, Numbers
from fastcontact.contact.surface import FacetBlock, Surface
from fastcontact.linear.sparse_rows import assembled
from fastcontact.mesh import elements, quadrature
from fastcontact.mesh.area_vectors import area_vectors
from fastcontact.round_off import SINGLE_PRECISION

# Areas below this fraction of a reference area count as zero, because pressures on them would be nearly arbitrary.
NEGLIGIBLE_AREA = 1e-3


def nodes_with_area(areas: AnyArray, facet_nodes: Sequence[Indices]) -> Mask:
    """Return the nodes (n,) whose `areas` (n,) are not negligible relative to the largest one on their facets [area].

    `facet_nodes` are arrays (n_facets, n_nodes), each with the nodes of facets of one element type.
    """
    largest = np.zeros(len(areas))
    for nodes in facet_nodes:
        np.maximum.at(largest, nodes, np.abs(areas)[nodes].max(axis=1, keepdims=True))
    return areas > NEGLIGIBLE_AREA * largest


def facet_measure(facets: Numbers, element: str, points: Array, xi: Array, axisymmetric: bool) -> Array:
    """Return the length or area (n_facets, n_q) per unit of the reference coordinates [length] or [area].

    `xi` (n_q, dim - 1) are the reference coordinates of points in each facet, and `points` (n_points, dim) the coordinates
    of all points of the mesh [length]. In axisymmetric models the circumference is included.
    """
    reference = elements.get(element)
    nodes = points[facets]
    measure = np.linalg.norm(area_vectors(nodes, reference.gradient(xi)), axis=2)
    if axisymmetric:
        measure = measure * (2 * np.pi * np.einsum("qk,fk->fq", reference.shape(xi), nodes[:, :, 0]))
    return measure


def gauss_rule(element: str, n: int) -> quadrature.Rule:
    """Return the Gauss rule of a facet with `n` points in each direction, which is exact for polynomials of degree 2n - 1.

    On triangles it is a symmetric rule of degree 2n - 2.

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
    """Return a quadrature rule that is accurate for products of two shape functions on slightly curved facets."""
    return gauss_rule(element, elements.get(element).order + 2)


def all_nodes_carry_pressure(element: str) -> bool:
    """Return whether the equivalent nodal forces of a uniform pressure on a facet are compressive at all of its nodes.

    At the corners of six-node triangles the forces vanish, and at those of eight-node quadrangles they are tensile.
    """
    xi, weights = fine_rule(element)
    areas = weights @ elements.get(element).shape(xi)
    return bool(areas.min() >= SINGLE_PRECISION * areas.max())


def areas_of_rule(block: FacetBlock, points: Array, axisymmetric: bool) -> tuple[Array, Array]:
    """Return the shape functions (n_quad, k) [-] at the points of the `fine_rule`, and the areas (n_facets, n_quad) [area].

    The area of a quadrature point is its weight times the `facet_measure`. `points` (n_points, dim) are the coordinates of
    all points of the mesh [length].
    """
    xi, weights = fine_rule(block.element)
    measure = facet_measure(block.facets, block.element, points, xi, axisymmetric)
    return elements.get(block.element).shape(xi), measure * weights


def mass_matrix(surface: Surface, points: Array, axisymmetric: bool) -> csr_array:
    """Return the mass matrix (m, m) of a surface, the integrals of products of two shape functions [area].

    Rows and columns are in the order of ``surface.points``; `points` (n_points, dim) are the coordinates of all points
    [length].
    """
    rules = [(block.local, *areas_of_rule(block, points, axisymmetric)) for block in surface.blocks]
    blocks = [(local, local, np.einsum("fq,qa,qb->fab", dA, N, N)) for local, N, dA in rules]
    return assembled(blocks, (len(surface.points), len(surface.points)))


def nodal_areas(surface: Surface, points: Array, axisymmetric: bool) -> Array:
    """Return the integrals (m,) of the shape functions of the nodes over a surface [area]; parameters as in `mass_matrix`."""
    return np.asarray(mass_matrix(surface, points, axisymmetric).sum(axis=1)).ravel()


def even_at_axis(surface: Surface, points: Array) -> csr_array:
    """Return the map (m, m) from the values of a field at nodes off the axis to those at all nodes.

    If the end of a quadratic line lies on the axis, the integral of its shape function vanishes. The nodal force there
    hardly depends on the value p there: divided by the area of the facet, the force is a 30th of the difference between p and
    the value at the other end. Errors in the forces would be amplified accordingly. A smooth field is an even function of the
    radius r. Therefore p = (r2^2 p1 - r1^2 p2) / (r2^2 - r1^2), with the values p1 and p2 at the radii r1 and r2 of the two
    other nodes. `points` (n_points, dim) are the coordinates of all points [length]. The column of an end is empty, and all
    other nodes keep their values.
    """
    values = eye_array(len(surface.points), format="lil")
    for block in surface.blocks:
        radii = np.abs(points[block.facets, 0])
        on_axis = radii <= SINGLE_PRECISION * np.abs(points).max()  # as in `symmetry_axis.axis_nodes`
        for facet, end in zip(*np.nonzero(on_axis[:, :2]), strict=True) if block.element == "line3" else ():
            nodes = block.local[facet]
            r1_squared, r2_squared = radii[facet, [2, 1 - end]] ** 2
            values[nodes[end], nodes[end]] = 0.0
            values[nodes[end], nodes[[2, 1 - end]]] = np.array([r2_squared, -r1_squared]) / (r2_squared - r1_squared)
    return csr_array(values)


def lumped_areas(side: Surface, points: Array, axisymmetric: bool) -> Array:
    """Return lumped areas (m,) of the nodes of a surface, which are positive for all element types [area].

    Within a facet, they are proportional to the integrals of the squares of the shape functions, as for lumped masses
    (Hinton, Rock and Zienkiewicz, Earthq. Eng. Struct. Dyn. 4, 1976). `points` (n_points, dim) are the coordinates of all
    points [length].
    """
    areas = np.zeros(len(side.points))
    for block in side.blocks:
        N, dA = areas_of_rule(block, points, axisymmetric)
        nodal_parts = dA @ N**2
        nodal_parts *= (dA.sum(axis=1) / nodal_parts.sum(axis=1))[:, None]
        np.add.at(areas, block.local, nodal_parts)
    return areas
