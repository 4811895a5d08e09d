"""Distances from a point to the eight boxes of a node at once, in the vectors of the processor.

Of a loop over the eight the compiler makes branches that no processor foresees, and checks at each node whether arrays
overlap: that took longer than all the rest of a search. Indices are not checked here.
"""

from __future__ import annotations

from typing import Any

import numba.extending
import numpy as np

from fastcontact._jit import compiled

WIDTH = 8


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


def _squares(_context: Any, boxes: Any, node: Any, point: Any, away: Any, begin: Any) -> Any:
    from numba.core import types

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        dim, start = len(signature.args[2]), _start(context, builder, signature, args, 0)
        first = builder.mul(args[1], args[1].type(2 * dim * WIDTH))

        def side(k: int) -> Any:
            return builder.load(_eight(builder, start, builder.add(first, first.type(k * WIDTH))), align=8)

        total = None
        for d in range(dim):
            here = _everywhere(builder, builder.extract_value(args[2], d))
            out = _chosen(builder, ">", builder.fsub(side(d), here), builder.fsub(here, side(dim + d)))
            out = _chosen(builder, ">", out, out.type([0.0] * WIDTH))
            square = builder.fmul(out, out, flags=("contract",))
            total = square if total is None else builder.fadd(total, square, flags=("contract",))
        builder.store(total, _eight(builder, _start(context, builder, signature, args, 3), args[4]), align=8)
        return _least(builder, total)

    return types.float64(boxes, types.intp, point, away, types.intp), code


def _within(_context: Any, away: Any, begin: Any, reach: Any) -> Any:
    from numba.core import types

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        from llvmlite import ir

        squares = builder.load(_eight(builder, _start(context, builder, signature, args, 0), args[1]), align=8)
        bits = builder.bitcast(builder.fcmp_ordered("<=", squares, _everywhere(builder, args[2])), ir.IntType(WIDTH))
        return builder.zext(bits, ir.IntType(64))

    return types.int64(away, types.intp, types.float64), code


def _without(_context: Any, away: Any, begin: Any, k: Any) -> Any:
    from numba.core import types

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        from llvmlite import ir

        where = _eight(builder, _start(context, builder, signature, args, 0), args[1])
        squares, lane = builder.load(where, align=8), ir.IntType(32)
        here = _everywhere(builder, builder.trunc(args[2], lane))
        here = builder.icmp_unsigned("==", here, here.type(list(range(WIDTH))))
        squares = builder.select(here, squares.type([np.inf] * WIDTH), squares)
        builder.store(squares, where, align=8)
        return _least(builder, squares)

    return types.float64(away, types.intp, types.intp), code


def _emptied(_context: Any, boxes: Any, node: Any, point: Any) -> Any:
    from numba.core import types

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        from llvmlite import ir

        dim, start = len(signature.args[2]), _start(context, builder, signature, args, 0)
        first, vector = builder.mul(args[1], args[1].type(2 * dim * WIDTH)), ir.VectorType(ir.DoubleType(), WIDTH)
        for d in range(2 * dim):
            nowhere = vector([np.inf if d < dim else -np.inf] * WIDTH)
            builder.store(nowhere, _eight(builder, start, builder.add(first, first.type(d * WIDTH))), align=8)
        return context.get_dummy_value()

    return types.none(boxes, types.intp, point), code


def _copied(_context: Any, boxes: Any, node: Any, k: Any, others: Any, other: Any, at: Any, point: Any) -> Any:
    from numba.core import types

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        sides, number = 2 * len(signature.args[6]), args[1].type

        def side(array: int, d: int) -> Any:
            first = builder.mul(args[array + 1], number(sides * WIDTH))
            index = builder.add(builder.add(first, args[array + 2]), number(d * WIDTH))
            return builder.gep(_start(context, builder, signature, args, array), [index])

        for d in range(sides):
            builder.store(builder.load(side(0, d)), side(3, d))
        return context.get_dummy_value()

    return types.none(boxes, types.intp, types.intp, others, types.intp, types.intp, point), code


def _lowest(_context: Any, bits: Any) -> Any:
    from numba.core import types

    def code(_context: Any, builder: Any, _signature: Any, args: Any) -> Any:
        from llvmlite import ir

        return builder.cttz(args[0], ir.IntType(1)(0))

    return types.int64(types.int64), code


def _start(context: Any, builder: Any, signature: Any, args: Any, k: int) -> Any:
    """Return the address of the first element of the array that argument `k` is."""
    from numba.np.arrayobj import make_array

    return make_array(signature.args[k])(context, builder, args[k]).data


def _eight(builder: Any, start: Any, offset: Any) -> Any:
    """Return the address of eight numbers that begin with number `offset`."""
    from llvmlite import ir

    return builder.bitcast(builder.gep(start, [offset]), ir.VectorType(ir.DoubleType(), WIDTH).as_pointer())


def _everywhere(builder: Any, number: Any) -> Any:
    """Return a vector with the same number eight times."""
    from llvmlite import ir

    vector, index = ir.VectorType(number.type, WIDTH), ir.IntType(32)
    one = builder.insert_element(ir.Constant(vector, ir.Undefined), number, index(0))
    return builder.shuffle_vector(one, one, ir.Constant(ir.VectorType(index, WIDTH), [0] * WIDTH))


def _chosen(builder: Any, sign: str, one: Any, other: Any) -> Any:
    """Return the numbers of one vector where it is larger or smaller than the other's, else the other's."""
    return builder.select(builder.fcmp_ordered(sign, one, other), one, other)


def _least(builder: Any, numbers: Any) -> Any:
    """Return the least number of a vector: that of its halves, and so on."""
    from llvmlite import ir

    index = ir.IntType(32)
    for half in (4, 2, 1):
        lanes = ir.VectorType(index, half)
        low, high = ir.Constant(lanes, list(range(half))), ir.Constant(lanes, list(range(half, 2 * half)))
        numbers = _chosen(
            builder,
            "<",
            builder.shuffle_vector(numbers, numbers, low),
            builder.shuffle_vector(numbers, numbers, high),
        )
    return builder.extract_element(numbers, index(0))


# Fills the squared distances away[begin : begin + WIDTH] from a point, a tuple of numbers, to the boxes[node]
# (2 dim, WIDTH), low sides first, and returns the least.
squares = numba.extending.intrinsic(_squares) if compiled() else squares_one_by_one
# Returns a number whose bit k tells whether away[begin + k] is not larger than `reach`.
within = numba.extending.intrinsic(_within) if compiled() else within_one_by_one
# Makes away[begin + k] infinite, and returns the least of away[begin : begin + WIDTH].
without = numba.extending.intrinsic(_without) if compiled() else without_one_by_one
# Puts all of boxes[node] infinitely far away; only the dimension of the point counts.
emptied = numba.extending.intrinsic(_emptied) if compiled() else emptied_one_by_one
# Copies the box boxes[node, :, k] to others[other, :, at]; only the dimension of the point counts.
copied = numba.extending.intrinsic(_copied) if compiled() else copied_one_by_one
# Returns the number of the lowest bit set.
lowest = numba.extending.intrinsic(_lowest) if compiled() else lowest_one_by_one
