# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Boundary facets, and cells that are connected by facets, found by sorting the facets by their nodes."""

import numpy as np

from fastcontact._jit.decorators import interpretable_kernel, kernel


@kernel
def _sorted_nodes(facets):
    """Return the nodes (n_nodes, n_facets) of each facet in ascending order."""
    n, n_nodes = facets.shape
    keys = np.empty((n_nodes, n), np.int32)
    for f in range(n):
        for a in range(n_nodes):
            node, at = facets[f, a], a
            while at > 0 and keys[at - 1, f] > node:
                keys[at, f] = keys[at - 1, f]
                at -= 1
            keys[at, f] = node
    return keys


@kernel
def _same(keys, f, g):
    """Return whether facets f and g have the same nodes."""
    for a in range(keys.shape[0]):
        if keys[a, f] != keys[a, g]:
            return False
    return True


@kernel
def _root(parent, cell):
    """Return the root of the tree of `cell`, with path halving."""
    while parent[cell] != cell:
        parent[cell] = parent[parent[cell]]
        cell = parent[cell]
    return cell


@interpretable_kernel
def alone(facets, owner, n_points, single, parent):
    """Fill `single` (n_facets,) with whether no other of the facets (n_facets, n_nodes) has the same nodes.

    `owner` (n_facets,) is the cell of each facet. Cells with facets that have the same nodes are united in the forest
    `parent` (n_cells,), in place; the lower root becomes the root of both.

    The facets are sorted by counting sorts over their nodes, the lowest node last. Facets with the same nodes are then
    consecutive, in a time that does not depend on the number of facets at a node.
    """
    keys, n = _sorted_nodes(facets), facets.shape[0]
    order, other = np.empty(n, np.int32), np.empty(n, np.int32)
    for f in range(n):
        order[f] = f
    for a in range(keys.shape[0] - 1, -1, -1):
        place = np.zeros(n_points + 1, np.int64)
        for f in range(n):
            place[keys[a, f] + 1] += 1
        for p in range(n_points):
            place[p + 1] += place[p]
        for k in range(n):
            node = keys[a, order[k]]
            other[place[node]] = order[k]
            place[node] += 1
        order, other = other, order
    for k in range(n):
        beside = k > 0 and _same(keys, order[k], order[k - 1])
        single[order[k]] = not (beside or (k + 1 < n and _same(keys, order[k], order[k + 1])))
        if beside:
            one, two = _root(parent, owner[order[k]]), _root(parent, owner[order[k - 1]])
            parent[max(one, two)] = min(one, two)
