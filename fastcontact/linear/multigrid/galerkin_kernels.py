# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Set-up of a multigrid hierarchy: smoothed prolongators and Galerkin products.

Block matrices are given by arrays, see `matrix.BlockMatrix`, and the block size (m, n) by two tuples of zeros, `rows` and
`cols`. Numbers that may be split are passed as tuples, and `storage` defines which blocks of the symmetric matrix A are
stored, see `symmetric_storage_kernels`. Kernels compute the rows `low` to ``high - 1`` in ascending order.

The transpose of a prolongator P is given by its row pointers `tstart`, its columns `torigin`, which are rows of P, and the
numbers `tslot` of its blocks in P.
"""

import numpy as np

from fastcontact._jit.decorators import kernel
from fastcontact.linear.multigrid.block_products import add_product, add_transposed
from fastcontact.linear.multigrid.symmetric_storage_kernels import slot_of, strip_of


@kernel
def smooth_prolongator(
    low, high, indptr, indices, storage, data, inverse, aggregate, tentative, omega, start, columns, out, rows, cols
):
    """Fill the blocks `out` of ``(I - omega D^-1 A) T``, with the row pointers `start` and the sorted `columns`.

    `aggregate` (n_nodes,) contains the number of the aggregate of each node, or -1 if it has none, and `tentative` (n_nodes *
    m * n,) the block of T for the node and its aggregate.
    """
    m, n, widest = len(rows), len(cols), 0
    for i in range(low, high):
        widest = max(widest, start[i + 1] - start[i])
    sums = np.empty(widest * m * n)
    for i in range(low, high):
        strip = strip_of(storage, i)
        for e in range((start[i + 1] - start[i]) * m * n):
            sums[e] = 0.0
        for k in range(indptr[i], indptr[i + 1]):
            j = indices[k]
            if aggregate[j] < 0:
                continue
            column = 0
            while columns[start[i] + column] != aggregate[j]:
                column += 1
            slot, transposed = slot_of(storage, strip, i, j, k)
            if transposed:
                add_transposed(sums, column * m * n, data, slot * m * m, tentative, j * m * n, (rows, rows, cols))
            else:
                add_product(sums, column * m * n, data, slot * m * m, tentative, j * m * n, (rows, rows, cols))
        for e in range(start[i], start[i + 1]):
            for r in range(m):
                for c in range(n):
                    s = 0.0
                    for t in range(m):
                        s += inverse[(i * m + r) * m + t] * sums[((e - start[i]) * m + t) * n + c]
                    first = tentative[(i * m + r) * n + c] if columns[e] == aggregate[i] else 0.0
                    out[(e * m + r) * n + c] = first - omega * s


@kernel
def _neighbours_of_row(
    row, indptr, indices, start, columns, tstart, torigin, visited, fine, visited_coarse, coarse_neighbours
):
    """Find the fine nodes and the coarse nodes that a row of ``P.T A P`` involves, and return both counts.

    `fine` is filled with the neighbours in A of the fine nodes of the row, and `coarse_neighbours` with their coarse nodes.
    `visited` and `visited_coarse` contain the last row that involved each node.
    """
    n_fine = n_coarse_neighbours = 0
    for e in range(tstart[row], tstart[row + 1]):
        i = torigin[e]
        for k in range(indptr[i], indptr[i + 1]):
            j = indices[k]
            if visited[j] != row:
                visited[j] = row
                fine[n_fine] = j
                n_fine += 1
    for e in range(n_fine):
        j = fine[e]
        for k in range(start[j], start[j + 1]):
            J = columns[k]
            if visited_coarse[J] != row:
                visited_coarse[J] = row
                coarse_neighbours[n_coarse_neighbours] = J
                n_coarse_neighbours += 1
    return n_fine, n_coarse_neighbours


@kernel
def count_galerkin(low, high, indptr, indices, start, columns, tstart, torigin, count, fine_count):
    """Fill the numbers of blocks (`count`) and of fine nodes (`fine_count`) of the rows of ``P.T A P``."""
    n, n_coarse = indptr.shape[0] - 1, tstart.shape[0] - 1
    visited, fine = np.full(n, -1, np.int32), np.empty(n, np.int32)
    visited_coarse, coarse_neighbours = np.full(n_coarse, -1, np.int32), np.empty(n_coarse, np.int32)
    for row in range(low, high):
        fine_count[row], count[row] = _neighbours_of_row(
            row, indptr, indices, start, columns, tstart, torigin, visited, fine, visited_coarse, coarse_neighbours
        )


@kernel
def _galerkin_row(
    row, fine, n_fine, position, products, indptr, indices, storage, data, start, columns, P, tstart, torigin, tslot, first,
    coarse_position, out, rows, cols,
):  # fmt: skip
    """Compute a row I of ``P.T A P`` as ``Z.T P``, where ``Z = A P_I`` is stored in `products`, since A is symmetric."""
    m, n = len(rows), len(cols)
    for e in range(n_fine):
        position[fine[e]] = e
    for e in range(n_fine * m * n):
        products[e] = 0.0
    for e in range(tstart[row], tstart[row + 1]):
        i, slot = torigin[e], tslot[e] * m * n
        strip = strip_of(storage, i)
        for k in range(indptr[i], indptr[i + 1]):  # A_ji = A_ij.T
            block, transposed = slot_of(storage, strip, i, indices[k], k)
            if transposed:
                add_product(products, position[indices[k]] * m * n, data, block * m * m, P, slot, (rows, rows, cols))
            else:
                add_transposed(products, position[indices[k]] * m * n, data, block * m * m, P, slot, (rows, rows, cols))
    for e in range(n_fine):
        j, base = fine[e], e * m * n
        for k in range(start[j], start[j + 1]):
            target = (first + coarse_position[columns[k]]) * n * n
            add_transposed(out, target, (products,), base, P, k * m * n, (cols, rows, cols))


@kernel
def galerkin(
    low, high, indptr, indices, storage, data, start, columns, P, tstart, torigin, tslot, out_ptr, max_fine, out_columns, out,
    rows, cols,
):  # fmt: skip
    """Fill `out_columns` and `out`, initially zero, with the columns and blocks of ``P.T A P`` for a symmetric matrix A.

    `out_ptr` contains the row pointers of the product. `max_fine` is the largest number of fine nodes that a row involves.
    """
    n, n_coarse = indptr.shape[0] - 1, tstart.shape[0] - 1
    visited, fine = np.full(n, -1, np.int32), np.empty(n, np.int32)
    visited_coarse, coarse_neighbours = np.full(n_coarse, -1, np.int32), np.empty(n_coarse, np.int32)
    position, coarse_position = np.empty(n, np.int32), np.empty(n_coarse, np.int32)
    products = np.empty(max_fine * len(rows) * len(cols))
    for row in range(low, high):
        n_fine, n_coarse_neighbours = _neighbours_of_row(
            row, indptr, indices, start, columns, tstart, torigin, visited, fine, visited_coarse, coarse_neighbours
        )
        coarse_neighbours[:n_coarse_neighbours].sort()
        for e in range(n_coarse_neighbours):
            coarse_position[coarse_neighbours[e]] = e
            out_columns[out_ptr[row] + e] = coarse_neighbours[e]
        _galerkin_row(
            row, fine, n_fine, position, products, indptr, indices, storage, data, start, columns, P, tstart, torigin, tslot,
            out_ptr[row], coarse_position, out, rows, cols,
        )  # fmt: skip
