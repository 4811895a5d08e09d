# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""What eliminated equations change in the diagonal blocks of a matrix; numbers that may be split come as a tuple."""

from fastcontact._jit.decorators import kernel
from fastcontact.linear.multigrid.split_matrix_kernels import entry


@kernel
def diagonal_change(pivots, number, indptr, indices, weights, start, columns, numbers, place, size, out):
    """Fill the change of diagonal blocks from A to ``T.T A T``, A symmetric, in which pivots follow ``x[pivots] = W x``.

    Parameters
    ----------
    pivots : (m,)
    number : (n,)
        Number of each pivot, -1 elsewhere.
    indptr, indices, weights : (m + 1,), (n_weights,), (n_weights,)
        W in compressed rows, columns ascending, which involve no pivots.
    start, columns, numbers
        A, of blocks size x size; canonical.
    place : (n_nodes,)
        Where the block of each node begins in `out`, in blocks: of those that have pivots or weights.
    out : (n_blocks * size * size,)
        Zero before.
    """
    for p in range(pivots.shape[0]):
        i, a = pivots[p] // size, pivots[p] % size
        for k in range(start[i], start[i + 1]):
            j = columns[k]
            for b in range(size):
                stiffness = entry(numbers, (k * size + a) * size + b)
                if stiffness == 0.0:
                    continue
                q = number[j * size + b]
                if q < 0:
                    _add_beside(j, b, stiffness, indptr[p], indptr[p + 1], indices, weights, place, size, out)
                else:
                    _add_between(p, q, stiffness, indptr, indices, weights, place, size, out)
                if j == i:  # rows and columns of pivots become zero
                    at = place[i] * size * size
                    out[at + a * size + b] -= stiffness
                    if q < 0:
                        out[at + b * size + a] -= stiffness


@kernel
def _add_beside(j, b, stiffness, low, high, indices, weights, place, size, out):
    """Add what the stiffness between a pivot with weights [low, high) and unknown b of node j does to that node's block."""
    for e in range(low, high):
        if indices[e] // size == j:
            at, x = place[j] * size * size, indices[e] % size
            out[at + x * size + b] += weights[e] * stiffness
            out[at + b * size + x] += weights[e] * stiffness


@kernel
def _add_between(p, q, stiffness, indptr, indices, weights, place, size, out):
    """Add what the stiffness between pivots p and q does to the blocks of the nodes that both follow."""
    e, g = indptr[p], indptr[q]
    while e < indptr[p + 1] and g < indptr[q + 1]:
        node, other = indices[e] // size, indices[g] // size
        if other < node:
            g += 1
            continue
        at, k = (place[node] * size + indices[e] % size) * size, g
        while k < indptr[q + 1] and indices[k] // size == node:
            out[at + indices[k] % size] += weights[e] * stiffness * weights[k]
            k += 1
        e += 1
