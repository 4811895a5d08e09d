"""Meshes of quarter discs and rings, such as the two half-spheres of the test case FORMA04 in the (r, y) plane."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.arrays import Array
from fastcontact.errors import MeshError
from fastcontact.mesh.generate._check import FACES, TRIANGLES, check_size, count, each, one_of, positive, refuse, within
from fastcontact.mesh.generate._spacing import Spacing, arc, coons_patch, divide, grid_mesh, progression, straight_side
from fastcontact.mesh.generate._triangulate import triangulated_body
from fastcontact.mesh.generate.quadratic import Circle, converted_to
from fastcontact.mesh.generate.transform import merge_points, mirrored, union, with_points_at
from fastcontact.mesh.mesh import Mesh

# Group names of the upper body, by the corresponding names of the lower body. A1A2 is the axis of both bodies.
_UPPER_NAMES = {"SPHBAS": "SPHHAU", "A1B1": "A2B2", "CONT1": "CONT2", "D1B1": "D2B2"}
_UPPER_NAMES |= {f"{letter}1": f"{letter}2" for letter in "ABCD"} | {f"{letter}1": letter for letter in "MNP"}


@typed(MeshError)
def half_spheres(
    element: str = "tri3",
    *,
    R: float = 50.0,
    size: float | None = None,
    contact_size: float | None = None,
    contact_radius: float | None = None,
    arc_sizes: tuple[float, float] | None = None,
    segments: int | None = None,
    radial_sizes: tuple[float, float] | None = None,
) -> Mesh:
    """Return two half-spheres that touch at the origin, each a quarter disc in the (r, y) plane.

    The lower body has its centre at A1 = (0, -R), the end of its flat side at B1 = (R, -R), its pole at C1 = (0, 0), and
    D1 at the middle of its arc. The upper body is the mirror image in y = 0. The poles C1 and C2 are two points at the
    same position. The generator is deterministic.

    Groups of cells: SPHBAS (lower body), SPHHAU (upper body), A1A2 (axis of both bodies), A1B1, A2B2 (flat sides), CONT1,
    CONT2 (arcs C1-D1 and C2-D2), D1B1, D2B2 (the rest of the arcs). Groups of points: A1, B1, C1, D1, A2, B2, C2, D2; with
    quadrangles also the corners of structured blocks, M = (0, R/2), N = (R/2, R/2) and P = (R/2, R) in the upper body, and
    M1, N1 and P1 in the lower body.

    Parameters
    ----------
    element : {"tri3", "tri6", "quad4", "quad8", "quad9"}
        Element type of both bodies. Triangles form an unstructured mesh, quadrangles three structured blocks in each body.
        The mid-side nodes of quadratic elements lie on the circle.
    R : float
        Radius [length].
    size : float, optional
        Only for triangles: largest edge length, at most R; by default R/25 [length].
    contact_size : float, optional
        Only for triangles: edge length at the pole, at most `size`. The edge length increases linearly to `size` at the
        distance R. By default the mesh is uniform [length].
    contact_radius : float, optional
        Only for triangles: distance from the pole up to which edges have the length `contact_size`, at most R/2; by
        default 0 [length].
    arc_sizes : (float, float), optional
        Only for quadrangles: lengths of the segments at the ends C and D of the arc C-D; by default R/250 and R/25
        [length]. The lengths in between form a geometric progression. All are reduced by a common factor such that the
        segments fill the arc.
    segments : int, optional
        Only for quadrangles: number of segments on the side A-M of the inner square, on the arc D-B, and on the radial
        lines M-C, N-D and P-B; by default 15.
    radial_sizes : (float, float), optional
        Only for quadrangles: lengths of the segments at the ends C and M of the radial line M-C [length]. The lengths in
        between form a geometric progression. By default there are `segments` segments, whose lengths at C and at M have
        the same ratio as those of the arc at C and at D.

    Returns
    -------
    Mesh

    Raises
    ------
    MeshError
        If an argument is out of range, or does not belong to the element type.

    Examples
    --------
    >>> mesh = half_spheres("quad4", segments=4, arc_sizes=(2.0, 5.0))
    >>> mesh.point("C1") == mesh.point("C2")
    False
    """
    lower = quarter_disc(
        element, R=R, size=size, contact_size=contact_size, contact_radius=contact_radius, arc_sizes=arc_sizes,
        segments=segments, radial_sizes=radial_sizes,
    )  # fmt: skip
    return union(lower, mirrored(lower, "y", rename=_UPPER_NAMES))


@typed(MeshError)
def quarter_disc(
    element: str = "tri3",
    *,
    body: str = "lower",
    R: float = 50.0,
    size: float | None = None,
    contact_size: float | None = None,
    contact_radius: float | None = None,
    arc_sizes: tuple[float, float] | None = None,
    segments: int | None = None,
    radial_sizes: tuple[float, float] | None = None,
) -> Mesh:
    """Return one of the two bodies of `half_spheres`, with the groups of this body.

    By default, triangles are as coarse at the contact as elsewhere: the facets have a length of 0.039 R (1584 cells, 20
    facets on the contact arc), so that a contact radius of 0.2 R has five facets. For smaller ones, give `contact_size`. By
    default, quadrangles have facets of 0.004 R at the pole, which increase to 0.04 R at 45 degrees (1725 cells, 50 facets on
    the contact arc).

    Parameters
    ----------
    element, R, size, contact_size, contact_radius, arc_sizes, segments, radial_sizes
        See `half_spheres`.
    body : {"lower", "upper"}
        The body to generate.

    Returns
    -------
    Mesh

    Raises
    ------
    MeshError
        If an argument is out of range, or does not belong to the element type.

    Examples
    --------
    >>> from fastcontact import generate
    >>> len(generate.quarter_disc("quad4").cells["quad4"])
    1725
    >>> disc = generate.quarter_disc("tri6", body="upper", R=50.0, size=5.0, contact_size=0.5)
    >>> disc.group_names[:4]
    ['SPHHAU', 'A2B2', 'D2B2', 'CONT2']
    """
    one_of("element", element, FACES)
    one_of("body", body, ("lower", "upper"))
    R = positive("R", R)
    if element in TRIANGLES:
        refuse(element, "size", "contact_size", arc_sizes=arc_sizes, segments=segments, radial_sizes=radial_sizes)
        linear = _triangle_mesh(R, _spacing(R, size, contact_size, contact_radius))
    else:
        sizes = {"size": size, "contact_size": contact_size, "contact_radius": contact_radius}
        refuse(element, "arc_sizes", "radial_sizes", "segments", **sizes)
        linear = _quadrangle_mesh(R, arc_sizes, segments, radial_sizes)
    disc = converted_to(linear, element, [Circle((0.0, -R), R, group) for group in ("CONT1", "D1B1")])
    return disc if body == "lower" else mirrored(disc, "y", rename=_UPPER_NAMES)


def _corners(R: float) -> dict[str, tuple[float, float]]:
    """Return the corners of the lower body by name. D1 is bitwise identical to the node of the arc."""
    x, y = arc((0.0, -R), R, np.array([0.25 * math.pi]))[0]
    return {"A1": (0.0, -R), "B1": (R, -R), "C1": (0.0, 0.0), "D1": (float(x), float(y))}


def _spacing(R: float, size: float | None, contact_size: float | None, contact_radius: float | None) -> Spacing:
    """Return the spacing of triangles, after a check of the arguments of `half_spheres`."""
    far = R / 25 if size is None else positive("size", size, R, "R")
    if contact_size is None:
        refuse("uniform", contact_radius=contact_radius)
        return Spacing(far, far, reach=R)
    near = positive("contact_size", contact_size, far, "size")
    plateau = 0.0 if contact_radius is None else within("contact_radius", contact_radius, 0.0, R / 2)
    return Spacing(near, far, plateau=plateau, reach=R)


def _triangle_mesh(R: float, spacing: Spacing) -> Mesh:
    """Return the lower body meshed with tri3 cells."""
    corners, angle_B, angle_D = _corners(R), 0.5 * math.pi, 0.25 * math.pi
    sides = [
        ("A1B1", divide(lambda s: straight_side(corners["A1"], corners["B1"], s), R, spacing)),
        ("D1B1", divide(lambda s: arc((0.0, -R), R, angle_B - s * angle_D), R * angle_D, spacing)),
        ("CONT1", divide(lambda s: arc((0.0, -R), R, angle_D - s * angle_D), R * angle_D, spacing)),
        ("A1A2", divide(lambda s: straight_side(corners["C1"], corners["A1"], s), R, spacing)),
    ]
    return with_points_at(triangulated_body("SPHBAS", sides, spacing), corners)


def _quadrangle_mesh(
    R: float, arc_sizes: tuple[float, float] | None, segments: int | None, radial_sizes: tuple[float, float] | None
) -> Mesh:
    """Return the lower body meshed with quad4 cells: the square A-P-N-M, and two blocks between the square and the arc."""
    n = 15 if segments is None else count("segments", segments)
    length = 0.25 * math.pi * R
    sizes = (R / 250, R / 25) if arc_sizes is None else arc_sizes
    near, far = each(partial(positive, at_most=length), "arc_sizes", sizes)
    on_arc = progression(length, near, far)
    uniform = np.linspace(0.0, 1.0, n + 1)
    if radial_sizes is None:
        lengths = (near / far) ** (np.arange(n) / max(n - 1, 1))
        on_radius = np.append(0.0, np.cumsum(lengths)) / lengths.sum()
    else:
        at_arc, at_square = each(partial(positive, at_most=0.5 * R), "radial_sizes", radial_sizes)
        on_radius = progression(0.5 * R, at_square, at_arc)
    return _three_blocks(R, on_arc, on_radius, uniform)


def _three_blocks(R: float, on_arc: Array, on_radius: Array, uniform: Array) -> Mesh:
    """Return the lower body, given the relative positions of the nodes on C-D, on M-C and on the uniformly divided sides."""
    corners = {**_corners(R), "M1": (0.0, -R / 2), "N1": (R / 2, -R / 2), "P1": (R / 2, -R)}

    def line(start: str, end: str, relative: Array) -> Array:
        return straight_side(corners[start], corners[end], relative)

    angle_D = 0.25 * math.pi
    contact_arc = arc((0.0, -R), R, angle_D * on_arc)
    outer_arc = arc((0.0, -R), R, angle_D * (2.0 - uniform))
    bottom, top = line("A1", "P1", on_arc), line("M1", "N1", on_arc)  # sides of the square
    right, radial = line("P1", "N1", uniform), line("N1", "D1", on_radius)
    radial[-1] = contact_arc[-1] = outer_arc[-1]  # D1 is common to three sides, which must agree bitwise
    square = coons_patch(bottom, right, top, line("A1", "M1", uniform), on_arc, uniform)
    upper = coons_patch(top, radial, contact_arc, line("M1", "C1", on_radius), on_arc, on_radius)
    outer = coons_patch(line("P1", "B1", on_radius), outer_arc, radial, right, on_radius, uniform)
    blocks = [
        grid_mesh(square, "SPHBAS", {"BOTTOM": "A1B1", "LEFT": "A1A2"}),
        grid_mesh(upper, "SPHBAS", {"TOP": "CONT1", "LEFT": "A1A2"}),
        grid_mesh(outer, "SPHBAS", {"BOTTOM": "A1B1", "RIGHT": "D1B1"}),
    ]
    return with_points_at(merge_points(union(*blocks), 1e-9 * R), corners)


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
    """Return the quarter x >= 0, y >= 0 of two concentric rings that touch at the interface radius.

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
        Numbers of cells of each ring in the radial and in the circumferential direction. The circumferential
        numbers of the two rings may differ.

    Returns
    -------
    Mesh

    Raises
    ------
    MeshError
        If the radii do not increase, or another argument is out of range.

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
    inner = _ring(element, (a, b), each(count, "divisions_inner", divisions_inner), "INNER", ("BORE", "CONT_INNER"))
    outer = _ring(element, (b, c), each(count, "divisions_outer", divisions_outer), "OUTER", ("CONT_OUTER", "RIM"))
    return union(inner, outer)


def _ring(element: str, radii: tuple[float, float], divisions: list[int], name: str, sides: tuple[str, str]) -> Mesh:
    """Return a quarter of one ring; `sides` are the names of the groups at the smaller and at the larger radius."""
    n, m = divisions
    r, angle = np.linspace(*radii, n + 1), np.linspace(0.0, math.pi / 2, m + 1)
    cosine, sine = np.cos(angle), np.sin(angle)
    cosine[-1] = 0.0
    check_size(n * m)
    grid = r[:, None, None] * np.column_stack([cosine, sine])[None]
    groups = {"LEFT": sides[0], "RIGHT": sides[1], "BOTTOM": "SYMMETRY_Y", "TOP": "SYMMETRY_X"}
    mesh = grid_mesh(grid, name, groups, triangles=element in TRIANGLES)
    circles = [Circle((0.0, 0.0), radius, group) for radius, group in zip(radii, sides, strict=True)]
    return converted_to(mesh, element, circles)
