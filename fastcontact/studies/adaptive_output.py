"""An adaptive study as plain data for JSON, as a table for CSV, as text, as a picture and as one HTML page."""

from __future__ import annotations

import html
import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fastcontact.cases.summary import versions
from fastcontact.mesh import elements
from fastcontact.studies.adaptive import AdaptiveStudy
from fastcontact.studies.output import finite
from fastcontact.studies.pictures import new_figure
from fastcontact.studies.quantities import title, unit
from fastcontact.studies.report import image, page, table_html
from fastcontact.studies.text import aligned, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def as_dict(study: AdaptiveStudy) -> dict[str, Any]:
    """Return the study as ``--json`` writes it; errors are relative, ``true_error`` is against the case's reference."""
    q = study.quantity
    return {
        "case": study.name,
        "title": study.title,
        "units": dict(study.units),
        "combination": study.combination,
        "quantity": q,
        "tolerance": study.tolerance,
        "reached": study.reached,
        "value": study.rounds[-1].values[q],
        "rounds": [
            {
                "n_dofs": found.n_dofs,
                "n_cells": found.n_cells,
                **found.values,
                "energy_error": found.energy_error,
                "estimate": finite(found.estimate),
                "true_error": finite(found.true_error(q)),
                "effectivity": finite(study.effectivity(k)),
                "seconds": found.seconds,
            }
            for k, found in enumerate(study.rounds)
        ],
        "versions": versions(),
    }


def table(study: AdaptiveStudy) -> NDArray[Any]:
    """Return a structured array, one row a mesh: ``n_dofs``, ``n_cells``, the value and its errors (relative)."""
    rows = [
        (found.n_dofs, found.n_cells, found.values[study.quantity], found.energy_error, found.estimate,
         found.true_error(study.quantity), study.effectivity(k))
        for k, found in enumerate(study.rounds)
    ]  # fmt: skip
    names = ("energy_error", "estimate", "true_error", "effectivity")
    kinds = [("n_dofs", np.int64), ("n_cells", np.int64), (study.quantity, float), *((name, float) for name in names)]
    return np.array(rows, dtype=kinds)


def rows(study: AdaptiveStudy) -> list[list[str]]:
    """Return header and one row a mesh."""
    q = study.quantity
    known = math.isfinite(study.rounds[-1].true_error(q))
    header = ["round", "cells", "DOF", f"{q} [{unit(q, study.units) or '1'}]", "estimated error", "energy error"]
    found = [header + (["true error", "effectivity"] if known else [])]
    for k, this in enumerate(study.rounds):
        row = [str(k), str(this.n_cells), str(this.n_dofs), number(this.values[q], 8)]
        row += [number(this.estimate, 2), number(this.energy_error, 2)]
        row += [number(this.true_error(q), 2), number(study.effectivity(k), 2)] if known else []
        found.append(row)
    return found


def sentence(study: AdaptiveStudy) -> str:
    """Return what came of it."""
    last, q = study.rounds[-1], study.quantity
    what = f"{title(q)} {last.values[q]:.8g} {unit(q, study.units)}".rstrip()
    if study.reached:
        text = f"{study.combination}: {what}, estimated error {last.estimate:.1e}, within the {study.tolerance:g} asked for"
    else:
        text = (
            f"{study.combination}: {what}, estimated error {last.estimate:.1e}, NOT within the {study.tolerance:g} asked "
            "for: the limit of meshes or degrees of freedom was reached; allow more (--max-dofs)"
        )
    true = last.true_error(q)
    return text + (f"; true error {true:.1e}, effectivity {study.effectivity():.2g}" if math.isfinite(true) else "")


def lines(study: AdaptiveStudy) -> list[str]:
    """Return the lines that ``fastcontact converge --adaptive`` prints."""
    return [study.title, "", *aligned(rows(study)), "", sentence(study)]


def figure(study: AdaptiveStudy) -> Figure:
    """Return a figure: errors over degrees of freedom, and the last mesh coloured by its estimated error."""
    picture = new_figure(12.0, 5.2)
    left, right = picture.subplots(1, 2)
    _errors(study, left)
    _mesh(study, right)
    picture.suptitle(f"{study.title}: {study.combination}, refined for the {title(study.quantity)}")
    return picture


def _errors(study: AdaptiveStudy, ax: Axes) -> None:
    n = [found.n_dofs for found in study.rounds]
    curves = {
        "estimated error": [found.estimate for found in study.rounds],
        "true error": [found.true_error(study.quantity) for found in study.rounds],
        "estimated error in the energy norm": [found.energy_error for found in study.rounds],
    }
    for marker, (label, values) in zip("os^", curves.items(), strict=True):
        if np.isfinite(values).any():
            ax.plot(n, values, f"{marker}-", ms=4, lw=1.0, label=label)
    ax.axhline(study.tolerance, color="black", ls="--", lw=1.0, label="asked for")
    ax.set_xscale("log")
    ax.set_yscale("log")
    ax.set_xlabel("degrees of freedom")
    ax.set_ylabel("relative error")
    ax.set_title(f"Error of the {title(study.quantity)}")
    ax.grid(which="major", alpha=0.4)
    ax.legend(fontsize=8)


def _mesh(study: AdaptiveStudy, ax: Axes) -> None:
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import LogNorm

    mesh, length = study.case.mesh, study.units["length"]
    places = [p for name, block in mesh.solids.items() for p in mesh.points[block[:, : elements.get(name).n_corners]]]
    error = np.maximum(study.error.cells, 1e-6 * study.error.cells.max())
    drawn = PolyCollection(places, array=error, norm=LogNorm(), cmap="viridis", edgecolors="white", linewidths=0.1)
    ax.add_collection(drawn)
    ax.autoscale_view()
    ax.set_aspect("equal")
    ax.set_xlabel(f"x [{length}]")
    ax.set_ylabel(f"y [{length}]")
    ax.set_title(f"Last mesh: {study.rounds[-1].n_cells} cells, estimated error")
    bar = ax.figure.colorbar(drawn, ax=ax)
    bar.set_label(f"energy norm [({study.units['force']} {length})$^{{1/2}}$]")


def html_report(study: AdaptiveStudy) -> str:
    """Return the page."""
    parts = [f"<p class='say'>{html.escape(sentence(study))}.</p>"]
    parts.append(image(study.figure(), "errors over degrees of freedom, and the last mesh coloured by its error"))
    parts.append(table_html(rows(study)))
    if study.text:
        parts += ["<h2>The case</h2>", f"<pre>{html.escape(study.text)}</pre>"]
    made = ", ".join(f"{name} {version}" for name, version in versions().items())
    parts.append(f"<footer>Made with {html.escape(made)}.</footer>")
    return page(f"Adaptive meshes: {study.title}", parts)
