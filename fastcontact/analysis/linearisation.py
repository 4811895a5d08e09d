"""The linear problem of a Newton iteration: the terms of the equilibrium are linearised about given displacements."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import bsr_array, csr_array

from fastcontact.analysis.equilibrium import Terms
from fastcontact.analysis.floating_bodies import SOFT, STIFF, FloatingBodies, RigidPosition
from fastcontact.analysis.problem import (
    Problem,
    StepLoad,
    active_dofs,
    floating_motions,
    near_nullspace,
    prepare_solver,
)  # fmt: skip
from fastcontact.arrays import Array
from fastcontact.elasticity.constrained_system import System
from fastcontact.linear.sparse_rows import sum_of_blocks
from fastcontact.round_off import SINGLE_PRECISION


def linearised(
    problem: Problem, K: bsr_array, u: Array, rigid: RigidPosition | None, contact: csr_array | None, stiff: bool,
    replaces: bool,
) -> Problem:  # fmt: skip
    """Return the problem whose system and linear solver use the tangent of the terms at displacements u.

    Parameters
    ----------
    problem : Problem
    K : bsr_array (n, n)
        Tangent of the terms, see `Terms.tangent`; it is modified [force / length].
    u : ndarray (n_dofs,)
        Displacements about which the terms are linearised [length].
    rigid : RigidPosition, optional
        Last position of floating bodies.
    contact : csr_array (n_dofs, n_dofs), optional
        Stiffness due to contact, which is added to K [force / length].
    stiff : bool
        Whether the springs of floating bodies are as stiff as the bodies.
    replaces : bool
        Whether floating bodies have no springs of their own if `contact` resists all their motions. The iteration of their
        positions may not converge for a tangent that is nearly singular.
    """
    K = problem.force_driven.stiffness(K)
    system = problem.system.renewed(K if contact is None else sum_of_blocks(K, contact))
    floating = _floating(problem, system, u, rigid, stiff)
    if replaces and floating is not None and contact is not None and _holds(contact, floating):
        floating = None
    solver = problem.solver.near()
    involved = system.involved(problem.contact_dofs)
    modes = problem.force_driven.near_nullspace(near_nullspace(problem.model, problem.displacement(u)))
    involved = prepare_solver(solver, system, floating, modes, involved)
    dofs = active_dofs(system, problem.contact_dofs, involved, problem.pairs, floating, solver)
    at = u if problem.bodies is not None and problem.bodies.finite else None
    return replace(problem, system=system, solver=solver, dofs=dofs, floating_bodies=floating, linearised_at=at)


def _holds(contact: csr_array, floating: FloatingBodies) -> bool:
    """Return whether a stiffness (n_dofs, n_dofs) resists all motions of floating bodies."""
    motions = floating.motions.displacement
    values = np.linalg.eigvalsh(motions.T @ (contact @ motions))
    return bool(values[0] > SINGLE_PRECISION * values[-1])


def load_about(problem: Problem, terms: Terms, u: Array, load: StepLoad, rigid: RigidPosition | None) -> StepLoad:
    """Return the load of the problem that is linearised about displacements u (n_dofs,) [length].

    Its forces are the external forces minus the forces of the terms at u, plus the product of the tangent and u.
    """
    force = load.force - terms.residual(u)[0] + problem.system.K @ u
    if problem.floating_bodies is not None and rigid is not None:
        # Under load, the tangent resists rigid-body rotations, which the unknowns of floating bodies do not include.
        force -= problem.system.K @ problem.floating_bodies.rigid(u[problem.floating_bodies.dofs])
    return replace(load, force=force)


def _floating(
    problem: Problem, system: System, u: Array, rigid: RigidPosition | None, stiff: bool
) -> FloatingBodies | None:
    """Return the floating bodies for a tangent at displacements u.

    In finite strain, their rigid-body modes are those of the deformed configuration.
    """
    if problem.floating_bodies is None or problem.bodies is None or not problem.bodies.finite:
        return problem.floating_bodies
    motions = problem.floating_bodies.motions
    if problem.model.kinematics != "axisymmetric":
        turned = floating_motions(problem.model, problem.model.prescribed_by_ramp()[0], problem.displacement(u))
        motions = turned if len(turned) == len(motions) else motions
    before = problem.floating_bodies.dofs if rigid is None else rigid.dofs
    return FloatingBodies(motions, system, STIFF if stiff or not problem.solver.iterative else SOFT, before)
