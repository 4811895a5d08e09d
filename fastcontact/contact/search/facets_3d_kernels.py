# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Preparation of facets in 3D for a search: polynomials, boxes, and curvature bounds (see `projection_3d_kernels`)."""

import numpy as np

from fastcontact._jit.decorators import inlined_kernel, interpretable_kernel, kernel
from fastcontact.contact.search.projection_3d_kernels import vector
from fastcontact.contact.search.straight_3d_kernels import dot, uniqueness_bound
from fastcontact.round_off import LENGTH_ROUND_OFF


@interpretable_kernel
def prepare(facets, begin, end, to_terms, weights, low, high):
    """Fill the coefficients and bounds of the facets `begin` to ``end - 1``, and their boxes `low`, `high` (n_facets, 3).

    The boxes contain the nodes, extended at curved sides by the bound on the deviation of the facet from flat triangles.
    `to_terms` and `weights` are those of `facet_tables.Tables`.
    """
    nodes, centre, C, deviations, bounds = facets
    m = nodes.shape[1]
    for i in range(begin, end):
        for d in range(3):
            if m <= 4:
                _fill_straight(nodes, centre, i, d, C, low, high)
            else:
                _fill_curved(nodes, centre, i, d, to_terms, C, low, high)
        deviations[i], bounds[i] = 0.0, np.inf
        if m == 3:
            continue
        deviation, turn, second = _curvature(C, i, weights)
        for d in range(3 if m > 4 else 0):
            low[i, d], high[i, d] = low[i, d] - deviation, high[i, d] + deviation
        extent = high[i, 0] - low[i, 0], high[i, 1] - low[i, 1], high[i, 2] - low[i, 2]
        if deviation >= LENGTH_ROUND_OFF * max(extent):  # otherwise the facet is flat
            deviations[i] = deviation
        p, q = vector(C, i, 1), vector(C, i, 2)
        diagonal = np.sqrt(dot(extent, extent))
        bounds[i] = uniqueness_bound(p, q, vector(C, i, 3)) if m == 4 else _convexity(p, q, turn, second, diagonal)


@inlined_kernel
def _fill_straight(nodes, centre, i, d, coefficients, low, high):
    """Fill the coefficients and the box of a facet of 3 or 4 nodes, in one coordinate.

    The sums are symmetric, so that round-off does not depend on which node of the facet is the first.
    """
    p, q, r = nodes[i, 0, d] - centre[d], nodes[i, 1, d] - centre[d], nodes[i, 2, d] - centre[d]
    low[i, d], high[i, d] = min(p, q, r), max(p, q, r)
    if nodes.shape[1] == 3:
        coefficients[i, 0, d], coefficients[i, 1, d], coefficients[i, 2, d] = p, q - p, r - p
    else:
        s = nodes[i, 3, d] - centre[d]
        coefficients[i, 0, d], coefficients[i, 1, d] = 0.25 * ((p + r) + (q + s)), 0.25 * ((q - p) + (r - s))
        coefficients[i, 2, d], coefficients[i, 3, d] = 0.25 * ((r - q) + (s - p)), 0.25 * ((p - q) + (r - s))
        low[i, d], high[i, d] = min(low[i, d], s), max(high[i, d], s)


@inlined_kernel
def _fill_curved(nodes, centre, i, d, to_terms, coefficients, low, high):
    """Fill the coefficients of a facet with curved sides and the box of its nodes, in one coordinate."""
    low[i, d], high[i, d] = np.inf, -np.inf
    for k in range(to_terms.shape[0]):
        value = 0.0
        for a in range(nodes.shape[1]):
            value += to_terms[k, a] * (nodes[i, a, d] - centre[d])
        coefficients[i, k, d], x = value, nodes[i, k, d] - centre[d]
        low[i, d], high[i, d] = min(low[i, d], x), max(high[i, d], x)


@inlined_kernel
def _curvature(coefficients, i, weights):
    """Return bounds on a facet's deviation from flat triangles, the change of its tangents, and its second derivative."""
    deviation, turn, second = 0.0, 0.0, 0.0
    for k in range(3, coefficients.shape[1]):
        term = vector(coefficients, i, k)
        length = np.sqrt(dot(term, term))
        deviation += length * weights[0, k]
        turn += length * weights[1, k]
        second += length * weights[2, k]
    return deviation, turn, second


@kernel
def _convexity(p, q, turn, second, diagonal):
    """Return the squared distance from a facet, with tangents p and q, up to which its minimum on the facet is unique.

    The Hessian of half the squared distance is J^T J - r . X'' with the tangents J. It is positive definite where the
    smallest singular value of J, squared, exceeds r |X''|, with r the distance to the farthest point of the facet. `turn` and
    `second` are results of `_curvature`, and `diagonal` is that of the box of the facet [length].
    """
    pp, pq, qq = dot(p, p), dot(p, q), dot(q, q)
    least = np.sqrt(max(0.5 * (pp + qq) - np.sqrt(0.25 * ((pp - qq) * (pp - qq)) + pq * pq), 0.0)) - turn
    if not least > 0.0:
        return 0.0
    if second == 0.0:
        return np.inf
    distance = max(least * least / second - diagonal, 0.0)
    return distance * distance
