"""Multigrid, and what takes over where it does not converge.

Equations ``B u = c`` are eliminated, see `_multigrid`. Those with a compliance of their own cannot be: they go through the
compliance of their degrees of freedom, one solution each, kept for the whole analysis. Where the iteration stalls, on thin
or nearly incompressible parts, factors take over for the rest of the analysis, if the matrix is not too large.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array

from fastcontact.errors import ConvergenceError
from fastcontact.linear.flexibility import multipliers, reduced
from fastcontact.linear.elimination.elimination import Elimination, RepeatedError, eliminate
from fastcontact.linear.multigrid.solver import Multigrid, StallError
from fastcontact.linear.protocol import FrictionTerms, Loaded, Monitor, Product

if TYPE_CHECKING:
    from fastcontact.linear.solvers.direct import Direct

log = logging.getLogger("fastcontact")
Array = NDArray[np.float64]
# Unknowns up to which factors take over, by the number of components of a displacement.
FACTORS_UP_TO = {1: 3_000_000, 2: 3_000_000, 3: 150_000}


class Amg(Multigrid):
    """See `Multigrid` for parameters.

    Attributes
    ----------
    instead : Direct or None
        What took over.
    gave_up : str
        Why.
    """

    name = "amg"
    condenses = False
    error = 0.0

    def __init__(self, tolerance: float = 1e-10, precision: str = "single") -> None:
        super().__init__(tolerance, precision)
        self.instead: Direct | None = None
        self.gave_up = ""

    def __repr__(self) -> str:
        if not hasattr(self, "hierarchy"):
            return "Amg(not prepared)"
        if self.instead is not None:
            return f"Amg(gave up, {self.instead})"
        return f"Amg({self.hierarchy}, {self.nbytes / 1e6:.1f} MB, {self.precision} precision)"

    @property
    def iterative(self) -> bool:
        """See `LinearSolver`; not any more once factors have taken over."""
        return self.instead is None

    def prepare(
        self, K: bsr_array, rigid_modes: Array, involved: NDArray[np.intp] | None = None, release: bool = False
    ) -> bsr_array | Product:
        """Build the hierarchy of K; see `LinearSolver.prepare`."""
        self.build(K, rigid_modes, release)
        self._involved, self.instead, self.gave_up = involved, None, ""
        return self.K if release else K

    def load(self, f: Array) -> Loaded:
        """Return the prepared matrix with right-hand side `f`."""
        return _Loaded(self, f)

    def memory(self) -> dict[str, Any]:
        """See `LinearSolver.memory`: what the hierarchy is tied for, how it was strengthened, columns of ``K^-1``."""
        tied = None
        if self._tied_as is not None:
            rows = self._tied_as.tie
            arrays = (self._tied_as.pivots, rows.indptr, rows.indices, rows.data)
            tied = dict(zip(("pivots", "indptr", "indices", "data"), arrays, strict=True))
        kept = {"precision": self.precision, "bounds": self.hierarchy.bounds, "asked": list(self.columns.asked)}
        instead = None if self.instead is None else {"why": self.gave_up, **self.instead.memory()}
        return {**kept, "tied": tied, "instead": instead}

    def remember(self, memory: dict[str, Any]) -> None:
        """See `LinearSolver.remember`."""
        if memory.get("instead"):
            self._take_factors(memory["instead"]["why"]).remember(memory["instead"])
            return
        if memory["precision"] != self.precision:
            self.build_in(memory["precision"])
        self.columns.ask_again(memory["asked"])
        self.tie(memory["tied"] and _tied_again(memory["tied"], self.hierarchy.n))
        self.hierarchy.bounds = memory["bounds"]

    def give_up(self, stalled: StallError) -> None:
        """Factorise the matrix, since the iteration stalls.

        Raises
        ------
        StallError
            If the matrix is too large for that.
        """
        if self.K.shape[0] > FACTORS_UP_TO[self.K.blocksize[0]]:
            raise stalled
        self._take_factors(f"multigrid gave up and factors took over, which cost more time and memory: {stalled}")

    def _take_factors(self, why: str) -> Direct:
        from fastcontact.linear.solvers.direct import Direct

        log.warning("%s", why)
        self.gave_up, self.instead = why, Direct()
        self.instead.counters = self.counters
        self.instead.prepare(self.K.restored(), self._modes.astype(float), self._involved)
        return self.instead


def _tied_again(tied: dict[str, Any], n: int) -> Elimination:
    """Return the elimination that a hierarchy was tied for; right-hand side and multipliers are of no more use."""
    m = len(tied["pivots"])
    rows = csr_array((tied["data"], tied["indices"], tied["indptr"]), shape=(m, n))
    return Elimination(tied["pivots"], rows, np.zeros(m), rows, csr_array((m, m)))


class _Iterated:
    """The matrix with a right-hand side, solved by multigrid."""

    def __init__(self, solver: Amg, f: Array) -> None:
        self._solver, self._f = solver, f
        self._free: Array | None = None

    def solve(
        self, B: csr_array, c: Array, C: Array | None = None, guess: Array | None = None,
        monitor: Monitor | None = None, tolerance: float | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        solver = self._solver
        if C is None or not B.shape[0]:
            try:
                elimination = eliminate(B, c) if B.shape[0] else None
            except RepeatedError as repeated:
                log.info("%s: their compliance is formed", repeated)
            else:
                u = solver.solution(self._f, elimination, guess, monitor, tolerance)
                return u, solver.multiplier(elimination, u, self._f)
        multiplier = multipliers(solver.columns, B, c - B @ self._unloaded(), C)
        return solver.solution(self._f + B.T @ multiplier, None, guess), multiplier

    def solve_nonsymmetric(        self, B: csr_array, c: Array, groups: NDArray[np.intp], guess: Array, tolerance: float,
        drag: FrictionTerms | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        if drag is None:
            elimination = eliminate(B, c, groups=groups) if B.shape[0] else None
            u = self._solver.solution(self._f, elimination, guess, tolerance=tolerance)
            return u, self._solver.multiplier(elimination, u, self._f)
        elimination, springs = eliminate(B, c, drag.rows, groups), drag.springs
        f = self._f if drag.forces is None else self._f + drag.forces
        u = self._solver.nonsymmetric_solution(f, elimination, springs, guess, tolerance)
        forces = f - (springs @ u if springs is not None else 0.0)
        return u, self._solver.multiplier(elimination, u, forces)

    def flexibility(self, R: csr_array) -> tuple[Array, Array]:
        return R @ self._unloaded(), reduced(self._solver.columns, R)

    def involved_solution(self, force: Array, elsewhere: Array | None) -> Array:
        return self._solver.solution(self._f + force, None, None) if force.any() else self._unloaded()

    def full_solution(self, force: Array, u: Array | None = None) -> Array:
        return self.involved_solution(force, None) if u is None else u

    def condensed(self) -> None:
        return None

    def _unloaded(self) -> Array:
        """Return the displacement without contact forces."""
        if self._free is None:
            self._free = self._solver.solution(self._f, None, None)
        return self._free


class _Loaded:
    """See `linear._solver.LoadedNonsymmetric`: by multigrid, and by factors from where that stalls."""

    def __init__(self, solver: Amg, f: Array) -> None:
        self._solver, self._f = solver, np.ascontiguousarray(f, float)
        self._iterated = _Iterated(solver, self._f)
        self._factored: Loaded | None = None

    def diagonal(self) -> Array:
        return self._solver.diagonal()

    def solve_nonsymmetric(self, *args: Any, **options: Any) -> tuple[Array, Array]:
        if self._solver.instead is not None:
            raise ConvergenceError("factors give the compliance of friction")
        return self._iterated.solve_nonsymmetric(*args, **options)

    def solve(self, *args: Any, **options: Any) -> tuple[Array, Array]:
        return self._found(lambda loaded: loaded.solve(*args, **options))

    def flexibility(self, R: csr_array) -> tuple[Array, Array]:
        return self._found(lambda loaded: loaded.flexibility(R))

    def involved_solution(self, force: Array, elsewhere: Array | None) -> Array:
        return self._found(lambda loaded: loaded.involved_solution(force, elsewhere))

    def full_solution(self, force: Array, u: Array | None = None) -> Array:
        return self._found(lambda loaded: loaded.full_solution(force, u))

    def condensed(self) -> None:
        return None

    def _found(self, by: Callable[[Loaded], Any]) -> Any:
        """Return what a call gives; where multigrid stalls, what factors give."""
        if self._solver.instead is None:
            try:
                return by(self._iterated)
            except StallError as stalled:
                self._solver.give_up(stalled)
        if self._factored is None:
            assert self._solver.instead is not None
            self._factored = self._solver.instead.load(self._f)
        return by(self._factored)


SOLVER = Amg
