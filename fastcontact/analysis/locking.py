"""A posteriori measure of locking: stresses of linear elements compared with recovered, continuous ones.

The energy of the difference, relative to that of the solution, estimates the error (Zienkiewicz and Zhu, Int. J. Numer.
Meth. Engng 24, 1987). In nearly incompressible cells only the mean stress is used: the deviator stays smooth, while the mean
stress, and with it the contact pressure, alternates from cell to cell (Hughes, The finite element method, 1987, section
4.3.7).

`Comparison` measures volumetric locking by a lower bound of the excess stiffness. Let K be the stiffness of the model, K - S
that of a reference without locking, and S the excess. For the forces of the solution u, the potential energy of the reference
is lower than that of the model by

    D = u.S u / 2 + max over x of (x.S u - x.(K - S) x / 2),

and D over the elastic energy u.K u / 2 is the additional compliance of the reference under the same forces. It equals the
excess of stiffness where forces act, and is smaller where displacements are prescribed. A few conjugate gradient iterations,
preconditioned by K^-1, approach the maximum from below. The contact forces are fixed.

The reference uses the projected dilatation of `elasticity.dilatation`; in linear triangles, tetrahedra, wedges and pyramids,
which lock with it or have none, it uses the mean dilatation of the cells at each node (Bonet and Burton, Commun. Numer. Meth.
Engng 14, 1998).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fastcontact.analysis.problem import Problem
from fastcontact.analysis.state import State
from fastcontact.arrays import Array, Mask
from fastcontact.elasticity import incompatible_modes, recovery
from fastcontact.elasticity.energy import cell_volumes, elastic_energy, integration_rule
from fastcontact.elasticity.incompatible_modes import BENDING as BENDING_ELEMENTS
from fastcontact.elasticity.material_field import MaterialField
from fastcontact.elasticity.materials import LinearElastic
from fastcontact.elasticity.recovery import BATCH, CellStress
from fastcontact.elasticity.smoothed_stress import PointStress, smoothed_stress
from fastcontact.mesh import elements
from fastcontact.mesh.topology import bodies
from fastcontact.model.model import Model
from fastcontact.results.step import StepResult
from fastcontact.round_off import LENGTH_ROUND_OFF, ROUND_OFF, SUM_ROUND_OFF

# Poisson's ratio above which the mean stress is examined, and relative scatter of the mean stress, or of nodal pressures,
# above which a warning is given. Under a sphere the mean stress scatters by 14 to 23 % at nu = 0.3, where the pressure is
# accurate, by 38 to 47 % at 0.45 and by 66 to 75 % at 0.48, where the errors of the pressure at the pole are 15 to 27 % and
# 27 to 43 %.
SUSPICIOUS, ALTERNATING = 0.45, 0.25
# Estimated error in the energy norm above which a warning is given. It is 25 % under the same sphere on coarse triangles, and
# 52 to 67 % in thin parts that carry a third of the exact load in bending.
BENDING = 0.45
# Fraction of the elastic energy of all bodies above which the error of a single body is examined.
NOTABLE_ENERGY = 0.1
# Elements that are over-constrained by one dilatation per cell.
SIMPLICES = ("tri3", "tet4")


def _stress_scatter(problem: Problem, state: State, step: StepResult, names: Sequence[str]) -> tuple[float, float]:
    """Return the differences of the stress and of the mean stress in elements called `names` from recovered ones [-].

    The first is the energy norm of the difference between recovered and computed stress, over that of the computed one. It is
    the largest of the ratios of all bodies together and of single bodies with a notable part of the energy. Where bodies
    yield, it is the ratio of all bodies, relative to the root of twice the elastic and plastic work: the residual stresses of
    unloaded bodies scatter by 72 % about recovered ones even where eight cells across a beam represent bending well.

    The second is the same for the root mean square of the mean stress in nearly incompressible triangles and tetrahedra.
    """
    model, field, mesh = problem.model, problem.field, problem.model.mesh
    thermal, initial = (step.iterations.get(key, ()) for key in ("temperature_factors", "initial_factors"))
    offset = model.stress_offset(thermal, initial, field, step.temperature)
    if not names or offset is not None:  # free thermal expansion only causes round-off stresses
        return 0.0, 0.0
    stress: CellStress | PointStress
    plastic_work, largest_work = 0.0, state.work.largest if state.work else 0.0
    if problem.bodies is None:
        stress = CellStress(mesh, model.kinematics, field.moduli, step.displacement, field.treatment)
    else:
        deformed = problem.deformed(state.u, state, None, tangent=False)
        stress, plastic_work = PointStress(deformed.stress), deformed.plastic_work
    recovered = smoothed_stress(mesh, field, stress)
    sums = np.sum([_scatter_integrals(problem, stress, name, recovered[name]) for name in names], axis=0)
    difference, energy, mean_difference, mean = np.sqrt(sums.sum(axis=0))
    size = np.ptp(mesh.points, axis=0)
    strain = 1.0 if model.strain == "finite" else np.abs(step.displacement).max() / size.max()
    # Root of the energy if the bounding box were filled with the stiffest material under this strain, or rotated.
    energy_scale = strain * np.sqrt(field.moduli.max() * np.prod(size))
    negligible_energy = max(LENGTH_ROUND_OFF * energy_scale, np.sqrt(LENGTH_ROUND_OFF * largest_work))
    if strain <= SUM_ROUND_OFF or energy <= negligible_energy:
        return 0.0, 0.0
    ratio = float(difference / np.sqrt(energy**2 + 2.0 * plastic_work))
    if not plastic_work:  # a thin part may bend on a body that stores more energy
        notable = sums[sums[:, 1] > NOTABLE_ENERGY * energy**2]
        ratio = float(np.sqrt(notable[:, 0] / notable[:, 1]).max(initial=ratio))
    return ratio, float(mean_difference / mean) if mean > 0.0 else 0.0


def _scatter_integrals(problem: Problem, stress: CellStress | PointStress, name: str, recovered: Array) -> Array:
    """Return integrals (n_bodies, 4) of energies and of squared mean stresses, of the difference and of the stress."""
    mesh, field, element = problem.model.mesh, problem.field, elements.get(name)
    xi, weights = integration_rule(element, 2)
    N, dN = np.ascontiguousarray(element.shape(xi)), np.ascontiguousarray(element.gradient(xi))
    body, n = bodies(mesh)[1], len(mesh.cells[name])
    averaged = _poisson_ratios(problem.model, field)[1] & (element.n_corners == element.dim + 1)
    sums = np.zeros((body.max() + 1, 4))
    for rows in np.array_split(np.arange(n), n * dN.nbytes // BATCH + 1):
        cells, numbers = mesh.cells[name][rows], field.rows[name][rows]
        computed = stress.at(name, xi, cells, field.moduli_rows[name][rows], rows)
        difference = N @ recovered[rows] - computed
        volume = cell_volumes(mesh.points[cells], N, dN, problem.model.kinematics == "axisymmetric") * weights
        compliance, mean_weights = field.compliance[numbers][:, None], volume * averaged[numbers, None]
        integrals = [
            *(elastic_energy(values, compliance) * volume for values in (difference, computed)),
            *(values[..., :3].mean(axis=2) ** 2 * mean_weights for values in (difference, computed)),
        ]
        np.add.at(sums, body[cells[:, 0]], np.sum(integrals, axis=2).T)
    return sums


def _poisson_ratios(model: Model, field: MaterialField) -> tuple[Array, Mask]:
    """Return the largest Poisson's ratios (n,) of a material field, and where they are suspicious.

    They are -1 for materials without a mean dilatation.
    """
    laws = [material for material, _ in model.materials]
    nu = np.array([law.largest_nu if isinstance(law, LinearElastic) else -1.0 for law in laws])[field.owner]
    return nu, (nu >= SUSPICIOUS) & (model.kinematics != "plane_stress")


def locking_warnings(problem: Problem, state: State, step: StepResult) -> list[str]:
    """Return a warning where cells are too stiff, because they lock or bend."""
    if problem.bodies is None:
        volumetric = locking_warning(problem, state.u)
    else:
        volumetric = _alternating_mean_stress(problem, state, step)
    return volumetric or _scatter_warnings(problem, state, step)


def _alternating_mean_stress(problem: Problem, state: State, step: StepResult) -> list[str]:
    """Return a warning where the mean stress of nearly incompressible nonlinear triangles and tetrahedra alternates."""
    mesh = problem.model.mesh
    names = [name for name in SIMPLICES if name in mesh.solids]
    selected = problem.field.averaged & (problem.model.kinematics != "plane_stress")
    if not names or not selected.any():
        return []
    rise = problem.model.expanding_rise(step.iterations.get("temperature_factors", ()), step.temperature)
    stress, difference, norm = problem.deformed(state.u, state, rise, tangent=False).stress, 0.0, 0.0
    for name in names:
        rows = selected[problem.field.rows[name]]
        cells, mean = mesh.cells[name][rows], stress[name][rows][..., :3].mean(axis=(1, 2))
        total, count = (np.bincount(cells.ravel(), w, mesh.n_points) for w in (mean.repeat(cells.shape[1]), None))
        smooth = (total / np.maximum(count, 1))[cells].mean(axis=1)
        difference, norm = difference + float(((mean - smooth) ** 2).sum()), norm + float((mean**2).sum())
    if difference <= ALTERNATING**2 * norm:
        return []
    return [
        f"{' and '.join(names)} cells lock: in a nearly incompressible material their mean stress scatters by "
        f"{np.sqrt(difference / norm):.0%} about its averages at the nodes, and forces are too large; use quadrangles "
        "or hexahedra, or quadratic elements (generate.to_quadratic)"
    ]


def _scatter_warnings(problem: Problem, state: State, step: StepResult) -> list[str]:
    """Return a warning where the stresses of linear cells differ much from recovered ones."""
    linear, axisymmetric = problem.bodies is None, problem.model.kinematics == "axisymmetric"
    if axisymmetric and not linear:
        return []
    have_modes = all(material.incompatible_modes for material, _ in problem.model.materials)
    bending = BENDING_ELEMENTS if have_modes else ()
    names = [name for name in problem.model.mesh.solids if elements.get(name).order == 1 and name not in bending]
    energy, pressure = _stress_scatter(problem, state, step, names)
    if pressure > ALTERNATING and linear:
        nu = _poisson_ratios(problem.model, problem.field)[0].max()
        return [
            f"{' and '.join(names)} cells lock: at nu = {nu:g} their mean stress scatters by {pressure:.0%} about its "
            "averages at the nodes, and contact pressures with it; use quadrangles or hexahedra, or quadratic elements "
            "(generate.to_quadratic)"
        ]
    if energy > BENDING and not axisymmetric:  # stresses at the axis scatter in any case
        projected = any(elements.get(name).dilatation is not None for name in names)
        soft = " or, with their mean dilatation, too soft" if projected and problem.field.averaged.any() else ""
        modes = "hexahedra or quadrangles with LinearElastic(incompatible_modes=True), " if linear else ""
        return [
            f"{' and '.join(names)} cells are too stiff{soft}, as in thin parts that bend: the error of their stress is "
            f"{energy:.0%} (energy norm of the difference from stress recovered at the nodes); use {modes}quadratic "
            "elements (generate.to_quadratic), or smaller ones"
        ]
    return []


# Excess of stiffness above which a warning is given, and the number of conjugate gradient iterations.
EXCESS, ITERATIONS = 0.05, 5
# Elements whose dilatation is averaged at the nodes for comparison.
AT_NODES = ("tri3", "tet4", "wedge6", "pyramid5")


class Comparison:
    """The forces S u of the excess stiffness, see the docstring of the module.

    Parameters
    ----------
    model : Model

    Attributes
    ----------
    elements : list of str
        Elements that may lock; may be empty.
    nu : float
        The largest Poisson's ratio of these elements [-].
    """

    def __init__(self, model: Model) -> None:
        self._model, self._field = model, model.material_field()
        nu, self._suspicious = _poisson_ratios(model, self._field)
        self.elements = [name for name in model.mesh.solids if self._may_lock(name).any()]
        nu_by_element = (float(nu[self._field.rows[name][self._may_lock(name)]].max()) for name in self.elements)
        self.nu = max(nu_by_element, default=0.0)

    def _may_lock(self, name: str) -> Mask:
        """Return which cells (n_cells,) of an element may lock."""
        numbers, treatment = self._field.rows[name], self._field.treatment
        bends = incompatible_modes.with_modes(name, treatment)
        treated = treatment[numbers] & 1 > 0 if bends is None else treatment[numbers] > 0
        return self._suspicious[numbers] & ((name in AT_NODES) | ~treated)

    def force(self, displacement: Array) -> Array:
        """Return the forces S u (n_points, dim) [force] for displacements u (n_points, dim) [length]."""
        mesh, kinematics, field = self._model.mesh, self._model.kinematics, self._field
        arguments = mesh, kinematics, field.moduli, field.rows, displacement
        stress = recovery.stress_at_points(*arguments, field.treatment)
        reference = recovery.stress_at_points(*arguments, field.treatment | self._suspicious)
        excess = {name: np.zeros_like(stress[name]) for name in self.elements}
        for name in self.elements:
            excess[name][..., :3] = (stress[name] - reference[name])[..., :3].mean(axis=2, keepdims=True)
        self._add_deviation_from_nodal_mean(reference, excess)
        return recovery.internal_force(mesh, kinematics, excess)

    def _add_deviation_from_nodal_mean(self, reference: dict[str, Array], excess: dict[str, Array]) -> None:
        """Add to `excess` the deviation of the mean pressures of cells from their means at the nodes of each material."""
        mesh, field, n = self._model.mesh, self._field, self._model.mesh.n_points
        nodes, pressure, sums = {}, {}, np.zeros((2, n * len(field.materials)))
        for name in (name for name in self.elements if name in AT_NODES):
            N, dN, weights = elements.get(name).tables
            axisymmetric = self._model.kinematics == "axisymmetric"
            volumes = cell_volumes(mesh.points[mesh.cells[name]], N, dN, axisymmetric) * weights
            volume = volumes.sum(axis=1)
            pressure[name] = (reference[name][..., :3].mean(axis=2) * volumes).sum(axis=1) / volume
            nodes[name] = mesh.cells[name] + n * field.material_numbers[name][:, None]
            np.add.at(sums[0], nodes[name], volume[:, None])
            np.add.at(sums[1], nodes[name], (volume * pressure[name])[:, None])
        mean = sums[1] / np.where(sums[0] > 0.0, sums[0], 1.0)
        for name in pressure:
            deviation = (pressure[name] - mean[nodes[name]].mean(axis=1)) * self._suspicious[field.rows[name]]
            excess[name][..., :3] += deviation[:, None, None]


def excess_of_stiffness(problem: Problem, u: Array, comparison: Comparison) -> float:
    """Return D over the elastic energy of displacements u (n_dofs,) [length], see the docstring of the module [-]."""
    system, n = problem.system, problem.model.n_dofs

    def excess(displacement: Array) -> Array:
        force = np.zeros(len(u))
        force[:n] = comparison.force(problem.displacement(displacement)).ravel()
        return force

    energy = 0.5 * float(u @ (system.K @ u))
    excess_force = excess(u)
    lower = 0.5 * float(u @ excess_force)
    zero, zero_lift = np.zeros(len(u)), np.zeros(len(u))
    residual = system.reduced(excess_force)
    direction, last_slope, snapshot = zero, 0.0, problem.solver.snapshot()
    for _ in range(ITERATIONS):
        step = problem.solver.load(residual).full_solution(zero)
        slope = float(residual @ step)
        if not slope > ROUND_OFF * energy:
            break
        direction = step + (slope / last_slope if last_slope else 0.0) * direction
        displacement_of_direction = system.displacement(direction, zero_lift)
        product = system.reduced(system.K @ displacement_of_direction - excess(displacement_of_direction))
        curvature = float(direction @ product)
        if not curvature > 0.0:
            break
        lower += 0.5 * slope**2 / curvature
        residual = residual - slope / curvature * product
        last_slope = slope
    problem.solver.put_back(snapshot)  # discards these loads, which do not belong to the analysis
    return lower / energy if energy > 0.0 else 0.0


def locking_warning(problem: Problem, u: Array) -> list[str]:
    """Return a warning where nearly incompressible elements are too stiff in the displacements u (n_dofs,)."""
    comparison = Comparison(problem.model)
    if not comparison.elements:
        return []
    excess = excess_of_stiffness(problem, u, comparison)
    if excess <= EXCESS:
        return []
    names = " and ".join(comparison.elements)
    if set(comparison.elements) <= set(AT_NODES):
        remedy = "use quadrangles or hexahedra, or quadratic elements (generate.to_quadratic)"
    else:
        remedy = 'give the material volumetric="mean_dilatation"'
    return [
        f"{names} cells lock: at nu = {comparison.nu:g}, nearly incompressible, they make the model about "
        f"{excess:.0%} too stiff (elastic energy under the same forces); {remedy}"
    ]
