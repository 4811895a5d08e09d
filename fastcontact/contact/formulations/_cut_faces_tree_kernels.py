# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""A tree of bounding boxes over facets in any dimension: the broad phase of the closest-facet searches.

A tree is five arrays: ``low``, ``high`` (n_boxes, dim), ``child`` (n_boxes,) number of the left child (the right one
follows it) or -1 at leaves, ``span`` (n_boxes, 2) range in ``order``, the facets sorted so that a box owns a range.
"""

import numpy as np

from fastcontact._jit.decorators import kernel

LEAF = 4


@kernel
def build(box_low, box_high):
    """Return (low, high, child, span, order) of a median-split tree over facet boxes (n, dim), built in O(n log n)."""
    n, dim = box_low.shape
    centre = 0.5 * (box_low + box_high)
    capacity = 2 * n + 1
    low, high = np.empty((capacity, dim)), np.empty((capacity, dim))
    child = np.full(capacity, -1, np.int64)
    span = np.zeros((capacity, 2), np.int64)
    order = np.arange(n)
    span[0, 1] = n
    count, box = 1, 0
    while box < count:
        begin, end = span[box, 0], span[box, 1]
        axis, widest = 0, -1.0
        for d in range(dim):
            a, b = np.inf, -np.inf
            for k in range(begin, end):
                a = min(a, box_low[order[k], d])
                b = max(b, box_high[order[k], d])
            low[box, d], high[box, d] = a, b
            if b - a > widest:
                axis, widest = d, b - a
        if end - begin > LEAF:
            middle = (begin + end) // 2
            _split(order, centre, axis, begin, end, middle)
            child[box] = count
            span[count, 0], span[count, 1] = begin, middle
            span[count + 1, 0], span[count + 1, 1] = middle, end
            count += 2
        box += 1
    return low[:count], high[:count], child[:count], span[:count], order


@kernel
def _split(order, centre, axis, begin, end, middle):
    """Permute ``order[begin:end]`` in place so that no centre before `middle` exceeds one from there on (Hoare, 1961)."""
    first, last = begin, end - 1
    while first < last:
        pivot = centre[order[(first + last) // 2], axis]
        i, j = first, last
        while i <= j:
            while centre[order[i], axis] < pivot:
                i += 1
            while centre[order[j], axis] > pivot:
                j -= 1
            if i <= j:
                order[i], order[j] = order[j], order[i]
                i += 1
                j -= 1
        if middle <= j:
            last = j
        elif middle >= i:
            first = i
        else:
            return
