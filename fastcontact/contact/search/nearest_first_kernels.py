# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Boxes of a tree (`packed_tree`), the nearest to a point first; and where to begin for points that lie near together.

What is still to look into lies in chunks of `WIDTH` boxes each, the children of one node, with the least distance of each
chunk beside it. Of points in a run, all may be closest to few leaves only, the front: it is found once, and makes the first
chunks for each of them.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastcontact._jit.decorators import inlined_kernel, kernel
from fastcontact.contact.search.eight_boxes import copied, emptied, lowest, squares, within, without
from fastcontact.contact.search.packed_tree_kernels import WIDTH

# Chunks up to which the nearest box of all comes first, from there on of the last chunk: room for trees of up to 2^60 facets.
SORTED, DEPTH = 64, 20
# Points in a run, and most chunks in a front.
RUN, FRONT = 24, 16
FAR = 1e300
Array = NDArray[np.float64]


class Queue(NamedTuple):
    """Chunks of boxes: squared distances (n WIDTH,), the least (n,), and the number of the first box (n,).

    The first chunks are the front: numbers of the nodes (FRONT WIDTH,) and their boxes (FRONT, 2 dim, WIDTH).
    """

    away: Array
    least: Array
    first: NDArray[np.int64]
    front: NDArray[np.int64]
    boxes: Array


def queue(dim: int) -> Queue:
    """Return an empty one, for one thread."""
    most = SORTED + DEPTH
    return Queue(
        np.empty(most * WIDTH),
        np.empty(most),
        np.empty(most, np.int64),
        np.empty(FRONT * WIDTH, np.int64),
        np.empty((FRONT, 2 * dim, WIDTH)),
    )


@inlined_kernel
def started(queue, count, point):
    """Fill the distances to the front of `count` boxes; return the number of chunks."""
    n = (count + WIDTH - 1) // WIDTH
    for chunk in range(n):
        queue.least[chunk] = squares(queue.boxes, chunk, point, queue.away, chunk * WIDTH)
    return n


@inlined_kernel
def nearest(queue, n):
    """Return the chunk of `n` with the nearest box, and its squared distance; of many chunks the last."""
    at = 0 if n <= SORTED else n - 1
    away = queue.least[at]
    for chunk in range(at + 1, n):
        here = queue.least[chunk]
        at, away = (chunk, here) if here < away else (at, away)
    return at, away


@inlined_kernel
def left(n):
    """Return the number of chunks where nothing in the last of many is within reach, or in none of few."""
    return n - 1 if n > SORTED else 0


@inlined_kernel
def taken(queue, chunk, away, count):
    """Remove the box at this distance from a chunk, and return its number."""
    k = lowest(within(queue.away, chunk * WIDTH, away))
    queue.least[chunk] = without(queue.away, chunk * WIDTH, k)
    return queue.front[chunk * WIDTH + k] if chunk * WIDTH < count else queue.first[chunk] + k


@inlined_kernel
def opened(queue, n, tree, n_leaves, node, point):
    """Add a chunk of what is in a node, facets with numbers after those of nodes; return the number of chunks."""
    queue.least[n] = squares(tree.boxes, node, point, queue.away, n * WIDTH)
    queue.first[n] = tree.first[node] + (len(tree.first) if node < n_leaves else 0)
    return n + 1


@kernel
def farthest(points, order, begin, end, i):
    """Return the largest distance from point `i` to those of ``order[begin:end]``."""
    most = 0.0
    for k in range(begin, end):
        square = 0.0
        for d in range(points.shape[1]):
            square += (points[order[k], d] - points[i, d]) ** 2
        most = max(most, square)
    return np.sqrt(most)


@kernel
def whole_front(queue, tree, point):
    """Make the root the front, and return its length; only the dimension of the point counts."""
    emptied(queue.boxes, 0, point)
    for d in range(len(point)):
        queue.boxes[0, d, 0], queue.boxes[0, len(point) + d, 0] = -np.inf, np.inf
    queue.front[0] = len(tree.first) - 1
    return 1


@kernel
def found_front(queue, tree, n_leaves, point, radius):
    """Make those leaves the front that lie within a distance of a point, the root if they are too many; return its length.

    Nothing that any point of a run may be closest to lies farther from one of them than its own distance and twice its
    distance from the others.
    """
    square, root = (radius * (1.0 + 1e-9)) ** 2, len(tree.first) - 1
    if root < n_leaves:
        return whole_front(queue, tree, point)
    stack, top, count, room = queue.first, 1, 0, WIDTH * (SORTED + DEPTH - 1)
    stack[0] = root
    while top > 0:
        top -= 1
        node = stack[top]
        squares(tree.boxes, node, point, queue.away, room)
        near = within(queue.away, room, square)
        while near != 0:
            k = lowest(near)
            near &= near - 1
            child = tree.first[node] + k
            if child >= n_leaves and top < len(stack):
                stack[top] = child
                top += 1
                continue
            if count == FRONT * WIDTH or child >= n_leaves:
                return whole_front(queue, tree, point)
            chunk, lane = count // WIDTH, count % WIDTH
            if lane == 0:
                emptied(queue.boxes, chunk, point)
            copied(tree.boxes, node, k, queue.boxes, chunk, lane, point)
            queue.front[count] = child
            count += 1
    return count
