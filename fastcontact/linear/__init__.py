"""Linear solvers behind one protocol: one file each; a new file with a ``SOLVER`` class is a new solver."""

from __future__ import annotations

import importlib
import logging
import pkgutil

from fastcontact.errors import ModelError, unknown
from fastcontact.linear._solver import Counters, LinearSolver, Loaded

log = logging.getLogger("fastcontact")
SOLVERS = tuple(name for _, name, _ in pkgutil.iter_modules(__path__) if not name.startswith("_"))
# Above these sizes a multigrid solution is cheaper than a factorisation (measured, see bench/README.md).
DIRECT_UP_TO = {2: 500_000, 3: 15_000}


def make(name: str, *, dim: int, n_dofs: int, tolerance: float = 1e-10) -> LinearSolver:
    """Return a linear solver by name.

    Parameters
    ----------
    name : str
        ``"direct"``, ``"amg"`` or ``"auto"``: direct for 2D and small 3D problems, multigrid beyond.
    dim, n_dofs : int
        Dimension and number of unknowns, for ``"auto"``.
    tolerance : float
        Relative residual of iterative solvers.

    Raises
    ------
    ModelError
        If there is no such solver.
    """
    if name == "auto":
        name = "direct" if n_dofs <= DIRECT_UP_TO[dim] else "amg"
        log.info(
            "linear solver: %s, for %d unknowns in %dD (direct up to %d)",
            name,
            n_dofs,
            dim,
            DIRECT_UP_TO[dim],
        )
    if name not in SOLVERS:
        raise ModelError(unknown("linear solver", name, [*SOLVERS, "auto"]))
    solver: LinearSolver = importlib.import_module(f"{__name__}.{name}").SOLVER(tolerance)
    return solver


__all__ = ["SOLVERS", "Counters", "LinearSolver", "Loaded", "make"]
