# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""What changes in the matrices of a multigrid hierarchy when unknowns are eliminated: only rows near the pivots.

Pivots p follow ``u_p = W_p u``, W in compressed rows (wstart, wcolumns, weights). The prolongator P becomes P + E, where E
has rows for the pivots only, ``E_p = W_p P - P_p``, and the next coarser matrix changes from ``P.T K P`` to
``(P + E).T K (P + E)``. With ``H = K[pivots] P + K[pivots, pivots] E / 2`` the change is ``E.T H + H.T E``.

Numbers of K come as a tuple, see `split_matrix_kernels`. Rows of E and H are lists of segments: ``start`` (m + 1,),
``columns`` the coarse nodes, ``values`` (n_segments * n,).
"""

import numpy as np

from fastcontact._jit.decorators import kernel
from fastcontact.linear.multigrid.split_matrix_kernels import entry


@kernel
def _segments_of(node, start, columns, stamp, seen, found, count):
    for k in range(start[node], start[node + 1]):
        if seen[columns[k]] != stamp:
            seen[columns[k]] = stamp
            found[count] = columns[k]
            count += 1
    return count


@kernel
def _add_row(dof, factor, size, n, start, columns, P, place, values):
    """Add ``factor`` times row `dof` of the prolongator to the segments at `place`."""
    node, a = dof // size, dof % size
    for k in range(start[node], start[node + 1]):
        at, base = place[columns[k]] * n, (k * size + a) * n
        for c in range(n):
            values[at + c] += factor * P[base + c]


@kernel
def prolongator_change(pivots, wstart, wcolumns, weights, start, columns, P, size, n, n_coarse):
    """Return (start, columns, values) of E; blocks of the prolongator are size x n."""
    m = pivots.shape[0]
    seen, place = np.full(n_coarse, -1, np.int64), np.empty(n_coarse, np.int64)
    found = np.empty(n_coarse, np.int64)
    out_start = np.zeros(m + 1, np.int64)
    out_columns, values = np.empty(0, np.int64), np.zeros(0)
    for filling in range(2):
        if filling:
            out_columns, values = np.empty(out_start[m], np.int64), np.zeros(out_start[m] * n)
            seen[:] = -1
        for p in range(m):
            count = _segments_of(pivots[p] // size, start, columns, p, seen, found, 0)
            for k in range(wstart[p], wstart[p + 1]):
                count = _segments_of(wcolumns[k] // size, start, columns, p, seen, found, count)
            if not filling:
                out_start[p + 1] = out_start[p] + count
                continue
            for e in range(count):
                out_columns[out_start[p] + e] = found[e]
                place[found[e]] = out_start[p] + e
            _add_row(pivots[p], -1.0, size, n, start, columns, P, place, values)
            for k in range(wstart[p], wstart[p + 1]):
                _add_row(wcolumns[k], weights[k], size, n, start, columns, P, place, values)
    return out_start, out_columns, values


@kernel
def products_at_pivots(pivots, number, indptr, indices, K, start, columns, P, estart, ecolumns, E, size, n, n_coarse):
    """Return (start, columns, values) of H; `number` (n_fine,) is the number of each pivot and -1 elsewhere."""
    m = pivots.shape[0]
    seen, place = np.full(n_coarse, -1, np.int64), np.empty(n_coarse, np.int64)
    found = np.empty(n_coarse, np.int64)
    out_start = np.zeros(m + 1, np.int64)
    out_columns, values = np.empty(0, np.int64), np.zeros(0)
    for filling in range(2):
        if filling:
            out_columns, values = np.empty(out_start[m], np.int64), np.zeros(out_start[m] * n)
            seen[:] = -1
        for p in range(m):
            i, a = pivots[p] // size, pivots[p] % size
            count = 0
            for k in range(indptr[i], indptr[i + 1]):
                j = indices[k]
                count = _segments_of(j, start, columns, p, seen, found, count)
                for b in range(size):
                    q = number[j * size + b]
                    if q >= 0:
                        for e in range(estart[q], estart[q + 1]):
                            if seen[ecolumns[e]] != p:
                                seen[ecolumns[e]] = p
                                found[count] = ecolumns[e]
                                count += 1
            if not filling:
                out_start[p + 1] = out_start[p] + count
                continue
            low = out_start[p]
            for e in range(count):
                out_columns[low + e] = found[e]
                place[found[e]] = low + e
            for k in range(indptr[i], indptr[i + 1]):
                j = indices[k]
                for b in range(size):
                    stiffness = entry(K, (k * size + a) * size + b)
                    if stiffness == 0.0:
                        continue
                    _add_row(j * size + b, stiffness, size, n, start, columns, P, place, values)
                    q = number[j * size + b]
                    if q >= 0:
                        for e in range(estart[q], estart[q + 1]):
                            at = place[ecolumns[e]] * n
                            for c in range(n):
                                values[at + c] += 0.5 * stiffness * E[e * n + c]
    return out_start, out_columns, values


@kernel
def _by_column(start, columns, local, n_local):
    """Return (first, row, slot): the segments of each coarse node."""
    first = np.zeros(n_local + 1, np.int64)
    for k in range(columns.shape[0]):
        first[local[columns[k]] + 1] += 1
    for c in range(n_local):
        first[c + 1] += first[c]
    at = first[:-1].copy()
    row, slot = np.empty(columns.shape[0], np.int64), np.empty(columns.shape[0], np.int64)
    for p in range(start.shape[0] - 1):
        for k in range(start[p], start[p + 1]):
            c = local[columns[k]]
            row[at[c]], slot[at[c]] = p, k
            at[c] += 1
    return first, row, slot


@kernel
def _reached(node, first, row, start, columns, local, seen, found, count):
    for e in range(first[node], first[node + 1]):
        for k in range(start[row[e]], start[row[e] + 1]):
            J = local[columns[k]]
            if seen[J] != node:
                seen[J] = node
                found[count] = J
                count += 1
    return count


@kernel
def _add_products(node, first, row, slot, left, start, columns, local, right, place, out, cols):
    n = len(cols)
    for e in range(first[node], first[node + 1]):
        for k in range(start[row[e]], start[row[e] + 1]):
            base = place[local[columns[k]]] * n * n
            for a in range(n):
                factor = left[slot[e] * n + a]
                for b in range(n):
                    out[base + a * n + b] += factor * right[k * n + b]


@kernel
def coarse_change(estart, ecolumns, E, hstart, hcolumns, H, local, n_local, cols):
    """Return (indptr, indices, data) of ``E.T H + H.T E`` on the coarse nodes numbered by `local`, blocks n x n.

    The block size comes as the length of `cols`, which the compiler knows.
    """
    n = len(cols)
    efirst, erow, eslot = _by_column(estart, ecolumns, local, n_local)
    hfirst, hrow, hslot = _by_column(hstart, hcolumns, local, n_local)
    seen, found = np.full(n_local, -1, np.int64), np.empty(n_local, np.int64)
    place = np.empty(n_local, np.int64)
    indptr = np.zeros(n_local + 1, np.int32)
    for node in range(n_local):
        count = _reached(node, efirst, erow, hstart, hcolumns, local, seen, found, 0)
        count = _reached(node, hfirst, hrow, estart, ecolumns, local, seen, found, count)
        indptr[node + 1] = indptr[node] + count
    indices, data = np.empty(indptr[n_local], np.int32), np.zeros(indptr[n_local] * n * n)
    seen[:] = -1
    for node in range(n_local):
        count = _reached(node, efirst, erow, hstart, hcolumns, local, seen, found, 0)
        count = _reached(node, hfirst, hrow, estart, ecolumns, local, seen, found, count)
        found[:count].sort()
        for e in range(count):
            indices[indptr[node] + e] = found[e]
            place[found[e]] = indptr[node] + e
        _add_products(node, efirst, erow, eslot, E, hstart, hcolumns, local, H, place, data, cols)
        _add_products(node, hfirst, hrow, hslot, H, estart, ecolumns, local, E, place, data, cols)
    return indptr, indices, data


@kernel
def constrain_diagonal(pivots, number, wstart, wcolumns, weights, indptr, indices, K, local, blocks, size):
    """Turn diagonal `blocks` (n_local * size * size,) of K into those of ``T.T K T``.

    `local` (n_nodes,) numbers the nodes of pivots and of the unknowns that they follow.
    """
    for p in range(pivots.shape[0]):
        i, a = pivots[p] // size, pivots[p] % size
        for k in range(indptr[i], indptr[i + 1]):
            j = indices[k]
            for b in range(size):
                stiffness = entry(K, (k * size + a) * size + b)
                if stiffness == 0.0:
                    continue
                q = number[j * size + b]
                for e in range(wstart[p], wstart[p + 1]):
                    node, x = wcolumns[e] // size, wcolumns[e] % size
                    base = local[node] * size * size
                    if node == j:
                        blocks[base + x * size + b] += weights[e] * stiffness
                        blocks[base + b * size + x] += weights[e] * stiffness
                    if q >= 0:
                        for g in range(wstart[q], wstart[q + 1]):
                            if wcolumns[g] // size == node:
                                blocks[base + x * size + wcolumns[g] % size] += weights[e] * stiffness * weights[g]
    for p in range(pivots.shape[0]):
        base, a = local[pivots[p] // size] * size * size, pivots[p] % size
        for b in range(size):
            blocks[base + a * size + b] = blocks[base + b * size + a] = 0.0
