"""``fastcontact bench``: the benchmark suite of the checkout, ``bench/suite``."""

from __future__ import annotations

import argparse
import importlib
import json
import sys
from pathlib import Path
from typing import Any

from fastcontact.cli._outputs import check_outputs, write_json
from fastcontact.cli._terminal import say, somebody_watches
from fastcontact.errors import FastcontactError, FileError

HELP = "run the benchmarks of the checkout"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this command."""
    parser.add_argument("names", nargs="*", metavar="NAME", help="benchmarks (default: all)")
    parser.add_argument("--smallest", action="store_true", help="the smallest size of each, once: does it run?")
    parser.add_argument("--sizes", type=int, nargs="+", metavar="N", help="about how many unknowns")
    parser.add_argument("--json", metavar="FILE", help="write figures and environment")
    parser.add_argument("--png", metavar="FOLDER", help="draw time and memory against unknowns, a picture a benchmark")
    parser.add_argument("--compare", metavar="FILE", help="compare with a run stored by --json")
    parser.add_argument("--problem", metavar="NAME", help="with contact, in detail: sphere-on-block, forma04c ...")
    parser.add_argument("--dofs", type=int, metavar="N", help="with --problem: about how many unknowns")
    parser.add_argument("--linear", metavar="SOLVER", help="with --problem: linear solver (default: the problem's)")
    parser.add_argument("--tolerance", type=float, metavar="T", help="with --problem: of solver and geometry (1e-8)")


def suite(name: str) -> Any:
    """Import a module of ``bench/suite``; raises FastcontactError if the package is installed without its checkout."""
    folder = Path(__file__).resolve().parents[2] / "bench"
    if not (folder / "suite").is_dir():
        raise FastcontactError(
            f"the benchmarks need the source checkout, and there is no '{folder}': install it with pip install -e"
        )
    if str(folder) not in sys.path:
        sys.path.append(str(folder))
    return importlib.import_module(f"suite.{name}")


def run(options: argparse.Namespace) -> int:
    """Run the benchmarks, print the table, write the files of the options."""
    if any(size < 1 for size in [*(options.sizes or ()), *([] if options.dofs is None else [options.dofs])]):
        raise FastcontactError("--sizes and --dofs must be positive: give about how many unknowns the problem has")
    check_outputs([options.compare], [options.json])
    if options.problem or options.dofs:
        return _contact(options)
    subjects, timing, table = map(suite, ("subjects", "timing", "table"))
    before = _stored(options.compare) if options.compare else None
    results: dict[str, Any] = {}
    tables: dict[str, Any] = {}
    show = somebody_watches() and not options.quiet
    for name in options.names or subjects.names():
        subject = subjects.load(name)
        if hasattr(subject, "entries"):  # a table of its own
            tables[name] = _table(subject, name, options, show)
            continue
        sizes = subject.SIZES[:1] if options.smallest else options.sizes or subject.SIZES
        for size in sizes:
            if show:
                say(f"{name} {size} ...", error=True)
            measured = timing.measured(subject, size, 1 if options.smallest else 3)
            results.setdefault(name, []).append(measured)
    if results and not options.quiet:
        say("\n".join(table.lines(results, before)))
    if options.json:
        write_json(options.json, {"environment": table.environment(), "results": results, "tables": tables}, indent=1)
    if options.png:
        draw(options.png, results)
    return 0


def _table(subject: Any, name: str, options: argparse.Namespace, show: bool) -> list[dict[str, Any]]:
    """Return the rows of a subject that has a table of its own, and print them."""

    def tell(text: str) -> None:
        if show:
            say(f"{name} {text} ...", error=True)

    rows: list[dict[str, Any]] = subject.entries(options.smallest, tell, options.sizes)
    if not options.quiet:
        say("\n".join(subject.lines(rows)))
    return rows


def _contact(options: argparse.Namespace) -> int:
    if options.names != ["contact"] or not options.problem or not options.dofs:
        raise FastcontactError("--problem and --dofs go together, with the benchmark 'contact' alone")
    given = {"solver": options.linear, "tolerance": options.tolerance}
    chosen = {key: value for key, value in given.items() if value is not None}
    result = suite("subjects").load("contact").detailed(options.problem, options.dofs, **chosen)
    if not options.quiet:
        say(json.dumps(result, indent=1))
    if options.json:
        write_json(options.json, result, indent=1)
    return 0


def _stored(path: str) -> Any:
    try:
        return json.loads(Path(path).read_text(encoding="utf-8"))["results"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise FileError(f"'{path}' is no stored run of the benchmarks ({error}): make one with --json") from error


def draw(path: str, results: dict[str, Any]) -> None:
    """Draw every benchmark of several sizes into a folder; raises FileError if a picture cannot be written."""
    pictures = suite("pictures")
    for name, sizes in results.items():
        if len({entry["n_dofs"] for entry in sizes}) > 1:
            try:
                Path(path).mkdir(parents=True, exist_ok=True)
                pictures.scaling(name, sizes).savefig(Path(path) / f"{name}.png")
            except OSError as error:
                raise FileError(f"cannot write the picture of '{name}' in '{path}': {error}") from error
