"""Plots, interactive views and animations of the deformed mesh coloured by a field, and plane sections through 3D bodies."""

from __future__ import annotations

import base64
import contextlib
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact._tools.paths import checked_target, replacing
from fastcontact.arrays import Array
from fastcontact.errors import FastcontactError
from fastcontact.mesh import elements
from fastcontact.mesh.flat_pieces import flat_triangles
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.topology import points_of_solids
from fastcontact.results.plot import _axes
from fastcontact.results.plot._axes import MODEL_UNITS, Axes, Units, new_axes, position_text, units_of
from fastcontact.results.plot.fields import Field, field_of
from fastcontact.results.plot.patches import fill, fill_triangles, outlines
from fastcontact.results.plot.solid import MOST_EDGES, draw_solid, show_box, shows_extreme, view_axes, view_of_extreme
from fastcontact.results.step import StepResult

# Largest coordinate that can be plotted. Products of larger coordinates would overflow.
LARGEST = 1e30
# Largest displacement of a vibration mode in a plot by default, relative to the size of the mesh.
MODE_AMPLITUDE = 0.1


def scale_of(scale: float | None, mesh: Mesh, steps: Sequence[StepResult]) -> float:
    """Return the factor by which displacements are multiplied [-], which is `scale` if it is not None.

    The default is 1. The amplitude of a vibration mode is arbitrary; by default its largest displacement is plotted as a
    tenth of the size of the mesh.
    """
    largest = max(float(np.abs(step.displacement).max(initial=0.0)) for step in steps)
    if scale is not None or largest == 0.0 or "parameter" not in steps[0].iterations:
        return 1.0 if scale is None else scale
    return float(f"{MODE_AMPLITUDE * float(np.ptp(mesh.points, axis=0).max()) / largest:.2g}")


def displaced_points(points: Array, scale: float, displacement: Array) -> Array:
    """Return the displaced points (n, dim) [length]. Raises FastcontactError if they are too large to be plotted."""
    with np.errstate(all="ignore"):
        position = points + scale * displacement
        valid = np.isfinite(scale) and (np.abs(position) < LARGEST).all()
    if not valid:
        raise FastcontactError(f"scale = {scale:g} must be a finite number, and not so large that coordinates overflow")
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
    units: Units = MODEL_UNITS,
    view: tuple[float, float] | None = None,
    ax: Axes | None = None,
) -> Axes:
    """Plot the deformed mesh, in 3D its visible surface, coloured by a field; the value of largest magnitude is marked.

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
        Half the width of the plotted region around the marked value, only for 2D meshes [length].
    limits : (float, float), optional
        Limits of the colour scale, in the unit of the field.
    title, units
        Described for `pressure_profile`.
    view : (float, float), optional
        Elevation and azimuth of the view of a 3D mesh [degrees]. By default it is (25, -60) or, if the marked value is not
        visible from there, the first of eight views, from corners of the bounding box, that shows it.
    ax : matplotlib Axes, optional
        Axes of the plot, which in 3D must have ``projection="3d"``; by default those of a new figure.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    FastcontactError
        If there is no such field, `scale` is not finite or too large, or `zoom` is not positive or given for a 3D mesh.

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
        raise FastcontactError(f"zoom = {zoom:g}: it must be positive, and is for 2D meshes only; in 3D draw a section")
    plot_field, units = field_of(mesh, step, field), units_of(units, step)
    scale = scale_of(scale, mesh, [step])
    points = displaced_points(plot_field.mesh.points, scale, step.displacement[plot_field.node])
    heading = title or f"Deformed shape (displacements x {scale:g}), {step.instant}"
    if mesh.dim == 3:
        axes = new_axes(ax, (6.4, 6.6), "3d")
        view = view or view_of_extreme(plot_field, points)
        artist = draw_solid(axes, plot_field, points, edges, view, limits or plot_field.range)
        _mark(axes, plot_field, points, mesh, units, hidden=not shows_extreme(plot_field, points, view))
        _axes.label_axes(axes, artist, plot_field, heading, units, "xyz")
        return axes if ax is not None else _axes.lay_out(axes)
    images = [points, points * [-1.0, 1.0]] if mirrored else [points]
    extent = np.concatenate([image[points_of_solids(plot_field.mesh)] for image in images])
    extent = extent if zoom is None else np.array(_axes.zoom_window(points[plot_field.extreme], zoom, extent))
    axes = new_axes(ax, _axes.figure_size(extent))
    for image in images:
        artist = _draw(axes, plot_field, image, edges, limits or plot_field.range, extent)
    if zoom is not None:
        axes.set(xlim=extent[:, 0], ylim=extent[:, 1])
    _mark(axes, plot_field, points, mesh, units)
    return _axes.label_axes(axes, artist, plot_field, heading, units, "xy", extent, alone=ax is None)


def _mark(
    axes: Any, plot_field: Field, points: Array, mesh: Mesh, units: Mapping[str, str], hidden: bool = False
) -> None:
    """Mark the extreme value; its label contains the position in the deformed and in the reference configuration."""
    point, size = points[plot_field.extreme], float(np.ptp(points, axis=0).max())
    deformed = position_text(point, size)
    undeformed = position_text(mesh.points[plot_field.node[plot_field.extreme]], size)
    extreme = plot_field.extreme_label(plot_field.values[plot_field.extreme], units)
    label = f"{extreme} at {deformed}{', hidden' * hidden}"
    _axes.mark(axes, point, label + (f"\nundeformed at {undeformed}" if deformed != undeformed else ""))


def _draw(
    ax: Axes, plot_field: Field, nodes: Array, edges: bool | None, limits: tuple[float, float], extent: Array
) -> Any:  # fmt: skip
    """Draw the cells of a 2D mesh at the positions `nodes` (n_points, 2), and return the artist with the colour scale.

    `limits` are those of the colour scale. By default edges are drawn if at most MOST_EDGES cells lie in the bounding box of
    the points `extent` (n, 2) [length].
    """
    from matplotlib.collections import PolyCollection

    artist = fill(ax, plot_field.mesh.solids, nodes, plot_field.values, plot_field.colours, limits)
    loops = [outlines(name, nodes[cells]) for name, cells in plot_field.mesh.solids.items()]
    low, high = extent.min(axis=0), extent.max(axis=0)
    inside = [((loop.max(axis=1) >= low) & (loop.min(axis=1) <= high)).all(axis=1) for loop in loops]
    if edges if edges is not None else sum(int(mask.sum()) for mask in inside) <= MOST_EDGES:
        for loop in loops:
            ax.add_collection(PolyCollection(list(loop), facecolors="none", edgecolors="black", lw=0.15, alpha=0.6))
    return artist


# Distance, relative to the size of the mesh, by which a section plane is moved along its normal, in case it coincides with
# facets.
PLANE_SHIFT = 1e-7


@typed(FastcontactError)
def section(
    mesh: Mesh,
    step: StepResult,
    point: Sequence[float],
    normal: Sequence[float],
    *,
    field: str = "von_mises",
    scale: float | None = None,
    edges: bool | None = None,
    zoom: float | None = None,
    title: str = "",
    units: Units = MODEL_UNITS,
    ax: Axes | None = None,
) -> Axes:
    """Plot a plane section through a 3D mesh, coloured by a field; the value of largest magnitude is marked.

    The plane is defined in the reference configuration; the section is drawn in the deformed configuration, projected along
    the normal.

    Parameters
    ----------
    mesh : Mesh
        A three-dimensional mesh.
    step : StepResult
        Results of a step.
    point : sequence of 3 floats
        A point of the plane in the reference configuration [length].
    normal : sequence of 3 floats
        Vector of any length normal to the plane [-].
    field, scale, title, units
        Described for `deformed_shape`.
    edges : bool, optional
        Whether to draw the lines along which the plane cuts facets of cells; by default if there are at most 20 000 of them.
    zoom : float, optional
        Half the width of the plotted region around the marked value [length]; by default the entire section is plotted.
    ax : matplotlib Axes, optional
        Axes of the plot; by default those of a new figure.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    FastcontactError
        If there is no such field, the mesh is not three-dimensional, the normal is zero, or the plane does not intersect the
        mesh.

    Examples
    --------
    >>> import fastcontact as fc
    >>> mesh = fc.generate.box(divisions=(2, 2, 2))
    >>> model = fc.Model(mesh, kinematics="3d")
    >>> model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
    >>> model.fix("ZMIN", "xyz")
    >>> model.add_pressure("ZMAX", 1.0)
    >>> step = fc.solve(model, 1)[-1]
    >>> ax = fc.plot.section(mesh, step, point=(0.5, 0.5, 0.5), normal=(0.0, 1.0, 0.0))
    """
    from matplotlib.collections import LineCollection

    origin, direction = _plane(mesh, point, normal)
    plot_field, units = field_of(mesh, step, field), units_of(units, step)
    triangles, lines = _intersection(plot_field, step, origin, direction)
    scale = scale_of(scale, mesh, [step])
    basis, labels = view_axes(direction, 1.0 - 1e-12)
    corners = displaced_points(triangles[..., :3], scale, triangles[..., 3:6])
    offset = 0.0 if labels else origin @ basis.T
    flat, values = corners @ basis.T - offset, triangles[..., 6]
    marked = np.unravel_index(int(np.argmax(np.abs(values))), values.shape)
    points = flat.reshape(-1, 2)
    points = points if zoom is None else np.array(_axes.zoom_window(flat[marked], zoom, points))
    axes = new_axes(ax, _axes.figure_size(points))
    limits = plot_field.range if plot_field.signed else (float(values.min()), float(values.max()))
    corner_rows = np.arange(values.size).reshape(-1, 3)
    artist = fill_triangles(axes, flat.reshape(-1, 2), corner_rows, values.ravel(), plot_field.colours, limits)
    strokes = displaced_points(lines[..., :3], scale, lines[..., 3:6]) @ basis.T - offset
    if edges if edges is not None else len(strokes) <= 4 * MOST_EDGES:
        axes.add_collection(LineCollection(list(strokes), colors="black", linewidths=0.2, alpha=0.6))
    undeformed = triangles[marked][:3] - ((triangles[marked][:3] - origin) @ direction) * direction
    size = float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    extreme = plot_field.extreme_label(values[marked], units, " on the section")
    _axes.mark(axes, flat[marked], f"{extreme}\nundeformed at {position_text(undeformed, size)}")
    if zoom is not None:
        axes.set(xlim=points[:, 0], ylim=points[:, 1])
    through = position_text(origin, float(np.ptp(mesh.points, axis=0).max()))
    plane = f"section through {through}, normal {position_text(direction, 1.0)}"
    state = f"{step.instant}, displacements x {scale:g}"
    labels = labels or ("along the section", "across it")
    heading = title or f"{plane}\n{state}"
    return _axes.label_axes(axes, artist, plot_field, heading, units, labels, points, alone=ax is None)


def _plane(mesh: Mesh, point: Sequence[float], normal: Sequence[float]) -> tuple[Array, Array]:
    """Return the point (3,) [length] and the unit normal (3,) [-] of a plane. Raises FastcontactError if one is invalid."""
    if mesh.dim != 3:
        raise FastcontactError("sections need a three-dimensional mesh: draw the deformed shape of this one")
    origin, direction = np.array(point, float), np.array(normal, float)
    valid = origin.shape == direction.shape == (3,) and bool(np.isfinite([origin, direction]).all())
    if not valid or not np.linalg.norm(direction) > 0.0:
        raise FastcontactError(
            f"a section takes a point and a normal of 3 numbers, not {list(point)} and {list(normal)}"
        )
    return origin, direction / np.linalg.norm(direction)


def _intersection(plot_field: Field, step: StepResult, origin: Array, direction: Array) -> tuple[Array, Array]:
    """Return the section as triangles (n, 3, 7) and lines (m, 2, 7), with position, displacement and value at each corner.

    The plane is moved slightly along its normal, because it may coincide with facets, or in the opposite direction if it does
    not intersect the mesh then. Raises FastcontactError if neither plane intersects the mesh.
    """
    size = float(np.ptp(plot_field.mesh.points, axis=0).max())
    data = np.column_stack([plot_field.mesh.points, step.displacement[plot_field.node], plot_field.values])
    for shift in (PLANE_SHIFT, -PLANE_SHIFT):
        height = data[:, :3] @ direction - origin @ direction - shift * size
        triangles, lines = _cut_cells(plot_field.mesh, data, height)
        if len(triangles):
            return triangles, lines
    low, high = plot_field.mesh.points.min(axis=0), plot_field.mesh.points.max(axis=0)
    raise FastcontactError(
        f"the plane through {position_text(origin, size)} with normal {position_text(direction, 1.0)} does not intersect "
        f"the mesh, which lies between {position_text(low, size)} and {position_text(high, size)}"
    )


def _cut_cells(mesh: Mesh, data: Array, height: Array) -> tuple[Array, Array]:
    """Return the intersection of cells with the plane of zero `height` (n_points,), see `_intersection`.

    `data` (n_points, 7) are the positions, displacements and values at the points. Each cell is divided into tetrahedra
    between its centre and triangles of its facets.
    """
    pieces, strokes = [np.empty((0, 3, 7))], [np.empty((0, 2, 7))]
    for name, block in mesh.solids.items():
        element = elements.get(name)
        cells = block[(height[block].min(axis=1) < 0.0) & (height[block].max(axis=1) >= 0.0)]
        if not len(cells):
            continue
        N = element.shape(element.nodes[: element.n_corners].mean(axis=0)[None])[0]
        centre, centre_height = np.einsum("n,end->ed", N, data[cells]), height[cells] @ N
        for facet in element.facets:
            for triangle in np.array(facet)[flat_triangles(len(facet))]:
                corners = cells[:, triangle]
                corner_data = np.concatenate([data[corners], centre[:, None]], axis=1)
                heights = np.column_stack([height[corners], centre_height])
                cut, stroke = _cut_tetrahedra(corner_data, heights)
                pieces.append(cut)
                strokes.append(stroke)
    return np.concatenate(pieces), np.concatenate(strokes)


def _cut_tetrahedra(data: Array, height: Array) -> tuple[Array, Array]:
    """Return the intersection of tetrahedra (m, 4, k) with a plane as triangles (n, 3, k) and lines (n, 2, k).

    The lines are the intersections with the first face of each tetrahedron, the face of the first three corners. `height`
    (m, 4) contains the heights of the corners above the plane.
    """
    above = height >= 0.0
    pattern = above @ np.array([1, 2, 4, 8])  # the binary digits state which corners lie above the plane
    pieces, strokes = [np.empty((0, 3, data.shape[2]))], [np.empty((0, 2, data.shape[2]))]
    for number in range(1, 15):
        rows = pattern == number
        if not rows.any():
            continue
        edges = [(i, j) for i in range(4) for j in range(4) if number >> i & 1 and not number >> j & 1]
        points = np.stack([_zero_crossing(data[rows], height[rows], i, j) for i, j in edges], axis=1)
        pieces.append(points[:, :3])
        if len(edges) == 4:  # the diagonal of a quadrangle joins the second and the third edge
            pieces.append(points[:, 1:])
        on_face = [k for k, (i, j) in enumerate(edges) if i < 3 and j < 3]
        if len(on_face) == 2:
            strokes.append(points[:, on_face])
    return np.concatenate(pieces), np.concatenate(strokes)


def _zero_crossing(data: Array, height: Array, i: int, j: int) -> Array:
    """Return the data (n, k) at the point of zero height between corners i and j, by linear interpolation."""
    t = (height[:, i] / (height[:, i] - height[:, j]))[:, None]
    return np.asarray((1.0 - t) * data[:, i] + t * data[:, j])


def view(
    results: Any, step: StepResult, *, scale: float | None = None, title: str = "", screenshot: str | None = None
) -> None:
    """Show the deformed mesh, coloured by the von Mises stress, in an interactive window.

    Parameters
    ----------
    results : Results
        An open result file.
    step : StepResult
        The step to show.
    scale : float, optional
        Factor by which displacements are multiplied, see `deformed_shape` [-].
    title : str
        Title of the plot.
    screenshot : str, optional
        Path of an image file that is written instead of opening a window.

    Raises
    ------
    FastcontactError
        If PyVista is not installed, or there is no display for a window.

    Examples
    --------
    >>> import fastcontact as fc
    >>> results = fc.open_results("press-fit.vtkhdf")  # doctest: +SKIP
    >>> fc.plot.view(results, results[-1])  # doctest: +SKIP
    """
    try:
        import pyvista
    except ImportError as error:
        raise FastcontactError("the interactive view needs PyVista: pip install 'fastcontact[view]'") from error
    has_display = sys.platform in ("win32", "darwin") or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if screenshot is None and not has_display:
        raise FastcontactError(
            "there is no display to open a window on: write a picture instead, with screenshot=FILE or --png FILE"
        )
    grid = results.to_pyvista(step)
    grid.points = displaced_points(grid.points, scale_of(scale, results.mesh, [step]), grid.point_data["displacement"])
    plotter: Any = pyvista.Plotter(off_screen=screenshot is not None)
    plotter.add_mesh(
        grid, scalars="von_mises", show_edges=grid.n_cells <= 5000, line_width=0.3, cmap="viridis",
        scalar_bar_args={"vertical": True, "title": "von Mises stress"},
    )  # fmt: skip
    plotter.add_text(title or step.instant, font_size=10)
    if results.mesh.dim == 2:
        plotter.view_xy()
    plotter.add_axes()
    plotter.show(screenshot=screenshot or False)


# Suffixes of animation files; all formats except the first require the program ffmpeg.
SUFFIXES = (".gif", ".mp4", ".mkv", ".webm")
# Resolution of a frame [dots per inch], which is low because an animation contains many frames.
RESOLUTION = 90


@dataclass(frozen=True)
class MovingPicture:
    """An animation in a file, which notebooks display.

    Attributes
    ----------
    path : pathlib.Path
        Path of the file.
    """

    path: Path

    def _repr_html_(self) -> str:
        """Return the animation embedded in HTML."""
        content = base64.b64encode(self.path.read_bytes()).decode()
        kind = self.path.suffix[1:].lower()
        if kind == "gif":
            return f"<img src='data:image/gif;base64,{content}'>"
        return f"<video controls loop src='data:video/{kind};base64,{content}'></video>"


@typed(FastcontactError)
def animate(
    mesh: Mesh,
    steps: Sequence[StepResult],
    path: str | os.PathLike[str],
    *,
    field: str = "von_mises",
    scale: float | None = None,
    mirrored: bool = False,
    pictures_per_second: int = 5,
    title: str = "",
    units: Units = MODEL_UNITS,
    view: tuple[float, float] = (25.0, -60.0),
) -> MovingPicture:
    """Write an animation of the deformed shape over all load steps, with fixed axes and a fixed colour scale.

    Parameters
    ----------
    mesh : Mesh
        The mesh of the steps.
    steps : sequence of StepResult
        Steps of an analysis, one for each frame.
    path : str or path
        File to write, with the suffix ``.gif`` or, if the program ffmpeg is installed, ``.mp4``, ``.mkv`` or ``.webm``.
    field, scale, mirrored, units, view
        Described for `deformed_shape`.
    pictures_per_second : int
        Frame rate [1/s].
    title : str
        Title of every frame, followed by the load factor.

    Returns
    -------
    MovingPicture
        The animation, which a notebook displays if it is the last value of a cell.

    Raises
    ------
    FastcontactError
        If there are no steps, the suffix is unknown, or ffmpeg is missing or fails.
    FileError
        If the file cannot be written.

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
    >>> picture = fc.plot.animate(mesh, steps, "joint.gif", scale=10.0)
    """
    if not len(steps):
        raise FastcontactError("there are no steps to animate")
    if pictures_per_second < 1:
        raise FastcontactError(f"pictures_per_second = {pictures_per_second} must be at least 1")
    target, scale = checked_target(path), scale_of(scale, mesh, steps)
    projection, size = None if mesh.dim == 2 else "3d", (6.4, 6.0)
    if mesh.dim == 2:
        size = _axes.figure_size(mesh.points[points_of_solids(mesh)] * [2.0 if mirrored else 1.0, 1.0], 3.8)
    figure = new_axes(None, size, projection).figure
    writer = writer_of(target, pictures_per_second)
    limits, box = _limits_of_steps(mesh, steps, field, scale, mirrored)
    zoom: float | None = None  # the zoom of the first frame is used for all frames
    with _failure_of_writer(target), replacing(target) as temporary, writer.saving(figure, temporary, RESOLUTION):
        for step in steps:
            figure.clear()
            axes = figure.add_subplot(projection=projection)
            heading = f"{title}\n{step.instant}, displacements x {scale:g}".strip()
            deformed_shape(
                mesh, step, field=field, scale=scale, mirrored=mirrored, limits=limits, title=heading, units=units,
                view=view, ax=axes,
            )  # fmt: skip
            if mesh.dim == 3:
                show_box(axes, *box, view)
                zoom = zoom or _axes.filling_zoom(axes)
                _axes.lay_out(axes, zoom)
            else:
                axes.set(**{f"{axis}lim": ends for axis, *ends in zip("xy", *box, strict=True)})
            writer.grab_frame()
    return MovingPicture(target)


def writer_of(path: Path, pictures_per_second: int) -> Any:
    """Return the Matplotlib writer of an animation. Raises FastcontactError if the suffix is unknown or ffmpeg is missing."""
    from matplotlib.animation import FFMpegWriter, PillowWriter

    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise FastcontactError(f"'{path}' has a suffix that is not an animation format: use {', '.join(SUFFIXES)}")
    if suffix == ".gif":
        return PillowWriter(fps=pictures_per_second)
    if not FFMpegWriter.isAvailable():
        raise FastcontactError(f"'{path}' needs the program ffmpeg, which is not installed: write a .gif instead")
    # Most codecs require an even number of pixels in both directions.
    even = ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p"]
    return FFMpegWriter(fps=pictures_per_second, extra_args=even)


@contextlib.contextmanager
def _failure_of_writer(path: Path) -> Iterator[None]:
    """Convert failures of ffmpeg to a FastcontactError with its last message.

    Errors before the first frame are raised unchanged.
    """
    try:
        yield
    except subprocess.CalledProcessError as error:
        lines = str(error.stderr or "").strip().splitlines()
        reason = f"{error.returncode} ({lines[-1][:200]})" if lines else str(error.returncode)
        raise FastcontactError(
            f"'{path}' was not written, because ffmpeg ended with code {reason}: write a .gif instead"
        ) from error
    except IndexError as error:  # Matplotlib fails to finish a .gif without frames, which hides the original error
        raise error.__context__ or error from None


def _limits_of_steps(
    mesh: Mesh, steps: Sequence[StepResult], field: str, scale: float, mirrored: bool
) -> tuple[tuple[float, float], tuple[Array, Array]]:
    """Return the limits of the colour scale and the corners of the bounding box of the bodies over all steps."""
    ranges, boxes = [], []
    for step in steps:  # steps of a result file are read one at a time
        ranges.append(field_of(mesh, step, field).range)
        points = displaced_points(mesh.points, scale, step.displacement)[points_of_solids(mesh)]
        boxes.append((points.min(axis=0), points.max(axis=0)))
    low, high = np.min(boxes, axis=0)[0], np.max(boxes, axis=0)[1]
    if mirrored and mesh.dim == 2:
        low[0], high[0] = min(low[0], -high[0]), max(high[0], -low[0])
    margin = 0.03 * float((high - low).max())
    return (min(low for low, _ in ranges), max(high for _, high in ranges)), (low - margin, high + margin)
