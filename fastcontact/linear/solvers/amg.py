"""Multigrid as a linear solver, and the factorisation that replaces it where it does not converge.

Equations ``B u = c`` are eliminated, see `multigrid.solver`, also those with a diagonal compliance, see `multigrid.loaded`.
Those with a full one cannot be: they go through columns of K^-1, one solution each, kept for the whole analysis. Where those
would be many, or the iteration stalls, on thin or nearly incompressible parts, or a load step has taken more work than
a factorisation, a factorisation replaces it for the rest of the analysis, if the matrix is not too large.
"""

from __future__ import annotations

import functools
import logging
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.sparse import bsr_array, csr_array

from fastcontact.arrays import Array, Indices
from fastcontact.errors import ConvergenceError
from fastcontact.linear.elimination.elimination import Elimination
from fastcontact.linear.flexibility import TooManyColumnsError
from fastcontact.linear.lower_tolerance import tighten
from fastcontact.linear.multigrid.loaded import LoadedMultigrid
from fastcontact.linear.multigrid.solver import (
    MAX_ITERATIONS,
    MAX_NONSYMMETRIC,
    Multigrid,
    StallError,
    TooManyIterationsError,
)
from fastcontact.linear.protocol import FrictionTerms, LinearSolver, Loaded, Product
from fastcontact.linear.solvers.direct import Direct
from fastcontact.linear.springs import Springs

log = logging.getLogger("fastcontact")
# Unknowns up to which a factorisation replaces multigrid, by the number of components of a displacement.
FACTORS_UP_TO = {1: 3_000_000, 2: 3_000_000, 3: 150_000}
# Equations that stiffen a node by more than this leave the softer body too little of multigrid's tolerance; coupled ones,
# whose weights are nearly right only, take hundreds of iterations from the second on.
STIFFENED, STIFFENED_COUPLED = 3e4, 6.0
# Work in one load step, in iterations, from which on factors are cheaper for certain: so much, and so much for each unknown,
# by the number of components of a displacement. In 3D a factorisation and a step by it cost 300 and 0.04 where two bodies
# touch, three times as much in stacks with friction (measured, see bench/README.md).
COST, COST_OF_UNKNOWN = 1000, {1: 0.0, 2: 0.0, 3: 0.08}
# Where forces stay out of balance, the tolerance is lowered down to this; round-off leaves little below it.
TIGHT = 1e-12


class Amg(Multigrid, LinearSolver):
    """See `Multigrid` for parameters.

    Attributes
    ----------
    instead : Direct or None
        The factorisation that replaced multigrid.
    gave_up : str
        Why.
    """

    name = "amg"

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
        """See `LinearSolver`; False once a factorisation has replaced multigrid."""
        return self.instead is None

    def prepare(
        self, K: bsr_array, rigid_modes: Array, involved: Indices | None = None, release: bool = False
    ) -> bsr_array | Product:
        """Build the hierarchy of K; see `LinearSolver.prepare`."""
        self.build(K, rigid_modes, release)
        self._involved, self.instead, self.gave_up = involved, None, ""
        self.patience = MAX_NONSYMMETRIC if self._may_factorise else MAX_ITERATIONS
        return self.K if release else K

    def load(self, f: Array) -> Loaded:
        """Return the prepared matrix with right-hand side `f` (n,); work is allowed anew, see `affordable`."""
        self.begin()
        self.allowed = self.work + self.affordable if self._may_factorise else None
        return _Loaded(self, f)

    @property
    def affordable(self) -> int:
        """How many iterations cost more than a factorisation and a load step by it."""
        n, size = self.K.shape[0], self.K.blocksize[0]
        return COST + int(COST_OF_UNKNOWN[size] * n)

    def improve(self, excess: float) -> bool:
        """See `LinearSolver.improve`: lower the tolerance, or let factors take over where round-off is near."""
        if self.instead is not None:
            return self.instead.improve(excess)
        if self._may_factorise and not self.tolerance > TIGHT * excess:
            self._factorise(
                f"multigrid gave up and factors took over, which cost more time and memory: at its tolerance of "
                f"{self.tolerance:.1e} it leaves forces out of balance by {excess:.1e} times what is allowed"
            )
            return True
        return tighten(self, excess)

    def memory(self) -> dict[str, Any]:
        """See `LinearSolver.memory`: equations and bounds of the hierarchy, columns of K^-1. Result files hold these keys."""
        tied = None
        if self._hierarchy_equations is not None:
            rows = self._hierarchy_equations.weights
            arrays = (self._hierarchy_equations.pivots, rows.indptr, rows.indices, rows.data)
            tied = dict(zip(("pivots", "indptr", "indices", "data"), arrays, strict=True))
        kept = {
            "precision": self.precision,
            "tolerance": self.tolerance,
            "bounds": self.hierarchy.bounds,
            "asked": list(self.columns.asked),
        }
        instead = None if self.instead is None else {"why": self.gave_up, **self.instead.memory()}
        springs = self._hierarchy_springs
        return {**kept, "tied": tied, "springs": springs and springs.to_dict(), "instead": instead}

    def remember(self, memory: dict[str, Any]) -> None:
        """See `LinearSolver.remember`."""
        if memory.get("instead"):
            self._factorise(memory["instead"]["why"]).remember(memory["instead"])
            return
        self.tolerance = memory.get("tolerance", self.tolerance)
        if memory["precision"] != self.precision:
            self.build_in(memory["precision"])
        self.columns.ask_again(memory["asked"])
        tied, springs = memory["tied"], memory.get("springs")
        n = self.hierarchy.n
        self.constrain(tied and _elimination(tied, n), springs and Springs.from_dict(springs, n))
        self.hierarchy.bounds = memory["bounds"]

    def constrain(self, elimination: Elimination | None, springs: Springs | None = None) -> None:
        """See `Multigrid.constrain`.

        Raises
        ------
        StallError
            If multigrid would need hundreds of iterations and factors can take over.
        """
        super().constrain(elimination, springs)
        coupled = elimination is not None and elimination.coupled is not None
        stiffening = self._constrained.stiffening
        if stiffening > (STIFFENED_COUPLED if coupled else STIFFENED) and self._may_factorise:
            raise StallError(
                f"contact makes nodes {stiffening:.1e} times as stiff as they are, where the secondary side is much stiffer "
                "than the primary one: let the softer body be the secondary side"
            )

    def give_up(self, stalled: StallError | TooManyColumnsError) -> None:
        """Factorise the matrix, since the iteration stalls or columns of its inverse cost more.

        Raises
        ------
        StallError, TooManyColumnsError
            If the matrix is too large for that.
        """
        if not self._may_factorise:
            raise stalled
        if isinstance(stalled, TooManyIterationsError):
            why = (
                f"multigrid gave up and factors took over, which cost more memory: the work of {self.affordable} iterations "
                f"in one load step takes longer than a factorisation of {self.K.shape[0]} unknowns"
            )
        else:
            why = f"multigrid gave up and factors took over, which cost more time and memory: {stalled}"
        self._factorise(why)

    @property
    def _may_factorise(self) -> bool:
        return bool(self.K.shape[0] <= FACTORS_UP_TO[self.K.blocksize[0]])

    def _factorise(self, why: str) -> Direct:
        log.warning("%s", why)
        self.gave_up, self.instead = why, Direct()
        self.instead.counters = self.counters
        self.instead.prepare(self.K.restored(), self._modes.astype(float), self._involved)
        # What is asked of later solutions is what factors give.
        self.asked = self.tolerance if self.asked is None else self.asked
        self.tolerance, self.error = self.instead.tolerance, self.instead.error
        return self.instead


def _elimination(tied: dict[str, Any], n: int) -> Elimination:
    """Return the elimination of `Amg.memory`; its offsets and multipliers are not needed any more."""
    m = len(tied["pivots"])
    rows = csr_array((tied["data"], tied["indices"], tied["indptr"]), shape=(m, n))
    return Elimination(tied["pivots"], rows, np.zeros(m), rows, csr_array((m, m)))


def _or_by_factors(method: Callable[..., Any]) -> Callable[..., Any]:
    """Let the method of a factorisation replace that of multigrid from where the iteration stalls."""

    @functools.wraps(method)
    def found(self: _Loaded, *args: Any, **options: Any) -> Any:
        if self._solver.instead is None:
            try:
                return method(self, *args, **options)
            except (StallError, TooManyColumnsError) as stalled:
                self._solver.give_up(stalled)
        return getattr(self._factored, method.__name__)(*args, **options)

    return found


class _Loaded(LoadedMultigrid):
    """See `linear.protocol.LoadedNonsymmetric`."""

    solve = _or_by_factors(LoadedMultigrid.solve)
    flexibility = _or_by_factors(LoadedMultigrid.flexibility)
    involved_solution = _or_by_factors(LoadedMultigrid.involved_solution)
    full_solution = _or_by_factors(LoadedMultigrid.full_solution)

    @functools.cached_property
    def _factored(self) -> Loaded:
        return self._solver.instead.load(self._f)

    def solve_nonsymmetric(
        self, B: csr_array, c: Array, nodes: Indices, guess: Array, tolerance: float,
        friction: FrictionTerms | None = None, C: Array | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        if self._solver.instead is not None:
            raise ConvergenceError("factors give the compliance of friction")
        try:
            return super().solve_nonsymmetric(B, c, nodes, guess, tolerance, friction, C)
        except StallError as stalled:
            self._solver.give_up(stalled)
            raise


SOLVER = Amg
