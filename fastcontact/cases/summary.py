"""Summary of a run as a dictionary, which ``--json`` writes, and as lines of text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fastcontact._tools.versions import versions
from fastcontact.analysis.resultants import contact_resultants
from fastcontact.cases.case import Case, Label
from fastcontact.cases.checks import contact_at_point, default_target, outcome
from fastcontact.errors import ModelError
from fastcontact.mesh.mesh import vector_text
from fastcontact.model.rigid_motions import grouped_by_body
from fastcontact.results.step import ContactResult, StepResult, force_text
from fastcontact.results.units import units_of_results, value_text, with_unit

if TYPE_CHECKING:
    from fastcontact.analysis.modal.shapes import Modes

# Contact resultants included in a summary.
RESULTANTS = ("normal_force", "moment", "area", "centre", "mean_gap", "pressure_mean")
# Quantities of a contact that are compared with its theory, if the theory defines all of them.
COMPARED = ("force", "pressure_max", "radius")


def summarise(
    case: Case,
    last: StepResult,
    steps: Sequence[Mapping[str, Any]],
    timings: Mapping[str, float],
    warnings: Sequence[str],
    modes: Modes | None = None,
) -> dict[str, Any]:
    """Return the summary of a run, which contains only numbers, strings, lists and dictionaries, as JSON requires.

    `last` is the last step. `steps` contains the `step_entry` of each step. `modes` contains the vibration modes at the last
    step if the case requests them.
    """
    mesh = case.mesh
    peak = int(np.argmax(last.von_mises))
    penalties = {pair.name: pair.options.get("penalty") for pair in case.model.contact}
    return {
        "case": case.name,
        "title": case.title,
        "units": units_of_results(case.units, case.model.kinematics),
        "mesh": {"n_points": mesh.n_points, "n_cells": mesh.n_cells},
        "n_dofs": case.model.n_dofs,
        "steps": list(steps),
        "contact": {
            name: {**_contact(contact, penalties.get(name)), **_resultants(case, last, name, steps)}
            for name, contact in last.contact.items()
        },
        "probes": {name: _probe(last, point) for name, point in case.probes.items()},
        "von_mises_max": {"value": float(last.von_mises[peak]), "at": mesh.points[peak].tolist()},
        **({"cell_fields": {k: _bounds(values) for k, values in last.cell_fields.items()}} if last.cell_fields else {}),
        **({} if last.temperature is None else {"heat": _heat(last)}),
        "theory": {
            pair: _theory_deviations(last.contact[pair], case.approach.get(pair), **comparison)
            for pair, comparison in case.theories.items()
            if pair in last.contact and all(hasattr(comparison["theory"], name) for name in COMPARED)
        },
        "sensitivities": [_sensitivity(case, last, *sensitivity) for sensitivity in case.sensitivities],
        "regularised": last.iterations.get("regularised"),
        **({} if modes is None else {"modes": _modes(modes)}),
        "checks": [outcome(check, last, case.probes, case.theories) for check in case.checks],
        "timings": dict(timings),
        "versions": versions(),
        "warnings": list(warnings),
    }


def _sensitivity(case: Case, last: StepResult, quantity: Label, by: Sequence[Label]) -> dict[str, Any]:
    """Return the derivatives of a quantity, or the message of the error if they are undefined."""
    from fastcontact.analysis.sensitivities import sensitivities

    try:
        options: dict[str, Any] = {"ramp": case.ramp, "criteria": case.criteria, "linear_solver": case.linear_solver}
        result = sensitivities(case.model, last, quantity, by, **options)
    except ModelError as error:
        return {"quantity": list(quantity), "refused": str(error)}
    derivatives = [{"by": list(parameter), "value": value} for parameter, value in result.derivatives.items()]
    return {"quantity": list(quantity), "value": result.value, "margin": result.margin, "derivatives": derivatives}


def _heat(last: StepResult) -> dict[str, Any]:
    """Return the heat flows of a step [power] and the bounds of its temperature."""
    assert last.heat_reaction is not None
    inflow = float(np.maximum(last.heat_reaction, 0.0).sum())
    return {**last.heat, "entering": inflow, "temperature": _bounds(last.temperature)}


def _modes(modes: Modes) -> dict[str, Any]:
    """Return the natural frequencies and effective masses, and for cyclic sectors the nodal diameters and mode pairs."""
    names = ("frequencies", "effective_mass", "nodal_diameters", "twins")
    return {name: values.tolist() for name in names if (values := getattr(modes, name)) is not None}


def step_entry(step: StepResult) -> dict[str, Any]:
    """Return the entry of a step in the summary: load factor, numbers of iterations, work [energy] and pretension."""
    counts = ("geometry_updates", "active_set_iterations", "linear_iterations")
    summary = {"load_factor": step.load_factor, **{name: step.iterations[name] for name in counts}}
    optional = {
        "substeps": step.iterations.get("substeps"),
        "dissipation": {name: contact.dissipation for name, contact in step.contact.items() if contact.dissipation},
        **{name: getattr(step, name) for name in ("work", "pretension")},
    }
    return summary | {name: values for name, values in optional.items() if values}


def _contact(contact: ContactResult, penalty: float | None) -> dict[str, Any]:
    """Return the summary of a contact pair in the last step from its `ContactResult`, with the `penalty` of the pair."""
    displacement = contact.obstacle_displacement
    return {
        **{
            name: getattr(contact, name)
            for name in ("formulation", "force_parts", "extent", "pressure_max", "penetration")
        },
        "force": float(np.linalg.norm(contact.force)),
        "force_vector": contact.force.tolist(),
        "radius": _json_value(contact.radius),
        "middle": contact.middle.tolist(),
        "closed_nodes": int(contact.active.sum()),
        "obstacle_displacement": None if displacement is None else displacement.tolist(),
        **({} if contact.torque is None else {"obstacle_angle": contact.obstacle_angle, "torque": contact.torque}),
        **({"fluid_force": float(np.linalg.norm(contact.fluid_force))} if contact.fluid_force.any() else {}),
        **({} if contact.wear is None else {"wear_max": float(contact.wear.max(initial=0.0))}),
        "penalty": penalty,
    }


def _resultants(case: Case, last: StepResult, pair: str, steps: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the contact resultants of a pair in the last step, and its frictional work in all `steps` [energy]."""
    (resultants,) = contact_resultants(case.model, [last], pair)
    friction_work = sum(step.get("dissipation", {}).get(pair, 0.0) for step in steps)
    return {**{name: _json_value(getattr(resultants, name)) for name in RESULTANTS}, "friction_work": friction_work}


def _json_value(value: Any) -> Any:
    """Return a number or the list of the numbers of an array, with None in place of NaN and infinity."""
    return [finite_or_none(member) for member in value] if np.ndim(value) else finite_or_none(value)


def finite_or_none(value: float) -> float | None:
    """Return a finite number unchanged, and None for NaN and infinity, which JSON cannot represent."""
    return float(value) if np.isfinite(value) else None


def _bounds(values: Any) -> list[float]:
    """Return the smallest and the largest of some values."""
    return [float(values.min()), float(values.max())]


def _probe(step: StepResult, point: int) -> dict[str, Any]:
    """Return the results at a probe; stresses by material are included only on interfaces between materials."""
    contact, row = contact_at_point(step, point) or (None, 0)
    by_material = step.material_stress.at(point) if step.material_stress is not None else {}
    material_stresses = {str(number): stress.tolist() for number, stress in by_material.items()}
    return {
        "stress": step.stress[point].tolist(),
        "displacement": step.displacement[point].tolist(),
        "von_mises": float(step.von_mises[point]),
        "pressure": float(contact.pressure[row]) if contact else None,
        **({"stress_by_material": material_stresses} if material_stresses else {}),
    }


def _theory_deviations(
    contact: ContactResult, approach: float | None, theory: Any, mesh_converged: Any = None, share: float = 1.0
) -> dict[str, Any]:
    """Return the deviations of a contact from its theory at equal approach and at equal force, and from `mesh_converged`.

    `share` is the modelled fraction of the theory's contact.
    """
    force = contact.force_against_theory(share) / share
    computed = {"force": force, "pressure_max": contact.pressure_max, "radius": 0.5 * sum(contact.radius)}
    deviations = {"equal_approach": {"approach": approach, **_deviations(computed, theory)}}
    if force > 0 and hasattr(theory, "at_force"):
        deviations["equal_force"] = _deviations(computed, theory.at_force(force))
    if mesh_converged is not None:
        deviations["mesh_converged"] = _deviations(computed, mesh_converged)
    return deviations


def _deviations(computed: Mapping[str, float], theory: Any) -> dict[str, Any]:
    """Return the quantities of a theory, and the relative deviations [-] of the computed ones; None if they are undefined."""
    targets = {name: getattr(theory, default_target(name, theory)) for name in COMPARED}
    exact = {name: finite_or_none(value) for name, value in targets.items()}  # the pressure under a tip is unbounded
    deviation = {name: finite_or_none(computed[name] / value - 1.0) if value else None for name, value in exact.items()}
    return {**exact, "deviation": deviation}


def lines(summary: Mapping[str, Any]) -> list[str]:
    """Return the summary as lines of text."""
    units = summary["units"]
    steps = summary["steps"]
    texts = [
        f"{summary['title']}",
        f"  {summary['mesh']['n_points']} points, {summary['n_dofs']} degrees of freedom, {count(len(steps), 'load step')}, "
        f"{sum(s['active_set_iterations'] for s in steps)} active-set iterations, "
        f"{sum(s['geometry_updates'] for s in steps)} geometry updates",
    ]
    if substeps := [len(s["substeps"]) for s in steps if "substeps" in s]:
        steps_text = count(len(substeps), "load step")
        texts.append(f"  {steps_text} did not converge as a whole, and took {sum(substeps)} substeps instead")
    peak = summary["von_mises_max"]
    loaded = peak["value"] > 0.0 or "heat" not in summary  # heat conduction alone has no forces
    for name, contact in summary["contact"].items() if loaded else ():
        texts += _contact_lines(name, contact, units)
    for name, section in steps[-1].get("pretension", {}).items():
        force = value_text(section["force"], units, "force", 6)
        shortening = value_text(section["shortening"], units, "length", 6)
        texts.append(f"  pretension '{name}': force {force}, shortened by {shortening}")
    if loaded:
        stress = value_text(peak["value"], units, "pressure", 6)
        texts.append(f"  largest von Mises stress {stress} at {with_unit(vector_text(peak['at'], 4), units, 'length')}")
    for name, (low, high) in summary.get("cell_fields", {}).items():
        texts.append(f"  {name.replace('_', ' ')} of cells from {low:.4g} to {high:.4g}")
    if heat := summary.get("heat"):
        powers = ", ".join(f"{name} {heat[name]:.4g}" for name in ("loads", "films", "friction"))
        supports = f"prescribed temperatures {heat['entering']:.6g} in, {heat['entering'] - heat['supports']:.6g} out"
        contacts = "".join(f"; across '{name}' {power:.6g}" for name, power in heat["contacts"].items())
        temperatures = "temperatures from {:.6g} to {:.6g}".format(*heat["temperature"])
        texts.append(f"  {temperatures}; heat into the bodies by {supports}, {powers}{contacts}")
    if report := summary["regularised"]:
        texts.append(
            f"  held by contact alone: {grouped_by_body(report['motions'])}. Regularised by springs of "
            f"{value_text(report['spring_stiffness'], units, 'stiffness', 3)}, which carry {report['relative_to_load']:.1e} "
            "of the load at the end"
        )
    for name, theory in summary["theory"].items():
        texts += _theory_lines(name, theory, summary["contact"][name])
    texts += map(_sensitivity_line, summary["sensitivities"])
    if "modes" in summary:
        texts += _mode_lines(summary["modes"])
    for check in summary["checks"]:
        texts += _check_lines(check, units)
    return texts


def _mode_lines(table: Mapping[str, Any]) -> Iterator[str]:
    """Yield a line of natural frequencies for each number of nodal diameters, in which a pair of modes is listed once."""
    frequencies = table["frequencies"]
    diameters = table.get("nodal_diameters", [None] * len(frequencies))
    twins = table.get("twins", range(len(frequencies)))
    for d in dict.fromkeys(diameters):
        modes = [k for k, diameter in enumerate(diameters) if diameter == d and k <= twins[k]]
        values = ", ".join(f"{frequencies[k]:.6g}" for k in modes)
        pairs = ", each of two modes" if any(twins[k] > k for k in modes) else ""
        family = "" if d is None else f", {count(d, 'nodal diameter')}{pairs}"
        yield f"  natural frequencies [cycles per unit of time] at the last step{family}: {values}"


def count(number: int, noun: str) -> str:
    """Return a number and its noun in the singular or the plural: "1 load step", "2 load steps"."""
    return f"{number} {noun}" + "s" * (number != 1)


def _contact_lines(name: str, contact: Mapping[str, Any], units: Mapping[str, str]) -> Iterator[str]:
    """Yield the lines of a contact pair or a rigid obstacle."""
    lower, upper = contact["radius"]
    forces = (contact["force_vector"], contact["force_parts"], contact["normal_force"])
    force = force_text(*forces, units, contact.get("fluid_force", 0.0))
    yield (
        f"  contact '{name}' ({contact['formulation'].replace('_', '-')}): force {force}, largest pressure "
        f"{value_text(contact['pressure_max'], units, 'pressure', 6)}, {_extent_text(contact['extent'], lower, upper, units)}"
    )
    if any(contact["obstacle_displacement"] or ()):
        displacement = with_unit(vector_text(contact["obstacle_displacement"]), units, "length")
        yield f"  obstacle '{name}' is displaced by {displacement}"
    if "torque" in contact:
        torque = value_text(contact["torque"], units, "moment", 6)
        yield f"  obstacle '{name}' has turned by {contact['obstacle_angle']:.6g} rad, with a torque of {torque}"
    if "wear_max" in contact:
        yield f"  contact '{name}' is worn by up to {value_text(contact['wear_max'], units, 'length')}"
    if contact["penalty"] is not None:
        penalty, law = contact["penalty"], "pressure-overclosure law"
        if isinstance(penalty, float):
            law = f"penalty of {value_text(penalty, units, 'penalty')}"
        depth = value_text(contact["penetration"], units, "length")
        yield f"  contact '{name}' penetrates by up to {depth}, with a {law}"


def _extent_text(extent: str, lower: float | None, upper: float | None, units: Mapping[str, str]) -> str:
    """Return the bounds [length] of the radius or the half-width of a contact as text; `extent` states which.

    The lower bound is None in an open contact, the upper bound if the contact reaches the end of the surface.
    """
    if lower is None:
        return "open"
    if upper is None:
        return f"{extent} {value_text(lower, units, 'length')}, to the end of the surface"
    return f"{extent} {lower:.4g} to {value_text(upper, units, 'length')}"


def _theory_lines(pair: str, theory: Mapping[str, Any], contact: Mapping[str, Any]) -> Iterator[str]:
    """Yield the lines of the deviations of a contact pair from its theory; those of the radius are of its two bounds."""
    titles = {
        "equal_approach": "theory at equal approach",
        "equal_force": "theory at equal force",
        "mesh_converged": "mesh-converged solution",
    }
    if theory["equal_approach"]["approach"] is None:
        titles["equal_approach"] = "the given theory"
    formats = {"force": "force {:+.3%}", "pressure_max": "largest pressure {:+.3%}"}
    formats["radius"] = contact["extent"] + " {:+.2%} to {:+.2%}"
    for key, values in theory.items():
        deviations = {name: [x] for name, x in values["deviation"].items() if x is not None}
        if "radius" in deviations:
            deviations["radius"] = [bound / values["radius"] - 1.0 for bound in contact["radius"]]
        texts = ", ".join(formats[name].format(*x) for name, x in deviations.items())
        yield f"  contact '{pair}' against {titles[key]}: {texts}"


def _sensitivity_line(report: Mapping[str, Any]) -> str:
    """Return the line of a sensitivity: its quantity and derivatives, or the reason why they are undefined."""
    quantity = " ".join(map(str, report["quantity"]))
    if "refused" in report:
        return f"  no sensitivities of {quantity}: {report['refused']}"
    by = ((d["value"], " ".join(map(str, d["by"]))) for d in report["derivatives"])
    derivatives = ", ".join(f"{value:.6g} with respect to {parameter}" for value, parameter in by)
    return f"  sensitivities of {quantity} (value {report['value']:.6g}): {derivatives}"


def _check_lines(check: Mapping[str, Any], units: Mapping[str, str]) -> Iterator[str]:
    """Yield the result of a check, and an explanation if the theory rather than the mesh causes its failure."""
    verdict = "within" if check["passed"] else "NOT within"
    origin = "the theory's" if check["of"] else "the documented"
    value = value_text(check["value"], units, check["unit"], 6)
    text = (
        f"  check {check['name']}: {value} is {abs(check['deviation']):.3%} from {origin} "
        f"{check['target']:.6g}, {verdict} {check['tolerance']:.3g}"
    )
    model_error = check["mesh_converged_deviation"]
    if model_error is None:
        yield text
        return
    distance = f"{check['distance_to_mesh_converged']:+.3%} from the mesh-converged value"
    yield f"{text}; {distance}, which itself is {model_error:+.3%} from the theory"
    if not check["passed"] and abs(model_error) > check["tolerance"]:
        yield (
            "    reason: the theory is not exact for these bodies: on finer meshes the deviation tends to "
            f"{model_error:+.3%}, more than the {check['tolerance']:.3g} that this check requires"
        )
