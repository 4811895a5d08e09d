# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Elimination of supported unknowns from a block matrix with sorted rows."""

from fastcontact._jit.decorators import interpretable_kernel, kernel


@kernel
def _near(i, indptr, indices, supported_nodes):
    """Return whether block row i or one of its columns has a support."""
    if supported_nodes[i]:
        return True
    for k in range(indptr[i], indptr[i + 1]):
        if supported_nodes[indices[k]]:
            return True
    return False


@interpretable_kernel
def take_out(indptr, indices, data, supported, supported_nodes, pivots, low, high, start, columns, removed, moves):
    """Move rows and columns of supports from `data` to (start, columns, removed), a matrix in compressed rows.

    Parameters
    ----------
    supported : ndarray of bool (n_rows, size), supported_nodes : ndarray of bool (n_rows,)
        Components with a support, and nodes with one.
    pivots : (n,)
        Values that remain on the diagonal of supported components.
    low, high : int
        Block rows `low` to ``high - 1`` are processed.
    start : (n + 1,)
        Row offsets; unless `moves`, ``start[row + 1]`` is filled with the number of entries.
    columns, removed : (n_removed,)
        Filled if `moves`.
    moves : bool
        Whether to move numbers, instead of counting them.
    """
    size = data.shape[1]
    for i in range(low, high):
        near = _near(i, indptr, indices, supported_nodes)
        for a in range(size):
            row = size * i + a
            at = start[row] if moves else 0
            for k in range(indptr[i] if near else indptr[i + 1], indptr[i + 1]):
                j = indices[k]
                for b in range(size):
                    if supported[i, a] or supported[j, b]:
                        stays = pivots[row] if size * j + b == row else 0.0
                        if data[k, a, b] != stays:
                            if moves:
                                columns[at], removed[at], data[k, a, b] = size * j + b, data[k, a, b] - stays, stays
                            at += 1
            if not moves:
                start[row + 1] = at


@interpretable_kernel
def diagonal(indptr, indices, data, out):
    """Fill `out` (n,) with the diagonal of a matrix of square blocks (n_blocks, size, size)."""
    size = data.shape[1]
    for i in range(indptr.shape[0] - 1):
        for a in range(size):
            out[i * size + a] = 0.0
        for k in range(indptr[i], indptr[i + 1]):
            if indices[k] == i:
                for a in range(size):
                    out[i * size + a] += data[k, a, a]
