"""A prepared model: for one load pair, constrain, solve until both stand still, recover."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from fastcontact._jit import parallel
from fastcontact._jit.norms_kernels import largest, largest_difference
from fastcontact.analysis import active_set
from fastcontact.analysis.active_dofs import Everything, Scope, Surfaces
from fastcontact.analysis.anderson import Anderson
from fastcontact.analysis.contact_result import contact_result
from fastcontact.analysis.criteria import Criteria
from fastcontact.analysis.extrapolation import Extrapolation
from fastcontact.analysis.friction import friction
from fastcontact.analysis.unsupported_bodies import SLACK, Floating, Settled
from fastcontact.contact.constraints import Constraints, stacked
from fastcontact.contact.formulations import Formulation
from fastcontact.contact.obstacles.rigid_side import RigidSide
from fastcontact.elasticity import recovery
from fastcontact.elasticity.springs import ground_force, stiffened
from fastcontact.elasticity.stiffness import rigid_modes, stiffness
from fastcontact.elasticity.system import Stiffness, System
from fastcontact.errors import ConvergenceError
from fastcontact.linear import choice as linear
from fastcontact.model.model import Model, combined, multiplier
from fastcontact.model.ramp import Ramp, linear_ramp
from fastcontact.model.rigid_motions import free_motions, generalised, resisting, stopped_at
from fastcontact.results.step import StepResult

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# One active-set iteration per pairing is cheapest near the solution but may cycle; after so many, settle the set first.
SEMISMOOTH_UPDATES = 8
# Pairings after which an iterative solver starts again from the last step instead of the extrapolated state, and errors of
# whole solutions are taken for what they are.
EXTENDED_UPDATES = 25
# Relative residual of the first solution of a step by an iterative solver, and of later ones in units of the relative
# change of the displacement and of the last residual: more accuracy than the pairing itself has is lost.
FIRST_RESIDUAL, RESIDUAL = 1e-2, 0.03
# Newton iterations with friction as long as the residual is larger than the last one: errors turn slips to and fro.
LOOSE_NEWTON = 3
# Earlier geometries that are mixed into the next one.
MIXED = 5


class Analysis:
    """A prepared model, checked before: stiffness, linear solver and contact pairs, solved load by load.

    Parameters are those of `solving.solve`. Attributes `u` (n_dofs,), the displacements of all points and then of the
    obstacles that forces drive, and `active` (m,) hold the current state.
    """

    @parallel.on_one_blas_thread
    def __init__(
        self, model: Model, linear_solver: str, linear_tolerance: float, criteria: Criteria, ramp: Ramp | None = None,
        linear_precision: str | None = None,
    ) -> None:  # fmt: skip
        self.ramp = ramp or linear_ramp()
        self.model, self.criteria = model, criteria
        self.unsettled: tuple[int, float] | None = None  # geometry updates asked for, change by the last one
        self.touched: dict[str, bool] = {}  # pairs that were closed at the end of a step
        self.solver = linear.make(
            linear_solver, dim=model.mesh.dim, n_dofs=model.n_dofs, tolerance=linear_tolerance,
            precision=linear_precision, columns=not all(pair.eliminable for pair in model.contact),
        )  # fmt: skip
        self.pairs: dict[str, Formulation] = {pair.name: model.bind(pair) for pair in model.contact}
        self.moduli, self.material = model.material_numbers()
        self.driven = driven = model.driven
        supported, prescribed = model.prescribed_by_ramp()
        for pair in self.pairs.values():
            pair.supported = supported
        self.prescribed, self.forces = driven.prescribed(prescribed), driven.forces(model.forces_by_ramp())
        K = stiffened(stiffness(model.mesh, model.kinematics, self.moduli, self.material), model.springs)
        relations = driven.relations(model.relations)
        self.system = System(driven.stiffness(K), driven.supported(supported).ravel(), relations, driven.loose)
        self.surface_dofs = self._surface_dofs()
        involved = self.system.involved(self.surface_dofs)
        motions = driven.motions(free_motions(model.mesh, model.kinematics, supported, model.holding_rows()))
        self.floating = Floating(motions, self.system, involved) if len(motions) else None
        matrix = self.system.matrix if self.floating is None else self.floating.with_springs(self.system.matrix)
        modes = driven.near_nullspace(near_nullspace(model))
        if self.floating is not None:
            involved = np.union1d(involved, self.floating.dofs)
        kept = self.solver.prepare(matrix, self.system.unknowns_of(modes), involved, release=True)
        if matrix is self.system.matrix:
            self.system.keep(kept)
        self.scope = self._scope(involved)
        self.shape = (driven.n_dofs // model.mesh.dim, model.mesh.dim)
        self.u = np.zeros(driven.n_dofs)
        self.external = np.zeros(driven.n_dofs)
        self.active: dict[str, Mask] = {}
        self.extrapolation = Extrapolation()
        self.pressure: dict[str, Array] = {}
        self.before = self.u  # at the beginning of the step, from where slip counts
        self.largest_force = self.largest_work = 0.0  # of all steps so far
        self.settled: Settled | None = None
        self.rubbing: friction.FrictionalEquilibrium | None = None  # the last solution of the step
        # Gaps are differences of coordinates and no more accurate than those.
        self.round_off = 8 * np.finfo(float).eps * float(np.abs(model.mesh.points).max())

    def _surface_dofs(self) -> NDArray[np.intp]:
        """Return the displacement components of all points on the contact surfaces, and of driven obstacles."""
        dim = self.model.mesh.dim
        sides = [side.points for pair in self.pairs.values() for side in (pair.secondary, pair.primary)]
        points = np.unique(np.concatenate(sides)) if sides else np.empty(0, np.intp)
        moved = self.model.mesh.n_points + np.arange(len(self.driven))
        return (np.concatenate([points, moved])[:, None].astype(np.intp) * dim + np.arange(dim)).ravel()

    def _scope(self, involved: NDArray[np.intp]) -> Scope:
        """Return the displacements that a pairing finds; those of a step follow when its contact forces are known."""
        if self.pairs and self.floating is None and self.solver.condenses:
            return Surfaces(self.system, self.surface_dofs, involved)
        return Everything(self.system, self.surface_dofs)

    @property
    def displacement(self) -> Array:
        """Displacements (n_points, dim) of the points of the mesh [length]."""
        return self.u[: self.model.n_dofs].reshape(-1, self.model.mesh.dim)

    @property
    def K(self) -> Stiffness:
        """Stiffness of all displacements; see `System`."""
        return self.system.K

    def loaded(self, instant: float) -> bool:
        """Return whether loads or prescribed displacements are there at an instant."""
        return bool(self._external(instant).any() or self._lift(instant).any())

    @parallel.on_one_blas_thread
    def step(self, index: int, instant: float) -> StepResult:
        """Solve for the loads at `instant` and return the state; see `solving.solve`."""
        lift = self._lift(instant)
        self.external = self._external(instant)
        self.largest_force = max(self.largest_force, largest(self.external))
        self.before = self.u
        self.u = self.scope.begin(self.u, lift)
        for side in self.pairs.values():
            side.before = self.before.reshape(self.shape)
        self._move_sides(instant)
        self.settled = None
        self.rubbing = None
        self.extrapolation.load(lift, self.external)
        loaded = self.solver.load(self.system.right(self.external, lift))
        before = self.solver.counters.iterations
        self.expected = 0.0  # displacement, for the first step under forces only
        if self.pairs and self.external.any() and not (self.u.any() or lift.any()):
            self.expected = largest(loaded.full_solution(np.zeros(len(lift))))
        if self.pairs and self.model.springs:
            # Weak springs alone would let bodies move far; contact takes that back, but not its round-off.
            alone = largest(loaded.full_solution(np.zeros(len(lift))))
            self.round_off = max(self.round_off, 16 * np.finfo(float).eps * alone)
        history: list[dict[str, Any]] = []
        if self.pairs:
            try:
                constraints, state = self._contact(loaded, lift, history)
            except ConvergenceError as error:
                error.history = error.history or history  # what failed inside knows of no pairings
                raise
            force = constraints.force(state)
            self._move_everything(loaded, state, force, lift)
        else:
            guess = self.system.unknowns(self.u, lift)
            v = loaded.solve(csr_array((0, len(lift))), np.empty(0), guess=guess)[0]
            self.u = self.system.displacement(v, lift)
            constraints, state, force = None, None, np.zeros(len(lift))
        if state is not None:
            self.extrapolation.converged(self.u, self._contact_states(state))
        reaction = self._balance(force, index, history)
        iterations = {
            "geometry_updates": max(len(history) - 1, 0),
            "active_set_iterations": sum(entry["active_set_iterations"] for entry in history),
            "linear_iterations": self.solver.counters.iterations - before,
            "history": history,
        }
        if self.floating is not None and self.settled is not None:
            iterations["regularised"] = self.floating.report(self.settled, self.largest_work)
        return self._result(index, instant, reaction, constraints, state, iterations)

    def _move_sides(self, instant: float) -> None:
        for pair in self.model.contact:
            side = self.pairs[pair.name].primary
            if isinstance(side, RigidSide):
                side.move(multiplier(pair.ramp, self.ramp, instant))
            if pair.clearance_ramp is not None:
                self.pairs[pair.name].terms.factor = multiplier(pair.clearance_ramp, self.ramp, instant)

    def _place_obstacles(self, u: Array) -> dict[str, Array]:
        """Put the obstacles that forces drive where displacements `u` (n_dofs,) have them; return them by pair."""
        still = np.zeros(self.model.mesh.dim)
        positions = dict.fromkeys(self.pairs, still)
        for number, pair in enumerate(self.driven.pairs):
            side = self.pairs[pair.name].primary
            assert isinstance(side, RigidSide)
            positions[pair.name] = side.now = u[self.driven.dofs(number)]
        return positions

    def _external(self, instant: float) -> Array:
        """Return the forces (n_dofs,) of the loads at `instant`."""
        return combined(self.forces, self.ramp, instant, self.shape).ravel()

    def _lift(self, instant: float) -> Array:
        """Return what supports and relations prescribe at `instant`; see `System.lift`."""
        prescribed = combined(self.prescribed, self.ramp, instant, self.shape)
        factors = [multiplier(relation.ramp, self.ramp, instant) for relation in self.model.relations]
        return self.system.lift(prescribed.ravel(), self.system.values(factors))

    def _contact(
        self, loaded: linear.Loaded, lift: Array, history: list[dict[str, Any]]
    ) -> tuple[Constraints, active_set.State]:
        """Alternate pairing and active-set solution until both stand still; update `u` and `active`."""
        criteria, scope, loaded = self.criteria, self.scope, self.scope.loaded(loaded)
        fixed_updates = 0 if criteria.keep_pairing else criteria.geometry_updates
        in_loop = fixed_updates is None and any(pair.geometry_in_loop for pair in self.pairs.values())
        in_loop = in_loop and self.floating is None
        limit = criteria.max_geometry_updates if fixed_updates is None else fixed_updates
        accelerated, known = Anderson(MIXED, scope.compared, self.solver.iterative), None
        tolerance = self.solver.tolerance
        start, last_active = self.u, dict(self.active)
        moved_by_lift = largest(lift)
        extended = fixed_updates is None and self.floating is None and self.solver.iterative
        if extended:
            self.u = self.extrapolation.displacement(self.u)
            tolerance = max(tolerance, FIRST_RESIDUAL)
        for update in range(limit + 1):
            displacement = self.displacement
            positions = self._place_obstacles(
                np.where(self.system.fixed, lift, self.u) if self.driven.pairs else self.u
            )
            paired_at = np.zeros_like(displacement) if criteria.keep_pairing else displacement
            parts = {name: pair.conditions(paired_at) for name, pair in self.pairs.items()}
            self.parts = parts
            constraints = stacked([self.driven.constraints(name, parts[name], positions[name]) for name in parts])
            in_loop = in_loop and update < SEMISMOOTH_UPDATES
            active = self._initially_active(parts, displacement, extended and update == 0)
            loose = self._loose(tolerance)
            limit_now = 1 if in_loop else criteria.max_active_set_iterations
            if self.floating is None:
                state, u = self._inequalities(loaded, constraints, lift, active, limit_now, tolerance)
            else:
                state, u = self._floating(loaded, constraints, lift, active, history)
            before = scope.of(self.u)
            self.u = scope.put(self.u, u)
            change = largest_difference(u, before)
            # Rigid motions of bodies that only contact holds do not count.
            size = max(scope.size(state.u), moved_by_lift)
            self._remember(state)
            history.append(
                {
                    "displacement_change": change / size if size else 0.0,
                    "active": int(state.active.sum()),
                    "active_set_iterations": state.iterations,
                    "settled": state.settled,
                }
            )
            if not (state.settled or in_loop or loose):
                history[-1]["nodes"] = self._nearest_nodes(np.flatnonzero(state.active != state.wanted))
                raise ConvergenceError(self._cycling(state, history[-1]["nodes"], constraints), history)
            # Iterative solvers leave a noise of their tolerance; asking for less would never end.
            accuracy = max(criteria.geometry, self.solver.tolerance)
            if update >= EXTENDED_UPDATES:
                accuracy = max(accuracy, self.solver.error)
            enough = max(accuracy * size, self.round_off)
            if fixed_updates is None and state.settled and change <= enough and not loose:
                return constraints, state
            if fixed_updates is None:
                tolerance = max(self.solver.tolerance, RESIDUAL * min(tolerance, change / size if size else 0.0))
                same = known is not None and np.array_equal(known, state.active)
                known = state.active if state.settled else None
                if loose or not same:
                    accelerated.restart()
                if not loose:  # a loose solution stands still where it is not right yet
                    self.u = scope.put(self.u, accelerated.mixed(before, u))
            if extended and update == EXTENDED_UPDATES:
                # Nodes that flip between facets may do so for ever from one start and not from another.
                self.u, self.active = start, last_active
                accelerated.restart()
        if fixed_updates is None:
            history[-1]["nodes"] = self._most_moved(scope.put(np.zeros_like(self.u), u - before))
            raise ConvergenceError(
                f"the contact geometry did not settle in {limit} updates: the displacement still changes by "
                f"{history[-1]['displacement_change']:.1e} of its largest component, most at "
                f"{self._named_nodes(history[-1]['nodes'])}, {history[-1]['active']} constraints are active. Allow more "
                f"(max_geometry_updates), use more load steps, a finer mesh on the primary side, {self._smoother()}or a "
                "fixed number of updates",
                history,
            )
        self.unsettled = (limit, history[-1]["displacement_change"]) if limit and not criteria.keep_pairing else None
        return constraints, state

    def _move_everything(self, loaded: linear.Loaded, state: active_set.State, force: Array, lift: Array) -> None:
        """Let all points follow the contact forces (n_dofs,), where so far those near the contact did."""
        if self.floating is not None and self.settled is not None:
            lift = lift + self.floating.rigid(self.settled.position)
        self.u = self.system.displacement(loaded.full_solution(self.system.reduced(force), state.u), lift)

    def _smoother(self) -> str:
        """Return the advice for pairs that may flip between the facets at a node."""
        faceted = [name for name, pair in self.pairs.items() if pair.normals == "facet" and len(pair.primary.points)]
        return f'normals="averaged" for contact {faceted[0]!r}, ' if faceted else ""

    def _initially_active(self, parts: dict[str, Constraints], displacement: Array, first: bool) -> Mask:
        """Return the set to start from: that of the last solution, or what the pairs make of its pressures."""
        sets = []
        for name, part in parts.items():
            found = None
            if part.held is not None and part.held.all():
                found = part.held
            elif name in self.active:
                found = self.pairs[name].initially_active(part, self.pressure[name], displacement)
                if found is None:
                    found = self.active[name]
                    found = self.extrapolation.active(name, found) if first else found
            sets.append(np.zeros(len(part.gap0), bool) if found is None else found)
        return np.concatenate(sets)

    def _contact_states(self, state: active_set.State) -> dict[str, tuple[Array, Array]]:
        """Return gaps and multipliers by pair."""
        ends = np.cumsum([len(part.gap0) for part in self.parts.values()])[:-1]
        both = zip(np.split(state.gap, ends), np.split(state.multiplier, ends), strict=True)
        return dict(zip(self.parts, both, strict=True))

    def _remember(self, state: active_set.State) -> None:
        """Keep, by pair, which constraints the solution wants active, and its nodal pressures."""
        first = 0
        for name, part in self.parts.items():
            size = len(part.gap0)
            self.active[name] = state.wanted[first : first + size]
            pair = self.pairs[name]
            self.pressure[name] = pair.pressure(pair.forces(state.multiplier[first : first + size]))
            first += size

    def _inequalities(
        self, loaded: linear.Loaded, constraints: Constraints, lift: Array, active: Mask, limit: int,
        tolerance: float = 0.0,
    ) -> tuple[active_set.State, Array]:  # fmt: skip
        """Solve in the unknowns that supports and relations leave; return the state and the scope's displacements."""
        noise, gap_tolerance = self._noise(lift, tolerance)
        B, gap0 = self.scope.rows(constraints.B, constraints.gap0, lift)
        usable = np.diff(B.indptr) > 0
        state: active_set.State
        if constraints.tangents:
            drift = constraints.drift if constraints.drift is not None else np.zeros((len(constraints.tangents), 1))
            rest = [own - T @ self.before for T, own in zip(constraints.tangents, drift, strict=True)]
            pairs = [self.scope.rows(T, slip, lift) for T, slip in zip(constraints.tangents, rest, strict=True)]
            state = friction.solve(
                loaded, B, tuple(T for T, _ in pairs), gap0, np.stack([slip for _, slip in pairs]),
                constraints.friction if constraints.friction is not None else np.zeros(len(gap0)), usable,
                compliance=constraints.compliance, directions=constraints.directions, closed=active,
                held=constraints.held, softness=constraints.softness, loose=constraints.loose, guess=self.rubbing,
                elsewhere=self.scope.unknowns(self.u, lift), tolerance=max(tolerance, self.solver.tolerance),
                patience=self._newton_steps(limit, tolerance),
            )  # fmt: skip
            self.rubbing = state
        else:
            state = active_set.solve(
                loaded, B, gap0, usable, active=active, compliance=constraints.normal_compliance, held=constraints.held,
                gap_tolerance=gap_tolerance, multiplier_tolerance=noise,
                max_iterations=limit, guess=self.scope.unknowns(self.u, lift), tolerance=tolerance,
            )  # fmt: skip
        return state, self.scope.displacement(state.u, lift)

    def _loose(self, tolerance: float) -> bool:
        """Return whether a solution to this relative residual is not the last one of a step."""
        return self.solver.iterative and tolerance > self.solver.tolerance

    def _newton_steps(self, limit: int, tolerance: float) -> int | None:
        """Return after how many steps friction may be left unsettled; None where it may not."""
        if limit == 1:
            return 1
        return LOOSE_NEWTON if self._loose(tolerance) else None

    def _noise(self, lift: Array, tolerance: float) -> tuple[float, float]:
        """Return the relative accuracy of a solution, and the absolute one of its gaps [length]."""
        noise = max(10 * self.solver.tolerance, tolerance if self.solver.iterative else 0.0)
        scale = self.scope.scale(self.u, lift)
        return noise, max(noise * (scale or self.expected), self.round_off)

    def _floating(
        self, loaded: linear.Loaded, constraints: Constraints, lift: Array, active: Mask, history: list[dict[str, Any]]
    ) -> tuple[active_set.State, Array]:
        """Solve for bodies that only contact holds; return the state and all displacements."""
        floating = self.floating
        assert floating is not None
        known = active

        def solve_at(position: Array) -> active_set.State:
            nonlocal known
            at = lift + floating.rigid(position)
            state, _ = self._inequalities(loaded, constraints, at, known, self.criteria.max_active_set_iterations)
            known = state.wanted
            return state

        work = generalised(floating.motions, self.external)
        self.largest_work = max(self.largest_work, float(np.abs(work).max()))
        start = self.u[floating.dofs]
        if not history:
            moved = self._approach(constraints, work)
            start = start if active.any() else start + moved
        settled = floating.settle(solve_at, start, self.largest_work, 10 * self.solver.tolerance, self.round_off)
        if settled.state.settled and not settled.slack:
            raise ConvergenceError(self._not_slack(settled), history)
        self.settled = settled
        at = lift + floating.rigid(settled.position)
        return settled.state, self.system.displacement(settled.state.u, at)

    def _approach(self, constraints: Constraints, work: Array) -> Array:
        """Return how far (k,) rigid bodies move until the loads hold them in contact.

        Raises
        ------
        ConvergenceError
            If no contact stops them.
        """
        assert self.floating is not None
        motions = self.floating.motions
        rows, gap0 = resisting(constraints)
        size = float(np.ptp(self.model.mesh.points, axis=0).max())
        found = stopped_at(rows @ motions.displacement, gap0 + rows @ self.u, work, size)
        if found is None:
            raise ConvergenceError(
                f"the loads pull bodies away, no contact stops them ({'; '.join(self.floating.names)}; resultant up to "
                f"{np.abs(work).max():.3g}): reverse the loads or add supports",
                smaller_steps_help=False,
            )
        return found

    def _not_slack(self, settled: Settled) -> str:
        assert self.floating is not None
        return (
            f"contact does not hold {'; '.join(self.floating.unheld(settled))}: after {settled.positions} positions "
            f"tried, a force of {np.abs(settled.left).max():.3g} is still missing for equilibrium under a load of "
            f"{self.largest_work:.3g}. Add a support, or use more load steps"
        )

    def _nearest_nodes(self, rows: NDArray[np.intp]) -> dict[str, list[int]]:
        """Return, by contact pair, the secondary nodes next to constraints, counted through the pairs."""
        found, first = {}, 0
        for name, part in self.parts.items():
            own = rows[(rows >= first) & (rows < first + len(part.gap0))] - first
            first += len(part.gap0)
            if len(own):
                points = self.pairs[name].secondary.points
                apart = part.positions[own][:, None] - self.model.mesh.points[points][None]
                found[name] = np.unique(points[np.linalg.norm(apart, axis=2).argmin(axis=1)]).tolist()
        return found

    def _most_moved(self, change: Array) -> dict[str, list[int]]:
        """Return, by contact pair, the three secondary nodes whose displacement changes (n_dofs,) most."""
        size = np.linalg.norm(change.reshape(self.shape), axis=1)
        sides = {name: pair.secondary.points for name, pair in self.pairs.items()}
        return {name: points[np.argsort(-size[points], kind="stable")[:3]].tolist() for name, points in sides.items()}

    def _named_nodes(self, nodes: dict[str, list[int]]) -> str:
        """Return nodes by contact pair in words, with the places of the first three."""
        texts = []
        for name, points in nodes.items():
            listed = ", ".join(f"{p} {np.array2string(self.model.mesh.points[p], precision=4)}" for p in points[:3])
            more = f" and {len(points) - 3} more" if len(points) > 3 else ""
            texts.append(f"points {listed}{more} of contact '{name}'")
        return "; ".join(texts)

    def _cycling(self, state: active_set.State, nodes: dict[str, list[int]], constraints: Constraints) -> str:
        if isinstance(state, friction.FrictionalEquilibrium):
            assert constraints.friction is not None
            return (
                f"contact with friction did not settle in {state.iterations} Newton iterations from several starts: its "
                f"equations are {state.residual:.1e} of the largest force off. With the coefficient of friction "
                f"{constraints.friction.max():g} there may be no solution to find: use more load steps or less friction"
            )
        count = int((state.active != state.wanted).sum())
        many = "1 constraint still changes" if count == 1 else f"{count} constraints still change"
        what = f"{many}, at {self._named_nodes(nodes)}" if count else "sliding constraints still turn"
        other = ", the direct linear solver" if self.solver.iterative else ""
        return (
            f"the active set did not settle in {state.iterations} iterations: {what}. Use more load steps{other} or more "
            "iterations (max_active_set_iterations)"
        )

    def _balance(self, contact_force: Array, index: int, history: list[dict[str, Any]]) -> Array:
        """Return the reactions (n_dofs,) and check that all other degrees of freedom are in balance."""
        out = self.K @ self.u
        out -= contact_force
        out -= self.external
        reaction, residual = self.system.balance(out)
        force = max(largest(forces) for forces in (reaction, contact_force, self.external))
        self.largest_force = max(self.largest_force, force)
        bound = max(self.criteria.relative * force, self.criteria.absolute or 0.0)
        # Without forces the criterion is 0/0: round-off of the internal forces decides, which costs a product with K.
        round_off = 0.0 if 0.0 < residual <= bound else self._force_round_off()
        bound = max(bound, round_off)
        if history:
            history[-1]["residual"] = float(residual / force) if force > round_off else 0.0
        if not residual <= bound:
            raise ConvergenceError(
                f"step {index}: the out-of-balance force {residual:.3g} stays above {bound:.3g} "
                f"({self.criteria.relative:g} of the largest force): use the direct solver or a smaller tolerance",
                history,
            )
        n_dofs = self.model.n_dofs
        return reaction[:n_dofs] + ground_force(self.model.springs, self.u[:n_dofs])

    def _force_round_off(self) -> float:
        """Return how far internal forces may be off by round-off and the tolerance of the linear solver [force]."""
        row_sums = self.K.largest_row_sum(self.u)
        return max(max(1e-13, self.solver.tolerance) * 10 * row_sums, SLACK * self.largest_force)

    def _result(
        self, index: int, instant: float, reaction: Array, constraints: Constraints | None,
        state: active_set.State | None, iterations: dict[str, Any],
    ) -> StepResult:  # fmt: skip
        mesh, kinematics = self.model.mesh, self.model.kinematics
        u = self.displacement
        self._place_obstacles(self.u)
        stress = recovery.nodal_stress(mesh, kinematics, self.moduli, self.material, u)
        von_mises = recovery.von_mises(stress)
        contact, first = {}, 0
        for name, pair in self.pairs.items():
            assert constraints is not None
            assert state is not None
            rows = slice(first, first + len(self.parts[name].gap0))
            contact[name] = contact_result(name, pair, self.parts[name], state, u, rows)
            pair.end_step(self.parts[name], state.active[rows])
            first = rows.stop
        self.touched |= {name: True for name, found in contact.items() if found.active.any()}
        return StepResult(
            index, instant, u.copy(), stress, von_mises, recovery.von_mises_signed(stress, von_mises),
            reaction.reshape(-1, mesh.dim), contact, iterations,
        )  # fmt: skip


def near_nullspace(model: Model) -> Array:
    """Return the displacements that cost little energy, for multigrid: rigid-body modes of the mesh.

    One set serves all bodies, since aggregates do not span them. In axisymmetry the in-plane motions are no rigid-body
    modes of the ring, but away from the axis they cost little, and aggregates of two unknowns a node need them.
    """
    return rigid_modes(model.mesh.points, "plane_strain" if model.mesh.dim == 2 else model.kinematics)
