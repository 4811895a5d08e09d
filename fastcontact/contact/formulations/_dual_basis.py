r"""Dual shape functions: biorthogonal to the displacement shape functions on each facet.

For positive shape functions :math:`\tilde N` of a facet that sum to one, the dual functions

.. math:: \psi = \mathrm{diag}(w) M^{-1} \tilde N, \quad w = \int \tilde N, \quad M = \int \tilde N \tilde N^T

obey :math:`\int \psi_j \tilde N_k = w_j \delta_{jk}` and sum to one (Wohlmuth, 2000). The integrals run over that part
of the facet which faces the other side, so both properties hold there (Cichosz and Bischoff, 2011; Popp, Seitz, Gee and
Wall, 2013). Where the covered part of a function nearly vanishes, M is nearly singular: that function is left out, and the
others sum to one without it.

The corner functions of quadratic facets are not positive. Multiples of the mid-node functions are added to them (Popp,
Wohlmuth, Gee and Wall, 2012), large enough for positivity everywhere, so that no part of a facet, however it is cut, has
negative weight: on lines, triangles and nine-node quadrangles this gives the Bernstein polynomials. The coefficient of a
corner function is the displacement of the corner; that of a mid node also involves the displacements of its edge's ends.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from fastcontact.arrays import Array, Mask
from fastcontact.mesh import elements
from fastcontact.round_off import LENGTH_ROUND_OFF, TINY

# Fraction of a mid node's function added to either end of its edge: with 1/4, parabolas become Bernstein polynomials; without
# a centre node, 3/8 is the smallest for which (a + b) / 4 + 1 / 2, a and b in [-1, 1], has no negative part.
SHARE, SHARE_WITHOUT_CENTRE = 0.25, 0.375
# A function of which less than this fraction of its weight faces the other side has no dual function.
COVERED = 0.02
# Fractions above this multiple of the largest one count as equal to it: on curved facets they differ by a few percent.
EQUAL = 0.9
# Dual functions of whole facets have root mean squares up to 2.4 (nine nodes); beyond the first number, and where their
# integral falls below the second fraction of their weight, they extrapolate more than they test.
MOST, LEAST = 20.0, 0.2


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
    """Return the end nodes of the edge of each mid node."""
    return ((0, 1),) if element.dim == 1 else element.edges


def _bernstein_square(element: elements.Element) -> Array:
    """Return T of nine-node quadrangles: the product of two lines."""
    line = elements.get("line3")
    index = {-1.0: 0, 1.0: 1, 0.0: 2}
    at = np.array([[index[float(c)] for c in node] for node in element.nodes])
    T = positive(line.name)
    return T[np.ix_(at[:, 0], at[:, 0])] * T[np.ix_(at[:, 1], at[:, 1])]


def dual_functions(mass: Array, kept: Mask, fraction: Array) -> tuple[Array, Array]:
    r"""Return the dual functions of facets of which an arbitrary part faces the other side.

    Parameters
    ----------
    mass : ndarray (n_facets, k, k)
        Integrals of products of positive shape functions that sum to one, over that part [area].
    kept : ndarray of bool (n_facets, k)
        Functions that may take part.
    fraction : ndarray (n_facets, k)
        Weight of each function over that part, relative to its weight over the whole facet.

    Returns
    -------
    dual, D
        As by `biorthogonal`, for all functions kept where these are well conditioned. On a narrow strip functions of nearly
        vanishing fraction are left out, and if that is not sufficient all but those of the largest, or the first of these.
    """
    partial = kept & (fraction > 0.0)
    dual, D = biorthogonal(mass, partial)
    share = np.where(partial, fraction, -1.0)
    # All of nearly equal fraction, or the first of them: the choice must not change as facets deform.
    large = share >= EQUAL * share.max(axis=1, keepdims=True)
    largest = np.argmax(large, axis=1)[:, None] == np.arange(partial.shape[1])
    for fewer in (partial & (fraction > COVERED), partial & large, partial & largest):
        wild = np.flatnonzero(~_tame(dual, mass, partial))
        if not len(wild):
            break
        partial[wild] = np.where(np.any(fewer[wild], axis=1, keepdims=True), fewer[wild], partial[wild])
        dual[wild], D[wild] = biorthogonal(mass[wild], partial[wild])
    return dual, D


def _tame(dual: Array, mass: Array, partial: Mask) -> Mask:
    """Return for which facets (n_facets,) the dual functions are bounded and positive on average."""
    area = np.maximum(mass.sum(axis=(1, 2)), TINY)
    weight = mass.sum(axis=2)
    with np.errstate(invalid="ignore", over="ignore"):
        size = np.sqrt(np.einsum("fab,fbc,fac->fa", dual, mass, dual) / area[:, None]).max(axis=1)
        off = np.abs(dual.sum(axis=1) - 1.0).max(axis=1)  # the shape functions sum to one with no other coefficients
        share = np.where(partial, np.einsum("fab,fb->fa", dual, weight) - LEAST * weight, 0.0).min(axis=1)
    return ((size <= MOST) & (off <= LENGTH_ROUND_OFF) & (share >= 0.0)) | ~partial.any(axis=1)


def biorthogonal(mass: Array, partial: Mask) -> tuple[Array, Array]:
    r"""Return the dual functions of facets, and their integrals with the positive shape functions.

    Parameters
    ----------
    mass : ndarray (n_facets, k, k)
        Integrals of products of positive shape functions that sum to one [area].
    partial : ndarray of bool (n_facets, k)
        Functions that take part; the dual functions of the others are zero.

    Returns
    -------
    dual : ndarray (n_facets, k, k)
        Coefficients, :math:`\psi_j = \sum_k dual_{jk} \tilde N_k`; the sum over those that take part is one.
    D : ndarray (n_facets, k, k)
        :math:`\int \psi_j \tilde N_k` [area]; diagonal among those that take part.

    Where the functions are linearly dependent to the last digit, both are NaN.
    """
    k = mass.shape[1]
    rest = partial.sum(axis=1)[:, None, None]
    # Functions left out are distributed evenly over the others, so that these still sum to one.
    spanning = np.eye(k) * partial[:, :, None] + partial[:, :, None] * ~partial[:, None, :] / np.maximum(rest, 1)
    G = np.where(partial[:, :, None] & partial[:, None, :], spanning @ mass, np.eye(k))
    weight = np.where(partial, mass.sum(axis=2), 0.0)
    # Rows and columns are scaled before the inversion: weights of cut facets may differ by orders.
    scale = 1.0 / np.sqrt(np.einsum("fkk->fk", G))
    scaled = G * scale[:, :, None] * scale[:, None, :]
    regular: Mask = np.not_equal(np.linalg.det(scaled), 0.0)
    scaled[~regular] = np.eye(k)
    inverse = np.linalg.inv(scaled) * scale[:, :, None] * scale[:, None, :]
    inverse[~regular] = np.nan
    dual = weight[:, :, None] * inverse @ spanning
    D = np.where(partial[:, None, :], weight[:, :, None] * np.eye(k), dual @ mass)
    return dual, D * partial[:, :, None]
