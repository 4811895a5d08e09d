"""``fastcontact profile``: computed and theoretical pressure along the contact, as a table, XMGRACE file or picture."""

from __future__ import annotations

from argparse import Namespace
from typing import Any

import numpy as np

from fastcontact.analytic.pressure_curve import PressureCurve, curves_along_axes, has_ellipse, pressure_curve
from fastcontact.arrays import Array
from fastcontact.cli import _results
from fastcontact.cli._outputs import check_outputs, draw_profile, say_written
from fastcontact.cli._results import load_multiplier, pressure_curves
from fastcontact.cli._terminal import say

HELP = "contact pressure along the surface compared with theory: CSV, XMGRACE .agr, PNG"
ARGUMENTS = {
    **_results.ARGUMENTS,
    "--csv FILE": "write the table",
    "--agr FILE": "write an XMGRACE project with the computed and the theoretical pressure",
    "--png FILE": "write a picture",
}


def run(options: Namespace) -> int:
    """Write the files that the options request, or print the table if there are none."""
    from fastcontact.results.reader import open_results
    from fastcontact.results.tables import contact_table, with_column, write_csv

    check_outputs([options.file], [options.csv, options.agr], [options.png])
    with open_results(options.file) as results:
        step = _results.select_step(results, options.step)
        name = _results.select_contact(options, step)
        case = _results.case_data(results)
    contact = step.contact[name]
    table = contact_table(contact, step)
    load = load_multiplier(case["ramp"], step)
    theories = pressure_curves(case["theories"].get(name, {}), contact, approach=case["approach"].get(name), load=load)
    for label, theory in theories.items():
        pressure = _pressure_at_nodes(theory, contact, case["theories"][name]["share"], table["radius"])
        column = f"pressure_{label.replace(', ', '_').replace(' ', '_').replace('é', 'e')}"
        if pressure is not None:
            table = with_column(table, column, pressure)
        elif not options.quiet:
            text = "the principal axes of the contact are unknown, or its 'share' does not match the model"
            say(f"contact '{name}': no column '{column}' of the elliptical theory: {text}", error=True)
    if options.csv:
        write_csv(options.csv, table)
    if options.agr:
        curves = [(k, curves_along_axes(theory)) for k, theory in theories.items()]
        by_label = {f"{label}{axis}": curve for label, along in curves for axis, curve in along.items()}
        _write_agr(options.agr, case, contact, step, by_label)
    if options.png:
        draw_profile(contact, step, theories, options.png, case["title"] or name)
    if options.csv or options.agr or options.png:
        say_written(options, options.csv, options.agr, options.png)
    else:
        _print_table(table)
    return 0


def _pressure_at_nodes(theory: Any, contact: Any, share: float, distance: Array) -> Array | None:
    """Return the pressure of a theory at the secondary nodes (m,) [pressure]; None if the axes of its ellipse are unknown.

    `distance` (m,) are the distances of the rows of the table from the middle of the contact [length].
    """
    from fastcontact.results.contact_ellipse import principal_coordinates

    if not has_ellipse(theory):
        curve = pressure_curve(theory)
        return None if curve is None else curve.pressure(distance)
    position = principal_coordinates(contact, share)
    if position is None:
        return None
    major, minor = position.T  # in the order of the rows, because the table of a contact in 3D is not sorted
    x, y = (major, minor) if theory.radius_x > theory.radius_y else (minor, major)
    return np.asarray(theory.pressure(x, y))


def _print_table(table: Any) -> None:
    """Print the main columns of a table."""
    names = [name for name in table.dtype.names if name in ("point", "x", "y", "gap", "pressure", "active")]
    names += [name for name in table.dtype.names if name.startswith("pressure_")]
    say("  ".join(f"{name:>14}" for name in names))
    for row in table:
        say("  ".join(f"{row[name]:>14.6g}" for name in names))


def _write_agr(path: str, case: dict[str, Any], contact: Any, step: Any, theories: dict[str, PressureCurve]) -> None:
    """Write an XMGRACE project with the computed pressure and the theoretical pressures, given by label."""
    from fastcontact.results.units import axis_label
    from fastcontact.results.xmgrace import Curve, write_agr

    order = np.argsort(contact.place, kind="stable")
    position = contact.place[order]
    style = "line+symbols" if contact.coordinates.shape[1] == 2 else "symbols"
    curves = [Curve(position, contact.pressure[order], "computed", style=style)]
    for label, curve in theories.items():
        end = min(curve.radius, float(np.abs(position).max()))
        x = np.unique(np.concatenate([position[[0, -1]], np.linspace(max(-end, min(position[0], 0.0)), end, 200)]))
        curves.append(Curve(x, curve.pressure(np.abs(x)), label))
    start = "axis" if contact.measured_from_axis else "middle of the contact"
    title, subtitle = case["title"] or f"Contact '{contact.name}'", f"load factor {step.load_factor:g}"
    xlabel = axis_label(f"distance from the {start}", contact.units, "length")
    ylabel = axis_label("contact pressure", contact.units, "pressure")
    write_agr(path, curves, title=title, subtitle=subtitle, xlabel=xlabel, ylabel=ylabel)
