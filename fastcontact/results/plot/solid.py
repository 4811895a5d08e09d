"""The visible outer surface of a three-dimensional solid with the colours of a field, in parallel projection."""

from __future__ import annotations

from typing import Any

import numpy as np

from fastcontact._tools.neighbours import pairs_within
from fastcontact.arrays import Array, Indices, Mask, Numbers
from fastcontact.mesh import elements
from fastcontact.mesh.flat_pieces import flat_triangles
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.topology import outer_facets, points_of_solids
from fastcontact.results.plot.fields import Field
from fastcontact.results.plot.patches import lattice

# Largest distance behind a triangle, relative to the total size, at which a point is still regarded as lying on it.
ON_TRIANGLE = 1e-4


class Screen:
    """Triangles in the coordinates of the screen, to test whether they hide points.

    Parameters
    ----------
    triangles : ndarray (n, 3, 3)
        Corners of the triangles [length].
    eye : ndarray (3,)
        Unit vector towards the viewer [-].
    """

    def __init__(self, triangles: Array, eye: Array) -> None:
        self.axes = screen_axes(eye)
        self.corners = triangles @ self.axes.T
        self.tolerance = ON_TRIANGLE * np.ptp(self.corners.reshape(-1, 3), axis=0).max()
        middle = 0.5 * (self.corners.min(axis=1) + self.corners.max(axis=1))
        self.centre, arms = middle[:, :2], self.corners - middle[:, None]
        self.radius = np.linalg.norm(arms[..., :2], axis=2).max(axis=1)

    def hidden(self, positions: Array) -> Mask:
        """Return whether each position (..., 3) [length] is hidden behind a triangle."""
        flat = positions.reshape(-1, 3) @ self.axes.T
        point, triangle = pairs_within(flat[:, :2], self.centre, self.radius)
        hidden = np.zeros(len(flat), bool)
        hidden[point[self._behind(flat[point], self.corners[triangle])]] = True
        return hidden.reshape(positions.shape[:-1])

    def _behind(self, points: Array, triangles: Array) -> Mask:
        """Return whether points (n, 3) lie behind triangles (n, 3, 3), all in the coordinates of the screen [length]."""
        a, b, c = np.moveaxis(triangles[..., :2], 1, 0)
        area = _cross(b - a, c - a)
        area = np.where(area == 0.0, np.inf, area)
        p = points[:, :2]
        weights = np.stack([_cross(b - p, c - p), _cross(c - p, a - p), _cross(a - p, b - p)], axis=1) / area[:, None]
        depth = (weights * triangles[..., 2]).sum(axis=1)
        return np.asarray((weights > 0.0).all(axis=1) & (depth > points[:, 2] + self.tolerance))


def screen_axes(eye: Array) -> Array:
    """Return three orthonormal vectors (3, 3) [-]: two normal to the line of sight, and `eye`, the vector to the viewer."""
    helper = np.eye(3)[int(np.argmin(np.abs(eye)))]
    first = np.cross(helper, eye)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(eye, first), eye])


def view_axes(direction: Array, aligned: float) -> tuple[Array, tuple[str, str] | None]:
    """Return two axes (2, 3) [-] for a view along a unit vector (3,) [-], and their names if they are coordinate axes.

    If the magnitude of a component of the vector is at least `aligned`, the axes are the other two coordinate axes. Otherwise
    they are normal to the vector, and None is returned in place of the names.
    """
    k = int(np.argmax(np.abs(direction)))
    if abs(direction[k]) < aligned:
        return screen_axes(direction)[:2], None
    first, second = [axis for axis in range(3) if axis != k]
    return np.eye(3)[[first, second]], ("xyz"[first], "xyz"[second])


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


# Largest number of cells or facets whose edges are drawn by default. More edges would blacken the plot.
MOST_EDGES = 5000
# Number of subdivisions of the sides of each flat triangle of a linear facet, for fields that are not linear within it.
CUTS = 2
# Largest number of recursive subdivisions of partly hidden triangles into four, and of partly hidden strokes into two.
SUBDIVISIONS = 4
# Barycentric weights of the ends of the halves of a stroke.
HALF_STROKES = np.array([[[1.0, 0.0], [0.5, 0.5]], [[0.5, 0.5], [0.0, 1.0]]])
# Size of solids relative to the axes, smaller than 1 to leave space for labels.
ROOM = 0.9
# Largest ratio of the longer extent of a box on the screen to its diagonal. Boxes with a larger ratio are drawn smaller.
WIDEST = 0.8
# Elevations and azimuths of the viewer [degree], from above and from below at each of the four corners.
VIEWS = [(height, direction) for height in (25.0, -25.0) for direction in (-60.0, 30.0, 120.0, -150.0)]
# Number of ticks on an axis that is as long as the diagonal of the box in the plot.
TICKS = 14
# Length of the part without ticks at each end of the y axis, relative to the axis. The labels of ticks there would overlap
# those of other axes.
NEAR_END = 0.1
# Distances of tick labels and of axis labels from the axes in 3D, in the unit of Matplotlib and for a box of size 1, and the
# smallest size of a box for which distances are computed.
TICK_LABEL_DISTANCE, AXIS_LABEL_DISTANCE, SMALLEST_BOX = 6.0, 17.0, 0.05


def draw_solid(
    ax: Any, plot_field: Field, points: Array, edges: bool | None, view: tuple[float, float],
    limits: tuple[float, float],
) -> Any:  # fmt: skip
    """Draw the visible part of the outer surface, and return the mappable for a colour bar.

    `points` (n_points, 3) are the positions of the points [length], and `limits` are the values of the first and the last
    colour. `edges` states whether the outlines of facets are drawn; by default they are for up to MOST_EDGES facets. `view`
    contains the elevation and the azimuth of the viewer [degree].
    """
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    facing, screen = _facing_facets(plot_field, points, viewer_direction(view))
    pieces, strokes = [], []
    for name, corners, flat in facing:
        weights = _subdivision(CUTS if elements.get(name).order == 1 else 1)
        flat_pieces = np.einsum("pcw,ftwd->ftpcd", weights, corners[:, flat]).reshape(-1, 3, 4)
        pieces.append(_visible_parts(flat_pieces, _subdivision(2), screen))
        strokes.append(_visible_parts(_outline(name, corners[..., :3]), HALF_STROKES, screen))
    triangles = np.concatenate(pieces)
    norm = Normalize(*limits)
    faces = colormaps[plot_field.colours](norm(triangles[..., 3].mean(axis=1)))
    polygons = list(triangles[..., :3])
    lines = faces.copy()  # lines in the colour of the face close hairline gaps between faces
    if edges if edges is not None else sum(len(corners) for _, corners, _ in facing) <= MOST_EDGES:
        # Matplotlib draws nearer objects later. Strokes are moved towards the viewer, which does not change their projection.
        moved = np.concatenate(strokes) + 4.0 * np.ptp(points, axis=0).max() * viewer_direction(view)
        polygons += list(moved)
        faces = np.vstack([faces, np.zeros((len(moved), 4))])
        lines = np.vstack([lines, np.tile([0.0, 0.0, 0.0, 0.6], (len(moved), 1))])
    ax.add_collection3d(Poly3DCollection(polygons, facecolors=faces, edgecolors=lines, linewidths=0.3))
    in_solids = points[points_of_solids(plot_field.mesh)]
    show_box(ax, in_solids.min(axis=0), in_solids.max(axis=0), view)
    return ScalarMappable(norm, plot_field.colours)


def show_box(ax: Any, low: Array, high: Array, view: tuple[float, float]) -> None:
    """Show the box between two corners (3,) [length] in true proportions in 3D axes, seen from `view` [degree].

    Limits must be changed only by this function. With other proportions, strokes would not lie on their faces.
    """
    from matplotlib.ticker import MaxNLocator

    ax.set_proj_type("ortho")
    ax.view_init(elev=view[0], azim=view[1])
    size, eye = np.maximum(high - low, 1e-9 * np.ptp([low, high])), viewer_direction(view)
    diagonal = float(np.linalg.norm(size))
    horizontal = np.array([-np.sin(np.radians(view[1])), np.cos(np.radians(view[1])), 0.0])
    widest = float((np.abs([horizontal, np.cross(eye, horizontal)]) @ size).max()) / diagonal
    lengths = size * np.sqrt(1.0 - eye**2) / diagonal  # of the axes in the plot
    for name, begin, end, length in zip("xyz", low, high, lengths):
        count = int(np.clip(TICKS * length, 3 if name == "y" else 1, 9))
        ticks = MaxNLocator(count, steps=[1, 2, 5, 10]).tick_values(begin, end)
        margin = (NEAR_END if name == "y" else -1e-9) * (end - begin)
        ticks = ticks[(ticks >= begin + margin) & (ticks <= end - margin)]
        getattr(ax, f"set_{name}lim")(begin, end)
        getattr(ax, f"set_{name}ticks")(ticks[-1:] if TICKS * length < 1.5 else ticks)
    _place_labels(ax, size / diagonal, eye, horizontal)
    ax.set_box_aspect(size, zoom=ROOM * min(1.0, WIDEST / widest))


def _place_labels(ax: Any, size: Array, eye: Array, horizontal: Array) -> None:
    """Place tick labels and labels of 3D axes at the same distance on the screen for bodies of all proportions.

    Matplotlib moves them away from an axis by distances proportional to the `size` (3,) [-] of the box along the other two.
    `eye` and `horizontal` (3,) are the unit vectors towards the viewer and along the horizontal direction of the screen.
    """
    screen = np.array([horizontal, np.cross(eye, horizontal)])
    near, sideways = np.sign(eye) * [1.0, 1.0, -1.0] * size, np.sign(horizontal) * size
    for name, outward in zip("xyz", (near * [0, 1, 1], near * [1, 0, 1], sideways)):
        reach = max(float(np.linalg.norm(screen @ outward)), SMALLEST_BOX)
        ax.tick_params(axis=name, pad=TICK_LABEL_DISTANCE / reach - 8.0)  # 8 and 21 are offsets of Matplotlib
        getattr(ax, f"{name}axis").labelpad = AXIS_LABEL_DISTANCE / reach - 21.0


def shows_extreme(plot_field: Field, points: Array, view: tuple[float, float]) -> bool:
    """Return whether the extreme value of a field at the positions `points` (n_points, 3) is visible from `view`."""
    _, screen = _facing_facets(plot_field, points, viewer_direction(view))
    return not bool(screen.hidden(points[[plot_field.extreme]])[0])


def view_of_extreme(plot_field: Field, points: Array) -> tuple[float, float]:
    """Return the first of VIEWS from which the extreme value of a field is visible, or the first one if there is none."""
    return next((view for view in VIEWS if shows_extreme(plot_field, points, view)), VIEWS[0])


def viewer_direction(view: tuple[float, float]) -> Array:
    """Return the unit vector (3,) [-] towards the viewer from its elevation and azimuth [degree]."""
    height, direction = np.radians(view)
    return np.array([np.cos(height) * np.cos(direction), np.cos(height) * np.sin(direction), np.sin(height)])


def _facing_facets(plot_field: Field, points: Array, eye: Array) -> tuple[list[tuple[str, Array, Indices]], Screen]:
    """Return the facets that face the viewer, and the screen with their triangles.

    For each element type of facets there are its name, the positions and values (n, n_nodes, 4) at the nodes of the facets,
    and the local nodes of the flat triangles of a facet.
    """
    mesh, node = plot_field.mesh, plot_field.node
    cut = len(node) != node.max(initial=-1) + 1
    data, facing = np.column_stack([points, plot_field.values]), []
    for name, facets in (_facets_without_cuts(mesh, node) if cut else outer_facets(mesh)).items():
        flat = flat_triangles(facets.shape[1])
        a, b, c = np.moveaxis(points[facets][:, flat], -2, 0)
        facing.append((name, data[facets[np.cross(b - a, c - a).sum(axis=1) @ eye > 0]], flat))
    triangles = [corners[:, flat, :3].reshape(-1, 3, 3) for _, corners, flat in facing]
    return facing, Screen(np.concatenate(triangles), eye)


def _visible_parts(simplices: Array, parts: Array, screen: Screen) -> Array:
    """Return the visible parts (m, k, d) of triangles or strokes (n, k, d), whose first three components are positions.

    Partly hidden ones are divided recursively into p parts, whose corners have the barycentric weights `parts` (p, k, k). The
    smallest parts are kept if their centre is visible.
    """
    visible = []
    for n_subdivisions in range(SUBDIVISIONS, -1, -1):
        positions = simplices[..., :3]
        centre = positions.mean(axis=1, keepdims=True)
        hidden = screen.hidden(np.concatenate([centre, centre + 0.98 * (positions - centre)], axis=1))
        is_visible = ~hidden[:, 0] if n_subdivisions == 0 else ~hidden.any(axis=1)
        visible.append(simplices[is_visible])
        partly_hidden = simplices[~is_visible & ~hidden.all(axis=1)]
        simplices = np.einsum("pcw,nwd->npcd", parts, partly_hidden).reshape(-1, *simplices.shape[1:])
    return np.concatenate(visible)


def _facets_without_cuts(mesh: Mesh, node: Numbers) -> dict[str, Numbers]:
    """Return the outer facets except those along internal cuts, where two facets have the same nodes."""
    blocks = {}
    for name, facets in outer_facets(mesh).items():
        _, inverse, count = np.unique(np.sort(node[facets], axis=1), axis=0, return_inverse=True, return_counts=True)
        blocks[name] = facets[count[inverse.ravel()] == 1]
    return {name: facets for name, facets in blocks.items() if len(facets)}


def _subdivision(n: int) -> Array:
    """Return barycentric weights (n * n, 3, 3) [-] of the corners of n * n equal pieces of a triangle."""
    points, pieces = lattice(True, n)
    return np.column_stack([1.0 - points.sum(axis=1), points])[pieces]


def _outline(name: str, nodes: Array) -> Array:
    """Return the sides of facets with `nodes` (m, n_nodes, 3) as strokes (n, 2, 3) between neighbouring nodes [length]."""
    element = elements.get(name)
    ends = list(element.edges)
    if element.order == 2:
        middles = range(element.n_corners, element.n_corners + len(ends))
        ends = [side for (a, b), middle in zip(ends, middles) for side in ((a, middle), (middle, b))]
    return np.asarray(nodes[:, np.array(ends)].reshape(-1, 2, 3))
