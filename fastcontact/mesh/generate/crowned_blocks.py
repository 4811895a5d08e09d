"""Two like blocks with crowned faces that touch along a line: long cylinders in contact, for shear as well."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastcontact.errors import MeshError
from fastcontact.mesh.generate._check import QUADRANGLES, one_of, positive, segments
from fastcontact.mesh.generate._places import with_points_at
from fastcontact.mesh.generate.blocks import block
from fastcontact.mesh.generate.transform import mirrored, renamed, union
from fastcontact.mesh.mesh import Mesh

Array = NDArray[np.float64]


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

    Both stand for half planes. They are whole, x < 0 as well, so that they can be drawn along, and mirror each other, so
    that nodes match and like materials do not couple pressure and shear. Groups of cells: LOWER, UPPER, CONT_LOWER,
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

    Raises
    ------
    MeshError
        If an argument is out of range.

    Examples
    --------
    >>> mesh = crowned_blocks(contact_size=0.1)
    >>> mesh.point("POLE_LOWER") == mesh.point("POLE_UPPER")
    False
    """
    one_of("element", element, QUADRANGLES)
    R, whole = positive("R", R), positive("extent", extent)
    if whole > R:
        raise MeshError(f"extent = {whole:g} is out of range: it must be at most R = {R:g}")
    fine = positive("contact_radius", contact_radius, whole / 2, "extent/2")
    size = positive("contact_size", contact_size, fine, "contact_radius")
    if not (rate := positive("growth", growth)) > 1.0:
        raise MeshError(f"growth = {growth:g} is out of range: it must be more than 1")
    right, down = _lines(size, fine, whole, rate), _lines(size, size, whole, rate)
    x, y = np.concatenate([-right[:0:-1], right]), -down[::-1]
    lattice = block((len(x) - 1.0, len(y) - 1.0), (len(x) - 1, len(y) - 1), element, name="LOWER")
    across, up = (np.interp(p, np.arange(len(v)), v) for p, v in zip(lattice.points.T, (x, y), strict=True))
    crown = across**2 / (2 * R) * (1 + up / whole)  # fades away downward
    lower = _named(lattice.replace(points=np.column_stack([across, up - crown])), across, 1.2 * fine)
    upper = mirrored(lower, "y", rename=lambda name: name.replace("LOWER", "UPPER"))
    return union(lower, upper)


def _lines(size: float, fine: float, length: float, growth: float) -> Array:
    """Return places from 0 to `length`: edges of about `size` up to `fine`, then each `growth` times the last."""
    equal = np.linspace(0.0, fine, segments(round(fine / size)) + 1)
    n = segments(np.log1p((length - fine) * (growth - 1.0) / (size * growth)) / np.log(growth))
    beyond = np.cumsum(growth ** np.arange(n))
    return np.concatenate([equal, fine + (length - fine) * beyond / beyond[-1]])


def _named(mesh: Mesh, across: Array, reach: float) -> Mesh:
    """Return the lower block with its groups, the contact up to |x| = `reach`."""
    mesh = renamed(mesh, {"LOWER": "LOWER", "TOP": "CONT_LOWER", "BOTTOM": "FAR_LOWER"}.get)
    ((kind, rows),) = mesh.split(mesh.cell_groups["CONT_LOWER"]).items()
    inside = (np.abs(across[mesh.cells[kind][rows]]) <= reach).all(axis=1)
    mesh = mesh.with_groups(cells={"CONT_LOWER": mesh.offsets[kind] + rows[inside]})
    return with_points_at(mesh, {"POLE_LOWER": (0.0, 0.0)})
