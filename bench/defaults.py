"""The default formulation compared with all others: ``python bench/defaults.py [plane|space|obstacle ...] [--match TEXT]``.

Each formulation solves every problem of `default_models` on the same mesh. The table gives the errors of force and pressure
(of its maximum; for a uniform pressure the largest error of any closed node) in percent and, in brackets, the geometry
updates. ``error`` marks an exception, whose text follows. A final table counts failures by kind of problem.
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


def solved(model: fc.Model) -> tuple[fc.ContactResult, int, float]:
    """Return the contact, the number of geometry updates and CPU seconds of a model."""
    start = time.process_time()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        step = fc.solve(model, fc.linear_ramp(1))[-1]
    return step.contact["c"], int(step.iterations["geometry_updates"]), time.process_time() - start


def truth_of(problem: Problem, known: dict[str, tuple[float, float]]) -> tuple[float, float]:
    """Return force and pressure; those of a refined mesh are kept in `known`."""
    force, pressure = problem.force, problem.pressure
    if problem.reference is not None:
        key = f"{problem.name.split(',')[0]} {problem.reference.args[1:]}"
        if key not in known:
            found, _, _ = solved(problem.reference())
            known[key] = float(np.linalg.norm(found.force)), found.pressure_max
        force = known[key][0] if force is None else force
        pressure = known[key][1] if pressure is None else pressure
    return np.nan if force is None else force, np.nan if pressure is None else pressure


def row(problem: Problem, options: dict[str, Any], truth: tuple[float, float]) -> dict[str, Any]:
    """Return the figures of one choice."""
    try:
        model = problem.build(options, 0)
        contact, updates, cpu = solved(model)
    except fc.FastcontactError as error:
        return {"error": f"{type(error).__name__}: {error}"}
    except Exception as error:  # what must never come is counted, too
        return {"error": f"RAW {type(error).__name__}: {error}"}
    force = float(np.linalg.norm(contact.force))
    if problem.uniform:
        closed = contact.pressure[contact.active]
        apart = np.abs(closed / truth[1] - 1.0).max(initial=0.0) if len(closed) else np.nan
    else:
        apart = contact.pressure_max / truth[1] - 1.0
    return {"force": force / truth[0] - 1.0, "pressure": float(apart), "updates": updates, "cpu": cpu,
            "formulation": model.contact[0].formulation, "dofs": model.n_dofs}  # fmt: skip


def problems(kinds: list[str]) -> Iterator[Problem]:
    for kind in kinds:
        yield from getattr(default_models, f"{kind}_problems")()


def text_of(found: dict[str, Any]) -> str:
    if "error" in found:
        return "error"
    return f"{100 * found['force']:+.2f} / {100 * found['pressure']:+.1f} ({found['updates']})"


# An entry is wrong where it is off by more than twice the error of the best choice on the same mesh and this besides.
FORCE, PRESSURE = 0.01, 0.05


def wrong(found: dict[str, Any], best: tuple[float, float]) -> bool:
    """Return whether a choice fails, or is off by more than its mesh explains."""
    if "error" in found:
        return True
    return abs(found["force"]) > 2 * best[0] + FORCE or abs(found["pressure"]) > 2 * best[1] + PRESSURE


def summary(table: dict[str, Any]) -> str:
    """Return a table in Markdown: by kind of problem and choice, wrong entries, the worst force and the worst pressure."""
    kinds: dict[str, list[dict[str, Any]]] = {}
    for name, entry in table.items():
        kinds.setdefault(name.split(",")[0], []).append(entry["choices"])
    choices = list(next(iter(table.values()))["choices"])
    lines = ["| problem | models | " + " | ".join(choices) + " |", "| --- " * (2 + len(choices)) + "|"]
    for kind, rows in kinds.items():
        cells = []
        for choice in choices:
            bad = sum(wrong(row[choice], best_of(row)) for row in rows)
            right = [row[choice] for row in rows if "error" not in row[choice]]
            worst = [np.nanmax([abs(one[what]) for one in right] + [0.0]) for what in ("force", "pressure")]
            cells.append(f"{bad}: {100 * worst[0]:.1f}, {100 * worst[1]:.0f}")
        lines.append(f"| {kind} | {len(rows)} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def best_of(row: dict[str, Any]) -> tuple[float, float]:
    """Return the smallest errors of force and pressure of all choices; a second one must be near, lest chance decides."""
    found = []
    for what in ("force", "pressure"):
        errors = sorted(abs(one[what]) for one in row.values() if "error" not in one)
        found.append(errors[min(2, len(errors) - 1)] if errors else 0.0)
    return found[0], found[1]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kinds", nargs="*", default=["plane", "space", "obstacle"])
    parser.add_argument("--match", default="")
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    known: dict[str, tuple[float, float]] = {}
    table: dict[str, Any] = {}
    for problem in problems(given.kinds):
        if given.match not in problem.name:
            continue
        truth = truth_of(problem, known)
        choices = AGAINST_OBSTACLES if problem.obstacle else CHOICES
        found = {name: row(problem, options, truth) for name, options in choices.items()}
        table[problem.name] = {"truth": truth, "choices": found}
        print(f"{problem.name}: " + "; ".join(f"{name} {text_of(one)}" for name, one in found.items()), flush=True)
        for name, one in found.items():
            if "error" in one:
                print(f"    {name}: {one['error'][:150]}", flush=True)
        if given.json:
            given.json.write_text(json.dumps(table, indent=1))
    for obstacle in (False, True):
        part = {name: entry for name, entry in table.items() if ("nts" in entry["choices"]) == obstacle}
        if part:
            print(summary(part))


if __name__ == "__main__":
    main()
