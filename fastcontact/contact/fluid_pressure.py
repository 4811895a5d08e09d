"""Fluid that penetrates between the sides of a contact pair, wherever they are open and connected with its source.

A node is open to the fluid if what presses it together is no more than the fluid, and at first if its gap is open; such nodes
of one facet are connected. There the force is that of the fluid, on both sides alike, in the place of that of contact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from fastcontact.arrays import Array, Mask
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints
from fastcontact.contact.surface import Surface

# A force that does not depend on the gap is a line of so small a slope: it vanishes at so many lengths of the side.
FAR = 1e6
# Gaps below this part of the length of the side are closed; pressures that differ by less of their size are the same.
CLOSED, ALIKE = 1e-10, 1e-9


@dataclass(frozen=True, eq=False)
class Wetted:
    """Where the fluid has come.

    Attributes
    ----------
    rows : ndarray of bool (m,)
        Constraints.
    pressure : ndarray (n_nodes,)
        At the secondary nodes [pressure].
    """

    rows: Mask
    pressure: Array


def wetted(constraints: Constraints, at: Configuration, side: Surface, source: Mask, points: Array) -> Constraints:
    """Return constraints `constraints` under the fluid pressure of a configuration.

    The fluid comes from the nodes `source` (n_nodes,) of the secondary side; `points` (n_points, dim) are reference
    coordinates [length]. Contact pressures are those of the last pairing; before the first one what is closed is tight.
    """
    if not at.fluid_pressure > 0.0:
        return constraints
    assert constraints.areas is not None
    assert constraints.nodal is not None
    size = float(np.linalg.norm(np.ptp(points[side.points], axis=0)))
    gaps = constraints.gaps(at.displacement)
    nodal, node = constraints.nodal.weighted_gaps(np.where(constraints.usable, gaps, np.inf))
    if at.pressure is None:
        passable = nodal > CLOSED * size
    else:  # a node that is pressed together is tight, even if places beside it are what is closed
        passable = (nodal > -CLOSED * size) & (at.pressure <= (1.0 + ALIKE) * at.fluid_pressure)
    nodes = reached(side, source, passable)
    rows = nodes[node] & constraints.usable
    far = FAR * size
    none = np.zeros(len(constraints))
    return replace(
        constraints,
        gap0=np.where(rows, constraints.gap0 - gaps - far, constraints.gap0),
        softness=np.where(
            rows,
            far / (at.fluid_pressure * constraints.areas),
            none if constraints.softness is None else constraints.softness,
        ),
        equality=rows if constraints.equality is None else constraints.equality | rows,
        friction=None if constraints.friction is None else np.where(rows, 0.0, constraints.friction),
        wetted=Wetted(rows, np.where(nodes, at.fluid_pressure, 0.0)),
    )


def reached(side: Surface, source: Mask, passable: Mask) -> Mask:
    """Return which of the `passable` nodes (n_nodes,) facets of a side connect with those of the source."""
    count, n = side.n_facets, len(passable)
    nodes = np.concatenate([block.local.ravel() for block in side.blocks])
    facet = np.repeat(np.arange(count), np.concatenate([np.full(len(b.local), b.local.shape[1]) for b in side.blocks]))
    kept = passable[nodes]
    graph = csr_array((np.ones(kept.sum()), (nodes[kept], n + facet[kept])), shape=(n + count, n + count))
    component = connected_components(graph, directed=False)[1][:n]
    return passable & np.isin(component, component[source & passable])
