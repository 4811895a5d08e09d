"""Search of the closest facets of a wavy surface or line for points in random order.

The reference is the same number of nearest-point queries of SciPy's cKDTree. The search includes the construction of its
tree, the reference does not: the construction of the cKDTree is reported separately.
"""

import numpy as np
from scipy.spatial import cKDTree

from fastcontact.contact.projection import closest

SIZES = (1_000, 10_000, 100_000)


def quadrangles(size):
    n = max(4, round(size**0.5))
    x, y = np.meshgrid(np.linspace(0.0, 1.0, n + 1), np.linspace(0.0, 1.0, n + 1), indexing="ij")
    nodes = np.stack([x, y, 0.05 * np.sin(5 * x) * np.cos(4 * y)], axis=-1)
    return np.stack([nodes[:-1, :-1], nodes[1:, :-1], nodes[1:, 1:], nodes[:-1, 1:]], axis=2).reshape(-1, 4, 3)


def triangles(size):
    corners = quadrangles(size / 2)
    return np.concatenate([corners[:, [0, 1, 2]], corners[:, [0, 2, 3]]])


def lines(size):
    angle = np.linspace(0.0, 2 * np.pi, size + 1)
    nodes = ((1 + 0.1 * np.cos(7 * angle)) * [np.cos(angle), np.sin(angle)]).T
    return np.stack([nodes[:-1], nodes[1:]], axis=1)


def surface(make, size):
    """Return facets (n, n_nodes, dim) and query points (n, dim), both in random order.

    The query points lie about a third of a facet length from the middle of each facet.
    """
    rng, corners = np.random.default_rng(0), make(size)
    off = np.linalg.norm(corners[:, 1] - corners[:, 0], axis=1)[:, None] * np.array([0.3, 0.2, 0.1])[: corners.shape[2]]
    return np.ascontiguousarray(rng.permutation(corners)), rng.permutation(corners.mean(axis=1) + off)


def works(size):
    (quad4, quad4_queries), (tri3, tri3_queries), (line2, line2_queries) = (
        surface(make, size) for make in (quadrangles, triangles, lines)
    )
    middles, middles_2d = quad4.mean(axis=1), line2.mean(axis=1)
    tree, tree_2d = cKDTree(middles), cKDTree(middles_2d)
    return len(quad4_queries), {
        "quad4": lambda: closest(quad4_queries, quad4),
        "tri3": lambda: closest(tri3_queries, tri3),
        "line2": lambda: closest(line2_queries, line2),
        "cKDTree, build 2D": lambda: cKDTree(middles_2d),
        "cKDTree, query 2D": lambda: tree_2d.query(line2_queries),
        "cKDTree, build": lambda: cKDTree(middles),
        "cKDTree, query": lambda: tree.query(quad4_queries),
    }
