"""Flat lines and triangles between the nodes of facets."""

from __future__ import annotations

import numpy as np

from fastcontact.arrays import Indices

# Flat triangles between the nodes, by number of nodes.
_FLAT = {
    3: [[0, 1, 2]],
    4: [[0, 1, 2], [0, 2, 3]],
    6: [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]],
    8: [[0, 4, 7], [4, 1, 5], [5, 2, 6], [6, 3, 7], [4, 5, 7], [5, 6, 7]],
    9: [[0, 4, 8], [0, 8, 7], [4, 1, 8], [1, 5, 8], [5, 2, 8], [2, 6, 8], [6, 3, 8], [3, 7, 8]],
}


def flat_triangles(n_nodes: int) -> Indices:
    """Return the flat triangles (n, 3) between the nodes of a facet in 3D, oriented like the facet."""
    return np.array(_FLAT[n_nodes])


def flat_pieces(n_nodes: int, dim: int) -> Indices:
    """Return the local nodes of the lines (n, 2) or triangles (n, 3) that approximate a facet with `n_nodes` nodes."""
    if dim == 2:
        return np.array([[0, 1]] if n_nodes == 2 else [[0, 2], [2, 1]])
    return flat_triangles(n_nodes)
