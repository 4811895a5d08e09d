"""Estimate the error of a solution in each cell from the smoothed stress and the traction jump at the contact surface.

The smoothed stress is more accurate than the stress of the solution, so that their difference is an estimate of the error
(Zienkiewicz and Zhu, 1987). On the contact surface the difference between the smoothed normal stress and the contact
pressure is added, as in residual-based estimates (for example Wriggers and Scherf, 1998).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact._tools.html_table import fields_table
from fastcontact.arrays import Array, Indices, Numbers
from fastcontact.contact.integration import facet_measure, fine_rule
from fastcontact.contact.surface import surface
from fastcontact.elasticity.energy import elastic_energy
from fastcontact.elasticity.incompatible_modes import PAIRS
from fastcontact.elasticity.initial_states import StressOffset
from fastcontact.elasticity.smoothed_stress import smoothed_stress
from fastcontact.errors import ModelError
from fastcontact.mesh import elements
from fastcontact.mesh.area_vectors import area_vectors
from fastcontact.mesh.topology import same_facets
from fastcontact.model.model import Model
from fastcontact.results.step import ContactResult, StepResult
from fastcontact.studies.error_norms import stress_in_cells


@dataclass(frozen=True, eq=False)
class ErrorEstimate:
    """Estimated errors of a solution in the energy norm, which `ErrorNorms` defines.

    Attributes
    ----------
    cells : ndarray (n_solids,)
        Error of each solid cell, in the order of ``mesh.solids`` [energy^(1/2)].
    contact : ndarray (n_solids,)
        Contribution of the traction jump at the contact surface to the error of each solid cell [energy^(1/2)].
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
        """Estimated error of the solution divided by the energy norm of the solution [-]."""
        return self.total / math.hypot(self.energy, self.total) if self.total else 0.0


@typed(ModelError)
def estimate_error(model: Model, step: StepResult) -> ErrorEstimate:
    """Return the estimated error of a step.

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
    heat, initial = (step.iterations.get(key, ()) for key in ("temperature_factors", "initial_factors"))
    offset = model.stress_offset(heat, initial, temperature=step.temperature)
    smooth = smoothed_stress(model.mesh, model.kinematics, model.material_field(), step.displacement, offset)
    squares, energy = [], 0.0
    for name in model.mesh.solids:
        difference, total = _differences(model, step.displacement, name, smooth[name], offset)
        squares.append(difference)
        energy += total
    contact = np.zeros(sum(map(len, squares)))
    for result in step.contact.values():
        _add_contact(model, result, smooth, contact)
    return ErrorEstimate(np.sqrt(np.concatenate(squares) + contact), np.sqrt(contact), math.sqrt(energy))


def _differences(
    model: Model, displacement: Array, name: str, smooth: Array, offset: StressOffset | None
) -> tuple[Array, float]:
    """Return the squared energy norms (n_cells,) of smoothed minus computed stress, and that of the computed stress."""
    N, stress, volume, elastic = stress_in_cells(
        model, name, slice(None), displacement, elements.get(name).order + 1, offset
    )
    off = np.einsum("qa,cai->cqi", N, smooth) - stress
    squares = (elastic_energy(off, elastic) * volume).sum(axis=1)
    return squares, float((elastic_energy(stress, elastic) * volume).sum())


def _add_contact(model: Model, result: ContactResult, smooth: dict[str, Array], contact: Array) -> None:
    """Add h / E times the squared difference between pressure and smoothed normal stress to the cells of the facets."""
    mesh = model.mesh
    pair = next(pair for pair in model.contact if pair.name == result.name)
    nodal = np.zeros(mesh.n_points)
    nodal[result.points] = result.pressure
    first = np.cumsum([0, *(len(block) for block in mesh.solids.values())])
    stiffness, material = np.array([law.young[0] for law, _ in model.materials]), model.material_field().number
    for block in surface(mesh, pair.secondary).blocks:
        xi, weights = fine_rule(block.element)
        reference = elements.get(block.element)
        N = reference.shape(xi)
        area = facet_measure(block.facets, block.element, mesh.points, xi, model.kinematics == "axisymmetric") * weights
        normals = area_vectors(mesh.points[block.facets], reference.gradient(xi))
        normals /= np.linalg.norm(normals, axis=2, keepdims=True)
        for number, name in enumerate(mesh.solids):
            facet, cell, local = _owners(name, mesh.cells[name], block.facets)
            if not len(facet):
                continue
            at_nodes = smooth[name][cell[:, None], local]
            tensor = np.einsum("qa,fai->fqi", N, at_nodes)[..., PAIRS[mesh.dim]]
            traction = (tensor * normals[facet][..., None, :]).sum(axis=-1)
            p = nodal[block.facets[facet]] @ N.T
            off = traction + p[:, :, None] * normals[facet]
            length = area[facet].sum(axis=1)
            size = np.linalg.norm(np.ptp(mesh.points[block.facets[facet]], axis=1), axis=1)
            value = (
                size
                / stiffness[material[name][cell]]
                * ((off * normals[facet]).sum(axis=2) ** 2 * area[facet]).sum(axis=1)
            )
            np.add.at(contact, first[number] + cell, np.where(length > 0, value, 0.0))


def _owners(name: str, cells: Numbers, facets: Numbers) -> tuple[Indices, Indices, Indices]:
    """Return the facets that belong to cells of one element type, these cells, and the local nodes of the facets."""
    near = np.flatnonzero(np.isin(cells, facets).sum(axis=1) >= facets.shape[1])
    sides = [list(side) for side in elements.get(name).facets if len(side) == facets.shape[1]]
    rows = np.array([same_facets(facets, cells[near][:, side]) for side in sides], np.intp).reshape(-1, len(near))
    cell, side = np.nonzero(rows.T >= 0)
    owners, row = cells[near[cell]], rows[side, cell]
    return row, near[cell], np.argmax(owners[:, None] == facets[row][:, :, None], axis=2)
