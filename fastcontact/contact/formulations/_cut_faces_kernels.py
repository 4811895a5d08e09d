# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Polygon clipping of facets in 3D, in the plane of the secondary facet, and integration over the clipped polygon.

A facet is a polynomial of its reference coordinates, with coefficients (n_terms, 3) of the terms in
`contact.search.facet_tables`. In kernels, ``terms`` (n_terms, 3) contains the values of these terms at a point, and their
derivatives. The polygon of the corners of a facet is clipped in a plane with the ``axes`` (3, 3): two tangents and the unit
normal.
"""

import numpy as np

from fastcontact._jit.decorators import inlined_kernel, innermost_kernel, interpretable_kernel, kernel
from fastcontact.contact.search.box_tree_kernels import DEPTH
from fastcontact.contact.search.limits import MAX_ITERATIONS
from fastcontact.round_off import LENGTH_ROUND_OFF, ROUND_OFF


@interpretable_kernel
def planes(corners, n_corners, origin, axes):
    """Fill `origin` (n, 3) with the centres of polygons (n, k, 3), and `axes` (n, 3, 3) with two tangents and the normal."""
    for i in range(corners.shape[0]):
        _plane(corners[i], n_corners, origin[i], axes[i])


# This function is inlined. If it were a separate kernel, the process that compiles it and later processes that load it from
# the cache would run different copies, in which products and sums may be fused differently. Tangents that differ in the
# last bit would change all contact results.
@innermost_kernel
def _plane(corners, count, origin, axes):
    origin[:] = 0.0
    for k in range(count):
        for d in range(3):
            origin[d] += corners[k, d] / count
    normal = axes[2]
    normal[:] = 0.0
    for k in range(count):  # area vector (Newell), valid for warped facets too
        m = (k + 1) % count
        for d in range(3):
            e, f = (d + 1) % 3, (d + 2) % 3
            normal[d] += (corners[k, e] - origin[e]) * (corners[m, f] - origin[f])
            normal[d] -= (corners[k, f] - origin[f]) * (corners[m, e] - origin[e])
    length = np.sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2])
    for d in range(3):
        normal[d] /= length
        axes[0, d] = corners[0, d] - origin[d]
    along = axes[0, 0] * normal[0] + axes[0, 1] * normal[1] + axes[0, 2] * normal[2]
    for d in range(3):
        axes[0, d] -= along * normal[d]
    size = np.sqrt(axes[0, 0] * axes[0, 0] + axes[0, 1] * axes[0, 1] + axes[0, 2] * axes[0, 2])
    for d in range(3):
        axes[0, d] /= size
    for d in range(3):
        e, f = (d + 1) % 3, (d + 2) % 3
        axes[1, d] = normal[e] * axes[0, f] - normal[f] * axes[0, e]


@kernel
def _flatten(points, count, n_positions, origin, axes, flat):
    """Fill `flat` (count, 2) with `points` in plane coordinates: the first `n_positions` are positions, the rest vectors."""
    for k in range(count):
        for a in range(2):
            flat[k, a] = 0.0
            for d in range(3):
                shift = origin[d] if k < n_positions else 0.0
                flat[k, a] += (points[k, d] - shift) * axes[a, d]


@kernel
def _area(flat, count):
    """Return the signed area of the polygon `flat` (count, 2), positive if its corners are in counter-clockwise order."""
    area = 0.0
    for k in range(count):
        m = (k + 1) % count
        area += 0.5 * (flat[k, 0] * flat[m, 1] - flat[m, 0] * flat[k, 1])
    return area


@kernel
def _centroid(flat, count):
    """Return the centre of area of the polygon `flat` (count, 2)."""
    x, y, twice_area = 0.0, 0.0, 0.0
    for k in range(1, count - 1):
        ux, uy = flat[k, 0] - flat[0, 0], flat[k, 1] - flat[0, 1]
        vx, vy = flat[k + 1, 0] - flat[0, 0], flat[k + 1, 1] - flat[0, 1]
        area = ux * vy - uy * vx
        x += area * (ux + vx) / 3.0
        y += area * (uy + vy) / 3.0
        twice_area += area
    return flat[0, 0] + x / twice_area, flat[0, 1] + y / twice_area


@kernel
def _clip(subject, count, window, n_window, spare, tolerance):
    """Clip `subject` in place by a convex, counter-clockwise `window` (Sutherland and Hodgman); return its number of corners.

    A corner is taken to lie on a side of the window if the parallelogram that they span has at most the area `tolerance`.
    Otherwise, nearly coincident sides would intersect at points that depend on round-off. `spare` is overwritten.
    """
    for w in range(n_window):
        ax, ay = window[w, 0], window[w, 1]
        bx, by = window[(w + 1) % n_window, 0], window[(w + 1) % n_window, 1]
        n_kept = 0
        for k in range(count):
            m = (k + 1) % count
            this_side = (bx - ax) * (subject[k, 1] - ay) - (by - ay) * (subject[k, 0] - ax)
            next_side = (bx - ax) * (subject[m, 1] - ay) - (by - ay) * (subject[m, 0] - ax)
            this_side = this_side if abs(this_side) > tolerance else 0.0
            next_side = next_side if abs(next_side) > tolerance else 0.0
            if this_side >= 0.0:
                spare[n_kept, 0], spare[n_kept, 1] = subject[k, 0], subject[k, 1]
                n_kept += 1
            if (this_side > 0.0 and next_side < 0.0) or (this_side < 0.0 and next_side > 0.0):
                t = this_side / (this_side - next_side)
                spare[n_kept, 0] = subject[k, 0] + t * (subject[m, 0] - subject[k, 0])
                spare[n_kept, 1] = subject[k, 1] + t * (subject[m, 1] - subject[k, 1])
                n_kept += 1
        count = n_kept
        for k in range(count):
            subject[k, 0], subject[k, 1] = spare[k, 0], spare[k, 1]
        if count < 3:
            return 0
    return count


@kernel
def _overlap(corners, count, other_corners, n_other, origin, axes, subject, window, spare):
    """Fill `subject` with the overlap of two polygons in the plane at `origin` with `axes`; return its number of corners.

    The number is 0 if they do not overlap. `window` and `spare` are overwritten.
    """
    _flatten(corners, count, count, origin, axes, subject)
    tolerance = ROUND_OFF * _area(subject, count)
    _flatten(other_corners, n_other, n_other, origin, axes, spare)
    for k in range(n_other):  # facets that face each other have opposite orientations
        window[k, 0], window[k, 1] = spare[n_other - 1 - k, 0], spare[n_other - 1 - k, 1]
    count = _clip(subject, count, window, n_other, spare, tolerance)
    if count < 3 or _area(subject, count) <= tolerance:
        return 0
    return count


@kernel
def _may_intersect(low, high, origin, normal, radius, reach):
    """Return whether the box from `low` to `high` may intersect a cylinder with the given `radius` and the length 2 `reach`.

    The axis of the cylinder is the `normal` through its centre `origin`. The result is False for an empty box.
    """
    if low[0] > high[0]:
        return False
    squared_distance, along, half_diagonal = 0.0, 0.0, 0.0
    for d in range(3):
        offset = 0.5 * (low[d] + high[d]) - origin[d]
        along += offset * normal[d]
        squared_distance += offset * offset
        half_diagonal += 0.25 * ((high[d] - low[d]) * (high[d] - low[d]))
    half_diagonal = np.sqrt(half_diagonal)
    largest = radius + half_diagonal
    return abs(along) <= reach + half_diagonal and squared_distance - along * along <= largest * largest


@interpretable_kernel
def facing_pairs(
    secondary, n_secondary, origin, axes, radius, reach, primary, n_primary, other_normal, numbers, tree,
    max_cosine, pairs,
):  # fmt: skip
    """Find the primary polygons that lie above or below each secondary polygon and face it.

    Parameters
    ----------
    secondary, primary : (n_facets, k, 3)
        Corners [length].
    n_secondary, n_primary : int
        Number of corners.
    origin, axes : (n_facets, 3), (n_facets, 3, 3)
        Planes of the secondary facets.
    radius, reach : (n_facets,)
        Radii of the secondary facets around their centres, and largest distances of primary facets along normals [length].
    other_normal : (n_facets, 3)
        Unit normals of the primary facets.
    numbers, tree : (n_facets,), Tree
        The primary facets in the order of their tree.
    max_cosine : float
        Largest cosine of the angle between the normals of facets that face each other, e.g. -0.1.
    pairs : (capacity, 2)
        Filled with the numbers of the secondary and the primary facet, in ascending order of the secondary facets.

    Returns
    -------
    int
        Number of pairs; if it exceeds the capacity of `pairs`, only the first ones are filled.
    """
    capacity = n_secondary + 2 * n_primary  # each side of the window adds at most two corners
    subject, window, spare = np.empty((capacity, 2)), np.empty((capacity, 2)), np.empty((capacity, 2))
    stack, n_leaves, count = np.empty(DEPTH, np.int64), len(tree.low) // 2, 0
    for s in range(secondary.shape[0]):
        normal = axes[s, 2]
        stack[0], top = 1, 1
        while top > 0:
            top -= 1
            box = stack[top]
            if not _may_intersect(tree.low[box], tree.high[box], origin[s], normal, radius[s], reach[s]):
                continue
            if box < n_leaves:
                stack[top], stack[top + 1] = 2 * box, 2 * box + 1
                top += 2
                continue
            p = numbers[box - n_leaves]
            cosine = normal[0] * other_normal[p, 0] + normal[1] * other_normal[p, 1] + normal[2] * other_normal[p, 2]
            if cosine <= max_cosine and _overlap(
                secondary[s], n_secondary, primary[p], n_primary, origin[s], axes[s], subject, window, spare
            ):
                if count < pairs.shape[0]:
                    pairs[count, 0], pairs[count, 1] = s, p
                count += 1
    return count


@innermost_kernel
def _fill_terms(n_terms, s, t, terms):
    """Fill `terms` (n_terms, 3) with the terms of a facet's polynomial and their derivatives."""
    terms[0, 0], terms[0, 1], terms[0, 2] = 1.0, 0.0, 0.0
    terms[1, 0], terms[1, 1], terms[1, 2] = s, 1.0, 0.0
    terms[2, 0], terms[2, 1], terms[2, 2] = t, 0.0, 1.0
    if n_terms > 3:
        terms[3, 0], terms[3, 1], terms[3, 2] = s * t, t, s
    if n_terms > 5:
        terms[4, 0], terms[4, 1], terms[4, 2] = s * s, 2.0 * s, 0.0
        terms[5, 0], terms[5, 1], terms[5, 2] = t * t, 0.0, 2.0 * t
    if n_terms > 7:
        terms[6, 0], terms[6, 1], terms[6, 2] = s * s * t, 2.0 * s * t, s * s
        terms[7, 0], terms[7, 1], terms[7, 2] = s * t * t, t * t, 2.0 * s * t
    if n_terms > 8:
        terms[8, 0], terms[8, 1], terms[8, 2] = s * s * t * t, 2.0 * s * t * t, 2.0 * s * s * t


@innermost_kernel
def _locate(flat, x, y, xi, terms):
    """Move `xi` (2,) to the point of a facet above (x, y), and fill `terms` at this point.

    `flat` (n_terms, 2) are the coefficients of the projected facet. Returns its area per unit of xi, or zero if there is no
    point above (x, y).
    """
    n_terms = flat.shape[0]
    for _ in range(MAX_ITERATIONS):
        _fill_terms(n_terms, xi[0], xi[1], terms)
        residual_x, residual_y = x, y
        a, b, c, d = 0.0, 0.0, 0.0, 0.0
        for k in range(n_terms):
            residual_x -= flat[k, 0] * terms[k, 0]
            residual_y -= flat[k, 1] * terms[k, 0]
            a += flat[k, 0] * terms[k, 1]
            b += flat[k, 0] * terms[k, 2]
            c += flat[k, 1] * terms[k, 1]
            d += flat[k, 1] * terms[k, 2]
        area = a * d - b * c
        if area == 0.0:
            return 0.0
        step_s, step_t = (d * residual_x - b * residual_y) / area, (a * residual_y - c * residual_x) / area
        xi[0] += step_s
        xi[1] += step_t
        if n_terms == 3 or (abs(step_s) < LENGTH_ROUND_OFF and abs(step_t) < LENGTH_ROUND_OFF):
            _fill_terms(n_terms, xi[0], xi[1], terms)
            return abs(area)
    return 0.0


@innermost_kernel
def _area_density(facet, terms):
    """Return the area of a facet per unit of the reference coordinates, at the point at which `terms` are evaluated."""
    area = 0.0
    for d in range(3):
        e, f = (d + 1) % 3, (d + 2) % 3
        se, sf, te, tf = 0.0, 0.0, 0.0, 0.0
        for k in range(facet.shape[0]):
            se += facet[k, e] * terms[k, 1]
            sf += facet[k, f] * terms[k, 1]
            te += facet[k, e] * terms[k, 2]
            tf += facet[k, f] * terms[k, 2]
        normal = se * tf - sf * te
        area += normal * normal
    return np.sqrt(area)


@innermost_kernel
def _fill_shape(to_terms, terms, shape):
    """Fill `shape` (n_nodes,) with the shape functions at the point at which `terms` are evaluated."""
    for k in range(shape.shape[0]):
        shape[k] = 0.0
    for j in range(shape.shape[0]):
        for k in range(shape.shape[0]):
            shape[k] += terms[j, 0] * to_terms[j, k]


@inlined_kernel
def _add_products(area, shape, other_shape, mass, coupling, i):
    """Add products of shape functions, times an `area`, to the lower triangle of ``mass[i]`` and to ``coupling[i]``."""
    for a in range(shape.shape[0]):
        for b in range(a + 1):
            mass[i, a, b] += area * shape[a] * shape[b]
        for b in range(other_shape.shape[0]):
            coupling[i, a, b] += area * shape[a] * other_shape[b]


@innermost_kernel
def _height(coefficients, xi):
    """Return the value at `xi` (2,) of a polynomial with coefficients (k, k) of the powers of both reference coordinates."""
    height = 0.0
    for i in range(coefficients.shape[0] - 1, -1, -1):
        row = 0.0
        for j in range(coefficients.shape[1] - 1, -1, -1):
            row = row * xi[1] + coefficients[i, j]
        height = height * xi[0] + row
    return height


@kernel
def _symmetrise(mass):
    """Copy the lower triangles of matrices (n, m, m) to the upper ones."""
    for s in range(mass.shape[0]):
        for a in range(mass.shape[1]):
            for b in range(a):
                mass[s, b, a] = mass[s, a, b]


@interpretable_kernel
def integrate(
    low, high, start, secondary, n_secondary, origin, axes, deformed, reference, to_terms, middle,
    primary, n_primary, other_deformed, other_to_terms, other_middle, pairs, points, weights, heights, other_heights,
    factor, mass, coupling, gap_reduction, folded,
):  # fmt: skip
    """Integrate products of shape functions over the segments of the secondary facets `low` to ``high - 1``.

    Both facets are projected along the normal of the secondary polygon. Areas are those of the reference surface. The
    quadrature is exact between flat triangles. Segments of other facets are divided into triangles around their centroids, so
    that the quadrature error does not depend on the choice of a first corner, and does not jump where corners appear or
    vanish.

    Parameters
    ----------
    low, high : int
    start : (n_facets + 1,)
        First pair of each secondary facet.
    secondary, n_secondary, origin, axes, primary, n_primary
        Polygons and planes, as for `facing_pairs`.
    deformed, reference : (n_facets, n_terms, 3)
        Coefficients of the secondary facets in both configurations [length].
    to_terms : (n_terms, n_nodes)
        Matrix from nodal values to coefficients.
    middle : (2,)
        Initial guess of reference coordinates.
    other_deformed, other_to_terms, other_middle
        The same for the primary facets.
    pairs : (n_pairs, 2)
        Result of `facing_pairs`, in ascending order.
    points, weights : (n_q, 2), (n_q,)
        Quadrature rule on the triangle.
    heights, other_heights : (n_facets, k, k)
        Coefficients of the heights of the smooth surfaces of both sides; k is 0 without smoothing [length].
    factor : (n_pairs, 2)
        Factors of the heights of both sides.
    mass : (n_pairs, n_nodes, n_nodes)
        Filled with integrals of products of two secondary shape functions over each segment [area].
    coupling : (n_pairs, n_nodes, n_other_nodes)
        Filled with integrals of secondary times primary shape functions [area].
    gap_reduction : (n_facets, n_nodes)
        Filled with integrals of secondary shape functions times the sum of both heights [volume].
    folded : (n_pairs,)
        Set where a point of the overlap has no counterpart on one of the facets. This point is omitted.
    """
    capacity = n_secondary + 2 * n_primary  # each side of the window adds at most two corners
    subject, window, spare = np.empty((capacity, 2)), np.empty((capacity, 2)), np.empty((capacity, 2))
    n, m = to_terms.shape[0], other_to_terms.shape[0]
    terms, other_terms, shape, other_shape = np.empty((n, 3)), np.empty((m, 3)), np.empty(n), np.empty(m)
    flat, other_flat, xi, other_xi = np.empty((n, 2)), np.empty((m, 2)), np.empty(2), np.empty(2)
    mass[start[low] : start[high]], coupling[start[low] : start[high]], gap_reduction[low:high] = 0.0, 0.0, 0.0
    exact = n == 3 and m == 3
    for i in range(start[low], start[high]):
        s, p = pairs[i, 0], pairs[i, 1]
        _flatten(deformed[s], n, 1, origin[s], axes[s], flat)  # coefficients: only the first is a position
        _flatten(other_deformed[p], m, 1, origin[s], axes[s], other_flat)
        count = _overlap(secondary[s], n_secondary, primary[p], n_primary, origin[s], axes[s], subject, window, spare)
        xi[:], other_xi[:] = middle, other_middle
        ox, oy = (subject[0, 0], subject[0, 1]) if exact else _centroid(subject, count)
        for k in range(1 if exact else 0, count - 1 if exact else count):
            successor = (k + 1) % count
            ux, uy = subject[k, 0] - ox, subject[k, 1] - oy
            vx, vy = subject[successor, 0] - ox, subject[successor, 1] - oy
            twice_area = ux * vy - uy * vx
            if twice_area <= 0.0:
                continue
            for q in range(points.shape[0]):
                x = ox + points[q, 0] * ux + points[q, 1] * vx
                y = oy + points[q, 0] * uy + points[q, 1] * vy
                projected_area = _locate(flat, x, y, xi, terms)
                if projected_area == 0.0 or _locate(other_flat, x, y, other_xi, other_terms) == 0.0:
                    folded[i] = True
                    xi[:], other_xi[:] = middle, other_middle
                    continue
                _fill_shape(to_terms, terms, shape)
                _fill_shape(other_to_terms, other_terms, other_shape)
                area = weights[q] * twice_area * _area_density(reference[s], terms) / projected_area
                _add_products(area, shape, other_shape, mass, coupling, i)
                if heights.shape[1] > 0:
                    rise = factor[i, 0] * _height(heights[s], xi)
                    rise += factor[i, 1] * _height(other_heights[p], other_xi)
                    for a in range(n):
                        gap_reduction[s, a] += area * rise * shape[a]
    _symmetrise(mass[start[low] : start[high]])
