"""Warnings about strains and rotations that linear kinematics do not describe.

In a rotation by a small angle, linear kinematics neglect the strain ``0.5 Q.T @ Q``, where Q is the antisymmetric part of
the displacement gradient. The work of the stresses on this strain, relative to that on the linear strain, shows whether the
strain matters. The work vanishes for a beam in bending, whose stresses cancel over the thickness, but not for a belt in
tension.

The second variation of this work is ``u.K_sigma u = 2 N`` with the geometric stiffness K_sigma, where N is the work on the
neglected strain, whereas ``u.K u = W`` is the work of the stresses on the linear strain. Under given forces, displacements
are therefore wrong by about 2 N / W. If displacements are prescribed and N is a cubic function of them, as in a disc spring,
forces are wrong by 3 N / W, the derivative of N relative to that of W / 2.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fastcontact.analysis.criteria import WARNING_RATIO
from fastcontact.analysis.problem import Problem
from fastcontact.analysis.state import State
from fastcontact.arrays import Array
from fastcontact.elasticity import recovery
from fastcontact.elasticity.energy import slopes_at
from fastcontact.elasticity.incompatible_modes import VOIGT
from fastcontact.elasticity.mass import cell_portions
from fastcontact.elasticity.nonlinear_materials import LARGEST_PLASTIC_STRAIN
from fastcontact.elasticity.stiffness import rigid_modes
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.topology import bodies
from fastcontact.model.model import Model
from fastcontact.model.rigid_motions import body_name
from fastcontact.results.layout import cut_at_interfaces
from fastcontact.results.step import StepResult
from fastcontact.round_off import SINGLE_PRECISION, TINY

# Error of the moment of friction above which a warning is given. Linear kinematics apply forces at undeformed positions. In
# bodies that rotate, moments are therefore out of balance by about the angle divided by the coefficient of friction. Errors
# of 0.019 and 0.055 lie on either side in `test_the_torque_of_a_press_fit_that_turns`.
MOMENT_ERROR = 0.03
# Estimated errors of displacements under given forces, and of forces due to prescribed motions, relative to the ratio of the
# works on neglected and on linear strains. In `test_leaves_that_are_pressed_together_before_they_bend` the estimate must be
# 0.5 to 1.5 times the error.
DISPLACEMENT_ERROR, FORCE_ERROR = 2.0, 3.0


def large_strain(problem: Problem, last: StepResult) -> Iterator[str]:
    """Yield warnings where strains, or plastic strains, are too large for linear kinematics."""
    strain = largest_strain(problem.model, last)
    if strain > WARNING_RATIO:
        yield (
            f"the largest equivalent strain is {strain:.3f}, beyond the {WARNING_RATIO} up to which linear kinematics are "
            "accurate"
        )
    else:
        yield from _large_free_strain(problem, last)
    plastic = last.cell_fields.get("plastic_strain")
    if plastic is not None and (largest := float(plastic.max())) > LARGEST_PLASTIC_STRAIN:
        yield (
            f"the largest plastic strain is {largest:.2f}, beyond the {LARGEST_PLASTIC_STRAIN} up to which linear kinematics "
            "are valid: contact pressures there are too low, under a ball by 10 % at 0.2; "
            "strain='finite' has no such limit"
        )


def largest_strain(model: Model, step: StepResult) -> float:
    """Return the largest equivalent elastic strain at the nodes of a model at the end of a step [-]."""
    field, (mesh, _, stress) = model.material_field(), cut_at_interfaces(model.mesh, step)
    largest_in_cells = 0.0
    for name, block in mesh.solids.items():
        compliance = field.compliance[field.rows[name]]
        for nodes in block.T:
            strain = recovery.equivalent_strain(np.einsum("cij,cj->ci", compliance, stress[nodes]))
            largest_in_cells = max(largest_in_cells, float(strain.max(initial=0.0)))
    return largest_in_cells


def _large_free_strain(problem: Problem, last: StepResult) -> Iterator[str]:
    """Yield a warning where temperatures or initial states cause large strains, which stresses need not show."""
    model = problem.model
    if not (model.temperatures or model.initial_states or model.conducts):
        return
    moduli = np.eye(problem.field.moduli.shape[1])[None]  # unit moduli: stresses are strains
    rows = {name: np.zeros(len(block), np.int32) for name, block in model.mesh.solids.items()}
    strain = float(np.abs(recovery.nodal_stress(model.mesh, model.kinematics, moduli, rows, last.displacement)).max())
    if strain > WARNING_RATIO:
        yield (
            f"temperatures and initial states cause strains of {strain:.3g}, beyond the {WARNING_RATIO} up to which linear "
            "kinematics are accurate: are they in the units of the model?"
        )


def large_rotation(problem: Problem, state: State, last: StepResult) -> Iterator[str]:
    """Yield a warning where rotations are too large for linear kinematics."""
    angle, where = largest_rotation(problem.model.mesh, problem.displacement(state.u))
    if angle**2 > WARNING_RATIO:  # the change of area that linear kinematics neglect
        yield (
            f"the largest rotation is {angle:.3f} rad, near {np.array2string(where, precision=4)}: linear kinematics "
            f"treat it as small, which neglects strains of about {0.5 * angle**2:.3f}"
        )
        return
    neglected, work_by_body = _work_on_strains(problem, last)
    # Bodies whose work on strains is round-off relative to that of other bodies are free of stress.
    least_work = max(SINGLE_PRECISION * work_by_body.max(initial=0.0), TINY)
    ratio = np.abs(neglected) / np.maximum(work_by_body, least_work)
    load = problem.load_at(last.load_factor)
    is_moved = bool(load.lift.any()) or any(motion.any() for motion in load.obstacles.values())
    notable = (FORCE_ERROR if is_moved else DISPLACEMENT_ERROR) * ratio > WARNING_RATIO
    # Even small rotations matter under large stresses. In bodies whose stresses are only due to neglected strains, the works
    # on strains and on neglected strains are about equal.
    is_preloaded = bool((notable & (ratio < 0.5)).any())
    friction = min((pair.friction or 1.0 for pair in problem.pairs.values()), default=1.0)
    if angle > 0.5 * MOMENT_ERROR * friction or is_preloaded:
        yield from _neglected_rotation(problem, last, angle, neglected, ratio, is_moved)


def largest_rotation(mesh: Mesh, displacement: Array) -> tuple[float, Array]:
    """Return the largest rotation at the centre of a solid cell [radian], and its position (dim,).

    In linear kinematics it is half the curl of the displacement (n_points, dim).
    """
    square, point = 0.0, np.zeros(mesh.dim)
    for name, rows in cell_portions(mesh):
        element, nodes = elements.get(name), mesh.cells[name][rows]
        centre = element.nodes[: element.n_corners].mean(axis=0)[None]
        gradients, _ = slopes_at(displacement[nodes], mesh.points[nodes], element.gradient(centre))
        squares = ((gradients - gradients.transpose(0, 1, 3, 2)) ** 2).sum(axis=(1, 2, 3)) / 8.0
        if squares.max() > square:
            square, point = squares.max(), mesh.points[nodes[squares.argmax()]].mean(axis=0)
    return float(square**0.5), point


def _neglected_rotation(
    problem: Problem, last: StepResult, angle: float, neglected: Array, ratio: Array, is_moved: bool
) -> Iterator[str]:
    """Yield a warning for the body in which linear kinematics neglect most.

    `angle` is the largest rotation [radian], `neglected` (n_bodies,) the work on neglected strains [energy], and `ratio`
    (n_bodies,) its magnitude relative to the work on strains [-]. `is_moved` is whether motions are prescribed.
    """
    mesh = problem.model.mesh
    worst = int(np.argmax(ratio))
    error = float(ratio[worst]) * (FORCE_ERROR if is_moved else DISPLACEMENT_ERROR)
    if error > WARNING_RATIO:
        name = body_name(mesh, bodies(mesh)[1], worst)
        amount = f"{'up to' if is_moved else 'about'} {error:.0%}" if error <= 1.0 else "100% or more"
        yield (
            f"rotations of up to {angle:.2g} rad matter in body {name}: linear kinematics neglect strains on which its "
            f"stresses would do work, so that displacements, and forces due to prescribed displacements, may be wrong by "
            f"{amount}. Solve the model with strain='finite'"
        )
        return
    capacity = _frictional_capacity(problem, last)
    # The moment out of balance does twice the neglected work in a rotation. The neglected strain also changes pressures.
    out_of_balance = np.divide(2.0 * np.abs(neglected), capacity, out=np.zeros_like(ratio), where=capacity > 0.0)
    moment_error = ratio + out_of_balance
    worst = int(np.argmax(np.where(capacity > 0.0, moment_error, 0.0)))
    if capacity[worst] > 0.0 and moment_error[worst] > MOMENT_ERROR:
        name = body_name(mesh, bodies(mesh)[1], worst)
        yield (
            f"moments of friction on body {name} are wrong by up to {moment_error[worst]:.1%}: it rotates by {angle:.2g} "
            "rad, and linear kinematics apply forces at undeformed positions. Solve the model with strain='finite'"
        )


def _frictional_capacity(problem: Problem, last: StepResult) -> Array:
    """Return the largest work (n_bodies,) of contact forces with friction in the rigid-body motion of each body [energy].

    It is zero for bodies whose deformation exceeds half of their rotation.
    """
    mesh, dim = problem.model.mesh, problem.model.mesh.dim
    n_bodies, body = bodies(mesh)
    capacity = np.zeros(n_bodies)
    motion, rotation = np.zeros((2, *mesh.points.shape))
    rotating = np.zeros(mesh.n_points, bool)
    for number in range(n_bodies):
        nodes = np.flatnonzero(body == number)
        modes, u = rigid_modes(mesh.points[nodes], problem.model.kinematics), last.displacement[nodes].ravel()
        amplitude = np.linalg.lstsq(modes, u)[0]
        rotation[nodes] = (modes[:, dim:] @ amplitude[dim:]).reshape(-1, dim)
        motion[nodes] = (modes @ amplitude).reshape(-1, dim)
        rotating[nodes] = np.linalg.norm(u - motion[nodes].ravel()) < 0.5 * np.linalg.norm(rotation[nodes])
    for name, pair in problem.pairs.items():
        contact, friction = last.contact[name], pair.friction or 0.0
        sides = (contact.points, contact.force_vectors), (contact.primary_points, contact.primary_force_vectors)
        for points, force in sides if friction else ():
            distance = np.maximum(np.linalg.norm(motion[points], axis=1), np.linalg.norm(rotation[points], axis=1))
            friction_work = friction * np.linalg.norm(force, axis=1) * distance
            work = np.maximum(friction_work, np.abs((force * motion[points]).sum(axis=1)))
            np.add.at(capacity, body[points], rotating[points] * work)
    return capacity


def _work_on_strains(problem: Problem, last: StepResult) -> tuple[Array, Array]:
    """Return the work of stresses on neglected strains, and the integral of their absolute work density on linear strains.

    Both are arrays (n_bodies,) [energy].
    """
    mesh, axisymmetric = problem.model.mesh, problem.model.kinematics == "axisymmetric"
    n_bodies, body = bodies(mesh)
    neglected, work_by_body = np.zeros((2, n_bodies))
    for name, rows in cell_portions(mesh):
        (N, dN, weights), cells = elements.get(name).tables, mesh.cells[name][rows]
        gradient, volume = slopes_at(last.displacement[cells], mesh.points[cells], dN)
        stress, volume = N @ last.stress[cells], np.abs(volume) * weights
        stress_tensor = stress[..., VOIGT[mesh.dim]]
        strain_work = np.einsum("cqij,cqij->cq", stress_tensor, gradient)
        if axisymmetric:
            radius, radial_u = (values[cells][..., 0] @ N.T for values in (mesh.points, last.displacement))
            volume, strain_work = volume * radius, strain_work + stress[..., 2] * radial_u / radius
        rotation = 0.5 * (gradient - gradient.transpose(0, 1, 3, 2))
        # The neglected strain is 0.5 Q.T @ Q = -0.5 Q @ Q, since the rotation Q is antisymmetric.
        neglected_work = -0.5 * np.einsum("cqij,cqij->cq", stress_tensor, rotation @ rotation)
        strain, rotated = (np.einsum("cqij,cqij->cq", part, part) for part in (gradient - rotation, rotation))
        neglected_work[strain < SINGLE_PRECISION**2 * rotated] = 0.0  # stresses of a rigid-body motion are round-off
        np.add.at(neglected, body[cells[:, 0]], (neglected_work * volume).sum(axis=1))
        np.add.at(work_by_body, body[cells[:, 0]], (np.abs(strain_work) * volume).sum(axis=1))
    return neglected, work_by_body
