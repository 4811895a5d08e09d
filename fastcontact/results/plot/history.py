"""Force and contact radius of a contact pair over the load."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fastcontact.results.plot._axes import UNITS, Units, name_axes, new_axes
from fastcontact.results.step import StepResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def history(
    steps: Sequence[StepResult],
    pair: str,
    *,
    law: Any = None,
    approach: float | None = None,
    title: str = "",
    units: Units = UNITS,
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
        axes = figure.subplots(2, 1, sharex=True)
    upper, lower = axes
    x = np.array([step.load_factor for step in steps]) * (approach or 1.0)
    contacts = [step.contact[pair] for step in steps]
    upper.plot(x, [np.linalg.norm(c.force) for c in contacts], "o-", ms=4, label="computed")
    bracket = np.array([c.radius for c in contacts])
    legend = "computed (between closed and open)"
    lower.fill_between(x, bracket[:, 0], bracket[:, 1], alpha=0.3, label=legend, step="mid")
    if law is not None and approach is not None:
        fine = np.linspace(1e-3, 1.0, 200) * x[-1]
        curves = [law.at_approach(d) for d in fine]
        upper.plot(fine, [c.force for c in curves], "k-", lw=1, label="Hertz, equal approach")
        lower.plot(fine, [c.radius for c in curves], "k-", lw=1, label="Hertz, equal approach")
    name_axes(upper, "", f"contact force [{units['force']}]", title or f"Contact '{pair}' over the load")
    along = f"approach [{units['length']}]" if approach else "load factor"
    name_axes(lower, along, f"contact radius [{units['length']}]", "")
    for ax in axes:
        ax.grid(alpha=0.3)
        ax.legend()
        ax.set_ylim(bottom=0.0)
    return axes
