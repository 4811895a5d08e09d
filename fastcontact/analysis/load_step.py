"""One load step: prepare, settle the contact geometry, balance, recover. Start reading the code here.

The loads of a step are prescribed displacements and balanced. The contact geometry is settled first: the surfaces are paired
on the deformed configuration, the inequalities of contact are solved, and both are repeated until the displacement stands
still. The contact forces are then known; all displacements, the reactions and the stresses follow from them.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from fastcontact._jit import parallel
from fastcontact._jit.norms_kernels import largest
from fastcontact.analysis.balance import Balance, balance
from fastcontact.analysis.geometry_loop import SettledContact, settle_geometry
from fastcontact.analysis.inequalities import Step
from fastcontact.analysis.iterate import gaps_and_forces
from fastcontact.analysis.problem import Problem, StepLoad
from fastcontact.analysis.recover import (
    contact_results,
    counted,
    first_contacts,
    never_opening,
    recover,
    tractions,
    worn_off,
)
from fastcontact.analysis.state import State
from fastcontact.linear.protocol import Loaded
from fastcontact.model.rigid_motions import generalised
from fastcontact.results.step import ContactResult, StepResult

Array = NDArray[np.float64]


@parallel.on_one_blas_thread
def load_step(problem: Problem, state: State, index: int, instant: float) -> tuple[State, StepResult]:
    """Return the state and the result at the end of a load step.

    Parameters
    ----------
    problem : Problem
    state : State
        At the end of the step before; it is not modified.
    index : int
        Number of the step, 1 for the first one.
    instant : float
        Pseudo-time of its end.

    Raises
    ------
    ConvergenceError
        If the step does not converge.
    """
    load = problem.load_at(instant)
    solved_before = problem.solver.counters.iterations
    problem.solver.put_back(state.solver)
    loaded = right_side(problem, load)
    start, expected = prepare_start(problem, state, load, loaded)
    settled, u, balanced = equilibrium(problem, start, load, loaded, expected)
    while balanced.excess > 1.0 and problem.solver.improve(balanced.excess):
        settled, u, balanced = equilibrium(problem, start, load, right_side(problem, load), expected, settled)
    balanced.check(index, problem, settled.iterate.history if settled is not None else ())
    iterations = counted(settled, problem.solver.counters.iterations - solved_before)
    end = replace(
        start, u=u, largest_force=balanced.largest, obstacles=problem.obstacles_at(load, u), angles=load.angles
    )
    end, contact = (end, {}) if settled is None else after_contact(problem, start, load, settled, end)
    if problem.bodies is not None and end.rigid is not None:
        iterations["regularised"] = problem.bodies.report(end.rigid, end.largest_work)
    end = replace(end, solver=problem.solver.snapshot())
    return end, recover(problem, end, contact, balanced.reaction, iterations, (index, instant))


def right_side(problem: Problem, load: StepLoad) -> Loaded:
    """Return the prepared matrix with the right-hand side of the step."""
    return problem.solver.load(problem.system.right(load.force, load.lift))


def prepare_start(problem: Problem, state: State, load: StepLoad, loaded: Loaded) -> tuple[State, float]:
    """Return the state from which the step starts, and the displacement to expect [length].

    The latter matters in the first step if forces alone act: nothing else tells how large displacements will be.
    """
    round_off, largest_work, expected = state.gap_round_off, state.largest_work, 0.0
    zero = np.zeros(len(load.lift))
    if problem.pairs and load.force.any() and not (state.u.any() or load.lift.any()):
        expected = largest(loaded.full_solution(zero))
    if problem.pairs and problem.model.springs:
        # Without contact, bodies on weak springs move far; gaps keep round-off of that size.
        alone = largest(loaded.full_solution(zero))
        round_off = max(round_off, 16 * np.finfo(float).eps * alone)
    if problem.bodies is not None:
        work = generalised(problem.bodies.motions, load.force)
        largest_work = max(largest_work, float(np.abs(work).max()))
    start = replace(
        state, gap_round_off=round_off, largest_work=largest_work, rigid=None, unsettled=None,
        largest_force=max(state.largest_force, largest(load.force)),
        extrapolation=state.extrapolation.to(load.lift, load.force),
    )  # fmt: skip
    return start, expected


def equilibrium(
    problem: Problem, start: State, load: StepLoad, loaded: Loaded, expected: float, before: SettledContact | None = None
) -> tuple[SettledContact | None, Array, Balance]:  # fmt: skip
    """Return the settled contact, all displacements (n_dofs,) [length] and the balance of forces.

    It begins where the contact `before` ended, which less accurate solutions have settled.
    """
    settled = None
    if problem.pairs:
        dofs = problem.dofs.for_step(start.u, load.lift)
        step = Step(problem, start, load, dofs.loaded(loaded), dofs)
        settled = settle_geometry(step, start.extrapolation, expected, before.iterate if before else None)
    u, contact_force = solve_displacements(problem, start, load, loaded, settled)
    balanced = balance(problem, u, contact_force, load.force, start.largest_force)
    if settled is not None:
        settled.iterate.history[-1]["residual"] = balanced.relative
    return settled, u, balanced


def solve_displacements(
    problem: Problem, start: State, load: StepLoad, loaded: Loaded, settled: SettledContact | None
) -> tuple[Array, Array]:
    """Return all displacements [length] and the contact forces [force], both (n_dofs,)."""
    system, lift = problem.system, load.lift
    if settled is None:
        none = csr_array((0, len(lift))), np.empty(0)
        v = loaded.solve(*none, guess=system.unknowns(start.u, lift))[0]
        return system.displacement(v, lift), np.zeros(len(lift))
    contact_force, rigid = settled.force, settled.iterate.rigid
    if problem.bodies is not None and rigid is not None:
        lift = lift + problem.bodies.rigid(rigid.position)
    v = loaded.full_solution(system.reduced(contact_force), settled.solution.u)
    return system.displacement(v, lift), contact_force


def after_contact(
    problem: Problem, start: State, load: StepLoad, settled: SettledContact, end: State
) -> tuple[State, dict[str, ContactResult]]:
    """Return the end of the step with the contact data that later steps need, and the results of all contact pairs."""
    end = replace(
        end, active=settled.iterate.active, pressure=settled.iterate.pressure, rigid=settled.iterate.rigid,
        unsettled=settled.unsettled, first_contact=first_contacts(problem, start, load, end.u),
        extrapolation=start.extrapolation.converged(end.u, gaps_and_forces(settled.constraints, settled.solution)),
        never_opening=never_opening(problem, start, settled), traction=tractions(problem, settled),
    )  # fmt: skip
    worn, results = worn_off(problem, start, load, end, contact_results(problem, start, load, settled, end))
    touched = end.touched | {name for name, found in results.items() if found.active.any()}
    met = {name: place for name, place in end.first_contact.items() if name in touched}
    return replace(end, touched=touched, first_contact=met, worn=worn), results
