"""Closest facet to a point in 2D: projection on line facets (narrow phase) through a tree of boxes.

Facets are straight (2 nodes) or quadratic (3 nodes, the middle last); ``corners`` below is (n_facets, n_nodes, 2).
The tree is that of `packed_tree`.
"""

import numpy as np

from fastcontact._jit import inlined_kernel, kernel
from fastcontact.kernels.borrowing import borrowed
from fastcontact.kernels.packed_tree import WIDTH, leaves

# Squared distances to boxes and facets are rounded.
ROUNDING = 1.0 + 1e-14
# Length of the list of boxes still to look into, for trees of up to 2^60 facets.
ROOM = 20 * WIDTH


@inlined_kernel
def _curve(corners, f, s):
    """Return the point and the first and second derivatives of facet `f` at s in [-1, 1]."""
    ax, ay, bx, by = corners[f, 0, 0], corners[f, 0, 1], corners[f, 1, 0], corners[f, 1, 1]
    if corners.shape[1] == 2:
        tx, ty = 0.5 * (bx - ax), 0.5 * (by - ay)
        return 0.5 * (ax + bx) + s * tx, 0.5 * (ay + by) + s * ty, tx, ty, 0.0, 0.0
    mx, my = corners[f, 2, 0], corners[f, 2, 1]
    cx, cy = ax + bx - 2.0 * mx, ay + by - 2.0 * my
    tx, ty = 0.5 * (bx - ax), 0.5 * (by - ay)
    return mx + s * tx + 0.5 * s * s * cx, my + s * ty + 0.5 * s * s * cy, tx + s * cx, ty + s * cy, cx, cy


@inlined_kernel
def _project(corners, f, x, y):
    """Return s in [-1, 1] of the point of facet `f` closest to (x, y), and the squared distance."""
    if corners.shape[1] == 2:
        px, py, tx, ty, _, _ = _curve(corners, f, 0.0)
        s = ((x - px) * tx + (y - py) * ty) / (tx * tx + ty * ty)
        s = min(1.0, max(-1.0, s))
    else:
        s, best = 0.0, np.inf
        for k in range(9):
            trial = -1.0 + 0.25 * k
            px, py, _, _, _, _ = _curve(corners, f, trial)
            d = (x - px) ** 2 + (y - py) ** 2
            if d < best:
                best, s = d, trial
        for _ in range(50):
            px, py, tx, ty, cx, cy = _curve(corners, f, s)
            slope = (x - px) * tx + (y - py) * ty
            curvature = tx * tx + ty * ty - ((x - px) * cx + (y - py) * cy)
            if not curvature > 0.0:  # far inside the centre of curvature: step as on a straight facet
                curvature = tx * tx + ty * ty
            new = min(1.0, max(-1.0, s + slope / curvature))
            change = abs(new - s)
            s = new
            if change < 1e-15:
                break
    # At a node that facets share, all of them have the same distance to the last bit: then the first one is taken.
    if abs(s) == 1.0:
        end = 0 if s < 0.0 else 1
        px, py = corners[f, end, 0], corners[f, end, 1]
    else:
        px, py, _, _, _, _ = _curve(corners, f, s)
    return s, (x - px) ** 2 + (y - py) ** 2


@kernel
def closest_facets(points, points_order, begin, end, corners, tree, numbers, scratch, facet, xi, normal, overhang):
    """Project points on their closest facets; of equally close facets on the one with the lowest number.

    Parameters
    ----------
    points : (n, 2), points_order : (n,)
        Points, and the order to go through them, along a curve: the facet of the last one is near the next.
    begin, end : int
        Which of that order.
    corners : (n_facets, n_nodes, 2), tree : Tree, numbers : (n_facets,)
        Facets in the order of the tree, and their numbers.
    scratch : (stack (ROOM,) of int64, bound (ROOM,), away (WIDTH,))
        Overwritten.
    facet : (n,), xi : (n,), normal : (n, 2), overhang : (n,)
        Filled in place: number of the facet, or -1 where a point is not finite; place in [-1, 1]; unit outward normal there;
        how far the point stands out beyond the end of its facet, in facet lengths, 0 within.
    """
    points, points_order, corners, numbers = borrowed((points, points_order, corners, numbers))
    facet, xi, normal, overhang = borrowed((facet, xi, normal, overhang))
    tree, scratch = borrowed(tree), borrowed(scratch)
    stack, bound, away = scratch
    n_leaves, last = leaves(len(numbers)), -1
    for place in range(begin, end):
        i = points_order[place]
        x, y = points[i, 0], points[i, 1]
        facet[i] = -1
        if not (np.isfinite(x) and np.isfinite(y)):
            continue
        best, found, best_s = np.inf, last, 0.0
        if last >= 0:
            best_s, best = _project(corners, last, x, y)
        reach = ROUNDING * best
        stack[0], bound[0], top = len(tree.boxes) - 1, 0.0, 1
        while top > 0:
            top -= 1
            node = stack[top]
            if bound[top] > reach:
                continue
            if node >= 0:
                top = _pushed_children(tree, n_leaves, node, x, y, reach, stack, bound, away, top)
                continue
            f = -1 - node
            s, d = _project(corners, f, x, y)
            if d < best or (d == best and numbers[f] < numbers[found]):
                best, found, best_s = d, f, s
                reach = ROUNDING * best
        last = found
        if found < 0:  # only collapsed facets
            continue
        facet[i], xi[i] = numbers[found], best_s
        px, py, tx, ty, _, _ = _curve(corners, found, best_s)
        length = np.sqrt(tx * tx + ty * ty)
        normal[i, 0], normal[i, 1] = ty / length, -tx / length
        along = ((x - px) * tx + (y - py) * ty) / (length * length)
        overhang[i] = 0.0
        if best_s == 1.0 and along > 0.0:
            overhang[i] = 0.5 * along
        elif best_s == -1.0 and along < 0.0:
            overhang[i] = -0.5 * along


@inlined_kernel
def _pushed_children(tree, n_leaves, node, x, y, reach, stack, bound, away, top):
    """Put the children of a node on the list that are within reach, facets with numbers below zero; return its length.

    Those of one node are sorted, with the nearest on top.
    """
    boxes, bottom = tree.boxes[node], top
    for k in range(boxes.shape[1]):
        dx = max(boxes[0, k] - x, x - boxes[2, k], 0.0)
        dy = max(boxes[1, k] - y, y - boxes[3, k], 0.0)
        away[k] = dx * dx + dy * dy
    for k in range(boxes.shape[1]):
        if away[k] <= reach and away[k] < np.inf:
            at = top
            while at > bottom and bound[at - 1] < away[k]:
                stack[at], bound[at] = stack[at - 1], bound[at - 1]
                at -= 1
            child = tree.first[node] + k
            stack[at], bound[at] = -1 - child if node < n_leaves else child, away[k]
            top += 1
    return top
