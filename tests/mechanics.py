"""Invariants of any result: balance, complementarity, Coulomb's cone, moments, integral of the pressure.

Each function returns numbers that vanish in an exact solution, relative to the sizes that it names; tests and
``bench/random_models.py`` say how far they may be from zero.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

import fastcontact as fc
from fastcontact.contact.integration import lumped_areas
from fastcontact.contact.surface import surface
from fastcontact.elasticity.stiffness import stiffness

# Forces below so many units in the last place of what their sums are made of are round-off.
ROUND_OFF = 3000 * float(np.finfo(float).eps)


@dataclass(frozen=True)
class Sizes:
    """By what figures are divided: the largest displacement [length] and force [force], infinite where all is round-off."""

    length: float
    force: float
    round_off: float  # of gaps, which are differences of coordinates [length]


def out_of_balance(model: fc.Model, step: fc.StepResult, factor: float, tolerance: float = 0.0) -> tuple[float, Sizes]:
    """Return the largest nodal force that nothing balances, over the largest force or round-off, and the sizes of both.

    `factor` is the multiplier of the loads, `tolerance` that of an iterative linear solver.
    """
    K = stiffness_of(model)
    internal = (K @ step.displacement.ravel()).reshape(step.displacement.shape)
    external = sum((factor * model.load_vector(load) for load in model.loads), np.zeros_like(internal))
    external = sum((factor * heat for heat in model.thermal_forces_by_ramp().values()), external)
    contact = contact_forces(step)
    largest = max(np.abs(part).max(initial=0.0) for part in (external, contact, step.reaction))
    noise = max(ROUND_OFF, 10 * tolerance) * (abs(K) @ np.abs(step.displacement).ravel()).max(initial=0.0)
    residual = float(np.abs(internal - contact - external - step.reaction).max())
    gaps = 16.0 * float(np.finfo(float).eps) * float(np.abs(model.mesh.points).max())
    sizes = Sizes(
        np.abs(step.displacement).max(initial=0.0) or 1.0, float(largest) if largest > noise else np.inf, gaps
    )
    return max(residual - noise, 0.0) / (noise or 1.0) if largest <= noise else residual / largest, sizes


def stiffness_of(model: fc.Model) -> csr_array:
    """Return the stiffness (n_dofs, n_dofs) of the solid cells [force / length]."""
    field = model.material_field()
    return stiffness(model.mesh, model.kinematics, field.moduli, field.moduli_rows, None, field.treatment)


def contact_forces(step: fc.StepResult) -> np.ndarray:
    """Return the contact forces (n_points, dim) on all nodes, those of both sides [force]."""
    total = np.zeros(step.displacement.shape)
    for found in step.contact.values():
        np.add.at(total, found.points, found.force_vectors)
        np.add.at(total, found.primary_points, found.primary_force_vectors)
    return total


def given_back(model: fc.Model, step: fc.StepResult, sizes: Sizes, name: str) -> tuple[float, float]:
    """Return by how much the forces on both sides of a pair fail to cancel, and their moments in the deformed state.

    The first over the sum of the sizes of the forces, the second over that times the extent of the side, less what forces
    on sides that stand apart make: by a clearance, or where tied. About an axis, forces along the radius do not cancel and
    have no moment.
    """
    found = step.contact[name]
    (options,) = (pair.options for pair in model.contact if pair.name == name)
    nodes = np.concatenate([found.points, found.primary_points])
    forces = np.vstack([found.force_vectors, found.primary_force_vectors])
    size = np.linalg.norm(found.force_vectors, axis=1).sum()
    size = max(float(size), sizes.force)
    if model.kinematics == "axisymmetric":
        return float(abs(forces[:, 1].sum()) / size), 0.0
    places = model.mesh.points[nodes] + step.displacement[nodes]
    arm = places - places[: len(found.points)].mean(axis=0)
    moment = np.cross(in_space(arm), in_space(forces)).sum(axis=0)
    extent = np.linalg.norm(np.ptp(places[: len(found.points)], axis=0))
    apart = abs(options.get("clearance", 0.0))
    if options.get("kind") == "tied":
        apart = np.abs(found.gap[np.isfinite(found.gap)]).max(initial=0.0)
    left = max(float(np.linalg.norm(moment)) - apart * size, 0.0) if size < np.inf else 0.0
    return float(np.linalg.norm(forces.sum(axis=0)) / size), left / (size * extent)


def in_space(vectors: np.ndarray) -> np.ndarray:
    """Return vectors (n, dim) with three components."""
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))


def complementarity(settled, sizes: Sizes) -> tuple[float, float, float]:
    """Return the largest penetration, tension and product of gap and force over all inequalities, in units of `sizes`.

    What a penalty lets penetrate is part of the gap.
    """
    state, constraints = settled.solution, settled.constraints
    usable = np.diff(constraints.B.indptr) > 0
    usable &= ~constraints.equality
    gap = state.gap[usable]
    gap = np.minimum(np.where(gap < 0.0, np.minimum(gap + sizes.round_off, 0.0), gap) / sizes.length, 1e6)
    force = state.multiplier[usable] / sizes.force
    product = float(np.abs(gap * force).max(initial=0.0))
    return float(-gap.min(initial=0.0)), float(-force.min(initial=0.0)), product


def displaced_gaps(settled, u: np.ndarray, sizes: Sizes) -> float:
    """Return the largest difference between gaps of closed constraints and those of the displacements u (n_dofs,) [-].

    It is relative to the largest displacement. Constraints with compliance, constraints whose forces are coupled or shared
    with others, and models with laws of two branches are not compared.
    """
    state, constraints = settled.solution, settled.constraints
    if any(part.branches is not None for part in constraints.parts.values()):
        return 0.0
    closed = state.active & (constraints.softness[0] == 0.0)
    for name, rows in constraints.rows.items():
        closed[rows] &= not constraints.parts[name].coupled
    if settled.nodes is not None:
        representative = settled.nodes.representative
        closed &= (np.bincount(representative, minlength=len(closed)) == 1) & (representative == np.arange(len(closed)))
    apart = np.abs(constraints.gap0 + constraints.B @ u - state.gap)[closed]
    return float(np.maximum(apart - sizes.round_off, 0.0).max(initial=0.0) / sizes.length)


def friction(settled, sizes: Sizes) -> tuple[float, float]:
    """Return how far tangential forces leave Coulomb's cone, and what work they do along the slip, in units of `sizes`."""
    state, constraints = settled.solution, settled.constraints
    if not constraints.tangents:
        return 0.0, 0.0
    rubbing = np.linalg.norm(state.tangential, axis=1)
    outside = (rubbing - constraints.friction * state.multiplier).max(initial=0.0)
    # In steps that are solved in increments, slips may turn round between them.
    work = -np.einsum("mk,mk->m", state.tangential, state.slip) if state.work is None else state.work
    driving = -work.min(initial=0.0)
    return float(outside / sizes.force), float(driving / (sizes.force * sizes.length))


def carried(model: fc.Model, step: fc.StepResult, settled, sizes: Sizes, name: str) -> float:
    """Return by how much the integral of the reported pressure misses the normal forces of a pair, over their sizes."""
    part, rows = settled.constraints.parts[name], settled.constraints.rows[name]
    forces = part.normal_forces(settled.solution.multiplier[rows])
    areas = part.nodal.nodal_areas  # by the rule of the formulation, which differs on coarse curved facets
    total = max(float(np.abs(forces).sum()), sizes.force)
    missing = abs((step.contact[name].pressure * areas).sum() - forces.sum())
    return float(max(missing - lost_at_seams(model, step.contact[name], areas), 0.0) / total)


def lost_at_seams(model: fc.Model, contact: fc.ContactResult, areas: np.ndarray) -> float:
    """Return what the mean of the pressures of two nodes of one place may change in their integral [force].

    The mean is by the shares of both in their facets, which are not in the ratio of `areas` (m,) at corners of curved
    quadratic facets, where these vanish but for the curvature.
    """
    (group,) = (pair.secondary for pair in model.contact if pair.name == contact.name)
    side, lost = surface(model.mesh, group), 0.0
    row = np.full(model.mesh.n_points, -1)
    row[side.points] = np.arange(len(side.points))
    for seam in model.periodic_interfaces:
        a, b = row[seam.first], row[seam.second]
        a, b = a[(a >= 0) & (b >= 0)], b[(a >= 0) & (b >= 0)]
        shares = lumped_areas(side, model.mesh.points, model.kinematics == "axisymmetric")
        apart = np.abs(areas[a] * shares[b] - areas[b] * shares[a]) / np.minimum(shares[a], shares[b])
        lost += float((apart * np.abs(contact.pressure[a])).sum())
    return lost
