"""Tangential multipliers at supported nodes, as on an axis or in a plane of symmetry.

There the slip of a facet has one nodal value less than its multiplier field: a field that alternates from node to node
and dies out along the surface does no work on any slip, and nothing would determine it. Such fields are made compliant,
as those are that the multiplier field cannot represent: the shear at the supported node then vanishes, as symmetry wants.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastcontact.contact.multiplier_field import Projection
from fastcontact.contact.surface import Surface

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def supported_nodes(side: Surface, supported: Mask, opposite: Mask) -> Mask:
    """Return which nodes (m,) of a side have no slip along an axis, while a neighbour on every facet has.

    Parameters
    ----------
    side : Surface
    supported : ndarray of bool (m,)
        Nodes whose motion along the axis supports prescribe.
    opposite : ndarray of bool (m,)
        Nodes that face such nodes of the other side.
    """
    found = supported & opposite
    whole = [block.local[found[block.local].all(axis=1)].ravel() for block in side.blocks]
    found[np.concatenate(whole)] = False
    return found


def compliant(projection: Projection, columns: NDArray[np.intp]) -> Array:
    r"""Return a factor Z (m, h) of what dropping `columns` of the multiplier field adds to the compliance C.

    With E the unit vectors of the columns and :math:`M = P^T W P` that is
    :math:`Z Z^T = P M^{-1} E (E^T M^{-1} E)^{-1} E^T M^{-1} P^T / \rho`.
    """
    if projection.mass is None:
        return np.zeros((projection.P.shape[0], 0))
    unit = np.zeros((projection.P.shape[1], len(columns)))
    unit[columns, np.arange(len(columns))] = 1.0
    inverse = projection.mass.solve(unit)
    lower = np.linalg.cholesky(inverse[columns])
    return np.asarray(np.linalg.solve(lower, (projection.P @ inverse).T).T) / np.sqrt(projection.rho)
