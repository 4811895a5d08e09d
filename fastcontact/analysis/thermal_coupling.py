"""Staggered solution of heat conduction and contact, which are coupled by thermal expansion and contact conductance.

Each exchange computes the equilibrium at given temperatures, and then the temperatures with the conductances of this
equilibrium. Anderson acceleration is applied to the temperatures. If temperatures depend neither on the contact nor on finite
deformations, they are computed only once, before the contact.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import csr_array

from fastcontact._tools.records import replace
from fastcontact.analysis.anderson import DEPTH, Anderson
from fastcontact.analysis.contact_result import areas
from fastcontact.analysis.criteria import LINEAR_ERROR, NOTABLE
from fastcontact.analysis.equilibrium import StepEquilibrium
from fastcontact.analysis.heat import Heat, Temperatures
from fastcontact.analysis.inequalities import StepContext
from fastcontact.analysis.problem import Problem, StepLoad
from fastcontact.analysis.solution import Solution
from fastcontact.analysis.state import State
from fastcontact.arrays import Array, largest
from fastcontact.contact.cohesive_layer import CohesiveLayer
from fastcontact.contact.conductance import closed_fractions, heat_transfer
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.surface import Surface
from fastcontact.errors import ConvergenceError
from fastcontact.model.model import Model
from fastcontact.model.parts.heat import HEAT_FLUX
from fastcontact.results.step import StepResult
from fastcontact.round_off import LENGTH_ROUND_OFF

Solve = Callable[[StepContext, StepEquilibrium | None], StepEquilibrium]


def with_heat_results(heat: Heat, temperatures: Temperatures, step: StepResult) -> StepResult:
    """Return the result of a load step with heat fluxes and heat reactions added."""
    cell_flux = heat.conduction_at(step.displacement).flux(temperatures.rise)
    with_flux = {name: replace(step.contact[name], heat_flux=flux) for name, flux in temperatures.fluxes.items()}
    return replace(
        step, contact=step.contact | with_flux, heat_reaction=temperatures.reaction,
        iterations={**step.iterations, "heat": temperatures.balance},
        cell_fields={**step.cell_fields, **dict(zip(HEAT_FLUX, cell_flux.T, strict=False))},
    )  # fmt: skip


def first_rise(problem: Problem, heat: Heat, state: State, instant: float) -> Array:
    """Return the initial temperature rise (n_points,) of a load step [temperature]."""
    depends_on_contact = any({"conductance", "friction_heat"} & set(pair.options) for pair in problem.model.contact)
    if not (depends_on_contact or heat.finite_strain):
        return heat.temperatures(instant).rise
    return np.zeros(problem.model.mesh.n_points) if state.rise is None else state.rise


def settle_heat(
    heat: Heat, step: StepContext, load: StepLoad, rise: Array, equilibrium: StepEquilibrium, solve: Solve
) -> StepEquilibrium:
    """Return the equilibrium of a load step with its temperatures.

    Parameters
    ----------
    heat : Heat
        Heat conduction of the problem.
    step : StepContext
    load : StepLoad
        Load at the end of the step, without thermal expansion.
    rise : ndarray (n_points,)
        Initial temperature rise [temperature].
    equilibrium : StepEquilibrium
        Equilibrium at the initial temperature rise.
    solve : callable
        Function that returns the equilibrium, given the step with another load, and the last equilibrium.

    Raises
    ------
    ConvergenceError
        If temperatures and contact do not converge.
    """
    problem, mixing = step.problem, Anderson(DEPTH, np.arange(len(rise)))
    tolerance = max(problem.criteria.geometry, LINEAR_ERROR * heat.linear_tolerance)
    change, limit = np.inf, max(problem.criteria.max_geometry_updates, 1)
    for exchange in range(1, limit + 1):
        temperatures = _steady_temperatures(heat, step, equilibrium)
        difference = temperatures.rise - rise
        change = largest(difference)
        settled = change <= tolerance * largest(temperatures.rise) or not problem.model.expands
        negligible = max(tolerance * equilibrium.balance.largest, equilibrium.balance.noise)
        if settled or largest(problem.model.expansion_forces(problem.field, difference).ravel()) <= negligible:
            temperatures = replace(temperatures, balance={**temperatures.balance, "exchanges": exchange})
            return replace(equilibrium, temperatures=temperatures)
        rise = mixing.mixed(rise, temperatures.rise)
        equilibrium = solve(step.with_load(thermal_load(problem, load, rise)), equilibrium)
    size, advice = largest(temperatures.rise), ""
    if change < NOTABLE * size:
        advice = f", or accept this accuracy with Criteria(geometry={2 * change / size:.0e})"
    raise ConvergenceError(
        f"heat and contact do not converge: after {limit} exchanges, temperatures still change by {change:.3g}, for "
        "instance because a contact opens when heat flows through it and closes when none does; let its "
        f"conductance fall gradually with the gap, or grow from zero with the pressure{advice}",
        [] if equilibrium.settled is None else equilibrium.settled.iterate.history,
    )


def thermal_load(problem: Problem, load: StepLoad, rise: Array) -> StepLoad:
    """Return the load with thermal expansion by a temperature rise (n_points,) [temperature].

    For linear bodies its nodal forces are added to the forces of the load.
    """
    if not problem.model.expands:
        return load
    load = replace(load, rise=rise)
    return load if problem.bodies is not None else expansion_as_force(problem, load)


def expansion_as_force(problem: Problem, load: StepLoad) -> StepLoad:
    """Return the load in which the nodal forces of thermal expansion replace the temperature rise."""
    assert load.rise is not None
    forces = problem.model.expansion_forces(problem.field, load.rise).ravel()
    return replace(load, force=load.force + np.pad(forces, (0, len(load.force) - len(forces))), rise=None)


def _steady_temperatures(heat: Heat, step: StepContext, equilibrium: StepEquilibrium) -> Temperatures:
    """Return the temperatures for the contact conductances and the frictional heat of an equilibrium."""
    problem, load, settled = step.problem, step.load, equilibrium.settled
    displacement = problem.displacement(equilibrium.u)
    n, laws, conducting = problem.model.mesh.n_points, problem.model.conductances(), {}
    contact_matrix, obstacle_matrix = csr_array((n, n)), csr_array((n, n))
    friction_power, obstacle_power = np.zeros((2, n))
    for name, pair in problem.pairs.items():
        law = laws.get(name)
        if settled is None or (law is None and not pair.options.friction_heat):
            continue
        part, solution = settled.parts[name]
        configuration = problem.configuration(name, step.state, load, equilibrium.u)
        constraints, force, gap = _normal_state(pair, part, solution, configuration)
        link = heat_transfer(constraints, pair.secondary, pair.primary, pair.points.shape)
        area_ratio = np.ones(n)  # ratio of deformed to undeformed area at each node
        if heat.finite_strain:
            before, after = areas(pair, displacement)
            area_ratio[pair.secondary.points] = after / before
            link = replace(link, area=link.area * (link.secondary @ area_ratio))
        if law is not None:
            h, facing = np.zeros(len(gap)), link.area > 0.0
            h[facing] = law(force[facing] / link.area[facing], gap[facing])
            is_closed, one_per_node = gap == 0.0, part.nodes is not None and part.tied is None and part.wetted is None
            if one_per_node and (facing & ~is_closed).any() and is_closed.any() and law.jump:
                pressure = constraints.nodal_field.pressure(force)
                closed = _closed_fractions(problem.model, pair, pressure, np.where(facing, gap, np.inf), configuration)
                h[facing] = np.maximum(h + law.jump * (closed - is_closed), 0.0)[facing]
            obstacle_rise = 0.0
            if pair.options.obstacle_temperature is None:
                contact_matrix = csr_array(contact_matrix + link.matrix(h))
            else:
                obstacle_rise = pair.options.obstacle_temperature - problem.model.reference_temperature
                obstacle_matrix = csr_array(obstacle_matrix + link.matrix(h))
                obstacle_power = obstacle_power + link.secondary.T @ (h * link.area * obstacle_rise)
            conducting[name] = link, constraints.nodal_field, h, obstacle_rise, area_ratio[pair.secondary.points]
        if pair.options.friction_heat:
            work = np.maximum(-(solution.tangential * solution.slip).sum(axis=1), 0.0)
            friction_power += link.nodal_powers(pair.options.friction_heat * work / (load.instant - step.state.instant))
    obstacles = obstacle_matrix, obstacle_power
    steady = heat.temperatures(load.instant, displacement, contact_matrix, friction_power, obstacles)
    fluxes, heat_flows = {}, {}
    for name, (link, field, h, obstacle_rise, area_ratio) in conducting.items():
        power = h * link.area * (link.jump @ steady.rise - obstacle_rise)
        fluxes[name], heat_flows[name] = field.side_pressure(power) / area_ratio, float(power.sum())
    return replace(steady, balance={**steady.balance, "contacts": heat_flows}, fluxes=fluxes)


def _closed_fractions(
    model: Model, pair: Formulation, pressure: Array, gap: Array, configuration: Configuration
) -> Array:
    """Return the closed fractions (n_nodes,) of the areas of nodes with one constraint each; see `closed_fractions`.

    `pressure` (n_nodes,) are nodal pressures, and `gap` (n_nodes,) gaps, infinite for nodes that face no facet [length].
    """
    if pair.weighs_gaps and pair.secondary.order == 2:  # the last closed mean gap may be a facet away from the rim
        is_open, at_nodes = (gap > 0.0) & np.isfinite(gap), pair.nodal_gap(configuration)[0]
        near_rim = pair.secondary.extended_adjacency @ is_open.astype(float) > 0.0
        gap = np.where(near_rim & np.isfinite(gap) & np.isfinite(at_nodes), at_nodes, gap)
    sides = [side.points for side in (pair.secondary, pair.primary) if isinstance(side, Surface)]
    modulus = 1.0 / sum(1.0 / model.contact_modulus_at(points) for points in sides)
    return closed_fractions(pair.secondary, pair.points, pressure, gap, modulus)


def _normal_state(
    pair: Formulation, constraints: Constraints, solution: Solution, configuration: Configuration
) -> tuple[Constraints, Array, Array]:
    """Return the constraints of a pair, their normal forces (m,) [force], and their gaps (m,), zero if closed [length]."""
    gap_round_off = LENGTH_ROUND_OFF * float(np.ptp(pair.points, axis=0).max())
    forces = np.maximum(constraints.normal_forces(constraints.contact_forces(solution.multiplier)), 0.0)
    if pair.options.kind == "tied":
        return pair.unilateral(Configuration.undeformed(pair.points)), forces, np.zeros(len(forces))
    closed, layer, wetted = solution.active, constraints.tied, constraints.wetted
    if pair.options.kind != "gap_only" and layer is None and wetted is None:
        gap = np.maximum(solution.gap, 0.0)
        return constraints, forces, np.where(closed | (gap <= gap_round_off), 0.0, gap)
    constraints = pair.unilateral(configuration)
    gap = np.maximum(constraints.gaps(configuration.displacement), 0.0)
    if wetted is not None:
        closed = closed & ~wetted.rows
    elif isinstance(layer, CohesiveLayer):  # adhesion conducts up to its strength, a cohesive layer until it is broken
        closed = layer.damage == 0.0 if layer.law.reversible else layer.damage < 1.0
    elif pair.options.kind == "gap_only":
        closed, forces = np.zeros(len(gap), bool), np.zeros(len(gap))
    return constraints, forces, np.where(closed | (gap <= gap_round_off), 0.0, gap)
