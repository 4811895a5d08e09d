"""Quantities for which sensitivities are available, and their gradients."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fastcontact.analysis.sensitivity.adjoint import Gradient
from fastcontact.analysis.sensitivity.moving_contact import CHANGED, MovingContact
from fastcontact.errors import ModelError, unknown
from fastcontact.model.model import Model
from fastcontact.results.step import StepResult

Array = NDArray[np.float64]
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
    if kind not in FORMS:
        raise ModelError(unknown("quantity", kind, FORMS))
    if len(quantity) != FORMS[kind].count(",") + 1:
        raise ModelError(f"the quantity {quantity} must have the form {FORMS[kind]}")
    if kind == "displacement":
        _point(model, quantity[1])
    elif kind == "reaction":
        model.mesh.points_of(str(quantity[1]))
    elif quantity[1] not in [pair.name for pair in model.contact]:
        raise ModelError(unknown("contact pair", str(quantity[1]), [pair.name for pair in model.contact]))
    if kind == "pressure":
        _point(model, quantity[2])
    if kind in ("displacement", "reaction", "contact_force"):
        _axis(model, quantity)


def with_gradient(contact: MovingContact, step: StepResult, quantity: Label) -> tuple[MovingContact, Gradient]:
    """Return the gradient of a quantity that `check_quantity` has accepted, and the contact whose samples it needs.

    Raises ModelError if the quantity has no sensitivities in this state.
    """
    none = Gradient(0.0, np.zeros(len(contact.u)), np.zeros(len(contact.active)))
    if quantity[0] == "displacement":
        model = contact.problem.model
        dof = _point(model, quantity[1]) * model.mesh.dim + _axis(model, quantity)
        none.displacement[dof] = 1.0
        return contact, replace(none, value=float(contact.u[dof]))
    if quantity[0] == "reaction":
        return contact, _reaction(contact, none, quantity)
    if quantity[0] == "contact_force":
        return contact, _contact_force(contact, none, step, quantity)
    return _pressure(contact, none, step, quantity)


def _axis(model: Model, quantity: Label) -> int:
    axes = "xyz"[: model.mesh.dim]
    if quantity[-1] not in list(axes):
        raise ModelError(unknown(f"component of the quantity {quantity}", str(quantity[-1]), list(axes)))
    return axes.index(str(quantity[-1]))


def _point(model: Model, point: str | int) -> int:
    """Return a point, given by its number or the name of a group of one point."""
    if isinstance(point, str):
        return int(model.mesh.point(point))
    if not 0 <= point < model.mesh.n_points:
        raise ModelError(f"point {point} is not in the mesh of {model.mesh.n_points} points (numbers from 0)")
    return point


def _reaction(contact: MovingContact, none: Gradient, quantity: Label) -> Gradient:
    model = contact.problem.model
    axis, points = _axis(model, quantity), model.mesh.points_of(str(quantity[1]))
    if model.springs:
        raise ModelError(
            "reactions of a model with springs have no sensitivities: request a displacement or a contact force"
        )
    whole = np.zeros(len(contact.u))
    whole[points * model.mesh.dim + axis] = 1.0
    balance = contact.problem.system.balance(whole)[0]
    if not balance.any():
        raise ModelError(f"no support acts along {quantity[-1]} on group '{quantity[1]}': its reaction is zero")
    force = contact.at(contact.u).force if contact.problem.pairs else 0.0
    out = contact.problem.system.K @ contact.u - contact.load.force - force
    return replace(none, value=float(balance @ out), reaction=balance)


def _contact_force(contact: MovingContact, none: Gradient, step: StepResult, quantity: Label) -> Gradient:
    contact_of_step, axis = step.contact[str(quantity[1])], _axis(contact.problem.model, quantity)
    others = [name for name in contact.problem.pairs if name != quantity[1]]
    nodes = np.setdiff1d(contact_of_step.points, contact_of_step.primary_points)
    for name in others:
        other_pair = contact.problem.pairs[name]
        shared = np.intersect1d(nodes, [*other_pair.secondary.points, *getattr(other_pair.primary, "points", ())])
        if len(shared):
            raise ModelError(
                f"point {shared[0]} carries forces of both contact '{quantity[1]}' and contact '{name}': the force of a "
                "single pair has no sensitivity here; use pairs that share no nodes"
            )
    dim, n = contact.problem.model.mesh.dim, len(contact.u)
    size = n + len(contact.active)
    sample = np.zeros(size)
    sample[nodes * dim + axis] = 1.0
    rows = contact.constraints.B[contact.active]
    return replace(none, value=float(contact_of_step.force[axis]), multiplier=rows @ sample[:n], sample=sample)


def _pressure(contact: MovingContact, none: Gradient, step: StepResult, asked: Label) -> tuple[MovingContact, Gradient]:
    name, result = str(asked[1]), step.contact[str(asked[1])]
    row = int(result.pressure.argmax())
    if asked[0] == "pressure":
        point = _point(contact.problem.model, asked[2])
        places = np.flatnonzero(result.points == point)
        if not len(places):
            raise ModelError(f"point {point} is not a node of the secondary side of contact '{name}'")
        row = int(places[0])
    if not result.active[row]:
        raise ModelError(f"point {result.points[row]} of contact '{name}' is open: its pressure is zero")
    if contact.problem.model.periodic_interfaces:
        raise ModelError(
            "pressures of periodic and cyclic models have no sensitivities: request a force or a displacement"
        )
    contact = replace(contact, pair=name, closed=result.active)
    multiplier, by_multiplier = contact.solution.multiplier, none.multiplier
    rows_of_pair, rows = contact.constraints.rows[name], contact.active
    change = CHANGED * (float(np.abs(multiplier[rows_of_pair]).max(initial=0.0)) or 1.0)
    base = contact.pressure(multiplier)[row]
    for k in np.flatnonzero((rows >= rows_of_pair.start) & (rows < rows_of_pair.stop)):
        more = multiplier.copy()
        more[rows[k]] += change
        by_multiplier[k] = (contact.pressure(more)[row] - base) / change
    sample = np.zeros(len(contact.u) + len(rows) + len(result.points))
    sample[len(contact.u) + len(rows) + row] = 1.0
    return contact, replace(none, value=float(base), sample=sample)
