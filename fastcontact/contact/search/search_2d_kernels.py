# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Closest facet to a point in 2D: projection on line facets (narrow phase) through a tree of boxes.

Facets are straight (2 nodes) or quadratic (3 nodes, the middle last); ``corners`` below is (n_facets, n_nodes, 2).
The tree is that of `packed_tree`; points come in runs, as in `search3d`.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastcontact._jit.borrowed_arrays import borrowed
from fastcontact._jit.decorators import inlined_kernel, kernel
from fastcontact.contact.search.nearest_first_kernels import (
    FAR,
    RUN,
    farthest,
    found_front,
    left,
    nearest,
    opened,
    started,
    taken,
    whole_front,
)
from fastcontact.contact.search.packed_tree_kernels import leaves

# Squared distances to boxes and facets are rounded.
ROUNDING = 1.0 + 1e-14
Array = NDArray[np.float64]


class Answer(NamedTuple):
    """What is found for points.

    Number of the facet (n,), or -1 where a point is not finite; place in [-1, 1] (n, 1); unit outward normal there (n, 2);
    how far the point stands out beyond the end of its facet, in facet lengths, 0 within (n,); projection (n, 2); distance
    (n,).
    """

    facet: NDArray[np.intp]
    xi: Array
    normal: Array
    overhang: Array
    position: Array
    distance: Array


@kernel
def prepare(corners, numbers, sorted_corners, low, high):
    """Fill the corners and the boxes (n_facets, 2) of facets in the order of their `numbers`."""
    corners, numbers, sorted_corners, low, high = borrowed((corners, numbers, sorted_corners, low, high))
    for i in range(len(numbers)):
        f = numbers[i]
        for d in range(2):
            p, q = corners[f, 0, d], corners[f, 1, d]
            sorted_corners[i, 0, d], sorted_corners[i, 1, d] = p, q
            low[i, d], high[i, d] = min(p, q), max(p, q)
            if corners.shape[1] == 3:
                middle = corners[f, 2, d]
                sorted_corners[i, 2, d] = middle
                # With its ends, the corner of the polygon that holds a parabola (Bezier).
                control = 2.0 * middle - 0.5 * (p + q)
                low[i, d], high[i, d] = min(low[i, d], control), max(high[i, d], control)


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
def closest_facets(points, order, begin, end, corners, tree, numbers, answer, queue):
    """Project points on their closest facets; of equally close facets on the one with the lowest number.

    Parameters
    ----------
    points : (n, 2), order : (n,)
        Points, and the order to go through them, along a curve: those of a run lie near together.
    begin, end : int
        Which of that order; the first a multiple of `RUN`.
    corners : (n_facets, n_nodes, 2), tree : Tree, numbers : (n_facets,)
        Facets in the order of the tree, and their numbers.
    answer : Answer
        Filled in place.
    queue : Queue
        Overwritten.
    """
    points, order, corners, numbers = borrowed((points, order, corners, numbers))
    tree, answer, queue = borrowed(tree), borrowed(answer), borrowed(queue)
    n_leaves, n_nodes = leaves(len(numbers)), len(tree.first)
    for run in range(begin, end, RUN):
        run_end = min(run + RUN, end)
        middle, count = (run + run_end) // 2, whole_front(queue, tree, (0.0, 0.0))
        for slot in range(run_end - run):
            # The one in the middle comes first.
            i = order[middle if slot == 0 else run + slot - 1 if run + slot <= middle else run + slot]
            x, y = points[i, 0], points[i, 1]
            answer.facet[i] = -1
            if not np.isfinite(x + y):
                continue
            best, found, best_s, reach = np.inf, -1, 0.0, FAR
            n = started(queue, count, (x, y))
            while n > 0:
                chunk, away = nearest(queue, n)
                if away > reach:
                    n = left(n)
                    continue
                child = taken(queue, chunk, away, count)
                if child < n_nodes:
                    n = opened(queue, n, tree, n_leaves, child, (x, y))
                    continue
                f = child - n_nodes
                s, d = _project(corners, f, x, y)
                if d < best or (d == best and numbers[f] < numbers[found]):
                    best, found, best_s = d, f, s
                    reach = ROUNDING * best
            if found < 0:  # only collapsed facets
                continue
            if slot == 0:
                radius = np.sqrt(best) + 2.0 * farthest(points, order, run, run_end, i)
                count = found_front(queue, tree, n_leaves, (x, y), radius)
            answer.facet[i] = numbers[found]
            _write(answer, i, corners, found, best_s, x, y)


@inlined_kernel
def _write(answer, i, corners, f, s, x, y):
    """Fill the answer for point `i`, at (x, y), but for the number of the facet `f`."""
    px, py, tx, ty, _, _ = _curve(corners, f, s)
    square = tx * tx + ty * ty
    length, along = np.sqrt(square), ((x - px) * tx + (y - py) * ty) / square
    answer.xi[i, 0], answer.normal[i, 0], answer.normal[i, 1] = s, ty / length, -tx / length
    outward = along if s == 1.0 else -along if s == -1.0 else 0.0
    answer.overhang[i] = max(0.5 * outward, 0.0)
    # As a mean of the nodes, which at an end is that node to the last bit.
    a, b, c = 0.5 * (1.0 - s), 0.5 * (1.0 + s), 0.0
    if corners.shape[1] == 3:
        a, b, c = -s * a, s * b, 1.0 - s * s
    square = 0.0
    for d in range(2):
        place = a * corners[f, 0, d] + b * corners[f, 1, d]
        if corners.shape[1] == 3:
            place += c * corners[f, 2, d]
        answer.position[i, d] = place
        gap = (x if d == 0 else y) - place
        square += gap * gap
    answer.distance[i] = np.sqrt(square)
