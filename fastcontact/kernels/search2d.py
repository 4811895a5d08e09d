"""Closest facet to a point in 2D: projection on line facets (narrow phase) through a tree of boxes.

Facets are straight (2 nodes) or quadratic (3 nodes, the middle last); ``corners`` below is (n_facets, n_nodes, 2).
The tree is that of `box_tree`.
"""

import numpy as np

from fastcontact._jit import kernel


@kernel
def _distance_to_box(x, y, low, high, box):
    dx = max(low[box, 0] - x, 0.0, x - high[box, 0])
    dy = max(low[box, 1] - y, 0.0, y - high[box, 1])
    return dx * dx + dy * dy


@kernel
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


@kernel
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
def closest_facets(points, corners, low, high, child, span, order, facet, xi, normal, overhang):
    """Project every point on its closest facet; of equally close facets the one with the lowest number.

    Fills, in place, ``facet`` (n,), ``xi`` (n,) in [-1, 1], ``normal`` (n, 2) unit outward at the projection, and
    ``overhang`` (n,): how far the point stands out beyond the end of its facet, in facet lengths, 0 within.
    """
    stack = np.empty(128, np.int64)
    for i in range(points.shape[0]):
        x, y = points[i, 0], points[i, 1]
        best, best_facet, best_s = np.inf, -1, 0.0
        stack[0] = 0
        top = 1
        while top > 0:
            top -= 1
            box = stack[top]
            if _distance_to_box(x, y, low, high, box) > best:
                continue
            if child[box] < 0:
                for k in range(span[box, 0], span[box, 1]):
                    s, d = _project(corners, order[k], x, y)
                    if d < best or (d == best and order[k] < best_facet):
                        best, best_facet, best_s = d, order[k], s
                continue
            left = child[box]
            near, far = left, left + 1
            if _distance_to_box(x, y, low, high, far) < _distance_to_box(x, y, low, high, near):
                near, far = far, near
            stack[top], stack[top + 1] = far, near
            top += 2
        facet[i], xi[i] = best_facet, best_s
        px, py, tx, ty, _, _ = _curve(corners, best_facet, best_s)
        length = np.sqrt(tx * tx + ty * ty)
        normal[i, 0], normal[i, 1] = ty / length, -tx / length
        along = ((x - px) * tx + (y - py) * ty) / (length * length)
        overhang[i] = 0.0
        if best_s == 1.0 and along > 0.0:
            overhang[i] = 0.5 * along
        elif best_s == -1.0 and along < 0.0:
            overhang[i] = -0.5 * along
