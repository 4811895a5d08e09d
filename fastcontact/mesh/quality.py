"""Quality measures of a mesh, and checks for degenerate and inverted cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.arrays import Array, Mask
from fastcontact.errors import MeshError
from fastcontact.mesh import elements, quadrature
from fastcontact.mesh.hanging_nodes import hanging_nodes, hanging_nodes_text
from fastcontact.mesh.mesh import Mesh, vector_text
from fastcontact.mesh.topology import equal_rows
from fastcontact.round_off import ROUND_OFF

# Limits beyond which a cell is poor: the smallest ratio of the smallest to the largest Jacobian, the largest angle [degrees],
# and the smallest ratio of the volume to the cube of the longest edge.
MIN_JACOBIAN_RATIO, MAX_ANGLE, MIN_VOLUME_RATIO = 0.05, 175.0, 1e-4
# Remedies for bad cells, as parts of messages.
REMEDIES = {
    "degenerate": "remove it or merge its points differently",
    "inverted": "reorient it with mesh, count = fastcontact.topology.oriented(mesh), refine if it is curved, or move "
    "mid-side nodes towards the middles of their edges",
}


@dataclass(frozen=True)
class MeshQuality:
    """Quality measures of a mesh.

    Angles and lengths are those of cells with straight edges between the corner nodes.

    Attributes
    ----------
    smallest_angle, largest_angle : float
        Extreme corner angles of all two-dimensional cells [degrees]; NaN without such cells.
    shortest_edge, longest_edge : float
        Extreme lengths of the edges of the solid cells [length]; NaN without solid cells.
    worst_aspect : float
        Largest ratio of the lengths of two edges of one cell [-]; NaN without solid cells.
    measure : float
        Total area in 2D [length^2], or total volume in 3D [length^3], of the solid cells with their curved sides.
    n_points : int
        Number of points.
    n_bad : int
        Number of solid cells that are degenerate or inverted, see `check_cells`.
    dim : int
        Number of coordinates of a point, 2 or 3.
    hanging_nodes : str
        Warning about nodes that lie on facets of their own body without belonging to them, as if the body were torn there;
        empty if there are none.
    n_cells : dict of str to int
        Number of cells, including facets, by element type.
    """

    smallest_angle: float
    largest_angle: float
    shortest_edge: float
    longest_edge: float
    worst_aspect: float
    measure: float
    n_points: int
    n_cells: dict[str, int]
    n_bad: int
    dim: int
    hanging_nodes: str = ""

    def __str__(self) -> str:
        cells = ", ".join(f"{count} {name}" for name, count in self.n_cells.items()) or "no cells"
        kind = "area" if self.dim == 2 else "volume"
        return (
            f"{self.n_points} points, {cells}; degenerate or inverted: {self.n_bad}\n"
            f"smallest angle {self.smallest_angle:.1f}, largest {self.largest_angle:.1f} degrees\n"
            f"edges {self.shortest_edge:.6g} to {self.longest_edge:.6g} [length], "
            f"worst aspect ratio {self.worst_aspect:.3g}\n"
            f"{kind} {self.measure:.9g} [length^{self.dim}]"
            + f"\nwarning: {self.hanging_nodes}"
            * bool(self.hanging_nodes)
        )


@typed(MeshError)
def quality(mesh: Mesh) -> MeshQuality:
    """Return quality measures of a mesh.

    Examples
    --------
    >>> mesh = Mesh([[0, 0], [1, 0], [0, 1]], {"tri3": [[0, 1, 2]]})
    >>> round(quality(mesh).smallest_angle, 9), quality(mesh).measure
    (45.0, 0.5)
    """
    angles = [corner_angles(_corners(mesh, name)).ravel() for name in mesh.cells if elements.get(name).dim == 2]
    angle = np.concatenate(angles) if angles else np.array([np.nan])
    ends = [mesh.points[block[:, elements.get(name).edges]] for name, block in mesh.solids.items()]
    lengths = [np.linalg.norm(x[:, :, 1] - x[:, :, 0], axis=2) for x in ends]
    length = np.concatenate([block.ravel() for block in lengths]) if lengths else np.array([np.nan])
    with np.errstate(divide="ignore", invalid="ignore"):
        aspects = [(block.max(axis=1) / block.min(axis=1)).max() for block in lengths]
    checks = [_bad_cells(mesh, name) for name in mesh.solids]
    return MeshQuality(
        smallest_angle=float(np.degrees(angle.min())),
        largest_angle=float(np.degrees(angle.max())),
        shortest_edge=float(length.min()),
        longest_edge=float(length.max()),
        worst_aspect=float(max(aspects, default=np.nan)),
        measure=float(sum(measure.sum() for measure, _, _ in checks)),
        n_points=mesh.n_points,
        n_cells={name: len(block) for name, block in mesh.cells.items()},
        n_bad=sum(int((degenerate | inverted).sum()) for _, degenerate, inverted in checks),
        dim=mesh.dim,
        hanging_nodes=hanging_nodes_text(mesh, *hanging_nodes(mesh)) if mesh.solids else "",
    )


def check_cells(mesh: Mesh) -> None:
    """Check that every solid cell has a positive Jacobian at its default quadrature points.

    Raises MeshError if a cell is degenerate, that is if all its Jacobians are zero up to round-off; if it is inverted, that
    is if it is not degenerate but has a Jacobian that is not positive; if it contains a node twice; or if two cells have
    the same nodes. The message states the number and the position of the first such cell.
    """
    for name in mesh.solids:
        _check_nodes(mesh, name)
        _check_duplicates(mesh, name)
        measure, degenerate, inverted = _bad_cells(mesh, name)
        for fault, is_bad in (("degenerate", degenerate), ("inverted", inverted)):
            if is_bad.any():
                row = int(np.flatnonzero(is_bad)[0])
                cell = _cell_text(mesh, name, row, measure[row])
                raise MeshError(f"{cell} is {fault} (number of such cells: {int(is_bad.sum())}): {REMEDIES[fault]}")


def poorest_cell(mesh: Mesh) -> str:
    """Return a sentence about the poorest solid cell of a mesh if it impairs the solution, otherwise an empty string.

    A cell is poor if its Jacobian is nearly zero somewhere, if it has an angle near 180 degrees in 2D (small angles have no
    such effect; Babuska and Aziz, 1976), or if it is nearly flat in 3D.
    """
    for name in mesh.solids:
        measure, min_det, max_det, longest = extremes(mesh, name)
        # For each criterion: the excess over its limit, the value, and the text of the message.
        ratio, volume = min_det / max_det, measure / longest**3
        text = "its smallest Jacobian is {:.2g} of its largest; move its nodes or remesh"
        criteria = [(MIN_JACOBIAN_RATIO - ratio, ratio, text)]
        if mesh.dim == 2:
            angle = np.degrees(corner_angles(_corners(mesh, name)).max(axis=1))
            text = "it has an angle of {:.1f} degrees; move its nodes or remesh"
            criteria.append((angle - MAX_ANGLE, angle, text))
        else:
            text = "its volume is only {:.1e} of its longest edge cubed; remesh there"
            criteria.append((MIN_VOLUME_RATIO - volume, volume, text))
        for excess, value, text in criteria:
            row = int(np.argmax(excess))
            if excess[row] > 0.0:
                return f"{_cell_text(mesh, name, row, measure[row])} is poor: {text.format(value[row])}"
    return ""


def _check_nodes(mesh: Mesh, name: str) -> None:
    """Raise MeshError if a cell contains a node twice, because its stresses are then undefined."""
    nodes = np.sort(mesh.cells[name], axis=1)
    repeated = nodes[:, 1:] == nodes[:, :-1]
    rows = np.flatnonzero(repeated.any(axis=1))
    if len(rows):
        node = int(nodes[rows[0], :-1][repeated[rows[0]]][0])
        raise MeshError(
            f"{_cell_text(mesh, name, int(rows[0]))} has point {node} twice (number of such cells: {len(rows)}): "
            "replace it by the element to which it collapses, a triangle, wedge, pyramid or tetrahedron"
        )


def _check_duplicates(mesh: Mesh, name: str) -> None:
    """Raise MeshError if two cells of one element type have the same nodes, so that their stiffness counts twice."""
    nodes = np.sort(mesh.cells[name], axis=1)
    rows = np.unique(equal_rows(nodes))
    _, first, count = np.unique(nodes[rows], axis=0, return_index=True, return_counts=True)
    if len(rows):
        row = int(rows[first.min()])
        raise MeshError(
            f"{_cell_text(mesh, name, row)} occurs in the mesh {int(count.max())} times (number of such cells: "
            f"{len(count)}): remove the copies"
        )


def _cell_text(mesh: Mesh, name: str, row: int, measure: float | None = None) -> str:
    """Return the number, the element type, the position and, if given, the `measure` of a cell, as part of a message."""
    centre = vector_text(_corners(mesh, name)[row].mean(axis=0))
    size = "" if measure is None else f", {'area' if mesh.dim == 2 else 'volume'} {measure:.3g}"
    return f"cell {mesh.offsets[name] + row} ({name} at {centre}{size})"


def _corners(mesh: Mesh, name: str) -> Array:
    """Return the coordinates (n_cells, n_corners, dim) of the corners of the cells of an element [length]."""
    return np.asarray(mesh.points[mesh.cells[name][:, : elements.get(name).n_corners]])


def corner_angles(corners: Array) -> Array:
    """Return the angles (n_cells, n_corners) [radian] of polygons with `corners` (n_cells, n_corners, dim) [length]."""
    to_next = np.roll(corners, -1, axis=1) - corners
    to_previous = np.roll(corners, 1, axis=1) - corners
    cosine = (to_next * to_previous).sum(axis=2)
    if corners.shape[2] == 3:
        return np.arctan2(np.linalg.norm(np.cross(to_next, to_previous), axis=2), cosine)
    sine = to_next[..., 0] * to_previous[..., 1] - to_next[..., 1] * to_previous[..., 0]
    # The angles are interior angles for either orientation of the cell, and exceed 180 degrees at re-entrant corners.
    sine *= np.where(sine.sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
    return np.arctan2(sine, cosine) % (2 * np.pi)


def _bad_cells(mesh: Mesh, name: str) -> tuple[Array, Mask, Mask]:
    """Return the area or volume (n_cells,) of the cells of one type, and the masks of degenerate and of inverted cells."""
    measure, min_det, max_det, longest = extremes(mesh, name)
    tolerance = ROUND_OFF * longest**mesh.dim
    degenerate = np.maximum(np.abs(min_det), np.abs(max_det)) <= tolerance
    return measure, degenerate, (min_det <= tolerance) & ~degenerate


def extremes(mesh: Mesh, name: str) -> tuple[Array, Array, Array, Array]:
    """Return the area or volume, the smallest and the largest Jacobian, and the longest edge of each cell (n_cells,).

    The first three are in units of length^2, in 3D length^3. Jacobians are those at the quadrature points, and edges [length]
    are treated as straight.
    """
    element, x = elements.get(name), mesh.points[mesh.cells[name]]
    _, gradients, weights = element.tables
    determinants = quadrature.jacobian_determinants(x, gradients)
    longest = np.max([np.linalg.norm(x[:, end] - x[:, begin], axis=1) for begin, end in element.edges], axis=0)
    return weights @ determinants, determinants.min(axis=0), determinants.max(axis=0), longest
