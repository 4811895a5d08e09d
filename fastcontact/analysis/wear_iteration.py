"""Iterate the wear of a load step: it depends on the contact pressures, which depend on the worn geometry.

By Archard's law, the wear depth of a step increases with the pressure at its end. This dependence is a compliance of the
contact constraints, with which the equilibrium is solved. Its slope, half the wear coefficient times the sliding distance, is
that of the previous solution, so that a few solutions suffice. The depth thus results from the mean of the pressures at the
beginning and at the end of the step (trapezoidal rule), and it is part of the geometry at the end of the step.
"""

from __future__ import annotations

import logging
from dataclasses import replace

from fastcontact.analysis.contact_result import contact_results, with_work
from fastcontact.analysis.equilibrium import StepEquilibrium
from fastcontact.analysis.inequalities import StepContext
from fastcontact.analysis.newton import newton
from fastcontact.analysis.problem import Problem, StepLoad
from fastcontact.analysis.state import State
from fastcontact.analysis.tolerances import DECLINE, WINDOW
from fastcontact.analysis.wear import Worn, linearisation_error, wear_compliance
from fastcontact.arrays import largest
from fastcontact.contact.wear_compliance import WearCompliance

log = logging.getLogger("fastcontact")


def newton_with_wear(begin: StepContext, load: StepLoad, before: StepEquilibrium | None = None) -> StepEquilibrium:
    """Return the equilibrium of a load step, including the wear of this step; for parameters see `newton`.

    The iteration also ends if the error of the depths no longer decreases. With friction this may happen where nodes open,
    because the work of friction and the wear then change discontinuously. The next step begins with the corrected depths.
    """
    problem, start = begin.problem, begin.state
    sides = {name: pair.secondary for name, pair in problem.pairs.items() if pair.options.wear is not None}
    if not sides:
        return newton(begin, load, before)
    earlier = {name: start.worn.get(name, Worn.nothing(len(side.points))).depth for name, side in sides.items()}
    points, errors = problem.model.mesh.points, list[float]()
    wear = {name: WearCompliance.constant(earlier[name], points[side.points]) for name, side in sides.items()}
    wear |= {} if before is None else before.wear
    while True:
        state = replace(start, wear=wear)
        before = newton(replace(begin, state=state), load, before)
        wear = {name: _wear_of_solution(problem, state, load, before, name) for name in sides}
        depth = max(largest(after.depth - earlier[name]) for name, after in wear.items())
        errors.append(
            max(linearisation_error(problem.pairs[name], state.wear[name], after) for name, after in wear.items())
        )
        if errors[-1] <= max(problem.criteria.relative * depth, start.gap_round_off):
            break
        if len(errors) > WINDOW and min(errors[-WINDOW:]) > DECLINE * min(errors[:-WINDOW]):
            log.info("wear depths do not converge: they still change by %.1e of the largest one", errors[-1] / depth)
            break
    return replace(before, wear=wear)


def _wear_of_solution(
    problem: Problem, start: State, load: StepLoad, equilibrium: StepEquilibrium, name: str
) -> WearCompliance:
    """Return the wear of a contact pair after a load step that ends in `equilibrium`, linearised there."""
    settled, pair, u = equilibrium.settled, problem.pairs[name], equilibrium.u
    assert settled is not None
    assert pair.options.wear is not None
    contact = contact_results(problem, start, load, settled, replace(start, u=u))[name]
    configuration = problem.configuration(name, start, load, problem.displacement(u), u)
    rows = settled.constraints.rows[name]
    arguments = pair, settled.constraints.parts[name], settled.solution, rows, configuration, contact
    contact, forces, _ = with_work(*arguments, start.forces.get(name))
    earlier = start.worn.get(name, Worn.nothing(len(contact.points)))
    worn = earlier.after(pair, configuration, contact, pair.options.wear)
    return wear_compliance(pair, configuration, contact, worn, forces, pair.options.wear)
