# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Set-up of a multigrid hierarchy: the graph of a matrix, smoothed prolongators and Galerkin products.

Block matrices come as arrays, see `matrix.BlockMatrix`, block sizes m and n as tuples of zeros, `rows` and `cols`; numbers
that may be split as a tuple, see `split_matrix_kernels`; which blocks are stored as `storage`, see
`symmetric_storage_kernels`. Rows are computed one by one in a fixed order.
"""

import numpy as np
from numba import prange

from fastcontact._jit.decorators import kernel, parallel_kernel
from fastcontact.linear.multigrid.block_products import add_product, add_transposed
from fastcontact.linear.multigrid.symmetric_storage_kernels import CHUNK, part_of, place_of

# Number of parts of Galerkin products, each with its own work space.
PARTS = 8


@kernel
def _near(i, indptr, indices, storage, data, square, near):
    """Fill `near` with the columns of the nonzero off-diagonal blocks of row i; return their number."""
    part, count = part_of(storage, i), 0
    for k in range(indptr[i], indptr[i + 1]):
        if indices[k] == i:
            continue
        slot = place_of(storage, part, i, indices[k], k)[0]
        for e in range(slot * square, (slot + 1) * square):
            if data[e] != 0.0:
                near[count] = indices[k]
                count += 1
                break
    return count


@parallel_kernel
def graph(indptr, indices, storage, data, size):
    """Return the offsets and columns of the nonzero off-diagonal blocks.

    A row without neighbours is a node without coupling: all its unknowns are supported.
    """
    n = indptr.shape[0] - 1
    start, widest = np.zeros(n + 1, np.int32), 0
    for i in range(n):
        widest = max(widest, indptr[i + 1] - indptr[i])
    for c in prange((n + CHUNK - 1) // CHUNK):
        near = np.empty(widest, np.int32)
        for i in range(c * CHUNK, min(n, (c + 1) * CHUNK)):
            start[i + 1] = _near(i, indptr, indices, storage, data, size * size, near)
    for i in range(n):
        start[i + 1] += start[i]
    neighbours = np.empty(start[n], np.int32)
    for c in prange((n + CHUNK - 1) // CHUNK):
        near = np.empty(widest, np.int32)
        for i in range(c * CHUNK, min(n, (c + 1) * CHUNK)):
            count = _near(i, indptr, indices, storage, data, size * size, near)
            for e in range(count):
                neighbours[start[i] + e] = near[e]
    return start, neighbours


@kernel
def _aggregates_of(i, indptr, indices, aggregate, aggregates):
    """Fill `aggregates` with the aggregates of node i and its neighbours, ascending; return their number."""
    count = 0
    for k in range(indptr[i], indptr[i + 1]):
        of_neighbour = aggregate[indices[k]]
        if of_neighbour < 0:
            continue
        at = count
        while at > 0 and aggregates[at - 1] > of_neighbour:
            at -= 1
        if at > 0 and aggregates[at - 1] == of_neighbour:
            continue
        for e in range(count, at, -1):
            aggregates[e] = aggregates[e - 1]
        aggregates[at] = of_neighbour
        count += 1
    return count


@parallel_kernel
def count_prolongator(indptr, indices, aggregate):
    """Return the row pointers of the smoothed prolongator: each node and its neighbours, by aggregate."""
    n = indptr.shape[0] - 1
    widest = 0
    for i in range(n):
        widest = max(widest, indptr[i + 1] - indptr[i])
    start = np.zeros(n + 1, np.int32)
    for c in prange((n + CHUNK - 1) // CHUNK):
        aggregates = np.empty(widest, np.int32)
        for i in range(c * CHUNK, min(n, (c + 1) * CHUNK)):
            start[i + 1] = _aggregates_of(i, indptr, indices, aggregate, aggregates)
    for i in range(n):
        start[i + 1] += start[i]
    return start


@kernel
def _smooth_row(
    i,
    indptr,
    indices,
    storage,
    data,
    inverse,
    aggregate,
    tentative,
    omega,
    start,
    columns,
    out,
    aggregates,
    sums,
    rows,
    cols,
):
    part = part_of(storage, i)
    m, n = len(rows), len(cols)
    count = _aggregates_of(i, indptr, indices, aggregate, aggregates)
    for e in range(count * m * n):
        sums[e] = 0.0
    for k in range(indptr[i], indptr[i + 1]):
        j = indices[k]
        if aggregate[j] < 0:
            continue
        at = 0
        while aggregates[at] != aggregate[j]:
            at += 1
        slot, turned = place_of(storage, part, i, j, k)
        if turned:
            add_transposed(sums, at * m * n, data, slot * m * m, tentative, j * m * n, (rows, rows, cols))
        else:
            add_product(sums, at * m * n, data, slot * m * m, tentative, j * m * n, (rows, rows, cols))
    for at in range(count):
        base = (start[i] + at) * m * n
        columns[start[i] + at] = aggregates[at]
        for r in range(m):
            for c in range(n):
                s = 0.0
                for t in range(m):
                    s += inverse[(i * m + r) * m + t] * sums[(at * m + t) * n + c]
                first = tentative[(i * m + r) * n + c] if aggregates[at] == aggregate[i] else 0.0
                out[base + r * n + c] = first - omega * s


@parallel_kernel
def smooth_prolongator(indptr, indices, storage, data, inverse, aggregate, tentative, omega, start, out, rows, cols):
    """Return the columns of ``(I - omega D^-1 A) T`` with the row pointers `start`, and fill its blocks into `out`.

    `tentative` (n_nodes * m * n,) is the block of T in each node's own aggregate; `aggregate` is -1 for nodes in none.
    """
    n = indptr.shape[0] - 1
    m = len(rows)
    widest = 0
    for i in range(n):
        widest = max(widest, start[i + 1] - start[i])
    columns = np.empty(start[n], np.int32)
    for c in prange((n + CHUNK - 1) // CHUNK):
        near = np.empty(widest + 1, np.int32)
        sums = np.empty((widest + 1) * m * len(cols))
        for i in range(c * CHUNK, min(n, (c + 1) * CHUNK)):
            _smooth_row(
                i, indptr, indices, storage, data, inverse, aggregate, tentative, omega, start, columns, out, near, sums,
                rows, cols,
            )  # fmt: skip
    return columns


@kernel
def _reach(row, indptr, indices, start, columns, tstart, torigin, seen, near, seen_coarse, reached):
    """Find the fine neighbours of the nodes of a coarse node, and the coarse nodes of these; return both counts."""
    n_near = n_found = 0
    for e in range(tstart[row], tstart[row + 1]):
        i = torigin[e]
        for k in range(indptr[i], indptr[i + 1]):
            j = indices[k]
            if seen[j] != row:
                seen[j] = row
                near[n_near] = j
                n_near += 1
    for e in range(n_near):
        j = near[e]
        for k in range(start[j], start[j + 1]):
            J = columns[k]
            if seen_coarse[J] != row:
                seen_coarse[J] = row
                reached[n_found] = J
                n_found += 1
    return n_near, n_found


@parallel_kernel
def count_galerkin(indptr, indices, start, columns, tstart, torigin, count, near_count):
    """Fill, for each coarse row of ``P.T A P``, the numbers of its blocks and of fine nodes in its sum."""
    n, n_coarse = indptr.shape[0] - 1, tstart.shape[0] - 1
    for part in prange(PARTS):
        seen, near = np.full(n, -1, np.int32), np.empty(n, np.int32)
        seen_coarse, reached = np.full(n_coarse, -1, np.int32), np.empty(n_coarse, np.int32)
        for row in range(part * n_coarse // PARTS, (part + 1) * n_coarse // PARTS):
            near_count[row], count[row] = _reach(
                row, indptr, indices, start, columns, tstart, torigin, seen, near, seen_coarse, reached
            )


@kernel
def _galerkin_row(
    row, near, n_near, place, products, indptr, indices, storage, data, start, columns, P, tstart, torigin, tslot, low,
    places, out, rows, cols,
):  # fmt: skip
    """Compute one row: first ``Z = A P_I`` for the fine nodes near it, then ``P.T Z``, transposed since A is symmetric."""
    m, n = len(rows), len(cols)
    for e in range(n_near):
        place[near[e]] = e
    for e in range(n_near * m * n):
        products[e] = 0.0
    for e in range(tstart[row], tstart[row + 1]):
        i, slot = torigin[e], tslot[e] * m * n
        part = part_of(storage, i)
        for k in range(indptr[i], indptr[i + 1]):  # A_ji = A_ij.T
            at, turned = place_of(storage, part, i, indices[k], k)
            if turned:
                add_product(products, place[indices[k]] * m * n, data, at * m * m, P, slot, (rows, rows, cols))
            else:
                add_transposed(products, place[indices[k]] * m * n, data, at * m * m, P, slot, (rows, rows, cols))
    for e in range(n_near):
        j, base = near[e], e * m * n
        for k in range(start[j], start[j + 1]):
            block = (low + places[columns[k]]) * n * n
            add_transposed(out, block, (products,), base, P, k * m * n, (cols, rows, cols))


@parallel_kernel
def galerkin(
    indptr,
    indices,
    storage,
    data,
    start,
    columns,
    P,
    tstart,
    torigin,
    tslot,
    low,
    largest,
    out_columns,
    out,
    rows,
    cols,
):
    """Fill the columns and blocks of ``P.T A P``, A symmetric; `low` are its row pointers, `out` holds zeros.

    `largest` is the largest number of fine nodes in the sum of a coarse row.
    """
    n, n_coarse = indptr.shape[0] - 1, tstart.shape[0] - 1
    m, size = len(rows), len(cols)
    for part in prange(PARTS):
        seen, near = np.full(n, -1, np.int32), np.empty(n, np.int32)
        seen_coarse, reached = np.full(n_coarse, -1, np.int32), np.empty(n_coarse, np.int32)
        place, places = np.empty(n, np.int32), np.empty(n_coarse, np.int32)
        products = np.empty(largest * m * size)
        for row in range(part * n_coarse // PARTS, (part + 1) * n_coarse // PARTS):
            n_near, n_found = _reach(
                row, indptr, indices, start, columns, tstart, torigin, seen, near, seen_coarse, reached
            )
            reached[:n_found].sort()
            for e in range(n_found):
                places[reached[e]] = e
                out_columns[low[row] + e] = reached[e]
            _galerkin_row(
                row, near, n_near, place, products, indptr, indices, storage, data, start, columns, P, tstart, torigin, tslot,
                low[row], places, out, rows, cols,
            )  # fmt: skip
