r"""Nodal pressures that are not negative, vanish at open nodes, and have the contact force as their integral.

A pressure field :math:`p_h` with the nodal values :math:`p_j`, which is obtained by projection, is not zero beyond the edge
of the contact. Its values at open nodes contribute to the contact force :math:`\int p_h\,dA = \sum_j A_j p_j`, where
:math:`A_j` are the integrals of the shape functions. The share :math:`A_j p_j` of an open node is therefore moved to the
closed nodes of its facets and of the adjacent facets. The pressures of all these nodes change by the same amount, which is
the smallest change for this set of nodes. A smaller set would cause a kink of the pressure, and a larger one would change
pressures far from the error. A closed node with a negative pressure becomes open.
"""

from __future__ import annotations

import numpy as np

from fastcontact.arrays import Array, Mask
from fastcontact.contact.surface import Surface
from fastcontact.round_off import SUM_ROUND_OFF

# Areas below this fraction of the typical area count as zero: the pressure of such a node would be nearly arbitrary.
NO_AREA = 1e-3


def carried(
    closed: Mask, nodal: Array, shares: Array, areas: Array, side: Surface, may_pull: bool = False
) -> tuple[Mask, Array]:
    """Return the closed nodes (m,) without tension, and pressures (m,) at these nodes that carry the contact force.

    Parameters
    ----------
    closed : ndarray of bool (m,)
        Nodes in contact.
    nodal : ndarray (m,)
        Pressures of all nodes [pressure].
    shares : ndarray (m,)
        Shares of all nodes in the contact force: their pressures times their areas, except at nodes without area [force].
    areas : ndarray (m,)
        Integrals of the shape functions of the nodes over the side [area].
    side : Surface
    may_pull : bool
        Whether pressures of closed nodes may be negative.
    """
    while True:
        if not may_pull:
            closed = closed & (nodal >= 0.0)
            if shares.sum() > 0.0 and not _takers(closed, areas).any():
                return _alone(shares, areas)
        pressure = nodal + _received(closed, nodal, shares, areas, side)
        tension = closed & (pressure < 0.0)
        if may_pull or not tension.any():
            return closed, np.where(closed, pressure, 0.0)
        closed = closed & ~tension


def _received(closed: Mask, nodal: Array, shares: Array, areas: Array, side: Surface) -> Array:
    """Return the changes (m,) of pressures at closed nodes by the shares of other nodes; for parameters see `carried`."""
    takers = _takers(closed, areas)
    moving = np.where(closed, shares - nodal * areas, shares)
    moving[takers | (np.abs(moving) <= SUM_ROUND_OFF * np.abs(shares).max(initial=0.0))] = 0.0
    if not moving.any():
        return np.zeros_like(moving)
    # Shares move from ring to ring towards the receiving nodes, beginning with the ring that is farthest away.
    rings = _rings(takers, moving, side)
    for inner, outer in zip(rings[-2::-1], rings[:0:-1], strict=True):
        room = np.where(inner, areas if inner is takers else 1.0, 0.0)
        given = np.divide(moving, side.near @ room, out=np.zeros_like(moving), where=outer)
        moving = np.where(outer, 0.0, moving) + room * (side.near @ given)
    return np.divide(moving, areas, out=np.zeros_like(moving), where=takers)


def _takers(closed: Mask, areas: Array) -> Mask:
    """Return the closed nodes (m,) with an area, which may receive shares of other nodes."""
    return closed & (areas > NO_AREA * np.abs(areas).mean())


def _alone(shares: Array, areas: Array) -> tuple[Mask, Array]:
    """Return the node with the largest share as the only closed one (m,), with the pressure (m,) for the complete force."""
    most = np.argmax(np.where(_takers(np.ones(len(areas), bool), areas), shares, -np.inf))
    closed = np.arange(len(areas)) == most
    return closed, np.where(closed, shares.sum() / areas[most], 0.0)


def _rings(takers: Mask, moving: Array, side: Surface) -> list[Mask]:
    """Return masks (m,) of the receiving nodes, of their neighbours, and so on, until all nodes with shares are included."""
    rings, reached = [takers], takers.copy()
    while (moving[~reached] != 0.0).any():
        ring = (side.near @ rings[-1].astype(np.float64) > 0.0) & ~reached
        if not ring.any():
            break
        rings.append(ring)
        reached |= ring
    return rings
