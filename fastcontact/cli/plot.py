"""``fastcontact plot``: the deformed mesh coloured by von Mises, and the history over the load."""

from __future__ import annotations

import argparse
from typing import Any

from fastcontact.cli import _results
from fastcontact.cli._outputs import check_outputs, save
from fastcontact.cli._terminal import say
from fastcontact.errors import CaseError

HELP = "plot the deformed mesh with its von Mises stress, or force and radius over the load"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this command."""
    _results.arguments(parser)
    parser.add_argument("--png", metavar="FILE", help="picture to write")
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--history", action="store_true", help="force and contact radius over the load instead")
    what.add_argument("--axis", action="store_true", help="stresses along the axis under the contact, against theory")
    what.add_argument(
        "--zones", action="store_true", help="where the contact is open, closed and slides, over the load"
    )
    what.add_argument("--view", action="store_true", help="an interactive window (PyVista) instead of a picture")
    parser.add_argument("--mirrored", action="store_true", help="draw the full section beyond the axis, too")
    parser.add_argument("--scale", type=float, default=1.0, help="factor on the displacements (default 1)")


def run(options: argparse.Namespace) -> int:
    """Write the picture, or show the window."""
    from fastcontact.results import plot
    from fastcontact.results.reader import open_results

    if not (options.png or options.view):
        raise CaseError("name the picture to write with --png FILE, or ask for a window with --view")
    check_outputs([options.file], (), [options.png])
    with open_results(options.file) as results:
        step = _results.chosen_step(results, options.step)
        case = _results.case_data(results)
        if options.view:
            plot.view(results, step, scale=options.scale, title=case["title"], screenshot=options.png)
            return 0
        save(_drawn(options, results, step, case), options.png)
    if not options.quiet:
        say(f"wrote {options.png}")
    return 0


def _drawn(options: argparse.Namespace, results: Any, step: Any, case: dict[str, Any]) -> Any:
    """Draw the deformed mesh, or of one contact pair its zones or history over the load, or the stresses under it."""
    from fastcontact.results import plot

    labels = {"title": case["title"], "units": case["units"]}
    loaded = f"load factor {step.load_factor:g}"
    if not (options.history or options.axis or options.zones):
        labels["title"] = f"{case['title']}\n{loaded}, displacements x {options.scale:g}".strip()
        return plot.deformed_shape(results.mesh, step, scale=options.scale, mirrored=options.mirrored, **labels)
    name = _results.chosen_contact(step, options.contact)
    hint = _results.other_contacts(step, name, options.contact)
    if hint and not options.quiet:
        say(hint, error=True)
    theories = case["theories"].get(name, {})
    if options.zones:
        return plot.contact_zones(list(results), name, **labels)
    if options.history:
        approach = case["approach"].get(name)
        return plot.history(list(results), name, law=_results.law(theories), approach=approach, **labels)[0]
    theory = theories.get("theory")
    theory = getattr(theory, "hertz", theory)
    curves: dict[str, Any] = {}
    if hasattr(theory, "stress_on_axis"):
        same = _results.at_equal_force("theory, equal force", theory, step.contact[name], theories["share"])
        approach, load = case["approach"].get(name), _results.load_multiplier(case["ramp"], step)
        if approach is not None and load > 0 and hasattr(theory, "at_approach"):
            curves["theory, equal approach"] = theory.at_approach(approach * load) if load != 1.0 else theory
        elif not same:
            curves["theory"] = theory
        curves |= same
    labels["title"] = f"{case['title']}\nstresses on the axis, {loaded}".strip()
    return plot.axis_stress(results.mesh, step, name, curves, **labels)
