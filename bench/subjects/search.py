"""Closest facets of a wavy surface of quadrangles, in nearest-point queries of SciPy's cKDTree, as many."""

import numpy as np
from scipy.spatial import cKDTree

from fastcontact.search import closest

SIZES = (1_000, 10_000, 100_000)


def works(size):
    n = max(4, round(size**0.5))
    x, y = np.meshgrid(np.linspace(0.0, 1.0, n + 1), np.linspace(0.0, 1.0, n + 1), indexing="ij")
    nodes = np.stack([x, y, 0.05 * np.sin(5 * x) * np.cos(4 * y)], axis=-1)
    corners = np.stack([nodes[:-1, :-1], nodes[1:, :-1], nodes[1:, 1:], nodes[:-1, 1:]], axis=2).reshape(-1, 4, 3)
    points = corners.mean(axis=1) + np.array([0.3 / n, 0.2 / n, 0.1 / n])
    middles = corners.mean(axis=1)
    return len(points), {
        "closest facets": lambda: closest(points, corners),
        "cKDTree, build and query": lambda: cKDTree(middles).query(points),
    }
