r"""Unilateral contact and Coulomb's law as a nonsmooth complementarity function, and Newton's method for it.

This is the common part of the solvers `dense` and `eliminated`.

The unknowns of a constraint are its normal force n and its k tangential forces t. Its gap g and its slips s along the k
tangents result from these forces. All values are scaled such that the compliance of each constraint is near one. Forces, gaps
and slips then have the same unit, and ``n - g`` is meaningful. The solution is the zero of

.. math:: n - [n - g]_+, \qquad t - P(t - s), \qquad P \text{ the projection onto the disc of radius } \mu [n - g]_+

(Alart and Curnier, 1991), where :math:`[x]_+ = \max(x, 0)`. These residuals are semismooth functions of n and t. A line
search ensures that their norm decreases. Newton's method does not depend on how gaps and slips are computed from the contact
forces, see `Linearised`.

To implement another law, begin with `Law`. The tangential force of the law is also used in `eliminated.Eliminated`,
which linearises sliding constraints, and in the fallback `dense._polyhedral_forces`. Parameters of the law
come from `PairOptions` through `Constraints`; parameters that are forces must be scaled by the caller that creates the
`Law`. `Law.state` and the formulations assume that a constraint without friction needs no tangents.

At a constraint on a symmetry plane or on an axis, supports prevent slip along one tangent or along both. The functions at the
end of this file detect such held tangents by the compliance of each constraint, and rotate the two tangents of a constraint
in 3D so that one of them is the direction in which slip is prevented. The compliance of m constraints, without their
coupling, is an array (1 + k, 1 + k, m): the changes of the gap and of the k slips of a constraint due to its normal force and
its k tangential forces [length / force], in this order.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from scipy.sparse import block_array, csr_array, diags_array

from fastcontact._tools.records import record
from fastcontact.analysis.criteria import DECREASE, HALVINGS, MAX_NEWTON_ITERATIONS
from fastcontact.analysis.solution import FrictionSolution
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.linear.protocol import TOLERANCE
from fastcontact.round_off import LENGTH_ROUND_OFF, ROUND_OFF, TINY


@record
class Law:
    """Unilateral contact with Coulomb friction of m constraints.

    The methods take forces `y` and `gaps`, both scaled, with the shape (1 + k, m): the first row of `y` contains the normal
    forces n and its other rows the tangential forces t; the first row of `gaps` contains the gaps g, its other rows the
    slips s.

    Attributes
    ----------
    mu : ndarray (m,)
        Coefficients of friction [-].
    equality : ndarray of bool (m,)
        Constraints that are equations, which are closed for either sign of the normal force.
    """

    mu: Array
    equality: Mask

    def trial(self, y: Array, gaps: Array) -> tuple[Array, Array, Array, Array]:
        """Return ``n - g`` (m,), ``t - s`` (k, m), the norm (m,) of t - s, and the radius (m,) of the friction disc.

        The radius is ``mu * max(n - g, 0)``.
        """
        n_trial, t_trial = y[0] - gaps[0], y[1:] - gaps[1:]
        return n_trial, t_trial, np.sqrt((t_trial * t_trial).sum(axis=0)), self.mu * np.maximum(n_trial, 0.0)

    def residual(self, y: Array, gaps: Array) -> Array:
        """Return the complementarity function (1 + k, m), which vanishes at the solution.

        Its rows are ``n - max(n - g, 0)`` and ``t - P(t - s)``, where P is the projection onto the friction disc.
        """
        n_trial, t_trial, norm, radius = self.trial(y, gaps)
        scale = np.divide(radius, norm, out=np.ones_like(norm), where=norm > radius)
        normal = np.where(self.equality, n_trial, np.maximum(n_trial, 0.0))
        return np.vstack([y[0] - normal, y[1:] - t_trial * scale])

    def state(self, y: Array, gaps: Array) -> tuple[Mask, Mask]:
        """Return which constraints (m,) are closed, and which (m,) of the closed ones stick."""
        n_trial, _, norm, radius = self.trial(y, gaps)
        return (n_trial > 0) | self.equality, (n_trial > 0) & (norm <= radius) & (self.mu > 0)

    def sliding_directions(self, y: Array, gaps: Array, sliding: Indices) -> tuple[Array, Array]:
        """Return the directions d of t - s and their influence on t, at the constraints numbered `sliding` (q,).

        Returns
        -------
        d : ndarray (k, q)
            Unit vectors.
        radius_ratio : ndarray (q,)
            Derivative of t with respect to the component of t - s perpendicular to d: the radius of the friction disc over
            the norm of t - s, at most 1.
        """
        _, t_trial, norm, radius = self.trial(y, gaps)
        length = np.maximum(norm[sliding], TINY)
        return t_trial[:, sliding] / length, np.minimum(radius[sliding] / length, 1.0)

    def linearised(self, y: Array, gaps: Array, rows: Indices, sticking: Mask) -> tuple[Array, Array]:
        """Return E and D (1 + k, 1 + k, q) of the equations ``E y + D gaps = 0`` of the closed constraints `rows` (q,).

        They are the equations of the semismooth Newton method. If a constraint is `sticking` (m,), its gap and its slips
        vanish. If it slides, its gap vanishes and ``t = mu n d``, where the direction d of t - s is linearised.
        """
        components, slipping = np.arange(len(y)), np.flatnonzero(~sticking[rows])
        E, D = np.zeros((2, len(y), len(y), len(rows)))
        D[components, components] = 1.0
        d, radius_ratio = self.sliding_directions(y, gaps, rows[slipping])
        projection = radius_ratio * (np.eye(len(d))[:, :, None] - d[:, None] * d)
        D[1:, 1:, slipping] = projection
        E[1:, 1:, slipping] = np.eye(len(d))[:, :, None] - projection
        E[1:, 0, slipping] = -self.mu[rows[slipping]] * d
        return E, D


class Linearised(Protocol):
    """Contact problem whose Newton step can be computed.

    Attributes
    ----------
    law : Law
    """

    law: Law

    def round_off(self, y: Array) -> float:
        """Return a bound of the round-off of the gaps and slips due to forces y (1 + k, m), in their scaled unit."""

    def step(self, y: Array, gaps: Array, closed: Mask, sticking: Mask) -> tuple[Array, Array]:
        """Return forces and gaps (1 + k, m) that solve the equations of a contact state, linearised at `y` and `gaps`.

        The gaps of `closed` constraints (m,) and the slips of `sticking` ones (m,) vanish. Sliding constraints satisfy
        ``t = mu n d`` with the direction d of t - s, which in 3D varies with t - s. Open constraints have no forces.
        """


def newton(
    problem: Linearised, y: Array, gaps: Array, tolerance: float = ROUND_OFF, max_iterations: int | None = None,
    line_search: bool = True, min_iterations: int = 0,
) -> FrictionSolution:  # fmt: skip
    """Return the zero of the residual, or the best iterate.

    Parameters
    ----------
    problem : Linearised
    y, gaps : ndarray (1 + k, m)
        Initial forces, and the gaps and slips that result from them.
    tolerance : float
        Tolerance of the residual, relative to the largest force [-].
    max_iterations : int, optional
        Largest number of iterations; MAX_NEWTON_ITERATIONS by default.
    line_search : bool
        Whether a step is halved until the residual decreases. Otherwise full steps are taken.
    min_iterations : int
        Smallest number of iterations.
    """
    max_iterations = MAX_NEWTON_ITERATIONS if max_iterations is None else max_iterations
    law = problem.law
    residual = law.residual(y, gaps)
    norm = float(np.linalg.norm(residual))
    best = y, gaps, np.inf
    earlier: set[int] = set()
    for iteration in range(max_iterations + 1):
        max_force = float(np.abs(y).max())
        max_residual = float(np.abs(residual).max())
        round_off = problem.round_off(y)
        relative_residual = max_residual / max_force if max_force else float(max_residual > round_off)
        if relative_residual < best[2]:
            best = y, gaps, relative_residual
        settled = iteration >= min_iterations and max_residual <= tolerance * max_force + round_off
        repeats = (iterate := hash(y.tobytes())) in earlier  # the iteration depends only on the forces, and would cycle
        if settled or repeats or iteration == max_iterations:
            break
        earlier.add(iterate)
        full_y, full_gaps = problem.step(y, gaps, *law.state(y, gaps))
        step, change = full_y - y, full_gaps - gaps
        damping = 1.0
        while (
            line_search
            and np.linalg.norm(law.residual(y + damping * step, gaps + damping * change))
            > (1 - DECREASE * damping) * norm
        ):
            damping *= 0.5
            if damping < 0.5**HALVINGS:  # at a kink no step may decrease the residual: take the full step
                damping = 1.0
                break
        y, gaps = (full_y, full_gaps) if damping == 1.0 else (y + damping * step, gaps + damping * change)
        residual = law.residual(y, gaps)
        norm = float(np.linalg.norm(residual))
    if not settled:
        y, gaps, relative_residual = best
    return FrictionSolution(y, gaps, *law.state(y, gaps), settled, relative_residual, iteration)


# Compliance of a prescribed slip relative to the compliance of its gap. It is negligible, but with it the equation of stick
# has a solution. The force of this solution lies outside the friction cone, so that the constraint slides.
SLIP_COMPLIANCE = LENGTH_ROUND_OFF


def compliance_of_rows(rows: tuple[csr_array, ...], unknown_compliance: Array) -> Array:
    """Return the compliance (1 + k, 1 + k, m) of each constraint for a diagonal stiffness matrix.

    Parameters
    ----------
    rows : tuple of csr_array (m, n)
        Derivatives of the gaps, and of the slips along each of k tangents, with respect to the n unknowns [-].
    unknown_compliance : ndarray (n,)
        Compliance of each unknown, the reciprocal of its stiffness [length / force].
    """
    weighted = [csr_array((R.data * unknown_compliance[R.indices], R.indices, R.indptr), shape=R.shape) for R in rows]
    return np.array([[weighted_rows.multiply(R).sum(axis=1) for R in rows] for weighted_rows in weighted])


def aligning_rotation(compliance: Array, directions: tuple[Array, ...] = ()) -> csr_array | None:
    """Return the matrix that rotates the two tangents of each constraint in 3D so that one is held if possible.

    If supports leave one slip direction free, both tangents may be oblique to it, and neither is held before the rotation.

    Parameters
    ----------
    compliance : ndarray (3, 3, m)
        Compliance of each constraint [length / force].
    directions : tuple of two ndarray (m, 3), optional
        The tangents. If they are given, the tangents of the other constraints are rotated, too, so that the first one is
        perpendicular to one of the coordinate axes: the elimination of displacements, which are components along these axes,
        then does not depend on the choice of tangents.

    Returns
    -------
    csr_array (3 m, 3 m) or None
        Q, for components of normals and then of both tangents. None if no tangent needs a rotation.
    """
    m = compliance.shape[2]
    gap = np.maximum(compliance[0, 0], TINY)
    first, second = compliance[1, 1] - compliance[1, 0] ** 2 / gap, compliance[2, 2] - compliance[2, 0] ** 2 / gap
    mixed = compliance[1, 2] - compliance[1, 0] * compliance[2, 0] / gap
    radius = np.hypot(0.5 * (first - second), mixed)
    largest, least = 0.5 * (first + second) + radius, 0.5 * (first + second) - radius
    oblique = (least <= TOLERANCE * np.maximum(largest, gap)) & (np.abs(mixed) > TOLERANCE * np.maximum(largest, gap))
    if not oblique.any() and not directions:
        return None
    axis_angle = _angles_to_axes(*directions) if directions else 0.0
    angle = np.where(oblique, 0.5 * np.arctan2(2 * mixed, first - second), axis_angle)
    c, s, zero = diags_array(np.cos(angle)), diags_array(np.sin(angle)), csr_array((m, m))
    return csr_array(block_array([[diags_array(np.ones(m)), zero, zero], [zero, c, s], [zero, -s, c]], format="csr"))


def rotated(Q: csr_array | None, values: Array, back: bool = False) -> Array:
    """Return the product of Q ((1 + k) m, (1 + k) m), or of its transpose, with values (1 + k, m) along normals and tangents.

    Without Q, the values are returned. The transpose, with `back`, is the inverse.
    """
    if Q is None:
        return values
    return np.asarray((Q.T if back else Q) @ values.ravel()).reshape(values.shape)


def _angles_to_axes(tangent: Array, second_tangent: Array) -> Array:
    """Return angles (m,) by which the tangents (m, 3) rotate until the first is perpendicular to a coordinate axis [rad].

    The axis is the one with the largest angle to the normal.
    """
    normal = np.cross(tangent, second_tangent)
    aligned = np.cross(np.eye(3)[np.argmin(np.abs(normal), axis=1)], normal)
    return np.asarray(np.arctan2((aligned * second_tangent).sum(axis=1), (aligned * tangent).sum(axis=1)))


def held_tangents(compliance: Array) -> Mask:
    """Return which tangents (k, m) are held, given the `compliance` (1 + k, 1 + k, m) of each constraint.

    Along a held tangent, supports allow no motion, or only a motion that is proportional to the change of the gap, so that
    the equation of its slip would be empty or linearly dependent. The tolerance is that of iterative solvers, whose
    solutions determine the compliance.
    """
    k = len(compliance) - 1
    slip_compliance, normal = compliance[np.arange(1, k + 1), np.arange(1, k + 1)], compliance[0, 0]
    bound = TOLERANCE * normal * np.maximum(slip_compliance, normal)
    return np.asarray(slip_compliance * normal - compliance[1:, 0] ** 2 <= bound)
