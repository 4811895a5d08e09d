"""Temperatures of the nodes of solid cells."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastcontact.elasticity.loads import Table, Value, check_number, check_value, evaluated
from fastcontact.errors import ModelError
from fastcontact.mesh.mesh import Mesh

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Temperature:
    """A temperature of the nodes of groups of solid cells, or of all.

    Attributes
    ----------
    groups : tuple of str or None
        Groups of solid cells; None: all.
    value : float, callable or ndarray (n_points,)
        A number, a function of the position, or a value for each point of the mesh [temperature].
    reference : float
        At which there is no thermal strain [temperature].
    ramp : tuple, optional
        History of the rise over the reference.
    """

    groups: tuple[str, ...] | None
    value: Value | Array
    reference: float
    ramp: Table | None = None

    @property
    def name(self) -> str:
        """Where it is given, for messages."""
        where = ", ".join(f"'{group}'" for group in self.groups) if self.groups is not None else "all solid cells"
        return f"the temperature of {where}"

    def check(self, mesh: Mesh) -> None:
        """Raise MeshError or ModelError if a group, the value or the reference cannot be."""
        for group in self.groups or ():
            if not mesh.cells_of(group, dim=mesh.dim):
                raise ModelError(f"group '{group}' holds no solid cells: it has no temperature")
        check_number(f"the reference of {self.name}", self.reference)
        if not isinstance(self.value, np.ndarray):
            check_value(self.name, self.value)
        elif self.value.shape != (mesh.n_points,) or self.value.dtype.kind not in "fiu":
            raise ModelError(
                f"{self.name} is an array of {self.value.dtype} of shape {self.value.shape}: it must have a number for each "
                f"point of the mesh, shape ({mesh.n_points},)"
            )
        elif not np.isfinite(self.value).all():
            raise ModelError(f"{self.name} is not finite at point {int(np.flatnonzero(~np.isfinite(self.value))[0])}")

    def rise(self, mesh: Mesh) -> Array:
        """Return the rise over the reference (n_points,) at multiplier 1, zero at points of other cells [temperature]."""
        if self.groups is None:
            blocks = list(mesh.solids.values())
        else:
            blocks = [block for group in self.groups for block in mesh.cells_of(group, dim=mesh.dim).values()]
        points = np.unique(np.concatenate([block.ravel() for block in blocks]))
        found = np.zeros(mesh.n_points)
        if isinstance(self.value, np.ndarray):
            found[points] = self.value[points] - self.reference
        else:
            found[points] = evaluated(self.value, mesh.points[points], self.name) - self.reference
        return found


def checked_value(value: Any) -> Any:
    """Return a temperature, a list of numbers as an array."""
    return np.array(value, float) if isinstance(value, (list, tuple, np.ndarray)) and np.ndim(value) else value
