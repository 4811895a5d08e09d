"""Selection of linear solvers by name, and automatic choice of a solver according to the size of the problem.

Each module of the package `solvers` defines a solver class as ``SOLVER``. The name of the solver is that of the module.
"""

from __future__ import annotations

import importlib
import importlib.util
import logging
import pkgutil

from fastcontact.errors import ModelError, unknown
from fastcontact.linear import solvers
from fastcontact.linear.factor_solver import MAX_FACTORISED_DOFS
from fastcontact.linear.protocol import TOLERANCE, LinearSolver

log = logging.getLogger("fastcontact")
# For each solver that needs an optional package, the name of the package and of the extra of fastcontact that installs it.
PACKAGES = {"cholmod": ("kvxopt", "cholmod")}
SOLVER_NAMES = tuple(name for _, name, _ in pkgutil.iter_modules(solvers.__path__))
SOLVERS = tuple(name for name in SOLVER_NAMES if name not in PACKAGES or importlib.util.find_spec(PACKAGES[name][0]))
# Largest admissible relative residual.
MAX_TOLERANCE = 1e-3
# Number of unknowns, by dimension, above which a solution by multigrid is cheaper than a factorisation (measured, see
# bench/README.md). If constraints require columns of K^-1, the limit is MAX_FACTORISED_DOFS, because multigrid solves one
# linear system for each column.
MAX_DIRECT_DOFS = {2: MAX_FACTORISED_DOFS[2], 3: 15_000}
# The same limit in 3D for quadratic cells, with which multigrid takes about ten times as many iterations.
MAX_DIRECT_DOFS_QUADRATIC = 50_000


def make(
    name: str, *, dim: int, n_dofs: int, tolerance: float = TOLERANCE, precision: str | None = None,
    needs_columns: bool = False, has_quadratic_cells: bool = False,
) -> LinearSolver:  # fmt: skip
    """Return a linear solver by name.

    Parameters
    ----------
    name : str
        - ``"direct"``: Cholesky factorisation;
        - ``"cholmod"``: Cholesky factorisation by CHOLMOD, which needs an optional package;
        - ``"amg"``: multigrid, which takes more iterations for thin parts and nearly incompressible materials;
        - ``"pyamg"``: the slower multigrid method of pyamg, for comparison;
        - ``"auto"``: ``"direct"`` for 2D problems and small 3D problems, otherwise ``"amg"``.
    dim, n_dofs : int
        Dimension and number of unknowns, for the choice by ``"auto"``.
    tolerance : float
        Relative residual at which iterative solvers stop; at most 0.001.
    precision : {"single", "double"}, optional
        Precision of the multigrid cycle, single by default. Direct solvers always use double precision.
    needs_columns : bool
        Whether there are constraints that cannot be eliminated and require columns of ``K^-1``, such as those with a full
        compliance matrix; for the choice by ``"auto"``.
    has_quadratic_cells : bool
        Whether there are quadratic cells in linear bodies; for the choice by ``"auto"``.

    Raises
    ------
    ModelError
        If the name is unknown, if a package that the solver needs is missing, or if the tolerance is out of range.
    """
    check_solver(name)
    check_tolerance(tolerance)
    if name == "auto":
        name, reason = automatic_choice(dim, n_dofs, needs_columns, has_quadratic_cells)
        log.info("linear solver: %s, %s", name, reason)
    options = {} if precision is None or name != "amg" else {"precision": precision}
    solver: LinearSolver = importlib.import_module(f"{solvers.__name__}.{name}").SOLVER(tolerance, **options)
    return solver


def check_solver(name: str) -> None:
    """Raise a ModelError if the name of a linear solver is unknown, or if a package that it needs is missing."""
    if name in PACKAGES and name not in SOLVERS:
        package, extra = PACKAGES[name]
        raise ModelError(f"linear solver '{name}' needs the package {package}: pip install 'fastcontact[{extra}]'")
    if name not in (*SOLVERS, "auto"):
        raise ModelError(unknown("linear solver", name, [*SOLVERS, "auto"]))


def check_tolerance(tolerance: float) -> None:
    """Raise a ModelError if the tolerance of a linear solver is out of range."""
    if not 0.0 < tolerance <= MAX_TOLERANCE:
        raise ModelError(f"linear_tolerance = {tolerance} must be positive and at most {MAX_TOLERANCE}, such as 1e-10")


def limited_tolerance(tolerance: float, relative: float) -> float:
    """Check `tolerance`, and return the smaller of it and the criterion `relative` on the residual force."""
    check_tolerance(tolerance)
    if tolerance > relative:
        log.info("linear solver: the tolerance %.1e is reduced to the residual criterion %.1e", tolerance, relative)
    return min(tolerance, relative)


def automatic_choice(dim: int, n_dofs: int, needs_columns: bool, has_quadratic_cells: bool) -> tuple[str, str]:
    """Return the name of the solver that ``"auto"`` selects, and the reason for it; for parameters see `make`."""
    limit = (MAX_FACTORISED_DOFS if needs_columns else MAX_DIRECT_DOFS)[dim]
    limit = max(limit, MAX_DIRECT_DOFS_QUADRATIC) if has_quadratic_cells and dim == 3 else limit
    if n_dofs <= limit:
        return "direct", f"for {n_dofs} unknowns in {dim}D a factorisation is cheapest (up to {limit})"
    return "amg", f"for {n_dofs} unknowns in {dim}D a factorisation costs more than multigrid (above {limit})"
