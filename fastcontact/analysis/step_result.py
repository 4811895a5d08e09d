"""Compute the result of a load step: nodal stresses, and all data for the user."""

from __future__ import annotations

from typing import Any

from fastcontact.analysis.problem import Problem
from fastcontact.analysis.state import State
from fastcontact.arrays import Array
from fastcontact.elasticity import recovery
from fastcontact.elasticity.nonlinear_bodies import DeformedBodies
from fastcontact.model.pretension import section_results
from fastcontact.model.ramp import multiplier
from fastcontact.results.material_stress import by_largest_von_mises
from fastcontact.results.step import ContactResult, StepResult
from fastcontact.results.units import units_of_results


def recover(
    problem: Problem, end: State, contact: dict[str, ContactResult], reaction: Array, iterations: dict[str, Any],
    instant: tuple[int, float], bodies: DeformedBodies | None = None,
) -> StepResult:  # fmt: skip
    """Return the result of a load step.

    Parameters
    ----------
    problem : Problem
    end : State
        State at the end of the step.
    contact : dict of str to ContactResult
        Results of each contact pair.
    reaction : ndarray (n_dofs of the mesh,)
        Reactions [force].
    iterations : dict
        Numbers of iterations, see `StepResult`.
    instant : (int, float)
        Number of the step, and pseudo-time at its end.
    bodies : DeformedBodies, optional
        The nonlinear bodies at the end of the step; None if bodies are linear.
    """
    mesh, u = problem.model.mesh, problem.displacement(end.u)
    temperature, initial = (
        problem.factors(load, instant[1]) for load in (problem.model.temperatures, problem.model.initial_states)
    )
    pressures = [multiplier(table, problem.ramp, instant[1]) for _, table in problem.following]
    factors = {"temperature_factors": temperature, "initial_factors": initial, "pressure_factors": pressures}
    iterations = {**iterations, **{key: multipliers for key, multipliers in factors.items() if multipliers}}
    heat = None if end.rise is None else problem.model.reference_temperature + end.rise
    sections = problem.model.pretensions
    if sections:
        pulls = [multiplier(load.ramp, problem.ramp, instant[1]) for load in sections]
        pretension = section_results(sections, u, reaction.reshape(-1, mesh.dim), pulls)
        iterations = {**iterations, "pretension": pretension}
    if bodies is None:
        at_places = recovery.nodal_stress(
            mesh, problem.model.kinematics, problem.field.moduli, problem.field.loops, u, problem.field.treatment,
            problem.sides, problem.model.stress_offset(temperature, initial, problem.field, heat),
        )  # fmt: skip
    else:
        at_places = recovery.nodal_average(mesh, bodies.stress, problem.sides)
    stress, by_material = by_largest_von_mises(problem.sides, problem.material_of_cells, at_places, mesh.n_points)
    von_mises, named = recovery.von_mises(stress), problem.model.units
    return StepResult(
        *instant, u.copy(), stress, von_mises, recovery.von_mises_signed(stress, von_mises), reaction.reshape(-1, mesh.dim),
        contact, iterations, material_stress=by_material,
        cell_fields={} if bodies is None or problem.bodies is None else problem.bodies.cell_fields(bodies, u),
        temperature=heat, units=named and units_of_results(named, problem.model.kinematics),
    )  # fmt: skip
