# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Kernels for facets in 3D: normals, angles, and projection along normals that are interpolated between nodes.

Positions and normals of a facet are polynomials of its reference coordinates, with coefficients (n_facets, m, 3) of the terms
in `search.facet_tables`; facets with fewer than m nodes have zeros at the end.
"""

import numpy as np

from fastcontact._jit.decorators import innermost_kernel, interpretable_kernel, kernel
from fastcontact.contact.search.limits import LARGEST_OVERHANG, MAX_ITERATIONS, ROUND_OFF_STEP, STEP
from fastcontact.contact.search.projection_3d_kernels import component, vector
from fastcontact.contact.search.straight_3d_kernels import cross, dot, minus, plus_multiple, unit
from fastcontact.round_off import LENGTH_ROUND_OFF, ROUND_OFF


@interpretable_kernel
def normals(nodes, slopes, begin, end, out):
    """Fill the unit normals (n, m, 3) of facets `begin` to ``end - 1`` with nodes (n, m, 3) at their own nodes.

    `slopes` (m, m, 2) are the derivatives of the shape functions at the nodes.
    """
    m = nodes.shape[1]
    for f in range(begin, end):
        for a in range(m):
            ps, qs, rs, pt, qt, rt = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            for k in range(m):
                p, q, r = nodes[f, k, 0], nodes[f, k, 1], nodes[f, k, 2]
                s, t = slopes[a, k, 0], slopes[a, k, 1]
                ps, qs, rs = ps + s * p, qs + s * q, rs + s * r
                pt, qt, rt = pt + t * p, qt + t * q, rt + t * r
            out[f, a, 0], out[f, a, 1], out[f, a, 2] = unit(cross((ps, qs, rs), (pt, qt, rt)))


@kernel
def angles(nodes, n_corners, out):
    """Fill the angles (n, m) of facets with nodes (n, m, 3) at their first `n_corners` nodes, and 1 at other nodes."""
    for f in range(nodes.shape[0]):
        for a in range(nodes.shape[1]):
            out[f, a] = 1.0
        for a in range(n_corners):
            corner, following, preceding = vector(nodes, f, a), (a + 1) % n_corners, (a - 1) % n_corners
            p, q = minus(vector(nodes, f, following), corner), minus(vector(nodes, f, preceding), corner)
            product = cross(p, q)
            out[f, a] = np.arctan2(np.sqrt(dot(product, product)), dot(p, q))


@interpretable_kernel
def coefficients(values, to_terms, first, begin, end, out):
    """Fill rows ``first + begin`` to ``first + end - 1`` of `out` (n_facets, width, 3) with polynomial coefficients.

    They interpolate the `values` (n, m, 3) at the nodes of the facets `begin` to ``end - 1``. `to_terms` (m, m) are those of
    `facet_tables.Tables`.
    """
    m = values.shape[1]
    for f in range(begin, end):
        for k in range(out.shape[1]):
            p, q, r = 0.0, 0.0, 0.0
            for a in range(m if k < m else 0):
                weight = to_terms[k, a]
                p, q, r = p + weight * values[f, a, 0], q + weight * values[f, a, 1], r + weight * values[f, a, 2]
            out[first + f, k, 0], out[first + f, k, 1], out[first + f, k, 2] = p, q, r


@innermost_kernel
def _interpolated(polynomials, f, s, t):
    """Return the values at (s, t) of the `polynomials` of facet `f`, and their derivatives."""
    x, xs, xt, _, _, _ = component(polynomials, f, 0, s, t)
    y, ys, yt, _, _, _ = component(polynomials, f, 1, s, t)
    z, zs, zt, _, _, _ = component(polynomials, f, 2, s, t)
    return (x, y, z), (xs, ys, zs), (xt, yt, zt)


@innermost_kernel
def _newton(point, positions, directions, f, s, t, height):
    """Return the solution (s, t) of ``X(s, t) + height n(s, t) = point`` on the extended facet `f`, and whether it converged.

    X is the position and n the interpolated normal, with the coefficients `positions` and `directions`, see `along_normals`.
    The arguments (s, t) and `height` are the initial guess.
    """
    step = np.inf
    for _ in range(MAX_ITERATIONS):
        foot, along_s, along_t = _interpolated(positions, f, s, t)
        normal, turn_s, turn_t = _interpolated(directions, f, s, t)
        residual = minus(point, plus_multiple(foot, normal, height))
        p, q = plus_multiple(along_s, turn_s, height), plus_multiple(along_t, turn_t, height)
        product = cross(q, normal)
        volume = dot(p, product)
        # The columns of the Jacobian are linearly dependent if the volume that they span is negligible.
        if not abs(volume) > LENGTH_ROUND_OFF * np.sqrt(dot(p, p) * dot(q, q) * dot(normal, normal)):
            return s, t, False
        ds, dt = dot(residual, product) / volume, dot(residual, cross(normal, p)) / volume
        dh, size = dot(residual, cross(p, q)) / volume, max(abs(ds), abs(dt))
        # Far from the solution, a full step may leave the region where the interpolated normals are meaningful.
        damping = 1.0 if size <= 1.0 else 1.0 / size
        s, t, height = s + damping * ds, t + damping * dt, height + damping * dh
        step = damping * size / (1.0 + max(abs(s), abs(t)))
        if step <= STEP:
            return s, t, True
    return s, t, step <= ROUND_OFF_STEP


@innermost_kernel
def overhang_of(triangle, s, t):
    """Return how far reference coordinates lie outside a facet, a `triangle` or a quadrangle, in facet lengths; 0 inside."""
    outside = max(-s, -t, s + t - 1.0) if triangle else 0.5 * (max(abs(s), abs(t)) - 1.0)
    return max(outside, 0.0)


@innermost_kernel
def clamped(triangle, s, t):
    """Return reference coordinates moved into a `triangle` or quadrangle, independently of the choice of a first corner."""
    if triangle:
        a, b, c = max(s, 0.0), max(t, 0.0), max(1.0 - s - t, 0.0)
        total = a + b + c if min(s, t, 1.0 - s - t) < 0.0 else 1.0
        return a / total, b / total
    return min(max(s, -1.0), 1.0), min(max(t, -1.0), 1.0)


@innermost_kernel
def _distance_beyond(positions, triangle, f, s, t, length):
    """Return the distance, divided by `length`, between facet `f` and a projection (s, t) onto the extended facet.

    Neighbours are compared by this distance, because overhangs depend on the shapes of facets. If two facets are closest at a
    common node, a small fraction of the sum of all overhangs decides.
    """
    if triangle:
        total = max(-s, 0.0) + max(-t, 0.0) + max(s + t - 1.0, 0.0)
    else:
        total = 0.5 * (max(abs(s) - 1.0, 0.0) + max(abs(t) - 1.0, 0.0))
    a, b = clamped(triangle, s, t)
    offset = minus(_interpolated(positions, f, s, t)[0], _interpolated(positions, f, a, b)[0])
    return np.sqrt(dot(offset, offset)) / length + 1e-3 * total


@innermost_kernel
def _closest_neighbour(point, positions, directions, triangular, neighbours, f, height, length):
    """Return the neighbour of facet `f` with the smallest `_distance_beyond`, (s, t) of the projection, and this distance.

    The distance is infinite if no projection converges. For the arguments, see `along_normals` and `_distance_beyond`.
    """
    start, numbers = neighbours
    best, best_s, best_t, least = f, 0.0, 0.0, np.inf
    for k in range(start[f], start[f + 1]):
        g = numbers[k]
        middle = 1.0 / 3.0 if triangular[g] else 0.0
        s, t, converged = _newton(point, positions, directions, g, middle, middle, height)
        distance = _distance_beyond(positions, triangular[g], g, s, t, length) if converged else np.inf
        # Of equally close facets, the first one is chosen.
        if converged and max(distance, LENGTH_ROUND_OFF) < max(least, LENGTH_ROUND_OFF) - ROUND_OFF:
            best, best_s, best_t, least = g, s, t, distance
    return best, best_s, best_t, least


@interpretable_kernel
def along_normals(begin, end, points, heights, positions, directions, triangular, neighbours, projection):
    """Project points `begin` to ``end - 1`` along interpolated normals; see `projection.along_normals`.

    Parameters
    ----------
    begin, end : int
    points : ndarray (n, 3)
        Positions [length].
    heights : ndarray (n,)
        Heights of the points over their closest points [length].
    positions, directions : ndarray (n_facets, m, 3)
        Coefficients of positions [length] and of normals [-].
    triangular : ndarray of bool (n_facets,)
        Whether each facet is a triangle.
    neighbours : (ndarray of int (n_facets + 1,), ndarray of int)
        Offsets and numbers of the facets that share a node with each facet, see `Surface.neighbours`.
    projection : tuple of ndarray
        The facet (n,), xi (n, 2) and overhang (n,) of the closest points [-], changed in place, and an array (n, 3) that is
        filled with unit normals.
    """
    facet, xi, overhang, normal = projection
    for i in range(begin, end):
        point, f = (points[i, 0], points[i, 1], points[i, 2]), facet[i]
        s, t, outside = xi[i, 0], xi[i, 1], overhang[i]
        a, b, converged = _newton(point, positions, directions, f, s, t, heights[i])
        new_overhang = overhang_of(triangular[f], a, b)
        if converged and new_overhang <= LARGEST_OVERHANG:
            s, t, outside = a, b, new_overhang
            if new_overhang > LENGTH_ROUND_OFF:
                edge = _interpolated(positions, f, s, t)[1]
                length = np.sqrt(dot(edge, edge))
                next_facet, a, b, distance = _closest_neighbour(
                    point, positions, directions, triangular, neighbours, f, heights[i], length
                )
                if distance < _distance_beyond(positions, triangular[f], f, s, t, length):
                    f, s, t, outside = next_facet, a, b, overhang_of(triangular[next_facet], a, b)
        s, t = clamped(triangular[f], s, t)
        facet[i], xi[i, 0], xi[i, 1], overhang[i] = f, s, t, outside if outside > LENGTH_ROUND_OFF else 0.0
        normal[i, 0], normal[i, 1], normal[i, 2] = unit(_interpolated(directions, f, s, t)[0])
