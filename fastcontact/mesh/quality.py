"""Quality of a mesh: angles, lengths, and degenerate or inverted cells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.arrays import Array, Mask
from fastcontact.errors import MeshError
from fastcontact.mesh import elements, quality_kernels
from fastcontact.mesh.mesh import Mesh

# Jacobians below this fraction of the squared (cubed) longest edge are round-off.
_FLAT = 1e-12
# Limits for poor cells: smallest over largest Jacobian, largest angle [degrees], volume over the cube of the longest edge.
EVEN, WIDE, THICK = 0.05, 175.0, 1e-4
# What to do about bad cells.
REMEDIES = {
    "degenerate": "remove it or merge its points differently",
    "inverted": "reorient it with mesh, count = fastcontact.topology.oriented(mesh), or refine if it is curved",
}


@dataclass(frozen=True)
class MeshQuality:
    """Figures of a mesh; angles and lengths are those of the straight-sided cells on the corner nodes.

    Attributes
    ----------
    smallest_angle, largest_angle : float
        Corner angles of all two-dimensional cells [degrees]; NaN without such cells.
    shortest_edge, longest_edge, worst_aspect : float
        Edges of the solid cells [length], and the largest ratio of two in one cell; NaN without cells.
    measure : float
        Area in 2D [length^2], volume in 3D [length^3], of the solid cells with their curved sides.
    n_points, n_bad, dim : int
        Number of points, and of solid cells that are degenerate or inverted, see `check_cells`; dimension of the space.
    n_cells : dict of str to int
        Number of cells by element type, facets too.
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

    def __str__(self) -> str:
        cells = ", ".join(f"{count} {name}" for name, count in self.n_cells.items()) or "no cells"
        kind = "area" if self.dim == 2 else "volume"
        return (
            f"{self.n_points} points, {cells}; degenerate or inverted: {self.n_bad}\n"
            f"smallest angle {self.smallest_angle:.1f}, largest {self.largest_angle:.1f} degrees\n"
            f"edges {self.shortest_edge:.6g} to {self.longest_edge:.6g} [length], "
            f"worst aspect ratio {self.worst_aspect:.3g}\n"
            f"{kind} {self.measure:.9g} [length^{self.dim}]"
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
    angles = [_angles(_corners(mesh, name)).ravel() for name in mesh.cells if elements.get(name).dim == 2]
    angle = np.concatenate(angles) if angles else np.array([np.nan])
    lengths = [_edge_lengths(mesh, name) for name in mesh.solids]
    length = np.concatenate([block.ravel() for block in lengths]) if lengths else np.array([np.nan])
    with np.errstate(divide="ignore", invalid="ignore"):
        aspects = [(block.max(axis=1) / block.min(axis=1)).max() for block in lengths]
    bad = [_bad_cells(mesh, name) for name in mesh.solids]
    return MeshQuality(
        smallest_angle=float(np.degrees(angle.min())),
        largest_angle=float(np.degrees(angle.max())),
        shortest_edge=float(length.min()),
        longest_edge=float(length.max()),
        worst_aspect=float(max(aspects, default=np.nan)),
        measure=float(sum(measure.sum() for measure, _, _ in bad)),
        n_points=mesh.n_points,
        n_cells={name: len(block) for name, block in mesh.cells.items()},
        n_bad=sum(int((flat | inverted).sum()) for _, flat, inverted in bad),
        dim=mesh.dim,
    )


def check_cells(mesh: Mesh) -> None:
    """Check that every solid cell has a positive Jacobian at its default quadrature points.

    MeshError if a cell is degenerate (its area or volume is zero to rounding) or inverted (clockwise, or folded so that
    the Jacobian is negative at a quadrature point), has a node twice, or is in the mesh twice; the message names the
    first one and its place.
    """
    for name in mesh.solids:
        _check_nodes(mesh, name)
        _check_twice(mesh, name)
        measure, flat, inverted = _bad_cells(mesh, name)
        for fault, bad in (("degenerate", flat), ("inverted", inverted)):
            if bad.any():
                row = int(np.flatnonzero(bad)[0])
                cell = _described(mesh, name, row, measure[row])
                raise MeshError(f"{cell} is {fault}, one of {int(bad.sum())} such cells: {REMEDIES[fault]}")


def poorest_cell(mesh: Mesh) -> str:
    """Return a sentence about the poorest solid cell of a mesh if it spoils the solution, else an empty string.

    A cell is poor whose Jacobian is nearly zero somewhere, in 2D one with an angle near 180 degrees (Babuska and Aziz,
    1976: small angles do no harm), in 3D one that is nearly flat.
    """
    for name in mesh.solids:
        measure, low, high, longest = _extremes(mesh, name)
        even, flat = low / high, measure / longest**3
        faults = [(even, even, EVEN, "its smallest Jacobian is {:.2g} of its largest; move its nodes or remesh")]
        if mesh.dim == 2:
            angle = np.degrees(_angles(_corners(mesh, name)).max(axis=1))
            faults.append((-angle, angle, -WIDE, "it has an angle of {:.1f} degrees; move its nodes or remesh"))
        else:
            faults.append((flat, flat, THICK, "its volume is only {:.1e} of its longest edge cubed; remesh there"))
        for figure, shown, limit, text in faults:
            row = int(np.argmin(figure))
            if figure[row] < limit:
                return f"{_described(mesh, name, row, measure[row])} is poor: {text.format(shown[row])}"
    return ""


def _check_nodes(mesh: Mesh, name: str) -> None:
    """Raise MeshError if a cell contains a node twice: its facets there have no area, and its stresses are undefined."""
    nodes = np.sort(mesh.cells[name], axis=1)
    twice = nodes[:, 1:] == nodes[:, :-1]
    bad = np.flatnonzero(twice.any(axis=1))
    if len(bad):
        node = int(nodes[bad[0], :-1][twice[bad[0]]][0])
        raise MeshError(
            f"{_described(mesh, name, int(bad[0]))} has point {node} twice, one of {len(bad)} such cells: write it as the "
            "element that it collapses to, a triangle, wedge, pyramid or tetrahedron"
        )


def _check_twice(mesh: Mesh, name: str) -> None:
    """Raise MeshError if two cells of an element have the same nodes: together they would be twice as stiff."""
    nodes = mesh.cells[name].astype(np.int64)
    # Sums distinguish most cells; only those with equal sums are compared node by node.
    key = nodes.sum(axis=1) * mesh.n_points + (nodes * nodes % 1_000_003).sum(axis=1)
    order = np.argsort(key, kind="stable")
    alike = np.flatnonzero(key[order[1:]] == key[order[:-1]])
    rows = np.unique(np.concatenate([order[alike], order[alike + 1]]))
    _, first, count = np.unique(np.sort(nodes[rows], axis=1), axis=0, return_index=True, return_counts=True)
    if (count > 1).any():
        row = int(rows[first[count > 1].min()])
        raise MeshError(
            f"{_described(mesh, name, row)} occurs in the mesh {int(count.max())} times, one of "
            f"{int((count > 1).sum())} such cells: remove the copies"
        )


def _described(mesh: Mesh, name: str, row: int, measure: float | None = None) -> str:
    """Return number, element, position and, if given, size of a cell for messages."""
    centre = ", ".join(f"{x:.6g}" for x in _corners(mesh, name)[row].mean(axis=0))
    size = "" if measure is None else f", {'area' if mesh.dim == 2 else 'volume'} {measure:.3g}"
    return f"cell {mesh.offsets[name] + row} ({name} at ({centre}){size})"


def _corners(mesh: Mesh, name: str) -> Array:
    """Return the coordinates (n_cells, n_corners, dim) of the corners of the cells of an element [length]."""
    return np.asarray(mesh.points[mesh.cells[name][:, : elements.get(name).n_corners]])


def _angles(corners: Array) -> Array:
    """Return the corner angles (n_cells, n_corners) of polygons (n_cells, n_corners, dim) [radian]."""
    ahead = np.roll(corners, -1, axis=1) - corners
    behind = np.roll(corners, 1, axis=1) - corners
    cosine = (ahead * behind).sum(axis=2)
    if corners.shape[2] == 3:
        return np.arctan2(np.linalg.norm(np.cross(ahead, behind), axis=2), cosine)
    sine = ahead[..., 0] * behind[..., 1] - ahead[..., 1] * behind[..., 0]
    # Interior angles for either orientation, so that a re-entrant corner has more than 180 degrees.
    sine *= np.where(sine.sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
    return np.arctan2(sine, cosine) % (2 * np.pi)


def _edge_lengths(mesh: Mesh, name: str) -> Array:
    """Return the lengths (n_cells, n_edges) of the straight edges of the cells [length]."""
    ends = mesh.points[mesh.cells[name][:, elements.get(name).edges]]
    return np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)


def _bad_cells(mesh: Mesh, name: str) -> tuple[Array, Mask, Mask]:
    """Return area or volume of each cell (n_cells,), whether it is round-off, and whether a Jacobian is not positive."""
    measure, low, high, longest = _extremes(mesh, name)
    rounding = _FLAT * longest**mesh.dim
    flat = np.maximum(np.abs(low), np.abs(high)) <= rounding
    return measure, flat, (low <= rounding) & ~flat


def _extremes(mesh: Mesh, name: str) -> tuple[Array, Array, Array, Array]:
    """Return, each (n_cells,), area or volume, smallest and largest Jacobian, longest edge of the cells of an element."""
    element = elements.get(name)
    _, gradients, weights = element.tables
    low, high, measure, longest = np.empty((4, len(mesh.cells[name])))
    edges = np.array(element.edges, np.intp)
    quality_kernels.extremes(mesh.points, mesh.cells[name], gradients, weights, edges, low, high, measure, longest)
    return measure, low, high, longest
