"""A posteriori measure of locking: stresses of linear elements compared with recovered, continuous ones.

The energy of the difference, relative to that of the solution, estimates the error (Zienkiewicz and Zhu, Int. J. Numer.
Meth. Engng 24, 1987). In nearly incompressible cells only the mean stress is used: the deviator stays smooth, while the mean
stress, and with it the contact pressure, alternates from cell to cell (Hughes, The finite element method, 1987, section
4.3.7).
"""

from __future__ import annotations

import numpy as np

from fastcontact.analysis.problem import Problem
from fastcontact.analysis.state import State
from fastcontact.arrays import Array
from fastcontact.elasticity.cell_stress import CellStress
from fastcontact.elasticity.energy import cell_volumes, elastic_energy, integration_rule
from fastcontact.elasticity.incompatible_modes import BENDING as BENDING_ELEMENTS
from fastcontact.elasticity.materials import LinearElastic
from fastcontact.elasticity.recovery import BATCH
from fastcontact.elasticity.smoothed_stress import smoothed_stress
from fastcontact.mesh import elements
from fastcontact.results.step import StepResult
from fastcontact.round_off import LENGTH_ROUND_OFF

# Poisson's ratio above which the mean stress is examined, and its scatter above which a warning is given. Under a sphere
# it scatters by 14 to 23 % at nu = 0.3, where the pressure is accurate, by 38 to 47 % at 0.45 and by 66 to 75 % at
# 0.48, where the error of the pressure at the pole is 15 to 27 % and 27 to 43 %.
SUSPICIOUS, ALTERNATING = 0.45, 0.3
# Error in the energy norm above which a warning is given. It is 25 % under the same sphere on coarse triangles, and 52 to
# 67 % in thin parts that carry a third of the exact load in bending.
BENDING = 0.45
# Elements that are over-constrained by one dilatation per cell.
SIMPLICES = ("tri3", "tet4")


class StressScatter:
    """Energy and mean stress of linear cells, and their difference from the recovered stresses.

    Parameters
    ----------
    problem : Problem
    step : StepResult

    Attributes
    ----------
    elements : list of str
        Names of the linear elements without incompatible modes; may be empty.
    energy : float
        Energy norm of the difference between recovered and computed stress, over that of the computed one [-].
    pressure : float
        The same for the root mean square of the mean stress in nearly incompressible triangles and tetrahedra [-].
    nu : float
        The largest Poisson's ratio of all materials [-].
    """

    def __init__(self, problem: Problem, step: StepResult) -> None:
        field, mesh = problem.field, problem.model.mesh
        has_modes = all(material.incompatible_modes for material, _ in problem.model.materials)
        self.elements = [
            name for name in mesh.solids
            if elements.get(name).order == 1 and not (has_modes and name in BENDING_ELEMENTS)
        ]  # fmt: skip
        self.energy = self.pressure = 0.0
        laws = [material for material, _ in problem.model.materials]
        nu = np.array([law.largest_nu if isinstance(law, LinearElastic) else -1.0 for law in laws])[field.owner]
        self._nearly = (nu >= SUSPICIOUS) & (problem.model.kinematics != "plane_stress")
        self.nu = float(nu.max(initial=-1.0))
        thermal, initial = (step.iterations.get(key, ()) for key in ("temperature_factors", "initial_factors"))
        offset = problem.model.stress_offset(thermal, initial, field, step.temperature)
        if not self.elements or offset is not None:  # free thermal expansion only causes round-off stresses
            return
        given = mesh, problem.model.kinematics, field
        smooth = smoothed_stress(*given, step.displacement, offset)
        stress = CellStress(*given[:2], field.moduli, step.displacement, field.treatment, offset)
        sums = sum(self._sums(problem, stress, name, smooth[name]) for name in self.elements)
        off, energy, off_mean, mean = np.sqrt(sums)
        size = np.ptp(mesh.points, axis=0)
        strain = np.abs(step.displacement).max() / size.max()
        # Root of the energy if the bounding box were filled with the stiffest material under this strain.
        stretched = strain * np.sqrt(field.moduli.max() * np.prod(size))
        if energy > LENGTH_ROUND_OFF * stretched:
            self.energy = float(off / energy)
            self.pressure = float(off_mean / mean) if mean > 0.0 else 0.0

    def _sums(self, problem: Problem, stress: CellStress, name: str, smooth: Array) -> Array:
        """Return integrals (4,) over cells: energies and squared mean stresses, of the difference and of the stress."""
        mesh, field, element = problem.model.mesh, problem.field, elements.get(name)
        xi, weights = integration_rule(element, 2)
        N, dN = np.ascontiguousarray(element.shape(xi)), np.ascontiguousarray(element.gradient(xi))
        simplex, sums = element.n_corners == element.dim + 1, np.zeros(4)
        n = len(mesh.cells[name])
        for rows in np.array_split(np.arange(n), n * dN.nbytes // BATCH + 1):
            cells, numbers = mesh.cells[name][rows], field.rows[name][rows]
            rough = stress.at(name, xi, cells, field.loops[name][rows], rows)
            off = N @ smooth[rows] - rough
            volume = cell_volumes(mesh.points[cells], N, dN, problem.model.kinematics == "axisymmetric") * weights
            compliance, nearly = field.compliance[numbers][:, None], volume * (self._nearly[numbers] & simplex)[:, None]
            sums += [
                (elastic_energy(off, compliance) * volume).sum(), (elastic_energy(rough, compliance) * volume).sum(),
                (off[..., :3].mean(axis=2) ** 2 * nearly).sum(), (rough[..., :3].mean(axis=2) ** 2 * nearly).sum(),
            ]  # fmt: skip
        return sums


def nonlinear_scatter_warnings(problem: Problem, state: State, step: StepResult) -> list[str]:
    """Return a warning where the mean stress of nearly incompressible nonlinear triangles and tetrahedra alternates."""
    mesh, bodies = problem.model.mesh, problem.bodies
    names = [name for name in SIMPLICES if name in mesh.solids]
    nearly = problem.field.averaged & (problem.model.kinematics != "plane_stress")
    if bodies is None or not names or not nearly.any():
        return []
    rise = problem.model.expanding_rise(step.iterations.get("temperature_factors", ()), step.temperature)
    stress, off, whole = problem.deformed(state.u, state, rise).stress, 0.0, 0.0
    for name in names:
        cells = mesh.cells[name][nearly[problem.field.rows[name]]]
        mean = stress[name][nearly[problem.field.rows[name]]][..., :3].mean(axis=(1, 2))
        total, count = (np.bincount(cells.ravel(), part, mesh.n_points) for part in (mean.repeat(cells.shape[1]), None))
        smooth = (total / np.maximum(count, 1))[cells].mean(axis=1)
        off, whole = off + float(((mean - smooth) ** 2).sum()), whole + float((mean**2).sum())
    if off <= ALTERNATING**2 * whole:
        return []
    return [
        f"{' and '.join(names)} cells lock: in a nearly incompressible material their mean stress scatters by "
        f"{np.sqrt(off / whole):.0%} about its averages at the nodes, and forces are too large; use quadrangles "
        "or hexahedra, or quadratic elements (generate.to_quadratic)"
    ]


def scatter_warnings(problem: Problem, step: StepResult) -> list[str]:
    """Return a warning where the stresses of linear cells differ much from recovered ones."""
    measure = StressScatter(problem, step)
    names = " and ".join(measure.elements)
    if measure.pressure > ALTERNATING:
        return [
            f"{names} cells lock: at nu = {measure.nu:g} their mean stress scatters by {measure.pressure:.0%} about its "
            "averages at the nodes, and contact pressures with it; use quadrangles or hexahedra, or quadratic elements "
            "(generate.to_quadratic)"
        ]
    if (
        measure.energy > BENDING and problem.model.kinematics != "axisymmetric"
    ):  # cells at the axis scatter by this amount anyway
        return [
            f"{names} cells are too stiff, as in thin parts that bend: the error of their stress is {measure.energy:.0%} "
            "(energy norm of the difference from stress recovered at the nodes); use hexahedra or quadrangles with "
            "LinearElastic(incompatible_modes=True), quadratic elements (generate.to_quadratic), or smaller ones"
        ]
    return []
