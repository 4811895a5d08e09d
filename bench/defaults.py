"""Comparison of the default formulation with others: ``python bench/defaults.py [plane|space|obstacle ...] [--match TEXT]``.

Each problem of `default_models` is solved with each formulation on the same mesh. The table contains the errors of the force
and of the largest pressure in percent, followed by the number of geometry updates in parentheses. For problems with a uniform
pressure, the error is the largest one of all closed nodes. ``error`` marks an exception, whose text follows. A final table
counts the failures of each kind of problem.
"""

from __future__ import annotations

import argparse
import json
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import default_models
import numpy as np
from default_models import Problem

import fastcontact as fc

CHOICES: dict[str, dict[str, Any]] = {
    "default": {},
    "nts facet": {"formulation": "node_to_segment", "normals": "facet"},
    "nts averaged": {"formulation": "node_to_segment", "normals": "averaged"},
    "continuous": {"formulation": "continuous"},
    "mortar standard": {"formulation": "mortar", "multipliers": "standard"},
    "mortar dual": {"formulation": "mortar", "multipliers": "dual"},
}
AGAINST_OBSTACLES: dict[str, dict[str, Any]] = {
    "default": {},
    "nts": {"formulation": "node_to_segment"},
    "continuous gauss": {"formulation": "continuous", "integration": "gauss"},
    "continuous node": {"formulation": "continuous", "integration": "node"},
    "continuous simpson": {"formulation": "continuous", "integration": "simpson"},
}


def solve(model: fc.Model) -> tuple[fc.ContactResult, int, float]:
    """Solve a model; return the result of its contact pair, the number of geometry updates, and the CPU time [s]."""
    start = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        step = fc.solve(model, fc.linear_ramp(1))[-1]
    return step.contact["c"], int(step.iterations["geometry_updates"]), time.process_time() - start


def reference_values(problem: Problem, known: dict[str, tuple[float, float]]) -> tuple[float, float]:
    """Return the reference values of force and pressure. Values from refined meshes are cached in `known`."""
    force, pressure = problem.force, problem.pressure
    if problem.reference is not None:
        key = f"{problem.name.split(',')[0]} {problem.reference.args[1:]}"
        if key not in known:
            contact, _, _ = solve(problem.reference())
            known[key] = float(np.linalg.norm(contact.force)), contact.pressure_max
        force = known[key][0] if force is None else force
        pressure = known[key][1] if pressure is None else pressure
    return np.nan if force is None else force, np.nan if pressure is None else pressure


def row(problem: Problem, options: dict[str, Any], truth: tuple[float, float]) -> dict[str, Any]:
    """Return the relative errors, the number of geometry updates and further data of a problem with one formulation."""
    try:
        model = problem.build(options, 0)
        contact, updates, cpu = solve(model)
    except fc.FastcontactError as error:
        return {"error": f"{type(error).__name__}: {error}"}
    except Exception as error:  # an unexpected error is a failure of the formulation as well
        return {"error": f"RAW {type(error).__name__}: {error}"}
    force = float(np.linalg.norm(contact.force))
    if problem.uniform:
        closed = contact.pressure[contact.active]
        pressure_error = np.abs(closed / truth[1] - 1.0).max(initial=0.0) if len(closed) else np.nan
    else:
        pressure_error = contact.pressure_max / truth[1] - 1.0
    return {"force": force / truth[0] - 1.0, "pressure": float(pressure_error), "updates": updates, "cpu": cpu,
            "formulation": model.contact[0].formulation, "dofs": model.n_dofs}  # fmt: skip


def problems(kinds: list[str]) -> Iterator[Problem]:
    for kind in kinds:
        yield from getattr(default_models, f"{kind}_problems")()


def entry_text(entry: dict[str, Any]) -> str:
    if "error" in entry:
        return "error"
    return f"{100 * entry['force']:+.2f} / {100 * entry['pressure']:+.1f} ({entry['updates']})"


# An entry is wrong if its error exceeds twice the error of the best choice on the same mesh by more than this amount.
FORCE, PRESSURE = 0.01, 0.05


def is_wrong(entry: dict[str, Any], best: tuple[float, float]) -> bool:
    """Return whether a choice fails, or whether its error is larger than the mesh explains."""
    if "error" in entry:
        return True
    return abs(entry["force"]) > 2 * best[0] + FORCE or abs(entry["pressure"]) > 2 * best[1] + PRESSURE


def summary(table: dict[str, Any]) -> str:
    """Return a table in Markdown with the number of wrong entries and the largest errors, by kind of problem and choice."""
    kinds: dict[str, list[dict[str, Any]]] = {}
    for name, entry in table.items():
        kinds.setdefault(name.split(",")[0], []).append(entry["choices"])
    choices = list(next(iter(table.values()))["choices"])
    lines = ["| problem | models | " + " | ".join(choices) + " |", "| --- " * (2 + len(choices)) + "|"]
    for kind, rows in kinds.items():
        cells = []
        for choice in choices:
            n_wrong = sum(is_wrong(row[choice], best_of(row)) for row in rows)
            entries = [row[choice] for row in rows if "error" not in row[choice]]
            worst = [np.nanmax([abs(entry[key]) for entry in entries] + [0.0]) for key in ("force", "pressure")]
            cells.append(f"{n_wrong}: {100 * worst[0]:.1f}, {100 * worst[1]:.0f}")
        lines.append(f"| {kind} | {len(rows)} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def best_of(row: dict[str, Any]) -> tuple[float, float]:
    """Return the third smallest errors of force and pressure of all choices; a smaller error may be due to chance."""
    best = []
    for key in ("force", "pressure"):
        errors = sorted(abs(entry[key]) for entry in row.values() if "error" not in entry)
        best.append(errors[min(2, len(errors) - 1)] if errors else 0.0)
    return best[0], best[1]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kinds", nargs="*", default=["plane", "space", "obstacle"])
    parser.add_argument("--match", default="")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    known: dict[str, tuple[float, float]] = {}
    table: dict[str, Any] = {}
    for problem in problems(options.kinds):
        if options.match not in problem.name:
            continue
        truth = reference_values(problem, known)
        choices = AGAINST_OBSTACLES if problem.obstacle else CHOICES
        entries = {name: row(problem, choice, truth) for name, choice in choices.items()}
        table[problem.name] = {"truth": truth, "choices": entries}
        print(
            f"{problem.name}: " + "; ".join(f"{name} {entry_text(entry)}" for name, entry in entries.items()),
            flush=True,
        )
        for name, entry in entries.items():
            if "error" in entry:
                print(f"    {name}: {entry['error'][:150]}", flush=True)
        if options.json:
            options.json.write_text(json.dumps(table, indent=1))
    for obstacle in (False, True):
        part = {name: entry for name, entry in table.items() if ("nts" in entry["choices"]) == obstacle}
        if part:
            print(summary(part))


if __name__ == "__main__":
    main()
