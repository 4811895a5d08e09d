"""Degrees of freedom of the contact problem: all of them, or those of the contact surfaces after static condensation.

A direct solver condenses the stiffness matrix to the contact surfaces. All other displacements are computed once, when the
contact forces of the load step are known.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array, diags_array

from fastcontact.analysis.criteria import NOTABLE
from fastcontact.arrays import Array, Indices, numbers_at
from fastcontact.contact.constraints import Constraints
from fastcontact.elasticity.constrained_system import System
from fastcontact.linear.sparse_rows import without_round_off
from fastcontact.round_off import SINGLE_PRECISION


class ActiveDofs:
    """Degrees of freedom of the contact problem.

    The contact problem is solved for the active components of the displacements, ``lift[active] + T @ v``. Here v (l,) are
    the active unknowns, and `lift` (n,) are the displacements that supports and multi-point constraints prescribe if all
    unknowns are zero [length].

    Parameters
    ----------
    system : System
    contact : ndarray of int
        Components that contact constraints may involve, in ascending order.
    springs : ndarray of int
        Components to which the springs of floating bodies are attached.
    unknowns : ndarray of int (l,), optional
        Unknowns on which the components `contact` and `springs` depend, in ascending order, see `System.involved`: the active
        unknowns after static condensation. The active components are then `contact` and `springs`. Without condensation,
        all components and all unknowns are active.

    Attributes
    ----------
    active : ndarray of int (k,)
        The active components.
    unknowns : ndarray of int (l,)
        The active unknowns.
    contact : ndarray of int
        Positions, among the active components, of those that contact constraints may involve.
    determined : ndarray of int
        Positions, among the active components, of those with contact or springs. A Newton step for the contact geometry
        changes only these.
    springs : ndarray of int
        Positions of the components with springs, which are unknowns, among the active unknowns.
    T, transpose : csr_array (k, l), csr_array (l, k)
        Derivatives of the active components with respect to the active unknowns [-], and their transpose, which maps forces
        on the active components to generalised forces.
    """

    def __init__(self, system: System, contact: Indices, springs: Indices, unknowns: Indices | None = None) -> None:
        involved, all_dofs = np.union1d(contact, springs), np.arange(len(system.free))
        self.active, self.unknowns = (all_dofs, all_dofs) if unknowns is None else (involved, unknowns)
        self.contact, self.determined = (np.searchsorted(self.active, dofs) for dofs in (contact, involved))
        self.springs = np.searchsorted(self.unknowns, springs)
        self._numbers = numbers_at(self.unknowns, len(all_dofs))  # of all unknowns among the active ones
        free = diags_array(system.free.astype(float), format="csr")
        T = free if system.T is None else system.T @ free
        self._system, self.T = system, csr_array(csr_array(T)[self.active][:, self.unknowns])
        self.transpose = csr_array(self.T.T)

    def constraints(self, constraints: Constraints, lift: Array, start: Array) -> Constraints:
        """Return constraints on all displacements as constraints on the active unknowns.

        `lift` (n,) are the displacements if all unknowns are zero, and `start` (n,) those at the beginning of the load step,
        relative to which slips are measured [length].

        If supports hold both sides of a constraint, its force can neither close its gap nor stop its slip. After the
        supported unknowns are eliminated, its row contains only small entries of neighbouring nodes. Rows whose entries are
        all below the fraction NOTABLE of the largest entry before the elimination are set to zero. With remaining entries of
        1e-16, multipliers of a mortar joint between two flanges with a fixed edge reached 1e23; with entries of 1e-7, active
        sets did not converge. If the constraint is soft, its gap nevertheless determines its normal force, and only round-off
        is removed from its row.
        """
        rows, offsets = [], np.vstack([constraints.gap0, constraints.slip0])
        shape = len(constraints), len(self.unknowns)
        threshold = np.full((1 + len(constraints.tangents), len(constraints)), NOTABLE)
        threshold[0, constraints.softness[0] > 0.0] = SINGLE_PRECISION
        for k, R in enumerate((constraints.B, *constraints.tangents)):
            reduced, offsets[k] = self._system.rows(R, offsets[k] - R @ start if k else offsets[k], lift)
            active = csr_array((reduced.data, self._numbers[reduced.indices], reduced.indptr), shape=shape)
            rows.append(without_round_off(active, R, threshold[k]))
        prescribed = constraints.usable & (constraints.softness[0] > 0.0) & (np.diff(rows[0].indptr) == 0)
        tangents, slip0 = tuple(rows[1:]), offsets[1:]
        return replace(constraints, B=rows[0], gap0=offsets[0], tangents=tangents, slip0=slip0, prescribed=prescribed)
