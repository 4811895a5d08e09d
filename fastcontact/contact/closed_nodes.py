r"""Non-negative nodal pressures that vanish at open nodes and integrate to the contact force.

A pressure field :math:`p_h` with the nodal values :math:`p_j`, which is obtained by projection, is not zero beyond the edge
of the contact. Its values at open nodes also contribute to the contact force :math:`\int p_h\,dA = \sum_j A_j p_j`, where
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

# Nodal areas below this fraction of the mean count as zero, because the pressures of such nodes would be nearly arbitrary.
NO_AREA = 1e-3


def carried(constraints: Constraints, forces: Array, closed: Mask, side: Surface) -> tuple[Mask, Array]:
    """Return the closed nodes (n,) without tension, and pressures (n,) at these nodes that carry the contact force.

    Parameters
    ----------
    constraints : Constraints
        The m constraints of the pair. If some are equations, pressures of closed nodes may be negative.
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
    with_area = areas > NO_AREA * np.abs(areas).mean()  # nodes that may receive shares of others
    while True:
        if not may_pull:
            closed = closed & (nodal >= 0.0)
            if shares.sum() > 0.0 and not (closed & with_area).any():
                largest = np.argmax(np.where(with_area, shares, -np.inf))
                single_node = np.arange(len(areas)) == largest
                return single_node, np.where(single_node, shares.sum() / areas[largest], 0.0)
        receivers = closed & with_area
        moved = np.where(closed, shares - nodal * areas, shares)
        moved[receivers | (np.abs(moved) <= SUM_ROUND_OFF * np.abs(shares).max(initial=0.0))] = 0.0
        pressure = nodal + (_received(receivers, moved, areas, side) if moved.any() else np.zeros_like(moved))
        tension = closed & (pressure < 0.0)
        if may_pull or not tension.any():
            return closed, np.where(closed, pressure, 0.0)
        closed = closed & ~tension


def _received(receivers: Mask, moved: Array, areas: Array, side: Surface) -> Array:
    """Return the changes (n,) of pressures at the `receivers` (n,) due to the shares `moved` (n,) of other nodes [pressure].

    Shares move from ring to ring of neighbours towards the receiving nodes, beginning with the ring that is farthest away.
    """
    rings, reached = [receivers], receivers.copy()
    while (moved[~reached] != 0.0).any():
        ring = (side.near @ rings[-1].astype(np.float64) > 0.0) & ~reached
        if not ring.any():
            break
        rings.append(ring)
        reached |= ring
    for inner, outer in zip(rings[-2::-1], rings[:0:-1], strict=True):
        weights = np.where(inner, areas if inner is receivers else 1.0, 0.0)
        per_weight = np.divide(moved, side.near @ weights, out=np.zeros_like(moved), where=outer)
        moved = np.where(outer, 0.0, moved) + weights * (side.near @ per_weight)
    return np.divide(moved, areas, out=np.zeros_like(moved), where=receivers)
