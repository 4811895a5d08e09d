"""Numba intrinsics for `block_products`, which generate LLVM code while Numba compiles a kernel.

Each public function implements the function with the same name in `block_products`. Numba calls it during compilation with
the types of the arguments. The function returns the signature and a code generator.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from llvmlite import ir
from numba.core import cgutils, types

# Vector length: most processors have vectors of four numbers in double precision, and blocks have three or six columns.
WIDTH = 4


class Piece(NamedTuple):
    """A part of a row of a block: `used` numbers, beginning at `column`, that are loaded as a vector of `width` numbers."""

    column: int
    width: int
    used: int


def row_times(_context: Any, indices: Any, entries: Any, x: Any, begin: Any, end: Any, rows: Any, cols: Any) -> Any:
    """Return the signature and the code generator of `block_products.row_times`."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return _all_blocks(_Row(context, builder, signature, args, len(rows), len(cols)), signature, args)

    sums = types.UniTuple(x.dtype, len(rows))
    return sums(indices, entries, x, types.intp, types.intp, rows, cols), code


def row_times_both_ways(
    _context: Any, indices: Any, entries: Any, x: Any, begin: Any, end: Any, row: Any, factor: Any, y: Any, rows: Any
) -> Any:
    """Return the signature and the code generator of `block_products.row_times_both_ways`."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return _all_blocks(_RowBothWays(context, builder, signature, args, len(rows), len(rows)), signature, args)

    sums = types.UniTuple(x.dtype, len(rows))
    return sums(indices, entries, x, types.intp, types.intp, types.intp, x.dtype, y, rows), code


def _all_blocks(row: _Row, signature: Any, args: Any) -> Any:
    """Generate the loop over the blocks of a row, from ``args[3]`` to ``args[4]``, and return its sums."""
    step = args[3].type(1)
    with cgutils.for_range_slice(row.builder, args[3], args[4], step, args[3].type, inc=True) as (k, _):
        row.add_block(k)
    return row.context.make_tuple(row.builder, signature.return_type, row.sums())


def add_product(_context: Any, out: Any, at: Any, left: Any, first: Any, right: Any, second: Any, sizes: Any) -> Any:
    """Return the signature and the code generator of `block_products.add_product`."""
    return _product_adder(lambda r, t, _m, k: r * k + t, out, left, right, sizes)


def add_transposed(_context: Any, out: Any, at: Any, left: Any, first: Any, right: Any, second: Any, sizes: Any) -> Any:
    """Return the signature and the code generator of `block_products.add_transposed`."""
    return _product_adder(lambda r, t, m, _k: t * m + r, out, left, right, sizes)


def _product_adder(index: Callable[[int, int, int, int], int], to: Any, left: Any, right: Any, sizes: Any) -> Any:
    """Return the signature and the code generator of a function that adds a product.

    ``index(row, inner, m, k)`` is the position of an entry in the left factor.
    """

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        m, k, n = (len(size) for size in sizes)
        write, pieces = _Writer(context, builder, signature.args[0].dtype), _pieces(n)
        out, right = (write.start(signature.args[number], args[number]) for number in (0, 4))
        left = write.starts(signature.args[2], args[2])
        rows_of_right = [[write.load([right], args[5], t * n + p.column, p.width) for p in pieces] for t in range(k)]
        for r in range(m):
            factors = [write.load(left, args[3], index(r, t, m, k), 1) for t in range(k)]
            for p, piece in enumerate(pieces):
                total = write.load([out], args[1], r * n + piece.column, piece.width)
                for t in range(k):
                    total = write.multiply_add(total, write.broadcast(factors[t], piece.width), rows_of_right[t][p])
                builder.store(total, write.address(out, args[1], r * n + piece.column, piece.width), align=8)
        return context.get_dummy_value()

    return types.none(to, types.intp, left, types.intp, right, types.intp, sizes), code


class _Writer:
    """Generator of vector loads and operations in the precision `kind`."""

    def __init__(self, context: Any, builder: Any, kind: Any) -> None:
        self.context, self.builder = context, builder
        self.real, self.lane = context.get_value_type(kind), ir.IntType(32)
        triple, _, features = context.codegen().magic_tuple()
        self.fused = "+fma" in features.split(",") or triple.startswith(("aarch64", "arm64"))

    def start(self, kind: Any, array: Any) -> Any:
        """Return the address of the first number of an array."""
        from numba.np.arrayobj import make_array

        return make_array(kind)(self.context, self.builder, array).data

    def starts(self, kinds: Any, arrays: Any) -> list[Any]:
        """Return the addresses of the first numbers of a tuple of arrays."""
        return [self.start(kind, self.builder.extract_value(arrays, k)) for k, kind in enumerate(kinds)]

    def address(self, start: Any, at: Any, column: int, width: int) -> Any:
        """Return the address of the vector that begins at number ``at + column``."""
        first = self.builder.gep(start, [self.builder.add(at, at.type(column))])
        return self.builder.bitcast(first, self.kind(start.type.pointee, width).as_pointer())

    def load(self, starts: list[Any], at: Any, column: int, width: int) -> Any:
        """Return the vector that begins at number ``at + column``; high and low parts of split numbers are added."""
        parts = [
            self.builder.load(
                self.address(start, at, column, width), align=4 if start.type.pointee == ir.FloatType() else 8
            )
            for start in starts
        ]
        if parts[0].type != self.kind(self.real, width):
            parts = [self.builder.fpext(part, self.kind(self.real, width)) for part in parts]
        return parts[0] if len(parts) == 1 else self.builder.fadd(*parts)

    def multiply_add(self, total: Any, a: Any, b: Any) -> Any:
        """Return ``total + a * b``, as a fused multiply-add if the processor has one.

        If the decision were left to the compiler, it would depend on the surrounding code, and the results of copies of a
        kernel would differ in the last bit.
        """
        if not self.fused:
            return self.builder.fadd(total, self.builder.fmul(a, b))
        kind = total.type
        suffix = "f32" if self.real == ir.FloatType() else "f64"
        name = f"llvm.fma.{suffix}" if kind == self.real else f"llvm.fma.v{kind.count}{suffix}"
        module = self.builder.module
        function = module.globals.get(name) or ir.Function(module, ir.FunctionType(kind, [kind] * 3), name)
        return self.builder.call(function, [a, b, total])

    def add(self, start: Any, at: Any, column: int, width: int, vector: Any) -> None:
        """Add a vector to the numbers in memory that begin at number ``at + column``."""
        total = self.builder.fadd(self.load([start], at, column, width), vector)
        align = 4 if str(self.real) == "float" else 8
        self.builder.store(total, self.address(start, at, column, width), align=align)

    def broadcast(self, number: Any, width: int) -> Any:
        """Return a vector with `number` in all lanes."""
        if width == 1:
            return number
        undefined = ir.Constant(ir.VectorType(number.type, width), ir.Undefined)
        return self.shuffle(self.builder.insert_element(undefined, number, self.lane(0)), [0] * width)

    def shuffle(self, vector: Any, lanes: list[int]) -> Any:
        """Return the vector that consists of the given `lanes` of `vector`."""
        order = ir.Constant(ir.VectorType(self.lane, len(lanes)), lanes)
        return self.builder.shuffle_vector(vector, vector, order)

    def kind(self, number: Any, width: int) -> Any:
        """Return the type of a vector of `width` numbers."""
        return number if width == 1 else ir.VectorType(number, width)

    def zeros(self, width: int) -> Any:
        """Return a vector of zeros."""
        return ir.Constant(self.kind(self.real, width), 0.0 if width == 1 else [0.0] * width)


class _Row(_Writer):
    """Generator of the body of the loop over the blocks of a row, with a sum for each row of the blocks and each vector lane.

    In blocks with three columns, a vector of four numbers also contains a neighbour of the row. This is the number after the
    row or, in the last row of a block, the number before it, so that no memory outside the block is read.
    """

    def __init__(self, context: Any, builder: Any, signature: Any, args: Any, m: int, n: int) -> None:
        super().__init__(context, builder, signature.args[2].dtype)
        self.offset = args[3].type
        self.m, self.n = m, n
        self.indices, self.x = (self.start(signature.args[k], args[k]) for k in (0, 2))
        self.data = self.starts(signature.args[1], args[1])
        self.shifted = self.n == 3 and self.m > 1
        self.pieces = [Piece(0, WIDTH, 3)] if self.shifted else _pieces(self.n)
        zeros = [self.zeros(piece.width) for piece in self.pieces]
        self.totals = [[cgutils.alloca_once_value(builder, zero) for zero in zeros] for _ in range(self.m)]

    def add_block(self, k: Any) -> None:
        """Add the product of block `k` with its part of x."""
        builder, m, n = self.builder, self.m, self.n
        column = builder.load(builder.gep(self.indices, [k]))
        if column.type != self.offset:
            column = builder.sext(column, self.offset)
        j = builder.mul(column, self.offset(n))
        at = builder.mul(k, self.offset(m * n))
        x_j = self._triple(j) if self.shifted else [self.load([self.x], j, p.column, p.width) for p in self.pieces]
        x_of_last = [self.shuffle(x_j[0], [0, 0, 1, 2])] if self.shifted else x_j
        for r in range(m):
            last = self.shifted and r == m - 1
            inputs = x_of_last if last else x_j
            for p, (piece, total, x) in enumerate(zip(self.pieces, self.totals[r], inputs, strict=True)):
                vector = self.load(self.data, at, r * n + piece.column - last, piece.width)
                builder.store(self.multiply_add(builder.load(total), vector, x), total)
                self.process(r, p, vector, last)
        self.finish(j)

    def process(self, r: int, p: int, vector: Any, last: bool) -> None:
        """Process the numbers of row r and piece p of a block; `last` is true if they begin one number before the row."""

    def finish(self, j: Any) -> None:
        """Finish a block whose first column is j."""

    def sums(self) -> list[Any]:
        """Return the sum for each row of the blocks."""
        return [self._sum(totals, int(self.shifted and r == self.m - 1)) for r, totals in enumerate(self.totals)]

    def _sum(self, totals: list[Any], first: int) -> Any:
        """Return the sum of the used lanes, which begin at lane `first`."""
        lanes = []
        for piece, total in zip(self.pieces, totals, strict=True):
            vector = self.builder.load(total)
            if piece.width == 1:
                lanes.append(vector)
            else:
                lanes += [self.builder.extract_element(vector, self.lane(first + c)) for c in range(piece.used)]
        partial = lanes[0]
        for lane in lanes[1:]:
            partial = self.builder.fadd(partial, lane)
        return partial

    def _triple(self, j: Any) -> list[Any]:
        """Return the three numbers of x from j on and an arbitrary fourth one, without reading beyond them."""
        pair = self.shuffle(self.load([self.x], j, 0, 2), [0, 1, 0, 1])
        return [self.builder.insert_element(pair, self.load([self.x], j, 2, 1), self.lane(2))]


class _RowBothWays(_Row):
    """Generator like `_Row` that also adds `factor` times the products of the transposed blocks with x to y."""

    def __init__(self, context: Any, builder: Any, signature: Any, args: Any, m: int, n: int) -> None:
        super().__init__(context, builder, signature, args, m, n)
        self.y = self.start(signature.args[7], args[7])
        first = builder.mul(args[5], self.offset(n))
        self.x_of_row = [builder.fmul(args[6], self.load([self.x], first, r, 1)) for r in range(m)]
        self.added: list[Any] = []

    def process(self, r: int, p: int, vector: Any, last: bool) -> None:
        """Add row r of the block, times `factor` and the entry of x in row r of the block row."""
        if last:
            vector = self.shuffle(vector, [1, 2, 3, 3])
        width = self.pieces[p].width
        if r == 0:
            self.added.append(self.zeros(width))
        self.added[p] = self.multiply_add(self.added[p], vector, self.broadcast(self.x_of_row[r], width))

    def finish(self, j: Any) -> None:
        """Add the sums to y, without touching other entries."""
        for piece, vector in zip(self.pieces, self.added, strict=True):
            if piece.used == piece.width:
                self.add(self.y, j, piece.column, piece.width, vector)
            else:
                self.add(self.y, j, piece.column, 2, self.shuffle(vector, [0, 1]))
                self.add(self.y, j, piece.column + 2, 1, self.builder.extract_element(vector, self.lane(2)))
        self.added = []


def _pieces(n: int) -> list[Piece]:
    """Return the pieces of n columns: full vectors, then a half vector, then a single number."""
    pieces, column = [], 0
    for width in (WIDTH, WIDTH // 2, 1):
        while n - column >= width:
            pieces.append(Piece(column, width, width))
            column += width
    return pieces
