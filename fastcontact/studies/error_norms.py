"""Errors of a finite-element solution: norms of its difference from an exact solution, and estimates for each cell.

The norms are computed by quadrature, for convergence studies with exact solutions such as `analytic.hertz_box`. Errors at the
nodes are not suitable, because they often converge faster than errors within the cells.

The estimates need no exact solution. The smoothed stress is more accurate than the stress of the solution, and the difference
of the two is an estimate of the error (Zienkiewicz and Zhu, 1987). On the contact surface, the difference between the
smoothed normal stress and the contact pressure is added, as in residual-based estimates (for example Wriggers and Scherf,
1998).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from fastcontact._tools.argument_types import typed
from fastcontact._tools.html_table import fields_table
from fastcontact.arrays import Array, Indices, Numbers
from fastcontact.contact.integration import facet_measure, fine_rule
from fastcontact.contact.surface import by_block, surface
from fastcontact.elasticity.energy import cell_volumes, integration_rule, twice_energy_density
from fastcontact.elasticity.incompatible_modes import VOIGT
from fastcontact.elasticity.initial_states import StressOffset
from fastcontact.elasticity.loads import check_solids, solid_rows
from fastcontact.elasticity.recovery import CellStress, interpolation
from fastcontact.elasticity.smoothed_stress import smoothed_stress
from fastcontact.errors import ModelError
from fastcontact.mesh import elements
from fastcontact.mesh.area_vectors import area_vectors
from fastcontact.mesh.mesh import starts_of
from fastcontact.mesh.topology import cells_of_outer_facets, outer_facets, same_facets
from fastcontact.model.model import Model
from fastcontact.results.step import ContactResult, StepResult

# Largest number of quadrature points that are evaluated at a time, which limits the memory of intermediate arrays.
POINTS_PER_BATCH = 100_000
CellArrays = tuple[Array, Array, Array, Array]  # see `_cell_arrays`


class Theory(Protocol):
    """An exact solution that is known everywhere in the bodies."""

    def displacement(self, points: Array) -> Array:
        """Return the displacements (n, dim) [length] at `points` (n, dim) [length]."""
        ...

    def stress(self, points: Array) -> Array:
        """Return the stresses (n, 4), in 3D (n, 6) [pressure] at `points` (n, dim) [length].

        The order of the components is that of `StepResult.stress`.
        """
        ...


@dataclass(frozen=True)
class ErrorNorms:
    """Norms of the error of a solution, and of the exact solution with which it is compared.

    The energy norm of a stress field s is the square root of the integral of s : C^-1 : s, with the elastic moduli C; this
    integral is twice the elastic energy. The L2 norm of a displacement field is the square root of the integral of its
    square. In axisymmetry integrals extend over the full circle, and dim is 3 in the units below.

    Attributes
    ----------
    energy : float
        Energy norm of the difference between the two solutions [energy^(1/2)].
    displacement : float
        L2 norm of the difference between the two displacements [length^(1 + dim/2)].
    energy_of_theory : float
        Energy norm of the exact solution [energy^(1/2)].
    displacement_of_theory : float
        L2 norm of the exact displacement [length^(1 + dim/2)].

    Examples
    --------
    `error_against` has a complete example.

    >>> import fastcontact as fc
    >>> fc.error_against(fc.analytic.hertz_box(), model, step.displacement).relative_energy  # doctest: +SKIP
    """

    energy: float
    displacement: float
    energy_of_theory: float
    displacement_of_theory: float

    _repr_html_ = fields_table

    @property
    def relative_energy(self) -> float:
        """Energy norm of the error divided by the energy norm of the exact solution [-]."""
        return self.energy / self.energy_of_theory

    @property
    def relative_displacement(self) -> float:
        """L2 norm of the error of the displacement divided by the L2 norm of the exact displacement [-]."""
        return self.displacement / self.displacement_of_theory


@typed(ModelError)
def error_against(
    theory: Theory,
    model: Model,
    displacement: ArrayLike,
    *,
    groups: Sequence[str] | str | None = None,
    n_points: int | None = None,
    rise: Array | None = None,
) -> ErrorNorms:
    """Return the norms of the difference between a finite-element solution and an exact solution.

    Both are evaluated at the same quadrature points in the reference configuration. The stresses of the solution follow from
    the derivatives of its displacements there, without averaging (Zienkiewicz and Taylor, 2000, section 14.1).

    Parameters
    ----------
    theory : Theory
        An object with methods ``displacement(points)`` and ``stress(points)``, such as `analytic.hertz_box`.
    model : Model
        The model of the solution; only its mesh, kinematics, materials and initial states are used. Initial stresses and
        strains have the multiplier 1.
    displacement : array_like (n_points, dim)
        Nodal displacements [length] of the solution, such as ``fc.solve(model)[-1].displacement``.
    groups : sequence of str or str, optional
        Groups of solid cells over which to integrate; by default all solid cells.
    n_points : int, optional
        Number of quadrature points along each direction of a cell. By default it is the order of the element plus three, so
        that the quadrature error is negligible.
    rise : ndarray (n_points,), optional
        Temperature rise [temperature] of every point of the mesh, see `Model.temperature_rise`.

    Returns
    -------
    ErrorNorms

    Raises
    ------
    MeshError, ModelError
        If a group is unknown or contains no solid cells, an array has a wrong shape, or a value of the theory is not finite.

    Examples
    --------
    >>> import fastcontact as fc
    >>> model = fc.Model(fc.generate.block(origin=(0.0, -1.0)), "plane_strain")
    >>> model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
    >>> box = fc.analytic.hertz_box()
    >>> norms = fc.error_against(box, model, box.displacement(model.mesh.points))
    >>> round(norms.relative_energy, 2)
    0.21
    """
    model.refuse_nonlinear("norms of errors are")
    u = np.asarray(displacement, float)
    if u.shape != (shape := model.mesh.points.shape):
        raise ModelError(f"displacement has shape {u.shape}: it must be {shape}, a row for each point")
    if n_points is not None and n_points < 1:
        raise ModelError(f"n_points = {n_points} points along each direction of a cell must be at least 1")
    names = (groups,) if isinstance(groups, str) else groups
    check_solids(model.mesh, names, " to integrate over")
    offset = model.material_field().offset(rise, [(1.0, state) for state in model.initial_states], model.mesh.n_points)
    total = np.zeros(4)
    for name, rows in solid_rows(model.mesh, names).items():
        n_cells = max(1, POINTS_PER_BATCH // len(integration_rule(elements.get(name), n_points)[1]))
        for first in range(0, len(rows), n_cells):
            batch = rows[first : first + n_cells]
            cell_arrays = _cell_arrays(model, name, batch, u, n_points, offset)
            total += _squared_norms(theory, model.mesh.cells[name][batch], model.mesh.points, u, cell_arrays)
    return ErrorNorms(*np.sqrt(total).tolist())


def _cell_arrays(
    model: Model, name: str, rows: Indices | slice, displacement: Array, n_points: int | None, offset: StressOffset | None
) -> CellArrays:  # fmt: skip
    """Return shape functions, stresses, volumes and compliances at the quadrature points of the cells `rows` of type `name`.

    The shape functions are (n_q, n_nodes) [-], the stresses (n_cells, n_q, n_components) [pressure], and the volumes of the
    quadrature points (n_cells, n_q) [length^dim], in axisymmetry [length^3]. The compliances are (n_cells, n_q, n_components,
    n_components) [1 / pressure] if they vary within cells, otherwise (n_cells, 1, n_components, n_components). `displacement`
    is (n_points, dim) [length].
    """
    mesh, element, axisymmetric = model.mesh, elements.get(name), model.kinematics == "axisymmetric"
    xi, weights = integration_rule(element, n_points)
    N, dN = np.ascontiguousarray(element.shape(xi)), element.gradient(xi)
    cells, field = mesh.cells[name][rows], model.material_field()
    numbers = field.moduli_rows[name][rows]
    cell_stress = CellStress(mesh, model.kinematics, field.moduli, displacement, field.treatment, offset)
    stress = cell_stress.at(name, xi, cells, numbers, np.arange(len(mesh.cells[name]))[rows])
    compliance = field.compliance[numbers.reshape(len(numbers), -1)]
    if compliance.shape[1] > 1:
        compliance = np.einsum("nq,cqij->cnij", interpolation(name, xi), compliance)
    return N, stress, cell_volumes(mesh.points[cells], N, dN, axisymmetric) * weights, compliance


def _squared_norms(theory: Theory, cells: Numbers, points: Array, u: Array, cell_arrays: CellArrays) -> Array:
    """Return the squares (4,) of the norms over `cells` (n_cells, n_nodes), in the order of the attributes of `ErrorNorms`.

    `points` and `u` (n_points, dim) are the nodal positions and displacements [length]; for `cell_arrays` see
    `_cell_arrays`.
    """
    N, stress, volume, compliance = cell_arrays
    exact_u, exact_stress = _exact_fields(theory, np.einsum("qa,cad->cqd", N, points[cells]), stress.shape[2])
    error_u = np.einsum("qa,cad->cqd", N, u[cells]) - exact_u
    densities = (
        twice_energy_density(stress - exact_stress, compliance), (error_u**2).sum(axis=-1),
        twice_energy_density(exact_stress, compliance), (exact_u**2).sum(axis=-1),
    )  # fmt: skip
    return np.array([(density * volume).sum() for density in densities])


def _exact_fields(theory: Theory, positions: Array, n_components: int) -> tuple[Array, Array]:
    """Return displacements and stresses (n_cells, n_q, ...) of a theory at `positions` (n_cells, n_q, dim) [length]."""
    points = positions.reshape(-1, positions.shape[2])
    fields = []
    for name, size in (("displacement", points.shape[1]), ("stress", n_components)):
        values = np.asarray(getattr(theory, name)(points), float)
        if values.shape != (len(points), size):
            raise ModelError(f"the theory's {name} has shape {values.shape} where {(len(points), size)} is needed")
        if not np.isfinite(values).all():
            first = points[np.flatnonzero(~np.isfinite(values).all(axis=1))[0]]
            raise ModelError(f"the theory's {name} is not finite at {first}")
        fields.append(values.reshape(*positions.shape[:2], size))
    return fields[0], fields[1]


@dataclass(frozen=True, eq=False)
class ErrorEstimate:
    """Estimated errors of a solution in the energy norm, which `ErrorNorms` defines.

    Attributes
    ----------
    cells : ndarray (n_solids,)
        Error [energy^(1/2)] of each solid cell, in the order of ``mesh.solids``.
    contact : ndarray (n_solids,)
        Contribution [energy^(1/2)] of the traction jump at the contact surface to the error of each solid cell.
    energy : float
        Energy norm of the solution [energy^(1/2)].

    Examples
    --------
    `estimate_error` has a complete example.

    >>> import fastcontact as fc
    >>> fc.estimate_error(model, step).relative  # doctest: +SKIP
    """

    cells: Array
    contact: Array
    energy: float

    _repr_html_ = fields_table

    @property
    def total(self) -> float:
        """Estimated error of the solution in the energy norm [energy^(1/2)]."""
        return float(np.linalg.norm(self.cells))

    @property
    def relative(self) -> float:
        """Estimated error of the solution divided by the estimated energy norm of the exact solution [-].

        The latter is ``sqrt(energy**2 + total**2)`` (Zienkiewicz and Zhu, 1987).
        """
        return self.total / math.hypot(self.energy, self.total) if self.total else 0.0


@typed(ModelError)
def estimate_error(model: Model, step: StepResult) -> ErrorEstimate:
    """Estimate the error of each cell in a step from the smoothed stress and, on contact surfaces, from the pressure.

    Parameters
    ----------
    model : Model
        The model that was solved.
    step : StepResult
        A step of its solution.

    Returns
    -------
    ErrorEstimate

    Examples
    --------
    >>> import fastcontact as fc
    >>> mesh = fc.generate.block(divisions=(4, 4))
    >>> model = fc.Model(mesh, "plane_strain")
    >>> model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
    >>> model.fix("LEFT", "x")
    >>> model.fix("BOTTOM", "y")
    >>> model.prescribe("TOP", y=-0.01)
    >>> step = fc.solve(model, fc.linear_ramp(1))[-1]
    >>> fc.estimate_error(model, step).relative < 1e-9  # the stress is uniform
    True
    """
    model.refuse_nonlinear("error estimates are")
    factors = [step.iterations.get(f"{kind}_factors", ()) for kind in ("temperature", "initial")]
    offset = model.stress_offset(factors[0], factors[1], temperature=step.temperature)
    field = model.material_field()
    in_cells = CellStress(model.mesh, model.kinematics, field.moduli, step.displacement, field.treatment, offset)
    smooth = smoothed_stress(model.mesh, field, in_cells)
    squares, energy = [], 0.0
    for name in model.mesh.solids:
        order, u = elements.get(name).order, step.displacement
        N, stress, volume, compliance = _cell_arrays(model, name, slice(None), u, order + 1, offset)
        difference = np.einsum("qa,cai->cqi", N, smooth[name]) - stress
        squares.append((twice_energy_density(difference, compliance) * volume).sum(axis=1))
        energy += float((twice_energy_density(stress, compliance) * volume).sum())
    contact = np.zeros(sum(map(len, squares)))
    for result in step.contact.values():
        _add_contact(model, result, smooth, contact)
    return ErrorEstimate(np.sqrt(np.concatenate(squares) + contact), np.sqrt(contact), math.sqrt(energy))


def _add_contact(model: Model, result: ContactResult, smooth: dict[str, Array], contact: Array) -> None:
    """Add h / E times the integral of the squared traction jump over each secondary facet to `contact` (n_solids,).

    The jump is the difference between the pressure and the negative normal component of the smoothed stress `smooth`, h is
    the size of the facet, and E is Young's modulus of its cell.
    """
    mesh, outer, cells_of_outer = model.mesh, outer_facets(model.mesh), cells_of_outer_facets(model.mesh)
    pair = next(pair for pair in model.contact if pair.name == result.name)
    nodal_pressure = np.zeros(mesh.n_points)
    nodal_pressure[result.points] = result.pressure
    starts, sizes = starts_of(mesh.solids), [len(cells) for cells in mesh.cells.values()]
    E, material = np.array([law.young[0] for law, _ in model.materials]), model.material_field().material_numbers
    for block in surface(mesh, pair.secondary).blocks:
        xi, weights = fine_rule(block.element)
        reference = elements.get(block.element)
        N = reference.shape(xi)
        area = facet_measure(block.facets, block.element, mesh.points, xi, model.kinematics == "axisymmetric") * weights
        normals = area_vectors(mesh.points[block.facets], reference.gradient(xi))
        normals /= np.linalg.norm(normals, axis=2, keepdims=True)
        cell_numbers = cells_of_outer[block.element][same_facets(outer[block.element], block.facets)].astype(np.intp)
        for name, (facet, cell) in zip(mesh.cells, by_block(cell_numbers, sizes), strict=True):
            if not len(facet):
                continue
            local = np.argmax(mesh.cells[name][cell][:, None] == block.facets[facet][:, :, None], axis=2)
            nodal_stress = smooth[name][cell[:, None], local]
            tensor = np.einsum("qa,fai->fqi", N, nodal_stress)[..., VOIGT[mesh.dim]]
            traction = (tensor * normals[facet][..., None, :]).sum(axis=-1)
            p = nodal_pressure[block.facets[facet]] @ N.T
            jump = ((traction + p[:, :, None] * normals[facet]) * normals[facet]).sum(axis=2)
            h = np.linalg.norm(np.ptp(mesh.points[block.facets[facet]], axis=1), axis=1)
            square = h / E[material[name][cell]] * (jump**2 * area[facet]).sum(axis=1)
            np.add.at(contact, starts[name] + cell, np.where(area[facet].sum(axis=1) > 0, square, 0.0))
