"""A finished adaptive study and its report: lines, table, dictionary, figure, page."""

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
from fastcontact.studies.error_estimate import ErrorEstimate
from fastcontact.studies.quantities import column, title, unit
from fastcontact.studies.render.figure import frame, panels
from fastcontact.studies.render.table import Rows, by_columns, number
from fastcontact.studies.report import Report


@dataclass(frozen=True, eq=False)
class Round:
    """One mesh of an adaptive study.

    Attributes
    ----------
    n_dofs, n_cells : int
    values, theory, reference : dict of str to float
        Value, theory at equal approach and mesh-converged solution of each quantity, in the units of the case.
    energy_error : float
        Estimated error of the whole solution in the energy norm, relative [-].
    estimate : float
        Estimated relative error of the quantity of interest [-]; NaN on the first two meshes.
    seconds : float
        Time of solution and estimate [s].
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
        """Return the relative difference from the mesh-converged solution of the case [-]; NaN without one."""
        exact = self.reference.get(quantity)
        return abs(self.values[quantity] / exact - 1.0) if exact else math.nan


@dataclass(frozen=True, eq=False, repr=False)
class AdaptiveStudy(Report):
    """A finished adaptive study; its case and units as in `Report`.

    Attributes
    ----------
    combination : str
        Element and formulation.
    quantity : str
    tolerance : float
        Target relative error [-].
    reached : bool
        Whether the estimate has reached the tolerance.
    rounds : list of Round
    case : Case
        The case on the last mesh.
    last : StepResult
        Solution on the last mesh.
    error : ErrorEstimate
        Error of each cell of the last mesh.
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
        """Return the effectivity index of a round, estimated over true error [-]; NaN without a reference."""
        round_ = self.rounds[number]
        true = round_.true_error(self.quantity)
        return round_.estimate / true if true > 0 else math.nan

    def as_dict(self) -> dict[str, Any]:
        """Return plain numbers, texts, lists and dictionaries, as ``--json`` writes them; errors are relative."""
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
        """Return a structured array (n_rounds,), one row a mesh, as ``--csv`` writes it.

        Fields are ``n_dofs``, ``n_cells``, the quantity in its unit, and ``energy_error``, ``estimate``,
        ``true_error`` (relative to the mesh-converged solution of the case) and ``effectivity`` [-].
        """
        counts = {name: [getattr(round_, name) for round_ in self.rounds] for name in ("n_dofs", "n_cells")}
        values = [round_.values[self.quantity] for round_ in self.rounds]
        return structured({**counts, self.quantity: values, **self._errors()})

    def tables(self) -> list[tuple[str, Rows]]:
        """See `Report`."""
        return [(self.combination, self._rows())]

    def figure(self) -> Any:
        """Return a matplotlib figure: errors over degrees of freedom, and the last mesh coloured by its error."""
        heading = f"{self.title}: {self.combination}, refined for the {title(self.quantity)}"
        width, height = np.ptp(self.case.mesh.points, axis=0)
        height_of_axes = float(np.clip(4.2 * width / height, 2.0, 8.0)) + 1.3  # [inch], the scale of colours included
        errors, mesh = panels(1, 2, (6.2 + height_of_axes, 5.2), heading, widths=(6.2, height_of_axes))[0]
        self._draw_errors(errors)
        self._draw_mesh(mesh)
        return mesh.figure

    def _errors(self) -> dict[str, list[float]]:
        """Return the errors of all rounds by name, each (n_rounds,)."""
        return {
            "energy_error": [round_.energy_error for round_ in self.rounds],
            "estimate": [round_.estimate for round_ in self.rounds],
            "true_error": [round_.true_error(self.quantity) for round_ in self.rounds],
            "effectivity": [self.effectivity(k) for k in range(len(self.rounds))],
        }

    def _rows(self) -> Rows:
        """Return header and one row a mesh."""
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
        text = f"{self.combination}: {value}, estimated error {last.estimate:.1e}, {verdict} the {self.tolerance:g} asked for"
        if not self.reached:
            text += ": the limit of meshes or degrees of freedom was reached; allow more (--max-dofs)"
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
        ax.axhline(self.tolerance, color="black", ls="--", lw=1.0, label="asked for")
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
