"""The ramp: per load step pair, constrain, solve, recover, hand over the result."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array

from fastcontact import active_set, friction, linear, recovery
from fastcontact.assembly import rigid_modes, stiffness
from fastcontact.contact.constraints import Constraints, stacked
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.result import contact_result
from fastcontact.errors import ConvergenceError, FastcontactWarning, ModelError
from fastcontact.model import Model
from fastcontact.ramp import Ramp, linear_ramp
from fastcontact.results import StepResult
from fastcontact.topology import bodies
from fastcontact.validation import body_name, penetration

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# Strain and rotation beyond which linear kinematics are worth a warning.
SMALL = 0.1
# One active-set iteration per pairing is cheapest near the solution but may cycle; after so many, settle the set first.
SEMISMOOTH_UPDATES = 8


@dataclass(frozen=True)
class Criteria:
    """When a load step counts as converged.

    Parameters
    ----------
    relative : float
        Largest out-of-balance force over the largest support reaction or contact force (RESI_GLOB_RELA).
    absolute : float, optional
        Largest out-of-balance force [force] that is small enough by itself (RESI_GLOB_MAXI). Without forces a relative
        criterion is 0/0; then, and by default, the bound is the round-off of the internal forces.
    geometry_updates : int or None
        How many times to re-pair on the deformed configuration after the first pairing of a step; None: until the
        displacement changes by less than `geometry` of its largest component.
    geometry : float
        See `geometry_updates`.
    max_geometry_updates, max_active_set_iterations : int
        Limits per step, and per pairing.
    """

    relative: float = 1e-6
    absolute: float | None = None
    geometry_updates: int | None = None
    geometry: float = 1e-11
    max_geometry_updates: int = 60
    max_active_set_iterations: int = 200

    def __post_init__(self) -> None:
        if not self.relative > 0 or not self.geometry > 0:
            raise ModelError("the convergence criteria `relative` and `geometry` must be positive")
        if self.geometry_updates is not None and self.geometry_updates < 0:
            raise ModelError(f"geometry_updates = {self.geometry_updates} must be None or a whole number >= 0")


def solve(
    model: Model,
    ramp: Ramp | None = None,
    *,
    linear_solver: str = "auto",
    linear_tolerance: float = 1e-10,
    criteria: Criteria | None = None,
    on_step: Callable[[StepResult], None] | None = None,
) -> list[StepResult]:
    """Solve a model along a load ramp.

    Parameters
    ----------
    model : Model
        Checked whole before any numerics.
    ramp : Ramp, optional
        By default 20 equal steps.
    linear_solver : str
        ``"direct"``, ``"amg"`` or ``"auto"``.
    linear_tolerance : float
        Relative residual of iterative linear solvers.
    criteria : Criteria, optional
        Convergence criteria and the handling of the geometry.
    on_step : callable, optional
        Called with every `StepResult` as soon as its step has converged, e.g. ``ResultWriter.write``.

    Returns
    -------
    list of StepResult

    Raises
    ------
    MeshError, ModelError, ContactError
        If the model is wrong.
    ConvergenceError
        If a step does not converge; steps before it have been handed to `on_step`.

    Warns
    -----
    FastcontactWarning
        If bodies interpenetrate where no contact is defined, or strains leave the range of linear kinematics.
    """
    analysis = Analysis(model, linear_solver, linear_tolerance, criteria or Criteria())
    ramp = ramp or linear_ramp()
    steps = []
    for index, instant in enumerate(ramp.instants, start=1):
        step = analysis.step(index, instant, ramp.value(instant), last=index == len(ramp))
        steps.append(step)
        if on_step is not None:
            on_step(step)
    return steps


class Analysis:
    """A prepared model: stiffness, linear solver and contact pairs, solved load by load.

    Parameters are those of `solve`. Attributes `u` (n_points * dim,) and `active` (m,) hold the current state.
    """

    def __init__(self, model: Model, linear_solver: str, linear_tolerance: float, criteria: Criteria) -> None:
        model.check()
        self.model, self.criteria = model, criteria
        self.pairs: dict[str, Formulation] = {pair.name: model.bind(pair) for pair in model.contact}
        self.moduli, self.material = model.material_numbers()
        fixed, self.prescribed = model.prescribed()
        self.K = stiffness(model.mesh, model.kinematics, self.moduli, self.material)
        self.fixed: Mask = fixed.ravel() | _without_stiffness(self.K)
        self.solver = linear.make(
            linear_solver, dim=model.mesh.dim, n_dofs=model.n_dofs, tolerance=linear_tolerance
        )  # fmt: skip
        modes = _near_nullspace(model)
        modes[self.fixed] = 0.0
        self.solver.prepare(_with_supports(self.K, self.fixed), modes, self._involved())
        self.u = np.zeros(model.n_dofs)
        self.active: dict[str, Mask] = {}
        self.pressure: dict[str, Array] = {}
        self.before = self.u  # at the beginning of the step, from where slip counts

    def _involved(self) -> NDArray[np.intp]:
        """Return the unsupported degrees of freedom of the contact surfaces."""
        dim = self.model.mesh.dim
        sides = [side.points for pair in self.pairs.values() for side in (pair.secondary, pair.primary)]
        points = np.unique(np.concatenate(sides)) if sides else np.empty(0, np.intp)
        dofs = (points[:, None] * dim + np.arange(dim)).ravel()
        return dofs[~self.fixed[dofs]].astype(np.intp)

    def step(self, index: int, instant: float, value: float, last: bool = False) -> StepResult:
        """Solve for the loads at `instant` with multiplier `value` and return the state; see `solve`."""
        lift = (self.prescribed * value).ravel()
        self.before = self.u
        loaded = self.solver.load(np.where(self.fixed, 0.0, -(self.K @ lift)))
        before = self.solver.counters.iterations
        history: list[dict[str, Any]] = []
        if self.pairs:
            constraints, state = self._contact(loaded, lift, history)
            force = constraints.force(state)
        else:
            self.u = loaded.solve(csr_array((0, len(lift))), np.empty(0), self.u - lift)[0] + lift
            constraints, state, force = None, None, np.zeros(len(lift))
        reaction = self._balance(force, index, history)
        iterations = {
            "geometry_updates": max(len(history) - 1, 0),
            "active_set_iterations": sum(entry["active_set_iterations"] for entry in history),
            "linear_iterations": self.solver.counters.iterations - before,
            "history": history,
        }
        return self._result(index, instant, reaction, constraints, state, iterations, last)

    def _contact(
        self, loaded: linear.Loaded, lift: Array, history: list[dict[str, Any]]
    ) -> tuple[Constraints, active_set.State]:
        """Alternate pairing and active-set solution until both stand still; update `u` and `active`."""
        criteria = self.criteria
        fixed_updates = criteria.geometry_updates
        in_loop = fixed_updates is None and any(pair.geometry_in_loop for pair in self.pairs.values())
        limit = criteria.max_geometry_updates if fixed_updates is None else fixed_updates
        for update in range(limit + 1):
            displacement = self.u.reshape(-1, self.model.mesh.dim)
            parts = {name: pair.constraints(displacement) for name, pair in self.pairs.items()}
            self.parts = parts
            constraints = stacked(list(parts.values()))
            in_loop = in_loop and update < SEMISMOOTH_UPDATES
            active = self._initially_active(parts, displacement)
            limit_now = 1 if in_loop else criteria.max_active_set_iterations
            state = self._inequalities(loaded, constraints, lift, active, limit_now)
            change = np.abs(state.u + lift - self.u).max(initial=0.0)
            size = max(np.abs(state.u + lift).max(initial=0.0), np.abs(lift).max(initial=0.0))
            self.u = state.u + lift
            self._remember(state)
            history.append(
                {
                    "displacement_change": change / size if size else 0.0,
                    "active": int(state.active.sum()),
                    "active_set_iterations": state.iterations,
                    "settled": state.settled,
                }
            )
            if not (state.settled or in_loop):
                raise ConvergenceError(self._cycling(state, constraints), history)
            # Iterative solvers leave a noise of their tolerance; asking for less would never end.
            if (
                fixed_updates is None
                and state.settled
                and change <= max(criteria.geometry, self.solver.tolerance) * size
            ):
                return constraints, state
        if fixed_updates is None:
            raise ConvergenceError(
                f"the contact geometry did not settle in {limit} updates: the displacement still changes by "
                f"{history[-1]['displacement_change']:.1e} of its largest component, {history[-1]['active']} "
                "constraints are active. Use more load steps, a finer mesh on the primary side, or a fixed number of updates",
                history,
            )
        return constraints, state

    def _initially_active(self, parts: dict[str, Constraints], displacement: Array) -> Mask:
        """Return the set to start from: that of the last solution, or what the pairs make of its pressures."""
        sets = []
        for name, part in parts.items():
            found = None
            if name in self.active:
                found = self.pairs[name].initially_active(part, self.pressure[name], displacement)
                found = self.active[name] if found is None else found
            sets.append(np.zeros(len(part.gap0), bool) if found is None else found)
        return np.concatenate(sets)

    def _remember(self, state: active_set.State) -> None:
        """Keep, by pair, which constraints the solution wants active, and its nodal pressures."""
        first = 0
        for name, part in self.parts.items():
            size = len(part.gap0)
            self.active[name] = state.wanted[first : first + size]
            self.pressure[name] = self.pairs[name].pressure(state.multiplier[first : first + size])
            first += size

    def _inequalities(
        self, loaded: linear.Loaded, constraints: Constraints, lift: Array, active: Mask, limit: int
    ) -> active_set.State:
        """Solve with the supported displacements moved to the gaps."""
        scale = np.abs(lift).max(initial=0.0) + np.abs(self.u).max(initial=0.0)
        noise = 10 * self.solver.tolerance
        B, gap0 = self._without_supports(constraints.B, constraints.gap0, lift)
        usable = np.diff(B.indptr) > 0
        if constraints.tangents:
            pairs = [self._without_supports(T, -(T @ self.before), lift) for T in constraints.tangents]
            return friction.solve(
                loaded, B, tuple(T for T, _ in pairs), gap0, np.stack([slip for _, slip in pairs]),
                constraints.friction if constraints.friction is not None else np.zeros(len(gap0)), usable,
                compliance=constraints.compliance, closed=active,
                gap_tolerance=noise * scale, multiplier_tolerance=noise,
            )  # fmt: skip
        return active_set.solve(
            loaded, B, gap0, usable, active=active, compliance=constraints.compliance,
            gap_tolerance=noise * scale, multiplier_tolerance=noise,
            max_iterations=limit, guess=self.u - lift,
        )  # fmt: skip

    def _without_supports(self, rows: csr_array, offset: Array, lift: Array) -> tuple[csr_array, Array]:
        """Return rows without supported degrees of freedom, whose displacement `lift` goes to the offset."""
        rows = rows.copy()
        offset = offset + rows @ lift
        rows.data[self.fixed[rows.indices]] = 0.0
        rows.eliminate_zeros()
        return rows, offset

    def _cycling(self, state: active_set.State, constraints: Constraints) -> str:
        wrong = np.flatnonzero(state.active != state.wanted)
        return (
            f"the active set did not settle in {state.iterations} iterations: {len(wrong)} constraints still change "
            f"(first near {constraints.positions[wrong[0]]}). Use more load steps or the direct linear solver"
        )

    def _balance(self, contact_force: Array, index: int, history: list[dict[str, Any]]) -> Array:
        """Return the reactions (n_dofs,) and check that all other degrees of freedom are in balance."""
        out = self.K @ self.u - contact_force
        reaction = np.where(self.fixed, out, 0.0)
        residual = np.abs(np.where(self.fixed, 0.0, out)).max(initial=0.0)
        force = max(np.abs(reaction).max(initial=0.0), np.abs(contact_force).max(initial=0.0))
        row_sums = np.asarray(abs(csr_array(self.K)) @ np.abs(self.u)).max(initial=0.0)
        round_off = max(1e-13, self.solver.tolerance) * 10 * row_sums
        bound = max(self.criteria.relative * force, self.criteria.absolute or 0.0, round_off)
        if history:
            history[-1]["residual"] = float(residual / force) if force > round_off else 0.0
        if not residual <= bound:
            raise ConvergenceError(
                f"step {index}: the out-of-balance force {residual:.3g} stays above {bound:.3g} "
                f"({self.criteria.relative:g} of the largest force): use the direct solver or a smaller tolerance",
                history,
            )
        return reaction

    def _result(
        self, index: int, instant: float, reaction: Array, constraints: Constraints | None,
        state: active_set.State | None, iterations: dict[str, Any], last: bool,
    ) -> StepResult:  # fmt: skip
        mesh, kinematics = self.model.mesh, self.model.kinematics
        u = self.u.reshape(-1, mesh.dim)
        at_points = recovery.stress_at_points(mesh, kinematics, self.moduli, self.material, u)
        stress = recovery.nodal_average(mesh, at_points)
        contact, first = {}, 0
        for name, pair in self.pairs.items():
            assert constraints is not None
            assert state is not None
            rows = slice(first, first + len(self.parts[name].gap0))
            contact[name] = contact_result(name, pair, self.parts[name], state, u, rows)
            first = rows.stop
        return StepResult(
            index, instant, u.copy(), stress, recovery.von_mises(stress), recovery.von_mises_signed(stress),
            reaction.reshape(-1, mesh.dim), contact, iterations, tuple(self._warn(stress, last)),
        )  # fmt: skip

    def _warn(self, stress: Array, last: bool) -> list[str]:
        """Warn, at the last step, of interpenetration without contact and of large strains."""
        if not last:
            return []
        found = self._interpenetration() + self._large_strain(stress)
        for text in found:
            warnings.warn(text, FastcontactWarning, stacklevel=4)
        return found

    def _interpenetration(self) -> list[str]:
        mesh = self.model.mesh
        _, body = bodies(mesh)
        joined = {
            frozenset((int(body[p.secondary.points[0]]), int(body[p.primary.points[0]]))) for p in self.pairs.values()
        }
        texts: list[str] = []
        seen: set[frozenset[int]] = set()
        coordinates = mesh.points + self.u.reshape(-1, mesh.dim)
        deep = sorted(penetration(mesh, self.model.kinematics, coordinates), key=lambda entry: -entry[2])
        for number, other, depth, where in deep:
            both = frozenset((number, other))
            if both not in joined | seen and depth > 1e-9 * np.ptp(mesh.points, axis=0).max():
                seen.add(both)
                texts.append(
                    f"bodies {body_name(mesh, body, number)} and {body_name(mesh, body, other)} interpenetrate by "
                    f"{depth:.6g} near {np.array2string(where, precision=4)}, and no contact is defined between them: "
                    "add_contact for the groups that meet"
                )
        return texts

    def _large_strain(self, stress: Array) -> list[str]:
        stiffest = min(material.shear_modulus for material, _ in self.model.materials)
        strain = float(recovery.von_mises(stress).max(initial=0.0) / (3 * stiffest))
        if strain <= SMALL:
            return []
        return [f"the largest equivalent strain is {strain:.3f}, beyond the {SMALL} where linear kinematics hold well"]


def _without_stiffness(K: bsr_array) -> Mask:
    """Return the degrees of freedom of points that belong to no solid cell."""
    diagonal = K.diagonal()
    return np.asarray(diagonal == 0.0)


def _with_supports(K: bsr_array, fixed: Mask) -> bsr_array:
    """Return K with the rows and columns of supported degrees of freedom cleared and their diagonal kept."""
    data = K.data.copy()
    size = data.shape[1]
    supported = fixed.reshape(-1, size)
    block_row = np.repeat(np.arange(len(K.indptr) - 1), np.diff(K.indptr))
    data[supported[block_row][:, :, None] | supported[K.indices][:, None, :]] = 0.0
    diagonal = K.diagonal()
    typical = diagonal.max(initial=1.0)
    on_diagonal = np.flatnonzero(block_row == K.indices)
    for k in range(size):
        held = on_diagonal[supported[:, k]]
        kept = diagonal[k::size][supported[:, k]]
        data[held, k, k] = np.where(kept > 0, kept, typical)
    return bsr_array((data, K.indices, K.indptr), shape=K.shape)


def _near_nullspace(model: Model) -> Array:
    """Return the displacements that cost little energy, for multigrid: rigid-body modes of the mesh.

    One set serves all bodies, since aggregates do not span them. In axisymmetry the in-plane motions are no rigid-body
    modes of the ring, but away from the axis they cost little, and aggregates of two unknowns a node need them.
    """
    return rigid_modes(model.mesh.points, "plane_strain" if model.mesh.dim == 2 else model.kinematics)
