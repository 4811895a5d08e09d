"""A run in numbers: the dictionary behind ``--json``, and the lines a person reads."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from importlib import metadata
from typing import Any

import numpy as np

import fastcontact
from fastcontact.case import Case, Check
from fastcontact.results import ContactResult, StepResult

_STRESS = {"xx": 0, "yy": 1, "zz": 2, "xy": 3}


def versions() -> dict[str, str]:
    """Return the versions of fastcontact, Python and the libraries it stands on."""
    libraries = ("numpy", "scipy", "numba", "pyamg", "meshio", "h5py")
    found = {"fastcontact": fastcontact.__version__, "python": platform.python_version()}
    return {**found, **{name: metadata.version(name) for name in libraries}}


def summarise(
    case: Case, steps: Sequence[StepResult], timings: Mapping[str, float], warnings: Sequence[str]
) -> dict[str, Any]:
    """Return the summary of a run, with the state of its last step; plain numbers, strings, lists and dictionaries."""
    mesh, last = case.mesh, steps[-1]
    top = int(np.argmax(last.von_mises))
    return {
        "case": case.name,
        "title": case.title,
        "units": dict(case.units),
        "mesh": {"n_points": mesh.n_points, "n_cells": mesh.n_cells},
        "n_dofs": case.model.n_dofs,
        "steps": [_step(step) for step in steps],
        "contact": {name: _contact(contact) for name, contact in last.contact.items()},
        "probes": {name: _probe(last, point) for name, point in case.probes.items()},
        "von_mises_max": {"value": float(last.von_mises[top]), "at": mesh.points[top].tolist()},
        "theory": {
            pair: _against_theory(last.contact[pair], **theories)
            for pair, theories in case.theories.items()
            if pair in last.contact
        },
        "regularised": last.iterations.get("regularised"),
        "checks": [_checked(case, check, last) for check in case.checks],
        "timings": dict(timings),
        "versions": versions(),
        "warnings": list(warnings),
    }


def _step(step: StepResult) -> dict[str, Any]:
    counts = ("geometry_updates", "active_set_iterations", "linear_iterations")
    return {"load_factor": step.load_factor, **{name: step.iterations[name] for name in counts}}


def _contact(contact: ContactResult) -> dict[str, Any]:
    return {
        "formulation": contact.formulation,
        "force": float(np.linalg.norm(contact.force)),
        "force_vector": contact.force.tolist(),
        "radius": [_finite(value) for value in contact.radius],
        "pressure_max": contact.pressure_max,
        "closed_nodes": int(contact.active.sum()),
    }


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _probe(step: StepResult, point: int) -> dict[str, Any]:
    pressure = None
    for contact in step.contact.values():
        at = np.flatnonzero(contact.points == point)
        if len(at):
            pressure = float(contact.pressure[at[0]])
    return {
        "stress": step.stress[point].tolist(),
        "displacement": step.displacement[point].tolist(),
        "von_mises": float(step.von_mises[point]),
        "pressure": pressure,
    }


def _against_theory(contact: ContactResult, theory: Any, mesh_converged: Any = None) -> dict[str, Any]:
    """Compare a contact with its theory at the theory's own load and at the computed force."""
    force = float(np.linalg.norm(contact.force))
    computed = {"force": force, "pressure_max": contact.pressure_max, "radius": list(contact.radius)}
    compared = {"equal_approach": _deviations(computed, theory)}
    if force > 0:
        compared["equal_force"] = _deviations(computed, theory.at_force(force))
    if mesh_converged is not None:
        compared["mesh_converged"] = _deviations(computed, mesh_converged)
    return compared


def _deviations(computed: Mapping[str, Any], theory: Any) -> dict[str, Any]:
    """Return the theory's numbers, and how far the computed ones lie from them, relative to them."""
    inside, outside = computed["radius"]
    middle = 0.5 * (inside + outside)
    return {
        "force": theory.force,
        "pressure_max": theory.pressure_max,
        "radius": theory.radius,
        "deviation": {
            "force": computed["force"] / theory.force - 1.0,
            "pressure_max": computed["pressure_max"] / theory.pressure_max - 1.0,
            "radius": _finite(middle / theory.radius - 1.0),
        },
    }


def _checked(case: Case, check: Check, last: StepResult) -> dict[str, Any]:
    """Compare one probe with the theory's greatest pressure, and with that of the mesh-converged solution."""
    probe, _, what = check.quantity.partition(".")
    values = _probe(last, case.probes[probe])
    compression = values["pressure"] if what == "pressure" else -values["stress"][_STRESS[what.partition(".")[2]]]
    theories = case.theories[check.theory]
    target = theories["theory"].pressure_max
    value = float("nan") if compression is None else compression
    converged = theories.get("mesh_converged")
    return {
        "name": check.name,
        "quantity": check.quantity,
        "value": value if what == "pressure" else -value,
        "target": target if what == "pressure" else -target,
        "deviation": value / target - 1.0,
        "tolerance": check.tolerance,
        "passed": bool(abs(value / target - 1.0) <= check.tolerance),
        "distance_to_mesh_converged": value / converged.pressure_max - 1.0 if converged is not None else None,
        "mesh_converged_deviation": converged.pressure_max / target - 1.0 if converged is not None else None,
    }


def lines(summary: Mapping[str, Any]) -> list[str]:
    """Return the summary as lines for a person: contact, maximum of von Mises, theory, checks."""
    unit = summary["units"]
    steps = summary["steps"]
    found = [
        f"{summary['title']}",
        f"  {summary['mesh']['n_points']} points, {summary['n_dofs']} degrees of freedom, {len(steps)} load steps, "
        f"{sum(s['active_set_iterations'] for s in steps)} active-set iterations, "
        f"{sum(s['geometry_updates'] for s in steps)} geometry updates",
    ]
    for name, contact in summary["contact"].items():
        inside, outside = contact["radius"]
        edge = f"radius {inside:.4g} to {outside:.4g} {unit['length']}" if inside and outside else "open"
        found.append(
            f"  contact '{name}' ({contact['formulation'].replace('_', '-')}): force {contact['force']:.6g} "
            f"{unit['force']}, largest pressure {contact['pressure_max']:.6g} {unit['pressure']}, {edge}"
        )
    top = summary["von_mises_max"]
    where = ", ".join(f"{x:.4g}" for x in top["at"])
    found.append(f"  largest von Mises stress {top['value']:.6g} {unit['pressure']} at ({where}) {unit['length']}")
    if summary["regularised"]:
        found.append(_regularised_line(summary["regularised"], unit))
    for name, theory in summary["theory"].items():
        found.extend(_theory_lines(name, theory))
    for check in summary["checks"]:
        found.append(_check_line(check, unit["pressure"]))
    return found


def _regularised_line(told: Mapping[str, Any], unit: Mapping[str, str]) -> str:
    return (
        f"  held by contact alone: {'; '.join(told['motions'])}. Regularised by springs of "
        f"{told['spring_stiffness']:.3g} {unit['force']}/{unit['length']}, which carry {told['relative_to_load']:.1e} "
        "of the load in the end"
    )


def _theory_lines(pair: str, theory: Mapping[str, Any]) -> list[str]:
    titles = {
        "equal_approach": "theory at equal approach",
        "equal_force": "theory at equal force",
        "mesh_converged": "mesh-converged solution",
    }
    return [
        f"  contact '{pair}' against {titles[key]}: force {values['deviation']['force']:+.3%}, "
        f"largest pressure {values['deviation']['pressure_max']:+.3%}"
        + (f", radius {values['deviation']['radius']:+.2%}" if values["deviation"]["radius"] is not None else "")
        for key, values in theory.items()
    ]


def _check_line(check: Mapping[str, Any], unit: str) -> str:
    verdict = "within" if check["passed"] else "NOT within"
    text = (
        f"  check {check['name']}: {check['value']:.6g} {unit} is {abs(check['deviation']):.3%} from the theory's "
        f"{check['target']:.6g}, {verdict} {check['tolerance']:.3g}"
    )
    if check["distance_to_mesh_converged"] is not None:
        text += (
            f"; {check['distance_to_mesh_converged']:+.3%} from the mesh-converged value, which itself is "
            f"{check['mesh_converged_deviation']:+.3%} from the theory"
        )
    return text
