# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Closest facet to each of many points in 3D."""

import numpy as np

from fastcontact._jit.decorators import inlined_kernel, interpretable_kernel
from fastcontact.contact.search.box_tree_kernels import DEPTH, FAR, open_box, square_to_box
from fastcontact.contact.search.projection_3d_kernels import component, normal_and_overhang, onto_sides, project, vector
from fastcontact.contact.search.straight_3d_kernels import cross, dot, minus, on_bilinear, on_flat, plus_multiple, unit
from fastcontact.round_off import LENGTH_ROUND_OFF, ROUND_OFF


@interpretable_kernel
def closest_facets(points, order, begin, end, facets, domain, numbers, tree, result):
    """Project points (n, 3) onto their closest facets.

    If several facets meet at the closest point, the one with the lowest number is chosen. `facets` and `domain` are described
    in `projection_3d_kernels`, and the other arguments in `search_2d_kernels.closest_facets`. If a projection fails, the
    distance is NaN. If a point is not finite, the facet is -1 as well.
    """
    stack, squares, leaves = np.empty(DEPTH, np.int64), np.empty(DEPTH), len(tree.low) // 2
    centre = facets.centre[0], facets.centre[1], facets.centre[2]
    for k in range(begin, end):
        i = order[k]
        point = minus((points[i, 0], points[i, 1], points[i, 2]), centre)
        closest, best, tolerance, certain, converged = -1, np.inf, 0.0, False, True
        best_s, best_t, foot, reach, top = 0.0, 0.0, point, FAR, 0
        if np.isfinite(point[0] + point[1] + point[2]):
            stack[0], squares[0], top = 1, square_to_box(tree, 1, point), 1
        while top > 0:
            top -= 1
            box = stack[top]
            if squares[top] > reach:
                continue
            if box < leaves:
                top = open_box(tree, box, point, stack, squares, top)
                continue
            f = box - leaves
            s, t, candidate, squared_distance, success, inside = _projected(facets, f, domain, point, reach)
            if squared_distance == np.inf:
                continue
            offset = minus(candidate, foot)
            # Facets whose closest points coincide meet there and are equally close.
            coincide = closest >= 0 and (dot(offset, offset) <= tolerance * tolerance or squared_distance == best)
            if (numbers[f] < numbers[closest]) if coincide else (squared_distance < best):
                closest, best_s, best_t, foot, certain, converged = f, s, t, candidate, inside, success
                tolerance = LENGTH_ROUND_OFF * _size(tree.low, tree.high, box)
            if squared_distance < best:
                best = squared_distance
                reach = np.sqrt(best) + tolerance
                reach = (1.0 + ROUND_OFF) * (reach * reach)
        result.facet[i], result.distance[i] = -1, np.nan
        if closest >= 0:
            result.facet[i] = numbers[closest]
            _write(result, i, facets, closest, domain, best_s, best_t, point, foot, certain, converged)


@inlined_kernel
def _write(result, i, facets, f, domain, s, t, point, foot, inside, converged):
    """Fill the results for point `i`, except the number of the facet `f`."""
    if inside:
        a, b, c = vector(facets.coefficients, f, 1), vector(facets.coefficients, f, 2), _twist(facets.coefficients, f)
        normal, overhang = unit(cross(plus_multiple(a, c, t), plus_multiple(b, c, s))), 0.0
    else:
        s, t = onto_sides(domain.sides, s, t)
        normal, overhang = normal_and_overhang(facets.coefficients, f, s, t, point, domain.sides, domain.nodes)
    offset = minus(point, foot)
    result.xi[i, 0], result.xi[i, 1], result.overhang[i] = s, t, overhang
    if converged and np.isfinite(normal[0]):
        result.distance[i] = np.sqrt(dot(offset, offset))
    for d in range(3):
        result.normal[i, d], result.position[i, d] = normal[d], foot[d] + facets.centre[d]


@inlined_kernel
def _twist(coefficients, f):
    """Return the coefficient of the term s t of a facet with three or four nodes."""
    return vector(coefficients, f, 3) if coefficients.shape[1] > 3 else (0.0, 0.0, 0.0)


@inlined_kernel
def _projected(facets, f, domain, point, reach):
    """Return (s, t) of the closest point of facet `f`, the point, and its squared distance, infinite if out of reach.

    The last two results are whether the projection converged, and whether it certainly lies inside the facet.
    """
    C = facets.coefficients
    if C.shape[1] <= 4:
        o, a, b, c = vector(C, f, 0), vector(C, f, 1), vector(C, f, 2), _twist(C, f)
        r = minus(point, o)
        if C.shape[1] == 3:
            s, t = on_flat(r, a, b)
            inside, d = s > ROUND_OFF and t > ROUND_OFF and 1.0 - s - t > ROUND_OFF, 0.0
        else:
            s, t, d = on_bilinear(r, a, b, c, np.sqrt(reach))
            inside = abs(s) < 1.0 and abs(t) < 1.0
        foot = plus_multiple(plus_multiple(plus_multiple(o, a, s), b, t), c, s * t)
        offset = minus(point, foot)
        if d == np.inf:
            return s, t, foot, np.inf, True, False
        if C.shape[1] == 3 or (abs(dot(offset, c)) < facets.convexity_bound[f] and d >= 0.0):
            return s, t, foot, dot(offset, offset), True, inside
    s, t, d, converged = project(facets, f, domain, point, reach)
    foot = component(C, f, 0, s, t)[0], component(C, f, 1, s, t)[0], component(C, f, 2, s, t)[0]
    offset = minus(point, foot)
    return s, t, foot, np.inf if d == np.inf else dot(offset, offset), converged, False


@inlined_kernel
def _size(low, high, box):
    """Return the longest side of a box."""
    return max(high[box, 0] - low[box, 0], high[box, 1] - low[box, 1], high[box, 2] - low[box, 2])
