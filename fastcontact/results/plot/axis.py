"""Plot the stresses along the axis below a contact, and those of analytic solutions for comparison."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.arrays import AnyArray, Array, Indices
from fastcontact.elasticity.recovery import von_mises
from fastcontact.errors import FastcontactError
from fastcontact.mesh.mesh import Mesh
from fastcontact.results.plot._axes import UNKNOWN, Axes, Units, contacts_of, new_axes, units_of
from fastcontact.results.step import StepResult
from fastcontact.results.units import labelled

# Depth of the plotted region, in contact radii.
PLOTTED_DEPTH = 4.0
COMPONENTS = {"along the axis": 1, "across the axis": 0}
# Colours of these, and of the von Mises stress.
COLOURS = ("C0", "C1", "C2")


@typed(FastcontactError)
def axis_stress(
    mesh: Mesh,
    step: StepResult,
    pair: str,
    theories: Mapping[str, Any] | None = None,
    *,
    title: str = "",
    units: Units = UNKNOWN,
    ax: Axes | None = None,
) -> Axes:
    """Plot the stresses at the nodes on the axis of a contact as functions of the depth below the surface.

    The axis passes through the middle of the contact along the normal of the surface; in axisymmetry it is the axis of
    symmetry.

    Parameters
    ----------
    mesh : Mesh
        A two-dimensional mesh.
    step : StepResult
        Results of a step.
    pair : str
        Name of the contact pair. The depth is measured from its node nearest to the middle of the contact.
    theories : mapping of str to object, optional
        Theories by label of the legend: objects with the method ``stress_on_axis(depth)``, such as `analytic.hertz_point`.
    title, units, ax
        Described for `pressure_profile`.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    FastcontactError
        If the mesh is three-dimensional or has no nodes on the axis.

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
    >>> ax = fc.plot.axis_stress(mesh, steps[-1], "joint")
    """
    depth, side, stress = stresses_on_axis(mesh, step, pair)
    upright = abs(_axis(step, pair)[1][1]) > 0.5
    bodies = ("upper body", "lower body") if upright else ("right body", "left body")
    axes, units = new_axes(ax, (6.4, 4.8)), units_of(units, step)
    reach = PLOTTED_DEPTH * np.nan_to_num(contacts_of([step], pair)[0].radius[0]) or float(depth.max())
    shown = depth <= reach
    values = {caption: stress[:, component] for caption, component in COMPONENTS.items()} | {
        "von Mises": von_mises(stress)
    }
    for number, name in enumerate(bodies):
        here = shown & (side == 1 - 2 * number)
        for (caption, value), colour, marker in zip(values.items(), COLOURS, "osD", strict=True):
            if here.any():  # hollow symbols of the second body do not hide those of the first body
                face, label = ("none" if number else colour), f"{caption}, {name}"
                axes.plot(depth[here], value[here], marker, color=colour, mfc=face, ms=3.5 * (1 + number), label=label)
    fine = np.linspace(0.0, reach, 400)
    for style, (label, theory) in zip(("-", "--", ":"), (theories or {}).items(), strict=False):
        exact = theory.stress_on_axis(fine)
        curves = [*(exact[:, component] for component in COMPONENTS.values()), von_mises(exact)]
        for colour, curve in zip(COLOURS, curves, strict=True):
            axes.plot(fine, curve, style, color=colour, lw=1.0)
        axes.plot([], [], f"k{style}", lw=1.0, label=label)
    title = title or f"Stresses on the axis, {step.instant}"
    axes.set(xlabel=labelled("depth below the surface", units, "length"), ylabel=labelled("stress", units, "pressure"))
    axes.set_title(title, fontsize="medium")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    return axes


def stresses_on_axis(mesh: Mesh, step: StepResult, pair: str) -> tuple[Array, Indices, Array]:
    """Return the depth (n,) [length], the side (n,) and the stress (n, 4) [pressure] of the nodes on the axis.

    The side is 1 above the surface and -1 below it; for a horizontal axis it is 1 to the right and -1 to the left. Stress
    components refer to rotated axes: xx is normal to the axis, yy along it, and xy the shear stress.
    """
    if mesh.dim != 2:
        raise FastcontactError(
            "stresses along the axis need a two-dimensional mesh: in three dimensions draw a section, or plot step.stress at "
            "the nodes on the axis"
        )
    pole, direction = _axis(step, pair)
    tolerance = 1e-9 * np.ptp(mesh.points, axis=0).max()
    used = np.unique(np.concatenate([block.ravel() for block in mesh.solids.values()]))
    height = (mesh.points[used] - pole) @ direction
    offset = (mesh.points[used] - pole) @ np.array([direction[1], -direction[0]])
    # The direction of the axis follows from the normal of a facet, which is accurate to a few thousandths.
    slope_tolerance = 0.0 if np.abs(direction).max() == 1.0 else 2e-3
    on_axis = np.abs(offset) <= tolerance + slope_tolerance * np.abs(height)
    nodes, height = used[on_axis], height[on_axis]
    if len(nodes) < 2:
        raise FastcontactError(
            f"the mesh has no nodes on the axis of contact '{pair}', along which stresses could be plotted"
        )
    # At the pole each body has a node; the positions of the adjacent cells show to which body a node belongs.
    body_side = _sides(mesh, nodes, pole, direction)
    side = np.where(np.abs(height) > tolerance, np.sign(height), body_side).astype(np.int64)
    order = np.lexsort((np.abs(height), side))
    return np.abs(height)[order], side[order], _turned(step.stress[nodes], direction)[order]


def _axis(step: StepResult, pair: str) -> tuple[Array, Array]:
    """Return the intersection (2,) [length] of the axis with the contact surface, and its upward direction (2,) [-]."""
    contact = contacts_of([step], pair)[0]
    nearest = int(np.argmin(np.abs(contact.place)))
    normal = contact.normal[nearest]
    if contact.measured_from_axis or not np.linalg.norm(normal) > 0.5:
        return np.array([0.0, contact.coordinates[nearest, 1]]), np.array([0.0, 1.0])
    along = int(np.argmax(np.abs(normal)))
    direction = np.eye(2)[along] if abs(normal[along]) > 0.999 else normal * np.sign(normal[along])
    return contact.coordinates[nearest], direction


def _turned(stress: Array, direction: Array) -> Array:
    """Return the stress (n, 4) [pressure] in axes normal to and along a direction (2,) [-]."""
    along, across = direction, np.array([direction[1], -direction[0]])
    tensor = stress[:, [0, 3, 3, 1]].reshape(-1, 2, 2)
    xx, yy, xy = (np.einsum("i,nij,j->n", a, tensor, b) for a, b in ((across, across), (along, along), (across, along)))
    return np.column_stack([xx, yy, stress[:, 2], xy])


def _sides(mesh: Mesh, nodes: AnyArray, pole: Array, direction: Array) -> Array:
    total = np.zeros(mesh.n_points)
    for block in mesh.solids.values():
        np.add.at(total, block, ((mesh.points[block].mean(axis=1) - pole) @ direction)[:, None])
    return np.asarray(np.sign(total[nodes]))
