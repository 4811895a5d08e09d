"""A warning about nodal pressures that oscillate from node to node, as on triangles that are much deeper than wide."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fastcontact.contact.formulations import Formulation
from fastcontact.results.step import ContactResult

# Median difference of a nodal pressure from the mean of its neighbours, over the mean pressure, above which a warning is
# given. On rings of tri3 cells 4.6 times as deep as wide it is 0.30, with pressure errors of 0.16 to 0.27; on wider ones
# 0.16 (0.09 to 0.13), on quadrangles 0.002; under punches of hex8 and tet4, whose pressures are singular at the edges,
# 0.10 to 0.12, and under a wearing hex8 sole 0.22.
WAVERING = 0.25
# Smallest number of nodes for which the median is meaningful.
MANY = 10


def wavering(pair: Formulation, contact: ContactResult) -> Iterator[str]:
    """Yield a warning where pressures of nodes whose neighbours are all closed oscillate by much of their mean.

    Sides that never separate, or adhere, carry tension, too: their mean may be zero or round-off, and is not meaningful.
    """
    if pair.options.always_closed or pair.options.cohesion is not None:
        return
    neighbours = pair.secondary.beside
    # A node is among its own neighbours here: the number of others is one less.
    others = np.asarray(neighbours.sum(axis=1)).ravel() - 1.0
    inside = contact.active & (neighbours @ ~contact.active == 0) & (others > 0)
    if inside.sum() < MANY:
        return
    pressure = contact.pressure[inside]
    deviation = pressure - ((neighbours @ contact.pressure)[inside] - pressure) / others[inside]
    size, mean = float(np.median(np.abs(deviation))), float(pressure.mean())
    if not size > WAVERING * mean > 0.0:
        return
    cells = f"quadrangles or hexahedra along '{pair.secondary.group}', or triangles or tetrahedra there about as deep as wide"
    yield (
        f"contact '{contact.name}': nodal pressures waver from node to node, by {0.5 * size:.3g} up and down about a mean of "
        f"{mean:.3g}: trust means over neighbouring nodes, or take {cells if pair.name == 'mortar' else 'formulation mortar'}"
    )
