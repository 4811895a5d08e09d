"""Multigrid as a linear solver, and the factorisation that replaces it if multigrid does not converge.

Constraint equations ``B u = c`` are eliminated (`multigrid.solver`). Those with a diagonal compliance are eliminated or
replaced by springs (`multigrid.loaded`). Equations with a full compliance matrix cannot be eliminated. For them, columns of
K^-1 are computed, each as the solution of one linear system, and stored for the rest of the analysis.

A factorisation replaces multigrid for the rest of the analysis if too many columns are needed, if the iteration stalls
because of thin or nearly incompressible parts, or if a load step has taken more work than a factorisation. Very large
matrices are not factorised.
"""

from __future__ import annotations

import functools
import logging
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from scipy.sparse import bsr_array, csr_array

from fastcontact.arrays import Array, Indices
from fastcontact.errors import ConvergenceError
from fastcontact.linear.delassus import TooManyColumnsError
from fastcontact.linear.elimination.elimination import Elimination
from fastcontact.linear.elimination.loaded import restore_tolerance, tighten
from fastcontact.linear.factor_solver import MAX_FACTORISED_DOFS
from fastcontact.linear.multigrid.loaded import LoadedMultigrid
from fastcontact.linear.multigrid.reduced import ReducedOperator
from fastcontact.linear.multigrid.solver import MAX_ITERATIONS, Multigrid, StallError, TooManyIterationsError
from fastcontact.linear.protocol import TOLERANCE, LinearSolver, Loaded, Matrix
from fastcontact.linear.solvers.direct import Direct
from fastcontact.linear.springs import Springs
from fastcontact.round_off import ROUND_OFF

log = logging.getLogger("fastcontact")
# A factorisation is cheaper if one load step takes more iterations than MAX_ITERATIONS plus this number for each unknown. The
# keys are the numbers of unknowns per node. For two bodies in contact in 3D, a factorisation and a load step with it cost as
# much as 300 iterations plus 0.04 iterations per unknown. In stacks with friction, they cost three times as much (measured,
# see bench/README.md).
ITERATIONS_PER_UNKNOWN = {1: 0.0, 2: 0.0, 3: 0.08}


class Amg(Multigrid, LinearSolver):
    """Linear solver by multigrid; for parameters see `Multigrid`.

    Attributes
    ----------
    replacement : Direct or None
        The direct solver that has replaced multigrid; None as long as multigrid is used.
    replacement_reason : str
        Reason for the replacement; empty if multigrid is used.
    """

    name = "amg"

    def __init__(self, tolerance: float = TOLERANCE, precision: str = "single") -> None:
        super().__init__(tolerance, precision)
        self.replacement: Direct | None = None
        self._factor_solver: Direct | None = None  # kept when an analysis returns to a state before the replacement
        self.replacement_reason = ""

    def __repr__(self) -> str:
        if not hasattr(self, "hierarchy"):
            return "Amg(not prepared)"
        if self.replacement is not None:
            return f"Amg(gave up, {self.replacement})"
        return f"Amg({self.hierarchy}, {self.nbytes / 1e6:.1f} MB, {self.precision} precision)"

    @property
    def iterative(self) -> bool:
        """Whether a solution with a larger tolerance costs less; true until a factorisation has replaced multigrid."""
        return self.replacement is None

    def prepare(
        self, K: bsr_array, rigid_modes: Array, involved: Indices | None = None, release: bool = False
    ) -> Matrix:
        """Build the hierarchy of K; see `LinearSolver.prepare`."""
        self.build(K, rigid_modes, release)
        self._involved, self.replacement, self._factor_solver, self.replacement_reason = involved, None, None, ""
        return self.K if release else K

    def load(self, f: Array) -> Loaded:
        """Return the prepared matrix with the right-hand side `f` (n,) [force], and reset the work limit."""
        self.reset_warm_starts()
        self.work_limit = self.work + self.iteration_limit if self._may_factorise else None
        return _Loaded(self, f)

    @property
    def iteration_limit(self) -> int:
        """Number of iterations in one load step above which a factorisation is cheaper."""
        n, size = self.K.shape[0], self.K.blocksize[0]
        return MAX_ITERATIONS + int(ITERATIONS_PER_UNKNOWN[size] * n)

    def improve(self, excess: float) -> bool:
        """Reduce the tolerance or, if it is near round-off, replace multigrid by a factorisation; see `LinearSolver`."""
        if self.replacement is not None:
            return self.replacement.improve(excess)
        if self._may_factorise and not self.tolerance > ROUND_OFF * excess:
            self._factorise(
                "multigrid gave up and a factorisation replaced it, which costs more time and memory: at its tolerance of "
                f"{self.tolerance:.1e} the out-of-balance forces are {excess:.1e} times the bound"
            )
            return True
        return tighten(self, excess)

    def snapshot(self) -> dict[str, Any]:
        """Return the equations, springs and eigenvalue bounds of the hierarchy, and the requested columns of K^-1.

        See `LinearSolver.snapshot`. The keys are names in result files and must not be changed.
        """
        replacement = self.replacement and {"why": self.replacement_reason, **self.replacement.snapshot()}
        return {
            "precision": self.precision, "tolerance": self.tolerance, "bounds": self.hierarchy.bounds,
            "asked": list(self.columns.requests), **self._constrained_by(), "instead": replacement,
            "lasting": self._may_reuse_levels[0],
        }  # fmt: skip

    def _constrained_by(self) -> dict[str, Any]:
        """Return the equations and the springs for which the hierarchy was changed, as dicts of arrays or None."""
        equations, springs, tied = self._hierarchy_equations, self._hierarchy_springs, None
        if equations is not None:
            rows = equations.weights
            tied = {"pivots": equations.pivots, "indptr": rows.indptr, "indices": rows.indices, "data": rows.data}
        return {"tied": tied, "springs": springs and springs.to_dict()}

    def put_back(self, snapshot: Mapping[str, Any]) -> None:
        """See `LinearSolver.put_back`."""
        if (replacement := snapshot.get("instead")) is not None:
            (self.replacement or self._factorise(replacement["why"])).put_back(replacement)
            return
        if self.replacement is not None:  # The factorisation replaced multigrid after the snapshot was taken.
            self._factor_solver, self.replacement, self.replacement_reason = self.replacement, None, ""
        self._may_reuse_levels[0] = snapshot.get("lasting", True)
        restore_tolerance(self, snapshot)
        if snapshot["precision"] != self.precision:
            self.rebuild(snapshot["precision"])
        self.columns.put_back(snapshot["asked"])
        current, saved = self._constrained_by(), {name: snapshot.get(name) for name in ("tied", "springs")}
        if not all(_equal(current[name], saved[name]) for name in saved):
            n = self.hierarchy.n
            equations, springs = saved["tied"], saved["springs"]
            self._reduced = ReducedOperator(self.K, None)
            equations, springs = equations and _elimination(equations, n), springs and Springs.from_dict(springs, n)
            self._change_hierarchy(equations, springs)
        self.hierarchy.bounds = snapshot["bounds"]

    def give_up(self, error: StallError | TooManyColumnsError) -> None:
        """Replace multigrid by a factorisation because of an `error`.

        Raises
        ------
        StallError, TooManyColumnsError
            The given `error`, if the matrix is too large to be factorised.
        """
        if not self._may_factorise:
            limit, n = MAX_FACTORISED_DOFS[self.K.blocksize[0]], self.K.shape[0]
            error.args = (
                f"{error}. No factorisation replaced multigrid, since {n} unknowns exceed the limit of {limit}",
            )
            raise error
        if isinstance(error, TooManyIterationsError):
            reason = (
                f"multigrid gave up and a factorisation replaced it, which costs more memory: {self.iteration_limit} "
                f"iterations in one load step take longer than a factorisation of {self.K.shape[0]} unknowns"
            )
        else:
            reason = f"multigrid gave up and a factorisation replaced it, which costs more time and memory: {error}"
        self._factorise(reason)

    @property
    def _may_factorise(self) -> bool:
        """Whether the matrix is small enough to be factorised."""
        return bool(self.K.shape[0] <= MAX_FACTORISED_DOFS[self.K.blocksize[0]])

    def _factorise(self, reason: str) -> Direct:
        """Replace multigrid by a factorisation, for the given `reason`, and return the direct solver."""
        if self._factor_solver is None:
            log.warning("%s", reason)
            self._factor_solver = Direct()
            self._factor_solver.counters = self.counters
            self._factor_solver.prepare(self.K.restored(), self._modes.astype(float), self._involved)
        else:
            self._factor_solver.put_back({"asked": [], "loads": []})
        self.replacement_reason, self.replacement = reason, self._factor_solver
        # From now on the tolerance is that of the direct solver.
        self.original_tolerance = self.tolerance if self.original_tolerance is None else self.original_tolerance
        self.tolerance = self.replacement.tolerance
        return self.replacement


def _equal(first: Mapping[str, Any] | None, second: Mapping[str, Any] | None) -> bool:
    """Return whether two mappings of arrays are equal; either may be None."""
    if first is None or second is None:
        return first is second
    return all(np.array_equal(values, second[name]) for name, values in first.items())


def _elimination(tied: Mapping[str, Any], n: int) -> Elimination:
    """Return the elimination of n unknowns that is stored as ``tied`` in `Amg.snapshot`; its offsets are not used."""
    m = len(tied["pivots"])
    rows = csr_array((tied["data"], tied["indices"], tied["indptr"]), shape=(m, n))
    return Elimination(tied["pivots"], rows, np.zeros(m), rows)


def _with_fallback(method: Callable[..., Any]) -> Callable[..., Any]:
    """Return a method of `_Loaded` that uses the factorisation if the iteration stalls or multigrid has been replaced."""

    @functools.wraps(method)
    def wrapper(self: _Loaded, *args: Any, **options: Any) -> Any:
        if self._solver.replacement is None:
            try:
                return method(self, *args, **options)
            except (StallError, TooManyColumnsError) as error:
                self._solver.give_up(error)
        return getattr(self._factorisation, method.__name__)(*args, **options)

    return wrapper


class _Loaded(LoadedMultigrid):
    """A matrix prepared by `Amg` with a right-hand side; see `linear.protocol.LoadedNonsymmetric`."""

    solve = _with_fallback(LoadedMultigrid.solve)
    delassus = _with_fallback(LoadedMultigrid.delassus)
    involved_solution = _with_fallback(LoadedMultigrid.involved_solution)
    full_solution = _with_fallback(LoadedMultigrid.full_solution)

    @functools.cached_property
    def _factorisation(self) -> Loaded:
        """The factorisation with the same right-hand side."""
        return self._solver.replacement.load(self._f)

    def solve_nonsymmetric(self, *args: Any, **options: Any) -> tuple[Array, Array]:
        if self._solver.replacement is not None:
            raise ConvergenceError("with a factorisation, the friction problem is solved with the Delassus operator")
        try:
            return super().solve_nonsymmetric(*args, **options)
        except StallError as error:
            self._solver.give_up(error)
            raise


SOLVER = Amg
