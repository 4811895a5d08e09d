"""Linear solvers by name, and the choice of one by the size of a problem; a new file in `solvers` is a new solver."""

from __future__ import annotations

import importlib
import importlib.util
import logging
import pkgutil

from fastcontact.errors import ModelError, unknown
from fastcontact.linear import solvers
from fastcontact.linear.factor_solver import AFFORDABLE
from fastcontact.linear.protocol import TOLERANCE, LinearSolver

log = logging.getLogger("fastcontact")
# Solvers that need an optional package, and the extra that installs it.
OPTIONAL = {"cholmod": ("kvxopt", "cholmod")}
KNOWN = tuple(name for _, name, _ in pkgutil.iter_modules(solvers.__path__))
SOLVERS = tuple(name for name in KNOWN if name not in OPTIONAL or importlib.util.find_spec(OPTIONAL[name][0]))
# Largest admissible relative residual.
LOOSEST = 1e-3
# Sizes above which a multigrid solution is cheaper than a factorisation (measured, see bench/README.md); where
# constraints need columns of K^-1, which a factorisation provides at once and multigrid by one solution each: AFFORDABLE.
DIRECT_UP_TO = {2: AFFORDABLE[2], 3: 15_000}


def make(
    name: str, *, dim: int, n_dofs: int, tolerance: float = TOLERANCE, precision: str | None = None, columns: bool = False
) -> LinearSolver:  # fmt: skip
    """Return a linear solver by name.

    Parameters
    ----------
    name : str
        ``"direct"``; ``"cholmod"``, direct too, where its package is installed; ``"amg"``, multigrid; ``"pyamg"``, slow,
        to compare with; or ``"auto"``: direct for 2D and small 3D problems, multigrid beyond. Multigrid needs
        more iterations where parts are thin or materials nearly incompressible.
    dim, n_dofs : int
        Dimension and number of unknowns, for ``"auto"``.
    tolerance : float
        Relative residual of iterative solvers, at most 0.001.
    precision : {"single", "double"}, optional
        Precision of the multigrid cycle, single by default; direct solvers always work in double precision.
    columns : bool
        Whether constraints cannot be eliminated but need columns of ``K^-1``, as those with a full compliance do. For
        ``"auto"``.

    Raises
    ------
    ModelError
        If there is no such solver, a package that it needs is missing, or the tolerance is out of range.
    """
    check_tolerance(tolerance)
    if name == "auto":
        name, reason = chosen(dim, n_dofs, columns)
        log.info("linear solver: %s, %s", name, reason)
    if name in OPTIONAL and name not in SOLVERS:
        package, extra = OPTIONAL[name]
        raise ModelError(f"linear solver '{name}' needs the package {package}: pip install 'fastcontact[{extra}]'")
    if name not in SOLVERS:
        raise ModelError(unknown("linear solver", name, [*SOLVERS, "auto"]))
    options = {} if precision is None or name != "amg" else {"precision": precision}
    solver: LinearSolver = importlib.import_module(f"{solvers.__name__}.{name}").SOLVER(tolerance, **options)
    return solver


def check_tolerance(tolerance: float) -> None:
    """Raise ModelError if a tolerance of linear solvers is out of range."""
    if not 0.0 < tolerance <= LOOSEST:
        raise ModelError(
            f"the tolerance {tolerance} of the linear solver must be positive and at most {LOOSEST}, such as 1e-10"
        )


def tight_enough(tolerance: float, relative: float) -> float:
    """Return a checked `tolerance`, or the criterion on the out-of-balance force if that is smaller."""
    check_tolerance(tolerance)
    if tolerance > relative:
        log.info("linear solver: the tolerance %.1e falls to %.1e, the criterion on balance", tolerance, relative)
        return relative
    return tolerance


def chosen(dim: int, n_dofs: int, columns: bool = False) -> tuple[str, str]:
    """Return the solver chosen by ``"auto"``, and the reason."""
    limit = (AFFORDABLE if columns else DIRECT_UP_TO)[dim]
    if n_dofs <= limit:
        return "direct", f"for {n_dofs} unknowns in {dim}D a factorisation is cheapest (up to {limit})"
    return "amg", f"for {n_dofs} unknowns in {dim}D a factorisation is dearer than multigrid (beyond {limit})"
