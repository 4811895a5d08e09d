"""A contact pair over the load: force and radius; nodes that are open, stick and slide."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fastcontact.errors import FastcontactError
from fastcontact.mesh.argument_types import typed
from fastcontact.results.plot._axes import UNKNOWN, Panels, Units, contacts_of, labelled, new_axes
from fastcontact.results.step import StepResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STATES = {"open": "0.85", "closed": "C0", "sliding": "C1"}


@typed(FastcontactError)
def history(
    steps: Sequence[StepResult],
    pair: str,
    *,
    law: Any = None,
    approach: float | None = None,
    title: str = "",
    units: Units = UNKNOWN,
    axes: Sequence[Axes] | None = None,
) -> Sequence[Axes]:
    """Plot force and contact radius of a contact pair over the load.

    Parameters
    ----------
    steps, pair
        Steps of an analysis, name of a contact pair.
    law : object with ``at_approach(d)``, optional
        A theory, drawn where `approach` is given.
    approach : float, optional
        Approach of the bodies at load factor 1 [length]; the abscissa is then the approach.
    title, units
        As in `pressure_profile`.
    axes : two matplotlib Axes, optional
    """
    if axes is None:
        first = new_axes(None, (7.0, 6.4))
        figure = first.figure
        first.remove()
        axes = Panels(figure.subplots(2, 1, sharex=True))
    upper, lower = axes
    contacts = contacts_of(steps, pair)
    x = np.array([step.load_factor for step in steps]) * (approach or 1.0)
    upper.plot(x, [np.linalg.norm(c.force) for c in contacts], "o-", ms=4, label="computed")
    bracket = np.array([c.radius for c in contacts])
    legend = "computed (between closed and open)"
    lower.fill_between(x, bracket[:, 0], bracket[:, 1], alpha=0.3, label=legend, step="mid")
    if law is not None and approach is not None:
        fine = np.linspace(1e-3, 1.0, 200) * x[-1]
        curves = [law.at_approach(d) for d in fine]
        upper.plot(fine, [c.force for c in curves], "k-", lw=1, label="Hertz, equal approach")
        lower.plot(fine, [c.radius for c in curves], "k-", lw=1, label="Hertz, equal approach")
    upper.set(ylabel=labelled("contact force", units, "force"), title=title or f"Contact '{pair}' over the load")
    along = labelled("approach", units, "length") if approach else "load factor"
    lower.set(xlabel=along, ylabel=labelled("contact radius", units, "length"))
    for ax in axes:
        ax.grid(alpha=0.3)
        ax.legend()
        ax.set_ylim(bottom=0.0)
    return axes


@typed(FastcontactError)
def contact_zones(
    steps: Sequence[StepResult], pair: str, *, title: str = "", units: Units = UNKNOWN, ax: Axes | None = None
) -> Axes:
    """Plot the state of every secondary node over the load: open, closed (sticking, with friction) or sliding.

    Parameters
    ----------
    steps, pair
        Steps of an analysis, name of a contact pair.
    title, units, ax
        As in `pressure_profile`.

    Raises
    ------
    FastcontactError
        If there is no step.
    """
    if not steps:
        raise FastcontactError("there is no step whose contact could be plotted")
    axes = new_axes(ax, (7.4, 5.2))
    contacts = contacts_of(steps, pair)
    x = np.concatenate([np.full(len(c.points), step.load_factor) for step, c in zip(steps, contacts, strict=True)])
    y = np.concatenate([c.place for c in contacts])
    closed = np.concatenate([c.active for c in contacts])
    sliding = closed & ~np.concatenate([c.sticking for c in contacts])
    for name, here in (("open", ~closed), ("closed", closed & ~sliding), ("sliding", sliding)):
        if here.any():
            axes.plot(x[here], y[here], "o" if name != "open" else ".", ms=4, color=STATES[name], label=name)
    for step, contact in zip(steps, contacts, strict=True):
        place = {"xycoords": ("data", "axes fraction"), "ha": "center", "va": "bottom"}
        axes.annotate(str(int(contact.active.sum())), (step.load_factor, 1.0), fontsize=7, **place)
    reach, farthest = 1.5 * np.abs(y[closed]).max(initial=0.0), np.abs(y).max(initial=0.0)
    top = reach if 0.0 < reach < farthest else None
    axes.set_ylim((-top if top else None) if y.min(initial=0.0) < 0 else 0.0, top)
    start = "axis" if contacts[-1].measured_from_axis else "middle of the contact"
    distance = labelled(f"distance from the {start}", units, "length")
    axes.set(xlabel="load factor (above: closed nodes)", ylabel=distance)
    axes.set_title(title or f"Contact '{pair}' over the load", pad=16)
    axes.legend(loc="upper left", fontsize=8)
    return axes
