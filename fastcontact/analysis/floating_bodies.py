"""Floating bodies, held by contact alone: springs regularise their singular stiffness matrix.

Each free rigid motion gets one spring at one node, about as stiff as the body there. The springs are fixed to a rigid
position y of the bodies; for every y the contact problem is regular. A Newton iteration moves y until the spring forces
vanish. The elongations w(y) that it leaves are, but for their sign
and stiffness, the gradient of a convex function of y (the Moreau envelope of the energy: Moreau, 1965; Rockafellar,
1976). Newton's method with a line search brings them to zero; then the springs carry nothing, and the solution is that
without them.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import qr
from scipy.sparse import bsr_array

from fastcontact.analysis.solution import Solution
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.elasticity.constrained_system import System
from fastcontact.model.rigid_motions import FreeMotions

# The springs carry less than this fraction of the loads and of the contact forces, which is all there is where motions drive
# the bodies; more where round-off or the linear solver leave more.
SLACK = 1e-12
# What is left when nothing improves any more counts as slack below this fraction.
STAGNANT = 1e-8
# Where displacements are no more accurate, a step by a known derivative is still worth its one solution above this fraction.
WORTH_A_STEP = 1e-10
MAX_POSITIONS = 100
# Lengths tried along one step.
TRIALS = 20
# A step that leaves more than this part of the elongations meets no resistance yet; the next one is longer by a factor.
UNCHANGED = 0.9
FARTHER = 10.0
# A motion that resists less than this fraction of its spring does not resist.
UNRESISTED = 1e-9


@dataclass(frozen=True)
class RigidPosition:
    """A contact solution with slack springs.

    Attributes
    ----------
    state : Solution
        For the springs at `position`, or the first one that did not settle; its iterations are those of all positions tried.
    position : ndarray (k,)
        Rigid displacement at each spring [length].
    spring_force : ndarray (k,)
        Force still carried by each spring [force].
    positions : int
        Positions tried.
    slack : bool
        Whether the springs are slack.
    derivative : ndarray (k, k), optional
        Of the elongations by the position, there or nearby, if any was needed [-].
    """

    state: Solution
    position: Array
    spring_force: Array
    positions: int
    slack: bool
    derivative: Array | None = None


class FloatingBodies:
    """Springs on the free motions of a system.

    Parameters
    ----------
    motions : FreeMotions
    system : System
    avoid : ndarray of int
        Displacements to keep the springs from if possible: those of the contact surfaces.

    Attributes
    ----------
    names : list of str
        Of the free motions.
    dofs : ndarray of int (k,)
        The displacement that each spring holds.
    motions : FreeMotions
        The free motions, each moving one of `dofs` by 1.
    stiffness : float
        Of each spring [force / length].
    """

    def __init__(self, motions: FreeMotions, system: System, avoid: Indices) -> None:
        diagonal, weightless = system.matrix.diagonal(), system.weightless
        typical = float(np.median(diagonal[system.free & ~weightless]))
        diagonal = np.where(weightless, typical, diagonal)
        self._dim = system.matrix.blocksize[0]
        self.names = motions.names()
        self.dofs = _spring_dofs(system.unknowns_of(motions.displacement), diagonal, avoid)
        self._places = [
            f"{'xyz'[dof % self._dim]} of {self._owner(motions, dof, weightless)}" for dof in self.dofs.tolist()
        ]
        self._at_springs = motions.displacement[self.dofs]
        self.motions = motions.combined(np.asarray(np.linalg.inv(self._at_springs), np.float64))
        self.stiffness = typical

    def with_springs(self, matrix: bsr_array) -> bsr_array:
        """Return the matrix with the springs added."""
        data, size = matrix.data.copy(), matrix.blocksize[0]
        for dof in self.dofs:
            row, component = divmod(int(dof), size)
            first, end = matrix.indptr[row], matrix.indptr[row + 1]
            slot = first + int(np.flatnonzero(matrix.indices[first:end] == row)[0])
            data[slot, component, component] += self.stiffness
        return bsr_array((data, matrix.indices, matrix.indptr), shape=matrix.shape)

    def rigid(self, position: Array) -> Array:
        """Return the displacements (n_dofs,) of the rigid position (k,)."""
        return np.asarray(self.motions.displacement @ position)

    def report(self, rigid: RigidPosition, load: float) -> dict[str, Any]:
        """Return a report of the regularisation, as plain numbers and strings.

        Keys: ``motions``, names of the free motions; ``springs``, their places; ``spring_stiffness`` [force / length];
        ``force_left``, what each spring still carries [force]; ``relative_to_load``, the largest over the load;
        ``positions``, rigid positions tried.
        """
        left = np.abs(rigid.spring_force)
        return {
            "motions": self.names,
            "springs": self._places,
            "spring_stiffness": self.stiffness,
            "force_left": left.tolist(),
            "relative_to_load": float(left.max() / load) if load else 0.0,
            "positions": rigid.positions,
        }

    def _owner(self, motions: FreeMotions, dof: int, weightless: Mask) -> str:
        """Return the name of the point or obstacle that a spring is attached to."""
        if not weightless[dof]:
            return f"point {dof // self._dim}"
        column = int(np.argmax(np.abs(motions.displacement[dof])))
        return motions.labels[int(np.argmax(np.abs(motions.parts[:, column])))][0]

    def moving(self, rigid: RigidPosition) -> list[str]:
        """Return the names of the free motions that the springs still resist most."""
        work = np.abs(self._at_springs.T @ rigid.spring_force)
        return [name for name, w in zip(self.names, work, strict=True) if w > 0.1 * work.max()]

    def settle(
        self, solve_at: Callable[[Array], Solution], start: Array, load: float, noise: float, round_off: float,
        derivative: Array | None = None,
    ) -> RigidPosition:  # fmt: skip
        """Find the position at which the springs are slack.

        A derivative by differences costs a contact problem for each free motion. It is therefore kept as long as its steps
        halve the elongations, and corrected by each of them (Broyden, 1965).

        Parameters
        ----------
        solve_at : callable
            Solves the contact problem with the springs at a position (k,).
        start : ndarray (k,)
        load : float
            The loads to compare the forces of the springs with, beside those of contact [force].
        noise : float
            Accuracy of displacements, as a fraction of the largest one.
        round_off : float
            Accuracy of gaps [length].
        derivative : ndarray (k, k), optional
            Of the elongations by the position, at a similar one [-].

        Returns
        -------
        RigidPosition
            The best found if the springs do not become slack, or a contact problem does not settle.
        """
        search = _Search(solve_at, self.dofs, start)
        noise *= float(np.abs(search.state.u).max())

        def elongation(part: float, least: float = noise) -> float:
            return max(part * max(load, search.contact_force) / self.stiffness, least)

        def tolerable() -> float:
            return max(elongation(STAGNANT), round_off)

        if derivative is not None and search.settled and elongation(WORTH_A_STEP, 0.0) < search.left <= noise:
            search.move(_step(derivative, search.elongation), farther=False)
        while search.settled and search.left > elongation(SLACK) and search.positions < MAX_POSITIONS:
            before, fresh = search.left, derivative is None
            if derivative is None:
                derivative = search.differences(max(0.1 * search.left, 1e3 * noise, 1e3 * round_off))
            start, there = search.position, search.elongation
            search.move(_step(derivative, there), farther=search.left > tolerable())
            derivative = _corrected(derivative, search.position - start, search.elongation - there)
            if search.left >= 0.5 * before:
                if fresh and search.left <= tolerable():
                    break
                derivative = None
        slack = search.settled and search.left <= tolerable()
        state = dataclasses.replace(search.unsettled or search.state, iterations=search.iterations)
        force = self.stiffness * search.elongation
        return RigidPosition(state, search.position, force, search.positions, slack, derivative)


class _Search:
    """State of the search for the position."""

    def __init__(self, solve_at: Callable[[Array], Solution], dofs: Indices, start: Array) -> None:
        self._solve_at, self._dofs = solve_at, dofs
        self.positions = self.iterations = 0
        self.unsettled: Solution | None = None  # the first one whose inequalities do not hold
        self.position = start
        self.state, self.elongation = self._at(start)

    @property
    def settled(self) -> bool:
        """Whether the contact problems of all positions so far have settled."""
        return self.unsettled is None

    @property
    def left(self) -> float:
        """Largest elongation [length]."""
        return float(np.abs(self.elongation).max())

    @property
    def contact_force(self) -> float:
        """Largest contact force [force]."""
        return float(np.abs(self.state.multiplier).max(initial=0.0))

    def _at(self, position: Array) -> tuple[Solution, Array]:
        state = self._solve_at(position)
        self.positions += 1
        self.iterations += state.iterations
        if self.unsettled is None and not state.settled:
            self.unsettled = state
        return state, state.u[self._dofs]

    def differences(self, by: float) -> Array:
        """Return the derivative (k, k) of the elongations by the position, from differences in their direction."""
        columns = []
        for k, w in enumerate(self.elongation):
            shift = np.zeros(len(self.position))
            shift[k] = by if w >= 0 else -by
            columns.append((self._at(self.position + shift)[1] - self.elongation) / shift[k])
        return np.column_stack(columns)

    def move(self, step: Array, *, farther: bool = True) -> None:
        """Go along `step`: less far where the elongations turn round, `farther` where nothing changes them.

        Where the bodies meet something much stiffer on their way, a step is far too long and its secant far too short. Once a
        length is too long, one is therefore looked for between two lengths, with at most half of the elongations left.
        """
        slope = float(self.elongation @ step)
        low, high, length = (0.0, slope), None, 1.0
        for _ in range(TRIALS):
            position = self.position + length * step
            state, elongation = self._at(position)
            there = float(elongation @ step)
            if there < -0.5 * abs(slope):
                high = length, there
                fraction = min(max(low[1] / (low[1] - there), 0.1), 0.9) if low[1] > there else 0.5
            elif there <= (UNCHANGED if high is None else 0.5) * slope or not (farther or high):
                break
            else:
                low, fraction = (length, there), 0.5
            length = FARTHER * length if high is None else low[0] + fraction * (high[0] - low[0])
        self.position, self.state, self.elongation = position, state, elongation


def _step(derivative: Array, elongation: Array) -> Array:
    """Return the Newton step; motions that nothing resists follow their springs."""
    left, values, right = np.linalg.svd(derivative)
    resisted = values > UNRESISTED
    step = -right[resisted].T @ ((left[:, resisted].T @ elongation) / values[resisted])
    free = right[~resisted]
    return np.asarray(step + free.T @ (free @ elongation))


def _corrected(derivative: Array, moved: Array, change: Array) -> Array:
    """Return the derivative (k, k) nearest to `derivative` that explains the `change` (k,) by a move (k,) (Broyden, 1965)."""
    square = float(moved @ moved)
    return derivative + np.outer(change - derivative @ moved, moved) / square if square else derivative


def _spring_dofs(motions: Array, diagonal: Array, avoid: Indices) -> Indices:
    """Return k unknowns that determine the motions (n, k): the stiffest ones far apart, none of `avoid` if possible."""
    weights = np.sqrt(np.maximum(diagonal, 0.0))
    weights[avoid] *= 1e-3
    _, _, order = qr((motions * weights[:, None]).T, mode="economic", pivoting=True)
    return np.sort(order[: motions.shape[1]]).astype(np.intp)
