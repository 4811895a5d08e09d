"""Recover the result of a load step from its displacements: stresses, contact results, work of the solvers."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastcontact.analysis.contact_result import contact_result
from fastcontact.analysis.geometry_loop import SettledContact
from fastcontact.analysis.problem import Problem, StepLoad
from fastcontact.analysis.solution import FrictionalEquilibrium
from fastcontact.analysis.state import State
from fastcontact.analysis.wear import Worn
from fastcontact.elasticity import recovery
from fastcontact.model.pretension import section_results
from fastcontact.model.ramp import multiplier
from fastcontact.results.material_stress import by_largest_von_mises
from fastcontact.results.step import ContactResult, StepResult

Array = NDArray[np.float64]


def recover(
    problem: Problem, end: State, contact: dict[str, ContactResult], reaction: Array, iterations: dict[str, Any],
    place: tuple[int, float],
) -> StepResult:  # fmt: skip
    """Return the result of a load step.

    Parameters
    ----------
    problem : Problem
    end : State
        At the end of the step.
    contact : dict of str to ContactResult
    reaction : ndarray (n_dofs of the mesh,)
        [force]
    iterations : dict
        See `StepResult`.
    place : (int, float)
        Number of the step, and its pseudo-time.
    """
    mesh, u = problem.model.mesh, problem.displacement(end.u)
    factors = problem.temperature_factors(place[1])
    if factors:
        iterations = {**iterations, "temperature_factors": factors}
    sections = problem.model.pretensions
    if sections:
        pulls = [multiplier(own.ramp, problem.ramp, place[1]) for own in sections]
        found = section_results(sections, u, reaction.reshape(-1, mesh.dim), pulls)
        iterations = {**iterations, "pretension": found}
    at_places = recovery.nodal_stress(
        mesh,
        problem.model.kinematics,
        problem.field.moduli,
        problem.field.rows,
        u,
        problem.field.treatment,
        problem.sides,
        problem.field.thermal(problem.model.temperature_rise(factors)),
    )
    stress, by_material = by_largest_von_mises(problem.sides, problem.material_of_cells, at_places, mesh.n_points)
    von_mises = recovery.von_mises(stress)
    return StepResult(
        *place, u.copy(), stress, von_mises, recovery.von_mises_signed(stress, von_mises), reaction.reshape(-1, mesh.dim),
        contact, iterations, material_stress=by_material,
    )  # fmt: skip


def first_contacts(problem: Problem, start: State, load: StepLoad, u: Array) -> dict[str, tuple[Array, Array]]:
    """Return by contact pair in space where the bodies meet first [length], and the normal there.

    Once they have met it stays; until then it is where they would meet now, with obstacles and clearances as they are.
    """
    if problem.model.mesh.dim == 2:
        return {}
    return {
        name: start.first_contact[name]
        if name in start.first_contact
        else pair.first_contact(problem.configuration(name, start, load, problem.displacement(u), u))
        for name, pair in problem.pairs.items()
    }


def contact_results(
    problem: Problem, start: State, load: StepLoad, settled: SettledContact, end: State
) -> dict[str, ContactResult]:
    """Return the results of all contact pairs.

    Parameters
    ----------
    problem : Problem
    start : State
        At the beginning of the step.
    load : StepLoad
    settled : SettledContact
    end : State
        At the end of the step; of it the displacements and the places of first contact are needed.
    """
    displacement = problem.displacement(end.u)
    paired_at = np.zeros_like(displacement) if problem.criteria.keep_pairing else displacement
    return {
        name: contact_result(
            name, problem.pairs[name], settled.constraints.parts[name], settled.solution, rows,
            problem.configuration(name, start, load, paired_at, end.u), end.first_contact.get(name), displacement,
        )
        for name, rows in settled.constraints.rows().items()
    }  # fmt: skip


def worn_off(
    problem: Problem, start: State, load: StepLoad, end: State, results: dict[str, ContactResult]
) -> tuple[dict[str, Worn], dict[str, ContactResult]]:
    """Return by contact pair that wears what has been worn off at the end of the step, and the results with it."""
    found, told, displacement = dict(start.worn), dict(results), problem.displacement(end.u)
    for name, contact in results.items():
        pair = problem.pairs[name]
        if pair.options.wear is None:
            continue
        before = start.worn.get(name, Worn.nothing(len(contact.points)))
        at = problem.configuration(name, start, load, displacement, end.u)
        found[name] = before.after(pair, at, contact, pair.options.wear)
        told[name] = dataclasses.replace(contact, wear=found[name].depth)
    return found, told


def never_opening(
    problem: Problem, start: State, settled: SettledContact
) -> dict[str, tuple[Array, NDArray[np.bool_]]]:
    """Return by contact pair that is bilateral once closed the places of its constraints, and which are closed for good."""
    found = dict(start.never_opening)
    for name, rows in settled.constraints.rows().items():
        if problem.pairs[name].options.kind == "bilateral_once_closed":
            part, closed = settled.constraints.parts[name], settled.solution.active[rows].copy()
            if part.equality is not None:  # what stands beside the other side now may come back to it
                closed |= part.equality
            found[name] = part.positions, closed
    return found


def tractions(problem: Problem, settled: SettledContact) -> dict[str, tuple[Array, Array]]:
    """Return by contact pair with a tangential penalty the places of its constraints, and the tangential tractions there."""
    found = {}
    for name, rows in settled.constraints.rows().items():
        part, solution = settled.constraints.parts[name], settled.solution
        if problem.pairs[name].options.tangential_penalty is not None and isinstance(solution, FrictionalEquilibrium):
            assert part.areas is not None
            forces = np.einsum("nk,ndk->nd", solution.tangential[rows], np.stack(part.directions, axis=2))
            found[name] = part.positions, forces / part.areas[:, None]
    return found


def counted(settled: SettledContact | None, linear_iterations: int) -> dict[str, Any]:
    """Return the work of a load step, see `StepResult.iterations`."""
    history = settled.iterate.history if settled is not None else []
    counts = {
        "geometry_updates": max(len(history) - 1, 0),
        "active_set_iterations": sum(entry["active_set_iterations"] for entry in history),
        "linear_iterations": linear_iterations,
        "history": history,
    }
    scatter = None if settled is None else settled.scatter
    return counts if scatter is None else {**counts, "scatter": dataclasses.asdict(scatter)}
