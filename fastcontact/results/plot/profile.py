"""The pressure of a contact pair over the distance from its axis, with theory beside it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fastcontact.results.plot._axes import UNITS, Units, new_axes
from fastcontact.results.step import ContactResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]


def pressure_profile(
    contact: ContactResult,
    theory: Any = None,
    *,
    other_theories: Mapping[str, Any] | None = None,
    stress: Array | None = None,
    title: str = "",
    units: Units = UNITS,
    ax: Axes | None = None,
) -> Axes:
    """Plot the contact pressure over the distance from the axis (in 3D that of first contact), with theory beside it.

    Parameters
    ----------
    contact : ContactResult
    theory : object with ``pressure(r)``, ``pressure_max`` and ``radius``, optional
        E.g. `analytic.hertz_point`.
    other_theories : mapping of str to such an object, optional
        Further curves by legend.
    stress : ndarray (m,), optional
        Normal stress at the contact nodes (compression negative), drawn with the opposite sign [pressure].
    title : str
    units : mapping
        Names of the units of ``length`` and ``pressure`` for the labels.
    ax : matplotlib Axes, optional
    """
    ax = new_axes(ax, (7.0, 4.6))
    flat = contact.coordinates.shape[1] == 2
    r = np.abs(contact.coordinates[:, 0]) if flat else contact.abscissa
    theories = {**({"Hertz, equal approach": theory} if theory is not None else {}), **(other_theories or {})}
    reach = max([contact.radius[1] if np.isfinite(contact.radius[1]) else 0.0, *(t.radius for t in theories.values())])
    reach = 1.35 * reach or float(r.max())
    shown = r <= reach
    for style, (legend, curve) in zip(("-", "--", ":", "-."), theories.items(), strict=False):
        x = np.append(np.linspace(0.0, curve.radius, 400), reach)
        label = f"{legend} ($p_0$ = {curve.pressure_max:.1f})"
        ax.plot(x, curve.pressure(x), style, color="black", lw=1.1, label=label)
    label = f"{contact.formulation.replace('_', '-')} ($p$ max = {contact.pressure_max:.1f})"
    ax.plot(r[shown], contact.pressure[shown], "o-" if flat else "o", color="tab:blue", ms=4, lw=0.8, label=label)
    if stress is not None:
        direction = "yy" if flat else "nn"
        ax.plot(r[shown], -stress[shown], "x", color="tab:red", ms=5, label=rf"$-\sigma_{{{direction}}}$ at the nodes")
    inside, outside = contact.radius
    if np.isfinite(inside) and np.isfinite(outside):
        ax.axvspan(inside, outside, color="tab:blue", alpha=0.15, lw=0, label=f"edge: {inside:.2f} to {outside:.2f}")
    x_name, y_name = f"distance from the axis [{units['length']}]", f"contact pressure [{units['pressure']}]"
    ax.set(xlabel=x_name, ylabel=y_name, title=title or f"Contact '{contact.name}'", xlim=(0.0, reach))
    ax.set_ylim(bottom=0.0)
    ax.grid(alpha=0.3)
    ax.legend()
    return ax
