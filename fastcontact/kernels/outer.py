"""Facets that belong to one cell only."""

import numpy as np

from fastcontact._jit import kernel


@kernel
def _same(facets, f, g):
    """Return whether two facets have the same nodes, each as often."""
    for a in range(facets.shape[1]):
        more = 0
        for b in range(facets.shape[1]):
            more += facets[g, b] == facets[f, a]
            more -= facets[f, b] == facets[f, a]
        if more != 0:
            return False
    return True


@kernel
def alone(facets, n_points, found):
    """Fill `found` (n_facets,) with whether no other one of the facets (n_facets, n_nodes) has the same nodes.

    Only those with the same lowest node are compared: they come together, counted and put in their places.
    """
    n = facets.shape[0]
    lowest = np.empty(n, np.int32)
    start = np.zeros(n_points + 1, np.int64)
    for f in range(n):
        lowest[f] = facets[f, 0]
        for a in range(1, facets.shape[1]):
            lowest[f] = min(lowest[f], facets[f, a])
        start[lowest[f] + 1] += 1
    for p in range(n_points):
        start[p + 1] += start[p]
    place, order = start[:-1].copy(), np.empty(n, np.int32)
    for f in range(n):
        order[place[lowest[f]]] = f
        place[lowest[f]] += 1
    found[:] = True
    for p in range(n_points):
        for k in range(start[p], start[p + 1]):
            for m in range(start[p], k):
                if _same(facets, order[k], order[m]):
                    found[order[k]] = found[order[m]] = False
