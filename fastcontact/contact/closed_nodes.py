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
from fastcontact.contact.constraints import Constraints
from fastcontact.contact.surface import Surface
from fastcontact.round_off import SUM_ROUND_OFF

# Areas below this fraction of the typical area count as zero: the pressure of such a node would be nearly arbitrary.
NO_AREA = 1e-3


def carried(constraints: Constraints, forces: Array, closed: Mask, side: Surface) -> tuple[Mask, Array]:
    """Return the closed nodes (n,) without tension, and pressures (n,) at these nodes that carry the contact force.

    Parameters
    ----------
    constraints : Constraints
        The m constraints of the pair. With equality constraints, pressures of closed nodes may be negative.
    forces : ndarray (m,)
        Normal forces of the constraints [force].
    closed : ndarray of bool (n,)
        Nodes in contact.
    side : Surface
        The secondary side.
    """
    field, may_pull = constraints.nodal, bool(constraints.equality.any())
    assert field is not None
    nodal, shares, areas = field.over_whole_side(forces), field.shares(forces), field.nodal_areas
    with_area = areas > NO_AREA * np.abs(areas).mean()  # these may receive shares of other nodes
    while True:
        if not may_pull:
            closed = closed & (nodal >= 0.0)
            if shares.sum() > 0.0 and not (closed & with_area).any():
                most = np.argmax(np.where(with_area, shares, -np.inf))
                alone = np.arange(len(areas)) == most
                return alone, np.where(alone, shares.sum() / areas[most], 0.0)
        takers = closed & with_area
        moving = np.where(closed, shares - nodal * areas, shares)
        moving[takers | (np.abs(moving) <= SUM_ROUND_OFF * np.abs(shares).max(initial=0.0))] = 0.0
        pressure = nodal + (_received(takers, moving, areas, side) if moving.any() else np.zeros_like(moving))
        tension = closed & (pressure < 0.0)
        if may_pull or not tension.any():
            return closed, np.where(closed, pressure, 0.0)
        closed = closed & ~tension


def _received(takers: Mask, moving: Array, areas: Array, side: Surface) -> Array:
    """Return the changes (n,) of pressures at the nodes `takers` (n,) by the shares `moving` (n,) of other nodes [pressure].

    Shares move from ring to ring of neighbours towards the receiving nodes, beginning with the ring that is farthest away.
    """
    rings, reached = [takers], takers.copy()
    while (moving[~reached] != 0.0).any():
        ring = (side.near @ rings[-1].astype(np.float64) > 0.0) & ~reached
        if not ring.any():
            break
        rings.append(ring)
        reached |= ring
    for inner, outer in zip(rings[-2::-1], rings[:0:-1], strict=True):
        room = np.where(inner, areas if inner is takers else 1.0, 0.0)
        given = np.divide(moving, side.near @ room, out=np.zeros_like(moving), where=outer)
        moving = np.where(outer, 0.0, moving) + room * (side.near @ given)
    return np.divide(moving, areas, out=np.zeros_like(moving), where=takers)
