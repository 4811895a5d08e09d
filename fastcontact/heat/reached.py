"""Search for bodies without thermal connection to a prescribed temperature or a film."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fastcontact.arrays import AnyArray, Indices, Mask


def not_reached(body: AnyArray, held: Mask, joined: AnyArray) -> Indices:
    """Return the numbers (n,) of the bodies whose steady temperature is undetermined, in ascending order.

    Parameters
    ----------
    body : ndarray of int (n_points,)
        Body of each point, -1 for points without a body.
    held : ndarray of bool (n_points,)
        Whether each point has a prescribed temperature or a film.
    joined : ndarray of int (m, 2)
        Pairs of points between which heat flows.
    """
    ends = body[joined]
    ends, count = ends[(ends >= 0).all(axis=1)], int(body.max()) + 1
    graph = coo_array((np.ones(len(ends), np.int8), ends.T), shape=(count, count))
    label = connected_components(graph, directed=False)[1]
    return np.flatnonzero(~np.isin(label, label[np.unique(body[held & (body >= 0)])]))
