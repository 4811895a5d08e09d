"""The deformed mesh coloured by its von Mises stress."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fastcontact.contact.search.facet_tables import flat_triangles
from fastcontact.elasticity.recovery import von_mises
from fastcontact.errors import FastcontactError
from fastcontact.mesh import elements
from fastcontact.mesh.argument_types import typed
from fastcontact.mesh.mesh import Mesh
from fastcontact.results.plot._axes import UNKNOWN, Units, labelled, new_axes
from fastcontact.results.plot.solid import MOST_EDGES, draw_solid
from fastcontact.results.separated import separated
from fastcontact.results.step import StepResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]
LARGEST = 1e30  # of coordinates that can be drawn: the libraries multiply them


def scaled(points: Array, scale: float, displacement: Array) -> Array:
    """Return displaced points (n, dim) [length]; FastcontactError if `scale` moves them out of what can be drawn."""
    with np.errstate(all="ignore"):
        place = points + scale * displacement
        drawn = np.isfinite(scale) and (np.abs(place) < LARGEST).all()
    if not drawn:
        raise FastcontactError(f"scale = {scale:g} must be a finite number, and not so large that nothing can be drawn")
    return place


@typed(FastcontactError)
def deformed_shape(
    mesh: Mesh,
    step: StepResult,
    *,
    scale: float = 1.0,
    edges: bool | None = None,
    mirrored: bool = False,
    title: str = "",
    units: Units = UNKNOWN,
    view: tuple[float, float] = (25.0, -60.0),
    ax: Axes | None = None,
) -> Axes:
    """Plot the deformed mesh coloured by the von Mises stress, its maximum marked.

    In three dimensions its outer surface is drawn, as far as it faces the eye.

    Parameters
    ----------
    mesh : Mesh
    step : StepResult
    scale : float
        Factor on the displacements.
    edges : bool, optional
        Draw the cells' edges; by default up to 5000 cells, or facets of the surface in 3D.
    mirrored : bool
        In 2D, draw the other half beyond x = 0, too: the full section of an axisymmetric body.
    title, units
        As in `pressure_profile`.
    view : (float, float)
        In 3D, height of the eye over the x-y plane and its direction around z [degrees].
    ax : matplotlib Axes, optional
        In 3D with ``projection="3d"``.
    """
    solid, (whole, (mesh, node, stress)) = mesh.dim == 3, (mesh, separated(mesh, step))
    values = step.von_mises if mesh is whole else von_mises(stress)  # each material's own, where they meet
    place = scaled(mesh.points, scale, step.displacement[node])
    both = np.concatenate([place, place * [-1.0, 1.0]]) if mirrored and not solid else place
    axes = new_axes(ax, (7.0, 7.0) if solid else _size(both), "3d" if solid else None)
    field = (
        draw_solid(axes, mesh, place, values, edges, view, node) if solid else _draw(axes, mesh, place, values, edges)
    )
    if both is not place:
        _draw(axes, mesh, place * [-1.0, 1.0], values, edges)
    top = int(np.argmax(step.von_mises))
    where = ", ".join(f"{x:.4g}" for x in mesh.points[top])
    label = f"maximum {step.von_mises[top]:.5g} at ({where})"
    axes.plot(*([x] for x in place[top]), "o", mfc="none", mec="red", ms=9, mew=1.5, label=label, zorder=10)
    axes.figure.colorbar(
        field, ax=axes, label=labelled("von Mises stress", units, "pressure"), shrink=0.6 if solid else 0.8
    )
    axes.set_aspect("equal")
    axes.set_title(title or f"Deformed shape (displacements x {scale:g}), load factor {step.load_factor:g}")
    axes.set(**{f"{axis}label": labelled(f"{axis}", units, "length") for axis in "xyz"[: mesh.dim]})
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 0.02 if solid else -0.09 if ax is not None else _below(both)))
    return axes


def _size(place: Array) -> tuple[float, float]:
    """Return width and height of a picture that the body fills, beside colours, labels and title [inches]."""
    width, height = np.ptp(place, axis=0) / np.ptp(place, axis=0).max()
    return max(5.0 * float(width) + 2.2, 5.0), max(5.0 * float(height) + 2.0, 3.6)


def _below(place: Array) -> float:
    """Return where the legend begins, in heights of such axes: half an inch leaves room for the label of the axis."""
    return -0.5 / (_size(place)[1] - 2.0)


def _draw(ax: Axes, mesh: Mesh, place: Array, values: Array, edges: bool | None) -> Any:
    """Draw the cells of a mesh in the plane at positions `place` (n_points, 2), coloured by `values` (n_points,).

    Return what carries the colours.
    """
    from matplotlib.collections import PolyCollection
    from matplotlib.tri import Triangulation

    loops = [cells[:, _outline(name)] for name, cells in mesh.solids.items()]
    flat = [cells[:, flat_triangles(cells.shape[1])].reshape(-1, 3) for cells in mesh.solids.values()]
    field = ax.tripcolor(
        Triangulation(place[:, 0], place[:, 1], np.concatenate(flat)), values, shading="gouraud", cmap="viridis"
    )
    if edges if edges is not None else sum(map(len, loops)) <= MOST_EDGES:
        for loop in loops:
            outlines = list(place[loop])
            ax.add_collection(PolyCollection(outlines, facecolors="none", edgecolors="black", lw=0.15, alpha=0.6))
    return field


def _outline(name: str) -> list[int]:
    """Return the nodes of a 2D element in order around it."""
    element = elements.get(name)
    if element.order == 1:
        return list(range(element.n_corners))
    return [node for facet in element.facets for node in (facet[0], facet[2])]
