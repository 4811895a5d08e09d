"""Load steps in which nodes slide while they close: friction is solved again in increments along the path of the step."""

from __future__ import annotations

import logging
import math
from dataclasses import replace

import numpy as np

from fastcontact.analysis.extrapolation import Extrapolation
from fastcontact.analysis.geometry_loop import SettledContact, settle_geometry
from fastcontact.analysis.inequalities import Iterate, StepContext, pair_surfaces, solve_inequalities
from fastcontact.analysis.shared_nodes import SharedNodes
from fastcontact.analysis.solution import Accuracy, FrictionalEquilibrium, Path
from fastcontact.arrays import Array
from fastcontact.contact.constraints import StackedConstraints
from fastcontact.contact.surface import Surface
from fastcontact.errors import ConvergenceError
from fastcontact.round_off import LENGTH_ROUND_OFF

log = logging.getLogger("fastcontact")
# Largest number of increments of a step.
MOST = 128


def along_path(step: StepContext, settled: SettledContact) -> SettledContact:
    """Return the contact of a step, with friction solved in increments if nodes slide while they close.

    Increments are solved on the converged geometry of the step without increments. If they do not converge, the step is left
    unchanged.
    """
    nodes = settled.nodes
    path = _path(step, settled, nodes)
    if path is None:
        return settled
    old = settled.iterate
    begun = replace(old, active=dict(old.active), pressure=dict(old.pressure), history=list(old.history))
    constraints, active = settled.constraints, settled.solution.active
    once, closed = (constraints, active) if nodes is None else (nodes.once(constraints), nodes.closed(active))
    try:
        solution, there = solve_inequalities(
            replace(step, path=path), once, replace(begun), closed & once.usable, Accuracy(0.0)
        )
        assert isinstance(solution, FrictionalEquilibrium)
        if not solution.settled:
            return settled
        begun.u = step.dofs.put(begun.u, there)
        along = settle_geometry(replace(step, path=solution.slid, extrapolation=Extrapolation()), begun)
        if not step.problem.until_settled:  # fixed number of updates
            del begun.history[: len(old.history)]
        return along
    except ConvergenceError as error:
        log.info("friction in %d increments of the step does not converge: %s", path.parts, error)
        return settled


def _path(step: StepContext, settled: SettledContact, nodes: SharedNodes | None) -> Path | None:
    """Return the path of a step; None if it has no effect."""
    constraints, solution = settled.constraints, settled.solution
    allowed = step.problem.criteria.friction_while_touching
    if allowed is None or allowed >= 1.0 or not isinstance(solution, FrictionalEquilibrium) or not constraints.tangents:
        return None
    forces = _forces(step, constraints)
    if forces is None:
        return None
    normal, traction = forces
    rubs = solution.active & (constraints.coefficients > 0.0)
    closing = rubs & (normal == 0.0)
    shear = np.linalg.norm(solution.tangential, axis=1)
    limit = allowed * float((constraints.coefficients * solution.multiplier)[rubs].sum())
    if not float(shear[closing].sum()) > limit:
        return None
    gap = np.where(normal != 0.0, 0.0, _gaps(step, constraints, settled.iterate))
    size = float(np.ptp(step.problem.model.mesh.points, axis=0).max())
    closing &= gap > LENGTH_ROUND_OFF * size
    if not (slid := float(shear[closing].sum())) > limit:
        return None
    slips = _closing(step, constraints, gap)
    if nodes is not None:
        gap, normal, traction, slips = nodes.gathered(constraints, gap, normal, traction, slips)
    parts = math.ceil(slid / limit - LENGTH_ROUND_OFF)  # if all nodes close, the ratio is an integer up to round-off
    return Path(gap, normal, traction, slips, min(parts, MOST))


def _closing(step: StepContext, constraints: StackedConstraints, gap: Array) -> Array:
    """Return the slips (m, dim) of closing the gaps (m,) between bodies with inclined normals [length].

    The constraints already contain the slips for the gaps at the beginning of the step in the geometry of its end, which are
    scaled here to the actual gaps.
    """
    closing = np.zeros_like(constraints.positions)
    for name, rows in constraints.rows.items():
        if constraints.slip0 is not None and isinstance(step.problem.pairs[name].primary, Surface):
            tangents = np.stack([tangent[rows] for tangent in constraints.directions])
            now = constraints.parts[name].gaps(step.state.u)
            more = np.divide(gap[rows], now, out=np.ones_like(now), where=now > 0.0)
            closing[rows] = np.einsum("km,kmd->md", more * constraints.slip0[:, rows], tangents)
    return closing


def _forces(step: StepContext, constraints: StackedConstraints) -> tuple[Array, Array] | None:
    """Return normal (m,) and tangential (m, dim) forces at the beginning of the step [force]; None if unknown.

    Forces of equality constraints are not needed.
    """
    normal, traction = np.zeros(len(constraints)), np.zeros_like(constraints.positions)
    for name, rows in constraints.rows.items():
        part, before = constraints.parts[name], step.state.forces.get(name)
        if before is not None and part.areas is not None and part.wetted is None:
            pressure, shear = before.at(part.positions)
            normal[rows], traction[rows] = part.finite_areas * pressure, part.finite_areas[:, None] * shear
        elif name in step.state.touched and not (part.equality is not None and part.equality.all()):
            return None
    return normal, traction


def _gaps(step: StepContext, constraints: StackedConstraints, iterate: Iterate) -> Array:
    """Return the gaps (m,) at the beginning of the step, in the configuration of that time [length]."""
    state = step.state
    begin = replace(step.load, obstacles=state.obstacles, angles=state.angles)
    there = pair_surfaces(step.problem, state, begin, Iterate.of(state))
    gaps = []
    for name, part in there.parts.items():
        now = constraints.parts[name]
        then = part if np.array_equal(part.positions, now.positions) else now
        known = np.isfinite(then.gap0) & then.usable
        gaps.append(np.where(known, then.gap0 + then.B @ state.u, now.gap0 + now.B @ state.u))
    return np.maximum(np.concatenate(gaps), 0.0)
