"""Adaptive meshes: solve, estimate the error, refine where it is large, until a quantity is accurate enough."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.analysis.progress import StatusLine
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.cases.case import Case, build_case, read_case
from fastcontact.errors import CaseError, FastcontactWarning, check_known
from fastcontact.mesh import elements
from fastcontact.mesh.generate import Forest, circles, linearised, to_quadratic
from fastcontact.mesh.mesh import Mesh
from fastcontact.results.step import StepResult
from fastcontact.studies import quantities
from fastcontact.studies.adaptive_report import AdaptiveStudy, Round
from fastcontact.studies.error_estimate import ErrorEstimate, estimate_error
from fastcontact.studies.job import case_data, last_step
from fastcontact.studies.levels import make_mesh, recipe
from fastcontact.studies.report import of_case
from fastcontact.studies.settings import Combination, Settings, one_combination, settings

# Cells that contribute this fraction of the error are refined; a larger one needs fewer, larger meshes (Dörfler, 1996).
BULK = 0.7
# If refinement converges, differences shrink by at least this factor from round to round.
SHRINKING = 3.0


@typed(CaseError)
def adaptive_study(
    case: Case | str | Path,
    quantity: str = "pressure_max",
    tolerance: float = 1e-3,
    *,
    element: str | None = None,
    formulation: str | None = None,
    max_dofs: int = 400_000,
    max_rounds: int = 25,
    on_round: Callable[[Round], None] | None = None,
    progress: bool = False,
) -> AdaptiveStudy:
    """Refine the mesh of a case adaptively until a quantity is accurate enough.

    Every round solves the case, estimates the error of each cell (`estimate_error`), weights it by its influence on
    the quantity, and divides the cells with the largest contributions in four. The error of the quantity is estimated
    from its changes.

    Parameters
    ----------
    case : Case or path-like
        A case in two dimensions, with triangles and quadrangles. The first mesh is level 0 of its ``[study]``,
        otherwise its own mesh.
    quantity : str
        The quantity of interest, e.g. ``"force"``, ``"pressure_max"``, ``"C1.stress.yy"``.
    tolerance : float
        Target relative error [-].
    element, formulation : str, optional
        By default the last of ``study.combinations``, or those of the case.
    max_dofs, max_rounds : int
        Limits at which the refinement stops: no new mesh after one with more than 60 % of `max_dofs`, since the next may
        exceed it.
    on_round : callable, optional
        Called with every `Round`.
    progress : bool
        Show the progress on standard error, updated after every round, on terminals and in notebooks.

    Returns
    -------
    AdaptiveStudy

    Raises
    ------
    CaseError
        If the case, a name or a number is invalid.
    FastcontactError
        If the case could not be solved on one of the meshes.

    Examples
    --------
    >>> import fastcontact as fc
    >>> study = fc.adaptive_study("forma04c.toml", "pressure_max", tolerance=0.005)  # doctest: +SKIP
    >>> print(study)  # doctest: +SKIP
    """
    case = _checked(case, tolerance)
    chosen = settings(case)
    quantities.check_names(case, [quantity, *chosen.quantities])
    combination = one_combination(chosen, element, formulation)
    forest, curves = _first_mesh(case, chosen, combination)
    rounds: list[Round] = []
    with StatusLine(80, progress) as line:
        while True:
            started = time.perf_counter()
            linear, leaf = forest.mesh()
            solved = _case_on(linear, curves, case, chosen, combination)
            last, error, this = _solved(solved, quantity, chosen.pair, rounds, started)
            rounds.append(this)
            if on_round is not None:
                on_round(this)
            line.draw(f"{this.n_dofs} degrees of freedom, estimated error {this.estimate:.1e}")
            reached = this.estimate <= tolerance
            if reached or len(rounds) == max_rounds or this.n_dofs > 0.6 * max_dofs:
                break
            forest.refine(_marked(_indicator(solved, last, error, quantity, chosen.pair), leaf, forest.n_leaves))
    return AdaptiveStudy(
        **of_case(case), combination=str(combination), quantity=quantity, tolerance=tolerance, reached=reached, rounds=rounds,
        case=solved, last=last, error=error)  # fmt: skip


def _checked(case: Case | str | Path, tolerance: float) -> Case:
    case = case if isinstance(case, Case) else read_case(case)
    if not 0 < tolerance < 1:
        raise CaseError(f"the relative tolerance {tolerance:g} must lie between 0 and 1")
    if case.mesh.dim != 2:
        raise CaseError("adaptive refinement is for triangles and quadrangles in two dimensions; this case is in 3D")
    return case


def _first_mesh(case: Case, chosen: Settings, combination: Combination) -> tuple[Forest, list[Any]]:
    """Return the first mesh, of divisible linear cells, and the curves of its boundary."""
    mesh = case.mesh
    if chosen.by_shape and combination.element is not None:
        mesh = make_mesh(recipe(chosen, combination.element, 0), None)
    curves = list(chosen.curves) if chosen.curves is not None else circles(mesh)
    return Forest(linearised(mesh), curves), curves


def _case_on(linear: Mesh, curves: Sequence[Any], case: Case, chosen: Settings, combination: Combination) -> Case:
    """Return the case on another mesh of linear cells, which become quadratic if the element is."""
    element = combination.element
    quadratic = element is not None and elements.get(element).order == 2
    mesh = to_quadratic(linear, curves, centre_nodes=element == "quad9") if quadratic else linear
    return build_case(case_data(chosen, combination), name=case.name, folder=case.folder, text=case.text, mesh=mesh)


def _solved(
    case: Case, quantity: str, pair: str | None, before: Sequence[Round], started: float
) -> tuple[StepResult, ErrorEstimate, Round]:
    """Solve a case, estimate its error, measure its quantities; warnings are issued in the first round only."""
    with warnings.catch_warnings():
        if before:
            warnings.simplefilter("ignore", FastcontactWarning)
        last = last_step(case)
    error = estimate_error(case.model, last)
    values = quantities.measure(case, last, pair)
    check_known("quantity", quantity, values, CaseError)
    exact = quantities.by_theory(case, pair, 0.0)
    n_cells = sum(map(len, case.mesh.solids.values()))
    estimate = _estimate([*(round_before.values[quantity] for round_before in before), values[quantity]])
    this = Round(
        n_dofs=case.model.n_dofs,
        n_cells=n_cells,
        values=values,
        theory=exact["theory"],
        reference=exact["reference"],
        energy_error=error.relative,
        estimate=estimate,
        seconds=time.perf_counter() - started,
    )
    return last, error, this


def _estimate(values: Sequence[float]) -> float:
    """Return the estimated relative error of the last of a quantity's values; NaN before there are three meshes.

    The last change bounds the remaining error if changes shrink by a factor of two or more; the change before it guards
    against one that is small by chance.
    """
    if len(values) < 3 or not values[-1]:
        return float("nan")
    first, second, last = values[-3:]
    return max(abs(last - second), abs(second - first) / SHRINKING) / abs(last)


def _indicator(case: Case, last: StepResult, error: ErrorEstimate, quantity: str, pair: str | None) -> Array:
    """Return the contribution (n_solids,) of each cell to the error of a quantity, up to a common factor.

    The error of a functional is at most the sum over all cells of the solution's error times that of the dual solution, the
    solution under a load where the quantity is measured (Becker and Rannacher, 2001). For a force the dual solution is
    proportional to the solution itself.
    For a value at a point the dual stress falls with the distance d like that under a point force, d^(1 - dim) with dim = 3
    in axisymmetry, too (Boussinesq, 1885; Flamant, 1892), and its error in a cell of size h like h d^-dim.
    """
    where = _place(case, last, quantity, pair)
    if where is None:
        return error.cells**2
    mesh, values = case.mesh, []
    axisymmetric = case.model.kinematics == "axisymmetric"
    for name, block in mesh.solids.items():
        corners = mesh.points[block[:, : elements.get(name).n_corners]]
        h = np.linalg.norm(np.ptp(corners, axis=1), axis=1)
        centre = corners.mean(axis=1)
        d = np.maximum(np.linalg.norm(centre - where, axis=1), 0.5 * h)
        volume = h**2 * (centre[:, 0] if axisymmetric else 1.0)
        values.append(h / d ** (3 if axisymmetric else 2) * np.sqrt(volume))
    return error.cells * np.concatenate(values)


def _place(case: Case, last: StepResult, quantity: str, pair: str | None) -> Array | None:
    """Return the point (dim,) where a quantity is measured [length]; None for global quantities."""
    probe = quantity.split(".")[0]
    if probe in case.probes:
        return case.mesh.points[case.probes[probe]]
    if quantity.startswith("von_mises"):
        return case.mesh.points[int(np.argmax(last.von_mises))]
    if pair is not None and quantity.startswith("pressure_"):
        contact = last.contact[pair]
        at = np.argmin(np.abs(contact.place)) if quantity == "pressure_pole" else np.argmax(contact.pressure)
        return contact.coordinates[int(at)]
    return None


def _marked(indicator: Array, leaf: Indices, n_leaves: int) -> Mask:
    """Mark leaves (n_leaves,) to divide: the fewest cells that hold the fraction `BULK` of an indicator (n_solids,)."""
    order = np.argsort(-indicator, kind="stable")
    carried = np.cumsum(indicator[order])
    count = int(np.searchsorted(carried, BULK * carried[-1])) + 1
    marked = np.zeros(n_leaves, bool)
    marked[leaf[order[:count]]] = True
    return marked
