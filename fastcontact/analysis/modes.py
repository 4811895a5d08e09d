"""Modes: frequencies and shapes of small vibrations about a settled load step."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import bsr_array

from fastcontact._jit import parallel
from fastcontact.analysis.modal.eigenpairs import lowest
from fastcontact.analysis.modal.held_contact import held_contact
from fastcontact.analysis.modal.reduced import Reduced
from fastcontact.analysis.problem import near_nullspace
from fastcontact.analysis.stages import at_present_length, stage_of
from fastcontact.arrays import Array
from fastcontact.contact.held_motions import HeldMotions
from fastcontact.elasticity import recovery
from fastcontact.elasticity.cell_stress import CellStress
from fastcontact.elasticity.constrained_system import System
from fastcontact.elasticity.inertia_loads import Densities
from fastcontact.elasticity.mass import mass, stress_stiffness
from fastcontact.elasticity.material_field import MaterialField
from fastcontact.elasticity.multipoint_constraints import stacked_rows
from fastcontact.elasticity.springs import stiffened
from fastcontact.elasticity.stiffness import stiffness
from fastcontact.errors import ModelError
from fastcontact.linear import choice
from fastcontact.mesh.argument_types import typed
from fastcontact.mesh.html_table import html_table
from fastcontact.model.model import Model
from fastcontact.results.conversions import data_frame
from fastcontact.results.step import StepResult

if TYPE_CHECKING:
    import pandas

# The shift that makes free bodies regular, by the eigenvalue of a uniform deformation: below those of all but thin bodies.
SHIFT = 1e-4


@dataclass(frozen=True, eq=False, repr=False)
class Modes(Sequence[StepResult]):
    """Modes of a model: a sequence of shapes, each a `StepResult` for pictures and files, that prints as a table.

    Attributes
    ----------
    frequencies : ndarray (n,)
        Ascending [1 / time]; about zero for rigid motions, negative for shapes that grow by themselves.
    eigenvalues : ndarray (n,)
        Squares of the angular frequencies [1 / time^2].
    shapes : ndarray (n, n_points, dim)
        Displacements of unit modal mass: ``shape . M shape = 1`` [1 / mass^(1/2)].
    participation : ndarray (n, dim)
        Of a uniform acceleration along each axis: ``shape . M e`` [mass^(1/2)].
    mass : ndarray (dim,)
        Of all that moves along each axis [mass]; in axisymmetry zero along the radius.
    """

    frequencies: Array
    eigenvalues: Array
    shapes: Array
    participation: Array
    mass: Array
    _model: Model = field(repr=False)
    _field: MaterialField = field(repr=False)

    @property
    def effective_mass(self) -> Array:
        """Effective modal masses (n, dim) [mass], the squares of the participation factors, whose sum is the total mass."""
        return np.asarray(self.participation**2)

    def __len__(self) -> int:
        return len(self.frequencies)

    def __getitem__(self, index: Any) -> Any:
        """Return a mode as a step: its shape, the stress of that, and the frequency as load factor."""
        if isinstance(index, slice):
            return [self[k] for k in range(*index.indices(len(self)))]
        number, model = range(len(self))[index], self._model
        u = self.shapes[number]
        stress = recovery.nodal_stress(
            model.mesh, model.kinematics, self._field.moduli, self._field.loops, u, self._field.treatment
        )
        equivalent = recovery.von_mises(stress)
        signed = recovery.von_mises_signed(stress, equivalent)
        frequency = float(self.frequencies[number])
        return StepResult(number + 1, frequency, u.copy(), stress, equivalent, signed, np.zeros_like(u))

    def __repr__(self) -> str:
        rows = [self._columns, *self._rows("{:.6g}")]
        widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
        return "\n".join("  ".join(text.rjust(width) for text, width in zip(row, widths)) for row in rows)

    def _repr_html_(self) -> str:
        return html_table(self._rows("{:.6g}"), self._columns, "Modes")

    @property
    def _columns(self) -> tuple[str, ...]:
        return ("mode", "frequency", *(f"effective mass {axis}" for axis in "xyz"[: len(self.mass)]))

    def _rows(self, numbers: str) -> list[tuple[str, ...]]:
        return [
            (str(k + 1), numbers.format(f), *(numbers.format(mass) for mass in masses))
            for k, (f, masses) in enumerate(zip(self.frequencies, self.effective_mass))
        ]

    def to_pandas(self) -> pandas.DataFrame:
        """Return frequencies and effective masses as a ``pandas.DataFrame``; FileError if pandas is not installed."""
        data = np.column_stack([np.arange(1, len(self) + 1), self.frequencies, self.effective_mass])
        return data_frame(data, {}, self._columns).astype({"mode": int})


@typed(ModelError)
@parallel.on_one_blas_thread
def modes(
    model: Model,
    step: StepResult | None = None,
    n: int = 10,
    *,
    stress_stiffening: bool = True,
    hold_sliding: bool = False,
    linear_solver: str = "auto",
) -> Modes:
    """Return the lowest frequencies and shapes of small vibrations, about a settled load step or at rest.

    What contact has closed stays closed, what sticks does not slip, what slides or is open is free; supports, relations,
    couplings and springs hold, with what they prescribe kept, and pretension sections keep their length. Stresses of the step
    stiffen, as in a string, or soften; at finite strains the bodies are those deformed. Obstacles that forces drive have no
    mass.

    Parameters
    ----------
    model : Model
        Its materials need densities. Free bodies are fine.
    step : StepResult, optional
        Of this model, from `solve` or a result file. Without one the model is at rest and without stress, and contact holds
        nothing but tied and bilateral pairs.
    n : int
        How many.
    stress_stiffening : bool
        Whether stresses of the step count.
    hold_sliding : bool
        Whether nodes that slide in the step are held along the surface, too, as friction does as soon as small motions turn
        the slip round. Without, what friction alone holds and slides everywhere, as a bolt that is pressed on all round may,
        is free to turn.
    linear_solver : str
        As for `solve`: by factors the Lanczos method, by multigrid conjugate gradients (LOBPCG).

    Returns
    -------
    Modes

    Raises
    ------
    ModelError
        If a density is missing, the step is of another mesh or of bodies that yield, the step is not stable, or there are
        fewer than n modes.
    ConvergenceError
        If the iteration does not end.

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
        raise ModelError(f"n = {n} modes: ask for one or more")
    if step is not None and step.displacement.shape != model.mesh.points.shape:
        raise ModelError(
            f"the step has displacements of shape {step.displacement.shape}, but the mesh points of shape "
            f"{model.mesh.points.shape}: take a step of this model"
        )
    model = stage_of(model, step)
    density = Densities([material for material, _ in model.materials], model.material_of_cells())
    field, driven = model.material_field(), model.force_driven
    K = _stiffness(model, step if stress_stiffening else None, field)
    M = mass(model.mesh, model.kinematics, density)
    supported, _ = model.prescribed_by_ramp()
    contact = held_contact(
        model, step, HeldMotions.of(supported, stacked_rows(model.relations, model.n_dofs)), hold_sliding
    )
    shift = SHIFT * _uniform(model, K, M)
    relations = driven.relations([*model.relations, *at_present_length(model)])
    K, M = contact.stiffened(driven.stiffness(K)), driven.stiffness(M)
    touched = np.isin(np.arange(K.shape[0]), contact.rows.indices)
    system = System(K, driven.supported(supported).ravel(), relations, driven.without_stiffness & touched)
    reduced = Reduced(system, M, contact.rows, contact.nodes)
    if n >= int(reduced.free.sum()):
        raise ModelError(f"n = {n} modes of {int(reduced.free.sum())} free displacements: ask for fewer")
    solver = choice.make(linear_solver, dim=model.mesh.dim, n_dofs=model.n_dofs, columns=True)
    solver.contrast = field.contrast
    soft = np.where(reduced.free[:, None], driven.near_nullspace(near_nullspace(model)), 0.0)
    values, vectors = lowest(solver, (reduced.K, reduced.M), soft, reduced.free, n, shift)
    return _modes(model, field, M, values, reduced.displacement(vectors))


def _stiffness(model: Model, step: StepResult | None, field: MaterialField) -> bsr_array:
    """Return the stiffness (n_dofs, n_dofs) of cells and springs, with that of the stresses of a step [force / length]."""
    mesh, kinematics = model.mesh, model.kinematics
    bodies = model.nonlinear_bodies(field)
    if bodies is not None and step is not None:
        if model.strain == "small":
            model.refuse_nonlinear("modes about a step are")
        return stiffened(bodies.at(step.displacement, bodies.beginning).K, model.springs)
    K = stiffened(stiffness(mesh, kinematics, field.moduli, field.loops, None, field.treatment), model.springs)
    if step is None:
        return K
    temperature, initial = (step.iterations.get(key, ()) for key in ("temperature_factors", "initial_factors"))
    offset = model.stress_offset(temperature, initial, field, step.temperature)
    stresses = CellStress(mesh, kinematics, field.moduli, step.displacement, field.treatment, offset)
    return bsr_array(K + stress_stiffness(mesh, stresses, field.loops, kinematics == "axisymmetric"))


def _uniform(model: Model, K: bsr_array, M: bsr_array) -> float:
    """Return the least quotient of energies [1 / time^2] of uniform deformations, which grow with one coordinate each."""
    points, densities = model.mesh.points - model.mesh.points.mean(axis=0), []
    for component in range(model.mesh.dim):
        for axis in range(model.mesh.dim):
            u = np.zeros_like(points)
            u[:, component] = points[:, axis]
            densities.append(float(u.ravel() @ (K @ u.ravel())) / float(u.ravel() @ (M @ u.ravel())))
    return min((own for own in densities if own > 0.0), default=1.0)


def _modes(model: Model, field: MaterialField, M: bsr_array, values: Array, vectors: Array) -> Modes:
    """Return modes from eigenvalues (n,) [1 / time^2] and displacements (n_dofs, n), their largest component positive."""
    vectors = vectors * np.sign(vectors[np.abs(vectors).argmax(axis=0), np.arange(len(values))])
    dim, count = model.mesh.dim, model.n_dofs
    along = np.tile(np.eye(dim), (len(vectors) // dim, 1))
    if model.kinematics == "axisymmetric":
        along[:, 0] = 0.0  # around the circle it has every direction
    momentum = M @ along
    frequencies = np.sign(values) * np.sqrt(np.abs(values)) / (2.0 * np.pi)
    shapes = vectors[:count].T.reshape(len(values), -1, dim)
    return Modes(frequencies, values, shapes, vectors.T @ momentum, np.diag(along.T @ momentum), model, field)
