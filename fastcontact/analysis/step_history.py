"""Data of the contact at the end of a load step that later steps need."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fastcontact.analysis.geometry_loop import SettledContact
from fastcontact.analysis.problem import Problem, StepLoad
from fastcontact.analysis.slip import Worn, slip_in_step
from fastcontact.analysis.solution import FrictionalEquilibrium
from fastcontact.analysis.state import State
from fastcontact.analysis.work import contact_work
from fastcontact.arrays import Array, Mask
from fastcontact.contact.cohesion import Bond
from fastcontact.contact.cohesive_layer import Layer
from fastcontact.results.step import ContactResult


def save_contact_history(problem: Problem, start: State, load: StepLoad, settled: SettledContact, end: State) -> State:
    """Return the state `end` with the contact data that later steps need.

    These are active sets, pressures, bonds, elastic slips, points of first contact, and the data for extrapolation.

    Parameters
    ----------
    problem : Problem
    start : State
        State at the beginning of the step.
    load : StepLoad
    settled : SettledContact
        Contact solution of the step.
    end : State
        State at the end of the step, with its displacements.
    """
    gap, force, rows = settled.solution.gap, settled.solution.multiplier, settled.constraints.rows()
    return replace(
        end, active=settled.iterate.active, pressure=settled.iterate.pressure, rigid=settled.iterate.rigid,
        last_change=settled.last_change, first_contact=first_contacts(problem, start, load, end.u),
        extrapolation=start.extrapolation.converged(
            end.u, {name: (gap[at], force[at]) for name, at in rows.items()}, problem.bodies is not None
        ),
        never_opening=never_opening(problem, start, settled), elastic_slip=elastic_slips(settled),
        bonds=bonds(settled, end.u),
    )  # fmt: skip


def keep_path(
    problem: Problem, start: State, load: StepLoad, settled: SettledContact, end: State, results: dict[str, ContactResult],
    energy: tuple[float, float],
) -> tuple[State, dict[str, ContactResult]]:  # fmt: skip
    """Return the state `end` and the contact results with accumulated slip, wear and work added.

    `start`, `load`, `settled` and `end` are those of `save_contact_history`; `results` are the contact results of each
    pair, and `energy` the elastic strain energy and the plastic work [energy].
    """
    displacement, results_so_far, works = problem.displacement(end.u), dict(results), np.zeros(3)
    worn, slipped, forces = dict(start.worn), dict(start.slipped), dict(start.forces)
    for name, rows in settled.constraints.rows().items():
        pair, contact, constraints = problem.pairs[name], results[name], settled.constraints.parts[name]
        at = problem.configuration(name, start, load, displacement, end.u)
        slip = slip_in_step(pair, at, contact)
        slipped[name] = slip + start.slipped.get(name, 0.0)
        results_so_far[name] = replace(contact, slip=slip, slip_total=slipped[name])
        if pair.options.wear is not None:
            before = start.worn.get(name, Worn.nothing(len(contact.points)))
            worn[name] = before.after(pair, at, contact, pair.options.wear)
            results_so_far[name] = replace(results_so_far[name], wear=worn[name].depth)
        if name in end.bonds:
            results_so_far[name] = replace(results_so_far[name], damage=end.bonds[name].at(contact.coordinates)[1])
        elif not (pair.options.tied or pair.options.gap_only):
            given = constraints, settled.solution, rows, at, contact, start.forces.get(name)
            forces[name], work_of_pair = contact_work(pair, *given)
            results_so_far[name] = replace(results_so_far[name], dissipation=work_of_pair[0])
            works += work_of_pair
    stored = sum(entry.stored for entry in forces.values()) + sum(entry.stored for entry in end.bonds.values())
    released = sum(entry.released for entry in end.bonds.values())
    work = None if start.work is None else start.work.after(energy, stored, works.tolist(), released)
    return replace(end, worn=worn, slipped=slipped, forces=forces, work=work), results_so_far


def first_contacts(problem: Problem, start: State, load: StepLoad, u: Array) -> dict[str, tuple[Array, Array]]:
    """Return the point of first contact (dim,) [length] of each contact pair in 3D, and the unit normal (dim,) there [-].

    The point is constant after the bodies have touched. Before that it is the node with the smallest gap at the current
    positions of obstacles and clearances.
    """
    if problem.model.mesh.dim == 2:
        return {}
    return {
        name: start.first_contact[name]
        if name in start.first_contact
        else pair.first_contact(problem.configuration(name, start, load, problem.displacement(u), u))
        for name, pair in problem.pairs.items()
    }


def never_opening(problem: Problem, start: State, settled: SettledContact) -> dict[str, tuple[Array, Mask]]:
    """Return, for each pair without separation, the positions (m, dim) of its constraints and which (m,) have closed."""
    positions = dict(start.never_opening)
    for name, rows in settled.constraints.rows().items():
        if problem.pairs[name].options.kind == "bilateral_once_closed":
            constraints, closed = settled.constraints.parts[name], settled.solution.active[rows].copy()
            if constraints.equality is not None:  # points that have slid beyond the other side may return to it
                closed |= constraints.equality
            positions[name] = constraints.positions, closed
    return positions


def elastic_slips(settled: SettledContact) -> dict[str, tuple[Array, Array]]:
    """Return the positions and elastic slips of each pair with tangential compliance, see `State.elastic_slip`."""
    given, solution = {}, settled.solution
    for name, rows in settled.constraints.rows().items():
        constraints = settled.constraints.parts[name]
        compliant = constraints.compliance is not None or constraints.tangential_softness is not None
        if compliant and constraints.tangents and isinstance(solution, FrictionalEquilibrium):
            slips = constraints.elastic_slips(solution.multiplier[rows], solution.tangential[rows])
            given[name] = constraints.positions, slips
    return given


def bonds(settled: SettledContact, u: Array) -> dict[str, Bond]:
    """Return the state of the cohesive layer, for each contact pair that has one, at displacements u (n_dofs,) [length]."""
    parts = settled.constraints.parts.items()
    return {name: part.tied.after(part, u) for name, part in parts if isinstance(part.tied, Layer)}
