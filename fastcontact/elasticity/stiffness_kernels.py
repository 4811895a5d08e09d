# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Sparsity pattern of the stiffness matrix by node blocks, and the block index of each node pair of each cell.

The cells of all element types are in one list, in which the nodes of cell ``c`` are ``nodes[start[c]:start[c + 1]]``.
"""

import numpy as np

from fastcontact._jit.decorators import interpretable_kernel, kernel


@interpretable_kernel
def cells_at_nodes(start, nodes, n_points):
    """Return (first, cells); the cells at node p are ``cells[first[p]:first[p + 1]]``, in ascending order."""
    first = np.zeros(n_points + 1, np.int64)
    for k in range(nodes.shape[0]):
        first[nodes[k] + 1] += 1
    for p in range(n_points):
        first[p + 1] += first[p]
    position = first[:-1].copy()
    cells = np.empty(nodes.shape[0], np.int32)
    for c in range(start.shape[0] - 1):
        for k in range(start[c], start[c + 1]):
            p = nodes[k]
            cells[position[p]] = c
            position[p] += 1
    return first, cells


@interpretable_kernel
def count_neighbours(start, nodes, first, cells, low, high, count):
    """Fill `count` (n_points,), from `low` to ``high - 1``, with the number of nodes that share a cell with each node."""
    seen = np.full(first.shape[0] - 1, -1, np.int32)
    for p in range(low, high):
        n_found = 0
        for k in range(first[p], first[p + 1]):
            for m in range(start[cells[k]], start[cells[k] + 1]):
                if seen[nodes[m]] != p:
                    seen[nodes[m]] = p
                    n_found += 1
        count[p] = max(n_found, 1)  # a node without cells has a diagonal block


@interpretable_kernel
def neighbours(start, nodes, first, cells, low, high, indptr, indices):
    """Fill `indices` with the sorted nodes that share a cell with each node from `low` to ``high - 1``, and the node."""
    seen = np.full(first.shape[0] - 1, -1, np.int32)
    for p in range(low, high):
        begin = end = indptr[p]
        for k in range(first[p], first[p + 1]):
            for m in range(start[cells[k]], start[cells[k] + 1]):
                node = nodes[m]
                if seen[node] != p:
                    seen[node] = p
                    at = end
                    while at > begin and indices[at - 1] > node:
                        indices[at] = indices[at - 1]
                        at -= 1
                    indices[at] = node
                    end += 1
        if end == begin:
            indices[begin] = p


@interpretable_kernel
def find_slots(cells, indptr, indices, slots):
    """Fill `slots` (n_cells, n_nodes, n_nodes) with the position in `indices` of each node pair of each cell."""
    n_cells, n_nodes = cells.shape
    for c in range(n_cells):
        for a in range(n_nodes):
            row = cells[c, a]
            for b in range(n_nodes):
                low, high = indptr[row], indptr[row + 1]
                while high - low > 1:
                    middle = (low + high) // 2
                    if indices[middle] <= cells[c, b]:
                        low = middle
                    else:
                        high = middle
                slots[c, a, b] = low


@kernel
def first_parts(cells, ends, unowned, owner, last, work):
    """Fill `owner` (n_points,), initially `unowned`, with the first part of the cells that contains each point.

    Part p consists of the cells ``ends[p]`` to ``ends[p + 1] - 1``. It owns a point of ``work[p]`` cells, all of which
    precede cell ``last[p]``. `last` and `work` (n_parts,) are initially zero.
    """
    for part in range(len(ends) - 1):
        for c in range(ends[part], ends[part + 1]):
            for a in range(cells.shape[1]):
                if owner[cells[c, a]] == unowned:
                    owner[cells[c, a]] = part
                first = owner[cells[c, a]]
                if last[first] <= c:
                    last[first] = c + 1
                    work[first] += 1
