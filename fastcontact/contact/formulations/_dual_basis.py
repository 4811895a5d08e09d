r"""Dual shape functions, which are biorthogonal to the shape functions of the displacements on each facet.

Let :math:`\tilde N` be the vector of the shape functions of a facet, modified where necessary so that they are positive on
the facet and sum to one. The dual functions

.. math:: \psi = \mathrm{diag}(w) M^{-1} \tilde N, \quad w = \int \tilde N, \quad M = \int \tilde N \tilde N^T

satisfy :math:`\int \psi_j \tilde N_k = w_j \delta_{jk}` and sum to one (Wohlmuth, 2000). The integrals are taken over the
part of the facet that faces the other side, so that both properties hold on this part (Cichosz and Bischoff, 2011; Popp,
Seitz, Gee and Wall, 2013). If the weight of a shape function on this part nearly vanishes, M is nearly singular. This shape
function then has no dual function, and the dual functions of the others sum to one.

The corner shape functions of quadratic facets are not positive. A fraction of the functions of the mid-side nodes is
therefore added to the corner functions (Popp, Wohlmuth, Gee and Wall, 2012). All functions are then positive on the facet, so
that no part of the facet has a negative weight. On lines, triangles and nine-node quadrangles the new functions are Bernstein
polynomials. In the new basis, the coefficient of a corner is the displacement of the corner, and the coefficient of a
mid-side node also depends on the displacements of the ends of its edge.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from fastcontact.arrays import Array, Mask
from fastcontact.mesh import elements
from fastcontact.round_off import LENGTH_ROUND_OFF, TINY

# Smallest covered fraction, that is, the fraction of the weight of a function that faces the other side. A node with a
# smaller fraction has no gap, because its weighted gap would be extrapolated from a small part. On facets with
# ill-conditioned dual functions, a function with a smaller fraction has no dual function. With 0.0002, random model 11 takes
# 6 pairings (3 with 0.02).
SMALL_FRACTION = 0.02
# Covered fractions above this multiple of the largest one count as equal to it, because on curved facets the fractions of
# fully covered functions differ by a few percent.
EQUAL_FRACTION = 0.9
# Dual functions count as ill conditioned if the root mean square of one of them exceeds LARGEST_RMS, or if the integral of
# one of them is less than SMALL_INTEGRAL times its weight. Dual functions of complete facets have root mean squares up to
# 2.4 (nine nodes). If the nodes of one edge have no dual functions, the integrals of the dual functions of the other corners
# are 0.21 times their weights on eight-node quadrangles, and zero on six-node triangles.
LARGEST_RMS, SMALL_INTEGRAL = 20.0, 0.1


@cache
def positive_basis(name: str) -> Array:
    r"""Return T (n_nodes, n_nodes) such that :math:`\tilde N = T N` is positive on the facet and sums to one."""
    element = elements.get(name)
    T = np.eye(element.n_nodes)
    if element.order == 1:
        return T
    if element.n_nodes == 9:
        return _bernstein_square(element)
    # Fraction of the function of a mid-side node that is moved to the function of each end of its edge. With 1/4 the
    # functions become Bernstein polynomials. For quadrangles without a centre node, 3/8 is the smallest fraction for which
    # all functions are positive.
    fraction = 0.375 if element.n_nodes == 8 else 0.25
    for k, ends in enumerate(_edges(element)):
        middle = element.n_corners + k
        T[list(ends), middle] = fraction
        T[middle, middle] = 1.0 - 2.0 * fraction
    return T


def _edges(element: elements.Element) -> tuple[tuple[int, int], ...]:
    """Return, for each mid-side node, the numbers of the two corners at the ends of its edge."""
    return ((0, 1),) if element.dim == 1 else element.edges


def _bernstein_square(element: elements.Element) -> Array:
    """Return T (9, 9) of nine-node quadrangles, the tensor product of the matrices of two lines; see `positive_basis`."""
    line = elements.get("line3")
    index = {-1.0: 0, 1.0: 1, 0.0: 2}
    line_nodes = np.array([[index[float(c)] for c in node] for node in element.nodes])
    T = positive_basis(line.name)
    return T[np.ix_(line_nodes[:, 0], line_nodes[:, 0])] * T[np.ix_(line_nodes[:, 1], line_nodes[:, 1])]


def dual_functions(mass: Array, admissible: Mask, fraction: Array) -> tuple[Array, Array]:
    r"""Return the dual functions of facets of which only a part may face the other side.

    As long as the dual functions of a facet are ill conditioned, dual functions are omitted in four stages: those of shape
    functions with a small covered fraction, then all except those with the largest fraction, then those with small
    integrals, and finally all except the first one with the largest fraction.

    Parameters
    ----------
    mass : ndarray (n_facets, k, k)
        Integrals of products of the positive shape functions over the covered part [area].
    admissible : ndarray of bool (n_facets, k)
        Functions that may have a dual function.
    fraction : ndarray (n_facets, k)
        Integral of each function over the covered part, relative to its integral over the complete facet [-].

    Returns
    -------
    dual, D : ndarray (n_facets, k, k)
        Coefficients and integrals of the dual functions, see `biorthogonal`.
    """
    with_dual = admissible & (fraction > 0.0)
    dual, D = biorthogonal(mass, with_dual)
    covered = np.where(with_dual, fraction, -1.0)
    # Nearly equal fractions are treated as equal, so that the choice does not change as facets deform.
    large = covered >= EQUAL_FRACTION * covered.max(axis=1, keepdims=True)
    largest = np.argmax(large, axis=1)[:, None] == np.arange(with_dual.shape[1])
    # None stands for the selection by integrals, which depends on the dual functions of the previous stage.
    for reduced in (with_dual & (fraction > SMALL_FRACTION), with_dual & large, None, with_dual & largest):
        facets = np.flatnonzero(~_well_conditioned(dual, mass, with_dual))
        if not len(facets):
            break
        if reduced is None:
            reduced = with_dual & _has_sufficient_integral(dual, mass)
        with_dual[facets] = np.where(np.any(reduced[facets], axis=1, keepdims=True), reduced[facets], with_dual[facets])
        dual[facets], D[facets] = biorthogonal(mass[facets], with_dual[facets])
    return dual, D


def _well_conditioned(dual: Array, mass: Array, with_dual: Mask) -> Mask:
    """Return for which facets (n_facets,) the dual functions are well conditioned.

    The limits are LARGEST_RMS and SMALL_INTEGRAL. `dual` is the first result of `biorthogonal` for `mass` and `with_dual`.
    """
    area = np.maximum(mass.sum(axis=(1, 2)), TINY)
    with np.errstate(invalid="ignore", over="ignore"):
        root_mean_square = np.sqrt(np.einsum("fab,fbc,fac->fa", dual, mass, dual) / area[:, None]).max(axis=1)
        # The dual functions sum to one if all coefficients of their sum are one.
        deviation = np.abs(dual.sum(axis=1) - 1.0).max(axis=1)
    sufficient = (_has_sufficient_integral(dual, mass) | ~with_dual).all(axis=1)
    return ((root_mean_square <= LARGEST_RMS) & (deviation <= LENGTH_ROUND_OFF) & sufficient) | ~with_dual.any(axis=1)


def _has_sufficient_integral(dual: Array, mass: Array) -> Mask:
    """Return which dual functions (n_facets, k) have integrals of at least SMALL_INTEGRAL times their weights w."""
    weight = mass.sum(axis=2)
    with np.errstate(invalid="ignore", over="ignore"):
        return np.asarray(np.einsum("fab,fb->fa", dual, weight) >= SMALL_INTEGRAL * weight)


def biorthogonal(mass: Array, with_dual: Mask) -> tuple[Array, Array]:
    r"""Return the dual functions of facets, and their integrals with the positive shape functions.

    Both results are NaN for facets whose shape functions are linearly dependent to machine precision.

    Parameters
    ----------
    mass : ndarray (n_facets, k, k)
        Integrals of products of the positive shape functions [area].
    with_dual : ndarray of bool (n_facets, k)
        Functions that have a dual function; the dual functions of the others are zero.

    Returns
    -------
    dual : ndarray (n_facets, k, k)
        Coefficients of the dual functions, :math:`\psi_j = \sum_k dual_{jk} \tilde N_k` [-]. The dual functions sum to one.
    D : ndarray (n_facets, k, k)
        Integrals :math:`\int \psi_j \tilde N_k` [area]; diagonal among the functions that have a dual function.
    """
    k = mass.shape[1]
    count = with_dual.sum(axis=1)[:, None, None]
    # Shape functions without a dual function are distributed equally to the others, which therefore still sum to one.
    basis = np.eye(k) * with_dual[:, :, None] + with_dual[:, :, None] * ~with_dual[:, None, :] / np.maximum(count, 1)
    G = np.where(with_dual[:, :, None] & with_dual[:, None, :], basis @ mass, np.eye(k))
    weight = np.where(with_dual, mass.sum(axis=2), 0.0)
    # Rows and columns are scaled before the inversion, because the weights of cut facets may differ by orders of magnitude.
    scale = 1.0 / np.sqrt(np.einsum("fkk->fk", G))
    G_scaled = G * scale[:, :, None] * scale[:, None, :]
    regular: Mask = np.not_equal(np.linalg.det(G_scaled), 0.0)
    G_scaled[~regular] = np.eye(k)
    inverse = np.linalg.inv(G_scaled) * scale[:, :, None] * scale[:, None, :]
    inverse[~regular] = np.nan
    dual = weight[:, :, None] * inverse @ basis
    D = np.where(with_dual[:, None, :], weight[:, :, None] * np.eye(k), dual @ mass)
    return dual, D * with_dual[:, :, None]
