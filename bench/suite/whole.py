"""A whole linear solution, L, and a whole contact step: from assembly on, by the same solver, measured alternately.

L is the cost of the same model without contact: assembly, preparation of the linear solver, one solution. A contact step
comprises everything from assembly to recovered stresses. Checks of the model, equal for both, are excluded. Both are CPU
seconds of the process, the minimum of alternating runs, so that other load on the machine affects both alike.
"""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import fastcontact as fc
from fastcontact.analysis.criteria import Criteria
from fastcontact.analysis.load_step import load_step
from fastcontact.analysis.problem import Problem, prepare
from fastcontact.results.step import StepResult


def without_contact(model: fc.Model) -> fc.Model:
    """Return the model without its contact pairs."""
    alone = copy.copy(model)
    alone.contact = []
    return alone


def linear_solution(model: fc.Model, solver: str, **tolerances: float) -> int:
    """Assemble, prepare and solve a model without its contact; return the iterations."""
    problem = started(without_contact(model), solver, **tolerances)
    load = problem.load_at(1.0)
    right = problem.system.right_side(np.zeros_like(load.lift), load.lift)
    problem.solver.load(right).full_solution(np.zeros_like(load.lift))
    return problem.solver.counters.iterations


def started(model: fc.Model, solver: str, steps: int = 1, **tolerances: float) -> Problem:
    """Assemble a model and prepare its linear solver; `tolerances` are "geometry" and "linear"."""
    criteria = Criteria(**{name: value for name, value in tolerances.items() if name == "geometry"})
    options = {"linear_tolerance": tolerances["linear"]} if "linear" in tolerances else {}
    return prepare(model, fc.linear_ramp(steps), criteria, linear_solver=solver, **options)


def cold_step(model: fc.Model, solver: str, **tolerances: float) -> tuple[Problem, Any, StepResult]:
    """Assemble a model, prepare its linear solver and make one load step; return problem, state and result."""
    problem = started(model, solver, **tolerances)
    state, result = load_step(problem, problem.initial_state(), 1, 1.0)
    return problem, state, result


def in_turn(works: dict[str, Callable[[], Any]], repeats: int) -> tuple[dict[str, Any], dict[str, float]]:
    """Return what each work returns, and the least CPU seconds of so many calls, made in turn."""
    found: dict[str, Any] = {}
    seconds = dict.fromkeys(works, math.inf)
    for _ in range(repeats):
        for name, work in works.items():
            found.pop(name, None)  # so that there are not two problems at a time
            begin = time.process_time()
            found[name] = work()
            seconds[name] = min(seconds[name], time.process_time() - begin)
    return found, seconds
