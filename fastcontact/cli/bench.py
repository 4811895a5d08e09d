"""``fastcontact bench``: the benchmark suite of the checkout, ``bench/suite``."""

from __future__ import annotations

import argparse
import importlib
import sys
from pathlib import Path
from typing import Any

from fastcontact.errors import FastcontactError

HELP = "run the benchmarks of the checkout"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this command."""
    parser.add_argument("names", nargs="*", metavar="NAME", help="benchmarks (default: all)")
    parser.add_argument("--smallest", action="store_true", help="run the smallest size of each once, as a check only")
    parser.add_argument("--sizes", type=int, nargs="+", metavar="N", help="approximate numbers of unknowns")
    parser.add_argument("--json", metavar="FILE", help="write results and environment")
    parser.add_argument(
        "--png", metavar="FOLDER", help="draw time and memory against unknowns, a picture for each benchmark"
    )
    parser.add_argument("--compare", metavar="FILE", help="compare with a run stored by --json")
    parser.add_argument("--problem", metavar="NAME", help="a contact problem in detail: sphere-on-block, forma04c ...")
    parser.add_argument("--dofs", type=int, metavar="N", help="with --problem: approximate number of unknowns")
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
    return int(suite("command").run(options))
