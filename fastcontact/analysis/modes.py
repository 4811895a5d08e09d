"""Modes: frequencies and shapes of small vibrations about a converged load step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import bsr_array

from fastcontact._jit import parallel
from fastcontact._tools.argument_types import typed
from fastcontact._tools.records import record
from fastcontact.analysis.criteria import NOTABLE
from fastcontact.analysis.modal.cyclic import Sectors, Wave, complex_eigenpairs, open_sector
from fastcontact.analysis.modal.eigenpairs import Reduced, lowest_eigenpairs
from fastcontact.analysis.modal.held_contact import Conditions, assembled, contact_stiffness, held_contact
from fastcontact.analysis.modal.shapes import Modes
from fastcontact.analysis.problem import near_nullspace
from fastcontact.analysis.stages import stage_of
from fastcontact.arrays import AnyArray, Array, Mask
from fastcontact.contact.held_motions import HeldMotions
from fastcontact.elasticity.constrained_system import System
from fastcontact.elasticity.mass import mass, stress_stiffness
from fastcontact.elasticity.material_field import MaterialField
from fastcontact.elasticity.multipoint_constraints import MultiPointConstraint
from fastcontact.elasticity.recovery import CellStress
from fastcontact.elasticity.springs import with_springs
from fastcontact.elasticity.stiffness import stiffness
from fastcontact.errors import ModelError, warn
from fastcontact.linear import choice
from fastcontact.linear.sparse_rows import stacked_rows, sum_of_blocks
from fastcontact.model.model import Model
from fastcontact.results.step import StepResult
from fastcontact.round_off import SINGLE_PRECISION


@typed(ModelError)
@parallel.on_one_blas_thread
def modes(
    model: Model,
    step: StepResult | None = None,
    n: int = 10,
    *,
    stress_stiffening: bool = True,
    hold_sliding: bool = False,
    nodal_diameters: int | str | Sequence[int] | None = None,
    linear_solver: str = "auto",
) -> Modes:
    """Return the lowest natural frequencies and mode shapes about the equilibrium of a load step, or at rest.

    Closed nodes remain closed, sticking nodes do not slip, sliding nodes are free along the surface, and open nodes
    are free. Supports, multi-point constraints, couplings and springs act as in the step, and pretension sections keep
    their length. The stresses of the step stiffen or soften the bodies, and contact forces follow the surfaces; in finite
    strain the modes are those of the deformed bodies under follower pressures. Force-driven obstacles have no mass.

    Parameters
    ----------
    model : Model
        Its materials need densities. Bodies may be free.
    step : StepResult, optional
        A step of this model, from `solve` or a result file. Without it the model is free of stress, and only tied and
        bilateral pairs connect bodies.
    n : int
        Number of modes, for each number of nodal diameters; a pair of modes counts once.
    stress_stiffening : bool
        Whether to include the stresses of the step, and the rotation of its pressures and contact forces.
    hold_sliding : bool
        Whether to treat nodes that slide in the step as sticking, as friction does when a vibration reverses the slip.
        Otherwise a body that slides along its whole circumference, such as a tightened bolt, is free to rotate.
    nodal_diameters : int, sequence of int or "all", optional
        Numbers of nodal diameters of the whole ring, for a model with one cyclic symmetry: from 0 to half the number
        of sectors. The modes are then those of the ring; except for 0 and half the number of sectors they occur in
        pairs of equal frequency. By default the motion is the same in all sectors, as with 0 nodal diameters, and a
        warning is given.
    linear_solver : str
        As for `solve`: the Lanczos method with a direct solver, conjugate gradients (LOBPCG) with multigrid.

    Returns
    -------
    Modes

    Raises
    ------
    ModelError
        If a density is missing, the step belongs to another mesh, bodies have yielded in it, the equilibrium is unstable,
        or there are fewer than n modes.
    ConvergenceError
        If the eigenvalue iteration does not converge.

    Examples
    --------
    >>> import fastcontact as fc
    >>> model = fc.Model(fc.generate.block((1.0, 0.1), (10, 1), "quad8"), "plane_stress")
    >>> model.add_material(fc.LinearElastic(E=1.0, nu=0.0, density=1.0))
    >>> model.fix("LEFT", "xy")
    >>> round(float(fc.modes(model, n=1).frequencies[0]), 4)  # of a slender beam: 0.0161
    0.0161
    """
    if n < 1:
        raise ModelError(f"n = {n} modes: request one or more")
    if step is not None and step.displacement.shape != model.mesh.points.shape:
        raise ModelError(
            f"the step has displacements of shape {step.displacement.shape}, but the mesh points of shape "
            f"{model.mesh.points.shape}: use a step of this model"
        )
    model = stage_of(model, step)
    sectors = Sectors.of(model)
    diameters = _diameters(model, sectors, nodal_diameters)
    vibration = _Vibration.of(model, sectors, step if stress_stiffening else None, step, hold_sliding)
    waves = [Wave(sectors, d) for d in ([0] if diameters is None else diameters)]
    eigenpairs = [(wave, *vibration.eigenpairs(wave, n, linear_solver)) for wave in waves]
    if diameters is None:
        vibration.warn_of_sliding_modes(*eigenpairs[0][1:])
    result = _modes(vibration, sectors, eigenpairs, whole_ring=diameters is not None)
    if result.unstable.any():
        warn(f"{result.remarks()[0]}: the loads exceed a buckling load, or nodes slide (hold_sliding=True)")
    return result


def _diameters(model: Model, sectors: Sectors, requested: int | str | Sequence[int] | None) -> list[int] | None:
    """Return the requested nodal diameters; None by default. ModelError if the model is not a sector of a ring."""
    if requested is None:
        if sectors.number > 1:
            warn(
                f"only modes with 0 nodal diameters are computed, which are alike in all {sectors.number} sectors: request "
                'all modes of the ring with nodal_diameters="all"'
            )
        return None
    if sectors.number == 1:
        raise ModelError("nodal diameters need a sector of a ring: name its ends by Model.add_cyclic_symmetry")
    if model.force_driven.pairs:
        raise ModelError(
            f"obstacle '{model.force_driven.pairs[0].name}' is driven by a force but not part of a sector, so that "
            "modes with nodal diameters cannot include it: prescribe its motion"
        )
    return sectors.diameters(requested)


@record
class _Vibration:
    """Matrices of small motions: stiffness K [force / length], mass M [mass], conditions of contact, and the shift of K."""

    model: Model
    field: MaterialField
    K: bsr_array
    M: bsr_array
    contact: list[Conditions]
    supported: Mask
    shift: float
    with_sliding: list[Conditions]  # conditions that hold sliding nodes as well; empty if no node slides

    @classmethod
    def of(
        cls, model: Model, sectors: Sectors, stressed: StepResult | None, step: StepResult | None, hold_sliding: bool
    ) -> _Vibration:
        """Return the vibration about a step, open at the ends of sectors; the stresses of `stressed` add stiffness."""
        field = model.material_field()
        K, M = _stiffness(model, stressed, field), mass(model.mesh, model.kinematics, model.densities())
        if not M.data.any():
            raise ModelError(
                "all densities are zero, and a massless model has no modes: give the materials density=..."
            )
        supported, _ = model.prescribed_by_ramp()
        model = open_sector(model, sectors)
        held = HeldMotions.of(supported, stacked_rows(model.relations, model.n_dofs))
        contact = held_contact(model, step, held, hold_sliding)
        slides = step is not None and any((pair.active & ~pair.sticking).any() for pair in step.contact.values())
        with_sliding = held_contact(model, step, held, True) if slides and not hold_sliding else []
        # The shift regularises the stiffness of free bodies. It also makes slightly negative eigenvalues positive, which
        # occur in loaded bodies that rotate freely. The corresponding frequency is NOTABLE times that of a uniform
        # deformation, which is below the frequencies of all but thin bodies.
        shift = NOTABLE**2 * _uniform_quotient(model, K, M)
        K = model.force_driven.stiffness(K)
        if stressed is not None:
            K = sum_of_blocks(K, contact_stiffness(model, stressed, held))
        return cls(model, field, K, M, contact, supported, shift, with_sliding)

    def warn_of_sliding_modes(self, values: Array, vectors: Array) -> None:
        """Warn of eigenvalues (n,) close to zero whose shapes (n_dofs, n) slide where friction holds small motions."""
        rigid = vectors[:, np.abs(values) < self.shift]
        rows = [conditions.rows for conditions in self.with_sliding]
        sliding = [np.abs(B @ rigid) > SINGLE_PRECISION * (abs(B) @ np.abs(rigid)).max(initial=0.0) for B in rows]
        if rigid.shape[1] and (count := int(np.any([slides.any(axis=0) for slides in sliding], axis=0).sum())):
            warn(
                f"{count} of {len(values)} modes have frequencies close to zero (the lowest {_frequencies(values)[0]:.3g}), "
                "since nodes that slide in this step are free along the surface: hold_sliding=True holds them, as friction "
                "does in small motions"
            )

    def eigenpairs(self, wave: Wave, n: int, linear_solver: str) -> tuple[Array, AnyArray]:
        """Return the n lowest eigenvalues (n,) and the displacements (n_dofs, n) of a wave, real for standing waves."""
        model, driven = self.model, self.model.force_driven
        # Pretension sections keep their current length.
        locked_lengths = [MultiPointConstraint(bolt.name, bolt.row(model.n_dofs)) for bolt in model.pretensions]
        relations = driven.relations(wave.relations(model, [*model.relations, *locked_lengths]))
        K, M = wave.real_block_form(self.K), wave.real_block_form(driven.stiffness(self.M))
        nullspace = driven.near_nullspace(near_nullspace(model))
        nullspace = nullspace if wave.is_standing else np.asarray(np.kron(np.eye(2), nullspace), float)
        contact = assembled(map(wave.ring_conditions, self.contact), K.shape[0])
        K = contact.stiffened(K)
        in_conditions = np.isin(np.arange(K.shape[0]), contact.rows.indices)
        without_stiffness = wave.repeated(driven.without_stiffness) & in_conditions
        system = System(K, wave.repeated(driven.supported(self.supported).ravel()), relations, without_stiffness)
        reduced = Reduced(system, M, contact.rows, contact.nodes)
        count, n_free = n if wave.is_standing else 2 * n, int(reduced.free.sum())
        if count >= n_free:
            raise ModelError(f"n = {count} modes of {n_free} free displacements: request fewer")
        solver = choice.make(linear_solver, dim=model.mesh.dim, n_dofs=K.shape[0], needs_columns=True)
        solver.contrast = self.field.contrast
        free_nullspace = np.where(reduced.free[:, None], nullspace, 0.0)
        values, v = lowest_eigenpairs(solver, (reduced.K, reduced.M), free_nullspace, reduced.free, count, self.shift)
        vectors = reduced.displacement(v)
        return (values, vectors) if wave.is_standing else complex_eigenpairs(vectors, K, M, n)


def _stiffness(model: Model, step: StepResult | None, field: MaterialField) -> bsr_array:
    """Return the stiffness (n_dofs, n_dofs) of cells and springs, with that of the stresses and loads of a step.

    Its unit is [force / length].
    """
    mesh, kinematics, bodies = model.mesh, model.kinematics, model.nonlinear_bodies(field)
    if step is None or bodies is None or not bodies.finite:
        K = stiffness(mesh, kinematics, field.moduli, field.moduli_rows, None, field.treatment)
        K = with_springs(K, model.springs)
    if step is None:
        return K
    names = ("temperature", "initial", "pressure", "spin")
    temperature, initial, pressures, spins = (step.iterations.get(f"{name}_factors", ()) for name in names)
    deformation = np.zeros_like(step.displacement)
    if bodies is not None and bodies.yields:
        plastic_strain = step.cell_fields.get("plastic_strain")
        if plastic_strain is None or plastic_strain.any():
            raise ModelError(
                "bodies have yielded in this step, and modes about it are not available: stress_stiffening=False returns "
                "those of the undeformed elastic bodies, with the contact of the step"
            )
    if bodies is not None and bodies.finite:
        deformation, rise = step.displacement, model.expanding_rise(temperature, step.temperature)
        K = with_springs(bodies.at(deformation, bodies.initial_history, rise=rise).K, model.springs)
    else:
        offset = model.stress_offset(temperature, initial, field, step.temperature)
        stresses = CellStress(mesh, kinematics, field.moduli, step.displacement, field.treatment, offset)
        K = sum_of_blocks(K, stress_stiffness(mesh, stresses, field.moduli_rows, kinematics == "axisymmetric"))
    for factor, (following, _) in zip([*pressures, *spins], model.following_loads()):
        K = sum_of_blocks(K, factor * following.at(deformation)[1])
    return K


def _uniform_quotient(model: Model, K: bsr_array, M: bsr_array) -> float:
    """Return the least Rayleigh quotient [1 / time^2] of uniform deformations, each linear in one coordinate."""
    points = model.mesh.points - model.mesh.points.mean(axis=0)
    u = np.kron(points, np.eye(model.mesh.dim))  # a column for each coordinate and component
    quotients = (u * (K @ u)).sum(axis=0) / (u * (M @ u)).sum(axis=0)
    return float(min(quotients[quotients > 0.0], default=1.0))


def _modes(
    vibration: _Vibration, sectors: Sectors, eigenpairs: list[tuple[Wave, Array, AnyArray]], *, whole_ring: bool
) -> Modes:
    """Return modes from the eigenvalues (n,) [1 / time^2] and displacements (n_dofs, n) of each wave.

    They are those of the whole ring or of the modelled sector. The largest component of standing waves is positive.
    """
    n_dofs, dim = vibration.M.shape[0], vibration.model.mesh.dim
    velocities = np.tile(np.eye(dim), (n_dofs // dim, 1))  # uniform, along each axis
    if vibration.model.kinematics == "axisymmetric":
        velocities[:, 0] = 0.0  # cancels over the full circle
    momentum, number = np.asarray(vibration.M @ velocities), sectors.number if whole_ring else 1
    rotations = [np.linalg.matrix_power(sectors.turn, k) for k in range(number)]
    values: list[float] = []
    shapes, participation, diameters, twins = [], [], [], []
    for wave, eigenvalues, displacements in eigenpairs:
        vectors = displacements[:n_dofs]  # without those of obstacles
        peaks = vectors[np.abs(vectors).argmax(axis=0), np.arange(vectors.shape[1])]
        vectors = vectors * (np.sign(peaks) if wave.is_standing else np.sqrt(2.0)) / np.sqrt(number)
        phases = np.exp(1j * wave.angle * np.arange(number))
        ring_momentum = np.einsum("nd,k,ked->ne", vectors.T @ momentum, phases, rotations)
        for value, vector, momentum_of_mode in zip(eigenvalues.tolist(), vectors.T, ring_momentum, strict=True):
            first = len(values)
            twins += [first] if wave.is_standing else [first + 1, first]
            for component in (np.real,) if wave.is_standing else (np.real, np.imag):
                values.append(value)
                diameters.append(wave.diameters)
                shapes.append(component(vector).reshape(-1, dim))
                participation.append(component(momentum_of_mode))
    mass = number * np.einsum("nii->i", momentum.reshape(-1, dim, dim))
    eigenvalues, ring = np.array(values), (np.array(diameters), np.array(twins), sectors)
    return Modes(
        _frequencies(eigenvalues), eigenvalues, np.array(shapes), np.array(participation), mass, vibration.model,
        vibration.field, *(ring if whole_ring else ()),
    )  # fmt: skip


def _frequencies(eigenvalues: Array) -> Array:
    return np.asarray(np.sign(eigenvalues) * np.sqrt(np.abs(eigenvalues)) / (2.0 * np.pi))
