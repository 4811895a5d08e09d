"""``fastcontact plot``: the deformed mesh coloured by von Mises, and the history over the load."""

from __future__ import annotations

import argparse

from fastcontact.cli import _results

HELP = "plot the deformed mesh with its von Mises stress, or force and radius over the load"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this command."""
    _results.arguments(parser)
    parser.add_argument("--png", metavar="FILE", required=True, help="picture to write")
    parser.add_argument("--history", action="store_true", help="force and contact radius over the load instead")
    parser.add_argument("--scale", type=float, default=1.0, help="factor on the displacements (default 1)")


def run(options: argparse.Namespace) -> int:
    """Write the picture."""
    from fastcontact import plot
    from fastcontact.cli._pictures import save
    from fastcontact.io.result_reader import open_results

    with open_results(options.file) as results:
        step = _results.chosen_step(results, options.step)
        case = _results.case_data(results)
        if options.history:
            name = _results.chosen_contact(step, options.contact)
            axes = plot.history(
                list(results),
                name,
                law=_results.law(case, name),
                approach=case["approach"].get(name),
                title=case["title"],
                units=case["units"],
            )[0]
        else:
            title = f"{case['title']}\nload factor {step.load_factor:g}, displacements x {options.scale:g}"
            axes = plot.deformed_shape(
                results.mesh, step, scale=options.scale, title=title.strip(), units=case["units"]
            )
    save(axes, options.png)
    if not options.quiet:
        print(f"wrote {options.png}")
    return 0
