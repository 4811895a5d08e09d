"""Adaptive meshes: solve, estimate the error, refine where it is large, until a quantity of interest is accurate enough."""

from __future__ import annotations

import dataclasses
import time
import warnings
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastcontact.analysis.run import solve_steps
from fastcontact.cases.case import Case, build_case, read_case
from fastcontact.errors import CaseError, FastcontactWarning, unknown
from fastcontact.mesh import elements
from fastcontact.mesh.generate import Forest, circles, linearised, to_quadratic
from fastcontact.mesh.mesh import Mesh
from fastcontact.results.step import StepResult
from fastcontact.studies import quantities
from fastcontact.studies.error_estimate import ErrorEstimate, estimate_error
from fastcontact.studies.job import case_data
from fastcontact.studies.levels import make_mesh, recipe
from fastcontact.studies.settings import Combination, Settings, one_combination, settings

Array = NDArray[np.float64]
# Cells that carry this part of the error are refined: a larger part makes fewer, larger steps (Doerfler, 1996).
BULK = 0.7
# From round to round differences shrink by at least so much where refinement converges.
SHRINKING = 3.0


@dataclass(frozen=True, eq=False)
class Round:
    """One mesh of an adaptive study.

    Attributes
    ----------
    n_dofs, n_cells : int
    values, theory, reference : dict of str to float
        Quantities of interest; what the theory at equal approach and the mesh-converged solution say of them.
    energy_error : float
        Estimated error of the whole solution in the energy norm, relative.
    estimate : float
        Estimated error of the wanted quantity, relative; NaN on the first two meshes.
    seconds : float
    """

    n_dofs: int
    n_cells: int
    values: dict[str, float]
    theory: dict[str, float]
    reference: dict[str, float]
    energy_error: float
    estimate: float
    seconds: float

    def true_error(self, quantity: str) -> float:
        """Return the difference from the case's mesh-converged solution, relative; NaN without one."""
        exact = self.reference.get(quantity)
        return abs(self.values[quantity] / exact - 1.0) if exact else float("nan")


@dataclass(frozen=True, eq=False)
class AdaptiveStudy:
    """A finished adaptive study.

    Attributes
    ----------
    name, title, text : str
        Of the case.
    units : dict of str to str
    combination : str
        Element and formulation.
    quantity : str
    tolerance : float
        Relative error asked for.
    reached : bool
        Whether the estimate fell below it.
    rounds : list of Round
    case : Case
        That of the last mesh.
    last : StepResult
        Its solution.
    error : ErrorEstimate
        Its error, cell by cell.
    """

    name: str
    title: str
    text: str
    units: dict[str, str]
    combination: str
    quantity: str
    tolerance: float
    reached: bool
    rounds: list[Round]
    case: Case
    last: StepResult
    error: ErrorEstimate

    def effectivity(self, number: int = -1) -> float:
        """Return estimated over true error of the quantity in a round; NaN without a reference."""
        found = self.rounds[number]
        true = found.true_error(self.quantity)
        return found.estimate / true if true > 0 else float("nan")

    def as_dict(self) -> dict[str, Any]:
        """Return plain numbers, texts, lists and dictionaries, as ``--json`` writes them."""
        from fastcontact.studies.adaptive_output import as_dict

        return as_dict(self)

    def table(self) -> NDArray[Any]:
        """Return a structured array, one row a mesh, as ``--csv`` writes it."""
        from fastcontact.studies.adaptive_output import table

        return table(self)

    def lines(self) -> list[str]:
        """Return a table and a sentence for a person."""
        from fastcontact.studies.adaptive_output import lines

        return lines(self)

    def figure(self) -> Any:
        """Return a matplotlib figure: the last mesh coloured by its error, and errors over degrees of freedom."""
        from fastcontact.studies.adaptive_output import figure

        return figure(self)

    def html(self) -> str:
        """Return the study as one self-contained HTML page."""
        from fastcontact.studies.adaptive_output import html_report

        return html_report(self)


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
) -> AdaptiveStudy:
    """Refine the mesh of a case where its error is large, until a quantity is accurate enough.

    Every round solves the case, estimates the error of each cell (`estimate_error`), weighs it with what it does to the
    quantity, and quarters the cells that carry most of it (`generate.Forest`), arcs kept round. The error of the quantity
    is estimated from its last changes.

    Parameters
    ----------
    case : Case or path-like
        In two dimensions, of triangles and quadrangles. The first mesh is level 0 of its ``[study]``, otherwise its own.
    quantity : str
        What must be accurate, e.g. ``"force"``, ``"pressure_max"``, ``"C1.stress.yy"``.
    tolerance : float
        Relative error wanted.
    element, formulation : str, optional
        By default the last of ``study.combinations``, or the case's own.
    max_dofs, max_rounds : int
        Where to stop in any case.
    on_round : callable, optional
        Called with every `Round`.

    Raises
    ------
    CaseError, FastcontactError
        If the case, a name or a number is wrong, or a mesh could not be solved.
    """
    case = case if isinstance(case, Case) else read_case(case)
    if not 0 < tolerance < 1:
        raise CaseError(f"the relative tolerance {tolerance:g} must lie between 0 and 1")
    if case.mesh.dim != 2:
        raise CaseError("adaptive refinement is for triangles and quadrangles in two dimensions; this case is in 3D")
    chosen = settings(case)
    member = one_combination(chosen, element, formulation)
    first, curves = _first_mesh(case, chosen, member)
    forest = Forest(first, curves)
    rounds: list[Round] = []
    while True:
        linear, leaf = forest.mesh()
        found, last, error, this = _solved(case, chosen, member, linear, curves, rounds, quantity)
        rounds.append(this)
        if on_round is not None:
            on_round(this)
        reached = this.estimate <= tolerance
        if reached or len(rounds) == max_rounds or this.n_dofs > 0.6 * max_dofs:
            break
        marked = np.zeros(forest.n_leaves, bool)
        marked[leaf[_bulk(_indicator(found, last, error, quantity, chosen.pair))]] = True
        forest.refine(marked)
    return AdaptiveStudy(
        case.name, case.title, case.text, case.units, str(member), quantity, tolerance, reached, rounds, found, last, error,
    )  # fmt: skip


def _first_mesh(case: Case, chosen: Settings, member: Combination) -> tuple[Mesh, list[Any]]:
    by_shape = chosen.generator is not None and "" not in chosen.arguments
    mesh = case.mesh
    if by_shape and member.element is not None:
        mesh = make_mesh(recipe(chosen, member.element, 0), None)
    curves = list(chosen.curves) if chosen.curves is not None else circles(mesh)
    return linearised(mesh), curves


def _solved(
    case: Case, chosen: Settings, member: Combination, linear: Mesh, curves: Sequence[Any], before: Sequence[Round],
    quantity: str,
) -> tuple[Case, StepResult, ErrorEstimate, Round]:  # fmt: skip
    started = time.perf_counter()
    element = member.element
    quadratic = element is not None and elements.get(element).order == 2
    mesh = to_quadratic(linear, curves, centre_nodes=element == "quad9") if quadratic else linear
    found = build_case(case_data(chosen, member), name=case.name, text=case.text, mesh=mesh)
    with warnings.catch_warnings():
        if before:  # said once
            warnings.simplefilter("ignore", FastcontactWarning)
        steps = solve_steps(
            found.model, found.ramp, linear_solver=case.linear_solver, linear_tolerance=case.linear_tolerance,
            criteria=case.criteria,
        )  # fmt: skip
        last = deque(steps, maxlen=1).pop()  # none of the others is kept
    error = estimate_error(found.model, last)
    values = quantities.measure(found, last, chosen.pair)
    if quantity not in values:
        raise CaseError(unknown("quantity", quantity, values))
    theories = found.theories.get(chosen.pair or "", {})
    this = Round(
        n_dofs=found.model.n_dofs,
        n_cells=sum(map(len, mesh.solids.values())),
        values=values,
        theory=quantities.of_theory(theories["theory"]) if "theory" in theories else {},
        reference=quantities.of_theory(theories["mesh_converged"]) if "mesh_converged" in theories else {},
        energy_error=error.relative,
        estimate=float("nan"),
        seconds=time.perf_counter() - started,
    )
    return found, last, error, _with_estimate(this, before, quantity)


def _with_estimate(this: Round, before: Sequence[Round], quantity: str) -> Round:
    """Return the round with the estimated error of the quantity, once there are three meshes.

    The last change bounds what is left where changes shrink by a factor of two or more; the one before guards against a
    change that is small by chance.
    """
    if len(before) < 2:
        return this
    first, second, last = (found.values[quantity] for found in (*before[-2:], this))
    change = max(abs(last - second), abs(second - first) / SHRINKING)
    return dataclasses.replace(this, estimate=change / abs(last) if last else float("nan"))


def _indicator(case: Case, last: StepResult, error: ErrorEstimate, quantity: str, pair: str | None) -> Array:
    """Return how much each cell contributes to the error of a quantity, up to a factor.

    The error of a functional is at most the sum over all cells of the solution's error times that of the dual solution, the
    answer to a load where the quantity is measured (Becker and Rannacher, 2001). For a force that is the solution itself.
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
    """Return the point where a quantity is measured; None for those that belong to the whole solution."""
    probe = quantity.split(".")[0]
    if probe in case.probes:
        return case.mesh.points[case.probes[probe]]
    if quantity.startswith("von_mises"):
        return case.mesh.points[int(np.argmax(last.von_mises))]
    if pair is not None and quantity.startswith("pressure_"):
        contact = last.contact[pair]
        at = (
            np.argmin(np.abs(contact.coordinates[:, 0])) if quantity == "pressure_pole" else np.argmax(contact.pressure)
        )
        return contact.coordinates[int(at)]
    return None


def _bulk(indicator: Array) -> NDArray[np.intp]:
    """Return the fewest cells that carry the part `BULK` of the indicator's sum."""
    order = np.argsort(-indicator, kind="stable")
    carried = np.cumsum(indicator[order])
    return order[: int(np.searchsorted(carried, BULK * carried[-1])) + 1]
