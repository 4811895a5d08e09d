# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Symmetric matrices, most blocks of which are stored only once.

Block rows are divided into strips of equal length; the last strip may be shorter. A block whose row and column lie in the
same strip is stored once, in the upper triangle. A block that couples two strips is stored in both rows, so that the product
of a strip with a vector changes only entries of this strip. If each strip contains several planes of a mesh, 55 to 65 % of
all blocks are stored.

The storage is a tuple ``storage = (start, upper, columns, length)``. The stored blocks of row i are ``start[i]`` to
``start[i + 1] - 1``, `columns` contains their block columns, and `length` is the number of rows of a strip. Blocks between
strips come first, then the diagonal block, and from ``upper[i]`` on the blocks of the upper triangle; each group has
ascending columns. ``length = 0`` means that all blocks of the pattern ``indptr``, ``indices`` are stored, in its order.

Entries in double precision may be split into two numbers of single precision, whose sum has 48 of their 53 bits. Kernels
receive `entries` as a tuple of one array, or of the two arrays (high, low) if they are split. Kernels with the arguments
`low` and `high` process rows `low` to ``high - 1``.
"""

import numpy as np

from fastcontact._jit.decorators import innermost_kernel, kernel
from fastcontact.linear.multigrid.block_products import row_times, row_times_both_ways


@innermost_kernel
def strip_of(storage, i):
    """Return the first row of the strip of row i, and the row after its last one; (0, 0) if every block is stored."""
    length = storage[3]
    if length == 0:
        return 0, 0
    first = i // length * length
    return first, first + length


@innermost_kernel
def slot_of(storage, strip, i, j, k):
    """Return the slot of block (i, j), the `k`-th of the pattern, and whether its transpose is stored there.

    `strip` is ``strip_of(storage, i)``. The slot is -1 if the block is not stored, which occurs only if the pattern is not
    symmetric.
    """
    if strip[1] == 0:
        return k, False
    start, upper, columns = storage[0], storage[1], storage[2]
    if i == j:
        return upper[i] - 1, False
    if j < strip[0] or j >= strip[1]:
        row, column, low, high = i, j, start[i], upper[i] - 1
    elif j > i:
        row, column, low, high = i, j, upper[i], start[i + 1]
    else:
        row, column, low, high = j, i, upper[j], start[j + 1]
    end = high
    while low < high:
        middle = (low + high) // 2
        if columns[middle] < column:
            low = middle + 1
        else:
            high = middle
    if low == end or columns[low] != column:
        return -1, False
    return low, row != i


@innermost_kernel
def entry_of(entries, slot, a, b, size):
    """Return the entry (a, b) of a block in double precision; `slot` is the result of `slot_of`."""
    k = (slot[0] * size + b) * size + a if slot[1] else (slot[0] * size + a) * size + b
    if len(entries) == 2:
        return np.float64(entries[0][k]) + np.float64(entries[-1][k])
    return np.float64(entries[0][k])


@kernel
def _store_blocks(row, begin, end, slot, factor, block_size, high_parts, low_parts):
    """Store the high and low parts of blocks `begin` to ``end - 1`` of `row` times `factor` in successive slots."""
    shift = (slot - begin) * block_size
    for e in range(begin * block_size, end * block_size):
        number = factor * row[e]
        high_part = np.float32(number)
        high_parts[shift + e] = high_part
        low_parts[shift + e] = number - np.float64(high_part)


@kernel
def store_rows(
    begin, end, shift, max_blocks, indptr, indices, storage, factor, entries, block_size, high_parts, low_parts
):
    """Store the high and low parts of the entries of rows ``shift + begin`` to ``shift + end - 1``, times `factor`.

    Rows have up to `max_blocks` blocks of `block_size` numbers. `low_parts` may share memory with the beginning of
    `entries`, since each row is read before its memory is overwritten. Columns must ascend within each row, unless every
    block is stored.
    """
    row = np.empty(max_blocks * block_size)
    for i in range(shift + begin, shift + end):
        count = indptr[i + 1] - indptr[i]
        for e in range(count * block_size):
            row[e] = entries[indptr[i] * block_size + e]
        first, after = strip_of(storage, i)
        if after == 0:
            _store_blocks(row, 0, count, indptr[i], factor, block_size, high_parts, low_parts)
            continue
        before_strip = before_diagonal = up_to_strip = 0  # numbers of blocks
        for k in range(indptr[i], indptr[i + 1]):
            before_strip += indices[k] < first
            before_diagonal += indices[k] < i
            up_to_strip += indices[k] < after
        outside = storage[0][i]
        _store_blocks(row, 0, before_strip, outside, factor, block_size, high_parts, low_parts)
        _store_blocks(row, up_to_strip, count, outside + before_strip, factor, block_size, high_parts, low_parts)
        _store_blocks(row, before_diagonal, up_to_strip, storage[1][i] - 1, factor, block_size, high_parts, low_parts)


@kernel
def expand(low, high, indptr, indices, storage, entries, size, out):
    """Fill `out` (n_blocks * size * size,) with all blocks of the pattern, in double precision."""
    for i in range(low, high):
        strip = strip_of(storage, i)
        for k in range(indptr[i], indptr[i + 1]):
            slot = slot_of(storage, strip, i, indices[k], k)
            for a in range(size):
                for b in range(size):
                    out[(k * size + a) * size + b] = entry_of(entries, slot, a, b, size)


@kernel
def rows_of(dofs, indptr, indices, storage, entries, size, out):
    """Fill `out` with rows `dofs` (m,) of the matrix, one row after the other."""
    position = 0
    for p in range(dofs.shape[0]):
        i, a = dofs[p] // size, dofs[p] % size
        strip = strip_of(storage, i)
        for k in range(indptr[i], indptr[i + 1]):
            slot = slot_of(storage, strip, i, indices[k], k)
            for b in range(size):
                out[position] = entry_of(entries, slot, a, b, size)
                position += 1


@kernel
def absolute_product(low, high, indptr, indices, storage, entries, x, size, out):
    """Fill `out` (n,) with ``|A| |x|``, which bounds the round-off of ``A x``."""
    for i in range(low, high):
        strip = strip_of(storage, i)
        for a in range(size):
            out[i * size + a] = 0.0
        for k in range(indptr[i], indptr[i + 1]):
            slot = slot_of(storage, strip, i, indices[k], k)
            for a in range(size):
                for b in range(size):
                    out[i * size + a] += abs(entry_of(entries, slot, a, b, size) * x[indices[k] * size + b])


@kernel
def _multiply_strip(low, high, storage, entries, x, factor, z_factor, z, y, rows):
    """Fill the rows `low` to ``high - 1`` of y, which form one strip; see `multiply`."""
    start, upper, columns = storage[0], storage[1], storage[2]
    m = len(rows)
    for i in range(m * low, m * high):
        y[i] = z_factor * z[i] if z_factor != 0.0 else z_factor
    for i in range(low, high):
        stored_twice = row_times(columns, entries, x, start[i], upper[i], rows, rows)
        stored_once = row_times_both_ways(columns, entries, x, upper[i], start[i + 1], i, factor, y, rows)
        for r in range(m):
            y[m * i + r] += factor * (stored_twice[r] + stored_once[r])


@kernel
def multiply(low, high, storage, entries, x, factor, z_factor, z, y, rows):
    """Fill strips `low` to ``high - 1`` of `y` (n,) with ``z_factor z + factor A x``; y may be z, but not x.

    Each strip is processed by one thread, so that every entry of y is summed in a fixed order.
    """
    n, length = y.shape[0] // len(rows), storage[3]
    for p in range(low, high):
        _multiply_strip(p * length, min(n, (p + 1) * length), storage, entries, x, factor, z_factor, z, y, rows)
