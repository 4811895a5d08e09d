"""Closest facet to each of many points in 3D, through a tree of boxes (`packed_tree`).

Points come in the order of a space-filling curve, in runs. What may be closest to any point of a run is found once, the
front: the boxes below which the search of each point begins. The closest facet of one point bounds the distance of the next.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastcontact._jit import inlined_kernel, kernel
from fastcontact.kernels.borrowing import borrowed
from fastcontact.kernels.packed_tree import WIDTH, leaves
from fastcontact.kernels.projection3d import component, frame, onto_sides, project, vector
from fastcontact.kernels.straight3d import ON_SIDE, above, along, cross, dot, minus, on_bilinear, on_flat, unit

# Facets whose closest points lie nearer together than this, in facet sizes, meet there and are equally close.
SAME_PLACE = 1e-9
CONVERGED, NOT_CONVERGED, NOT_FINITE = 0, 1, 2
# Points in a run, at whose start the last facet is forgotten; most boxes in a front; length up to which the list of boxes
# still to look into is kept sorted.
RUN, FRONT, SORTED = 32, 64, 96
# Squared distances to boxes and facets are rounded: from far away by more than the size of the places that are the same.
ROUNDING = 1.0 + 1e-14
FAR = 1e300
Array = NDArray[np.float64]


class Answer(NamedTuple):
    """What is found for points.

    Number of the closest facet (n,), reference coordinates (n, 2), unit normal (n, 3), how far the point stands out beyond
    the sides of its facet as extended along its tangents, in facet lengths (0 within), projection (n, 3), distance (n,), and
    CONVERGED, NOT_CONVERGED or NOT_FINITE.
    """

    facet: NDArray[np.intp]
    xi: Array
    normal: Array
    overhang: Array
    position: Array
    distance: Array
    status: NDArray[np.int8]


class Scratch(NamedTuple):
    """Room to work in: boxes still to look into and their squared distances; the front and its boxes; distances."""

    stack: NDArray[np.int64]
    bound: Array
    front: NDArray[np.int64]
    front_boxes: Array
    away: Array


def scratch() -> Scratch:
    """Return room for one thread."""
    most = 20 * WIDTH + SORTED
    return Scratch(
        np.empty(most, np.int64), np.empty(most), np.empty(FRONT, np.int64), np.empty((6, FRONT)), np.empty(FRONT)
    )


@kernel
def closest_facets(points, order, begin, end, midst, facets, domain, tree, answer, scratch):
    """Project points on their closest facets; of facets that meet in the closest point the one with the lowest number.

    Parameters
    ----------
    points : (n, 3), order : (n,)
        Points, and the order to go through them, along a curve: the facet of the last one is near the next.
    begin, end : int
        Which of that order; the first a multiple of `RUN`.
    midst : (3,)
        Origin of the facets.
    facets, domain, tree : Facets, Domain, Tree
        Facets in the order of the tree.
    answer : Answer
        Filled in place.
    scratch : Scratch
        Overwritten.
    """
    points, order = borrowed((points, order))
    facets, domain, tree = borrowed(facets), borrowed(domain), borrowed(tree)
    answer, scratch = borrowed(answer), borrowed(scratch)
    slack, n_leaves = 0.0, leaves(len(facets.numbers))
    for d in range(3):
        slack = max(slack, SAME_PLACE * (tree.boxes[-1, 3 + d].max() - tree.boxes[-1, d].min()))
    for run in range(begin, end, RUN):
        run_end = min(run + RUN, end)
        middle, last, count = (run + run_end) // 2, -1, 0
        for slot in range(run_end - run):
            # The one in the middle comes first.
            i = order[middle if slot == 0 else run + slot - 1 if run + slot <= middle else run + slot]
            point = minus(row(points, i), (midst[0], midst[1], midst[2]))
            answer.facet[i], answer.status[i] = -1, NOT_FINITE
            if not np.isfinite(point[0] + point[1] + point[2]):
                continue
            reach = FAR
            if last >= 0:
                reach = ROUNDING * (_at_most(facets, last, point) + slack) ** 2
            best, found, same, state, within = np.inf, -1, 0.0, CONVERGED, False
            best_s, best_t, place = 0.0, 0.0, point
            top = _started(tree, scratch, count, point, reach)
            while top > 0:
                top -= 1
                node = scratch.stack[top]
                if scratch.bound[top] > reach:
                    continue
                if node >= 0:
                    top = _pushed_children(tree, n_leaves, node, point, reach, scratch, top)
                    continue
                f = -1 - node
                s, t, trial, square, good, inside = _projected(facets, f, domain, point, reach)
                if square == np.inf:
                    continue
                gap = minus(trial, place)
                tied = found >= 0 and (dot(gap, gap) <= same * same or square == best)
                if (facets.numbers[f] < facets.numbers[found]) if tied else (square < best):
                    found, best_s, best_t, place, within = f, s, t, trial, inside
                    state = CONVERGED if good else NOT_CONVERGED
                    same = SAME_PLACE * _size(tree.boxes, f)
                if square < best:
                    best = square
                    reach = ROUNDING * (np.sqrt(best) + same) ** 2
            last = found
            if found < 0:
                continue
            if slot == 0:
                radius = np.sqrt(best) + 2.0 * _farthest(points, order, run, run_end, i) + same
                count = _found_front(tree, n_leaves, point, radius, scratch)
            _write(answer, i, facets, found, domain, best_s, best_t, point, place, midst, within, state)


@inlined_kernel
def _write(answer, i, facets, f, domain, s, t, point, place, midst, within, state):
    """Fill the answer for point `i` from what was found."""
    if within:
        a, b, c = vector(facets.terms, f, 1), vector(facets.terms, f, 2), _twist(facets.terms, f)
        normal, overhang = unit(cross(along(a, c, t), along(b, c, s))), 0.0
    else:
        s, t = onto_sides(domain.sides, s, t)
        normal, overhang = frame(facets.terms, f, s, t, point, domain.sides, domain.nodes)
        if not np.isfinite(normal[0]):
            state = NOT_CONVERGED
    gap = minus(point, place)
    answer.facet[i], answer.xi[i, 0], answer.xi[i, 1], answer.status[i] = facets.numbers[f], s, t, state
    answer.overhang[i], answer.distance[i] = overhang, np.sqrt(dot(gap, gap))
    for d in range(3):
        answer.normal[i, d], answer.position[i, d] = normal[d], place[d] + midst[d]


@inlined_kernel
def row(points, i):
    """Return row `i` of (n, 3)."""
    return points[i, 0], points[i, 1], points[i, 2]


@inlined_kernel
def _twist(terms, f):
    """Return the term s t of a facet of three or four nodes."""
    return vector(terms, f, 3) if terms.shape[1] > 3 else (0.0, 0.0, 0.0)


@inlined_kernel
def _at_most(facets, f, point):
    """Return a distance that the closest point of facet `f` does not exceed."""
    terms = facets.terms
    if terms.shape[1] > 4:
        r = minus(point, vector(facets.nodes, f, 0))
        return np.sqrt(dot(r, r))
    r = minus(point, vector(terms, f, 0))
    a, b = vector(terms, f, 1), vector(terms, f, 2)
    return np.sqrt(above(r, a, b, _twist(terms, f), terms.shape[1] == 3))


@inlined_kernel
def _projected(facets, f, domain, point, reach):
    """Return (s, t) of the closest point of facet `f`, the point, and its squared distance; infinite if out of reach.

    Also whether the projection converged, and whether it certainly lies within the facet.
    """
    terms = facets.terms
    if terms.shape[1] <= 4:
        o, a, b, c = vector(terms, f, 0), vector(terms, f, 1), vector(terms, f, 2), _twist(terms, f)
        r = minus(point, o)
        if terms.shape[1] == 3:
            s, t = on_flat(r, a, b)
            inside, d = s > ON_SIDE and t > ON_SIDE and 1.0 - s - t > ON_SIDE, 0.0
        else:
            s, t, d = on_bilinear(r, a, b, c, np.sqrt(reach))
            inside = abs(s) < 1.0 and abs(t) < 1.0
        place = along(along(along(o, a, s), b, t), c, s * t)
        gap = minus(point, place)
        if d == np.inf:
            return s, t, place, np.inf, True, False
        if terms.shape[1] == 3 or (abs(dot(gap, c)) < facets.convex[f] and d >= 0.0):
            return s, t, place, dot(gap, gap), True, inside
    s, t, d, good = project(facets, f, domain, point, reach)
    place = component(terms, f, 0, s, t)[0], component(terms, f, 1, s, t)[0], component(terms, f, 2, s, t)[0]
    gap = minus(point, place)
    return s, t, place, np.inf if d == np.inf else dot(gap, gap), good, False


@inlined_kernel
def _size(boxes, f):
    """Return the longest side of the box of facet `f`."""
    leaf, k = f // WIDTH, f % WIDTH
    return max(
        boxes[leaf, 3, k] - boxes[leaf, 0, k],
        boxes[leaf, 4, k] - boxes[leaf, 1, k],
        boxes[leaf, 5, k] - boxes[leaf, 2, k],
    )


@inlined_kernel
def _fill_away(boxes, point, count, away):
    """Fill the squared distances from a point to boxes (6, count)."""
    for k in range(count):
        dx = max(boxes[0, k] - point[0], point[0] - boxes[3, k], 0.0)
        dy = max(boxes[1, k] - point[1], point[1] - boxes[4, k], 0.0)
        dz = max(boxes[2, k] - point[2], point[2] - boxes[5, k], 0.0)
        away[k] = dx * dx + dy * dy + dz * dz


@inlined_kernel
def _pushed(scratch, top, bottom, what, away):
    """Put a box on the list so that the nearest stays on top, and return the new length."""
    at, stack, bound = top, scratch.stack, scratch.bound
    while at > bottom and bound[at - 1] < away:
        stack[at], bound[at] = stack[at - 1], bound[at - 1]
        at -= 1
    stack[at], bound[at] = what, away
    return top + 1


@inlined_kernel
def _pushed_children(tree, n_leaves, node, point, reach, scratch, top):
    """Put the children of a node on the list that are within reach, facets with numbers below zero; return its length."""
    width = tree.boxes.shape[2]  # as a constant it would keep the compiler from using vectors
    _fill_away(tree.boxes[node], point, width, scratch.away)
    # A long list is not sorted through any more, lest that take longest.
    bottom = 0 if top < SORTED else top
    for k in range(width):
        if scratch.away[k] <= reach:
            child = tree.first[node] + k
            top = _pushed(scratch, top, bottom, -1 - child if node < n_leaves else child, scratch.away[k])
    return top


@inlined_kernel
def _started(tree, scratch, count, point, reach):
    """Start the list with the boxes of the front that are within reach, without a front with the root; return its length."""
    top = 0
    if count == 0:
        top = _pushed(scratch, 0, 0, len(tree.boxes) - 1, 0.0)
    _fill_away(scratch.front_boxes, point, count, scratch.away)
    for k in range(count):
        if scratch.away[k] <= reach:
            top = _pushed(scratch, top, 0, scratch.front[k], scratch.away[k])
    return top


@inlined_kernel
def _farthest(points, points_order, run, run_end, i):
    """Return the largest distance from point `i` to another of its run."""
    square = 0.0
    for k in range(run, run_end):
        gap = minus(row(points, points_order[k]), row(points, i))
        square = max(square, dot(gap, gap))
    return np.sqrt(square)


@inlined_kernel
def _found_front(tree, n_leaves, point, radius, scratch):
    """Fill the front with the nodes above the leaves within a distance of a point; return their number.

    Nothing that any point of a run may be closest to lies farther from one of them than its own distance and twice its
    distance from the others. The number is 0 where there are more than have room, or no such nodes.
    """
    square, stack, front, away = (radius * (1.0 + 1e-9)) ** 2, scratch.stack, scratch.front, scratch.away
    upper = n_leaves + leaves(n_leaves)  # nodes from here on are above those above the leaves
    stack[0], top, count = len(tree.boxes) - 1, 1, 0
    while top > 0 and stack[top - 1] >= upper:
        top -= 1
        boxes, first = tree.boxes[stack[top]], tree.first[stack[top]]
        _fill_away(boxes, point, boxes.shape[1], away)
        for k in range(WIDTH):
            if not away[k] <= square:
                continue
            if first + k >= upper:
                stack[top] = first + k
                top += 1
            elif count < FRONT:
                front[count] = first + k
                for d in range(6):
                    scratch.front_boxes[d, count] = boxes[d, k]
                count += 1
            else:
                return 0
    return count
