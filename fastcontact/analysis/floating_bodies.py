"""Floating bodies, which contact alone restrains: springs regularise their singular stiffness matrix.

Each rigid-body mode that supports leave free gets one spring at one node. The springs are anchored at a position of the
bodies, so that the contact problem is regular. Its solution stretches the springs, which are then anchored at a new
position. This is repeated until they carry no force. After each update of the contact geometry, the iteration starts from the
last position.

If the matrix is factorised, the linear response of the contact problem to the position is known, and Newton's method finds
the position at which the springs are slack. Once the contact state no longer changes, one Newton step suffices, whatever
the stiffness of the springs. With friction, the first position is that of bodies on softer springs, see `SoftSprings`.

Otherwise the springs are soft compared with the body, and the new position is that at which they would be slack without
contact. This is the proximal point method for the minimum of the energy under the inequalities of contact (Rockafellar,
1976), in which the norm of the elongations, unlike the largest one, never increases. If contact restrains the bodies, each
solution reduces the forces of the springs by about the ratio of their stiffness to that of the contact.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cached_property
from typing import Any

import numpy as np
from numpy.linalg import LinAlgError, norm
from scipy.linalg import qr
from scipy.sparse import bsr_array, csr_array

from fastcontact._tools.records import record, replace
from fastcontact.analysis.active_dofs import ActiveDofs
from fastcontact.analysis.anderson import Anderson
from fastcontact.analysis.criteria import DECREASE, HALVINGS, MAX_NEWTON_ITERATIONS
from fastcontact.analysis.solution import Response, Solution
from fastcontact.arrays import Array, Indices, largest
from fastcontact.contact.constraints import Constraints
from fastcontact.elasticity.constrained_system import System
from fastcontact.elasticity.springs import Springs
from fastcontact.linear.protocol import Loaded
from fastcontact.model.rigid_motions import FreeMotions
from fastcontact.round_off import LENGTH_ROUND_OFF, ROUND_OFF, SINGLE_PRECISION

# Stiffness of soft springs relative to that of the softest body. With a direct solver, springs are as stiff as that body,
# since soft springs reduce the accuracy of displacements (relative errors are 3e-9 for a wedge with 1e-6, 2e-11 for plates
# with 1e-3, and 1e-12 with 1). With multigrid, they are soft, since stiff ones would cost more solutions: with 1e-3, 1e-2
# and 1, a stack with friction takes 4.1, 4.2 and 65 linear solutions, and a bolt 2.8, 5.3 and 27. Stiff
# springs also compensate the negative stiffness that rotated bodies may have under load. The reference is the softest
# body, because a contact is not stiffer than the softer one of its bodies (for a layer that is softer by a
# factor of 2e5, 100 positions did not suffice with the stiffness of the other body).
SOFT = 1e-3


@record
class RigidPosition:
    """Result of the iteration for the position of floating bodies.

    Attributes
    ----------
    solution : Solution
        The last solution, with the number of iterations for all positions.
    anchor : ndarray (k,)
        Displacement at which each spring is anchored [length].
    spring_force : ndarray (k,)
        Remaining force of each spring [force].
    positions : int
        Number of positions, each of which takes one contact solution.
    slack : bool
        Whether the springs are slack: their forces are negligible.
    """

    solution: Solution
    anchor: Array
    spring_force: Array
    positions: int
    slack: bool


@record
class PositionResponse:
    """Linear response of a contact solution with fixed contact state to the positions at which the springs are anchored.

    Attributes
    ----------
    anchored : callable
        The `Response` for springs anchored at a fixed position.
    unknown_rates : ndarray (n, k)
        Derivatives of the unknowns, which include the rigid-body motion, with respect to the positions [-].
    elongation_rates : ndarray (k, k)
        Derivatives of the elongations of the springs with respect to the positions [-].
    springs : ndarray of int (k,)
        Numbers of the unknowns at springs.
    gap_rates : ndarray (m, k)
        Derivatives of the gaps of all m constraints with respect to the positions, for rigid-body motions [-].
    """

    anchored: Response
    unknown_rates: Array
    elongation_rates: Array
    springs: Indices
    gap_rates: Array

    def slack_position_change(self, elongation: Array, solution: Solution) -> tuple[Array, float]:
        """Return the change (k,) of the positions that makes springs with an `elongation` (k,) slack [length].

        If contact does not restrain a motion, the bodies move by the elongations, and then further until the first gap of the
        `solution` closes. The norm of the elongations that remain according to the linear response is returned as well.
        """
        position_error = self._inverse @ elongation
        remaining = float(norm(elongation - self.elongation_rates @ position_error))
        if remaining <= SINGLE_PRECISION * norm(elongation):
            return -position_error, remaining
        motion = elongation - self._inverse @ (self.elongation_rates @ elongation)
        approach, threshold = -self.gap_rates @ motion, LENGTH_ROUND_OFF * remaining
        # Gaps of active constraints are round-off.
        closing = ~solution.active & (solution.gap > 0.0) & (approach > threshold)
        further = float(np.min(solution.gap[closing] / approach[closing])) if closing.any() else 0.0
        return (1.0 + further) * motion - position_error, remaining

    def respond(self, force: Array, gaps: Array) -> Array:
        """Return the change of the unknowns (n,), like a `Response`, if the springs stay slack."""
        u = self.anchored(force, gaps)
        return np.asarray(u - self.unknown_rates @ (self._inverse @ u[self.springs]))

    @cached_property
    def _inverse(self) -> Array:
        """Pseudoinverse (k, k) of `elongation_rates`, whose singular values are about 1, or 0 without restraint."""
        U, s, V = np.linalg.svd(self.elongation_rates)
        return np.asarray((V.T * np.divide(1.0, s, out=np.zeros_like(s), where=s > LENGTH_ROUND_OFF)) @ U.T)


@record
class SoftSprings(Loaded):
    """A prepared matrix with a right-hand side, in which the springs are softer.

    Each spring is in series with a soft one, whose elongation is a rigid-body motion of the bodies.

    Attributes
    ----------
    loaded : Loaded
        The matrix (n, n) with the stiff springs.
    modes : ndarray (n, k)
        Rigid-body modes, each of which elongates one spring by 1 [-].
    load : ndarray (k,)
        Generalised forces of the right-hand side in these modes [force].
    stiffness : float
        Stiffness of each soft spring [force / length].
    """

    loaded: Loaded
    modes: Array
    load: Array
    stiffness: float

    def delassus(self, R: csr_array) -> tuple[Array, Array]:
        """See `Loaded`."""
        free, F = self.loaded.delassus(R)
        return free + (R @ self.modes) @ self.load / self.stiffness, F

    def rigid_compliance(self, R: csr_array) -> Array | float:
        """See `Loaded`."""
        gap_rates = R @ self.modes
        return np.asarray(gap_rates @ gap_rates.T / self.stiffness)

    def full_solution(self, force: Array, u: Array | None = None) -> Array:
        """See `Loaded`."""
        # The elongations of the stiff springs would include round-off of the displacements without contact, which are large
        # if bodies are flexible.
        elongation = (self.load + self.modes.T @ force) / self.stiffness
        return np.asarray(self.loaded.full_solution(force) + self.modes @ elongation)


class FloatingBodies:
    """Springs of the floating bodies of a system, one for each of k free rigid-body modes.

    Parameters
    ----------
    motions : FreeMotions
        The free rigid-body modes.
    system : System
    soft : bool
        Whether the stiffness of the springs is SOFT times that of the softest body; otherwise it is equal to it.
    model_springs : sequence of Springs
        The springs of the model. Springs of floating bodies are not stiffer than those of the model at the same bodies.

    Attributes
    ----------
    names : list of str
        Descriptions of the motions of bodies in the free rigid-body modes.
    dofs : ndarray of int (k,)
        Displacement component to which each spring is attached.
    motions : FreeMotions
        The free rigid-body modes, combined such that each one moves one of the components `dofs` by 1 and the others by 0.
    stiffness : float
        Stiffness of each spring [force / length].
    """

    def __init__(self, motions: FreeMotions, system: System, soft: bool, model_springs: Sequence[Springs]) -> None:
        diagonal, no_stiffness = system.matrix.diagonal(), system.zero_stiffness
        # Smallest of several medians of the diagonal: one over the unknowns that each mode moves, one over those that no
        # mode moves.
        solid, moving = system.free & ~no_stiffness, motions.displacement != 0.0
        groups = [solid & group for group in (*moving.T, ~moving.any(axis=1))]
        typical = min(float(np.median(diagonal[group])) for group in groups if group.any())
        diagonal = np.where(no_stiffness, typical, diagonal)
        self._system, self._dim = system, system.matrix.blocksize[0]
        self.names = motions.names()
        weights = np.sqrt(np.maximum(diagonal, 0.0))
        # The unknowns with springs determine the amplitudes of the modes, are far apart and have large weights.
        modes = system.unknowns_of(motions.displacement)
        _, _, order = qr((modes * weights[:, None]).T, mode="economic", pivoting=True)
        self.dofs = np.sort(order[: modes.shape[1]]).astype(np.intp)
        self._values_at_springs = motions.displacement[self.dofs]
        self._spring_labels = []
        for dof, modes_at_spring in zip(self.dofs.tolist(), self._values_at_springs, strict=True):
            row, component = divmod(dof, self._dim)
            weights_of_mode = motions.weights[:, np.argmax(np.abs(modes_at_spring))]
            obstacle = motions.labels[int(np.argmax(np.abs(weights_of_mode)))].body
            self._spring_labels.append(f"{'xyz'[component]} of {obstacle if no_stiffness[dof] else f'point {row}'}")
        self.motions = motions.combined(np.asarray(np.linalg.inv(self._values_at_springs), np.float64))
        # A body on soft springs of the model that slides on an incline moves in all directions, which stiffer springs would
        # prevent.
        moving_points = moving.any(axis=1).reshape(-1, self._dim).any(axis=1)
        spring_sums = [s.stiffness.sum() for s in model_springs if moving_points[s.rows.indices // self._dim].any()]
        softest = max(SINGLE_PRECISION * typical, min(spring_sums, default=np.inf))
        self.stiffness = min(SOFT * typical if soft else typical, softest)

    def with_springs(self, matrix: bsr_array) -> bsr_array:
        """Return the sum of `matrix` (n_dofs, n_dofs) and the stiffness of the springs [force / length]."""
        data, size = matrix.data.copy(), matrix.blocksize[0]
        for dof in self.dofs:
            row, component = divmod(int(dof), size)
            first, end = matrix.indptr[row], matrix.indptr[row + 1]
            slot = first + int(np.flatnonzero(matrix.indices[first:end] == row)[0])
            data[slot, component, component] += self.stiffness
        return bsr_array((data, matrix.indices, matrix.indptr), shape=matrix.shape)

    def rigid(self, anchor: Array) -> Array:
        """Return the displacements (n_dofs,) of the rigid-body motion with the values `anchor` (k,) at `dofs` [length]."""
        return np.asarray(self.motions.displacement @ anchor)

    def strained(self, u: Array) -> Array:
        """Return displacements u (n_dofs,) less the rigid-body motion with the same displacements at `dofs` [length]."""
        return u - self.rigid(u[self.dofs])

    def position_response(self, constraints: Constraints, dofs: ActiveDofs, respond: Response) -> PositionResponse:
        """Return the linear response to positions of the springs, given `respond` for springs at a fixed position."""
        modes = self.motions.displacement
        changes = np.stack([rows @ modes for rows in (constraints.B, *constraints.tangents)])
        rigid = self._system.unknowns(modes)[dofs.unknowns]
        unloaded = np.zeros(len(rigid))
        strained = np.stack([respond(unloaded, gaps) for gaps in np.moveaxis(changes, -1, 0)], axis=1)
        return PositionResponse(respond, rigid + strained, strained[dofs.springs], dofs.springs, changes[0])

    def with_soft_springs(self, loaded: Loaded, dofs: ActiveDofs, load: Array, slides: bool) -> SoftSprings:
        """Return the prepared matrix `loaded` with soft springs, given the generalised forces `load` (k,) [force].

        `slides` is whether bodies may slide far. The springs are then so soft that their forces are negligible.
        """
        stiffness = (SINGLE_PRECISION if slides else SOFT) * self.stiffness
        modes = self._values_at_springs  # original modes by `motions`; they do not depend on the choice of nodes
        rigid = self._system.unknowns(self.motions.displacement)[dofs.unknowns]
        return SoftSprings(loaded, rigid @ modes, modes.T @ load, stiffness)

    def report(self, rigid: RigidPosition, load: float) -> dict[str, Any]:
        """Return a report of the regularisation, as a dict of numbers and strings.

        Its keys are ``motions``, the free motions of bodies; ``springs``, the components to which springs are
        attached; ``spring_stiffness`` [force / length]; ``force_left``, the remaining force of each spring [force];
        ``relative_to_load``, the largest of these forces divided by `load` [-]; and ``positions``, the number of positions.
        The load step adds ``undetermined``, the motions that the method `undetermined` returns, by body, and ``moved``, the
        largest displacement of these bodies in the step [length].
        """
        remaining = np.abs(rigid.spring_force)
        return {
            "motions": self.names,
            "springs": self._spring_labels,
            "spring_stiffness": self.stiffness,
            "force_left": remaining.tolist(),
            "relative_to_load": float(remaining.max() / load) if load else 0.0,
            "positions": rigid.positions,
        }

    def undetermined(
        self, constraints: Constraints, multiplier: Array, u: Array, load: float, residual: float
    ) -> FreeMotions:
        """Return the motions that neither contact forces nor bilateral contact restrain at the end of a step.

        Any position along these motions without contact forces is then a solution. Contact forces of sides that just touch
        are round-off and are ignored: they are negligible compared with the force of a spring that is elongated by the
        largest displacement and, if there are loads, also compared with the loads. Contact forces smaller than the
        out-of-balance forces, which may be large with an iterative solver, are ignored, too.

        Parameters
        ----------
        constraints : Constraints
            The m constraints.
        multiplier : ndarray (m,)
            Their normal forces [force].
        u : ndarray (n_dofs,)
            Displacements [length].
        load : float
            Scale of the loads, as in `settle` [force].
        residual : float
            Largest out-of-balance force [force].
        """
        elastic = self.stiffness * float(np.abs(u).max())
        significant = max(LENGTH_ROUND_OFF * (min(load, elastic) if load else elastic), residual)
        loaded = (np.abs(multiplier) > significant) | constraints.equality
        frictional = loaded & (constraints.friction > 0.0)
        restraints = [constraints.B[loaded], *(tangent[frictional] for tangent in constraints.tangents)]
        _, values, V = np.linalg.svd(np.vstack([rows @ self.motions.displacement for rows in restraints]))
        free = np.append(values, np.zeros(len(V) - len(values))) <= SINGLE_PRECISION
        return self.motions.combined(V[free].T)

    def moving(self, rigid: RigidPosition) -> list[str]:
        """Return the motions of bodies in the free rigid-body modes with the largest generalised forces of the springs."""
        # A message names the motions with the largest forces, within a factor of ten.
        work = np.abs(self._values_at_springs.T @ rigid.spring_force)
        return self.motions.combined(self._values_at_springs[:, work > 0.1 * work.max()]).names()

    def settle(
        self, solve_at: Callable[[Array], Solution], position_response: Callable[[Response], PositionResponse] | None,
        springs: Indices, start: Array, load: float, noise: float, round_off: float,
    ) -> RigidPosition:  # fmt: skip
        """Solve the contact problem and anchor the springs at the new position, repeatedly, until they are slack.

        Parameters
        ----------
        solve_at : callable
            Function that returns the `Solution` of the contact problem with the springs anchored at a position (k,) [length].
        position_response : callable, optional
            Function that returns the `PositionResponse`, given the response of a solution with springs at a fixed position;
            see the method `position_response`. By default Newton's method is not used.
        springs : ndarray of int (k,)
            Indices of the displacement components `dofs` among the unknowns of the solution.
        start : ndarray (k,)
            First position [length].
        load : float
            Scale of the loads. Springs are slack if their forces are negligible compared with it or with the sum of the
            contact forces [force].
        noise : float
            Relative accuracy of displacements, due to the tolerance of the linear solver [-].
        round_off : float
            Bound of the round-off of gaps [length].

        Returns
        -------
        RigidPosition
            The last position, also if the springs do not become slack or if a contact problem does not converge.
        """
        anchor, last_stretch, iterations, newton_stretch = start, np.inf, 0, 0.0
        step, length = None, 1.0
        mixing = Anderson(len(start) + 1, np.arange(len(start)))
        for positions in range(1, MAX_NEWTON_ITERATIONS + 1):
            solution = solve_at(anchor)
            elongation, u_error = solution.u[springs], noise * largest(solution.u)
            iterations += solution.iterations
            stretch = float(norm(elongation))
            load_stretch = max(load, float(np.abs(solution.multiplier).sum())) / self.stiffness
            # Springs are slack if their forces are round-off of the loads and of the contact forces (the only forces if
            # prescribed displacements move the bodies), as small as the accuracy of the linear solver allows, or round-off of
            # the elongation before a Newton step.
            slack = stretch <= max(ROUND_OFF * load_stretch, u_error, LENGTH_ROUND_OFF * newton_stretch)
            # If the forces of the springs no longer decrease, a larger tolerance applies.
            if not slack and stretch >= 0.5 * last_stretch and positions > 3:
                slack = stretch <= max(LENGTH_ROUND_OFF * load_stretch, round_off)
            if slack or not solution.settled or positions == MAX_NEWTON_ITERATIONS:
                break
            bound = np.inf if step is None else last_stretch - DECREASE * length * (last_stretch - step[1])
            if step is not None and length > 0.5**HALVINGS and stretch > bound:
                length *= 0.5
                anchor = anchor - length * step[0]
                continue
            step, length = None, 1.0
            if stretch > last_stretch:
                mixing.restart()
            elif position_response is not None and solution.response is not None:
                with suppress(LinAlgError):  # the constraints are linearly dependent
                    linear = position_response(solution.response())
                    step = linear.slack_position_change(elongation, solution)
            # Without Newton's method, the iteration is accelerated, because parts much softer than the springs, such as
            # a peeling layer, approach equilibrium slowly.
            anchor = mixing.mixed(anchor, anchor + elongation) if step is None else anchor + step[0]
            last_stretch, newton_stretch = stretch, 0.0 if step is None else stretch
        solution = replace(solution, iterations=iterations)
        return RigidPosition(solution, anchor, self.stiffness * elongation, positions, slack)
