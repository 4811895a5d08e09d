"""Wear as a compliance: in a load step, the wear depth at a constraint increases with its contact pressure."""

from __future__ import annotations

import numpy as np

from fastcontact._tools.neighbours import nearest
from fastcontact._tools.records import record, replace
from fastcontact.arrays import Array
from fastcontact.contact.constraints import Constraints


@record
class WearCompliance:
    """Wear depth at the end of a load step, linearised about an earlier solution of the step.

    Attributes
    ----------
    depth, nodal_pressure : ndarray (n_nodes,)
        Wear depth at the secondary nodes [length] and pressure there [pressure] in this solution.
    slope : ndarray (n_nodes,)
        Derivative of the wear depth of each node with respect to its pressure [length / pressure].
    nodes : ndarray (n_nodes, dim)
        Reference positions of the nodes [length].
    pressure : ndarray (k,)
        Pressures at the k constraints in this solution [pressure].
    positions : ndarray (k, dim)
        Reference positions of these constraints [length].
    """

    depth: Array
    nodal_pressure: Array
    slope: Array
    nodes: Array
    pressure: Array
    positions: Array

    @classmethod
    def constant(cls, depth: Array, nodes: Array) -> WearCompliance:
        """Return a wear `depth` (n_nodes,) at `nodes` (n_nodes, dim) that does not depend on pressures [length]."""
        zero = np.zeros_like(depth)
        return cls(depth, zero, zero, nodes, zero, nodes)

    def added_to(self, constraints: Constraints) -> Constraints:
        """Return constraints, whose gaps include `depth`, with the change of the depth due to changes of pressures.

        Constraints without an area, and those in the part that fluid fills, carry no contact pressure.
        """
        areas = constraints.finite_areas
        dry = areas > 0.0 if constraints.wetted is None else (areas > 0.0) & ~constraints.wetted.rows
        slope = np.where(dry, self.slope[nearest(self.nodes, constraints.positions)[1]], 0.0)
        pressure = self.pressure[nearest(self.positions, constraints.positions)[1]]
        softness, of_wear = constraints.softness.copy(), np.divide(slope, areas, out=np.zeros_like(slope), where=dry)
        softness[0] += of_wear
        gap0 = constraints.gap0 - slope * pressure
        return replace(constraints, gap0=gap0, softness=softness, wear_softness=of_wear)
