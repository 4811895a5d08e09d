"""Bodies with nonlinear laws or finite strains: internal forces, consistent tangent, history."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.sparse import bsr_array

from fastcontact._jit import parallel
from fastcontact.arrays import Array, Numbers
from fastcontact.elasticity import dilatation
from fastcontact.elasticity.constitutive_kernels import LINEAR, LOGARITHMIC, PLASTIC, SAINT_VENANT
from fastcontact.elasticity.dilatation import REMAINDER
from fastcontact.elasticity.energy import gradients_at
from fastcontact.elasticity.material_field import MaterialField, material_field
from fastcontact.elasticity.materials import LinearElastic, Material
from fastcontact.elasticity.nonlinear_materials import ElasticPlastic, NonlinearElastic
from fastcontact.elasticity.recovery import von_mises
from fastcontact.elasticity.stiffness import Sparsity, sparsity
from fastcontact.errors import ConvergenceError, ModelError
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import Mesh

History = dict[str, Array]
# Size of the history of a quadrature point, see `constitutive_kernels`.
HISTORY, PLASTIC_STRAIN, ACROSS = 9, 6, 8
# Parts of the geometric stiffness in a tangent, see `NonlinearBodies.at`.
WHOLE = 2


@dataclass(frozen=True, eq=False)
class DeformedBodies:
    """The bodies at a displacement.

    Attributes
    ----------
    tangent : callable
        Function that returns K.
    force : ndarray (n_points, dim)
        Internal forces [force].
    history : dict of str to ndarray (n_cells, n_q, 9)
        History by solid element type, if the load step ended here.
    stress : dict of str to ndarray (n_cells, n_q, n_components)
        Cauchy stress [pressure].
    energy, plastic_work : float
        Elastic energy, and the plastic work since the beginning [energy].
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
    """The solid cells of a model with nonlinear laws or finite strains; see `body_kernels`.

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
        if kinematics == "plane_stress":  # the out-of-plane strain follows from the full law
            field = material_field(mesh, "plane_strain", field.materials, field.number)
        self._materials, self._owner = field.materials, field.owner
        self._moduli = _six_by_six(field.moduli)
        self._expansion = np.zeros((len(self._moduli), 6))
        self._expansion[:, : field.moduli.shape[1]] = np.nan_to_num(field.expansion)
        self._cells = {name: _at_points(field.loops[name], name) for name in mesh.solids}
        self._averaged = field.averaged & (kinematics != "plane_stress")
        self._constants = self._rows()
        self._pattern: Sparsity = sparsity(mesh)
        self._blocks = len(self._pattern.indices), mesh.dim, mesh.dim

    def _rows(self) -> Array:
        """Return the constants (n_moduli, n_constants) of all laws."""
        hooke = SAINT_VENANT if self.finite else LINEAR
        constants_of_laws = [law.constants if isinstance(law, NonlinearElastic) else [hooke] for law in self._materials]
        rows = np.zeros((len(constants_of_laws), max(4, *map(len, constants_of_laws))))
        for row, constants in zip(rows, constants_of_laws, strict=True):
            row[: len(constants)] = constants
            if self.finite and constants[0] == PLASTIC:
                row[0] = LOGARITHMIC
        return np.ascontiguousarray(rows[self._owner])

    @property
    def yields(self) -> bool:
        """Whether there is an elastic-plastic law."""
        return any(isinstance(law, ElasticPlastic) for law in self._materials)

    @property
    def _remembers(self) -> bool:
        """Whether the history may change."""
        return self.yields or self.kinematics == "plane_stress"

    @property
    def beginning(self) -> History:
        """The history before the first load step."""
        return {name: np.zeros((*numbers.shape, HISTORY)) for name, numbers in self._cells.items()}

    def _split(self, name: str) -> tuple[Array, Array]:
        """Return moduli without dilatation, and bulk moduli (n_moduli, 2) of the projected dilatation and the remainder."""
        moduli, element = self._moduli.copy(), elements.get(name)
        bulk = np.zeros((len(moduli), 2))
        bulk[:, 1] = self._constants[:, 2]
        of_hooke = np.isin(self._constants[:, 0], (LINEAR, SAINT_VENANT))
        projected = self._averaged & (element.dilatation is not None) & (self._constants[:, 0] != SAINT_VENANT)
        bulk_moduli = moduli[:, :3, :3].sum(axis=(1, 2)) / 9.0
        removed = np.where(projected & of_hooke, bulk_moduli, 0.0)
        moduli[:, :3, :3] -= removed[:, None, None]
        bulk[:, 1] += removed
        shear = np.where(of_hooke, moduli[:, 3, 3], self._constants[:, 1])
        rest = 0.0 if element.dilatation == element.order - 1 else np.minimum(bulk[:, 1], REMAINDER * shear)
        bulk[projected] = np.column_stack([bulk[:, 1] - rest, np.broadcast_to(rest, len(bulk))])[projected]
        return moduli, bulk

    def at(
        self, displacement: Array, before: Mapping[str, Array], *, rise: Array | None = None, geometric: int = WHOLE,
        tangent: bool = True,
    ) -> DeformedBodies:  # fmt: skip
        """Return the bodies at `displacement` (n_points, dim) [length], with the history `before` the load step.

        They expand by a temperature `rise` (n_points,) over the reference [temperature].
        `geometric` selects the full tangent (2), the tangent without the rotation of the mean pressure (1), or also without
        initial-stress stiffness (0). The last one is positive definite farther from the solution, and where only contact
        prevents the rotation of a body under load. Without `tangent`, K is computed only at its first use, which takes half
        the time if K is never used, and one and a half times the time if it is.

        Raises
        ------
        ConvergenceError
            If a cell is inverted, or plane stress does not converge at a point.
        """
        data = np.zeros((0, *self._blocks[1:]))
        if tangent:
            data = np.zeros(self._blocks) if self.finite else self._elastic.copy()
        return self._assembled(displacement, before, rise, geometric, data, not self.finite)

    @cached_property
    def _elastic(self) -> Array:
        """Blocks (n_blocks, dim, dim) of the tangent without plastic flow at small strains [force / length]."""
        data = np.zeros(self._blocks)
        self._assembled(np.zeros_like(self.mesh.points), self.beginning, None, WHOLE, data, False)
        return data

    def _assembled(
        self, displacement: Array, before: Mapping[str, Array], rise: Array | None, geometric: int, data: Array,
        elastic: bool,
    ) -> DeformedBodies:  # fmt: skip
        """Return the result of `at`; `data` (n_blocks, dim, dim) receive the tangent, see `body_kernels.linearise`."""
        from fastcontact.elasticity import body_kernels  # most models are linear

        mesh, dim, pattern = self.mesh, self.mesh.dim, self._pattern
        history, stress, force, energy = {}, {}, np.zeros((mesh.n_points, dim)), np.zeros(2)
        finite, degrees = (self.finite, geometric), np.zeros(0) if rise is None else rise
        flags = self.kinematics == "axisymmetric", self.kinematics == "plane_stress", *finite
        for name, cells in mesh.solids.items():
            N, dN, weights = elements.get(name).tables
            moduli, bulk = self._split(name)
            polynomials = np.ascontiguousarray(dilatation.basis(name, elements.get(name).quadrature[0]))
            if (bulk[:, 1] > 0.0).any():  # the remainder is not a linear function
                polynomials = polynomials[:, :1].copy() if elements.get(name).dilatation == 0 else polynomials
            owner, row_ranges = pattern.owners(mesh, name)
            cauchy = np.empty((*before[name].shape[:2], 6 if dim == 3 else 4))
            new = np.empty_like(before[name]) if self._remembers else before[name][:0]
            energies, numbers = np.zeros((len(cells), 2)), self._cells[name]
            slots, old = pattern.slots[name], before[name]

            def part(number: int) -> tuple[int, int]:
                rows = slice(*row_ranges[number])  # noqa: B023
                status, cell = body_kernels.linearise(
                    mesh.points, cells[rows], N, dN, weights, polynomials, *flags, displacement, self._constants, moduli,  # noqa: B023
                    bulk, self._expansion, degrees, numbers[rows], old[rows], slots[rows], owner, number, elastic, data,  # noqa: B023
                    force, new[rows], cauchy[rows], energies[rows],  # noqa: B023
                )  # fmt: skip
                return status, int(cell) + rows.start

            for status, cell in parallel.shared(part, range(len(row_ranges))):
                if status:
                    raise ConvergenceError(self._failure(status, name, cell, displacement))
            history[name], stress[name] = new if self._remembers else before[name], cauchy
            energy += energies.sum(axis=0)
        size = mesh.n_points * dim

        def whole() -> bsr_array:
            if not len(data):
                return self.at(displacement, before, rise=rise, geometric=geometric).K
            return bsr_array((data, pattern.indices, pattern.indptr), shape=(size, size))

        return DeformedBodies(whole, force, history, stress, float(energy[0]), float(energy[1]))

    def _failure(self, status: int, name: str, cell: int, displacement: Array) -> str:
        from fastcontact.elasticity import body_kernels

        where = self.mesh.points[self.mesh.cells[name][cell]].mean(axis=0)
        measure = self._measures(name, cell, displacement).min()
        failure = f"is inverted (J = {measure:.3g})"
        if status != body_kernels.INVERTED:
            failure = "has no out-of-plane strain of zero stress"
        return f"cell {cell} of {name} near {where} {failure}: smaller load steps, or a mesh that is coarser there, may help"

    def _measures(self, name: str, cell: int, displacement: Array) -> Array:
        """Return J (n_q,) of a cell."""
        N, dN, _ = elements.get(name).tables
        nodes, dim, F = self.mesh.cells[name][cell], self.mesh.dim, np.tile(np.eye(3), (len(N), 1, 1))
        points, u = self.mesh.points[nodes], displacement[nodes]
        F[:, :dim, :dim] += np.einsum("ai,qaj->qij", u, gradients_at(points[None], dN)[0][0])
        if self.kinematics == "axisymmetric":
            F[:, 2, 2] += (N @ u[:, 0]) / (N @ points[:, 0])
        return np.linalg.det(F)

    def cell_fields(self, bodies: DeformedBodies, displacement: Array) -> dict[str, Array]:
        """Return the fields of `field_names` (n_solids,): extremes over the points of each cell, except for the volume."""
        fields = {name: self._fields(name, bodies, displacement) for name in self._cells}
        names = field_names(self._materials, "finite" if self.finite else "small")
        return {name: np.concatenate([field[i] for field in fields.values()]) for i, name in enumerate(names)}

    def _fields(self, name: str, bodies: DeformedBodies, displacement: Array) -> list[Array]:
        """Return the values (n_cells,) of `field_names` for the cells of an element."""
        J, fields = np.ones(self._cells[name].shape), list[Array]()
        if self.finite:
            J, ratio, logarithm = self._strains(name, bodies, displacement)
            fields = [ratio, logarithm]
        if self.yields:
            fields += self._yielding(name, bodies, J)
        return fields

    def _strains(self, name: str, bodies: DeformedBodies, displacement: Array) -> tuple[Array, Array, Array]:
        """Return J (n_cells, n_q), and the volume ratios and largest logarithmic strains (n_cells,) of cells."""
        from fastcontact.elasticity import body_kernels

        N, dN, weights = elements.get(name).tables
        cells, across = self.mesh.cells[name], np.zeros(self._cells[name].shape)
        if self.kinematics == "plane_stress":
            across = np.ascontiguousarray(bodies.history[name][..., ACROSS])
        J, ratio, logarithm = np.empty_like(across), np.empty(len(cells)), np.empty(len(cells))
        axisymmetric = self.kinematics == "axisymmetric"

        def part(cut: tuple[int, int]) -> None:
            rows = slice(*cut)
            body_kernels.strains(
                self.mesh.points, cells[rows], N, dN, weights, axisymmetric, across[rows], displacement, J[rows], ratio[rows],
                logarithm[rows],
            )  # fmt: skip

        parallel.shared(part, parallel.portions(len(cells), len(N)))
        return J, ratio, logarithm

    def _yielding(self, name: str, bodies: DeformedBodies, J: Array) -> list[Array]:
        """Return the largest equivalent plastic strain and yield ratio (n_cells,) of cells.

        The yield condition applies to the Kirchhoff stress, J (n_cells, n_q) times the Cauchy stress.
        """
        history, owner = bodies.history[name], self._owner[self._cells[name]]
        strain = history[..., PLASTIC_STRAIN]
        ratio = np.zeros(strain.shape)
        for index, law in enumerate(self._materials):
            if isinstance(law, ElasticPlastic):
                at = owner == index
                stress = J[at][:, None] * bodies.stress[name][at]
                relative = stress - 2.0 / 3.0 * law.kinematic * history[at][:, : stress.shape[1]]
                ratio[at] = von_mises(relative) / law.yield_at(strain[at])
        return [strain.max(axis=1), ratio.max(axis=1)]


def field_names(materials: Sequence[Material], strain: str) -> tuple[str, ...]:
    """Return the names of the cell fields in steps with these materials; none for linear bodies."""
    plastic = ("plastic_strain", "yield_ratio") if any(isinstance(law, ElasticPlastic) for law in materials) else ()
    return (*(("J", "logarithmic_strain") if strain == "finite" else ()), *plastic)


def nonlinear_bodies(mesh: Mesh, kinematics: str, strain: str, field: MaterialField) -> NonlinearBodies | None:
    """Return the solid cells as nonlinear bodies; None if they are linear."""
    if strain == "small" and not any(isinstance(law, NonlinearElastic) for law in field.materials):
        return None
    return NonlinearBodies(mesh, kinematics, strain, field)


def check_law(law: Material, strain: str) -> None:
    """Raise ModelError if a material does not support these strains."""
    if isinstance(law, NonlinearElastic) and strain not in law.strains:
        raise ModelError(f"{type(law).__name__} requires finite strains: use Model(..., strain='finite')")
    if strain == "finite" and isinstance(law, ElasticPlastic) and law.kinematic:
        raise ModelError("kinematic hardening requires small strains: omit kinematic, or strain='finite'")
    if law.incompatible_modes and (strain == "finite" or isinstance(law, NonlinearElastic)):
        raise ModelError("incompatible modes are available only for linear bodies: omit incompatible_modes")
    if strain == "finite" and not isinstance(law, NonlinearElastic) and law.averaged:
        example = "NeoHookean(E=..., nu=...)" if isinstance(law, LinearElastic) else "a hyperelastic law"
        raise ModelError(
            f"a nearly incompressible material ({law.described}) locks in elements of finite strains: use {example}"
        )


def _six_by_six(moduli: Array) -> Array:
    """Return moduli (n, 6, 6), extended from plane-strain moduli (n, 4, 4) if necessary."""
    if moduli.shape[1] == 6:
        return np.ascontiguousarray(moduli)
    full = np.zeros((len(moduli), 6, 6))
    full[:, :4, :4] = moduli
    return full


def _at_points(numbers: Numbers, name: str) -> Numbers:
    """Return the moduli numbers of every quadrature point (n_cells, n_q) from those of cells or points."""
    n_q = len(elements.get(name).quadrature[1])
    columns = numbers[:, None] if numbers.ndim == 1 else numbers
    return np.ascontiguousarray(np.broadcast_to(columns, (len(columns), n_q)))
