r"""Non-negative nodal pressures that vanish at open nodes and integrate to the contact force.

A pressure field obtained by projection undershoots beyond the edge of the contact, and its values at open nodes contribute to
the force: :math:`\int p_h\,dA = \sum_j A_j p_j` holds for all nodes together. The share :math:`A_j p_j` of an open node is
therefore not dropped but distributed over the closed nodes nearby, those of its facets and of the adjacent facets, all of
which change by the same pressure. This is the smallest change over this set of nodes; fewer nodes would produce a kink, and
more would lie farther from the error. A closed node in tension becomes an open one.
"""

from __future__ import annotations

import numpy as np

from fastcontact.arrays import Array, Mask
from fastcontact.contact.surface import Surface
from fastcontact.round_off import SUM_ROUND_OFF

# Less than this fraction of an area counts as none: a node would have any pressure, a multiplier next to no equation.
NO_AREA = 1e-3


def carried(
    closed: Mask, nodal: Array, shares: Array, areas: Array, side: Surface, may_pull: bool = False
) -> tuple[Mask, Array]:
    """Return the nodes that are closed without tension, and the pressures (m,) with which they carry all shares.

    Parameters
    ----------
    closed : ndarray of bool (m,)
        Nodes in contact.
    nodal : ndarray (m,)
        Pressures of all nodes [pressure].
    shares : ndarray (m,)
        Shares of all nodes in the resultant: their pressures times their areas, except at nodes without area [force].
    areas : ndarray (m,)
        Integrals of the nodes' shape functions over the whole side [area].
    side : Surface
    may_pull : bool
        Whether closed nodes may be in tension.
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
    """Return the pressures (m,) that closed nodes take from others; arguments as of `carried`."""
    takers = _takers(closed, areas)
    moving = np.where(closed, shares - nodal * areas, shares)
    moving[takers | (np.abs(moving) <= SUM_ROUND_OFF * np.abs(shares).max(initial=0.0))] = 0.0
    if not moving.any():
        return np.zeros_like(moving)
    # From ring to ring towards the receiving nodes, the farthest first.
    rings = _rings(takers, moving, side)
    for inner, outer in zip(rings[-2::-1], rings[:0:-1], strict=True):
        room = np.where(inner, areas if inner is takers else 1.0, 0.0)
        given = np.divide(moving, side.near @ room, out=np.zeros_like(moving), where=outer)
        moving = np.where(outer, 0.0, moving) + room * (side.near @ given)
    return np.divide(moving, areas, out=np.zeros_like(moving), where=takers)


def _takers(closed: Mask, areas: Array) -> Mask:
    return closed & (areas > NO_AREA * np.abs(areas).mean())


def _alone(shares: Array, areas: Array) -> tuple[Mask, Array]:
    """Return the node with the largest share as the only closed one, and pressures (m,) with which it carries all shares."""
    most = np.argmax(np.where(_takers(np.ones(len(areas), bool), areas), shares, -np.inf))
    closed = np.arange(len(areas)) == most
    return closed, np.where(closed, shares.sum() / areas[most], 0.0)


def _rings(takers: Mask, moving: Array, side: Surface) -> list[Mask]:
    """Return the receiving nodes, their neighbours, and so on, until all nodes with shares to move are included."""
    rings, reached = [takers], takers.copy()
    while (moving[~reached] != 0.0).any():
        ring = (side.near @ rings[-1].astype(np.float64) > 0.0) & ~reached
        if not ring.any():
            break
        rings.append(ring)
        reached |= ring
    return rings
