"""Degrees of freedom of the contact problem: all of them, or those of the contact surfaces after static condensation.

A direct solver condenses the stiffness to the contact surfaces; all other displacements are then computed once, when the
contact forces of the load step are known.
"""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
from scipy.sparse import csr_array, eye_array

from fastcontact._jit.norms_kernels import largest
from fastcontact.arrays import Array, Indices
from fastcontact.contact.constraints import Constraints
from fastcontact.elasticity.constrained_system import System
from fastcontact.linear.protocol import Loaded
from fastcontact.linear.sparse_rows import without_remnants

# Where supports hold both sides of a constraint, no force there can close its gap or stop its slip: its row only has
# entries of neighbours that move by strains, below this fraction of the row, of either sign. With such entries of 1e-16,
# multipliers of a mortar joint between two flanges held at one edge reached 1e23; with entries of 1e-7 active sets of
# held nodes never settled.
HELD = 1e-2


class ActiveDofs:
    """Degrees of freedom of the contact problem: in this class all of them, without static condensation.

    In the methods, `u` (n,) are all displacement components, `lift` (n,) those that supports and multi-point constraints
    prescribe if all unknowns are zero, `part` (k,) the active components, for which the contact problem is solved, and `v`
    (l,) the unknowns that determine the active components [length].

    Parameters
    ----------
    system : System
    contact_dofs : ndarray of int
        Components that contact constraints may involve.

    Attributes
    ----------
    compared : ndarray of int
        Positions, among the active components, of those on which contact depends.
    determined : ndarray of int
        Positions, among the active components, of those at which direct solvers compute the solutions of the contact problem.
    """

    def __init__(self, system: System, contact_dofs: Indices) -> None:
        self._system, self.compared, self.determined = system, contact_dofs, contact_dofs

    def for_step(self, u: Array, lift: Array) -> ActiveDofs:
        """Return the object for a load step that begins at displacements `u`."""
        return self

    def loaded(self, loaded: Loaded) -> Loaded:
        """Return the prepared matrix and the right-hand side, reduced to the active unknowns."""
        return loaded

    def of(self, u: Array) -> Array:
        """Return the active components (k,) of `u`."""
        return u

    def put(self, u: Array, part: Array) -> Array:
        """Return all displacements (n,) with the active ones replaced by `part`; `u` may be modified."""
        return part

    def rows(self, rows: csr_array, offset: Array, lift: Array) -> tuple[csr_array, Array]:
        """Return ``rows @ u + offset`` as an affine function of the active unknowns.

        Returns
        -------
        rows : csr_array (m, l)
            [-].
        offset : ndarray (m,)
            [length].
        """
        return self._system.rows(rows, offset, lift)

    def unknowns(self, u: Array, lift: Array) -> Array:
        """Return the active unknowns (l,) of displacements `u` that satisfy supports and multi-point constraints."""
        return self._system.unknowns(u, lift)

    def displacement(self, v: Array, lift: Array) -> Array:
        """Return the active components (k,) for active unknowns `v`."""
        return self._system.displacement(v, lift)

    def varied(self, v: Array) -> Array:
        """Return the change (k,) of the active components due to a change `v` of the active unknowns."""
        return self._system.displacement(v, np.zeros(len(self._system.free)))

    def reduced(self, force: Array) -> Array:
        """Return the generalised forces (l,) on the active unknowns, given nodal forces (n,) [force]."""
        return self._system.reduced(force)

    def numbers(self, unknowns: Indices) -> Indices:
        """Return the numbers of unknowns of the system (k,) among the active unknowns."""
        return unknowns

    def size(self, v: Array) -> float:
        """Return the largest absolute value of all unknowns; condensed ones count with their values before the step."""
        return largest(v)

    def scale(self, u: Array, lift: Array) -> float:
        """Return the sum of the largest displacement and the largest prescribed displacement, as a scale [length]."""
        return largest(lift) + largest(u)


class SurfaceDofs(ActiveDofs):
    """Degrees of freedom of the contact surfaces, for solvers that condense the stiffness matrix; see `ActiveDofs`.

    Parameters
    ----------
    system : System
    contact_dofs : ndarray of int
        Components that contact constraints may involve, in ascending order.
    springs : ndarray of int
        Components to which the springs of floating bodies are attached. The active components are these and `contact_dofs`.
    unknowns : ndarray of int (l,)
        Unknowns on which these components depend, in ascending order; see `System.involved`.
    """

    def __init__(self, system: System, contact_dofs: Indices, springs: Indices, unknowns: Indices) -> None:
        self._dofs, self._unknowns = np.union1d(contact_dofs, springs), unknowns
        super().__init__(system, np.searchsorted(self._dofs, contact_dofs))
        self.determined = np.arange(len(self._dofs))
        T = eye_array(len(system.free), format="csr") if system.T is None else system.T
        self._T = csr_array(T[self._dofs][:, unknowns])
        self._transpose = csr_array(self._T.T)

    # The largest condensed unknown; set by `for_step`.
    _unknown_beyond: float

    def for_step(self, u: Array, lift: Array) -> SurfaceDofs:
        """See `ActiveDofs`."""
        step = copy.copy(self)
        beyond = self._system.unknowns(u, lift)
        beyond[self._unknowns] = 0.0
        step._unknown_beyond = largest(beyond)
        return step

    def loaded(self, loaded: Loaded) -> Loaded:
        """See `ActiveDofs`."""
        condensed = loaded.condensed()
        assert condensed is not None
        return condensed

    def of(self, u: Array) -> Array:
        """See `ActiveDofs`."""
        return u[self._dofs]

    def put(self, u: Array, part: Array) -> Array:
        """See `ActiveDofs`; writes into `u`."""
        u[self._dofs] = part
        return u

    def rows(self, rows: csr_array, offset: Array, lift: Array) -> tuple[csr_array, Array]:
        """See `ActiveDofs`."""
        reduced, offset = super().rows(rows, offset, lift)
        return csr_array(reduced[:, self._unknowns]), offset

    def unknowns(self, u: Array, lift: Array) -> Array:
        """See `ActiveDofs`."""
        return u[self._unknowns] - lift[self._unknowns]

    def displacement(self, v: Array, lift: Array) -> Array:
        """See `ActiveDofs`."""
        return np.asarray(lift[self._dofs] + self.varied(v))

    def varied(self, v: Array) -> Array:
        """See `ActiveDofs`."""
        return np.asarray(self._T @ v)

    def reduced(self, force: Array) -> Array:
        """See `ActiveDofs`."""
        return np.asarray(self._transpose @ force[self._dofs])

    def numbers(self, unknowns: Indices) -> Indices:
        """See `ActiveDofs`."""
        return np.searchsorted(self._unknowns, unknowns)

    def size(self, v: Array) -> float:
        """See `ActiveDofs`."""
        return max(self._unknown_beyond, largest(v))


def constraints_on_unknowns(dofs: ActiveDofs, constraints: Constraints, lift: Array, start: Array) -> Constraints:
    """Return constraints on all displacements as constraints on the active unknowns.

    Constraints whose two sides are held by supports get empty rows, see HELD.

    Parameters
    ----------
    dofs : ActiveDofs
    constraints : Constraints
    lift : ndarray (n,)
        Prescribed displacements [length].
    start : ndarray (n,)
        Displacements at the beginning of the load step, from where slip is measured [length].
    """

    def on_unknowns(rows: csr_array, offset: Array) -> tuple[csr_array, Array]:
        reduced, offset = dofs.rows(rows, offset, lift)
        return without_remnants(reduced, rows, HELD), offset

    B, gap0 = on_unknowns(constraints.B, constraints.gap0)
    slip0 = constraints.slip0 if constraints.slip0 is not None else np.zeros((len(constraints.tangents), 1))
    slips = [slip - T @ start for T, slip in zip(constraints.tangents, slip0, strict=True)]
    pairs = [on_unknowns(T, slip) for T, slip in zip(constraints.tangents, slips, strict=True)]
    tangents = tuple(T for T, _ in pairs)
    return replace(
        constraints, B=B, gap0=gap0, tangents=tangents, slip0=np.stack([s for _, s in pairs]) if pairs else None
    )
