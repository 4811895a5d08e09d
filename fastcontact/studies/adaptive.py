"""Adaptive mesh refinement of a case, in regions where the error affects a quantity of interest most."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.analysis.progress import StatusLine
from fastcontact.arrays import AnyArray, Array, Indices, Mask
from fastcontact.cases.case import Case, build_case, read_case
from fastcontact.cases.summary import finite_or_none
from fastcontact.errors import CaseError, FastcontactWarning, check_known
from fastcontact.mesh import elements
from fastcontact.mesh.generate import Forest, circles, linearised, to_quadratic
from fastcontact.mesh.mesh import Mesh
from fastcontact.results.plot.patches import outlines
from fastcontact.results.step import StepResult
from fastcontact.results.tables import structured
from fastcontact.results.units import axis_label
from fastcontact.studies import quantities
from fastcontact.studies.error_norms import ErrorEstimate, estimate_error
from fastcontact.studies.job import case_data, last_step
from fastcontact.studies.quantities import column, title, unit
from fastcontact.studies.report import Report, Rows, format_axes, number, panels, report_fields, to_rows
from fastcontact.studies.settings import Combination, Settings, make_mesh, matching_combination, recipe, settings


@dataclass(frozen=True, eq=False)
class Round:
    """Results on one mesh of an adaptive study.

    Attributes
    ----------
    n_dofs : int
        Number of degrees of freedom.
    n_cells : int
        Number of cells.
    values : dict of str to float
        Value of each quantity, in the units of the case.
    theory : dict of str to float
        Value of each quantity in the theory at equal approach.
    reference : dict of str to float
        Value of each quantity in the mesh-converged solution of the case.
    energy_error : float
        Estimated relative error [-] of the solution in the energy norm.
    estimate : float
        Estimated relative error [-] of the quantity of interest; NaN on the first two meshes.
    seconds : float
        Wall time [s] of the solution and the estimate.
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
        """Return the relative difference between a quantity and the mesh-converged solution of the case.

        Parameters
        ----------
        quantity : str
            Name of the quantity.

        Returns
        -------
        float
            Magnitude of the relative difference [-]; NaN if the case has no mesh-converged solution or if its value is zero.
        """
        exact = self.reference.get(quantity)
        return abs(self.values[quantity] / exact - 1.0) if exact else math.nan


@dataclass(frozen=True, eq=False, repr=False)
class AdaptiveStudy(Report):
    """The result of an adaptive study, with the attributes of `Report` and the following.

    Attributes
    ----------
    combination : str
        Element and contact formulation.
    quantity : str
        Quantity of interest.
    tolerance : float
        Requested relative error [-].
    reached : bool
        True if the estimated error of the quantity is at most the tolerance.
    rounds : list of Round
        Results on each mesh.
    case : Case
        Case on the last mesh.
    last : StepResult
        Last load step on the last mesh.
    error : ErrorEstimate
        Estimated error of each cell of the last mesh.
    """

    kind = "Adaptive meshes"
    picture = "errors over degrees of freedom, and the last mesh coloured by its error"

    combination: str
    quantity: str
    tolerance: float
    reached: bool
    rounds: list[Round]
    case: Case
    last: StepResult
    error: ErrorEstimate

    def effectivity(self, number: int = -1) -> float:
        """Return the effectivity index, the ratio of the estimated to the true error.

        Parameters
        ----------
        number : int
            Index of the mesh, by default the last one.

        Returns
        -------
        float
            Effectivity index [-]; NaN if the true error is unknown or zero, or if there is no estimate.
        """
        round_ = self.rounds[number]
        true = round_.true_error(self.quantity)
        return round_.estimate / true if true > 0 else math.nan

    def as_dict(self) -> dict[str, Any]:
        """Return the study as numbers, strings, lists and dictionaries, as ``--json`` writes it; errors are relative [-]."""
        numbers = {name: getattr(self, name) for name in ("combination", "quantity", "tolerance", "reached")}
        errors = {name: list(map(finite_or_none, values)) for name, values in self._errors().items()}
        rounds = [
            {"n_dofs": r.n_dofs, "n_cells": r.n_cells, **r.values, **dict(zip(errors, values)), "seconds": r.seconds}
            for r, values in zip(self.rounds, zip(*errors.values(), strict=True), strict=True)
        ]
        return self.with_metadata({**numbers, "value": self.rounds[-1].values[self.quantity], "rounds": rounds})

    def table(self) -> AnyArray:
        """Return a structured array (n_rounds,) with a row for each mesh, as ``--csv`` writes it.

        The fields are ``n_dofs``, ``n_cells``, the quantity of interest [unit of the quantity], ``energy_error``,
        ``estimate``, ``true_error``, which is relative to the mesh-converged solution of the case, and ``effectivity`` [-].
        """
        counts = {name: [getattr(round_, name) for round_ in self.rounds] for name in ("n_dofs", "n_cells")}
        values = [round_.values[self.quantity] for round_ in self.rounds]
        return structured({**counts, self.quantity: values, **self._errors()})

    def figure(self) -> Any:
        """Return a Matplotlib figure with the errors over degrees of freedom and the error of each cell of the last mesh."""
        heading = f"{self.title}: {self.combination}, refined for the {title(self.quantity)}"
        width, height = np.ptp(self.case.mesh.points, axis=0)
        width_of_map = float(np.clip(4.2 * width / height, 2.0, 8.0)) + 1.3  # with colour bar [inch]
        errors, mesh = panels((1, 2), (6.2 + width_of_map, 5.2), heading, widths=(6.2, width_of_map))[0]
        self._draw_errors(errors)
        self._draw_mesh(mesh)
        return mesh.figure

    def _errors(self) -> dict[str, list[float]]:
        """Return the errors (n_rounds,) [-] of all meshes by name."""
        return {
            "energy_error": [round_.energy_error for round_ in self.rounds],
            "estimate": [round_.estimate for round_ in self.rounds],
            "true_error": [round_.true_error(self.quantity) for round_ in self.rounds],
            "effectivity": [self.effectivity(k) for k in range(len(self.rounds))],
        }

    def tables(self) -> list[tuple[str, Rows]]:
        """See `Report`; the table has a row for each mesh."""
        q, errors = self.quantity, self._errors()
        headers = {"estimated error": "estimate", "energy error": "energy_error"}
        if math.isfinite(errors["true_error"][-1]):
            headers |= {"true error": "true_error", "effectivity": "effectivity"}
        columns = [
            ("round", [str(k) for k in range(len(self.rounds))]),
            ("cells", [str(round_.n_cells) for round_ in self.rounds]),
            ("DOF", [str(round_.n_dofs) for round_ in self.rounds]),
            (column(q, q, self.units), [number(round_.values[q], 8) for round_ in self.rounds]),
        ]
        columns += [(label, [number(v, 2) for v in errors[name]]) for label, name in headers.items()]
        return [(self.combination, to_rows(columns))]

    def sentences(self) -> list[str]:
        """See `Report`."""
        last, q = self.rounds[-1], self.quantity
        value = f"{title(q)} {last.values[q]:.8g} {unit(q, self.units)}".rstrip()
        verdict = "within" if self.reached else "NOT within"
        text = f"{self.combination}: {value}, estimated error {last.estimate:.1e}, {verdict} the {self.tolerance:g} requested"
        if not self.reached:
            text += ": the largest number of meshes or of degrees of freedom was reached; increase it (--max-dofs)"
        if math.isfinite(true := last.true_error(q)):
            text += f"; true error {true:.1e}, effectivity {self.effectivity():.2g}"
        return [text]

    def _draw_errors(self, ax: Any) -> None:
        """Draw the errors of all meshes over the degrees of freedom."""
        n_dofs, errors = [round_.n_dofs for round_ in self.rounds], self._errors()
        for name, style, label in (
            ("estimate", "o-", "estimated error"),
            ("true_error", "s-", "true error"),
            ("energy_error", "^-", "estimated error in the energy norm"),
        ):
            if np.isfinite(errors[name]).any():
                ax.plot(n_dofs, errors[name], style, ms=4, lw=1.0, label=label)
        ax.axhline(self.tolerance, color="black", ls="--", lw=1.0, label="tolerance")
        labels = ("degrees of freedom", "relative error [-]")
        format_axes(ax, f"Error of the {title(self.quantity)}", labels, scales=("plain log", "log"))

    def _draw_mesh(self, ax: Any) -> None:
        """Draw the last mesh with its cells coloured by their error."""
        from matplotlib.collections import PolyCollection
        from matplotlib.colors import LogNorm

        mesh, cells = self.case.mesh, self.error.cells
        shapes = [polygon for name, block in mesh.solids.items() for polygon in outlines(name, mesh.points[block])]
        error = np.maximum(cells, 1e-6 * cells.max())
        style: dict[str, Any] = {"cmap": "viridis", "edgecolors": "white", "linewidths": 0.1}
        polygons = ax.add_collection(PolyCollection(shapes, array=error, norm=LogNorm(), **style))
        ax.autoscale_view()
        ax.set_aspect("equal")
        bar = ax.figure.colorbar(polygons, ax=ax)
        bar.set_label("energy norm" + (f" [({work})$^{{1/2}}$]" if (work := self.units.get("moment")) else ""))
        labels = axis_label("x", self.units, "length"), axis_label("y", self.units, "length")
        format_axes(ax, f"Last mesh: {self.rounds[-1].n_cells} cells, estimated error", labels, grid=0.0)


# Fraction of the sum of the error indicators that the refined cells carry (Dörfler, 1996). With a larger fraction there are
# fewer but larger meshes.
BULK = 0.7
# Expected factor by which the changes of a quantity decrease from mesh to mesh.
REDUCTION = 3.0


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
    cell on the quantity, and divides each of the cells with the largest contributions into four. The error of the quantity is
    estimated from its changes from mesh to mesh.

    Parameters
    ----------
    case : Case or path-like
        A two-dimensional case with triangles and quadrangles, or the path of a case file. The first mesh is that of level 0
        of the table ``[study]`` or, without this table, the mesh of the case.
    quantity : str
        The quantity of interest, such as ``"force"``, ``"pressure_max"`` or ``"C1.stress.yy"``.
    tolerance : float
        Relative error [-] of the quantity at which the refinement stops.
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
        If true, show the progress on standard error, in terminals and notebooks.

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
    setup = settings(case)
    quantities.check_names(case, [quantity, *setup.quantities])
    combination = matching_combination(setup, element, formulation)
    forest, curves = _first_forest(case, setup, combination)
    rounds: list[Round] = []
    with StatusLine(80, progress) as line:
        while True:
            started = time.perf_counter()
            linear, leaf = forest.mesh()
            round_case = _case_on_mesh(linear, curves, case, setup, combination)
            last, error = _solve_round(round_case, quantity, setup.pair, rounds, started)
            round_ = rounds[-1]
            if on_round is not None:
                on_round(round_)
            line.draw(f"{round_.n_dofs} degrees of freedom, estimated error {round_.estimate:.1e}")
            reached = round_.estimate <= tolerance
            if reached or len(rounds) == max_rounds or round_.n_dofs > 0.6 * max_dofs:
                break
            indicator = _indicator(round_case, last, error, quantity, setup.pair)
            forest.refine(_refined_leaves(indicator, leaf, forest.n_leaves))
    return AdaptiveStudy(
        **report_fields(case), combination=str(combination), quantity=quantity, tolerance=tolerance, reached=reached,
        rounds=rounds, case=round_case, last=last, error=error)  # fmt: skip


def _first_forest(case: Case, setup: Settings, combination: Combination) -> tuple[Forest, list[Any]]:
    """Return the first mesh as a forest of linear cells, which can be refined, and the curves of its boundary."""
    mesh = case.mesh
    if setup.by_shape and combination.element is not None:
        mesh = make_mesh(recipe(setup, combination.element, 0), None)
    curves = list(setup.curves) if setup.curves is not None else circles(mesh)
    return Forest(linearised(mesh), curves), curves


def _case_on_mesh(linear: Mesh, curves: Sequence[Any], case: Case, setup: Settings, combination: Combination) -> Case:
    """Return the case on another mesh with the cells of `linear`, which become quadratic if the element type requires it."""
    element = combination.element
    quadratic = element is not None and elements.get(element).order == 2
    mesh = to_quadratic(linear, curves, centre_nodes=element == "quad9") if quadratic else linear
    return build_case(case_data(setup, combination), name=case.name, folder=case.folder, text=case.text, mesh=mesh)


def _solve_round(
    case: Case, quantity: str, pair: str | None, rounds: list[Round], started: float
) -> tuple[StepResult, ErrorEstimate]:
    """Return the last step of a case and the errors of its cells, and append the results of the round to `rounds`.

    Only the first round issues warnings.
    """
    with warnings.catch_warnings():
        if rounds:
            warnings.simplefilter("ignore", FastcontactWarning)
        last = last_step(case)
    error = estimate_error(case.model, last)
    values = quantities.measure(case, last, pair)
    check_known("quantity", quantity, values, CaseError)
    exact, n_cells = quantities.comparison_values(case, pair, 0.0), sum(map(len, case.mesh.solids.values()))
    estimate = _estimate([*(earlier.values[quantity] for earlier in rounds), values[quantity]])
    errors, seconds = (error.relative, estimate), time.perf_counter() - started
    rounds.append(Round(case.model.n_dofs, n_cells, values, exact["theory"], exact["reference"], *errors, seconds))
    return last, error


def _estimate(values: Sequence[float]) -> float:
    """Return the estimated relative error [-] of the last value of a quantity; NaN with fewer than three values.

    If changes decrease by a factor of at least two from mesh to mesh, the last change is an upper bound of the remaining
    error. The estimate is at least the previous change divided by `REDUCTION`, because the last change may be small by
    chance.
    """
    if len(values) < 3 or not values[-1]:
        return float("nan")
    first, second, last = values[-3:]
    return max(abs(last - second), abs(second - first) / REDUCTION) / abs(last)


def _indicator(case: Case, last: StepResult, error: ErrorEstimate, quantity: str, pair: str | None) -> Array:
    """Return the contribution (n_solids,) of each cell to the error of a quantity, up to a common factor.

    The error of a functional is bounded by the sum over all cells of the error of the solution times the error of the dual
    solution, which is the solution under a load that corresponds to the functional (Becker and Rannacher, 2001). For a
    force the dual solution is proportional to the solution itself. For a value at a point the dual stress decreases with
    the distance d like the stress of a point force, as d^(1 - dim) with dim = 3 also in axisymmetry (Boussinesq, 1885;
    Flamant, 1892). The error of the dual stress in a cell of size h decreases as h d^-dim; its norm over the cell is this
    error times the square root of the volume.
    """
    position = _position(case, last, quantity, pair)
    if position is None:
        return error.cells**2
    mesh, values = case.mesh, []
    axisymmetric = case.model.kinematics == "axisymmetric"
    for name, block in mesh.solids.items():
        corners = mesh.points[block[:, : elements.get(name).n_corners]]
        h = np.linalg.norm(np.ptp(corners, axis=1), axis=1)
        centre = corners.mean(axis=1)
        d = np.maximum(np.linalg.norm(centre - position, axis=1), 0.5 * h)
        volume = h**2 * (centre[:, 0] if axisymmetric else 1.0)
        values.append(h / d ** (3 if axisymmetric else 2) * np.sqrt(volume))
    return error.cells * np.concatenate(values)


def _position(case: Case, last: StepResult, quantity: str, pair: str | None) -> Array | None:
    """Return the position (dim,) [length] at which a quantity is evaluated; None for quantities of the entire model."""
    if (probe := quantity.split(".")[0]) in case.probes:
        return case.mesh.points[case.probes[probe]]
    if quantity.startswith("von_mises"):
        return case.mesh.points[int(np.argmax(last.von_mises))]
    if pair is not None and quantity.startswith("pressure_"):
        contact = last.contact[pair]
        row = np.argmin(np.abs(contact.place)) if quantity == "pressure_pole" else np.argmax(contact.pressure)
        return contact.coordinates[int(row)]
    return None


def _refined_leaves(indicator: Array, leaf: Indices, n_leaves: int) -> Mask:
    """Return the leaves to refine, as a mask (n_leaves,).

    They belong to the smallest set of cells that carries the fraction `BULK` of the sum of `indicator` (n_solids,). `leaf`
    (n_solids,) is the leaf of each cell.
    """
    order = np.argsort(-indicator, kind="stable")
    cumulative = np.cumsum(indicator[order])
    count = int(np.searchsorted(cumulative, BULK * cumulative[-1])) + 1
    marked = np.zeros(n_leaves, bool)
    marked[leaf[order[:count]]] = True
    return marked
