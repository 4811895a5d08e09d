"""Plot the deformed mesh, coloured by a field."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.arrays import Array
from fastcontact.errors import FastcontactError
from fastcontact.mesh.mesh import Mesh
from fastcontact.results.plot._axes import (
    UNKNOWN,
    Axes,
    Units,
    framed,
    mark,
    new_axes,
    part_shown,
    placed,
    settled,
    size_around,
    units_of,
)
from fastcontact.results.plot.fields import Field, field_of
from fastcontact.results.plot.patches import fill, outlines
from fastcontact.results.plot.solid import MOST_EDGES, draw_solid, is_seen, view_of_extreme
from fastcontact.results.step import StepResult

LARGEST = 1e30  # largest coordinate that can be plotted without overflow in products of coordinates
VIBRATION = (
    0.1  # largest displacement of vibration modes, over the size of the mesh, at which they are drawn by default
)


def scale_of(scale: float | None, mesh: Mesh, steps: Sequence[StepResult]) -> float:
    """Return the factor on the displacements [-]: `scale` or, by default, 1 or that of vibration modes.

    The amplitude of a mode is arbitrary; by default the largest displacement is a tenth of the size of the mesh.
    """
    largest = max(float(np.abs(step.displacement).max(initial=0.0)) for step in steps)
    if scale is not None or largest == 0.0 or "parameter" not in steps[0].iterations:
        return 1.0 if scale is None else scale
    return float(f"{VIBRATION * float(np.ptp(mesh.points, axis=0).max()) / largest:.2g}")


def scaled(points: Array, scale: float, displacement: Array) -> Array:
    """Return the displaced points (n, dim) [length]; FastcontactError if `scale` makes them too large to be plotted."""
    with np.errstate(all="ignore"):
        position = points + scale * displacement
        drawn = np.isfinite(scale) and (np.abs(position) < LARGEST).all()
    if not drawn:
        raise FastcontactError(f"scale = {scale:g} must be a finite number, and not so large that nothing can be drawn")
    return position


@typed(FastcontactError)
def deformed_shape(
    mesh: Mesh,
    step: StepResult,
    *,
    field: str = "von_mises",
    scale: float | None = None,
    edges: bool | None = None,
    mirrored: bool = False,
    zoom: float | None = None,
    limits: tuple[float, float] | None = None,
    title: str = "",
    units: Units = UNKNOWN,
    view: tuple[float, float] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Plot the deformed mesh, in 3D its visible surface, coloured by a field, with the largest value marked.

    Parameters
    ----------
    mesh : Mesh
        The mesh of the step.
    step : StepResult
        Results of a step.
    field : str
        Name of the field: ``"von_mises"``, ``"von_mises_signed"`` or ``"tresca"``; a stress component such as
        ``"stress.xx"``, or a principal stress ``"stress.principal_max"``, ``"stress.principal_mid"`` or
        ``"stress.principal_min"``; ``"displacement"`` for its magnitude, or a component such as ``"displacement.x"``; or a
        name in `StepResult.cell_fields`.
    scale : float, optional
        Factor by which displacements are multiplied [-]. By default it is 1, but the largest displacement of a vibration
        mode is a tenth of the size of the mesh.
    edges : bool, optional
        Whether to draw the edges of cells; by default if there are at most 5000 cells or, in 3D, facets of the surface.
    mirrored : bool
        Whether to draw also the mirror image at x = 0 of a 2D mesh, for example to show the full section of an axisymmetric
        body.
    zoom : float, optional
        Half the width of the plotted region around the largest value, only for 2D meshes [length].
    limits : (float, float), optional
        Limits of the colour scale, in the unit of the field.
    title, units
        Described for `pressure_profile`.
    view : (float, float), optional
        Elevation and azimuth of the view of a 3D mesh [degrees]. By default it is (25, -60) or, if the largest value is not
        visible from there, the first of eight views from corners of the bounding box from which it is.
    ax : matplotlib Axes, optional
        Axes of the plot, which in 3D must have ``projection="3d"``; by default those of a new figure.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    FastcontactError
        If there is no such field, or `zoom` is given for a 3D mesh.

    Examples
    --------
    >>> import fastcontact as fc
    >>> mesh = fc.generate.block_on_block()
    >>> model = fc.Model(mesh, kinematics="plane_strain")
    >>> model.add_material(fc.LinearElastic(E=1000.0, nu=0.0))
    >>> model.fix("LOWER_BOTTOM", "xy")
    >>> model.fix("UPPER_LEFT", "x")
    >>> model.add_pressure("UPPER_TOP", 2.0)
    >>> model.add_contact("joint", secondary="CONT_UPPER", primary="CONT_LOWER")
    >>> steps = fc.solve(model, 2)
    >>> ax = fc.plot.deformed_shape(mesh, steps[-1], scale=10.0)
    >>> ax.figure.savefig("shape.png")
    """
    if zoom is not None and (mesh.dim == 3 or not 0.0 < zoom < LARGEST):
        raise FastcontactError(f"zoom = {zoom:g}: in the plane half a width > 0 can be drawn; in 3D draw a section")
    shown, units = field_of(mesh, step, field), units_of(units, step)
    scale = scale_of(scale, mesh, [step])
    points = scaled(shown.mesh.points, scale, step.displacement[shown.node])
    heading = title or f"Deformed shape (displacements x {scale:g}), {step.instant}"
    if mesh.dim == 3:
        axes = new_axes(ax, (6.4, 6.9), "3d")
        view = view or view_of_extreme(shown, points)
        drawn = draw_solid(axes, shown, points, edges, view, limits or shown.range)
        _mark(axes, shown, points, mesh, units, hidden=not is_seen(shown, points, view))
        framed(axes, drawn, shown, heading, units, "xyz")
        return axes if ax is not None else settled(axes)
    extent = np.concatenate([points, points * [-1.0, 1.0]]) if mirrored else points
    extent = extent if zoom is None else np.array(part_shown(points[shown.extreme], zoom, extent))
    axes = new_axes(ax, size_around(extent))
    for turned in (points, points * [-1.0, 1.0]) if mirrored else (points,):
        drawn = _draw(axes, shown, turned, edges, limits or shown.range, extent)
    if zoom is not None:
        axes.set(xlim=extent[:, 0], ylim=extent[:, 1])
    _mark(axes, shown, points, mesh, units)
    return framed(axes, drawn, shown, heading, units, "xy", extent, alone=ax is None)


def _mark(axes: Any, shown: Field, points: Array, mesh: Mesh, units: Mapping[str, str], hidden: bool = False) -> None:
    """Mark the extreme value; its label contains the position in the deformed and in the reference configuration."""
    before = mesh.points[shown.node[shown.extreme]]
    at, size = points[shown.extreme], float(np.ptp(points, axis=0).max())
    here, there = placed(at, size), placed(before, size)
    label = f"{shown.described(shown.values[shown.extreme], units)} at {here}{', hidden' * hidden}"
    mark(axes, at, label + (f"\nundeformed at {there}" if here != there else ""))


def _draw(
    ax: Axes, shown: Field, nodes: Array, edges: bool | None, colours: tuple[float, float], box: Array
) -> Any:  # fmt: skip
    """Draw the cells of a 2D mesh at the positions `nodes` (n_points, 2), and return the artist with the colour scale.

    `colours` contains the limits of the colour scale. By default edges are drawn if there are few cells in the bounding box
    of the points `box` (n, 2).
    """
    from matplotlib.collections import PolyCollection

    drawn = fill(ax, shown.mesh.solids, nodes, shown.values, shown.colours, colours)
    loops = [outlines(name, nodes[cells]) for name, cells in shown.mesh.solids.items()]
    low, high = box.min(axis=0), box.max(axis=0)
    inside = [((loop.max(axis=1) >= low) & (loop.min(axis=1) <= high)).all(axis=1) for loop in loops]
    if edges if edges is not None else sum(int(kept.sum()) for kept in inside) <= MOST_EDGES:
        for loop in loops:
            ax.add_collection(PolyCollection(list(loop), facecolors="none", edgecolors="black", lw=0.15, alpha=0.6))
    return drawn
