"""Coulomb friction by Newton's method with linear solvers that eliminate constraints: the Delassus operator is not formed.

In each step of Newton's method, the gaps of closed constraints and the slips of sticking ones are linear equations. A
sliding constraint with the normal force n has the friction force ``mu n`` along its slip direction d. Let B be the
derivative of the gap with respect to the displacements, and T the derivatives of the slips. The multiplier of the gap then
acts through the rows ``B + mu d T`` instead of B, see `linear.protocol`. In 3D the friction force t also rotates with the
slip s, which has the effect of a spring perpendicular to d: ``t = mu n d - stiffness * (s - (d . s) d)``. Penalties are a
diagonal compliance of these equations.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array, vstack

from fastcontact._tools.records import field, record, replace
from fastcontact.analysis.friction import cone_newton
from fastcontact.analysis.solution import Accuracy, FrictionSolution
from fastcontact.analysis.tolerances import RESIDUAL
from fastcontact.arrays import Array, Indices, Mask, largest
from fastcontact.contact.constraints import Constraints
from fastcontact.errors import ConvergenceError
from fastcontact.linear.choice import MAX_TOLERANCE
from fastcontact.linear.protocol import MILD_CONTRAST, FrictionTerms, LoadedNonsymmetric
from fastcontact.linear.sparse_rows import scaled, taken
from fastcontact.linear.springs import Springs
from fastcontact.round_off import ROUND_OFF, SUM_ROUND_OFF, TINY

# Bound of the stiffness of the spring perpendicular to the slip, relative to the stiffness of the constraint. Without a
# bound it tends to infinity as the slip vanishes. The solution does not depend on it, because its slip is parallel to d.
# With a bound of 1, the base case with friction takes 129 iterations (22 with 100), and with 1e6 "hex20" takes 63 (48 with
# 100; `fastcontact bench robustness`, 3 000 unknowns).
STIFFEST = 100.0
# Estimated stiffness of a constraint relative to the stiffness that the diagonal of K gives it. It is smaller because
# neighbouring nodes deform as well. Nearly incompressible cells resist the displacement of a single node far more than that
# of a surface (`LinearSolver.contrast`). If this contrast exceeds MILD_CONTRAST, the estimate is divided by the square root
# of their ratio; otherwise Newton's method reverses a few slips repeatedly (with nu = 0.4999 and 161 442 unknowns, 588
# iterations did not converge; nu = 0.499 was not affected). With 1, "hex20" in the same benchmark takes 64 iterations.
STIFFNESS_ESTIMATE = 0.2
# Tolerance of the residual of the friction law relative to the tolerance of the linear solutions, and the larger tolerance
# that is accepted where it cannot be reached. If contact forces are a small fraction of all forces, they cannot be more
# accurate. Without ACCEPTABLE, `test_forces_that_cannot_be_more_accurate_settle_without_a_compliance` needs columns of K^-1.
LAW_TOLERANCE, ACCEPTABLE = 10.0, 300.0


def solve(
    loaded: LoadedNonsymmetric, constraints: Constraints, closed: Mask, accuracy: Accuracy, u: Array,
    forces: Array | None,
) -> tuple[Array, FrictionSolution]:  # fmt: skip
    """Return the unknowns (n,) [length] and the contact forces.

    Parameters
    ----------
    loaded : LoadedNonsymmetric
        Prepared matrix K (n, n) with a right-hand side.
    constraints : Constraints
        The m constraints in the n unknowns, see `friction.solve.solve`. The only compliance allowed is the diagonal one,
        `softness`.
    closed : ndarray of bool (m,)
        Constraints that are assumed closed and sticking at the start, if there are no initial `forces`.
    accuracy : Accuracy
        Its `residual` is the relative tolerance of the linear solutions.
    u : ndarray (n,)
        Initial guess of the unknowns [length].
    forces : ndarray (1 + k, m), optional
        Initial guess of the forces: normal ones, then those along each of k tangents [force].

    Raises
    ------
    ConvergenceError
        If the method fails.
    """
    tolerance = accuracy.residual or 0.0
    problem = Eliminated(loaded, constraints, u, tolerance, adaptive=not accuracy.inexact)
    y, gaps = problem.start(forces)
    if forces is None or not forces.any():
        sticking = closed if closed.any() else gaps[0] < 0.0
        state = sticking | constraints.equality, sticking
    else:
        state = problem.law.state(y, gaps)
    # At least one step is necessary, because initial forces and displacements are not in equilibrium.
    y, gaps = problem.step(y, gaps, *state)
    if not state[0].any():  # if all were open, close those that penetrate in the solution without contact
        y, gaps = problem.step(y, gaps, gaps[0] < 0.0, gaps[0] < 0.0)
    exact = max(ROUND_OFF, LAW_TOLERANCE * tolerance)
    iterate = cone_newton.newton(problem, y, gaps, exact, 0 if accuracy.inexact else None)
    if problem.finish():
        y, gaps = problem.step(iterate.y, iterate.gaps, iterate.closed, iterate.sticking)
        iterate = cone_newton.newton(problem, y, gaps, exact)
    if not (accuracy.inexact or iterate.settled):
        iterate = replace(iterate, settled=iterate.residual <= ACCEPTABLE * tolerance)
        if not iterate.settled:
            raise ConvergenceError("friction: the iteration on eliminated constraints did not converge")
    if iterate.y is not problem.last_forces:  # after a damped step, for which no displacements were computed
        problem.step(iterate.y, iterate.gaps, iterate.closed, iterate.sticking)
    return problem.u, problem.unscaled(iterate)


class Eliminated:
    """The equations of a contact problem for `cone_newton.newton`, with eliminated constraints; see `cone_newton.Linearised`.

    Forces are divided, and gaps multiplied, by the square root of the estimated stiffness of each constraint. Both then have
    the same unit. Parameters are those of `solve`; `adaptive` is whether linear solutions are only as accurate as each step
    requires, see `_accuracy`.

    Attributes
    ----------
    u : ndarray (n,)
        Unknowns at the end of the last step [length].
    last_forces : ndarray (1 + k, m)
        Scaled forces at the end of the last step.
    """

    def __init__(
        self, loaded: LoadedNonsymmetric, constraints: Constraints, u: Array, tolerance: float, adaptive: bool
    ) -> None:
        usable, mu = constraints.usable, constraints.friction
        rows, rest_gaps = (constraints.B, *constraints.tangents), constraints.gaps_at_rest()
        self._loaded, self._usable, self._tolerance = loaded, usable, tolerance
        self._prescribed = constraints.prescribed
        self._adaptive, self._last_tolerance = adaptive, tolerance
        self._nodes = np.arange(len(constraints)) if constraints.nodes is None else constraints.nodes
        k, m = len(rows) - 1, len(constraints)
        unknown_compliance = np.divide(1.0, diagonal := loaded.diagonal(), out=np.zeros(len(u)), where=diagonal > 0.0)
        self._compliance = constraints.softness.copy()
        compliance = self._compliance_of_rows(rows, unknown_compliance)
        self._rotation = cone_newton.aligning_rotation(compliance, constraints.directions) if k == 2 else None
        if self._rotation is not None:
            rotated_rows = csr_array(self._rotation @ vstack(rows, format="csr"))
            rows = tuple(rotated_rows[a * m : (a + 1) * m] for a in range(3))
            rest_gaps = cone_newton.rotated(self._rotation, rest_gaps)
            compliance = self._compliance_of_rows(rows, unknown_compliance)
        held_slips = cone_newton.held_tangents(compliance)
        prescribed = held_slips & constraints.imposes_slip(np.arange(m), self._rotation)
        self._compliance[1:] += np.where(prescribed, cone_newton.SLIP_COMPLIANCE * compliance[0, 0], 0.0)
        slip_rows = [scaled(T, np.where(is_held, 0.0, 1.0)) for T, is_held in zip(rows[1:], held_slips, strict=True)]
        self._rows = (rows[0], *slip_rows)
        self._at_rest = np.vstack([rest_gaps[0], np.where(held_slips & ~prescribed, 0.0, rest_gaps[1:])])
        self._free_slips = ~held_slips | prescribed
        normal, estimate = compliance[0, 0], STIFFNESS_ESTIMATE / np.sqrt(max(1.0, loaded.contrast / MILD_CONTRAST))
        self._unit = np.sqrt(1.0 / (np.where(normal > 0.0, normal, 1.0) / estimate + self._compliance[0]))
        self.law = cone_newton.Law(np.where(usable, mu, 0.0), constraints.equality & usable)
        self.u = u
        self._round_off = SUM_ROUND_OFF * largest((self._unit * self._gaps(u))[:, usable])

    def round_off(self, y: Array) -> float:
        """See `cone_newton.Linearised`."""
        return self._round_off

    def _compliance_of_rows(self, rows: tuple[csr_array, ...], unknown_compliance: Array) -> Array:
        """Return the sum of `compliance_of_rows` and the tangential compliance of the constraints themselves.

        Tangents with such a compliance are thus not held. Where supports prescribe gaps, the normal compliance is added, too.
        """
        compliance = cone_newton.compliance_of_rows(rows, unknown_compliance)
        compliance[0, 0] += np.where(self._prescribed, self._compliance[0], 0.0)
        slips = np.arange(1, len(rows))
        compliance[slips, slips] += self._compliance[1:]
        return compliance

    def start(self, forces: Array | None) -> tuple[Array, Array]:
        """Return scaled forces and gaps (1 + k, m) at the initial unknowns, given initial `forces` (1 + k, m) [force]."""
        y = np.zeros_like(self._at_rest) if forces is None else np.where(self._usable, forces, 0.0)
        y = cone_newton.rotated(self._rotation, y)
        y[1:][~self._free_slips] = 0.0
        self.last_forces = y / self._unit
        return self.last_forces, self._scaled(self._gaps(self.u, y))

    def unscaled(self, scaled: FrictionSolution) -> FrictionSolution:
        """Return forces [force] and gaps [length] along the original tangents, from the last step.

        Whether constraints are closed or stick, the residual and the number of iterations are those of `scaled`.
        """
        y = self.last_forces * self._unit
        y, gaps = (cone_newton.rotated(self._rotation, values, back=True) for values in (y, self._gaps(self.u, y)))
        return replace(scaled, y=y, gaps=gaps, iterations=1 + scaled.iterations)

    def _gaps(self, u: Array, forces: Array | float = 0.0) -> Array:
        """Return gaps and slips (1 + k, m) at unknowns u (n,) [length], with the compliance under `forces` [force]."""
        return self._at_rest + np.stack([R @ u for R in self._rows]) + self._compliance * forces

    def _scaled(self, gaps: Array) -> Array:
        """Return scaled gaps (1 + k, m), given `gaps` [length]; constraints that cannot close get a positive gap."""
        gaps = np.where(self._usable, gaps * self._unit, 0.0)
        gaps[0, ~self._usable] = 1.0
        return gaps

    def step(self, y: Array, gaps: Array, closed: Mask, sticking: Mask) -> tuple[Array, Array]:
        """See `cone_newton.Linearised.step`."""
        closed = closed & self._usable
        # Equations of gaps and then of the slips along each tangent.
        equations = np.vstack([closed, closed & sticking & self._free_slips])
        rows = [taken(R, np.flatnonzero(at)) for R, at in zip(self._rows, equations, strict=True)]
        B, nodes = csr_array(vstack(rows, format="csr")), self._nodes[equations.nonzero()[1]]
        sliding = self._sliding(y, gaps, np.flatnonzero(closed & ~sticking & (self.law.mu > 0.0)))
        friction_terms = self._friction_terms(B, np.flatnonzero(closed), sliding) if len(sliding.at) else None
        self._last_tolerance, c, C = self._accuracy(y, gaps), -self._at_rest[equations], self._compliance[equations]
        u, multiplier = self._loaded.solve_nonsymmetric(B, c, nodes, self.u, self._last_tolerance, friction_terms, C)
        forces = np.zeros_like(y)
        forces[equations] = multiplier
        forces[1:, sliding.at] += sliding.force(forces[0, sliding.at], u)
        self.u, self.last_forces = u, forces / self._unit
        return self.last_forces, self._scaled(self._gaps(u, forces))

    def _accuracy(self, y: Array, gaps: Array) -> float:
        """Return the relative residual to which the linear system of a step from forces `y` and `gaps` is solved.

        It is proportional to the residual of the friction law, but at most MAX_TOLERANCE: less accurate steps would change
        the directions of small slips. The last step is solved to the full tolerance.
        """
        if not self._adaptive:
            return self._tolerance
        force = float(np.abs(y).max(initial=0.0))
        residual = float(np.abs(self.law.residual(y, gaps)).max(initial=0.0))
        return max(self._tolerance, min(RESIDUAL * residual / force, MAX_TOLERANCE) if force else MAX_TOLERANCE)

    def finish(self) -> bool:
        """Use the full tolerance in further steps; return whether the last step was less accurate."""
        self._adaptive = False
        return self._last_tolerance > self._tolerance

    def _sliding(self, y: Array, gaps: Array, at: Indices) -> _Sliding:
        """Return the friction terms of the sliding constraints numbered `at` (q,), linearised at `y` and `gaps`."""
        d, radius_ratio = self.law.sliding_directions(y, gaps, at)
        ratios = self.law.mu[at] * d
        if len(d) == 1:
            return _Sliding(at, ratios)
        across = np.stack([-d[1], d[0]])
        rows = sum(scaled(taken(T, at), factor) for factor, T in zip(across, self._rows[1:], strict=True))
        spring = np.minimum(radius_ratio / np.maximum(1.0 - radius_ratio, TINY), STIFFEST) * self._unit[at] ** 2
        spring = spring / (1.0 + spring * self._compliance[1, at])  # in series with the compliance of the constraint
        free = (across * self._at_rest[1:, at]).sum(axis=0)
        return _Sliding(at, ratios, Springs(csr_array(rows), spring), across, free)

    def _friction_terms(self, B: csr_array, closed_rows: Indices, sliding: _Sliding) -> FrictionTerms:
        """Return the friction terms of the linear system, whose equations `B` begin with the gaps of `closed_rows`."""
        ratios = np.zeros((len(self._rows) - 1, len(self._usable)))
        ratios[:, sliding.at] = sliding.ratios
        force_rows = taken(self._rows[0], closed_rows)
        for T, factor in zip(self._rows[1:], ratios, strict=True):
            force_rows = force_rows + scaled(taken(T, closed_rows), factor[closed_rows])
        force_rows = csr_array(vstack([force_rows, B[len(closed_rows) :]], format="csr"))
        if sliding.springs is None:
            return FrictionTerms(force_rows)
        springs = sliding.springs
        return FrictionTerms(force_rows, springs, -springs.rows.T @ (springs.stiffness * sliding.free))


@record
class _Sliding:
    """Linearised friction of q sliding constraints.

    Attributes
    ----------
    at : ndarray of int (q,)
        Numbers of the constraints.
    ratios : ndarray (k, q)
        Ratios of the tangential forces to the normal force, ``mu d`` [-].
    springs : Springs, optional
        Springs perpendicular to the slip directions, in 3D.
    across : ndarray (k, q)
        Unit vectors perpendicular to the slip directions, in components along the tangents.
    free : ndarray (q,)
        Elongations of the springs at u = 0 [length].
    """

    at: Indices
    ratios: Array
    springs: Springs | None = None
    across: Array = field(default_factory=lambda: np.empty(0))
    free: Array = field(default_factory=lambda: np.empty(0))

    def force(self, normal: Array, u: Array) -> Array:
        """Return the tangential forces (k, q) for normal forces (q,) [force] and unknowns u (n,) [length]."""
        friction = self.ratios * normal
        if self.springs is None:
            return friction
        elongation = self.springs.rows @ u + self.free
        return np.asarray(friction - self.across * self.springs.stiffness * elongation)
