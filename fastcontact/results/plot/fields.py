"""Fields for plots, by name, with their values at the points of a mesh."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping

import numpy as np

from fastcontact._tools.records import record
from fastcontact.arrays import Array, Numbers
from fastcontact.elasticity.recovery import principal_stress, tresca, von_mises, von_mises_signed
from fastcontact.errors import FastcontactError, check_known
from fastcontact.mesh.mesh import Mesh
from fastcontact.results.layout import CONTACT_FIELDS, cells_by_element, contact_fields, cut_at_interfaces
from fastcontact.results.step import StepResult
from fastcontact.results.tables import AXES, STRESS_COMPONENTS
from fastcontact.results.units import value_text


@record
class Field:
    """A scalar field at the points of a mesh, which is cut along material interfaces for stresses.

    Attributes
    ----------
    mesh : Mesh
        Mesh with the points of the values.
    node : ndarray of int (m,)
        Node of the original mesh at each of these points.
    values : ndarray (m,)
        Values [unit of `quantity`].
    caption : str
        Name for labels.
    quantity : str
        Quantity that determines the unit, ``"pressure"`` or ``"length"``; empty for other fields.
    """

    mesh: Mesh
    node: Numbers
    values: Array
    caption: str
    quantity: str

    @property
    def extreme(self) -> int:
        """Number of the point with the value of largest magnitude."""
        return int(np.argmax(np.abs(self.values)))

    @property
    def range(self) -> tuple[float, float]:
        """Limits of the colours, which are symmetric about zero if the field is `signed`."""
        low, high = float(self.values.min()), float(self.values.max())
        return (-max(-low, high), max(-low, high)) if self.signed else (low, high)

    @property
    def signed(self) -> bool:
        """Whether the values have both signs, and the magnitude of the smaller extreme exceeds a tenth of the larger one."""
        low, high = float(self.values.min()), float(self.values.max())
        return low < 0.0 < high and min(-low, high) > 0.1 * max(-low, high)

    def extreme_label(self, value: float, units: Mapping[str, str], region: str = "") -> str:
        """Return a label for an extreme value of the field, or of a `region` such as ``" on the section"``."""
        kind = "maximum" if value >= 0.0 else "minimum"
        return f"{kind}{region} {value_text(float(value), units, self.quantity, 5)}"

    @property
    def colours(self) -> str:
        """Name of the colour map, which diverges from blue through white to red if the field is `signed`."""
        return "RdBu_r" if self.signed else "viridis"


def field_of(mesh: Mesh, step: StepResult, name: str) -> Field:
    """Return a field of a step by its name. Raises FastcontactError if there is no field with this name."""
    fluxes = [flux for key, flux in step.cell_fields.items() if key.startswith("heat_flux_")]
    heat = [*["temperature"] * (step.temperature is not None), *["heat_flux"] * bool(fluxes)]
    contact = contact_fields(mesh, step)
    check_known("field", name, [*field_names(mesh), *contact, *step.cell_fields, *heat], FastcontactError)
    if name in STRESS_FIELDS and name not in step.cell_fields:
        separate_mesh, node, stress = cut_at_interfaces(mesh, step)
        caption, stress_measure = STRESS_FIELDS[name]
        values = step.von_mises if name == "von_mises" and separate_mesh is mesh else stress_measure(stress)
        return Field(separate_mesh, node, values, caption, "pressure")
    caption, quantity = name, ""
    if name in DISPLACEMENTS:
        caption, quantity = name.replace(".", " along "), "" if "parameter" in step.iterations else "length"
        axis = AXES.index(name[-1]) if "." in name else None
        values = np.linalg.norm(step.displacement, axis=1) if axis is None else step.displacement[:, axis]
    elif name in contact:
        caption, quantity = CONTACT_FIELDS[name]
        values = np.linalg.norm(contact[name].reshape(mesh.n_points, -1), axis=1)
    elif name == "temperature" and step.temperature is not None:
        values = step.temperature
    elif name == "heat_flux":
        caption, values = "heat flux", _nodal_mean(mesh, np.linalg.norm(fluxes, axis=0))
    else:
        caption, values = CELL_CAPTIONS.get(name, name), _nodal_mean(mesh, step.cell_fields[name])
    return Field(mesh, np.arange(mesh.n_points, dtype=np.int32), values, caption, quantity)


def field_names(mesh: Mesh) -> list[str]:
    """Return the names of the fields of bodies that each step on a mesh has."""
    missing = ("stress.yz", "stress.xz", "displacement.z") if mesh.dim == 2 else ()
    return [name for name in (*STRESS_FIELDS, *DISPLACEMENTS) if name not in missing]


def _nodal_mean(mesh: Mesh, values: Array) -> Array:
    """Return the mean (n_points,) of the `values` (n_solids,) of the solid cells that share each point."""
    total, count, by_element = np.zeros(mesh.n_points), np.zeros(mesh.n_points), cells_by_element(mesh, values)
    for name, block in mesh.solids.items():
        np.add.at(total, block, by_element[name][:, None])
        np.add.at(count, block, 1.0)
    return total / np.maximum(count, 1.0)


# Captions of fields, and functions from stresses (n, 4) or (n, 6) to values (n,) [pressure].
STRESS_FIELDS: dict[str, tuple[str, Callable[[Array], Array]]] = {
    "von_mises": ("von Mises stress", von_mises),
    "von_mises_signed": ("von Mises stress with the sign of the trace", von_mises_signed),
    "tresca": ("Tresca stress (largest minus smallest principal stress)", tresca),
    "stress.principal_max": ("largest principal stress", lambda stress: principal_stress(stress)[:, 2]),
    "stress.principal_mid": ("middle principal stress", lambda stress: principal_stress(stress)[:, 1]),
    "stress.principal_min": ("smallest principal stress", lambda stress: principal_stress(stress)[:, 0]),
    **{
        f"stress.{name}": (f"stress {name}", operator.itemgetter((slice(None), k)))
        for k, name in enumerate(STRESS_COMPONENTS)
    },
}
CELL_CAPTIONS = {
    "plastic_strain": "equivalent plastic strain",
    "yield_ratio": "equivalent stress over yield stress",
    **{f"heat_flux_{axis}": f"heat flux along {axis}" for axis in AXES},
    "J": "volume over reference volume",
    "logarithmic_strain": "principal logarithmic strain",
}
DISPLACEMENTS = ("displacement", "displacement.x", "displacement.y", "displacement.z")
