"""Fields at the points of a mesh that can be drawn, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fastcontact.arrays import Array, Numbers
from fastcontact.elasticity.recovery import von_mises, von_mises_signed
from fastcontact.errors import FastcontactError, unknown
from fastcontact.mesh.mesh import Mesh
from fastcontact.results.layout import contact_slip
from fastcontact.results.separated import separated
from fastcontact.results.step import StepResult
from fastcontact.results.tables import AXES, STRESS_COMPONENTS
from fastcontact.results.units import valued


@dataclass(frozen=True, eq=False)
class Field:
    """A field at the points of a mesh, which is cut along material interfaces for stresses.

    Attributes
    ----------
    mesh : Mesh
        Mesh with the points of the values.
    node : ndarray of int (m,)
        Node of the whole mesh at each of these points.
    values : ndarray (m,)
        Values in the unit of `quantity`.
    caption : str
        Name for labels.
    quantity : str
        Quantity of the unit, ``"pressure"`` or ``"length"``.
    """

    mesh: Mesh
    node: Numbers
    values: Array
    caption: str
    quantity: str

    @property
    def extreme(self) -> int:
        """Number of the point with the largest value, or with the smallest if that has the larger magnitude."""
        return int(np.argmax(np.abs(self.values)))

    @property
    def range(self) -> tuple[float, float]:
        """Limits of the colours: symmetric about zero if the values have both signs."""
        low, high = float(self.values.min()), float(self.values.max())
        if self.signed:
            return -max(-low, high), max(-low, high)
        return low, high

    @property
    def signed(self) -> bool:
        """Whether the values have both signs, each with at least a tenth of the magnitude of the other."""
        low, high = float(self.values.min()), float(self.values.max())
        return low < 0.0 < high and min(-low, high) > 0.1 * max(-low, high)

    def described(self, value: float, units: Mapping[str, str], where: str = "") -> str:
        """Return an extreme value as text."""
        kind = "maximum" if value >= 0.0 else "minimum"
        return f"{kind}{where} {valued(float(value), units, self.quantity, 5)}"

    @property
    def colours(self) -> str:
        """Name of the colour map: diverging from blue over white to red for both signs."""
        return "RdBu_r" if self.signed else "viridis"


def field_of(mesh: Mesh, step: StepResult, name: str) -> Field:
    """Return a field of a step by one of `names`; FastcontactError if there is no such field."""
    everywhere = np.arange(mesh.n_points, dtype=np.int32)
    if name in DISPLACEMENTS:
        axis = AXES.index(name[-1]) if "." in name else None
        if axis is not None and axis >= mesh.dim:
            raise FastcontactError(unknown("field", name, names(mesh)))
        values = np.linalg.norm(step.displacement, axis=1) if axis is None else step.displacement[:, axis]
        return Field(
            mesh, everywhere, values, "displacement" if axis is None else f"displacement along {name[-1]}", "length"
        )
    if name in SLIPS:
        slip = np.linalg.norm(contact_slip(mesh, step, name.removeprefix("contact_")), axis=1)
        return Field(mesh, everywhere, slip, SLIPS[name], "length")
    if name == "temperature" and step.temperature is not None:
        return Field(mesh, everywhere, step.temperature, name, "")
    if name in step.cell_fields:
        return Field(mesh, everywhere, _of_cells(mesh, step.cell_fields[name]), CELLS.get(name, name), "")
    separate_mesh, node, stress = separated(mesh, step)
    if name == "von_mises" and separate_mesh is mesh:
        return Field(mesh, node, step.von_mises, CAPTIONS[name], "pressure")
    if name not in names(mesh):
        further = [*step.cell_fields, *(["temperature"] if step.temperature is not None else [])]
        raise FastcontactError(unknown("field", name, [*names(mesh), *further]))
    if name in CAPTIONS:
        return Field(separate_mesh, node, OF_STRESS[name](stress), CAPTIONS[name], "pressure")
    component = name.removeprefix("stress.")
    values = stress[:, STRESS_COMPONENTS.index(component)]
    return Field(separate_mesh, node, values, f"stress {component}", "pressure")


def names(mesh: Mesh) -> list[str]:
    """Return the names of all possible fields of a mesh."""
    components = STRESS_COMPONENTS[: 4 if mesh.dim == 2 else 6]
    displacements = [name for name in DISPLACEMENTS if "." not in name or name[-1] in AXES[: mesh.dim]]
    return [*CAPTIONS, *(f"stress.{name}" for name in components), *displacements, *SLIPS]


def _of_cells(mesh: Mesh, values: Array) -> Array:
    """Return values of solid cells (n_solids,) at the points (n_points,): the mean of the cells around each."""
    total, count, first = np.zeros(mesh.n_points), np.zeros(mesh.n_points), 0
    for block in mesh.solids.values():
        block_values = values[first : first + len(block)]
        np.add.at(total, block, block_values[:, None])
        np.add.at(count, block, 1.0)
        first += len(block)
    return total / np.maximum(count, 1.0)


def principal_stresses(stress: Array) -> Array:
    """Return the principal stresses (n, 3) of stresses (n, 4) or (n, 6), the smallest first [pressure]."""
    full = np.zeros((len(stress), 6))
    full[:, : stress.shape[1]] = stress
    xx, yy, zz, xy, yz, xz = full.T
    tensor = np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=1).reshape(-1, 3, 3)
    return np.asarray(np.linalg.eigvalsh(tensor))


def _tresca(stress: Array) -> Array:
    principal = principal_stresses(stress)
    return np.asarray(principal[:, 2] - principal[:, 0])


CAPTIONS = {
    "von_mises": "von Mises stress",
    "von_mises_signed": "von Mises stress with the sign of the trace",
    "tresca": "Tresca stress (largest less smallest principal)",
    "stress.principal_max": "largest principal stress",
    "stress.principal_mid": "middle principal stress",
    "stress.principal_min": "smallest principal stress",
}
OF_STRESS: dict[str, Callable[[Array], Array]] = {
    "von_mises": von_mises,
    "von_mises_signed": von_mises_signed,
    "tresca": _tresca,
    "stress.principal_max": lambda stress: principal_stresses(stress)[:, 2],
    "stress.principal_mid": lambda stress: principal_stresses(stress)[:, 1],
    "stress.principal_min": lambda stress: principal_stresses(stress)[:, 0],
}
CELLS = {
    "plastic_strain": "equivalent plastic strain",
    "yield_ratio": "equivalent stress over yield stress",
    **{f"heat_flux_{axis}": f"heat flux along {axis}" for axis in AXES},
    "J": "volume over reference volume",
    "logarithmic_strain": "principal logarithmic strain",
}
SLIPS = {"contact_slip": "slip of the step", "contact_slip_total": "slip so far"}
DISPLACEMENTS = ("displacement", "displacement.x", "displacement.y", "displacement.z")
