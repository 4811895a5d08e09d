"""Iterate the wear of a load step: it depends on the contact pressures, which depend on the worn geometry.

By Archard's law, the wear depth of a step is the wear coefficient times the integral of the pressure over the slip. Without
friction, the integral is the mean of the pressures at the beginning and at the end of the step (trapezoidal rule) times the
sliding distance; with friction, it is `ContactResult.sliding_load`. The derivative of the depth with respect to the pressure
at the end of the step is therefore half the wear coefficient times the sliding distance. With this derivative, evaluated at
the previous solution, wear is a compliance of the contact constraints, so that a few solutions of the equilibrium suffice.
The depth is part of the geometry at the end of the step.
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
    because the work of friction and the wear then change discontinuously. The next step begins with the depths that
    belong to the last equilibrium.
    """
    problem, start = begin.problem, begin.state
    sides = {name: pair.secondary for name, pair in problem.pairs.items() if pair.options.wear is not None}
    if not sides:
        return newton(begin, before)
    depth_at_start = {name: start.worn.get(name, Worn.nothing(len(side.points))).depth for name, side in sides.items()}
    points, errors = problem.model.mesh.points, list[float]()
    wear = {name: WearCompliance.constant(depth_at_start[name], points[side.points]) for name, side in sides.items()}
    wear |= {} if before is None else before.wear
    equilibrium = before
    while True:
        begin = replace(begin, state=replace(start, wear=wear))
        equilibrium = newton(begin, equilibrium)
        wear = {name: _wear_of_solution(begin, equilibrium, name) for name in sides}
        largest_depth = max(largest(after.depth - depth_at_start[name]) for name, after in wear.items())
        assumed = begin.state.wear
        errors.append(max(linearisation_error(problem.pairs[name], assumed[name], wear[name]) for name in wear))
        if errors[-1] <= max(problem.criteria.relative * largest_depth, start.gap_round_off):
            break
        if len(errors) > WINDOW and min(errors[-WINDOW:]) > DECLINE * min(errors[:-WINDOW]):
            change = errors[-1] / largest_depth
            log.info("wear depths do not converge: they still change by %.1e of the largest in this step", change)
            break
    return replace(equilibrium, wear=wear)


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
