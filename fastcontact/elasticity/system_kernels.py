# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Supports taken out of a block matrix, whose blocks (n_blocks, size, size) are sorted in every row."""

from fastcontact._jit.decorators import kernel


@kernel
def _near(i, indptr, indices, supported_nodes):
    """Return whether block row i or one of its columns has a support."""
    if supported_nodes[i]:
        return True
    for k in range(indptr[i], indptr[i + 1]):
        if supported_nodes[indices[k]]:
            return True
    return False


@kernel
def take_out(indptr, indices, data, supported, supported_nodes, kept, start, columns, taken):
    """Move rows and columns of supports from `data` to (start, columns, taken), compressed rows of single numbers.

    Parameters
    ----------
    supported : ndarray of bool (n_rows, size), supported_nodes : ndarray of bool (n_rows,)
        Which components have a support, and which nodes have one.
    kept : (n,)
        What stays on the diagonal.
    start : (n + 1,)
        Filled with where rows begin.
    columns, taken : (n_taken,) or (0,)
        Filled; if they are empty, nothing is moved, and the numbers that would be are counted in `start`.
    """
    size, at, count_only = data.shape[1], 0, taken.shape[0] == 0
    start[0] = 0
    for i in range(indptr.shape[0] - 1):
        near = _near(i, indptr, indices, supported_nodes)
        for a in range(size):
            row = size * i + a
            for k in range(indptr[i] if near else indptr[i + 1], indptr[i + 1]):
                j = indices[k]
                for b in range(size):
                    if supported[i, a] or supported[j, b]:
                        stays = kept[row] if size * j + b == row else 0.0
                        change = data[k, a, b] - stays
                        if change != 0.0:
                            if not count_only:
                                columns[at], taken[at], data[k, a, b] = size * j + b, change, stays
                            at += 1
            start[row + 1] = at
