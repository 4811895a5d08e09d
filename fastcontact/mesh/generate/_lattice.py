"""Blocks and boxes between grid lines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fastcontact.mesh.generate.blocks import block
from fastcontact.mesh.generate.box import box
from fastcontact.mesh.mesh import Mesh

Array = NDArray[np.float64]


def on_lines(element: str, lines: Sequence[Array], name: str = "BLOCK") -> Mesh:
    """Return a block, or a box in three dimensions, with the groups of `block` or `box`.

    Parameters
    ----------
    element : str
        Element of the solid.
    lines : sequence of ndarray (n + 1,)
        Coordinates of the grid lines of each axis, ascending [length].
    name : str
        Name of the solid group.
    """
    divisions = [len(places) - 1 for places in lines]
    if len(lines) == 2:
        lattice = block((divisions[0], divisions[1]), (divisions[0], divisions[1]), element, name=name)
    else:
        n, m, k = divisions
        lattice = box((n, m, k), (n, m, k), element, name=name)
    moved = [np.interp(x, np.arange(len(places)), places) for x, places in zip(lattice.points.T, lines, strict=True)]
    return lattice.replace(points=np.column_stack(moved))
