"""Adaptive mesh refinement: solve, estimate the error and refine in turn, until a quantity is accurate enough."""

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
from fastcontact.studies.error_norms import ErrorEstimate, estimate_error
from fastcontact.studies.job import case_data, last_step
from fastcontact.studies.levels import make_mesh, recipe
from fastcontact.studies.report import of_case
from fastcontact.studies.settings import Combination, Settings, one_combination, settings

# Fraction of the error whose cells are refined (Dörfler, 1996). With a larger fraction there are fewer but larger meshes.
BULK = 0.7
# Factor by which the changes of a quantity decrease from round to round if the refinement converges.
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

    Each round solves the case, estimates the error of each cell with `estimate_error`, weights it by the influence of the
    cell on the quantity, and divides the cells with the largest contributions in four. The error of the quantity is
    estimated from its changes from round to round.

    Parameters
    ----------
    case : Case or path-like
        A two-dimensional case with triangles and quadrangles, or the path of a case file. The first mesh is that of level 0
        of the table ``[study]`` or, without this table, the mesh of the case.
    quantity : str
        The quantity of interest, such as ``"force"``, ``"pressure_max"`` or ``"C1.stress.yy"``.
    tolerance : float
        Relative error of the quantity at which the refinement stops [-].
    element, formulation : str, optional
        Element type and contact formulation; by default the last of ``study.combinations`` or, without these, those of the
        case.
    max_dofs : int
        Largest number of degrees of freedom. After a mesh with more than 60 % of this number the refinement stops, because
        the next mesh may exceed it.
    max_rounds : int
        Largest number of meshes.
    on_round : callable, optional
        Function that is called with a `Round` after every round.
    progress : bool
        Whether to show the progress on standard error, in terminals and notebooks.

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
    case = case if isinstance(case, Case) else read_case(case)
    if not 0 < tolerance < 1:
        raise CaseError(f"the relative tolerance {tolerance:g} must lie between 0 and 1")
    if case.mesh.dim != 2:
        raise CaseError("adaptive refinement is for triangles and quadrangles in two dimensions; this case is in 3D")
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
            last, error, round_ = _solved(solved, quantity, chosen.pair, rounds, started)
            rounds.append(round_)
            if on_round is not None:
                on_round(round_)
            line.draw(f"{round_.n_dofs} degrees of freedom, estimated error {round_.estimate:.1e}")
            reached = round_.estimate <= tolerance
            if reached or len(rounds) == max_rounds or round_.n_dofs > 0.6 * max_dofs:
                break
            forest.refine(_marked(_indicator(solved, last, error, quantity, chosen.pair), leaf, forest.n_leaves))
    return AdaptiveStudy(
        **of_case(case), combination=str(combination), quantity=quantity, tolerance=tolerance, reached=reached, rounds=rounds,
        case=solved, last=last, error=error)  # fmt: skip


def _first_mesh(case: Case, chosen: Settings, combination: Combination) -> tuple[Forest, list[Any]]:
    """Return the first mesh as a forest of linear cells that can be divided, and the curves of its boundary."""
    mesh = case.mesh
    if chosen.by_shape and combination.element is not None:
        mesh = make_mesh(recipe(chosen, combination.element, 0), None)
    curves = list(chosen.curves) if chosen.curves is not None else circles(mesh)
    return Forest(linearised(mesh), curves), curves


def _case_on(linear: Mesh, curves: Sequence[Any], case: Case, chosen: Settings, combination: Combination) -> Case:
    """Return the case on another mesh of linear cells, which are converted if the element type is quadratic."""
    element = combination.element
    quadratic = element is not None and elements.get(element).order == 2
    mesh = to_quadratic(linear, curves, centre_nodes=element == "quad9") if quadratic else linear
    return build_case(case_data(chosen, combination), name=case.name, folder=case.folder, text=case.text, mesh=mesh)


def _solved(
    case: Case, quantity: str, pair: str | None, before: Sequence[Round], started: float
) -> tuple[StepResult, ErrorEstimate, Round]:
    """Solve a case, estimate the errors of its cells, and evaluate its quantities; only the first round issues warnings."""
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
    round_ = Round(
        n_dofs=case.model.n_dofs,
        n_cells=n_cells,
        values=values,
        theory=exact["theory"],
        reference=exact["reference"],
        energy_error=error.relative,
        estimate=estimate,
        seconds=time.perf_counter() - started,
    )
    return last, error, round_


def _estimate(values: Sequence[float]) -> float:
    """Return the estimated relative error of the last value of a quantity [-]; NaN with fewer than three values.

    If changes decrease by a factor of at least two from mesh to mesh, the last change is an upper bound of the remaining
    error. The change before it is also taken into account, because the last one may be small by chance.
    """
    if len(values) < 3 or not values[-1]:
        return float("nan")
    first, second, last = values[-3:]
    return max(abs(last - second), abs(second - first) / SHRINKING) / abs(last)


def _indicator(case: Case, last: StepResult, error: ErrorEstimate, quantity: str, pair: str | None) -> Array:
    """Return the contribution (n_solids,) of each cell to the error of a quantity, up to a common factor.

    The error of a functional is bounded by the sum over all cells of the error of the solution times the error of the dual
    solution, which is the solution under a load that corresponds to the functional (Becker and Rannacher, 2001). For a
    force the dual solution is proportional to the solution itself.
    For a value at a point the dual stress decreases with the distance d like the stress of a point force, as d^(1 - dim)
    with dim = 3 also in axisymmetry (Boussinesq, 1885; Flamant, 1892). Its error in a cell of size h decreases as h d^-dim.
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
    """Return the position (dim,) [length] at which a quantity is evaluated; None for quantities of the entire model."""
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
    """Return for each leaf (n_leaves,) whether to divide it.

    The marked leaves are those of the fewest cells whose sum is the fraction `BULK` of the sum of `indicator` (n_solids,).
    """
    order = np.argsort(-indicator, kind="stable")
    carried = np.cumsum(indicator[order])
    count = int(np.searchsorted(carried, BULK * carried[-1])) + 1
    marked = np.zeros(n_leaves, bool)
    marked[leaf[order[:count]]] = True
    return marked
