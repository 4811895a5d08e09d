"""Mesh of two concentric rings, for example for the press fit of a bush in a hub."""

from __future__ import annotations

import math

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.errors import MeshError
from fastcontact.mesh.generate._blocks import structured
from fastcontact.mesh.generate._check import FACES, TRIANGLES, affordable, count, each, one_of, positive
from fastcontact.mesh.generate.quadratic import Circle, in_element
from fastcontact.mesh.generate.transform import union
from fastcontact.mesh.mesh import Mesh


@typed(MeshError)
def rings(
    element: str = "quad8",
    *,
    inner_radius: float = 20.0,
    interface_radius: float = 50.0,
    outer_radius: float = 100.0,
    divisions_inner: tuple[int, int] = (6, 16),
    divisions_outer: tuple[int, int] = (8, 16),
) -> Mesh:
    """Quarter of two concentric rings, the part x >= 0, y >= 0; the rings touch at the interface radius.

    The rings fit without clearance. To model an interference, give their contact pair a negative ``clearance``. Groups of
    cells: INNER, OUTER, CONT_INNER, CONT_OUTER (the two sides of the interface), BORE (inner side of the inner ring), RIM
    (outer side of the outer ring), SYMMETRY_X (x = 0 of both rings), SYMMETRY_Y (y = 0 of both rings).

    Parameters
    ----------
    element : {"tri3", "tri6", "quad4", "quad8", "quad9"}
        Element type of both solids; mid-side nodes of curved sides lie on their circles.
    inner_radius, interface_radius, outer_radius : float
        Radii of the bore, of the interface and of the rim, in ascending order [length].
    divisions_inner, divisions_outer : (int, int)
        Numbers of cells of each ring in the radial and in the circumferential direction; the latter may differ.

    Returns
    -------
    Mesh

    Examples
    --------
    >>> sorted(rings("quad4").cell_groups)[:4]
    ['BORE', 'CONT_INNER', 'CONT_OUTER', 'INNER']
    """
    one_of("element", element, FACES)
    a, b = positive("inner_radius", inner_radius), positive("interface_radius", interface_radius)
    c = positive("outer_radius", outer_radius)
    if not a < b < c:
        raise MeshError(f"inner_radius, interface_radius and outer_radius must increase, not {a:g}, {b:g}, {c:g}")
    return union(
        _ring(element, (a, b), each(count, "divisions_inner", divisions_inner), "INNER", ("BORE", "CONT_INNER")),
        _ring(element, (b, c), each(count, "divisions_outer", divisions_outer), "OUTER", ("CONT_OUTER", "RIM")),
    )


def _ring(element: str, radii: tuple[float, float], divisions: list[int], name: str, sides: tuple[str, str]) -> Mesh:
    """Return a quarter of one ring; `sides` are the names of the groups at the smaller and at the larger radius."""
    n, m = divisions
    r, angle = np.linspace(*radii, n + 1), np.linspace(0.0, math.pi / 2, m + 1)
    cosine, sine = np.cos(angle), np.sin(angle)
    cosine[-1] = 0.0
    affordable(n * m)
    grid = r[:, None, None] * np.column_stack([cosine, sine])[None]
    groups = {"LEFT": sides[0], "RIGHT": sides[1], "BOTTOM": "SYMMETRY_Y", "TOP": "SYMMETRY_X"}
    mesh = structured(grid, name, groups, triangles=element in TRIANGLES)
    circles = [Circle((0.0, 0.0), radius, group) for radius, group in zip(radii, sides, strict=True)]
    return in_element(mesh, element, circles)
