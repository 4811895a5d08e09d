"""Plot the history of a contact pair: its force and radius, and the zones of open, sticking and sliding nodes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.analytic.pressure_curve import NAMES
from fastcontact.arrays import Array
from fastcontact.errors import FastcontactError
from fastcontact.results.plot import _axes
from fastcontact.results.plot._axes import UNKNOWN, Axes, Units, contacts_of, new_axes, units_of
from fastcontact.results.step import StepResult
from fastcontact.results.units import labelled, units_of_results

# Largest number of steps at which the number of closed nodes is written above the zones.
MOST_COUNTS = 20
STATES = {"open": "0.85", "closed": "C0", "sticking": "C0", "sliding": "C1"}


@typed(FastcontactError)
def history(
    steps: Sequence[StepResult],
    pair: str,
    *,
    law: Any = None,
    approach: float | None = None,
    share: float = 1.0,
    title: str = "",
    units: Units = UNKNOWN,
    axes: Sequence[Axes] | None = None,
) -> Sequence[Axes]:
    """Plot the force and the contact radius of a contact pair as functions of the load factor or the approach.

    If the normal forces balance each other, as in a press fit, their sum is plotted instead of the resultant.

    Parameters
    ----------
    steps : sequence of StepResult
        Steps of an analysis.
    pair : str
        Name of a contact pair.
    law : object with the method ``at_approach(d)``, optional
        A theory, such as `analytic.hertz_point`, which is plotted if `approach` is given.
    approach : float, optional
        Approach of the bodies at load factor 1 [length]; if it is given, the abscissa is the approach.
    share : float
        Fraction of the contact of the theory that the model represents, for example 0.25 for a quarter [-].
    title, units
        Described for `pressure_profile`.
    axes : two matplotlib Axes, optional
        Axes of the force and of the radius; by default those of a new figure.

    Returns
    -------
    tuple of matplotlib Axes
        Axes of the force and of the radius.

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
    >>> axes = fc.plot.history(steps, "joint")
    >>> axes[0].figure.savefig("history.png")
    """
    if axes is None:
        axes = _axes.Panels(_axes.new_panels(2, 1, (6.0, 5.8), sharex=True)[:, 0])
    upper, lower = axes
    contacts, units = contacts_of(steps, pair), units_of(units, steps[-1])
    x = np.array([step.load_factor for step in steps]) * (approach or 1.0)
    cancels = any(c.active.any() for c in contacts) and all(c.cancels for c in contacts if c.active.any())
    forces = [c.normal_force if cancels else float(np.linalg.norm(c.force)) for c in contacts]
    upper.plot(x, forces, "o", ms=4, label="computed")
    _brackets(lower, x, np.array([c.radius for c in contacts]))
    if law is not None and approach is not None:
        name = f"{NAMES.get(type(law), 'theory')}, equal approach"
        fine = x.max() * np.linspace(0.0, 1.0, 200)[1:] ** 2
        curves = [law.at_approach(d) for d in fine]
        upper.plot([0.0, *fine], [0.0, *(share * c.force for c in curves)], "k-", lw=1, label=name)
        lower.plot([0.0, *fine], [0.0, *(c.radius for c in curves)], "k-", lw=1, label=name)
    if any(c.per_thickness for c in contacts):
        units = units_of_results(units, "plane_strain")
    upper.set(ylabel=labelled("sum of the normal forces" if cancels else "contact force", units, "force"))
    upper.set_title(title or f"Contact '{pair}' against the load", fontsize="medium")
    along = labelled("approach", units, "length") if approach else "load factor"
    size = "contact radius" if contacts[-1].extent == "radius" else "half-width of the contact"
    lower.set(xlabel=along, ylabel=labelled(size, units, "length"))
    for ax in axes:
        ax.grid(alpha=0.3)
        entries = len(ax.get_legend_handles_labels()[0])
        if entries:
            ax.legend(fontsize=9, loc="upper left")
        top = float(ax.dataLim.y1)
        room = 0.12 * (entries + 0.3) if entries else 0.05  # space for the legend above the curves
        ax.set_ylim(0.0, (1.0 + room) * top if 0.0 < top < np.inf else None)
        ax.set_xlim(left=min(0.0, float(x.min())))
    return axes


def _brackets(ax: Any, x: Array, bracket: Array) -> None:
    """Draw a bar between the lower and the upper bound of the radius at each step, or a tick without an upper bound."""
    low, high = bracket.T
    known = np.isfinite(low)
    both = known & np.isfinite(high)
    name = "computed: outermost closed place to first open one"
    if both.any():
        ax.vlines(x[both], low[both], high[both], lw=4, alpha=0.5, color="tab:blue", label=name)
        ax.plot([x[both], x[both]], [low[both], high[both]], "_", ms=6, color="tab:blue")
    if (known & ~both).any():
        ax.plot(x[known & ~both], low[known & ~both], "_", ms=9, color="tab:blue", label="computed: all nodes closed")


@typed(FastcontactError)
def contact_zones(
    steps: Sequence[StepResult], pair: str, *, title: str = "", units: Units = UNKNOWN, ax: Axes | None = None
) -> Axes:
    """Plot for every load step which secondary nodes are open, closed or, with friction, sticking and sliding.

    Parameters
    ----------
    steps : sequence of StepResult
        Steps of an analysis.
    pair : str
        Name of a contact pair.
    title, units, ax
        Described for `pressure_profile`.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    FastcontactError
        If there are no steps.

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
    >>> ax = fc.plot.contact_zones(steps, "joint")
    """
    if not steps:
        raise FastcontactError("there is no step whose contact could be plotted")
    axes = new_axes(ax, (6.4, 4.8))
    contacts, units = contacts_of(steps, pair), units_of(units, steps[-1])
    x = np.concatenate([np.full(len(c.points), step.load_factor) for step, c in zip(steps, contacts, strict=True)])
    y = np.concatenate([c.place for c in contacts])
    closed = np.concatenate([c.active for c in contacts])
    sliding = closed & ~np.concatenate([c.sticking for c in contacts])
    held = "sticking" if sliding.any() or any(c.shear.any() for c in contacts) else "closed"
    for name, here in (("open", ~closed), (held, closed & ~sliding), ("sliding", sliding)):
        if here.any():
            axes.plot(x[here], y[here], "o" if name != "open" else ".", ms=4, color=STATES[name], label=name)
    every = -(-len(contacts) // MOST_COUNTS)
    for step, contact in list(zip(steps, contacts, strict=True))[(len(contacts) - 1) % every :: every]:
        anchor = {"xycoords": ("data", "axes fraction"), "ha": "center", "va": "bottom"}
        axes.annotate(str(int(contact.active.sum())), (step.load_factor, 1.0), fontsize=8, **anchor)
    reach, farthest = 1.5 * np.abs(y[closed]).max(initial=0.0), np.abs(y).max(initial=0.0)
    top = reach if 0.0 < reach < farthest else None
    axes.set_ylim((-top if top else None) if y.min(initial=0.0) < 0 else 0.0, top)
    start = "axis" if contacts[-1].measured_from_axis else "middle of the contact"
    distance = labelled(f"distance from the {start}", units, "length")
    axes.set(xlabel="load factor (above: closed nodes)", ylabel=distance)
    axes.set_title(title or f"Contact '{pair}' against the load", pad=16, fontsize="medium")
    _axes.outer_legend(axes, 3)
    return axes
