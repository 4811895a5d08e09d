"""Plot the pressure of a contact pair as a function of the distance from its middle, with theories for comparison."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import is_dataclass
from typing import Any

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.analytic.pressure_curve import PressureCurve, pressure_curve
from fastcontact.arrays import Array
from fastcontact.errors import FastcontactError
from fastcontact.results.plot._axes import UNKNOWN, Axes, Units, new_axes, outer_legend, units_of
from fastcontact.results.step import ContactResult, half_width
from fastcontact.results.units import labelled, valued


@typed(FastcontactError)
def pressure_profile(
    contact: ContactResult,
    theory: Any = None,
    *,
    other_theories: Mapping[str, Any] | None = None,
    stress: Array | None = None,
    title: str = "",
    units: Units = UNKNOWN,
    ax: Axes | None = None,
) -> Axes:
    """Plot the contact pressure as a function of the distance from the middle, with theories for comparison.

    The distance is `ContactResult.place`, which in 2D is the arc length, with a sign if nodes lie on both sides of the
    middle. The edge of the contact is shaded; in finite strain it is the deformed `ContactResult.radius`. If the axes already
    contain a profile, the next one has another colour.

    Parameters
    ----------
    contact : ContactResult
        Result of a contact pair.
    theory : object, optional
        A result of a function in `analytic`, such as `analytic.hertz_point`, or an object with the method ``pressure(r)``
        and the attributes ``pressure_max`` and ``radius``.
    other_theories : mapping of str to object, optional
        Further theories by label of the legend.
    stress : ndarray (m,), optional
        Normal stress at the secondary nodes, negative in compression, which is plotted with the opposite sign [pressure];
        see `normal_stress`.
    title : str
        Title of the plot.
    units : str or mapping of str to str, optional
        Names of the units of ``length``, ``force`` and ``pressure`` for the labels, for example ``"mm, N, MPa"``; by
        default those of the model.
    ax : matplotlib Axes, optional
        Axes of the plot; by default those of a new figure.

    Returns
    -------
    matplotlib Axes

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
    >>> ax = fc.plot.pressure_profile(steps[-1].contact["joint"], title="joint")
    >>> ax.figure.savefig("joint.png")
    """
    if stress is not None and np.shape(stress) != np.shape(contact.place):
        raise FastcontactError(
            f"stress has the shape {np.shape(stress)}, not {np.shape(contact.place)}: one of each node"
        )
    ax, units = new_axes(ax, (6.4, 5.0)), units_of(units, contact)
    earlier = sum(line.get_marker() == "o" for line in ax.lines)
    colour = ("tab:blue", "tab:orange", "tab:green", "tab:purple", "tab:brown", "tab:pink")[earlier % 6]
    order = np.argsort(contact.place, kind="stable")
    position, flat = contact.place[order], contact.coordinates.shape[1] == 2
    curves = _curves(theory, other_theories or {})
    low, high = _shown_range(contact, curves)
    limits = (low, high, *(ax.get_xlim() if earlier else ()))
    shown = (position >= low) & (position <= high)
    for style, (legend, curve) in zip(("-", "--", ":", "-."), curves.items(), strict=False):
        end = min(curve.radius, high)
        x = np.unique(np.concatenate([[low, high], np.linspace(max(-end, low), end, 400)]))
        name = "$p_0$" if np.isfinite(curve.radius) else "$p$"  # the pressure is uniform
        label = f"{legend}: {name} = {valued(curve.pressure_max, units, 'pressure')}"
        ax.plot(x, curve.pressure(np.abs(x)), style, color="black", lw=1.1, label=label)
    peak = f"$p_{{max}}$ = {valued(contact.pressure_max, units, 'pressure')}"
    label = f"{contact.formulation.replace('_', '-')}: {peak}"
    pressure = contact.pressure[order][shown]
    ax.plot(position[shown], pressure, "o-" if flat else "o", color=colour, ms=4, lw=0.8, label=label)
    if stress is not None:
        label = r"$-n \cdot \sigma \cdot n$ at the nodes"
        ax.plot(position[shown], -stress[order][shown], "x", color="tab:red", ms=5, label=label)
    _mark_edges(ax, contact, position, units, colour)
    start = "axis" if contact.measured_from_axis else "middle of the contact"
    along = "distance along the surface" if flat and not contact.measured_from_axis else "distance"
    ax.set(xlabel=labelled(f"{along} from the {start}", units, "length"), xlim=(min(limits), max(limits)))
    ax.set(ylabel=labelled("contact pressure", units, "pressure"))
    ax.set(title=title or ax.get_title() or f"Contact '{contact.name}'")
    ax.set_ylim(min(0.0, 1.05 * float(pressure.min(initial=0.0))), 1.05 * ax.dataLim.y1 or None)
    ax.grid(alpha=0.3)
    ax.title.set_fontsize("medium")
    outer_legend(ax, 2)
    return ax


def _curves(theory: Any, others: Mapping[str, Any]) -> dict[str, PressureCurve]:
    """Return the pressure curves of the theories, by label of the legend."""
    for theory_given in (theory, *others.values()):
        if theory_given is not None and not is_dataclass(theory_given) and pressure_curve(theory_given) is None:
            raise FastcontactError(
                f"a theory has a pressure, as those of fastcontact.analytic do, which {theory_given!r} has not"
            )
    curves = {legend: pressure_curve(other) for legend, other in others.items()}
    curve = pressure_curve(theory)
    return {**({curve.name: curve} if curve is not None else {}), **{k: c for k, c in curves.items() if c is not None}}


def _shown_range(contact: ContactResult, curves: Mapping[str, PressureCurve]) -> tuple[float, float]:
    """Return the limits of the abscissa, which exceed the extent of the contact and of the theories by one third.

    Both sides of the middle are included if the surface has nodes on both sides.
    """
    closed = np.abs(contact.place[contact.active]).max(initial=0.0)
    radii = [value for value in (*contact.radius, *(c.radius for c in curves.values())) if np.isfinite(value)]
    farthest = float(np.abs(contact.place).max(initial=0.0))
    reach = 1.35 * max([closed, *radii]) or 1.02 * farthest or 1.0
    reach = min(reach, 1.02 * max(farthest, *radii, 1e-300)) if closed else reach
    low, nearest = contact.place.min(initial=0.0), float(np.abs(contact.place).min(initial=np.inf))
    if nearest > 0.2 * reach and not curves:  # a ring, where the range between axis and bore would be empty
        return nearest - 0.05 * (reach - nearest), reach
    return (max(-reach, 1.02 * float(low)) if low < 0 else 0.0), reach


def _mark_edges(ax: Axes, contact: ContactResult, position: Array, units: Mapping[str, str], colour: str) -> None:
    """Shade the range of the contact radius, in 2D as arc lengths, on both sides of the contact."""
    inside, outside = half_width(contact.place, contact.active)
    if not (np.isfinite(inside) and np.isfinite(outside)):
        return
    centre = 0.0
    if position.min(initial=0.0) < 0:
        closed = contact.place[contact.active]
        centre = 0.5 * float(closed.min() + closed.max()) if len(closed) else 0.0
    label = f"edges: {centre - inside:.4g} and {valued(centre + inside, units, 'length')}"
    if abs(centre) <= 0.01 * outside:
        # Constraints may lie between nodes, so that the bounds of the radius are closer to each other than nodes are. Nodes
        # beyond the contact are left out: on a curved surface, they may be as near to the middle along the tangent.
        place = np.abs(contact.place)
        near = np.flatnonzero(place <= outside)[np.argsort(place[place <= outside])]
        inside, outside = np.interp(contact.radius, np.abs(contact.across)[near], place[near])
        label = f"edge: {inside:.4g} to {valued(outside, units, 'length')}"
    label += "" if contact.tangent is None else " (arc length)"
    for side in (-1.0, 1.0) if position.min(initial=0.0) < 0 else (1.0,):
        ends = centre + side * inside, centre + side * outside
        ax.axvspan(min(ends), max(ends), color=colour, alpha=0.15, lw=0, label=label if side > 0.0 else None)
