"""Distances from a point to the eight boxes of a node at once, in the vectors of the processor.

Of a loop over the eight the compiler makes branches that no processor foresees, and checks at each node whether arrays
overlap: that took longer than all the rest of a search. Indices are not checked here.
"""

from __future__ import annotations

from typing import Any

import numba.extending
import numpy as np

from fastcontact._jit.decorators import compiled
from fastcontact.contact.search import eight_boxes_llvm
from fastcontact.contact.search.eight_boxes_llvm import WIDTH


def squares_one_by_one(boxes: Any, node: int, point: Any, away: Any, begin: int) -> float:
    """Return what `squares` does, in NumPy."""
    low, high = np.split(boxes[node], 2)
    here = np.array(point)[:, None]
    out = np.fmax(np.fmax(low - here, here - high), 0.0)
    away[begin : begin + WIDTH] = (out * out).sum(axis=0)
    return float(away[begin : begin + WIDTH].min())


def within_one_by_one(away: Any, begin: int, reach: float) -> int:
    """Return what `within` does, in NumPy."""
    return int((away[begin : begin + WIDTH] <= reach) @ (1 << np.arange(WIDTH)))


def without_one_by_one(away: Any, begin: int, k: int) -> float:
    """Return what `without` does, in NumPy."""
    away[begin + k] = np.inf
    return float(away[begin : begin + WIDTH].min())


def lowest_one_by_one(bits: int) -> int:
    """Return what `lowest` does, in Python."""
    return (bits & -bits).bit_length() - 1


def emptied_one_by_one(boxes: Any, node: int, _point: Any) -> None:
    """Do what `emptied` does, in NumPy."""
    dim = boxes.shape[1] // 2
    boxes[node, :dim], boxes[node, dim:] = np.inf, -np.inf


def copied_one_by_one(boxes: Any, node: int, k: int, others: Any, other: int, at: int, _point: Any) -> None:
    """Do what `copied` does, in NumPy."""
    others[other, :, at] = boxes[node, :, k]


# Fills the squared distances away[begin : begin + WIDTH] from a point, a tuple of numbers, to the boxes[node]
# (2 dim, WIDTH), low sides first, and returns the least.
squares = numba.extending.intrinsic(eight_boxes_llvm.squares) if compiled() else squares_one_by_one
# Returns a number whose bit k tells whether away[begin + k] is not larger than `reach`.
within = numba.extending.intrinsic(eight_boxes_llvm.within) if compiled() else within_one_by_one
# Makes away[begin + k] infinite, and returns the least of away[begin : begin + WIDTH].
without = numba.extending.intrinsic(eight_boxes_llvm.without) if compiled() else without_one_by_one
# Puts all of boxes[node] infinitely far away; only the dimension of the point counts.
emptied = numba.extending.intrinsic(eight_boxes_llvm.emptied) if compiled() else emptied_one_by_one
# Copies the box boxes[node, :, k] to others[other, :, at]; only the dimension of the point counts.
copied = numba.extending.intrinsic(eight_boxes_llvm.copied) if compiled() else copied_one_by_one
# Returns the number of the lowest bit set.
lowest = numba.extending.intrinsic(eight_boxes_llvm.lowest) if compiled() else lowest_one_by_one
