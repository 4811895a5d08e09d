"""Validation specs with each formulation: ``python bench/default_specs.py DIR [DIR ...]``.

The runner of tests/verification reads the specs (JSON, with MED meshes). For each run the table gives the number of values
outside the tolerance of the spec, the number of all values, and the largest ratio of deviation to tolerance.
"""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "verification"))

import aster_contact
import aster_spec
import aster_values
import test_code_aster_cases
from aster_mesh import MissingError
from defaults import AGAINST_OBSTACLES, CHOICES

import fastcontact as fc

RUNNER_FORMULATION = aster_contact._formulation
OBSTACLE_CHOICES = {"continuous": "continuous gauss"}


def outcome(path: Path, run: int, choice: str) -> str:
    """Return the outcome of a run with a formulation; for the choice "runner" it is the formulation of the test runner."""

    def formulation(contact: Any, zone: Any, mesh: fc.Mesh, *, against_obstacle: bool) -> dict[str, Any]:
        if choice == "runner":
            return RUNNER_FORMULATION(contact, zone, mesh, against_obstacle=against_obstacle)
        if against_obstacle:
            return {"formulation": "continuous", **AGAINST_OBSTACLES.get(OBSTACLE_CHOICES.get(choice, choice), {})}
        return {"formulation": None, **CHOICES[choice]}

    aster_contact._formulation = formulation
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            problem = aster_spec.problem(path, run)
            steps = aster_spec.solve(problem)
        except MissingError:
            return "-"
        except Exception as error:
            return type(error).__name__
        ratios = []
        for test in problem.spec["tests"]:
            if test["run"] == run and test["value_reference"] is not None:
                try:
                    amended_test = test_code_aster_cases.amended(test, problem)
                    ratios.append(aster_values.verdict(*amended_test, problem, steps).ratio)
                except MissingError:
                    continue
    n_wrong = sum(not ratio <= 1.0 for ratio in ratios)
    return f"{n_wrong} of {len(ratios)}" + (f" ({max(ratios):.1f})" if n_wrong else "")


def main() -> None:
    choices = ["runner", *CHOICES]
    print("| spec | " + " | ".join(choices) + " |\n" + "| --- " * (1 + len(choices)) + "|")
    for folder in sys.argv[1:]:
        for path, run in aster_spec.specs(Path(folder)):
            print(
                f"| {path.stem}-{run} | " + " | ".join(outcome(path, run, choice) for choice in choices) + " |",
                flush=True,
            )


if __name__ == "__main__":
    main()
