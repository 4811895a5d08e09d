# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""A binary tree of the bounding boxes of facets in 2D or 3D, which selects the few facets that may be closest to a point.

Facets are first sorted so that neighbours in space follow each other (`tree_order`). Box 1 is the root, and the children of
box k are the boxes 2 k and 2 k + 1. The second half of the boxes are those of single facets, in the sorted order. Empty
boxes, which are infinitely far from every point, increase the number of leaves to a power of two.
"""

from typing import NamedTuple

import numpy as np

from fastcontact._jit.decorators import inlined_kernel, interpretable_kernel, kernel
from fastcontact.arrays import Array

# Capacity of the stack of boxes to be opened. A tree has at most as many levels as the number of a box has bits.
DEPTH = np.iinfo(np.int64).bits
# A squared distance that no facet exceeds.
FAR = float(np.finfo(np.float64).max)


class Tree(NamedTuple):
    """Corners of the boxes, low and high (2 n_leaves, dim) each [length]."""

    low: Array
    high: Array


@interpretable_kernel
def tree_order(points):
    """Return the permutation (n,) that sorts points (n, dim) by recursive bisection along the longest side.

    The number of points in the left half is a power of two, so that the facets below each box of the tree form one of these
    parts.
    """
    n = points.shape[0]
    sorted_, order, size = points.copy(), np.arange(n), 1
    while size < n:
        size *= 2
    while size > 1:
        for begin in range(0, n, size):
            if begin + size // 2 < n:
                _halve(sorted_, order, begin, begin + size // 2, min(begin + size, n))
        size //= 2
    return order


@kernel
def _halve(points, order, begin, middle, end):
    """Partition the rows `begin` to ``end - 1`` at `middle` along the longest side of their box (Hoare, 1961).

    In this coordinate, no row before `middle` exceeds a row after it.
    """
    axis, longest = 0, -1.0
    for d in range(points.shape[1]):
        low, high = np.inf, -np.inf
        for k in range(begin, end):
            low, high = min(low, points[k, d]), max(high, points[k, d])
        if high - low > longest:
            axis, longest = d, high - low
    first, last = begin, end - 1
    while first < last:
        pivot = points[(first + last) // 2, axis]
        i, j = first, last
        while i <= j:
            while points[i, axis] < pivot:
                i += 1
            while points[j, axis] > pivot:
                j -= 1
            if i <= j:
                order[i], order[j] = order[j], order[i]
                for d in range(points.shape[1]):
                    points[i, d], points[j, d] = points[j, d], points[i, d]
                i += 1
                j -= 1
        if middle <= j:
            last = j
        elif middle >= i:
            first = i
        else:
            return


@interpretable_kernel
def build(low, high):
    """Return the tree over the boxes of facets (n_facets, dim), sorted by `tree_order`."""
    n, dim = low.shape
    leaves = 1
    while leaves < n:
        leaves *= 2
    tree = Tree(np.full((2 * leaves, dim), np.inf), np.full((2 * leaves, dim), -np.inf))
    for k in range(n):  # element by element: a slice would compile its error message as well, which takes seconds
        for d in range(dim):
            tree.low[leaves + k, d], tree.high[leaves + k, d] = low[k, d], high[k, d]
    for box in range(leaves - 1, 0, -1):
        for d in range(dim):
            tree.low[box, d] = min(tree.low[2 * box, d], tree.low[2 * box + 1, d])
            tree.high[box, d] = max(tree.high[2 * box, d], tree.high[2 * box + 1, d])
    return tree


@inlined_kernel
def square_to_box(tree, box, point):
    """Return the squared distance from a point, a tuple, to a box; 0 inside [length^2]."""
    square = 0.0
    for d in range(len(point)):
        distance = max(tree.low[box, d] - point[d], point[d] - tree.high[box, d], 0.0)
        square += distance * distance
    return square


@inlined_kernel
def open_box(tree, box, point, stack, squares, top):
    """Push the children of a box onto a stack of boxes and squared distances, the nearer one last; return the new height."""
    near, far = 2 * box, 2 * box + 1
    to_near, to_far = square_to_box(tree, near, point), square_to_box(tree, far, point)
    if to_far < to_near:
        near, far, to_near, to_far = far, near, to_far, to_near
    stack[top], squares[top] = far, to_far
    stack[top + 1], squares[top + 1] = near, to_near
    return top + 2
