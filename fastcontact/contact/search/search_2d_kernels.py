# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Closest facet to each of many points in 2D, and projection of points along normals interpolated between the nodes.

Facets are straight lines (2 nodes) or parabolas (3 nodes, the middle one last), at ``nodes`` (n_facets, n_nodes, 2).
"""

import numpy as np

from fastcontact._jit.decorators import inlined_kernel, interpretable_kernel, kernel
from fastcontact.contact.search.box_tree_kernels import DEPTH, FAR, open_box, square_to_box
from fastcontact.contact.search.limits import LARGEST_OVERHANG, MAX_ITERATIONS, ROUND_OFF_STEP, STEP
from fastcontact.round_off import LENGTH_ROUND_OFF, ROUND_OFF


@inlined_kernel
def _curve(nodes, f, s):
    """Return the point and the first and second derivatives of facet `f` at s in [-1, 1]."""
    ax, ay, bx, by = nodes[f, 0, 0], nodes[f, 0, 1], nodes[f, 1, 0], nodes[f, 1, 1]
    if nodes.shape[1] == 2:
        tx, ty = 0.5 * (bx - ax), 0.5 * (by - ay)
        return 0.5 * (ax + bx) + s * tx, 0.5 * (ay + by) + s * ty, tx, ty, 0.0, 0.0
    mx, my = nodes[f, 2, 0], nodes[f, 2, 1]
    cx, cy = ax + bx - 2.0 * mx, ay + by - 2.0 * my
    tx, ty = 0.5 * (bx - ax), 0.5 * (by - ay)
    return mx + s * tx + 0.5 * s * s * cx, my + s * ty + 0.5 * s * s * cy, tx + s * cx, ty + s * cy, cx, cy


@kernel
def _project(nodes, f, x, y):
    """Return s in [-1, 1] of the point of facet `f` closest to (x, y), and the squared distance."""
    if nodes.shape[1] == 2:
        px, py, tx, ty, _, _ = _curve(nodes, f, 0.0)
        s = ((x - px) * tx + (y - py) * ty) / (tx * tx + ty * ty)
        s = min(1.0, max(-1.0, s))
    else:
        s, best = 0.0, np.inf
        for k in range(9):
            trial = -1.0 + 0.25 * k
            px, py, _, _, _, _ = _curve(nodes, f, trial)
            d = (x - px) * (x - px) + (y - py) * (y - py)
            if d < best:
                best, s = d, trial
        for _ in range(50):
            px, py, tx, ty, cx, cy = _curve(nodes, f, s)
            slope = (x - px) * tx + (y - py) * ty
            curvature = tx * tx + ty * ty - ((x - px) * cx + (y - py) * cy)
            if not curvature > 0.0:  # beyond the centre of curvature: step as on a straight facet
                curvature = tx * tx + ty * ty
            new = min(1.0, max(-1.0, s + slope / curvature))
            change = abs(new - s)
            s = new
            if change < 1e-15:
                break
    # At a common node the distances of all its facets must be equal, so that the choice between them does not depend on
    # round-off. The projection of a point opposite the node may lie inside one of these facets by a rounding error.
    if abs(s) >= 1.0 - ROUND_OFF:
        end = 0 if s < 0.0 else 1
        s = 2.0 * end - 1.0
        px, py = nodes[f, end, 0], nodes[f, end, 1]
    else:
        px, py, _, _, _, _ = _curve(nodes, f, s)
    return s, (x - px) * (x - px) + (y - py) * (y - py)


@inlined_kernel
def _precedes(nodes, f, s, g, r, numbers):
    """Return whether facet `f` at s is preferred to the equally close facet `g` at r.

    If a line continues smoothly beyond a common node, the facet that ends there is preferred, independently of the numbering.
    At corners of more than 45 degrees and in all other cases, it is the facet with the lower number.
    """
    _, _, px, py, _, _ = _curve(nodes, f, s)
    _, _, qx, qy, _, _ = _curve(nodes, g, r)
    product = px * qx + py * qy
    if s != r and product > 0.0 and 2.0 * product * product > (px * px + py * py) * (qx * qx + qy * qy):
        return s > r
    return numbers[f] < numbers[g]


@interpretable_kernel
def closest_facets(points, order, begin, end, nodes, numbers, tree, result):
    """Project points (n, 2) onto their closest facets; `_precedes` chooses between equally close ones.

    The points are those from `begin` to ``end - 1`` in an `order` (n,) in which neighbours in space follow each other. Facets
    are in the order of the tree, and `numbers` (n_facets,) are their numbers before sorting. `result` is filled in place,
    with facet -1 and distance NaN if a point is not finite.
    """
    stack, squares, leaves = np.empty(DEPTH, np.int64), np.empty(DEPTH), len(tree.low) // 2
    for k in range(begin, end):
        i = order[k]
        x, y = points[i, 0], points[i, 1]
        closest, best, best_s, reach, top = -1, np.inf, 0.0, FAR, 0
        if np.isfinite(x + y):
            stack[0], squares[0], top = 1, square_to_box(tree, 1, (x, y)), 1
        while top > 0:
            top -= 1
            box = stack[top]
            if squares[top] > reach:
                continue
            if box < leaves:
                top = open_box(tree, box, (x, y), stack, squares, top)
                continue
            f = box - leaves
            s, d = _project(nodes, f, x, y)
            if d < best or (d == best and _precedes(nodes, f, s, closest, best_s, numbers)):
                closest, best, best_s, reach = f, d, s, (1.0 + ROUND_OFF) * d
        result.facet[i], result.distance[i] = -1, np.nan
        if closest >= 0:
            result.facet[i] = numbers[closest]
            _write(result, i, nodes, closest, best_s, x, y)


@inlined_kernel
def _write(result, i, nodes, f, s, x, y):
    """Fill the results for point `i`, at (x, y), except the number of the facet `f`."""
    px, py, tx, ty, _, _ = _curve(nodes, f, s)
    square = tx * tx + ty * ty
    length, tangential = np.sqrt(square), ((x - px) * tx + (y - py) * ty) / square
    result.xi[i, 0], result.normal[i, 0], result.normal[i, 1] = s, ty / length, -tx / length
    outward = tangential if s == 1.0 else -tangential if s == -1.0 else 0.0
    result.overhang[i] = max(0.5 * outward, 0.0)
    # A weighted mean of the nodes, which at an end of the facet is exactly that node.
    a, b, c = 0.5 * (1.0 - s), 0.5 * (1.0 + s), 0.0
    if nodes.shape[1] == 3:
        a, b, c = -s * a, s * b, 1.0 - s * s
    square = 0.0
    for d in range(2):
        coordinate = a * nodes[f, 0, d] + b * nodes[f, 1, d]
        if nodes.shape[1] == 3:
            coordinate += c * nodes[f, 2, d]
        result.position[i, d] = coordinate
        difference = (x if d == 0 else y) - coordinate
        square += difference * difference
    result.distance[i] = np.sqrt(square)


@kernel
def _newton(x, y, nodes, normals, f, s):
    """Return s where (x, y) lies on the normal of facet f, extended beyond its ends, and whether the iteration converged."""
    for _ in range(MAX_ITERATIONS):
        px, py, tx, ty, _, _ = _curve(nodes, f, s)
        nx, ny, mx, my, _, _ = _curve(normals, f, s)
        dx, dy, across = x - px, y - py, tx * ny - ty * nx
        slope = (dx * my - dy * mx) - across
        # The slope vanishes at a centre of curvature, where the foot of the normal is not unique.
        if not abs(slope) > LENGTH_ROUND_OFF * abs(across):
            return s, False
        step = min(1.0, max(-1.0, -(dx * ny - dy * nx) / slope))
        s += step
        if 0.5 * (abs(s) - 1.0) > 2.0 * LARGEST_OVERHANG:
            return s, False
        if abs(step) <= STEP * (1.0 + abs(s)):
            return s, True
    return s, abs(step) <= ROUND_OFF_STEP


@interpretable_kernel
def along_normals(points, nodes, normals, neighbour, facet, xi, overhang):
    """Replace closest-point projections (facet, xi) by projections along the interpolated normals.

    Parameters
    ----------
    points : ndarray (n, 2)
        Positions [length].
    nodes, normals : ndarray (n_facets, k, 2)
        Nodes of the facets and unit normals there, ends first; k is 2 or 3. With three nodes, a straight facet has its middle
        as the third one.
    neighbour : ndarray of int (n_facets, 2)
        The facet that continues the line at each end, or -1. At end 0 it is joined by its end 1, and at end 1 by its end 0.
    facet, xi, overhang : ndarray (n,)
        Closest points, changed in place where the projection succeeds.
    """
    for i in range(points.shape[0]):
        f, s, previous = facet[i], xi[i], -1
        for _ in range(MAX_ITERATIONS):
            s, converged = _newton(points[i, 0], points[i, 1], nodes, normals, f, s)
            if not converged or 0.5 * (abs(s) - 1.0) > LARGEST_OVERHANG:
                break
            if abs(s) <= 1.0:
                facet[i], xi[i], overhang[i] = f, s, 0.0
                break
            end = 1 if s > 0.0 else 0
            beyond = neighbour[f, end]
            if beyond < 0:
                facet[i], xi[i], overhang[i] = f, 2.0 * end - 1.0, 0.5 * (abs(s) - 1.0)
                break
            if beyond == previous:  # at the node between both facets
                facet[i], xi[i], overhang[i] = f, 2.0 * end - 1.0, 0.0
                break
            previous, f, s = f, beyond, 1.0 - 2.0 * end
