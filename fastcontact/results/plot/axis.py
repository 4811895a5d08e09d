"""Stresses along the axis under a contact, against a sub-surface formula."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fastcontact.elasticity.recovery import von_mises
from fastcontact.errors import FastcontactError
from fastcontact.mesh.mesh import Mesh
from fastcontact.results.plot._axes import UNITS, Units, new_axes
from fastcontact.results.step import StepResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]
# How deep the picture goes, in contact radii.
DEEP = 4.0
COMPONENTS = {"along the axis": 1, "across the axis": 0}


def axis_stress(
    mesh: Mesh,
    step: StepResult,
    pair: str,
    theories: Mapping[str, Any] | None = None,
    *,
    title: str = "",
    units: Units = UNITS,
    ax: Axes | None = None,
) -> Axes:
    """Plot the stresses at the nodes on the axis x = 0 over the depth under the contact surface.

    Parameters
    ----------
    mesh : Mesh
        Two-dimensional.
    step : StepResult
    pair : str
        Contact pair whose node on the axis is the origin.
    theories : mapping of str to object, optional
        Curves by label: objects with ``stress_on_axis(depth)``, such as `analytic.hertz_point`.
    title, units, ax
        As in `pressure_profile`.

    Raises
    ------
    FastcontactError
        If the mesh is three-dimensional or has no nodes on the axis.
    """
    depth, side, stress = stresses_on_axis(mesh, step, pair)
    axes = new_axes(ax, (7.4, 5.4))
    reach = DEEP * np.nan_to_num(step.contact[pair].radius[0]) or float(depth.max())
    shown = depth <= reach
    for number, (name, marker) in enumerate((("upper body", "^"), ("lower body", "v"))):
        here = shown & (side == 1 - 2 * number)
        for colour, (what, component) in zip(("C0", "C1"), COMPONENTS.items(), strict=True):
            axes.plot(depth[here], stress[here, component], marker, color=colour, ms=4, label=f"{what}, {name}")
        axes.plot(depth[here], von_mises(stress[here]), marker, color="C2", ms=4, label=f"von Mises, {name}")
    fine = np.linspace(0.0, reach, 400)
    for style, (label, theory) in zip(("-", "--", ":"), (theories or {}).items(), strict=False):
        exact = theory.stress_on_axis(fine)
        for colour, component in zip(("C0", "C1"), COMPONENTS.values(), strict=True):
            axes.plot(fine, exact[:, component], style, color=colour, lw=1.0)
        axes.plot(fine, von_mises(exact), style, color="C2", lw=1.0)
        axes.plot([], [], f"k{style}", lw=1.0, label=label)
    title = title or f"Stresses on the axis, load factor {step.load_factor:g}"
    depth_name, stress_name = f"depth under the surface [{units['length']}]", f"stress [{units['pressure']}]"
    axes.set(xlabel=depth_name, ylabel=stress_name, title=title)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    return axes


def stresses_on_axis(mesh: Mesh, step: StepResult, pair: str) -> tuple[Array, NDArray[np.int64], Array]:
    """Return depth (n,) [length], side (n,), 1 above and -1 below the surface, and stress (n, 4) of the axis nodes."""
    if mesh.dim != 2:
        raise FastcontactError("stresses along the axis are for meshes in two dimensions: probe points in three")
    contact = step.contact[pair]
    pole = contact.coordinates[int(np.argmin(np.abs(contact.coordinates[:, 0])))]
    tolerance = 1e-9 * np.ptp(mesh.points, axis=0).max()
    used = np.unique(np.concatenate([block.ravel() for block in mesh.solids.values()]))
    nodes = used[np.abs(mesh.points[used, 0]) <= tolerance]
    if len(nodes) < 2:
        raise FastcontactError("the mesh has no nodes on the axis x = 0, along which stresses could be plotted")
    height = mesh.points[nodes, 1] - pole[1]
    # Two nodes stand at the pole, one of each body; where the cells of a node lie tells which is which.
    side = np.where(np.abs(height) > tolerance, np.sign(height), _sides(mesh, nodes, pole[1])).astype(np.int64)
    order = np.lexsort((np.abs(height), side))
    return np.abs(height)[order], side[order], step.stress[nodes][order]


def _sides(mesh: Mesh, nodes: NDArray[Any], level: float) -> Array:
    total = np.zeros(mesh.n_points)
    for block in mesh.solids.values():
        np.add.at(total, block, (mesh.points[block, 1].mean(axis=1) - level)[:, None])
    return np.asarray(np.sign(total[nodes]))
