# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Block index of each node pair of each cell in the stiffness matrix, and division of the assembly among threads."""

from fastcontact._jit.decorators import interpretable_kernel, kernel


@interpretable_kernel
def find_slots(cells, indptr, indices, slots):
    """Fill `slots` (n_cells, n_nodes, n_nodes) with the positions in `indices` of the node pairs of cells, by bisection."""
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

    Part p consists of the cells ``ends[p]`` to ``ends[p + 1] - 1``. The points that it owns belong to ``work[p]`` cells, all
    of which precede cell ``last[p]``. `last` and `work` (n_parts,) are initially zero.
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
