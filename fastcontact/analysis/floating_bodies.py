"""Floating bodies, held by contact alone: soft springs regularise their singular stiffness matrix.

Each rigid-body mode gets one spring at one node, soft compared with the body there. With anchored springs the contact problem
is regular; its solution stretches the springs, and they are anchored anew at the new position of the bodies. This is the
proximal point method for the energy under the inequalities of contact (Rockafellar, 1976): where contact holds the bodies,
each solution reduces the forces of the springs by about the ratio of their stiffness to that of the contact. Pairings
begin at the last position, so that most need only one solution. At convergence the springs carry no force.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import qr
from scipy.sparse import bsr_array

from fastcontact.analysis.anderson import Anderson
from fastcontact.analysis.solution import Solution
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.elasticity.constrained_system import System
from fastcontact.model.rigid_motions import FreeMotions
from fastcontact.round_off import LENGTH_ROUND_OFF, ROUND_OFF

# Stiffness of the springs over that of the body. Softer springs cost digits of factorisations (1e-6: an error of 3e-9 in a
# wedge), stiffer ones more solutions: a stack with friction takes 4.1, 4.2 and 65 linear solutions with 1e-3, 1e-2 and
# 1, a bolt 2.8, 5.3 and 27. Where rotated bodies under load have a negative stiffness, springs as stiff as the body
# compensate it. The reference is the softest body: a contact with a stiff body is no stiffer than it (a layer 2e5 times
# softer crept for 100 positions).
SOFT, STIFF = 1e-3, 1.0
MAX_POSITIONS = 100
# Weight of displacements in the choice of springs where springs were before: a rubber block pressed on another by multigrid
# takes 142 iterations in two steps, 157 without.
KEPT = 4.0


@dataclass(frozen=True)
class RigidPosition:
    """A contact solution with slack springs.

    Attributes
    ----------
    state : Solution
        The last solution, with the iterations of all positions.
    position : ndarray (k,)
        Rigid displacement at the anchor of each spring [length].
    spring_force : ndarray (k,)
        Remaining force of each spring [force].
    positions : int
        Number of positions.
    slack : bool
        Whether the springs are slack.
    dofs : ndarray of int (k,)
        The displacement that each spring holds.
    """

    state: Solution
    position: Array
    spring_force: Array
    positions: int
    slack: bool
    dofs: Indices


class FloatingBodies:
    """Springs on the free rigid motions of a system.

    Parameters
    ----------
    motions : FreeMotions
    system : System
    relative_stiffness : float
        Stiffness of the springs over that of the body [-].
    before : ndarray of int, optional
        Displacements of the springs before, which are kept unless others are much better.

    Attributes
    ----------
    names : list of str
        Names of the free motions.
    dofs : ndarray of int (k,)
        The displacement that each spring holds.
    motions : FreeMotions
        The free motions, each moving one of `dofs` by 1.
    stiffness : float
        Stiffness of each spring [force / length].
    """

    def __init__(
        self, motions: FreeMotions, system: System, relative_stiffness: float, before: Indices | None = None
    ) -> None:
        diagonal, weightless = system.matrix.diagonal(), system.weightless
        typical = _softest(diagonal, system.free & ~weightless, motions.displacement != 0.0)
        diagonal = np.where(weightless, typical, diagonal)
        self._dim = system.matrix.blocksize[0]
        self.names = motions.names()
        weights = np.sqrt(np.maximum(diagonal, 0.0))
        if before is not None:
            weights[before] *= KEPT
        self.dofs = _spring_dofs(system.unknowns_of(motions.displacement), weights)
        self._places = [
            f"{'xyz'[dof % self._dim]} of {self._owner(motions, dof, weightless)}" for dof in self.dofs.tolist()
        ]
        self._at_springs = motions.displacement[self.dofs]
        self.motions = motions.combined(np.asarray(np.linalg.inv(self._at_springs), np.float64))
        self.stiffness = relative_stiffness * typical

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

        Keys: ``motions``, names of the free motions; ``springs``, their positions; ``spring_stiffness`` [force / length];
        ``force_left``, the remaining force of each spring [force]; ``relative_to_load``, the largest one divided by the load;
        ``positions``, number of rigid positions.
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
        """Return the names of the free motions with the largest remaining spring forces."""
        work = np.abs(self._at_springs.T @ rigid.spring_force)
        return [name for name, w in zip(self.names, work, strict=True) if w > 0.1 * work.max()]

    def settle(
        self, solve_at: Callable[[Array], Solution], start: Array, load: float, noise: float, round_off: float
    ) -> RigidPosition:
        """Anchor the springs at the position of the last solution, until they are slack.

        Parameters
        ----------
        solve_at : callable
            Solves the contact problem with the springs anchored at a position (k,).
        start : ndarray (k,)
        load : float
            Loads to which the forces of the springs are compared, in addition to contact forces [force].
        noise : float
            Accuracy of displacements, as a fraction of the largest one.
        round_off : float
            Accuracy of gaps [length].

        Returns
        -------
        RigidPosition
            The last position if the springs do not become slack, or a contact problem does not converge.
        """
        position, before, iterations = start, np.inf, 0
        mixing = Anderson(len(start) + 1, np.arange(len(start)))
        for positions in range(1, MAX_POSITIONS + 1):
            state = solve_at(position)
            elongation, iterations = state.u[self.dofs], iterations + state.iterations
            left = float(np.abs(elongation).max())
            force = max(load, float(np.abs(state.multiplier).max(initial=0.0))) / self.stiffness
            # Less than round-off of the loads and of the contact forces (the only forces where prescribed displacements
            # drive the bodies), or as little as the linear solver allows.
            slack = left <= max(ROUND_OFF * force, noise * float(np.abs(state.u).max()))
            # Springs whose forces do not decrease any more count as slack sooner.
            if not slack and left >= 0.5 * before and positions > 3:
                slack = left <= max(LENGTH_ROUND_OFF * force, round_off)
            if slack or not state.settled or positions == MAX_POSITIONS:
                break
            if left > before:
                mixing.restart()
            # Extrapolated: parts far softer than the springs, such as a peeling layer, creep.
            position, before = mixing.mixed(position, position + elongation), left
        state = dataclasses.replace(state, iterations=iterations)
        return RigidPosition(state, position, self.stiffness * elongation, positions, slack, self.dofs)


def _softest(diagonal: Array, solid: Mask, moving: Mask) -> float:
    """Return the least median of `diagonal` (n,) over the `solid` unknowns of each of `moving` (n, k), and of the others."""
    groups = [solid & group for group in (*moving.T, ~moving.any(axis=1))]
    return min(float(np.median(diagonal[group])) for group in groups if group.any())


def _spring_dofs(motions: Array, weights: Array) -> Indices:
    """Return k unknowns that determine the motions (n, k): unknowns of large `weights` (n,) far apart."""
    _, _, order = qr((motions * weights[:, None]).T, mode="economic", pivoting=True)
    return np.sort(order[: motions.shape[1]]).astype(np.intp)
