"""Show a result in an interactive window of PyVista."""

from __future__ import annotations

import os
import sys
from typing import Any

from fastcontact.errors import FastcontactError
from fastcontact.results.plot.shape import scale_of, scaled
from fastcontact.results.step import StepResult


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
    displayed = sys.platform in ("win32", "darwin") or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if screenshot is None and not displayed:
        raise FastcontactError("there is no display to open a window on: write a picture instead, with --png FILE")
    grid = results.to_pyvista(step)
    grid.points = scaled(grid.points, scale_of(scale, results.mesh, [step]), grid.point_data["displacement"])
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
