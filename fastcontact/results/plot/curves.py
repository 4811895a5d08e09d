"""Plots of a contact: pressure profiles, stresses below the surface, and force, radius and zones over the load steps."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import is_dataclass
from functools import partial
from typing import Any

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.analytic.pressure_curve import PressureCurve, author, curves_along_axes
from fastcontact.arrays import AnyArray, Array, Indices
from fastcontact.elasticity.material_axes import rotated_stress
from fastcontact.elasticity.recovery import von_mises
from fastcontact.errors import FastcontactError
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.topology import points_of_solids
from fastcontact.results.plot import _axes
from fastcontact.results.plot._axes import MODEL_UNITS, Axes, Units, contacts_of, new_axes, outer_legend, units_of
from fastcontact.results.step import MIN_ELEMENTS_ACROSS_RADIUS, ContactResult, StepResult, half_width
from fastcontact.results.units import axis_label, units_of_results, value_text


@typed(FastcontactError)
def pressure_profile(
    contact: ContactResult,
    theory: Any = None,
    *,
    other_theories: Mapping[str, Any] | None = None,
    stress: Array | None = None,
    title: str = "",
    units: Units = MODEL_UNITS,
    ax: Axes | None = None,
) -> Axes:
    """Plot the contact pressure as a function of the distance from the middle, with theories for comparison.

    The distance is `ContactResult.place`: the radius in axisymmetry, the arc length in plane models, and the distance from
    the axis of the contact in 3D. It has a sign if nodes lie on both sides of the middle. The range between the bounds of the
    contact radius is shaded. If the axes already contain a profile, the new one has another colour.

    Parameters
    ----------
    contact : ContactResult
        Result of a contact pair.
    theory : object, optional
        A result of a function in `analytic`, such as `analytic.hertz_point`, or an object with the method ``pressure(r)``
        and the attributes ``pressure_max`` and ``radius``. `analytic.hertz_elliptical` has a curve along each axis of the
        ellipse.
    other_theories : mapping of str to object, optional
        Further theories, by their labels in the legend.
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

    Raises
    ------
    FastcontactError
        If a theory has no pressure, or `stress` does not have the shape (m,).

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
            f"stress has the shape {np.shape(stress)}, not {np.shape(contact.place)}: give one value for each secondary node"
        )
    ax, units = new_axes(ax, (6.4, 5.0)), units_of(units, contact)
    n_profiles = sum(line.get_marker() == "o" for line in ax.lines)
    colour = ("tab:blue", "tab:orange", "tab:green", "tab:purple", "tab:brown", "tab:pink")[n_profiles % 6]
    order = np.argsort(contact.place, kind="stable")
    position, is_2d = contact.place[order], contact.coordinates.shape[1] == 2
    curves = _curves(theory, other_theories or {})
    low, high = _shown_range(contact, curves)
    limits = (low, high, *(ax.get_xlim() if n_profiles else ()))
    shown = (position >= low) & (position <= high)
    for style, (legend, curve) in zip(("-", "--", ":", "-."), curves.items(), strict=False):
        end = min(curve.radius, high)
        x = np.unique(np.concatenate([[low, high], np.linspace(max(-end, low), end, 400)]))
        name = "$p_0$" if np.isfinite(curve.radius) else "$p$"  # with an infinite radius the pressure is uniform
        label = f"{legend}: {name} = {value_text(curve.pressure_max, units, 'pressure')}"
        ax.plot(x, curve.pressure(np.abs(x)), style, color="black", lw=1.1, label=label)
    peak = f"$p_{{max}}$ = {value_text(contact.pressure_max, units, 'pressure')}"
    label = f"{contact.formulation.replace('_', '-')}: {peak}"
    pressure = contact.pressure[order][shown]
    ax.plot(position[shown], pressure, "o-" if is_2d else "o", color=colour, ms=4, lw=0.8, label=label)
    if stress is not None:
        label = r"$-n \cdot \sigma \cdot n$ at the nodes"
        ax.plot(position[shown], -stress[order][shown], "x", color="tab:red", ms=5, label=label)
    _mark_edges(ax, contact, position, units, colour)
    start = "axis" if contact.measured_from_axis else "middle of the contact"
    distance = "distance along the surface" if is_2d and not contact.measured_from_axis else "distance"
    ax.set(xlabel=axis_label(f"{distance} from the {start}", units, "length"), xlim=(min(limits), max(limits)))
    ax.set(ylabel=axis_label("contact pressure", units, "pressure"))
    ax.set(title=title or ax.get_title() or f"Contact '{contact.name}'")
    ax.set_ylim(min(0.0, 1.05 * float(pressure.min(initial=0.0))), 1.05 * ax.dataLim.y1 or None)
    ax.grid(alpha=0.3)
    ax.title.set_fontsize("medium")
    outer_legend(ax, 2)
    return ax


def _curves(theory: Any, others: Mapping[str, Any]) -> dict[str, PressureCurve]:
    """Return the pressure curves of the theories, by their labels in the legend.

    Results of `analytic` without a pressure are left out.
    """
    curves = dict[str, PressureCurve]()
    for legend, candidate in (("", theory), *others.items()):
        found = curves_along_axes(candidate)
        curves |= {f"{legend or curve.name}{axis}": curve for axis, curve in found.items()}
        if not found and candidate is not None and not is_dataclass(candidate):
            raise FastcontactError(
                f"a theory needs a pressure, like the results of fastcontact.analytic, but {candidate!r} has none"
            )
    return curves


def _shown_range(contact: ContactResult, curves: Mapping[str, PressureCurve]) -> tuple[float, float]:
    """Return the limits of the x axis, about one third beyond the contact and the radii of the theories.

    The limits lie at most 2 % beyond the farthest node or the largest radius. They include both sides of the middle if
    the surface has nodes on both sides.
    """
    farthest_closed = np.abs(contact.place[contact.active]).max(initial=0.0)
    radii = [value for value in (*contact.radius, *(c.radius for c in curves.values())) if np.isfinite(value)]
    farthest = float(np.abs(contact.place).max(initial=0.0))
    reach = 1.35 * max([farthest_closed, *radii]) or 1.02 * farthest or 1.0
    reach = min(reach, 1.02 * max(farthest, *radii, 1e-300)) if farthest_closed else reach
    low, nearest = contact.place.min(initial=0.0), float(np.abs(contact.place).min(initial=np.inf))
    if nearest > 0.2 * reach and not curves:  # on a ring, the range between the axis and the bore would be empty
        return nearest - 0.05 * (reach - nearest), reach
    return (max(-reach, 1.02 * float(low)) if low < 0 else 0.0), reach


def _mark_edges(ax: Axes, contact: ContactResult, position: Array, units: Mapping[str, str], colour: str) -> None:
    """Shade the range between the bounds of the contact radius at each end, in plane models as arc lengths."""
    inside, outside = half_width(contact.place, contact.active)
    if not (np.isfinite(inside) and np.isfinite(outside)):
        return
    closed_places, one_sided = contact.place[contact.active], position.min(initial=0.0) >= 0.0
    centre = 0.0 if one_sided else 0.5 * float(closed_places.min() + closed_places.max())
    before = contact.place[contact.place < closed_places.min()]
    label = f"edges: {centre - inside:.4g} and {value_text(centre + inside, units, 'length')}"
    if one_sided and before.size:  # the contact is a ring around an open middle
        ax.axvspan(before.max(), closed_places.min(), color=colour, alpha=0.15, lw=0)
        outer = f"{inside:.4g} to {value_text(outside, units, 'length')}"
        label = f"edges: {before.max():.4g} to {closed_places.min():.4g}, and {outer}"
    elif abs(centre) <= 0.01 * outside:
        # The difference of the bounds may be smaller than the distance between two nodes, because constraints may lie between
        # nodes. Nodes beyond the contact are excluded, because on a curved surface their distance from the middle along the
        # tangent may be the same as that of nodes in contact.
        place = np.abs(contact.place)
        near = np.flatnonzero(place <= outside)[np.argsort(place[place <= outside])]
        inside, outside = np.interp(contact.radius, np.abs(contact.across)[near], place[near])
        label = f"edge: {inside:.4g} to {value_text(outside, units, 'length')}"
    label += "" if contact.tangent is None else " (arc length)"
    for side in (1.0,) if one_sided else (-1.0, 1.0):
        ends = centre + side * inside, centre + side * outside
        ax.axvspan(min(ends), max(ends), color=colour, alpha=0.15, lw=0, label=label if side > 0.0 else None)


# Depth of the plotted region, in contact radii.
PLOTTED_DEPTH = 4.0
COMPONENTS = {"along the axis": 1, "across the axis": 0}
# Colours of the COMPONENTS and of the von Mises stress.
COLOURS = ("C0", "C1", "C2")


@typed(FastcontactError)
def axis_stress(
    mesh: Mesh,
    step: StepResult,
    pair: str,
    theories: Mapping[str, Any] | None = None,
    *,
    title: str = "",
    units: Units = MODEL_UNITS,
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
        Theories, by their labels in the legend: objects with the method ``stress_on_axis(depth)``, such as the result of
        `analytic.hertz_point`. If Poisson's ratios of the two bodies of a theory differ, both have their own curves.
    title, units, ax
        Described for `pressure_profile`.

    Returns
    -------
    matplotlib Axes

    Raises
    ------
    FastcontactError
        If the mesh is three-dimensional or has no nodes on the axis, or the step has no such pair.

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
    vertical = abs(_axis(step, pair)[1][1]) > 0.5
    bodies = ("upper body", "lower body") if vertical else ("right body", "left body")
    axes, units = new_axes(ax, (6.4, 4.8)), units_of(units, step)
    reach = PLOTTED_DEPTH * np.nan_to_num(contacts_of([step], pair)[0].radius[0]) or float(depth.max())
    shown = depth <= reach
    values = {caption: stress[:, component] for caption, component in COMPONENTS.items()}
    values["von Mises"] = von_mises(stress)
    for number, name in enumerate(bodies):
        rows = shown & (side == 1 - 2 * number)
        for (caption, value), colour, marker in zip(values.items(), COLOURS, "osD", strict=True):
            if rows.any():  # symbols of the second body are hollow, so that they do not hide those of the first body
                face, label = ("none" if number else colour), f"{caption}, {name}"
                axes.plot(depth[rows], value[rows], marker, color=colour, mfc=face, ms=3.5 * (1 + number), label=label)
    depths = np.linspace(0.0, reach, 400)
    by_ratio = (curve for label, theory in (theories or {}).items() for curve in _by_poissons_ratio(label, theory))
    for style, (label, stress_at) in zip(("-", "--", ":", "-."), by_ratio, strict=False):
        exact = stress_at(depths)
        curves = [*(exact[:, component] for component in COMPONENTS.values()), von_mises(exact)]
        for colour, curve in zip(COLOURS, curves, strict=True):
            axes.plot(depths, curve, style, color=colour, lw=1.0)
        axes.plot([], [], f"k{style}", lw=1.0, label=label)
    title = title or f"Stresses on the axis, {step.instant}"
    axes.set(xlabel=axis_label("depth below the surface", units, "length"))
    axes.set(ylabel=axis_label("stress", units, "pressure"))
    axes.set_title(title, fontsize="medium")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    return axes


def _by_poissons_ratio(label: str, theory: Any) -> list[tuple[str, Callable[[Array], Array]]]:
    """Return the label of a theory and its stress on the axis, for both bodies if their Poisson's ratios differ."""
    bodies, stress = getattr(theory, "bodies", None), theory.stress_on_axis
    if bodies is None or bodies.E2 is None or bodies.nu1 == bodies.nu2:
        return [(label, stress)]
    return [(f"{label}, nu = {nu:g}", partial(stress, nu=nu)) for nu in (bodies.nu1, bodies.nu2)]


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
    origin, direction = _axis(step, pair)
    tolerance = 1e-9 * np.ptp(mesh.points, axis=0).max()
    used = points_of_solids(mesh)
    height = (mesh.points[used] - origin) @ direction
    offset = (mesh.points[used] - origin) @ np.array([direction[1], -direction[0]])
    # The direction of an oblique axis is the normal of a facet, whose error may be a few thousandths of a radian.
    slope_tolerance = 0.0 if np.abs(direction).max() == 1.0 else 2e-3
    on_axis = np.abs(offset) <= tolerance + slope_tolerance * np.abs(height)
    nodes, height = used[on_axis], height[on_axis]
    if len(nodes) < 2:
        raise FastcontactError(
            f"the mesh has no nodes on the axis of contact '{pair}', along which stresses could be plotted"
        )
    # Both bodies have a node where the axis intersects the surface. The side of the cells of such a node determines its body.
    body_side = _body_sides(mesh, nodes, origin, direction)
    side = np.where(np.abs(height) > tolerance, np.sign(height), body_side).astype(np.int64)
    order = np.lexsort((np.abs(height), side))
    axes = np.array([[direction[1], -direction[0]], direction])
    return np.abs(height)[order], side[order], rotated_stress(step.stress[nodes], axes)[order]


def _axis(step: StepResult, pair: str) -> tuple[Array, Array]:
    """Return the intersection (2,) [length] of the axis with the contact surface, and its upward direction (2,) [-]."""
    contact = contacts_of([step], pair)[0]
    nearest = int(np.argmin(np.abs(contact.place)))
    normal = contact.normal[nearest]
    if contact.measured_from_axis or not np.linalg.norm(normal) > 0.5:
        return np.array([0.0, contact.coordinates[nearest, 1]]), np.array([0.0, 1.0])
    axis = int(np.argmax(np.abs(normal)))
    direction = np.eye(2)[axis] if abs(normal[axis]) > 0.999 else normal * np.sign(normal[axis])
    return contact.coordinates[nearest], direction


def _body_sides(mesh: Mesh, nodes: AnyArray, origin: Array, direction: Array) -> Array:
    """Return the side (n,), 1 or -1, on which the cells of each node lie; see `stresses_on_axis`."""
    total = np.zeros(mesh.n_points)
    for block in mesh.solids.values():
        np.add.at(total, block, ((mesh.points[block].mean(axis=1) - origin) @ direction)[:, None])
    return np.asarray(np.sign(total[nodes]))


# Largest number of steps for which `contact_zones` shows the number of closed nodes.
MAX_COUNTS = 20
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
    units: Units = MODEL_UNITS,
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
        A theory, such as the result of `analytic.hertz_point`; it is only plotted if `approach` is given. Both semi-axes of
        an ellipse are plotted.
    approach : float, optional
        Approach of the bodies at load factor 1 [length]; if it is given, the abscissa is the approach, which is assumed to
        be proportional to the load factor.
    share : float
        Fraction of the contact of the theory that the model represents, for example 0.25 for a quarter [-].
    title, units
        Described for `pressure_profile`.
    axes : two matplotlib Axes, optional
        Axes of the force and of the radius; by default those of a new figure.

    Returns
    -------
    sequence of two matplotlib Axes
        Axes of the force and of the radius.

    Raises
    ------
    FastcontactError
        If there are no steps, or a step has no such pair.

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
    forces = [c.normal_force if cancels else c.force_against_theory(share) for c in contacts]
    upper.plot(x, forces, "o", ms=4, label="computed")
    _plot_bounds(lower, x, np.array([c.radius for c in contacts]))
    if law is not None and approach is not None:
        name = f"{author(law)}, equal approach"
        approaches = x.max() * np.linspace(0.0, 1.0, 200)[1:] ** 2
        theory = [law.at_approach(d) for d in approaches]
        upper.plot([0.0, *approaches], [0.0, *(share * t.force for t in theory)], "k-", lw=1, label=name)
        for radius in ("radius_x", "radius_y") if hasattr(law, "radius_x") else ("radius",):
            label = None if radius == "radius_y" else name
            lower.plot([0.0, *approaches], [0.0, *(getattr(t, radius) for t in theory)], "k-", lw=1, label=label)
    if any(c.per_thickness for c in contacts):
        units = units_of_results(units, "plane_strain")
    upper.set(ylabel=axis_label("sum of the normal forces" if cancels else "contact force", units, "force"))
    upper.set_title(title or f"Contact '{pair}' against the load", fontsize="medium")
    if coarse := sum(pair in step.iterations.get("coarse_contacts", {}) for step in steps):
        count = f"in {coarse} of {len(steps)} steps"
        lower.set_title(f"fewer than {MIN_ELEMENTS_ACROSS_RADIUS} elements across the radius {count}", fontsize="small")
    abscissa = axis_label("approach", units, "length") if approach else "load factor"
    extent = "contact radius" if contacts[-1].extent == "radius" else "half-width of the contact"
    lower.set(xlabel=abscissa, ylabel=axis_label(extent, units, "length"))
    for ax in axes:
        ax.grid(alpha=0.3)
        entries = len(ax.get_legend_handles_labels()[0])
        if entries:
            ax.legend(fontsize=9, loc="upper left")
        top = float(ax.dataLim.y1)
        margin = 0.12 * (entries + 0.3) if entries else 0.05  # space for the legend above the curves
        ax.set_ylim(0.0, (1.0 + margin) * top if 0.0 < top < np.inf else None)
        ax.set_xlim(left=min(0.0, float(x.min())))
    return axes


def _plot_bounds(ax: Any, x: Array, bounds: Array) -> None:
    """Draw a bar between the bounds (n, 2) of the radius at each step, or a tick if there is no upper bound."""
    low, high = bounds.T
    bounded = np.isfinite(low) & np.isfinite(high)
    all_closed = np.isfinite(low) & ~bounded
    if bounded.any():
        label = "computed: outermost closed node to first open one"
        ax.vlines(x[bounded], low[bounded], high[bounded], lw=4, alpha=0.5, color="tab:blue", label=label)
        ax.plot([x[bounded], x[bounded]], [low[bounded], high[bounded]], "_", ms=6, color="tab:blue")
    if all_closed.any():
        ax.plot(x[all_closed], low[all_closed], "_", ms=9, color="tab:blue", label="computed: all nodes closed")


@typed(FastcontactError)
def contact_zones(
    steps: Sequence[StepResult], pair: str, *, title: str = "", units: Units = MODEL_UNITS, ax: Axes | None = None
) -> Axes:
    """Plot at every load step which secondary nodes are open, closed or, with friction, sticking or sliding.

    Positions in all steps are relative to the middle of the contact in the first step in which a node is closed.

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
        If there are no steps, or a step has no such pair.

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
    contacts, axes = contacts_of(steps, pair), new_axes(ax, (6.4, 4.8))
    units = units_of(units, steps[-1])
    x = np.concatenate([np.full(len(c.points), step.load_factor) for step, c in zip(steps, contacts, strict=True)])
    first = next((c for c in contacts if c.active.any()), contacts[-1])
    y = np.tile(first.place, len(contacts))
    closed = np.concatenate([c.active for c in contacts])
    sliding = closed & ~np.concatenate([c.sticking for c in contacts])
    closed_state = "sticking" if sliding.any() or any(c.shear.any() for c in contacts) else "closed"
    for state, nodes in (("open", ~closed), (closed_state, closed & ~sliding), ("sliding", sliding)):
        if nodes.any():
            axes.plot(x[nodes], y[nodes], "o" if state != "open" else ".", ms=4, color=STATES[state], label=state)
    stride = -(-len(contacts) // MAX_COUNTS)
    for step, contact in list(zip(steps, contacts, strict=True))[(len(contacts) - 1) % stride :: stride]:
        anchor = {"xycoords": ("data", "axes fraction"), "ha": "center", "va": "bottom"}
        axes.annotate(str(int(contact.active.sum())), (step.load_factor, 1.0), fontsize=8, **anchor)
    reach, farthest = 1.5 * np.abs(y[closed]).max(initial=0.0), np.abs(y).max(initial=0.0)
    top = reach if 0.0 < reach < farthest else None
    axes.set_ylim((-top if top else None) if y.min(initial=0.0) < 0 else 0.0, top)
    start = "axis" if first.measured_from_axis else "middle of the first contact"
    distance = axis_label(f"distance from the {start}", units, "length")
    axes.set(xlabel="load factor (above: closed nodes)", ylabel=distance)
    axes.set_title(title or f"States of the nodes of contact '{pair}' in each load step", pad=16, fontsize="medium")
    _axes.outer_legend(axes, 3)
    return axes
