"""``fastcontact converge``: a case on finer and finer meshes, and why it differs from theory."""

from __future__ import annotations

import argparse
import sys

from fastcontact.cli import _study
from fastcontact.errors import FastcontactError

HELP = "mesh-convergence study: orders, limits with error bars, model error told from mesh error"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this command."""
    parser.add_argument("case", help="case file (TOML); its table [study] names the meshes")
    parser.add_argument("--levels", type=int, default=5, metavar="N", help="number of meshes (default 5)")
    parser.add_argument("--elements", metavar="NAMES", help="elements to compare, e.g. quad4,quad8, or all")
    parser.add_argument("--formulations", metavar="NAMES", help="e.g. node_to_segment,continuous, or all")
    parser.add_argument("--quantities", metavar="NAMES", help="further quantities, e.g. C1.stress.yy,C1.displacement.y")
    _study.arguments(parser)


def run(options: argparse.Namespace) -> int:
    """Run the study, write what was asked for, print tables and sentences."""
    from fastcontact.cli._pictures import save
    from fastcontact.convergence import convergence_study

    _study.check_targets(options)
    progress = _study.Lines(show=sys.stderr.isatty() and not options.quiet)
    try:
        with _study.executor(options.executor) as executor:
            study = convergence_study(
                options.case,
                options.levels,
                _study.names(options.elements),
                _study.names(options.formulations),
                quantities=_study.names(options.quantities) or (),
                executor=executor,
                workers=options.workers,
                store=options.store,
                on_progress=progress,
            )
    except KeyboardInterrupt:
        raise FastcontactError(_study.stopped(options)) from None
    finally:
        progress.close()
    written = _study.write(options, study, save)
    failures = [text for series in study.series for text in series.failed.values()] + list(study.failed.values())
    for text in failures:
        print(f"warning: {text}", file=sys.stderr)
    if not options.quiet:
        print("\n".join(study.lines()))
        print(f"wrote {', '.join(written)}" if written else "nothing written: --html FILE makes a report to send on")
    return 2 if failures else 0
