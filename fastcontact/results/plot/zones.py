"""Where a contact is open, sticks and slides, over the load."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from fastcontact.errors import FastcontactError
from fastcontact.results.plot._axes import UNITS, Units, new_axes
from fastcontact.results.step import StepResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes

STATES = {"open": "0.85", "closed": "C0", "sliding": "C1"}


def contact_zones(
    steps: Sequence[StepResult], pair: str, *, title: str = "", units: Units = UNITS, ax: Axes | None = None
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
    contacts = [step.contact[pair] for step in steps]
    x = np.concatenate([np.full(len(c.points), step.load_factor) for step, c in zip(steps, contacts, strict=True)])
    y = np.concatenate([c.abscissa for c in contacts])
    closed = np.concatenate([c.active for c in contacts])
    sliding = closed & ~np.concatenate([c.sticking for c in contacts])
    for name, here in (("open", ~closed), ("closed", closed & ~sliding), ("sliding", sliding)):
        if here.any():
            axes.plot(x[here], y[here], "o" if name != "open" else ".", ms=4, color=STATES[name], label=name)
    for step, contact in zip(steps, contacts, strict=True):
        place = {"xycoords": ("data", "axes fraction"), "ha": "center", "va": "bottom"}
        axes.annotate(str(int(contact.active.sum())), (step.load_factor, 1.0), fontsize=7, **place)
    reach = y[closed].max(initial=0.0)
    axes.set_ylim(0.0, 1.5 * reach if 0.0 < 1.5 * reach < y.max() else None)
    axes.set_xlabel("load factor (above: closed nodes)")
    axes.set_ylabel(f"distance along the secondary surface [{units['length']}]")
    axes.set_title(title or f"Contact '{pair}' over the load", pad=16)
    axes.legend(loc="upper left", fontsize=8)
    return axes
