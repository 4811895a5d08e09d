# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""A tree of boxes over facets in the order of a space-filling curve: the broad phase of the closest-facet searches.

Points sorted by the interleaved bits of their coordinates (Morton, 1966) lie near their neighbours in the list. Of facets in
this order, each `WIDTH` in turn make a leaf, each `WIDTH` leaves a node above, and so on up to one root. ``boxes``
(n_nodes, 2 dim, WIDTH) holds, for every node, the boxes of what is in it, low sides before high sides, so that the
distances to all of them are one short loop; missing ones are infinitely far. ``first`` (n_nodes,) is the number of the first
child, and at the leaves, which come first, the position of the first facet; the root comes last.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fastcontact._jit.decorators import kernel
from fastcontact.contact.search.eight_boxes_llvm import WIDTH

# Sorting takes three or four passes over digits of so many bits.
DIGIT, PASSES = 12, 4
BLOCK = 256


class Tree(NamedTuple):
    """What is in the nodes: boxes (n_nodes, 2 dim, WIDTH), and the number of the first (n_nodes,)."""

    boxes: NDArray[np.float64]
    first: NDArray[np.int64]


@kernel
def leaves(n):
    """Return the number of nodes that hold `n` facets or nodes."""
    return (n + WIDTH - 1) // WIDTH


@kernel
def _spread_by_two(k):
    """Return the lowest 24 bits of `k` with a gap of one bit after each."""
    k = (k | (k << np.uint64(16))) & np.uint64(0x0000FFFF0000FFFF)
    k = (k | (k << np.uint64(8))) & np.uint64(0x00FF00FF00FF00FF)
    k = (k | (k << np.uint64(4))) & np.uint64(0x0F0F0F0F0F0F0F0F)
    k = (k | (k << np.uint64(2))) & np.uint64(0x3333333333333333)
    return (k | (k << np.uint64(1))) & np.uint64(0x5555555555555555)


@kernel
def _spread_by_three(k):
    """Return the lowest 16 bits of `k` with a gap of two bits after each."""
    k = (k | (k << np.uint64(32))) & np.uint64(0x001F00000000FFFF)
    k = (k | (k << np.uint64(16))) & np.uint64(0x001F0000FF0000FF)
    k = (k | (k << np.uint64(8))) & np.uint64(0x100F00F00F00F00F)
    k = (k | (k << np.uint64(4))) & np.uint64(0x10C30C30C30C30C3)
    return (k | (k << np.uint64(2))) & np.uint64(0x1249249249249249)


@kernel
def _cell(value, low, scale, most):
    """Return the number of the cell that holds a coordinate; what is outside, or no number, counts to the ends."""
    k = (value - low) * scale
    if not k > 0.0:
        return np.uint32(0)
    return np.uint32(min(k, most))


@kernel
def _transposed(x, bits):
    """Turn cell numbers (dim, n) in place into those whose interleaved bits tell the place on a Hilbert curve.

    By exchange and inversion of lower bits, from the highest bit down (Skilling, 2004).
    """
    dim, n = x.shape
    one, first, turn = np.uint32(1), x[0], np.zeros(n, np.uint32)
    for bit in range(bits - 1, 0, -1):
        shift = np.uint32(bit)
        below = (one << shift) - one
        for i in range(n):  # where the bit is set, invert the lower bits of the first number
            first[i] ^= below * ((first[i] >> shift) & one)
        for d in range(1, dim):
            other = x[d]
            for i in range(n):  # the same, and where it is not, exchange them with those of this one
                present = below * ((other[i] >> shift) & one)
                change = (first[i] ^ other[i]) & (below ^ present)
                first[i] ^= change | present
                other[i] ^= change
    for d in range(1, dim):
        other, previous = x[d], x[d - 1]
        for i in range(n):
            other[i] ^= previous[i]
    last = x[dim - 1]
    for bit in range(bits - 1, 0, -1):
        shift = np.uint32(bit)
        below = (one << shift) - one
        for i in range(n):
            turn[i] ^= below * ((last[i] >> shift) & one)
    for d in range(dim):
        other = x[d]
        for i in range(n):
            other[i] ^= turn[i]


@kernel
def curve_order(points, low, high):
    """Return the permutation (n,) that sorts `points` (n, dim) along a Hilbert curve through the cube at `low`.

    The side of the cube is the largest of ``high - low`` (dim,); it is cut into 2^24 cells in 2D, 2^16 in 3D.
    """
    n, dim = points.shape
    side = 0.0
    for d in range(dim):
        side = max(side, high[d] - low[d])
    bits = 24 if dim == 2 else 16
    most = 2.0**bits - 1.0
    scale = most / side if side > 0.0 else 0.0
    keys, x = np.empty(n, np.uint64), np.zeros((dim, BLOCK), np.uint32)
    for begin in range(0, n, BLOCK):
        count = min(BLOCK, n - begin)
        for i in range(count):
            for d in range(dim):
                x[d, i] = _cell(points[begin + i, d], low[d], scale, most)
        _transposed(x, bits)
        for i in range(count):
            if dim == 2:
                k = (_spread_by_two(np.uint64(x[0, i])) << np.uint64(1)) | _spread_by_two(np.uint64(x[1, i]))
            else:
                k = (
                    (_spread_by_three(np.uint64(x[0, i])) << np.uint64(2))
                    | (_spread_by_three(np.uint64(x[1, i])) << np.uint64(1))
                    | _spread_by_three(np.uint64(x[2, i]))
                )
            keys[begin + i] = k
    return _sorted(keys)


@kernel
def _sorted(keys):
    """Return the stable permutation that sorts keys of 48 bits (n,), which are overwritten: counting sort by digits."""
    n, size = keys.shape[0], 1 << DIGIT
    mask = np.uint64(size - 1)
    count = np.zeros((PASSES, size), np.int64)
    for i in range(n):
        for k in range(PASSES):
            count[k, (keys[i] >> np.uint64(DIGIT * k)) & mask] += 1
    order, other, spare = np.arange(n), np.empty(n, np.int64), np.empty(n, np.uint64)
    for k in range(PASSES):
        place, shift = count[k], np.uint64(DIGIT * k)
        if n == 0 or place[(keys[0] >> shift) & mask] == n:  # all alike
            continue
        total = 0
        for digit in range(size):
            here = place[digit]
            place[digit] = total
            total += here
        for i in range(n):
            digit = (keys[i] >> shift) & mask
            spare[place[digit]], other[place[digit]] = keys[i], order[i]
            place[digit] += 1
        keys, spare, order, other = spare, keys, other, order
    return order


@kernel
def pack(low, high):
    """Return (boxes, first) of a tree over the boxes (n, dim) of facets in the order of the curve."""
    n, dim = low.shape
    count, level = 0, n
    while count == 0 or level > 1:
        level = max(leaves(level), 1)
        count += level
    boxes, first = np.empty((count, 2 * dim, WIDTH)), np.empty(count, np.int64)
    boxes[:, :dim] = np.inf
    boxes[:, dim:] = -np.inf
    n_leaves = max(leaves(n), 1)
    for node in range(n_leaves):
        first[node] = node * WIDTH
        for k in range(min(WIDTH, n - node * WIDTH)):
            for d in range(dim):
                boxes[node, d, k], boxes[node, dim + d, k] = low[node * WIDTH + k, d], high[node * WIDTH + k, d]
    begin, end, node = 0, n_leaves, n_leaves
    while node < count:
        for start in range(begin, end, WIDTH):
            first[node] = start
            for k in range(min(WIDTH, end - start)):
                for d in range(dim):
                    a, b = np.inf, -np.inf
                    for child in range(WIDTH):
                        a, b = min(a, boxes[start + k, d, child]), max(b, boxes[start + k, dim + d, child])
                    boxes[node, d, k], boxes[node, dim + d, k] = a, b
            node += 1
        begin, end = end, node
    return Tree(boxes, first)
