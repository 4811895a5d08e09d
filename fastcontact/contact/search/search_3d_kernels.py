# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Closest facet to each of many points in 3D, through a tree of boxes (`packed_tree`), the nearest first (`nearest_first`).

Points come in the order of a space-filling curve, in runs. What may be closest to any point of a run is found once, the
front: the boxes at which the search of each point begins.
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
from fastcontact.contact.search.packed_tree_kernels import WIDTH, leaves
from fastcontact.contact.search.projection_3d_kernels import component, frame, onto_sides, project, vector
from fastcontact.contact.search.straight_3d_kernels import ON_SIDE, along, cross, dot, minus, on_bilinear, on_flat, unit

# Facets whose closest points lie nearer together than this, in facet sizes, meet there and are equally close.
SAME_PLACE = 1e-9
CONVERGED, NOT_CONVERGED, NOT_FINITE = 0, 1, 2
# Squared distances to boxes and facets are rounded: from far away by more than the size of the places that are the same.
ROUNDING = 1.0 + 1e-14
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


@kernel
def closest_facets(points, order, begin, end, facets, domain, tree, answer, queue):
    """Project points on their closest facets; of facets that meet in the closest point the one with the lowest number.

    Parameters
    ----------
    points : (n, 3), order : (n,)
        Points, and the order to go through them, along a curve: those of a run lie near together.
    begin, end : int
        Which of that order; the first a multiple of `RUN`.
    facets, domain, tree : Facets, Domain, Tree
        Facets in the order of the tree.
    answer : Answer
        Filled in place.
    queue : Queue
        Overwritten.
    """
    points, order = borrowed((points, order))
    facets, domain, tree = borrowed(facets), borrowed(domain), borrowed(tree)
    answer, queue = borrowed(answer), borrowed(queue)
    midst, n_leaves, n_nodes = facets.midst, leaves(len(facets.numbers)), len(tree.first)
    for run in range(begin, end, RUN):
        run_end = min(run + RUN, end)
        middle, count = (run + run_end) // 2, whole_front(queue, tree, (0.0, 0.0, 0.0))
        for slot in range(run_end - run):
            # The one in the middle comes first.
            i = order[middle if slot == 0 else run + slot - 1 if run + slot <= middle else run + slot]
            point = minus(row(points, i), (midst[0], midst[1], midst[2]))
            answer.facet[i], answer.status[i] = -1, NOT_FINITE
            if not np.isfinite(point[0] + point[1] + point[2]):
                continue
            best, found, same, state, inside = np.inf, -1, 0.0, CONVERGED, False
            best_s, best_t, place, reach = 0.0, 0.0, point, FAR
            n = started(queue, count, point)
            while n > 0:
                chunk, away = nearest(queue, n)
                if away > reach:
                    n = left(n)
                    continue
                child = taken(queue, chunk, away, count)
                if child < n_nodes:
                    n = opened(queue, n, tree, n_leaves, child, point)
                    continue
                f = child - n_nodes
                s, t, trial, square, good, sure = _projected(facets, f, domain, point, reach)
                if square == np.inf:
                    continue
                gap = minus(trial, place)
                tied = found >= 0 and (dot(gap, gap) <= same * same or square == best)
                if (facets.numbers[f] < facets.numbers[found]) if tied else (square < best):
                    found, best_s, best_t, place, inside = f, s, t, trial, sure
                    state = CONVERGED if good else NOT_CONVERGED
                    same = SAME_PLACE * _size(tree.boxes, f)
                if square < best:
                    best = square
                    reach = ROUNDING * (np.sqrt(best) + same) ** 2
            if found < 0:
                continue
            if slot == 0:
                radius = np.sqrt(best) + 2.0 * farthest(points, order, run, run_end, i) + same
                count = found_front(queue, tree, n_leaves, point, radius)
            _write(answer, i, facets, found, domain, best_s, best_t, point, place, midst, inside, state)


@inlined_kernel
def _write(answer, i, facets, f, domain, s, t, point, place, midst, inside, state):
    """Fill the answer for point `i` from what was found."""
    if inside:
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
