"""Bodies with nonlinear material laws or finite strains: internal forces, consistent tangent and history."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

import numpy as np
from scipy.sparse import bsr_array

from fastcontact._jit import parallel
from fastcontact._tools.records import record
from fastcontact.arrays import Array, Numbers
from fastcontact.elasticity import dilatation
from fastcontact.elasticity.constitutive_kernels import LINEAR, LOGARITHMIC, PLASTIC, SAINT_VENANT
from fastcontact.elasticity.dilatation import BULK_TO_SHEAR
from fastcontact.elasticity.energy import cell_volumes, gradients_at
from fastcontact.elasticity.material_field import MaterialField, material_field
from fastcontact.elasticity.materials import LinearElastic, Material
from fastcontact.elasticity.nonlinear_materials import ElasticPlastic, NonlinearElastic
from fastcontact.elasticity.recovery import CELLS_AT_ONCE, von_mises
from fastcontact.elasticity.stiffness import Sparsity, sparsity
from fastcontact.errors import ConvergenceError, ModelError
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import Mesh

History = dict[str, Array]
# Number of history variables at a quadrature point, and the indices of the equivalent plastic strain and, in plane stress,
# of F_zz - 1 among them; see `constitutive_kernels`.
N_HISTORY, PLASTIC_STRAIN, OUT_OF_PLANE = 9, 6, 8
# Value of the argument `geometric` for the complete tangent, see `NonlinearBodies.at`.
COMPLETE = 2


@record
class DeformedBodies:
    """Response of the bodies to a displacement.

    Attributes
    ----------
    tangent : callable
        Function without arguments that returns the tangent stiffness K.
    force : ndarray (n_points, dim)
        Internal forces [force].
    history : dict of str to ndarray (n_cells, n_q, 9)
        History variables by solid element type, at the end of a load step with this displacement.
    stress : dict of str to ndarray (n_cells, n_q, n_components)
        Cauchy stress by solid element type [pressure].
    energy, plastic_work : float
        Elastic energy, and plastic work that has been done since the beginning of the analysis [energy].
    """

    tangent: Callable[[], bsr_array]
    force: Array
    history: History
    stress: History
    energy: float
    plastic_work: float

    @cached_property
    def K(self) -> bsr_array:
        """Tangent stiffness (n_dofs, n_dofs) [force / length]."""
        return self.tangent()


class NonlinearBodies:
    """The solid cells of a model with nonlinear material laws or finite strains; see `body_kernels`.

    Parameters
    ----------
    mesh : Mesh
    kinematics : str
    strain : {"small", "finite"}
    field : MaterialField
        Materials of the model.
    """

    def __init__(self, mesh: Mesh, kinematics: str, strain: str, field: MaterialField) -> None:
        self.mesh, self.kinematics, self.finite = mesh, kinematics, strain == "finite"
        if kinematics == "plane_stress":  # the kernels compute the out-of-plane strain from the law
            field = material_field(mesh, "plane_strain", field.materials, field.material_numbers)
        self._materials, self._owner = field.materials, field.owner
        size = field.moduli.shape[1]
        self._moduli, self._expansion = np.zeros((len(field.moduli), 6, 6)), np.zeros((len(field.moduli), 6))
        self._moduli[:, :size, :size], self._expansion[:, :size] = field.moduli, np.nan_to_num(field.expansion)
        self._moduli_rows = {name: _rows_at_points(field.moduli_rows[name], name) for name in mesh.solids}
        self._averaged = field.averaged & (kinematics != "plane_stress")
        self._constants = self._constants_of_laws()
        self._splits = {name: self._split(name) for name in mesh.solids}
        self._pattern: Sparsity = sparsity(mesh)
        self._blocks = len(self._pattern.indices), mesh.dim, mesh.dim

    def _constants_of_laws(self) -> Array:
        """Return the constants (n_moduli, n_constants) of the laws for `constitutive_kernels`."""
        hooke = SAINT_VENANT if self.finite else LINEAR
        by_law = [law.constants if isinstance(law, NonlinearElastic) else [hooke] for law in self._materials]
        rows = np.zeros((len(by_law), max(4, *map(len, by_law))))
        for row, constants in zip(rows, by_law, strict=True):
            row[: len(constants)] = constants
            if self.finite and constants[0] == PLASTIC:
                row[0] = LOGARITHMIC
        return np.ascontiguousarray(rows[self._owner])

    @property
    def yields(self) -> bool:
        """Whether one of the materials is elastic-plastic."""
        return any(isinstance(law, ElasticPlastic) for law in self._materials)

    @property
    def halving_estimates_error(self) -> bool:
        """Whether `change_if_halved` estimates the error of the plastic flow.

        There is no such estimate in plane stress, where the out-of-plane strain changes the strain path when yielding begins.
        """
        return self.yields and self.kinematics != "plane_stress"

    @property
    def _has_history(self) -> bool:
        """Whether the history may change."""
        return self.yields or self.kinematics == "plane_stress"

    @property
    def initial_history(self) -> History:
        """The history before the first load step."""
        return {name: np.zeros((*rows.shape, N_HISTORY)) for name, rows in self._moduli_rows.items()}

    def _split(self, name: str) -> tuple[Array, Array, Array]:
        """Return the moduli for an element type, and bulk moduli (n_moduli, 2) and polynomials (n_q, m) for its dilatation.

        The two columns of bulk moduli add up to the bulk modulus: the first multiplies the projected dilatation, and the
        second the unprojected one, unlike in `dilatation.Split`. If the dilatation is projected, the moduli do not contain
        them.
        """
        moduli, element = self._moduli.copy(), elements.get(name)
        bulk = np.zeros((len(moduli), 2))
        bulk[:, 1] = self._constants[:, 2]
        is_hookean = np.isin(self._constants[:, 0], (LINEAR, SAINT_VENANT))
        projected = self._averaged & (element.dilatation is not None) & (self._constants[:, 0] != SAINT_VENANT)
        bulk_moduli = moduli[:, :3, :3].sum(axis=(1, 2)) / 9.0
        subtracted_bulk = np.where(projected & is_hookean, bulk_moduli, 0.0)
        moduli[:, :3, :3] -= subtracted_bulk[:, None, None]
        bulk[:, 1] += subtracted_bulk
        shear = np.where(is_hookean, moduli[:, 3, 3], self._constants[:, 1])
        remainder = 0.0 if element.dilatation == element.order - 1 else np.minimum(bulk[:, 1], BULK_TO_SHEAR * shear)
        bulk[projected] = np.column_stack([bulk[:, 1] - remainder, np.broadcast_to(remainder, len(bulk))])[projected]
        polynomials = dilatation.basis(name, element.quadrature[0])
        if element.dilatation == 0 and (bulk[:, 1] > 0.0).any():  # because the remainder is not a linear function
            polynomials = polynomials[:, :1]
        return moduli, bulk, np.ascontiguousarray(polynomials)

    def at(
        self, displacement: Array, old_history: Mapping[str, Array], *, rise: Array | None = None, geometric: int = COMPLETE,
        tangent: bool = True,
    ) -> DeformedBodies:  # fmt: skip
        """Return the response to a displacement, with internal forces, stresses, history and tangent.

        Parameters
        ----------
        displacement : ndarray (n_points, dim)
            Displacements [length].
        old_history : mapping of str to ndarray (n_cells, n_q, 9)
            History at the beginning of the load step, by solid element type.
        rise : ndarray (n_points,), optional
            Temperature rise above the reference temperature; zero by default [temperature].
        geometric : int
            2 for the complete tangent, 1 without the second derivative of J, 0 also without the initial-stress stiffness; see
            `body_kernels.linearise`. With 0, the tangent is positive definite farther from the solution, and also if the
            rotation of a loaded body is prevented by contact alone.
        tangent : bool
            Whether K is computed at once. Otherwise, it is computed when it is first used, which halves the time if K is not
            used, and increases it by half if it is.

        Raises
        ------
        ConvergenceError
            If a cell is inverted, or if the iteration for plane stress does not converge at a point.
        """
        data = np.zeros((0, *self._blocks[1:]))
        if tangent:
            data = np.zeros(self._blocks) if self.finite else self._elastic.copy()
        return self._response(displacement, old_history, rise, geometric, data, not self.finite)

    @cached_property
    def _elastic(self) -> Array:
        """Blocks (n_blocks, dim, dim) of the tangent without plastic flow at small strains [force / length]."""
        data = np.zeros(self._blocks)
        self._response(np.zeros_like(self.mesh.points), self.initial_history, None, COMPLETE, data, False)
        return data

    def _response(
        self, displacement: Array, old_history: Mapping[str, Array], rise: Array | None, geometric: int, data: Array,
        elastic: bool,
    ) -> DeformedBodies:  # fmt: skip
        """Return the result of `at`, and add the tangent to `data` (n_blocks, dim, dim); see `body_kernels.linearise`."""
        from fastcontact.elasticity import body_kernels  # most models are linear

        mesh, dim, pattern = self.mesh, self.mesh.dim, self._pattern
        history, stress, force, energy = {}, {}, np.zeros((mesh.n_points, dim)), np.zeros(2)
        rise_or_empty = np.zeros(0) if rise is None else rise
        flags = self.kinematics == "axisymmetric", self.kinematics == "plane_stress", self.finite, geometric
        for name, cells in mesh.solids.items():
            N, dN, weights = elements.get(name).tables
            moduli, bulk, polynomials = self._splits[name]
            owner, row_ranges = pattern.owners(mesh, name)
            cauchy = np.empty((*old_history[name].shape[:2], 6 if dim == 3 else 4))
            new = np.empty_like(old_history[name]) if self._has_history else old_history[name][:0]
            energies, moduli_rows = np.zeros((len(cells), 2)), self._moduli_rows[name]
            slots, old = pattern.slots[name], old_history[name]

            def linearise_part(number: int) -> tuple[int, int]:
                rows = slice(*row_ranges[number])  # noqa: B023
                status, cell = body_kernels.linearise(
                    mesh.points, cells[rows], N, dN, weights, polynomials, *flags, displacement, self._constants, moduli,  # noqa: B023
                    bulk, self._expansion, rise_or_empty, moduli_rows[rows], old[rows], slots[rows], owner,  # noqa: B023
                    number, elastic, data, force, new[rows], cauchy[rows], energies[rows],  # noqa: B023
                )  # fmt: skip
                return status, int(cell) + rows.start

            for status, cell in parallel.parallel_map(linearise_part, range(len(row_ranges))):
                if status:
                    raise ConvergenceError(self._failure(status, name, cell, displacement))
            history[name], stress[name] = new if self._has_history else old_history[name], cauchy
            energy += energies.sum(axis=0)
        size = mesh.n_points * dim

        def assembled_tangent() -> bsr_array:
            if not len(data):
                return self.at(displacement, old_history, rise=rise, geometric=geometric).K
            return bsr_array((data, pattern.indices, pattern.indptr), shape=(size, size))

        return DeformedBodies(assembled_tangent, force, history, stress, float(energy[0]), float(energy[1]))

    def change_if_halved(
        self, middle: Array, end: Array, old_history: Mapping[str, Array], bodies: DeformedBodies
    ) -> tuple[float, float]:
        """Return the norm of the stresses at points that yield in a step, and that of their change if the step is halved.

        The norm is the Euclidean norm. The change is an estimate of the error of the radial return, which is exact if the
        direction of plastic flow does not change in the step.

        Parameters
        ----------
        middle, end : ndarray (n_points, dim)
            Displacements in the middle and at the end of the step [length].
        old_history : mapping of str to ndarray (n_cells, n_q, 9)
            History at the beginning of the step, by solid element type.
        bodies : DeformedBodies
            The response at the end of the step.

        Returns
        -------
        size, change : float
            Both are zero if no point yields, or if a cell is inverted in the middle of the step [pressure].
        """
        flowing = {k: bodies.history[k][..., PLASTIC_STRAIN] > h[..., PLASTIC_STRAIN] for k, h in old_history.items()}
        if not any(points.any() for points in flowing.values()):
            return 0.0, 0.0
        try:
            halved_bodies = self.at(end, self.at(middle, old_history, tangent=False).history, tangent=False)
        except ConvergenceError:
            return 0.0, 0.0
        weights = np.sqrt([1.0, 1.0, 1.0, 2.0, 2.0, 2.0][: 2 * self.mesh.dim])  # of components in the norm of a tensor
        stresses = (bodies.stress, halved_bodies.stress)
        parts = [[(s[name][points] * weights).ravel() for name, points in flowing.items()] for s in stresses]
        stress, halved_stress = map(np.concatenate, parts)
        return float(np.linalg.norm(stress)), float(np.linalg.norm(halved_stress - stress))

    def _failure(self, status: int, name: str, cell: int, displacement: Array) -> str:
        """Return the message for a nonzero status of `body_kernels.linearise`."""
        from fastcontact.elasticity import body_kernels

        centre = self.mesh.points[self.mesh.cells[name][cell]].mean(axis=0)
        J = np.linalg.det(self._deformation(name, slice(cell, cell + 1), displacement)).min()
        failure = f"is inverted (J = {J:.3g})"
        if status != body_kernels.INVERTED:
            failure = "has no out-of-plane strain for which the out-of-plane stress is zero"
        return f"cell {cell} of {name} near {centre} {failure}: try smaller load steps, or a coarser mesh at this point"

    def _deformation(self, name: str, rows: slice, displacement: Array) -> Array:
        """Return the deformation gradients (n, n_q, 3, 3) [-] of cells, with F_zz = 1 in plane stress."""
        N, dN, _ = elements.get(name).tables
        nodes, dim = self.mesh.cells[name][rows], self.mesh.dim
        points, u = self.mesh.points[nodes], displacement[nodes]
        F = np.tile(np.eye(3), (len(nodes), len(N), 1, 1))
        F[..., :dim, :dim] += np.einsum("cai,cqaj->cqij", u, gradients_at(points, dN)[0], optimize=True)
        if self.kinematics == "axisymmetric":
            F[..., 2, 2] += (u[..., 0] @ N.T) / (points[..., 0] @ N.T)
        return F

    def cell_fields(self, bodies: DeformedBodies, displacement: Array) -> dict[str, Array]:
        """Return the fields of `field_names` (n_solids,): the volume ratio of each cell, and extremes over its points."""
        fields = {name: self._fields(name, bodies, displacement) for name in self._moduli_rows}
        names = field_names(self._materials, "finite" if self.finite else "small")
        return {name: np.concatenate([field[i] for field in fields.values()]) for i, name in enumerate(names)}

    def _fields(self, name: str, bodies: DeformedBodies, displacement: Array) -> list[Array]:
        """Return the values (n_cells,) of `field_names` for the cells of an element."""
        J, fields = np.ones(self._moduli_rows[name].shape), list[Array]()
        if self.finite:
            J, *fields = self._strains(name, bodies, displacement)
        if self.yields:
            fields += self._plastic_fields(name, bodies, J)
        return fields

    def _strains(self, name: str, bodies: DeformedBodies, displacement: Array) -> list[Array]:
        """Return J (n_cells, n_q), the volume ratios (n_cells,), and the extreme logarithmic strains (n_cells,)."""
        (N, dN, weights), cells, results = elements.get(name).tables, self.mesh.cells[name], []
        for first in range(0, len(cells), CELLS_AT_ONCE):
            rows = slice(first, first + CELLS_AT_ONCE)
            F = self._deformation(name, rows, displacement)
            if self.kinematics == "plane_stress":
                F[..., 2, 2] += bodies.history[name][rows, :, OUT_OF_PLANE]
            J, squared = np.linalg.det(F), np.linalg.eigvalsh(np.swapaxes(F, 2, 3) @ F)
            volume = cell_volumes(self.mesh.points[cells[rows]], N, dN, self.kinematics == "axisymmetric") * weights
            ratio = (volume * J).sum(axis=1) / volume.sum(axis=1)
            low, high = 0.5 * np.log(squared[..., 0].min(axis=1)), 0.5 * np.log(squared[..., 2].max(axis=1))
            results.append((J, ratio, np.where(high >= -low, high, low)))
        return [np.concatenate(parts) for parts in zip(*results, strict=True)]

    def _plastic_fields(self, name: str, bodies: DeformedBodies, J: Array) -> list[Array]:
        """Return the largest equivalent plastic strain and the largest ratio of stress to yield stress (n_cells,) in cells.

        The yield condition refers to the Kirchhoff stress, which is J (n_cells, n_q) times the Cauchy stress.
        """
        history, owner = bodies.history[name], self._owner[self._moduli_rows[name]]
        strain = history[..., PLASTIC_STRAIN]
        ratio = np.zeros(strain.shape)
        for index, law in enumerate(self._materials):
            if isinstance(law, ElasticPlastic):
                rows = owner == index
                stress = J[rows][:, None] * bodies.stress[name][rows]
                relative = stress - 2.0 / 3.0 * law.kinematic * history[rows][:, : stress.shape[1]]
                ratio[rows] = von_mises(relative) / law.yield_at(strain[rows])
        return [strain.max(axis=1), ratio.max(axis=1)]


def field_names(materials: Sequence[Material], strain: str) -> tuple[str, ...]:
    """Return the names of the cell fields for given materials and strains; there are none for linear bodies."""
    plastic = ("plastic_strain", "yield_ratio") if any(isinstance(law, ElasticPlastic) for law in materials) else ()
    return (*(("J", "logarithmic_strain") if strain == "finite" else ()), *plastic)


def check_law(law: Material, strain: str) -> None:
    """Raise ModelError if a material does not support the kind of `strain`, ``"small"`` or ``"finite"``."""
    if isinstance(law, NonlinearElastic) and strain not in law.strains:
        raise ModelError(f"{type(law).__name__} requires finite strains: use Model(..., strain='finite')")
    if strain == "finite" and isinstance(law, ElasticPlastic) and law.kinematic:
        raise ModelError("kinematic hardening requires small strains: omit kinematic, or strain='finite'")
    if law.incompatible_modes and (strain == "finite" or isinstance(law, NonlinearElastic)):
        raise ModelError("incompatible modes are available only for linear bodies: omit incompatible_modes")
    if strain == "finite" and not isinstance(law, NonlinearElastic) and law.averaged:
        example = "NeoHookean(E=..., nu=...)" if isinstance(law, LinearElastic) else "a hyperelastic law"
        raise ModelError(f"a nearly incompressible material ({law.described}) locks at finite strains: use {example}")


def _rows_at_points(rows: Numbers, name: str) -> Numbers:
    """Return the row of moduli of each quadrature point (n_cells, n_q), given the rows of cells or of quadrature points."""
    n_q = len(elements.get(name).quadrature[1])
    columns = rows[:, None] if rows.ndim == 1 else rows
    return np.array(np.broadcast_to(columns, (len(columns), n_q)), order="C")  # writable, also if n_q is 1
