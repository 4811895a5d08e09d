"""Which displacements a pairing finds: all of them, or those of the contact surfaces, where all else may wait.

Both kinds of scope say the same things about vectors that hold their displacements, or their unknowns, alone.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from fastcontact._jit.norms_kernels import largest
from fastcontact.elasticity.system import System
from fastcontact.linear.protocol import Loaded

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


class Scope(Protocol):
    """See the module; `u` and `lift` (n,) below are of all displacements, `part` (k,) and `v` (l,) of the scope's.

    Attributes
    ----------
    compared : ndarray of int
        Which of the scope's displacements contact looks at.
    """

    compared: Indices

    def begin(self, u: Array, lift: Array) -> Array:
        """Begin a step at displacements `u` with what supports prescribe in it; return displacements to go on with."""
        ...

    def loaded(self, loaded: Loaded) -> Loaded:
        """Return the prepared matrix and its right-hand side for the unknowns of the scope."""
        ...

    def of(self, u: Array) -> Array:
        """Return the displacements of the scope."""
        ...

    def put(self, u: Array, part: Array) -> Array:
        """Return all displacements once those of the scope are `part`."""
        ...

    def rows(self, rows: csr_array, offset: Array, lift: Array) -> tuple[csr_array, Array]:
        """Return ``rows @ u + offset`` as rows and offset for the unknowns of the scope."""
        ...

    def unknowns(self, u: Array, lift: Array) -> Array:
        """Return the unknowns of displacements that obey supports and relations."""
        ...

    def displacement(self, v: Array, lift: Array) -> Array:
        """Return the displacements of the scope."""
        ...

    def size(self, v: Array) -> float:
        """Return the largest of all unknowns, those beyond the scope as they were when the step began."""
        ...

    def scale(self, u: Array, lift: Array) -> float:
        """Return the largest displacement and the largest one that supports prescribe, added."""
        ...


class Everything:
    """All displacements; see `Scope`.

    Parameters
    ----------
    system : System
    dofs : ndarray of int
        Displacements that constraints may involve.
    """

    def __init__(self, system: System, dofs: Indices) -> None:
        self.compared = dofs
        self.rows, self.unknowns, self.displacement = system.rows, system.unknowns, system.displacement

    def begin(self, u: Array, lift: Array) -> Array:
        """See `Scope`."""
        return u

    def loaded(self, loaded: Loaded) -> Loaded:
        """See `Scope`."""
        return loaded

    def of(self, u: Array) -> Array:
        """See `Scope`."""
        return u

    def put(self, u: Array, part: Array) -> Array:
        """See `Scope`."""
        return part

    def size(self, v: Array) -> float:
        """See `Scope`."""
        return largest(v)

    def scale(self, u: Array, lift: Array) -> float:
        """See `Scope`."""
        return largest(lift) + largest(u)


class Surfaces:
    """The displacements of contact surfaces, for solvers that know the compliance of their unknowns; see `Scope`.

    Parameters
    ----------
    system : System
    dofs : ndarray of int (k,)
        Displacements that constraints may involve, ascending.
    unknowns : ndarray of int (l,)
        Unknowns that they depend on, ascending; see `System.involved`.
    """

    def __init__(self, system: System, dofs: Indices, unknowns: Indices) -> None:
        self._system, self._dofs, self._unknowns = system, dofs, unknowns
        self.compared = np.arange(len(dofs))
        # Columns of constraints as places among the unknowns, or, where relations stand between, the displacements.
        columns = unknowns if system.T is None else dofs
        self._place = np.full(len(system.free), -1, np.intp)
        self._place[columns] = np.arange(len(columns))
        self._columns = len(columns)
        if system.T is None:
            self._own = np.searchsorted(dofs, unknowns)
        else:
            self._T = csr_array(system.T[dofs][:, unknowns])

    def begin(self, u: Array, lift: Array) -> Array:
        """See `Scope`."""
        self._lift = lift[self._dofs]
        self._prescribed = largest(lift)
        beyond = u.copy()
        beyond[self._dofs] = 0.0
        self._beyond = largest(beyond)
        beyond = self._system.unknowns(u, lift)
        beyond[self._unknowns] = 0.0
        self._unknown_beyond = largest(beyond)
        return u.copy()

    def loaded(self, loaded: Loaded) -> Loaded:
        """See `Scope`."""
        condensed = loaded.condensed()
        assert condensed is not None
        return condensed

    def of(self, u: Array) -> Array:
        """See `Scope`."""
        return u[self._dofs]

    def put(self, u: Array, part: Array) -> Array:
        """See `Scope`; changes `u` in place, which `begin` returned."""
        u[self._dofs] = part
        return u

    def rows(self, rows: csr_array, offset: Array, lift: Array) -> tuple[csr_array, Array]:
        """See `Scope`."""
        offset = offset + rows @ lift
        place = self._place[rows.indices]
        kept = (place >= 0) & (rows.data != 0.0)
        start = np.concatenate([[0], np.cumsum(kept)])[rows.indptr]
        own = csr_array((rows.data[kept], place[kept], start), shape=(rows.shape[0], self._columns))
        if self._system.T is not None:
            own = csr_array(own @ self._T)
            own.eliminate_zeros()
        return own, offset

    def unknowns(self, u: Array, lift: Array) -> Array:
        """See `Scope`."""
        return u[self._unknowns] - lift[self._unknowns]

    def displacement(self, v: Array, lift: Array) -> Array:
        """See `Scope`."""
        part = self._lift.copy()
        if self._system.T is None:
            part[self._own] += v
        else:
            part += self._T @ v
        return part

    def size(self, v: Array) -> float:
        """See `Scope`."""
        return max(self._unknown_beyond, largest(v))

    def scale(self, u: Array, lift: Array) -> float:
        """See `Scope`."""
        return self._prescribed + max(self._beyond, largest(self.of(u)))
