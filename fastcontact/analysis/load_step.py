"""Solve one load step: evaluate loads, iterate to equilibrium with contact, and compute results.

First the loads and the prescribed displacements at the end of the step are evaluated. Newton's method (`newton`) then solves
the equilibrium, repeatedly where surfaces wear (`wear_iteration`). Each of its iterations pairs the contact surfaces on the
deformed configuration, solves the inequalities of contact, and repeats both until the displacements converge
(`geometry_loop`). The remaining displacements, the force balance and the stresses follow from the contact forces. This module
is the place to start reading the code.
"""

from __future__ import annotations

from dataclasses import replace
from operator import attrgetter
from typing import Any

import numpy as np

from fastcontact._jit import parallel
from fastcontact._tools.argument_types import unchecked
from fastcontact.analysis import thermal_coupling
from fastcontact.analysis.contact_result import contact_results, mean_slip_before_closing, with_work
from fastcontact.analysis.equilibrium import StepEquilibrium
from fastcontact.analysis.geometry_loop import SettledContact
from fastcontact.analysis.inequalities import StepContext
from fastcontact.analysis.problem import Problem, StepLoad
from fastcontact.analysis.resultants import reference_reactions
from fastcontact.analysis.state import State
from fastcontact.analysis.wear import Worn, wear_work
from fastcontact.analysis.wear_iteration import newton_with_wear
from fastcontact.arrays import Array, largest
from fastcontact.contact.cohesive_layer import CohesiveLayer
from fastcontact.elasticity import recovery
from fastcontact.elasticity.inertia_loads import Centrifugal
from fastcontact.elasticity.loads import Pressure
from fastcontact.elasticity.nonlinear_bodies import DeformedBodies
from fastcontact.model.pretension import section_results
from fastcontact.model.rigid_motions import generalised_forces
from fastcontact.results.step import ContactResult, StepResult, nodal_stress_of_materials
from fastcontact.results.units import units_of_results
from fastcontact.round_off import SINGLE_PRECISION

nodal_stress = unchecked(recovery.nodal_stress)
von_mises, von_mises_signed = unchecked(recovery.von_mises), unchecked(recovery.von_mises_signed)


@parallel.on_one_blas_thread
def load_step(problem: Problem, state: State, index: int, instant: float) -> tuple[State, StepResult]:
    """Return the state and the result at the end of a load step.

    Parameters
    ----------
    problem : Problem
    state : State
        State at the end of the previous step; it is not modified.
    index : int
        Number of the step; the first step has the number 1.
    instant : float
        Pseudo-time at the end of the step, at which the load multipliers are evaluated [-].

    Raises
    ------
    ConvergenceError
        If the step does not converge.
    """
    load = load_without_conduction = problem.load_at(instant)
    if problem.heat is not None:
        rise = thermal_coupling.first_rise(problem, problem.heat, state, instant)
        load = thermal_coupling.thermal_load(problem, load, rise)
    problem.solver.put_back(state.solver)
    solved_before = problem.solver.counters.iterations
    step = prepare_start(problem, state, index, load)
    solution = newton_with_wear(step)
    if problem.heat is not None:
        arguments = step, load_without_conduction, rise, solution, newton_with_wear
        solution = thermal_coupling.settle_heat(problem.heat, *arguments)
    iterations = solution.counts(problem.solver.counters.iterations - solved_before)
    step = replace(step, state=replace(step.state, wear=solution.wear))
    return _end_of_step(step, solution, iterations)


def _end_of_step(step: StepContext, solution: StepEquilibrium, iterations: dict[str, Any]) -> tuple[State, StepResult]:
    """Return the state and the result at the end of a load step.

    Parameters
    ----------
    step : StepContext
        Data at the beginning of the step.
    solution : StepEquilibrium
        The converged equilibrium.
    iterations : dict
        Numbers of iterations and further data for `StepResult.iterations`; it is modified.
    """
    problem, start, load = step.problem, step.state, step.load
    settled, u, balance, temperatures = solution.settled, solution.u, solution.balance, solution.temperatures
    end = replace(
        start, u=u, largest_force=balance.largest, obstacles=problem.obstacles_at(load, u), angles=load.angles,
        instant=load.instant, rise=None if temperatures is None else temperatures.rise,
    )  # fmt: skip
    bodies = None
    if problem.bodies is not None and solution.terms is not None:
        bodies = solution.terms.bodies_at(u)
        end = replace(end, history=bodies.history)
        # The error of a step is estimated as the change if the step were halved, which requires the path of the
        # displacements. In the first step, which begins without a history, the path is unknown.
        if problem.bodies.halving_estimates_error and load.rise is None and start.history:
            displacements = problem.displacement(start.extrapolation.midway(start.u, u)), problem.displacement(u)
            size, change = problem.bodies.change_if_halved(*displacements, start.history, bodies)
            end = replace(end, flow=(start.flow[0] + size, start.flow[1] + change))
    contact: dict[str, ContactResult] = {}
    if settled is not None:
        end, contact = _contact_at_end(step, settled, end, balance.energy)
    elif start.work is not None:
        end = replace(end, work=start.work.after(balance.energy, 0.0, (0.0, 0.0, 0.0)))
    if problem.extrapolates:
        contact_data = {}
        if settled is not None:
            contact_data = {name: (part.gap, part.multiplier) for name, (_, part) in settled.parts.items()}
        extrapolation = start.extrapolation.after(u, contact_data, problem.bodies is not None)
        end = replace(end, extrapolation=extrapolation)
    if end.work is not None:
        iterations["work"] = end.work.as_dict()
    if problem.floating_bodies is not None and settled is not None and (rigid := settled.iterate.rigid) is not None:
        # The scale may be round-off relative to the contact forces, which then replace it. Without loads it is zero, and the
        # contact forces are round-off.
        scale = end.largest_rigid_force
        report = problem.floating_bodies.report(rigid, scale and max(scale, end.largest_force))
        forces = settled.constraints, settled.solution.multiplier
        free = problem.floating_bodies.undetermined(*forces, u, scale, balance.residual)
        moving = (np.abs(free.displacement) > SINGLE_PRECISION).any(axis=1)
        moved = {"undetermined": free.by_body(), "moved": largest((u - start.u)[moving])}
        iterations["regularised"] = report | moved
    end = replace(end, solver=problem.solver.snapshot())
    result = recover(problem, end, step.index, contact, balance.reaction, iterations, bodies)
    if problem.heat is not None and temperatures is not None:
        result = thermal_coupling.with_heat_results(problem.heat, temperatures, result)
    return end, result


def prepare_start(problem: Problem, state: State, index: int, load: StepLoad) -> StepContext:
    """Return the data at the beginning of a load step.

    They include the `state` at the end of the previous step, with the bounds of round-off and of forces for the new `load`.
    If only forces act in the first step, no prescribed displacement provides a scale. The largest displacement of the
    solution without contact is then used, see `StepContext.expected`.
    """
    load_as_force = load if load.rise is None else thermal_coupling.expansion_as_force(problem, load)
    loaded = problem.loaded(load_as_force)
    round_off, rigid_force, expected = state.gap_round_off, state.largest_rigid_force, 0.0
    zero = np.zeros(len(load.lift))
    if problem.pairs and load_as_force.force.any() and not (state.u.any() or load.lift.any()):
        expected = largest(loaded.full_solution(zero))
    if problem.pairs and problem.model.springs:
        # Springs of the model may be weak: without contact, bodies on them have large displacements, and gaps are
        # differences of such displacements, each with an error of a few units in the last place.
        largest_displacement = largest(loaded.full_solution(zero))
        round_off = max(round_off, 16 * np.finfo(float).eps * largest_displacement)
    if problem.floating_bodies is not None:
        forces = generalised_forces(problem.floating_bodies.motions, load_as_force.force)
        rigid_force = max(rigid_force, float(np.abs(forces).max()))
    start = replace(
        state, gap_round_off=round_off, largest_rigid_force=rigid_force, last_change=None,
        largest_force=max(state.largest_force, largest(load_as_force.force)),
    )  # fmt: skip
    if problem.extrapolates:
        # For nonlinear bodies, both the loads and the motions of rigid obstacles determine the extrapolation. The first
        # state of the extrapolation is the state at rest, without loads.
        quantities = [load.lift, load_as_force.force, *(() if problem.bodies is None else load.obstacles.values())]
        extrapolation = state.extrapolation
        if not (extrapolation.loads or state.u.any()):
            extrapolation = extrapolation.to_loads(*map(np.zeros_like, quantities)).after(state.u, {})
        start = replace(start, extrapolation=extrapolation.to_loads(*quantities))
    return StepContext(problem, start, load, loaded, expected, index)


def _contact_at_end(
    step: StepContext, settled: SettledContact, end: State, energy: tuple[float, float]
) -> tuple[State, dict[str, ContactResult]]:
    """Return the state `end` with the contact data that later steps need, and the results of each contact pair.

    In 3D, the point of first contact is constant after the bodies have touched. Before that it is the node with the smallest
    gap for the current obstacle positions and clearances.

    Parameters
    ----------
    step : StepContext
        Data at the beginning of the step.
    settled : SettledContact
        Contact solution of the step.
    end : State
        State at the end of the step, with its displacements.
    energy : (float, float)
        Elastic strain energy and plastic work [energy].
    """
    problem, start = step.problem, step.state
    configurations, first_contact = {}, dict(start.first_contact)
    for name in settled.parts:
        configurations[name] = problem.configuration(name, start, step.load, end.u)
        if problem.model.mesh.dim == 3 and name not in first_contact:
            first_contact[name] = problem.pairs[name].first_contact(configurations[name])
    results = contact_results(step, settled, end.u, first_contact)
    touched, never_opening, worn = set(start.touched), dict(start.never_opening), dict(start.worn)
    slipped, forces, elastic_slip, bonds = dict(start.slipped), dict(start.forces), {}, {}
    work_increments, work_on_wear = np.zeros(3), 0.0
    for name, configuration in configurations.items():
        pair, (constraints, solution) = problem.pairs[name], settled.parts[name]
        if pair.options.kind == "bilateral_once_closed":
            # Points that have slid beyond the other side are included, since they may return to it.
            never_opening[name] = constraints.positions, solution.active | constraints.equality
        compliant = constraints.compliance is not None or constraints.softness[1:].any()
        if compliant and constraints.tangents:
            slips = constraints.elastic_slips(solution.multiplier, solution.tangential)
            elastic_slip[name] = constraints.positions, slips
        contact, slip = results[name], np.zeros_like(results[name].coordinates)
        if contact.active.any():
            touched.add(name)
        elif name not in touched:
            first_contact.pop(name, None)
        if contact.active.any() and pair.options.kind != "tied":
            rigid_stick = contact.sticking & bool(pair.friction) & (pair.options.tangential_penalty is None)
            slip = pair.nodal_slip(configuration)
            if solution.slip_before_closing is not None and constraints.tangents:
                slip -= mean_slip_before_closing(constraints, solution, contact)
            slip = np.where((contact.active & ~rigid_stick)[:, None], slip, 0.0)
        slipped[name] = slip + start.slipped.get(name, 0.0)
        contact = replace(contact, slip=slip, slip_total=slipped[name])
        if isinstance(constraints.tied, CohesiveLayer):
            bonds[name] = constraints.tied.bond_after(constraints, end.u)
            contact = replace(contact, damage=bonds[name].at(contact.coordinates)[1])
        elif pair.options.kind not in ("tied", "gap_only"):
            arguments = pair, constraints, solution, configuration, contact
            contact, forces[name], work_of_pair = with_work(*arguments, start.forces.get(name))
            work_increments += work_of_pair
        if pair.options.wear is not None:
            earlier = start.worn.get(name, Worn.nothing(len(contact.points)))
            worn[name] = earlier.after(pair, configuration, contact, pair.options.wear)
            contact = replace(contact, wear=worn[name].depth)
            work_on_wear += wear_work(worn[name].depth, earlier.depth, forces[name], start.forces.get(name))
        results[name] = contact
    stored = sum(map(attrgetter("stored"), (*forces.values(), *bonds.values())))
    released = sum(map(attrgetter("released"), bonds.values()))
    end = replace(
        end, active=settled.iterate.active, pressure=settled.iterate.pressure,
        last_change=settled.last_change, never_opening=never_opening, elastic_slip=elastic_slip, bonds=bonds, worn=worn,
        wear={}, slipped=slipped, forces=forces, touched=frozenset(touched), first_contact=first_contact,
        work=start.work and start.work.after(energy, stored, work_increments.tolist(), released, work_on_wear),
    )  # fmt: skip
    return end, results


def recover(
    problem: Problem, end: State, index: int, contact: dict[str, ContactResult], reaction: Array,
    iterations: dict[str, Any], bodies: DeformedBodies | None = None,
) -> StepResult:  # fmt: skip
    """Return the result of a load step.

    Parameters
    ----------
    problem : Problem
    end : State
        State at the end of the step.
    index : int
        Number of the step.
    contact : dict of str to ContactResult
        Results of each contact pair.
    reaction : ndarray (n_dofs of the mesh,)
        Reactions [force].
    iterations : dict
        Numbers of iterations and further data, see `StepResult.iterations`.
    bodies : DeformedBodies, optional
        The nonlinear bodies at the end of the step; None if bodies are linear.
    """
    mesh, u = problem.model.mesh, problem.displacement(end.u)
    sections, reaction = problem.model.pretensions, reaction.reshape(-1, mesh.dim)
    iterations = dict(iterations)
    loads_by_kind: dict[str, Any] = {"temperature": problem.model.temperatures, "initial": problem.model.initial_states}
    for name, kind in (("pressure", Pressure), ("spin", Centrifugal)):
        loads_by_kind[name] = [load for load in problem.model.loads if isinstance(load, kind)]
    factors = {name: problem.factors(parts, end.instant) for name, parts in loads_by_kind.items()}
    iterations |= {f"{name}_factors": values for name, values in factors.items() if values}
    temperature = None if end.rise is None else problem.model.reference_temperature + end.rise
    if points := problem.reference_points:
        iterations["reference_reactions"] = reference_reactions(problem.model, points, reaction, u)
    if sections:
        iterations["pretension"] = section_results(sections, u, reaction, problem.factors(sections, end.instant))
    if bodies is not None:
        stress = recovery.nodal_average(mesh, bodies.stress, problem.sides)
    else:
        offset, field = None, problem.field
        if factors["temperature"] or factors["initial"] or temperature is not None:
            offset = problem.model.stress_offset(factors["temperature"], factors["initial"], field, temperature)
        arguments = field.moduli, field.moduli_rows, u, field.treatment
        stress = nodal_stress(mesh, problem.model.kinematics, *arguments, problem.sides, offset)
    by_material = None
    if len(problem.sides.points):
        materials_of_cells = np.concatenate(list(problem.field.distinct_materials.values()))
        stress, by_material = nodal_stress_of_materials(problem.sides, materials_of_cells, stress, mesh.n_points)
    equivalent, units = von_mises(stress), problem.model.units
    return StepResult(
        index, end.instant, u.copy(), stress, equivalent, von_mises_signed(stress, equivalent), reaction, contact,
        iterations, material_stress=by_material,
        cell_fields={} if bodies is None or problem.bodies is None else problem.bodies.cell_fields(bodies, u),
        temperature=temperature, units=units and units_of_results(units, problem.model.kinematics),
    )  # fmt: skip
