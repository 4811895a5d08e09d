"""The result of an adaptive study and its report as lines, table, dictionary, figure and page."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from fastcontact.arrays import AnyArray
from fastcontact.cases.case import Case
from fastcontact.cases.summary import finite
from fastcontact.results.plot.patches import outlines
from fastcontact.results.step import StepResult
from fastcontact.results.tables import structured
from fastcontact.results.units import labelled
from fastcontact.studies.error_norms import ErrorEstimate
from fastcontact.studies.quantities import column, title, unit
from fastcontact.studies.render import Rows, by_columns, frame, number, panels
from fastcontact.studies.report import Report


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
        Value of each quantity [units of the case].
    theory : dict of str to float
        Value of each quantity in the theory at equal approach [units of the case].
    reference : dict of str to float
        Value of each quantity in the mesh-converged solution of the case [units of the case].
    energy_error : float
        Estimated relative error of the solution in the energy norm [-].
    estimate : float
        Estimated relative error of the quantity of interest [-]; NaN on the first two meshes.
    seconds : float
        Wall time of the solution and the estimate [s].
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
        Whether the estimated error is at most the tolerance.
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
        numbers = {
            "combination": self.combination,
            "quantity": self.quantity,
            "tolerance": self.tolerance,
            "reached": self.reached,
            "value": self.rounds[-1].values[self.quantity],
            "rounds": [self._round(k) for k in range(len(self.rounds))],
        }
        return self.framed(numbers)

    def _round(self, k: int) -> dict[str, Any]:
        round_, errors = self.rounds[k], {name: finite(values[k]) for name, values in self._errors().items()}
        counts = {"n_dofs": round_.n_dofs, "n_cells": round_.n_cells}
        return {**counts, **round_.values, **errors, "seconds": round_.seconds}

    def table(self) -> AnyArray:
        """Return a structured array (n_rounds,) with a row for each mesh, as ``--csv`` writes it.

        The fields are ``n_dofs``, ``n_cells``, the quantity of interest [unit of the quantity], ``energy_error``,
        ``estimate``, ``true_error``, which is relative to the mesh-converged solution of the case, and ``effectivity`` [-].
        """
        counts = {name: [getattr(round_, name) for round_ in self.rounds] for name in ("n_dofs", "n_cells")}
        values = [round_.values[self.quantity] for round_ in self.rounds]
        return structured({**counts, self.quantity: values, **self._errors()})

    def tables(self) -> list[tuple[str, Rows]]:
        """See `Report`."""
        return [(self.combination, self._rows())]

    def figure(self) -> Any:
        """Return a Matplotlib figure with the errors over degrees of freedom and the error of each cell of the last mesh."""
        heading = f"{self.title}: {self.combination}, refined for the {title(self.quantity)}"
        width, height = np.ptp(self.case.mesh.points, axis=0)
        width_of_map = float(np.clip(4.2 * width / height, 2.0, 8.0)) + 1.3  # with colour bar [inch]
        errors, mesh = panels(1, 2, (6.2 + width_of_map, 5.2), heading, widths=(6.2, width_of_map))[0]
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

    def _rows(self) -> Rows:
        """Return a header and a row for each mesh."""
        q, errors = self.quantity, self._errors()
        shown = {"estimated error": "estimate", "energy error": "energy_error"}
        if math.isfinite(errors["true_error"][-1]):
            shown |= {"true error": "true_error", "effectivity": "effectivity"}
        columns = [
            ("round", [str(k) for k in range(len(self.rounds))]),
            ("cells", [str(round_.n_cells) for round_ in self.rounds]),
            ("DOF", [str(round_.n_dofs) for round_ in self.rounds]),
            (column(q, q, self.units), [number(round_.values[q], 8) for round_ in self.rounds]),
        ]
        return by_columns(columns + [(label, [number(v, 2) for v in errors[name]]) for label, name in shown.items()])

    def sentences(self) -> list[str]:
        """See `Report`."""
        last, q = self.rounds[-1], self.quantity
        value = f"{title(q)} {last.values[q]:.8g} {unit(q, self.units)}".rstrip()
        verdict = "within" if self.reached else "NOT within"
        text = f"{self.combination}: {value}, estimated error {last.estimate:.1e}, {verdict} the {self.tolerance:g} requested"
        if not self.reached:
            text += ": the largest number of meshes or of degrees of freedom was reached; increase it (--max-dofs)"
        true = last.true_error(q)
        return [
            text + (f"; true error {true:.1e}, effectivity {self.effectivity():.2g}" if math.isfinite(true) else "")
        ]

    def _draw_errors(self, ax: Any) -> None:
        n_dofs, errors = [round_.n_dofs for round_ in self.rounds], self._errors()
        for name, style, label in (
            ("estimate", "o-", "estimated error"),
            ("true_error", "s-", "true error"),
            ("energy_error", "^-", "estimated error in the energy norm"),
        ):
            if np.isfinite(errors[name]).any():
                ax.plot(n_dofs, errors[name], style, ms=4, lw=1.0, label=label)
        ax.axhline(self.tolerance, color="black", ls="--", lw=1.0, label="requested")
        labels = ("degrees of freedom", "relative error [-]")
        frame(ax, f"Error of the {title(self.quantity)}", labels, scales=("plain log", "log"))

    def _draw_mesh(self, ax: Any) -> None:
        from matplotlib.collections import PolyCollection
        from matplotlib.colors import LogNorm

        mesh, cells = self.case.mesh, self.error.cells
        shapes = [polygon for name, block in mesh.solids.items() for polygon in outlines(name, mesh.points[block])]
        error = np.maximum(cells, 1e-6 * cells.max())
        drawn = PolyCollection(shapes, array=error, norm=LogNorm(), cmap="viridis", edgecolors="white", linewidths=0.1)
        ax.add_collection(drawn)
        ax.autoscale_view()
        ax.set_aspect("equal")
        bar = ax.figure.colorbar(drawn, ax=ax)
        bar.set_label("energy norm" + (f" [({work})$^{{1/2}}$]" if (work := self.units.get("moment")) else ""))
        labels = labelled("x", self.units, "length"), labelled("y", self.units, "length")
        frame(ax, f"Last mesh: {self.rounds[-1].n_cells} cells, estimated error", labels, grid=0.0)
