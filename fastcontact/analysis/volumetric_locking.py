"""Volumetric locking: a lower bound of the excess stiffness, computed from the solution.

Let K be the stiffness of the model, K - S that of a reference without locking, and S the excess. For the forces of the
solution u, the potential energy of the reference is lower than that of the model by

    D = u.S u / 2 + max over x of (x.S u - x.(K - S) x / 2),

and D over the elastic energy u.K u / 2 is the additional compliance of the reference under the same forces. It equals the
excess of stiffness where forces act, and is smaller where displacements are prescribed. A few conjugate gradient iterations,
preconditioned by K^-1, approach the maximum from below. The contact forces are fixed.

The reference uses the projected dilatation of `elasticity.dilatation`; in linear triangles, tetrahedra, wedges and pyramids,
which lock with it or have none, it uses the mean dilatation of the cells at each node (Bonet and Burton, Commun. Numer. Meth.
Engng 14, 1998).
"""

from __future__ import annotations

import numpy as np

from fastcontact.analysis.problem import Problem
from fastcontact.analysis.stress_scatter import SUSPICIOUS
from fastcontact.arrays import Array, Mask
from fastcontact.elasticity import incompatible_modes, recovery
from fastcontact.elasticity.energy import cell_volumes
from fastcontact.elasticity.materials import LinearElastic
from fastcontact.mesh import elements
from fastcontact.model.model import Model
from fastcontact.round_off import ROUND_OFF

# Excess of stiffness above which a warning is given, and the number of conjugate gradient iterations.
EXCESS, ITERATIONS = 0.05, 5
# Elements whose dilatation is averaged at the nodes for comparison.
AT_NODES = ("tri3", "tet4", "wedge6", "pyramid5")


class Comparison:
    """The forces S u of the excess stiffness; see the module.

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
        self._model = model
        field = model.material_field()
        self._moduli, self._material = field.moduli, field.rows
        self._treatment, self._owner = field.treatment, field.owner
        nu = np.full(len(self._moduli), -1.0)  # only isotropic materials have a mean dilatation; modes do not lock
        for number, (material, _) in enumerate(model.materials):
            if isinstance(material, LinearElastic):
                nu[field.owner == number] = material.largest_nu
        self._suspicious = (nu >= SUSPICIOUS) & (model.kinematics != "plane_stress")
        self._cells = {name: rows for name in model.mesh.solids if (rows := self._may_lock(name)).any()}
        self.elements = list(self._cells)
        self.nu = max((float(nu[self._material[name][rows]].max()) for name, rows in self._cells.items()), default=0.0)

    def _may_lock(self, name: str) -> Mask:
        """Return which cells (n_cells,) of an element may lock."""
        numbers = self._material[name]
        bends = incompatible_modes.asked(name, self._treatment)
        treated = self._treatment[numbers] & 1 > 0 if bends is None else self._treatment[numbers] > 0
        return self._suspicious[numbers] & ((name in AT_NODES) | ~treated)

    def force(self, displacement: Array) -> Array:
        """Return the forces S u (n_points, dim) [force] for displacements u (n_points, dim) [length]."""
        mesh, kinematics = self._model.mesh, self._model.kinematics
        given = mesh, kinematics, self._moduli, self._material, displacement
        stress = recovery.stress_at_points(*given, self._treatment)
        reference = recovery.stress_at_points(*given, self._treatment | self._suspicious)
        surplus = {name: np.zeros_like(stress[name]) for name in self._cells}
        for name in self._cells:
            surplus[name][..., :3] = (stress[name] - reference[name])[..., :3].mean(axis=2, keepdims=True)
        self._add_beyond_nodal_mean(reference, surplus)
        return recovery.internal_force(mesh, kinematics, surplus)

    def _add_beyond_nodal_mean(self, reference: dict[str, Array], surplus: dict[str, Array]) -> None:
        """Add to `surplus` the deviation of cell mean pressures from the nodal means, material by material."""
        mesh, names = self._model.mesh, [name for name in self._cells if name in AT_NODES]
        volume, pressure = {}, {}
        for name in names:
            N, dN, weights = elements.get(name).tables
            corners = mesh.points[mesh.cells[name]]
            volumes = cell_volumes(corners, N, dN, self._model.kinematics == "axisymmetric") * weights
            volume[name] = volumes.sum(axis=1)
            at_points = reference[name][..., :3].mean(axis=2)
            pressure[name] = (at_points * volumes).sum(axis=1) / volume[name]
        for number in np.unique(self._owner[self._suspicious]):
            whole, work = np.zeros((2, mesh.n_points))
            rows = {name: np.flatnonzero(self._owner[self._material[name]] == number) for name in names}
            for name in names:
                cells = mesh.cells[name][rows[name]]
                for node in cells.T:
                    np.add.at(whole, node, volume[name][rows[name]])
                    np.add.at(work, node, (volume[name] * pressure[name])[rows[name]])
            mean = work / np.where(whole > 0.0, whole, 1.0)
            for name in names:
                beyond = pressure[name][rows[name]] - mean[mesh.cells[name][rows[name]]].mean(axis=1)
                surplus[name][rows[name], :, :3] += beyond[:, None, None]


def excess_of_stiffness(problem: Problem, u: Array, comparison: Comparison) -> float:
    """Return D over the elastic energy of displacements u (n_dofs,) [length], see the module [-]."""
    system, n = problem.system, problem.model.n_dofs

    def surplus(displacement: Array) -> Array:
        force = np.zeros(len(u))
        force[:n] = comparison.force(problem.displacement(displacement)).ravel()
        return force

    energy = 0.5 * float(u @ (system.K @ u))
    own_energy = surplus(u)
    lower = 0.5 * float(u @ own_energy)
    zero, still = np.zeros(len(u)), np.zeros(len(u))
    residual = system.reduced(own_energy)
    direction, before, kept = zero, 0.0, problem.solver.snapshot()
    for _ in range(ITERATIONS):
        step = problem.solver.load(residual).full_solution(zero)
        slope = float(residual @ step)
        if not slope > ROUND_OFF * energy:
            break
        direction = step + (slope / before if before else 0.0) * direction
        moved = system.displacement(direction, still)
        product = system.reduced(system.K @ moved - surplus(moved))
        curvature = float(direction @ product)
        if not curvature > 0.0:
            break
        lower += 0.5 * slope**2 / curvature
        residual = residual - slope / curvature * product
        before = slope
    problem.solver.put_back(kept)  # discards these loads, which do not belong to the analysis
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
