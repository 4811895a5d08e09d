"""The quantities that have sensitivities, and their gradients."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fastcontact.analysis.sensitivity.adjoint import Gradient
from fastcontact.analysis.sensitivity.moving_contact import MovingContact
from fastcontact.errors import ModelError, unknown
from fastcontact.results.step import StepResult

Array = NDArray[np.float64]
Asked = tuple[str | int, ...]
FORMS = {
    "displacement": '("displacement", point, "y")',
    "reaction": '("reaction", group, "y")',
    "contact_force": '("contact_force", pair, "y")',
    "pressure": '("pressure", pair, point)',
    "pressure_max": '("pressure_max", pair)',
}


def with_gradient(contact: MovingContact, step: StepResult, asked: Asked) -> tuple[MovingContact, Gradient]:
    """Return the gradient of a quantity, and the contact whose samples hold what it needs.

    ModelError if there is no such quantity.
    """
    kind = str(asked[0]) if asked else ""
    if kind not in FORMS:
        raise ModelError(unknown("quantity", kind, FORMS))
    if len(asked) != FORMS[kind].count(",") + 1:
        raise ModelError(f"the quantity {asked} must have the form {FORMS[kind]}")
    none = Gradient(0.0, np.zeros(len(contact.u)), np.zeros(len(contact.active)))
    if kind == "displacement":
        dof = _dof(contact, asked)
        none.displacement[dof] = 1.0
        return contact, replace(none, value=float(contact.u[dof]))
    if kind == "reaction":
        return contact, _reaction(contact, none, asked)
    name = str(asked[1])
    if name not in contact.problem.pairs:
        raise ModelError(unknown("contact pair", name, list(contact.problem.pairs)))
    if kind == "contact_force":
        return contact, _contact_force(contact, none, step, asked)
    return _pressure(contact, none, step, asked)


def _axis(contact: MovingContact, asked: Asked) -> int:
    axes = "xyz"[: contact.problem.model.mesh.dim]
    if asked[-1] not in list(axes):
        raise ModelError(unknown(f"component of the quantity {asked}", str(asked[-1]), list(axes)))
    return axes.index(str(asked[-1]))


def _dof(contact: MovingContact, asked: Asked) -> int:
    mesh = contact.problem.model.mesh
    if not (isinstance(asked[1], int) and 0 <= asked[1] < mesh.n_points):
        raise ModelError(f"the quantity {asked} needs a point of the mesh by its number, 0 to {mesh.n_points - 1}")
    return asked[1] * mesh.dim + _axis(contact, asked)


def _reaction(contact: MovingContact, none: Gradient, asked: Asked) -> Gradient:
    model = contact.problem.model
    axis, points = _axis(contact, asked), model.mesh.points_of(str(asked[1]))
    if model.springs:
        raise ModelError(
            "reactions of a model with springs have no sensitivities: ask for a displacement or a contact force"
        )
    whole = np.zeros(len(contact.u))
    whole[points * model.mesh.dim + axis] = 1.0
    own = contact.problem.system.balance(whole)[0]
    if not own.any():
        raise ModelError(f"no support acts along {asked[-1]} on group '{asked[1]}': its reaction is zero")
    force = contact.at(contact.u).force if contact.problem.pairs else 0.0
    out = contact.problem.system.K @ contact.u - contact.load.force - force
    return replace(none, value=float(own @ out), reaction=own)


def _contact_force(contact: MovingContact, none: Gradient, step: StepResult, asked: Asked) -> Gradient:
    found, axis = step.contact[str(asked[1])], _axis(contact, asked)
    others = [name for name in contact.problem.pairs if name != asked[1]]
    nodes = np.setdiff1d(found.points, found.primary_points)
    for name in others:
        theirs = contact.problem.pairs[name]
        shared = np.intersect1d(nodes, [*theirs.secondary.points, *getattr(theirs.primary, "points", ())])
        if len(shared):
            raise ModelError(
                f"point {shared[0]} carries forces of both contact '{asked[1]}' and contact '{name}': the force of one of "
                "them has no sensitivity here; let the pairs share no nodes"
            )
    dim, n = contact.problem.model.mesh.dim, len(contact.u)
    size = n + len(contact.active)
    sample = np.zeros(size)
    sample[nodes * dim + axis] = 1.0
    rows = contact.constraints.B[contact.active]
    return replace(none, value=float(found.force[axis]), multiplier=rows @ sample[:n], sample=sample)


def _pressure(contact: MovingContact, none: Gradient, step: StepResult, asked: Asked) -> tuple[MovingContact, Gradient]:
    name, found = str(asked[1]), step.contact[str(asked[1])]
    place = int(found.pressure.argmax())
    if asked[0] == "pressure":
        places = np.flatnonzero(found.points == asked[2])
        if not len(places):
            raise ModelError(f"point {asked[2]} is no node of the secondary side of contact '{name}'")
        place = int(places[0])
    if not found.active[place]:
        raise ModelError(f"point {found.points[place]} of contact '{name}' is open: its pressure is zero")
    if contact.problem.model.seams:
        raise ModelError(
            "pressures of a part that repeats itself have no sensitivities: ask for a force or a displacement"
        )
    contact = replace(contact, pair=name, closed=found.active)
    multiplier, by_multiplier = contact.solution.multiplier, none.multiplier
    own, rows = contact.constraints.rows()[name], contact.active
    size = float(np.abs(multiplier[own]).max(initial=0.0)) or 1.0
    base = contact.pressure(multiplier)[place]
    for k in np.flatnonzero((rows >= own.start) & (rows < own.stop)):
        more = multiplier.copy()
        more[rows[k]] += 1e-3 * size
        by_multiplier[k] = (contact.pressure(more)[place] - base) / (1e-3 * size)
    sample = np.zeros(len(contact.u) + len(rows) + len(found.points))
    sample[len(contact.u) + len(rows) + place] = 1.0
    return contact, replace(none, value=float(base), sample=sample)
