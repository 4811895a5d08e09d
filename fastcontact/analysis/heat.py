"""Steady heat conduction of a model, prepared for analysis: temperatures for given contact conductances."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.sparse import bsr_array, coo_array, csr_array

from fastcontact._tools.records import field, record, replace
from fastcontact.analysis.criteria import Criteria
from fastcontact.arrays import Array, Mask, Numbers
from fastcontact.errors import ConvergenceError
from fastcontact.heat.conduction import Conduction, undetermined_bodies
from fastcontact.heat.loads import Film, Heating
from fastcontact.linear import choice
from fastcontact.mesh.topology import bodies
from fastcontact.model.model import Model
from fastcontact.model.ramp import Ramp, Table, combined, sums_by_ramp
from fastcontact.model.rigid_motions import body_name
from fastcontact.round_off import SUM_ROUND_OFF

ByRamp = Mapping[Table | None, Array]


@record
class Temperatures:
    """Steady temperatures and heat flows.

    Attributes
    ----------
    rise : ndarray (n_points,)
        Temperature rise above the reference temperature [temperature].
    reaction : ndarray (n_points,)
        Heat flow into the nodes with prescribed temperatures [power].
    balance : dict
        See `StepResult.heat` [power].
    fluxes : dict of str to ndarray (m,)
        Heat flux at the secondary nodes of each contact pair that conducts heat [power / area].
    """

    rise: Array
    reaction: Array
    balance: dict[str, Any]
    fluxes: dict[str, Array] = field(default_factory=dict)


@record
class ThermalLoads:
    """Heat loads and films of a model.

    Attributes
    ----------
    films : csr_array (n_points, n_points)
        Matrix of all films [power / temperature].
    powers, ambient : dict of ramp table to ndarray (n_points,)
        For each ramp table, at multiplier 1: nodal powers of loads, and those of films due to the temperature rise of their
        surroundings [power].
    """

    films: csr_array
    powers: ByRamp
    ambient: ByRamp


def thermal_loads(model: Model, displacement: Array | None = None) -> ThermalLoads:
    """Return the heat loads and films of a model, on areas and volumes deformed by a displacement (n_points, dim)."""
    mesh, films = model.mesh, [load for load in model.heat_loads if isinstance(load, Film)]
    deformed = mesh if displacement is None else mesh.replace(points=mesh.points + displacement)
    geometry = mesh, model.kinematics, deformed
    powers = sums_by_ramp((load.ramp, load.power(*geometry)) for load in model.heat_loads if isinstance(load, Heating))
    exchanges = [(film.ramp, *film.exchange(*geometry, model.reference_temperature)) for film in films]
    matrix = sum((matrix for _, matrix, _ in exchanges), csr_array((mesh.n_points, mesh.n_points)))
    return ThermalLoads(csr_array(matrix), powers, sums_by_ramp((ramp, power) for ramp, _, power in exchanges))


@record
class Heat:
    """Heat conduction of a model, prepared for analysis; temperatures are rises above the reference temperature.

    Attributes
    ----------
    model : Model
    ramp : Ramp
    criteria : Criteria
    conduction : Conduction
        Conduction in the reference configuration.
    matrix : csr_array (n_points, n_points)
        Conductivity matrix in that configuration [power / temperature].
    loads : ThermalLoads
        Loads and films in that configuration.
    merged : csr_array (n_points, n_points)
        Matrix that maps the temperatures of merged nodes to those of all nodes [-].
    body : ndarray of int (n_points,)
        Body of each node, -1 for none.
    fixed : ndarray of bool (n_points,)
        Merged nodes with a prescribed temperature.
    prescribed : dict of ramp table to ndarray (n_points,)
        For each ramp table, prescribed temperature rises at multiplier 1 [temperature].
    linear_solver : str
    linear_tolerance : float
    """

    model: Model
    ramp: Ramp
    criteria: Criteria
    conduction: Conduction
    matrix: csr_array
    loads: ThermalLoads
    merged: csr_array
    body: Numbers
    fixed: Mask
    prescribed: ByRamp
    linear_solver: str
    linear_tolerance: float

    @property
    def finite_strain(self) -> bool:
        """Whether heat is conducted in the deformed bodies."""
        return self.model.strain == "finite"

    def conduction_at(self, displacement: Array) -> Conduction:
        """Return the conduction; with finite strains, in the configuration deformed by `displacement` (n_points, dim)."""
        return replace(self.conduction, displacement=displacement) if self.finite_strain else self.conduction

    def temperatures(
        self, instant: float, displacement: Array | None = None, contact: csr_array | None = None,
        friction: Array | None = None, obstacles: tuple[csr_array, Array] | None = None,
    ) -> Temperatures:  # fmt: skip
        """Return the temperatures at an instant of the ramp.

        Parameters
        ----------
        instant : float
        displacement : ndarray (n_points, dim), optional
            Displacement of the bodies, used with finite strains [length].
        contact : csr_array (n_points, n_points), optional
            Conductivity matrix of the contacts [power / temperature].
        friction : ndarray (n_points,), optional
            Nodal powers of friction [power].
        obstacles : (csr_array (n_points, n_points), ndarray (n_points,)), optional
            Films between bodies and rigid obstacles: matrix [power / temperature], and nodal powers due to the temperature
            rise of the obstacles [power].

        Raises
        ------
        ConvergenceError
            If open contacts isolate a body, so that its temperature is undetermined, or heat is not in balance.
        """
        n = (self.model.mesh.n_points,)
        conductivity, thermal = self.matrix, self.loads
        if displacement is not None and self.finite_strain:
            conductivity, thermal = self.conduction_at(displacement).matrix(), thermal_loads(self.model, displacement)
        by_ramps = self.prescribed, thermal.powers, thermal.ambient
        rise, loads, ambient = (combined(by_ramp, self.ramp, instant, n) for by_ramp in by_ramps)
        friction_power = np.zeros(n) if friction is None else friction
        conductivity = conductivity if contact is None else csr_array(conductivity + contact)
        films = thermal.films
        if obstacles is not None:
            films, ambient = csr_array(films + obstacles[0]), ambient + obstacles[1]
        self._check_determined(contact, films)
        P, power = self.merged, loads + ambient + friction_power
        A, f = csr_array(P.T @ (conductivity + films) @ P), P.T @ power
        in_cells = np.zeros(n, bool)
        in_cells[P.indices] = self.body >= 0
        free = np.flatnonzero(in_cells & ~self.fixed)
        rise = np.where(self.fixed, rise, 0.0)
        if len(free):
            dim, free_A = self.model.mesh.dim, csr_array(A[free][:, free])
            solver = choice.make(self.linear_solver, dim=dim, n_dofs=len(free), tolerance=self.linear_tolerance)
            # Sums of sparse matrices drop entries that cancel, possibly on one side of the diagonal only. The factorisation
            # requires a symmetric pattern.
            free_A = csr_array(0.5 * (free_A + free_A.T))
            free_A.sort_indices()
            blocks = bsr_array((free_A.data[:, None, None], free_A.indices, free_A.indptr), shape=free_A.shape)
            solver.prepare(blocks, np.ones((len(free), 1)))
            rise[free] = solver.load(f[free] - (A @ rise)[free]).full_solution(np.zeros(len(free)))
        heat_flow = A @ rise - f
        reaction = np.where(self.fixed, heat_flow, 0.0)
        round_off = SUM_ROUND_OFF * float((abs(A) @ np.abs(rise)).max())
        rise = P @ rise
        film_power = ambient - films @ rise
        flows = reaction, loads, film_power, friction_power, P.T @ (conductivity @ rise)
        largest = max(float(np.abs(powers).max()) for powers in flows)
        residual = float(np.abs(heat_flow[free]).max(initial=0.0))
        if residual > max(self.criteria.relative * largest, round_off):
            raise ConvergenceError(
                f"heat is out of balance by {residual:.3g} at a node, above {self.criteria.relative:g} of the largest heat "
                f"flow {largest:.3g}: use the direct solver, or check for conductivities that differ by many "
                "orders of magnitude",
                smaller_steps_help=False,
            )
        sums = {"supports": reaction, "loads": loads, "films": film_power, "friction": friction_power}
        return Temperatures(rise, reaction, {**{k: float(v.sum()) for k, v in sums.items()}, "imbalance": residual})

    def _check_determined(self, contact: csr_array | None, films: csr_array) -> None:
        """Raise a ConvergenceError if the temperature of a body is undetermined."""
        determined = self.merged @ self.fixed + films.diagonal() > 0.0
        pairs = coo_array(self.merged if contact is None else self.merged + contact)
        conducting = np.stack([pairs.row, pairs.col], axis=1)[pairs.data != 0.0]
        isolated = undetermined_bodies(self.body, determined, conducting)
        if len(isolated):
            raise ConvergenceError(
                f"no heat reaches body {body_name(self.model.mesh, self.body, isolated[0])}: its contacts are open or "
                "conduct nothing in this step, so that nothing determines its temperature; add a film, or a conductance "
                "across gaps"
            )


def prepared_heat(model: Model, ramp: Ramp, criteria: Criteria, linear_solver: str, tolerance: float) -> Heat | None:
    """Return the heat conduction of a checked model; None if the model does not conduct heat."""
    if not model.conducts:
        return None
    conduction, merged_node, n = model.conduction(), model.nodes_of_temperatures(), model.mesh.n_points
    merged = csr_array((np.ones(n), merged_node, np.arange(n + 1)), shape=(n, n))
    return Heat(
        model, ramp, criteria, conduction, conduction.matrix(), thermal_loads(model), merged, bodies(model.mesh)[1],
        *model.fixed_temperatures(), linear_solver, tolerance,
    )  # fmt: skip
