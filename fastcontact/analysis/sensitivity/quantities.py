"""Quantities for which sensitivities are available, and their gradients."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fastcontact.analysis.sensitivity.adjoint import Gradient
from fastcontact.analysis.sensitivity.moving_contact import INCREMENT, MovingContact
from fastcontact.arrays import scattered
from fastcontact.errors import ModelError, check_known
from fastcontact.model.model import Model
from fastcontact.results.step import StepResult

Label = tuple[str | int, ...]
FORMS = {
    "displacement": '("displacement", point, "y")',
    "reaction": '("reaction", group, "y")',
    "contact_force": '("contact_force", pair, "y")',
    "pressure": '("pressure", pair, point)',
    "pressure_max": '("pressure_max", pair)',
}


def check_quantity(model: Model, quantity: Label) -> None:
    """Raise ModelError or MeshError if there is no such quantity of a model."""
    kind = str(quantity[0]) if quantity else ""
    check_known("quantity", kind, FORMS, ModelError)
    if len(quantity) != FORMS[kind].count(",") + 1:
        raise ModelError(f"the quantity {quantity} must have the form {FORMS[kind]}")
    if kind == "displacement":
        _point(model, quantity[1])
    elif kind == "reaction":
        model.mesh.points_of(str(quantity[1]))
    else:
        check_known("contact pair", quantity[1], [pair.name for pair in model.contact], ModelError)
    if kind == "pressure":
        _point(model, quantity[2])
    if kind in ("displacement", "reaction", "contact_force"):
        _axis(model, quantity)


def with_gradient(contact: MovingContact, step: StepResult, quantity: Label) -> tuple[MovingContact, Gradient]:
    """Return the contact, whose sample contains pressures if the quantity is a pressure, and the gradient of the quantity.

    `check_quantity` must have accepted the quantity. Raises ModelError if it has no sensitivities in this state.
    """
    zero = Gradient(0.0, np.zeros(len(contact.u)), np.zeros(len(contact.active)))
    if quantity[0] == "displacement":
        model = contact.problem.model
        dof = _point(model, quantity[1]) * model.mesh.dim + _axis(model, quantity)
        zero.displacement[dof] = 1.0
        return contact, replace(zero, value=float(contact.u[dof]))
    if quantity[0] == "reaction":
        return contact, _reaction(contact, zero, quantity)
    if quantity[0] == "contact_force":
        return contact, _contact_force(contact, zero, step, quantity)
    return _pressure(contact, zero, step, quantity)


def _axis(model: Model, quantity: Label) -> int:
    axes = list("xyz"[: model.mesh.dim])
    check_known(f"component of the quantity {quantity}", quantity[-1], axes, ModelError)
    return axes.index(str(quantity[-1]))


def _point(model: Model, point: str | int) -> int:
    """Return the number of a point, which is given by this number or by the name of a group of one point."""
    if isinstance(point, str):
        return int(model.mesh.point(point))
    if not 0 <= point < model.mesh.n_points:
        raise ModelError(f"point {point} is not in the mesh of {model.mesh.n_points} points (numbered from 0)")
    return point


def _reaction(contact: MovingContact, zero: Gradient, quantity: Label) -> Gradient:
    model = contact.problem.model
    axis, points = _axis(model, quantity), model.mesh.points_of(str(quantity[1]))
    if model.springs:
        raise ModelError("reactions of a model with springs have no sensitivities: use displacements or contact forces")
    unit_displacement = scattered(1.0, points * model.mesh.dim + axis, len(contact.u))
    balance = contact.problem.system.balance(unit_displacement)[0]
    if not balance.any():
        raise ModelError(f"no support acts along {quantity[-1]} on group '{quantity[1]}': its reaction is zero")
    force = contact.sample[: len(contact.u)] if contact.problem.pairs else 0.0
    residual = contact.problem.system.K @ contact.u - contact.load.force - force
    return replace(zero, value=float(balance @ residual), reaction=balance)


def _contact_force(contact: MovingContact, zero: Gradient, step: StepResult, quantity: Label) -> Gradient:
    contact_of_step, axis = step.contact[str(quantity[1])], _axis(contact.problem.model, quantity)
    nodes = np.setdiff1d(contact_of_step.points, contact_of_step.primary_points)
    for name, other_pair in contact.problem.pairs.items():
        shared = np.intersect1d(nodes, [*other_pair.secondary.points, *other_pair.primary.points])
        if name != quantity[1] and len(shared):
            raise ModelError(
                f"point {shared[0]} carries forces of both contact '{quantity[1]}' and contact '{name}': the force of a "
                "single pair has no sensitivity here; use pairs that share no nodes"
            )
    dim, n = contact.problem.model.mesh.dim, len(contact.u)
    sample = scattered(1.0, nodes * dim + axis, n + len(contact.active))
    rows = contact.constraints.B[contact.active]
    return replace(zero, value=float(contact_of_step.force[axis]), multiplier=rows @ sample[:n], sample=sample)


def _pressure(
    contact: MovingContact, zero: Gradient, step: StepResult, quantity: Label
) -> tuple[MovingContact, Gradient]:
    name, result = str(quantity[1]), step.contact[str(quantity[1])]
    row = int(result.pressure.argmax())
    if quantity[0] == "pressure":
        point = _point(contact.problem.model, quantity[2])
        rows_of_point = np.flatnonzero(result.points == point)
        if not len(rows_of_point):
            raise ModelError(f"point {point} is not a node of the secondary side of contact '{name}'")
        row = int(rows_of_point[0])
    if not result.active[row]:
        raise ModelError(f"point {result.points[row]} of contact '{name}' is open: its pressure is zero")
    if contact.problem.model.periodic_interfaces:
        raise ModelError("pressures of periodic and cyclic models have no sensitivities: use forces or displacements")
    contact = replace(contact, pair=name, closed=result.active)
    multiplier, multiplier_gradient = contact.solution.multiplier, zero.multiplier
    rows_of_pair, rows = contact.constraints.rows[name], contact.active
    change = INCREMENT * (float(np.abs(multiplier[rows_of_pair]).max(initial=0.0)) or 1.0)
    pressure = contact.pressure(multiplier)[row]
    for k in np.flatnonzero((rows >= rows_of_pair.start) & (rows < rows_of_pair.stop)):
        increased = multiplier.copy()
        increased[rows[k]] += change
        multiplier_gradient[k] = (contact.pressure(increased)[row] - pressure) / change
    first = len(contact.u) + len(rows)
    sample = scattered(1.0, np.array([first + row]), first + len(result.points))
    return contact, replace(zero, value=float(pressure), sample=sample)
