# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Factors D and G of a symmetric update ``D.T G + G.T D``, restricted and multiplied.

Sparse rows are given by ``indptr`` and ``indices``, in any order, and numbers. Restricted rows have a block of ``len(cols)``
numbers for each coarse node. Kernels with `low` and `high` compute these rows of a result, each in a fixed order.
"""

import numpy as np

from fastcontact._jit.decorators import kernel
from fastcontact.linear.multigrid.block_products import add_product, add_transposed


@kernel
def diagonal(indptr, indices, data, low, columns, values, slot, size, out):
    """Add the diagonal blocks of ``D.T G + G.T D`` to `out` (n_blocks * size * size,).

    D is given by `indptr`, `indices`, `data`, G by `low`, `columns`, `values`; `slot` (n_nodes,) is the number of the block
    of each node in `out`.
    """
    sums = np.zeros(slot.shape[0] * size)
    for p in range(indptr.shape[0] - 1):
        for e in range(low[p], low[p + 1]):
            sums[columns[e]] = values[e]
        for e in range(indptr[p], indptr[p + 1]):
            node, a = indices[e] // size, indices[e] % size
            block = slot[node] * size * size
            for b in range(size):
                part = data[e] * sums[node * size + b]
                out[block + a * size + b] += part
                out[block + b * size + a] += part
        for e in range(low[p], low[p + 1]):
            sums[columns[e]] = 0.0


@kernel
def count_restricted(low, high, indptr, indices, start, columns, size, n_coarse, count):
    """Fill `count` (n_rows,) with the number of coarse nodes of rows restricted by the prolongator `start`, `columns`."""
    seen = np.full(n_coarse, -1, np.int32)
    for row in range(low, high):
        n_columns = 0
        for e in range(indptr[row], indptr[row + 1]):
            i = indices[e] // size
            for k in range(start[i], start[i + 1]):
                if seen[columns[k]] != row:
                    seen[columns[k]] = row
                    n_columns += 1
        count[row] = n_columns


@kernel
def restrict(low, high, indptr, indices, data, start, columns, P, size, n_coarse, into, nodes, out, cols):
    """Fill the products of rows with a prolongator: coarse nodes `nodes` (n_blocks,) and their blocks `out`.

    `into` (n_rows + 1,) are the row pointers of the result, `out` holds zeros.
    """
    width = len(cols)
    seen, column_slot = np.full(n_coarse, -1, np.int32), np.empty(n_coarse, np.int32)
    for row in range(low, high):
        at = into[row]
        for e in range(indptr[row], indptr[row + 1]):
            i, a = indices[e] // size, indices[e] % size
            for k in range(start[i], start[i + 1]):
                J = columns[k]
                if seen[J] != row:
                    seen[J], column_slot[J], nodes[at] = row, at, J
                    at += 1
                add_product(out, column_slot[J] * width, (data,), e, P, (k * size + a) * width, ((0,), (0,), cols))


@kernel
def count_products(low, high, start, origin, rows, nodes, n_coarse, count):
    """Fill `count` (n_rows,) with the number of blocks in each block row of `products`."""
    seen = np.full(n_coarse, -1, np.int32)
    for row in range(low, high):
        number = 0
        for e in range(start[row], start[row + 1]):
            for k in range(rows[origin[e]], rows[origin[e] + 1]):
                if seen[nodes[k]] != row:
                    seen[nodes[k]] = row
                    number += 1
        count[row] = number


@kernel
def products(low, high, start, origin, slot, E, rows, nodes, H, n_coarse, into, columns, out, cols):
    """Fill block rows of ``E.T H``: columns, ascending, and blocks.

    E is given by block columns, with `start` (n_rows + 1,) and the row `origin` and block `slot` of each entry, and H by
    rows, with `rows`, `nodes` and numbers. `into` (n_rows + 1,) are the row pointers of the result; `out` initially contains
    zeros.
    """
    width = len(cols)
    seen, column_slot = np.full(n_coarse, -1, np.int32), np.empty(n_coarse, np.int32)
    for row in range(low, high):
        at = into[row]
        for e in range(start[row], start[row + 1]):
            for k in range(rows[origin[e]], rows[origin[e] + 1]):
                if seen[nodes[k]] != row:
                    seen[nodes[k]], columns[at] = row, nodes[k]
                    at += 1
        columns[into[row] : at].sort()
        for k in range(into[row], at):
            column_slot[columns[k]] = k
        for e in range(start[row], start[row + 1]):
            for k in range(rows[origin[e]], rows[origin[e] + 1]):
                to = column_slot[nodes[k]] * width * width
                add_transposed(out, to, (E,), slot[e] * width, H, k * width, (cols, (0,), cols))
