"""Blocks and boxes between grid lines, and the places of those lines."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fastcontact.mesh.generate._check import segments
from fastcontact.mesh.generate._spacing import Spacing, divided
from fastcontact.mesh.generate.blocks import block
from fastcontact.mesh.generate.box import box
from fastcontact.mesh.mesh import Mesh

Array = NDArray[np.float64]


def graded(length: float, spacing: Spacing) -> Array:
    """Return places (n + 1,) [length] from 0 to `length`, their distances after a spacing about 0."""
    return divided(lambda s: np.column_stack([length * s, np.zeros(len(s))]), length, spacing)[:, 0]


def growing(length: float, first: float, growth: float) -> Array:
    """Return places (n + 1,) [length] from 0 to `length`: about `first` apart, then each time `growth` times as far."""
    n = segments(np.log1p(length * (growth - 1.0) / first) / np.log(growth))
    places = np.concatenate([[0.0], np.cumsum(growth ** np.arange(n))])
    return np.asarray(length * places / places[-1])


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
