"""Two like blocks with crowned faces that touch along a line: long cylinders in contact, for shear as well."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastcontact.errors import MeshError
from fastcontact.mesh.generate._check import QUADRANGLES, growth_of, one_of, positive, segments
from fastcontact.mesh.generate._lattice import growing, on_lines
from fastcontact.mesh.generate._places import with_cells_inside, with_points_at
from fastcontact.mesh.generate.transform import mirrored, renamed, union
from fastcontact.mesh.mesh import Mesh

Array = NDArray[np.float64]
_NAMES = {"LOWER": "LOWER", "TOP": "CONT_LOWER", "BOTTOM": "FAR_LOWER"}


def crowned_blocks(
    element: str = "quad4",
    *,
    R: float = 500.0,
    extent: float = 40.0,
    contact_radius: float = 1.1,
    contact_size: float = 0.05,
    growth: float = 1.25,
) -> Mesh:
    """Two blocks above each other whose facing sides are parabolas of radius R that touch at the origin.

    Both represent half planes. They are whole, x < 0 as well, for tangential loads, and mirror each other, so that nodes
    match and equal materials do not couple pressure and shear. Groups of cells: LOWER, UPPER, CONT_LOWER,
    CONT_UPPER (their facing sides around the origin), FAR_LOWER, FAR_UPPER (the flat sides far from it). Groups of
    points: POLE_LOWER, POLE_UPPER (two points at the origin).

    Parameters
    ----------
    element : {"quad4", "quad8", "quad9"}
        Element of both solids.
    R : float
        Radius at the origin of each facing side [length].
    extent : float
        Height and half the width of each block [length].
    contact_radius : float
        Distance from the origin up to which edges have their smallest length. Choose it a little wider than the contact
        [length].
    contact_size : float
        That length [length].
    growth : float
        Length of an edge beyond over that of its neighbour nearer to the origin, more than 1.

    Examples
    --------
    >>> mesh = crowned_blocks(contact_size=0.1)
    >>> mesh.point("POLE_LOWER") == mesh.point("POLE_UPPER")
    False
    """
    one_of("element", element, QUADRANGLES)
    R, whole, rate = positive("R", R), positive("extent", extent), growth_of("growth", growth)
    if whole > R:
        raise MeshError(f"extent = {whole:g} is out of range: it must be at most R = {R:g}")
    fine = positive("contact_radius", contact_radius, whole / 2, "extent/2")
    size = positive("contact_size", contact_size, fine, "contact_radius")
    right, down = _lines(size, fine, whole, rate), _lines(size, size, whole, rate)
    lattice = on_lines(element, [np.concatenate([-right[:0:-1], right]), -down[::-1]], "LOWER")
    across, up = lattice.points.T
    crown = across**2 / (2 * R) * (1 + up / whole)  # fades away downward
    lower = renamed(lattice.replace(points=np.column_stack([across, up - crown])), _NAMES.get)
    lower = with_cells_inside(lower, "CONT_LOWER", "CONT_LOWER", lambda points: np.abs(points[:, 0]) <= 1.2 * fine)
    lower = with_points_at(lower, {"POLE_LOWER": (0.0, 0.0)})
    upper = mirrored(lower, "y", rename=lambda name: name.replace("LOWER", "UPPER"))
    return union(lower, upper)


def _lines(size: float, fine: float, length: float, growth: float) -> Array:
    """Return places (n + 1,) [length] from 0 to `length`: about `size` apart up to `fine`, then growing."""
    equal = np.linspace(0.0, fine, segments(round(fine / size)) + 1)
    return np.concatenate([equal, fine + growing(length - fine, size * growth, growth)[1:]])
