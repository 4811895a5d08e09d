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
from fastcontact.analysis.tolerances import DECLINE, WINDOW
from fastcontact.analysis.wear import Worn, linearisation_error, wear_compliance
from fastcontact.arrays import largest
from fastcontact.contact.wear_compliance import WearCompliance

log = logging.getLogger("fastcontact")


def newton_with_wear(begin: StepContext, before: StepEquilibrium | None = None) -> StepEquilibrium:
    """Return the equilibrium of a load step, including the wear of this step; for parameters see `newton`.

    The iteration also ends if the error of the depths no longer decreases. With friction this may happen where nodes open,
    because the work of friction and the wear then change discontinuously. The next step begins with the corrected depths.
    """
    problem, start = begin.problem, begin.state
    sides = {name: pair.secondary for name, pair in problem.pairs.items() if pair.options.wear is not None}
    if not sides:
        return newton(begin, before)
    earlier = {name: start.worn.get(name, Worn.nothing(len(side.points))).depth for name, side in sides.items()}
    points, errors = problem.model.mesh.points, list[float]()
    wear = {name: WearCompliance.constant(earlier[name], points[side.points]) for name, side in sides.items()}
    wear |= {} if before is None else before.wear
    while True:
        begin = replace(begin, state=replace(start, wear=wear))
        before = newton(begin, before)
        wear = {name: _wear_of_solution(begin, before, name) for name in sides}
        depth = max(largest(after.depth - earlier[name]) for name, after in wear.items())
        errors.append(
            max(linearisation_error(problem.pairs[name], begin.state.wear[name], after) for name, after in wear.items())
        )
        if errors[-1] <= max(problem.criteria.relative * depth, start.gap_round_off):
            break
        if len(errors) > WINDOW and min(errors[-WINDOW:]) > DECLINE * min(errors[:-WINDOW]):
            log.info("wear depths do not converge: they still change by %.1e of the largest one", errors[-1] / depth)
            break
    return replace(before, wear=wear)


def _wear_of_solution(step: StepContext, equilibrium: StepEquilibrium, name: str) -> WearCompliance:
    """Return the wear of a contact pair after a load step that ends in `equilibrium`, linearised there."""
    settled, pair, start, u = equilibrium.settled, step.problem.pairs[name], step.state, equilibrium.u
    assert settled is not None
    assert pair.options.wear is not None
    contact = contact_results(step, settled, u, start.first_contact)[name]
    configuration = step.problem.configuration(name, start, step.load, u)
    contact, forces, _ = with_work(pair, *settled.parts[name], configuration, contact, start.forces.get(name))
    earlier = start.worn.get(name, Worn.nothing(len(contact.points)))
    worn = earlier.after(pair, configuration, contact, pair.options.wear)
    return wear_compliance(pair, configuration, contact, worn, forces, pair.options.wear)
