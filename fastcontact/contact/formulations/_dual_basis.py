r"""Dual shape functions, which are biorthogonal to the shape functions of the displacements on each facet.

Let :math:`\tilde N` be the vector of shape functions of a facet, which are positive and sum to one. The dual functions

.. math:: \psi = \mathrm{diag}(w) M^{-1} \tilde N, \quad w = \int \tilde N, \quad M = \int \tilde N \tilde N^T

satisfy :math:`\int \psi_j \tilde N_k = w_j \delta_{jk}` and sum to one (Wohlmuth, 2000). The integrals are taken over the
part of the facet that faces the other side, so that both properties hold for this part (Cichosz and Bischoff, 2011; Popp,
Seitz, Gee and Wall, 2013). If the weight of a function in this part nearly vanishes, M is nearly singular. This function is
then left out, and the remaining dual functions sum to one without it.

The shape functions of the corners of quadratic facets are not positive. Multiples of the functions of the mid nodes are
added to them (Popp, Wohlmuth, Gee and Wall, 2012), which are large enough for the sums to be positive everywhere. No part
of a facet then has a negative weight. On lines, triangles and nine-node quadrangles the sums are Bernstein polynomials. In
this basis the coefficient of a corner is the displacement of the corner, and the coefficient of a mid node also depends on
the displacements of the ends of its edge.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from fastcontact.arrays import Array, Mask
from fastcontact.mesh import elements
from fastcontact.round_off import LENGTH_ROUND_OFF, TINY

# Fraction of the function of a mid node that is added to the functions at both ends of its edge. With 1/4 the functions
# become Bernstein polynomials. For quadrangles without a centre node, 3/8 is the smallest fraction for which all functions
# are positive.
SHARE, SHARE_WITHOUT_CENTRE = 0.25, 0.375
# A node has no gap, and a function no dual function where those of the facet would otherwise be ill conditioned, if a smaller
# fraction of its weight faces the other side. A weighted gap is that of the covered part, extrapolated to the node.
COVERED = 0.02
# Covered fractions above this multiple of the largest one count as equal to it: on curved facets they differ by a few
# percent.
EQUAL = 0.9
# Dual functions count as ill conditioned if the root mean square of one of them exceeds MOST, or if the integral of one of
# them is less than LEAST times its weight. Dual functions of complete facets have root mean squares up to 2.4 (nine nodes).
# If the nodes of an edge are left out, those of the other corners of eight nodes have 0.21 of their weights, and that of the
# other corner of six nodes has none.
MOST, LEAST = 20.0, 0.1


@cache
def positive(name: str) -> Array:
    r"""Return T (n_nodes, n_nodes) with :math:`\tilde N = T N`, positive on the facet, summing to one."""
    element = elements.get(name)
    T = np.eye(element.n_nodes)
    if element.order == 1:
        return T
    if element.n_nodes == 9:
        return _bernstein_square(element)
    share = SHARE_WITHOUT_CENTRE if element.n_nodes == 8 else SHARE
    for k, ends in enumerate(_edges(element)):
        middle = element.n_corners + k
        T[list(ends), middle] = share
        T[middle, middle] = 1.0 - 2.0 * share
    return T


def _edges(element: elements.Element) -> tuple[tuple[int, int], ...]:
    """Return the numbers of the two corners of the edge of each mid node."""
    return ((0, 1),) if element.dim == 1 else element.edges


def _bernstein_square(element: elements.Element) -> Array:
    """Return T (9, 9) of nine-node quadrangles, the tensor product of the matrices of two lines; see `positive`."""
    line = elements.get("line3")
    index = {-1.0: 0, 1.0: 1, 0.0: 2}
    at = np.array([[index[float(c)] for c in node] for node in element.nodes])
    T = positive(line.name)
    return T[np.ix_(at[:, 0], at[:, 0])] * T[np.ix_(at[:, 1], at[:, 1])]


def dual_functions(mass: Array, kept: Mask, fraction: Array) -> tuple[Array, Array]:
    r"""Return the dual functions of facets of which an arbitrary part faces the other side.

    If the dual functions of a facet are ill conditioned, functions are left out: first those with a small covered fraction,
    then all but those with the largest fraction, then those whose dual functions have small integrals, and finally all but
    the first of those with the largest fraction.

    Parameters
    ----------
    mass : ndarray (n_facets, k, k)
        Integrals of products of the positive shape functions over the covered part [area].
    kept : ndarray of bool (n_facets, k)
        Functions that may have a dual function.
    fraction : ndarray (n_facets, k)
        Integral of each function over the covered part, relative to its integral over the complete facet [-].

    Returns
    -------
    dual, D : ndarray (n_facets, k, k)
        See `biorthogonal`.
    """
    partial = kept & (fraction > 0.0)
    dual, D = biorthogonal(mass, partial)
    share = np.where(partial, fraction, -1.0)
    # Nearly equal fractions are treated as equal, so that the choice does not change as facets deform.
    large = share >= EQUAL * share.max(axis=1, keepdims=True)
    largest = np.argmax(large, axis=1)[:, None] == np.arange(partial.shape[1])
    for fewer in (partial & (fraction > COVERED), partial & large, None, partial & largest):
        wild = np.flatnonzero(~_tame(dual, mass, partial))
        if not len(wild):
            break
        if fewer is None:
            fewer = partial & _sufficient(dual, mass)
        partial[wild] = np.where(np.any(fewer[wild], axis=1, keepdims=True), fewer[wild], partial[wild])
        dual[wild], D[wild] = biorthogonal(mass[wild], partial[wild])
    return dual, D


def _tame(dual: Array, mass: Array, partial: Mask) -> Mask:
    """Return for which facets (n_facets,) the dual functions are well conditioned, see MOST and LEAST.

    Parameters are those of `biorthogonal`, with its result `dual`.
    """
    area = np.maximum(mass.sum(axis=(1, 2)), TINY)
    with np.errstate(invalid="ignore", over="ignore"):
        size = np.sqrt(np.einsum("fab,fbc,fac->fa", dual, mass, dual) / area[:, None]).max(axis=1)
        # The dual functions sum to one if all coefficients of their sum are one.
        off = np.abs(dual.sum(axis=1) - 1.0).max(axis=1)
    sufficient = (_sufficient(dual, mass) | ~partial).all(axis=1)
    return ((size <= MOST) & (off <= LENGTH_ROUND_OFF) & sufficient) | ~partial.any(axis=1)


def _sufficient(dual: Array, mass: Array) -> Mask:
    """Return which dual functions (n_facets, k) have integrals of at least LEAST times their weights."""
    weight = mass.sum(axis=2)
    with np.errstate(invalid="ignore", over="ignore"):
        return np.asarray(np.einsum("fab,fb->fa", dual, weight) >= LEAST * weight)


def biorthogonal(mass: Array, partial: Mask) -> tuple[Array, Array]:
    r"""Return the dual functions of facets, and their integrals with the positive shape functions.

    Both are NaN for facets whose shape functions are linearly dependent to machine precision.

    Parameters
    ----------
    mass : ndarray (n_facets, k, k)
        Integrals of products of the positive shape functions [area].
    partial : ndarray of bool (n_facets, k)
        Functions that have a dual function; the dual functions of the others are zero.

    Returns
    -------
    dual : ndarray (n_facets, k, k)
        Coefficients of the dual functions, :math:`\psi_j = \sum_k dual_{jk} \tilde N_k` [-]. The dual functions sum to one.
    D : ndarray (n_facets, k, k)
        Integrals :math:`\int \psi_j \tilde N_k` [area]; diagonal among the functions that have a dual function.
    """
    k = mass.shape[1]
    rest = partial.sum(axis=1)[:, None, None]
    # Functions that are left out are added in equal parts to the others, so that these still sum to one.
    spanning = np.eye(k) * partial[:, :, None] + partial[:, :, None] * ~partial[:, None, :] / np.maximum(rest, 1)
    G = np.where(partial[:, :, None] & partial[:, None, :], spanning @ mass, np.eye(k))
    weight = np.where(partial, mass.sum(axis=2), 0.0)
    # Rows and columns are scaled before the inversion, because the weights of cut facets may differ by orders of magnitude.
    scale = 1.0 / np.sqrt(np.einsum("fkk->fk", G))
    scaled = G * scale[:, :, None] * scale[:, None, :]
    regular: Mask = np.not_equal(np.linalg.det(scaled), 0.0)
    scaled[~regular] = np.eye(k)
    inverse = np.linalg.inv(scaled) * scale[:, :, None] * scale[:, None, :]
    inverse[~regular] = np.nan
    dual = weight[:, :, None] * inverse @ spanning
    D = np.where(partial[:, None, :], weight[:, :, None] * np.eye(k), dual @ mass)
    return dual, D * partial[:, :, None]
