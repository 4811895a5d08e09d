"""The outer surface of a solid in three dimensions, coloured by a field at the points."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastcontact.contact.search.facet_tables import flat_triangles
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.topology import outer_facets

Array = NDArray[np.float64]

# Cells or facets beyond which edges would only blacken the picture.
MOST_EDGES = 5000
# Each flat triangle between the nodes is cut into so many along its sides, to show how a field varies in it.
CUTS = 2


def draw_solid(
    ax: Any, mesh: Mesh, place: Array, values: Array, edges: bool | None, view: tuple[float, float],
    node: NDArray[np.int32],
) -> Any:  # fmt: skip
    """Draw the facets of the outer surface that face the eye; return what a colour bar is made of.

    The points stand at `place` (n_points, 3) [length] and are coloured by `values` (n_points,). Outlines of facets are drawn
    if `edges` says so, by default up to MOST_EDGES. `view` is height and direction of the eye [degrees]. Points of one `node`
    (n_points,) are one: the mesh may be cut along borders inside.
    """
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    height, direction = np.radians(view)
    eye = np.array([np.cos(height) * np.cos(direction), np.cos(height) * np.sin(direction), np.sin(height)])
    pieces, colours, outlines = [], [], []
    outer = outer_facets(mesh) if len(node) == node.max(initial=-1) + 1 else _without_cuts(mesh, node)
    for name, facets in outer.items():
        corners = place[facets]
        flat = flat_triangles(facets.shape[1])
        a, b, c = np.moveaxis(corners[:, flat], -2, 0)
        seen = np.cross(b - a, c - a).sum(axis=1) @ eye > 0
        weights = _cut(CUTS if elements.get(name).order == 1 else 1)
        triangles = np.einsum("pcw,ftwd->ftpcd", weights, corners[seen][:, flat])
        pieces.append(triangles.reshape(-1, 3, 3))
        centre = np.einsum("pw,ftw->ftp", weights.mean(axis=1), values[facets[seen]][:, flat])
        colours.append(centre.ravel())
        outlines.append(_outline(name, corners[seen], eye))
    field = np.concatenate(colours)
    norm = Normalize(float(values.min()), float(values.max()))
    faces = colormaps["viridis"](norm(field))
    polygons = list(np.concatenate(pieces))
    lines = faces.copy()  # the colour of the face itself closes the hair cracks between neighbours
    if edges if edges is not None else sum(map(len, outer.values())) <= MOST_EDGES:
        strokes = np.concatenate(outlines)
        polygons += list(strokes)
        faces = np.vstack([faces, np.zeros((len(strokes), 4))])
        lines = np.vstack([lines, np.tile([0.0, 0.0, 0.0, 0.6], (len(strokes), 1))])
    ax.add_collection3d(Poly3DCollection(polygons, facecolors=faces, edgecolors=lines, linewidths=0.3))
    ax.set_proj_type("ortho")
    ax.view_init(elev=view[0], azim=view[1])
    for setter, low, high in zip((ax.set_xlim, ax.set_ylim, ax.set_zlim), place.min(axis=0), place.max(axis=0)):
        setter(low, high)
    return ScalarMappable(norm, "viridis")


def _without_cuts(mesh: Mesh, node: NDArray[np.int32]) -> dict[str, NDArray[np.int32]]:
    """Return the outer facets but for those along cuts inside, where two facets have the same nodes."""
    found = {}
    for name, facets in outer_facets(mesh).items():
        _, back, count = np.unique(np.sort(node[facets], axis=1), axis=0, return_inverse=True, return_counts=True)
        found[name] = facets[count[back.ravel()] == 1]
    return {name: facets for name, facets in found.items() if len(facets)}


def _cut(n: int) -> Array:
    """Return the weights (n * n, 3, 3) of the corners of the n * n equal pieces of a triangle."""
    pieces = []
    for i in range(n):
        for j in range(n - i):
            pieces.append([(i, j), (i + 1, j), (i, j + 1)])
            if i + j < n - 1:
                pieces.append([(i + 1, j), (i + 1, j + 1), (i, j + 1)])
    steps = np.array(pieces, float) / n
    return np.concatenate([1.0 - steps.sum(axis=2, keepdims=True), steps], axis=2)


def _outline(name: str, corners: Array, eye: Array) -> Array:
    """Return the sides of facets (n, 2, 3) as strokes between neighbouring nodes, a facet's length nearer to the eye.

    What is nearer is drawn later, so that no piece of the facets beside it covers a stroke; in a parallel projection it
    stays where it is in the picture.
    """
    element = elements.get(name)
    ends = [(a, b) for a, b in element.edges]
    if element.order == 2:
        middles = range(element.n_corners, element.n_corners + len(ends))
        ends = [side for (a, b), middle in zip(ends, middles) for side in ((a, middle), (middle, b))]
    size = np.linalg.norm(np.ptp(corners, axis=1), axis=1)
    nearer = corners[:, np.array(ends)] + (size[:, None] * eye)[:, None, None]
    return np.asarray(nearer.reshape(-1, 2, 3))
