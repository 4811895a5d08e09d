"""Plots of the contact pairs that `find_contacts` detects in a mesh."""

from __future__ import annotations

from typing import Any

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.contact.found_contacts import FoundContacts
from fastcontact.errors import FastcontactError
from fastcontact.mesh.topology import outer_facets, points_of_solids
from fastcontact.results.plot._axes import LETTER_WIDTH, Axes, figure_size, lay_out, new_axes
from fastcontact.results.plot.patches import outlines, triangles_of
from fastcontact.results.plot.solid import show_box
from fastcontact.results.units import axis_label

# Largest number of contacts in the legend, each with two lines of this height [inch].
MAX_NAMED, LINE_HEIGHT = 10, 0.18


@typed(FastcontactError)
def contacts(
    found_contacts: FoundContacts, *, view: tuple[float, float] = (25.0, -60.0), ax: Axes | None = None
) -> Axes:
    """Plot the contact pairs that `find_contacts` returns.

    Each pair has a different colour, which is darker on the secondary side than on the primary side. After ten pairs, the
    colours are repeated, and the legend states the number of further pairs.

    Parameters
    ----------
    found_contacts : FoundContacts
        The contact pairs.
    view : (float, float)
        Elevation and azimuth of the view of a 3D mesh [degrees].
    ax : matplotlib Axes, optional
        Axes of the plot, which in 3D must have ``projection="3d"``; by default those of a new figure.

    Returns
    -------
    matplotlib Axes

    Examples
    --------
    >>> import fastcontact as fc
    >>> ax = fc.plot.contacts(fc.find_contacts(fc.generate.block_on_block()))
    """
    mesh = found_contacts.mesh
    points = mesh.points[points_of_solids(mesh)]
    width, height = figure_size(points) if mesh.dim == 2 else (6.4, 6.2)
    # The legend is beside the axes.
    margin = LETTER_WIDTH * max((len(f"{pair.name}, secondary") for pair in found_contacts), default=0)
    height = max(height, 1.0 + 2 * LINE_HEIGHT * min(len(found_contacts), MAX_NAMED))
    across = 4.2 * float(np.ptp(points[:, 0]) / np.ptp(points, axis=0).max()) + 1.1 if mesh.dim == 2 else width
    width = max(width, across + margin)
    axes = new_axes(ax, (width, height), "3d" if mesh.dim == 3 else None)
    if mesh.dim == 2:
        _draw_2d(axes, found_contacts)
        axes.set_aspect("equal", anchor="W")
        axes.autoscale_view()
    else:
        _draw_3d(axes, found_contacts)
        show_box(axes, points.min(axis=0), points.max(axis=0), view)
    axes.set(**{f"{axis}label": axis_label(axis, found_contacts.units, "length") for axis in "xyz"[: mesh.dim]})
    axes.set_title("1 contact" if len(found_contacts) == 1 else f"{len(found_contacts)} contacts")
    if len(found_contacts):
        others = len(found_contacts) - MAX_NAMED
        title = f"the first {MAX_NAMED}, and {others} more" if others > 0 else None
        handles = axes.get_legend_handles_labels()[0][: 2 * MAX_NAMED]
        options = {"handles": handles, "title": title, "fontsize": "small", "title_fontsize": "small"}
        # The box of the axes may be smaller than the legend.
        place = {"loc": "outside right upper"} if ax is None else {"loc": "upper left", "bbox_to_anchor": (1.02, 1.0)}
        (axes.figure if ax is None else axes).legend(**options, **place)
    return axes if mesh.dim == 2 or ax is not None else lay_out(axes)


def _sides(found_contacts: FoundContacts) -> list[tuple[str, str, Any, float]]:
    """Return the group, the label, the colour and the opacity of each side of each pair."""
    from matplotlib import colormaps

    colours = colormaps["tab10"].colors  # type: ignore[attr-defined]
    return [
        (group, f"{pair.name}, {side}", colours[number % len(colours)], opacity)
        for number, pair in enumerate(found_contacts)
        for group, side, opacity in ((pair.primary, "primary", 0.4), (pair.secondary, "secondary", 1.0))
    ]


def _draw_2d(axes: Any, found_contacts: FoundContacts) -> None:
    from matplotlib.collections import LineCollection, PolyCollection

    mesh = found_contacts.mesh
    for name, cells in mesh.solids.items():
        polygons = list(outlines(name, mesh.points[cells]))
        axes.add_collection(PolyCollection(polygons, facecolors="0.95", edgecolors="0.8", lw=0.3))
    for group, label, colour, opacity in _sides(found_contacts):
        # Each line is drawn from end to end, through its mid-side node if it is quadratic.
        lines = [mesh.points[b[:, [0, 2, 1] if b.shape[1] == 3 else [0, 1]]] for b in mesh.cells_of(group, 1).values()]
        polylines = [line for block in lines for line in block]
        width = 4.0 if opacity < 1.0 else 1.5
        axes.add_collection(LineCollection(polylines, colors=[colour], alpha=opacity, lw=width, label=label))


def _draw_3d(axes: Any, found_contacts: FoundContacts) -> None:
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    mesh = found_contacts.mesh
    for facets in outer_facets(mesh).values():
        axes.add_collection3d(Poly3DCollection(triangles_of(mesh.points, facets), facecolors="0.6", alpha=0.12))
    for group, label, colour, opacity in _sides(found_contacts):
        triangles = np.concatenate([triangles_of(mesh.points, block) for block in mesh.cells_of(group, 2).values()])
        axes.add_collection3d(Poly3DCollection(triangles, facecolors=[colour], alpha=opacity, label=label))
