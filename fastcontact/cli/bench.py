"""``fastcontact bench``: the benchmark suite in ``bench/suite`` of the source checkout."""

from __future__ import annotations

import importlib
import sys
from argparse import Namespace
from pathlib import Path
from typing import Any

from fastcontact.errors import FastcontactError

HELP = "run the benchmarks of the checkout"
ARGUMENTS = {
    "names": ({"nargs": "*", "metavar": "NAME"}, "benchmarks (default: all)"),
    "--smallest": "run the smallest size of each benchmark once, as a check",
    "--sizes N": ({"type": int, "nargs": "+"}, "approximate numbers of unknowns"),
    "--json FILE": "write results and environment",
    "--png FOLDER": "plot time and memory against the number of unknowns, for each benchmark",
    "--compare FILE": "compare with a run stored by --json",
    "--problem NAME": "solve one contact problem in detail: sphere-on-block, forma04c ...",
    "--dofs N": (int, "with --problem: approximate number of unknowns"),
    "--linear SOLVER": "with --problem: linear solver (default: that of the problem)",
    "--tolerance T": (float, "with --problem: tolerance of solver and geometry (1e-8)"),
}


def suite(name: str) -> Any:
    """Import a module of ``bench/suite``; FastcontactError if there is no source checkout."""
    folder = Path(__file__).resolve().parents[2] / "bench"
    if not (folder / "suite").is_dir():
        raise FastcontactError(
            f"the benchmarks need the source checkout, and there is no '{folder}': install it with pip install -e"
        )
    if str(folder) not in sys.path:
        sys.path.append(str(folder))
    return importlib.import_module(f"suite.{name}")


def run(options: Namespace) -> int:
    """Run the benchmarks, print the table, and write the requested files."""
    return int(suite("command").run(options))
