"""A posteriori measure of locking: stresses of linear elements compared with recovered, continuous ones.

The energy of the difference, relative to that of the solution, estimates the error (Zienkiewicz and Zhu, Int. J. Numer.
Meth. Engng 24, 1987). In nearly incompressible cells only the mean stress is used: the deviator stays smooth, while the mean
stress, and with it the contact pressure, alternates from cell to cell (Hughes, The finite element method, 1987, section
4.3.7).

`relative_excess` measures volumetric locking by a lower bound of the excess stiffness. Let K be the stiffness of the model,
K - S that of a reference without locking, and S the excess. For the forces of the solution u, the potential energy of the
reference is lower than that of the model by

    D = u.S u / 2 + max over x of (x.S u - x.(K - S) x / 2),

and D over the elastic energy u.K u / 2 is the additional compliance of the reference under the same forces. It equals the
excess of stiffness where forces act, and is smaller where displacements are prescribed. A few conjugate gradient iterations,
preconditioned by K^-1, approach the maximum from below. The contact forces are fixed.

The reference uses the projected dilatation of `elasticity.dilatation`. Linear triangles, tetrahedra, wedges and pyramids lock
with a projected dilatation or have none; for these, the reference uses the mean dilatation of the cells at each node (Bonet
and Burton, Commun. Numer. Meth. Engng 14, 1998).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse.linalg import LinearOperator, cg

from fastcontact.analysis.criteria import WARNING_ERROR, WARNING_RATIO
from fastcontact.analysis.problem import Problem
from fastcontact.analysis.state import State
from fastcontact.arrays import Array, Mask
from fastcontact.elasticity import incompatible_modes, recovery
from fastcontact.elasticity.energy import cell_volumes, integration_rule, twice_energy_density
from fastcontact.elasticity.incompatible_modes import ELEMENTS_WITH_MODES
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
# Estimated error in the energy norm of parts that bend. It is 52 to 67 % in thin parts that carry a third of the exact load.
# Elsewhere a warning is given if its square, the relative error of the stiffness, exceeds WARNING_ERROR: a pad of tetrahedra,
# whose force is 9 % too large, has an error of 25 %.
BENDING = 0.45
# Remedies for elements that lock with any kind of integration, and for other elements.
OTHER_ELEMENTS = "use quadrangles or hexahedra, or quadratic elements (generate.to_quadratic)"
MEAN_DILATATION = 'give the material volumetric="mean_dilatation"'
# Elements that are over-constrained by one dilatation per cell.
SIMPLICES = ("tri3", "tet4")


def _stress_scatter(
    problem: Problem, state: State, step: StepResult, names: Sequence[str]
) -> tuple[float, float, float]:
    """Return by how much stresses, and mean stresses, in the elements `names` differ from recovered ones [-].

    The first is the energy norm of the difference between recovered and computed stress of all bodies, over that of the
    computed one, where bodies yield over the root of twice the elastic and plastic work: the residual stresses of unloaded
    bodies scatter by 72 % about recovered ones even where eight cells across a beam represent bending well.

    The second is the largest of this ratio and, unless bodies yield, those of single bodies with a notable part of the
    energy. The third is the same as the first for the root mean square of the mean stress in nearly incompressible triangles
    and tetrahedra.
    """
    model, field, mesh = problem.model, problem.field, problem.model.mesh
    thermal, initial = (step.iterations.get(key, ()) for key in ("temperature_factors", "initial_factors"))
    offset = model.stress_offset(thermal, initial, field, step.temperature)
    if not names or (offset is not None and problem.bodies is None):  # free expansion only causes round-off stresses
        return 0.0, 0.0, 0.0
    stress: CellStress | PointStress
    plastic_work, largest_work = 0.0, state.work.largest if state.work else 0.0
    if problem.bodies is None:
        stress = CellStress(mesh, model.kinematics, field.moduli, step.displacement, field.treatment)
    else:
        deformed = problem.deformed(state.u, state, model.expanding_rise(thermal, step.temperature), tangent=False)
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
        return 0.0, 0.0, 0.0
    ratio = total = float(difference / np.sqrt(energy**2 + 2.0 * plastic_work))
    if not plastic_work:  # a thin part may bend on a body that stores more energy
        notable = sums[sums[:, 1] > WARNING_RATIO * energy**2]
        ratio = float(np.sqrt(notable[:, 0] / notable[:, 1]).max(initial=ratio))
    mean_stress = float(mean_difference / mean) if mean > 0.0 else 0.0
    return (total, ratio, mean_stress) if offset is None else (0.0, 0.0, mean_stress)


def _scatter_integrals(problem: Problem, stress: CellStress | PointStress, name: str, recovered: Array) -> Array:
    """Return integrals (n_bodies, 4): energies of the difference and of the stress, then the squares of their means."""
    mesh, field, element = problem.model.mesh, problem.field, elements.get(name)
    xi, weights = integration_rule(element, 2)
    N, dN = np.ascontiguousarray(element.shape(xi)), element.gradient(xi)
    body, n = bodies(mesh)[1], len(mesh.cells[name])
    nearly_incompressible = field.averaged if problem.bodies else _poisson_ratios(problem.model, field)[1]
    selected = nearly_incompressible & (name in SIMPLICES)
    sums = np.zeros((body.max() + 1, 4))
    for rows in np.array_split(np.arange(n), n * dN.nbytes // BATCH + 1):
        cells, numbers = mesh.cells[name][rows], field.rows[name][rows]
        computed = stress.at(name, xi, cells, field.moduli_rows[name][rows], rows)
        difference = N @ recovered[rows] - computed
        volume = cell_volumes(mesh.points[cells], N, dN, problem.model.kinematics == "axisymmetric") * weights
        compliance, mean_weights = field.compliance[numbers][:, None], volume * selected[numbers, None]
        integrals = [twice_energy_density(values, compliance) * volume for values in (difference, computed)]
        integrals += [values[..., :3].mean(axis=2) ** 2 * mean_weights for values in (difference, computed)]
        np.add.at(sums, body[cells[:, 0]], np.sum(integrals, axis=2).T)
    return sums


def _poisson_ratios(model: Model, field: MaterialField) -> tuple[Array, Mask]:
    """Return the largest Poisson's ratios (n,) of a material field, and where they are suspicious.

    They are -1 for materials other than `LinearElastic`.
    """
    laws = [material for material, _ in model.materials]
    nu = np.array([law.largest_nu if isinstance(law, LinearElastic) else -1.0 for law in laws])[field.owner]
    return nu, (nu >= SUSPICIOUS) & (model.kinematics != "plane_stress")


def locking_warnings(problem: Problem, state: State, step: StepResult) -> list[str]:
    """Return a warning where cells are too stiff, because they lock or bend."""
    volumetric = locking_warning(problem, state.u) if problem.bodies is None else []
    return volumetric or _scatter_warnings(problem, state, step)


def _scatter_warnings(problem: Problem, state: State, step: StepResult) -> list[str]:
    """Return a warning where the stresses of linear cells differ much from recovered ones."""
    model, linear = problem.model, problem.bodies is None
    have_modes = all(material.incompatible_modes for material, _ in model.materials)
    bending = ELEMENTS_WITH_MODES if have_modes else ()
    names = [name for name in model.mesh.solids if elements.get(name).order == 1 and name not in bending]
    total, energy, mean_stress = _stress_scatter(problem, state, step, names)
    if mean_stress > ALTERNATING:
        simplices = " and ".join(name for name in names if name in SIMPLICES)
        material, effect = "in a nearly incompressible material", "forces are too large"
        if linear:
            nu = _poisson_ratios(model, problem.field)[0].max()
            material, effect = f"at nu = {nu:g}", "contact pressures with it"
        return [
            f"{simplices} cells lock: {material} their mean stress scatters by {mean_stress:.0%} about its averages at the "
            f"nodes, and {effect}; {OTHER_ELEMENTS}"
        ]
    if (
        max(total**2 / WARNING_ERROR, energy / BENDING) > 1.0 and model.kinematics != "axisymmetric"
    ):  # stresses at the axis scatter in any case
        projected = any(elements.get(name).dilatation is not None for name in names)
        soft = " or, with their mean dilatation, too soft" if projected and problem.field.averaged.any() else ""
        modes = "hexahedra or quadrangles with LinearElastic(incompatible_modes=True), " if linear else ""
        bent = ", as in thin parts that bend" if energy > BENDING else ""
        return [
            f"{' and '.join(names)} cells are too stiff{soft}{bent}: the error of their stress is {energy:.0%} (energy norm "
            f"of the difference from stress recovered at the nodes), and that of forces or displacements about "
            f"{total**2:.0%}; use {modes}quadratic elements (generate.to_quadratic), or smaller ones"
        ]
    return []


# Number of conjugate gradient iterations. With one, `test_the_excess_is_that_of_two_solutions` fails.
ITERATIONS = 5
# Elements whose dilatation is averaged at the nodes for comparison.
AT_NODES = ("tri3", "tet4", "wedge6", "pyramid5")


class ExcessStiffness:
    """The stiffness S of locking elements in excess of the reference, see the docstring of the module.

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


def relative_excess(problem: Problem, u: Array, excess: ExcessStiffness) -> float:
    """Return D over the elastic energy of displacements u (n_dofs,) [length], see the docstring of the module [-]."""
    system, n, zero = problem.system, problem.model.n_dofs, np.zeros(len(u))

    def excess_force(displacement: Array) -> Array:
        return np.pad(excess.force(problem.displacement(displacement)).ravel(), (0, len(u) - n))

    def reference_force(v: Array) -> Array:
        displacement = system.displacement(v, zero)
        return system.reduced(system.K @ displacement - excess_force(displacement))

    def preconditioned(residual: Array) -> Array:
        return problem.solver.load(residual).full_solution(zero)

    energy, force, snapshot = 0.5 * float(u @ (system.K @ u)), excess_force(u), problem.solver.snapshot()
    right_side, shape = system.reduced(force), (len(u), len(u))
    operator, preconditioner = LinearOperator(shape, reference_force), LinearOperator(shape, preconditioned)
    x, _ = cg(operator, right_side, rtol=ROUND_OFF, maxiter=ITERATIONS, M=preconditioner)
    problem.solver.put_back(snapshot)  # discards these loads, which do not belong to the analysis
    # For iterates x of conjugate gradients from zero, the maximised expression is x.S u / 2.
    return 0.5 * float(u @ force + x @ right_side) / energy if energy > 0.0 else 0.0


def locking_warning(problem: Problem, u: Array) -> list[str]:
    """Return a warning where nearly incompressible elements are too stiff in the displacements u (n_dofs,)."""
    excess = ExcessStiffness(problem.model)
    ratio = relative_excess(problem, u, excess) if excess.elements else 0.0
    if ratio <= WARNING_ERROR:
        return []
    names, simple = " and ".join(excess.elements), set(excess.elements) <= set(AT_NODES)
    return [
        f"{names} cells lock: at nu = {excess.nu:g}, nearly incompressible, they make the model about {ratio:.0%} too stiff "
        f"(elastic energy under the same forces); {OTHER_ELEMENTS if simple else MEAN_DILATATION}"
    ]
