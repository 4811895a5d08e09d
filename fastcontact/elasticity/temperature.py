"""Temperatures of the nodes of solid cells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from fastcontact.arrays import Array
from fastcontact.elasticity.loads import (
    EVERYWHERE,
    Table,
    Value,
    check_number,
    check_solids,
    check_value,
    evaluated,
    listed,
    solid_points,
)
from fastcontact.errors import ModelError
from fastcontact.mesh.mesh import Mesh


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
        Temperature without thermal strain [temperature].
    ramp : tuple, optional
        Ramp of the temperature rise over the reference.
    times : tuple of float
        Instants of the history to which the temperature belongs, if any.
    place : int
        Index of the instant of this temperature in `times`.
    """

    groups: tuple[str, ...] | None
    value: Value | Array
    reference: float
    ramp: Table | None = None
    # For a history by instants, set by `histories`: the instants, and the index of this one.
    times: tuple[float, ...] = field(default=(), init=False)
    place: int = field(default=0, init=False)

    @property
    def name(self) -> str:
        """Description with the groups, for messages."""
        return f"the temperature of {listed(self.groups)}"

    @property
    def places(self) -> tuple[str, ...]:
        """Names of the groups."""
        return (EVERYWHERE,) if self.groups is None else self.groups

    def check(self, mesh: Mesh) -> None:
        """Raise MeshError or ModelError if a group, the value or the reference is not admissible."""
        check_solids(mesh, self.groups, ": it has no temperature")
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
        points = solid_points(mesh, self.groups)
        rise = np.zeros(mesh.n_points)
        if isinstance(self.value, np.ndarray):
            rise[points] = self.value[points] - self.reference
        else:
            rise[points] = evaluated(self.value, mesh.points[points], self.name) - self.reference
        return rise


def checked_value(value: Any) -> Any:
    """Return a temperature, with lists of numbers as arrays."""
    return np.array(value, float) if isinstance(value, (list, tuple, np.ndarray)) and np.ndim(value) else value


def histories(
    groups: tuple[str, ...] | None, values: Array, reference: float, times: Sequence[float]
) -> list[Temperature]:
    """Return a temperature for each of several instants, between which they are interpolated linearly.

    Parameters
    ----------
    groups : tuple of str or None
    values : ndarray (n_instants, n_points)
        Temperatures [temperature].
    reference : float
        Temperature without thermal strain [temperature].
    times : sequence of float
        Ascending load factors of the instants.

    Raises
    ------
    ModelError
        If there are not as many times as instants, or they do not ascend.
    """
    instants = checked_times(times, len(values))
    temperatures = []
    for k, time in enumerate(instants):
        hat = tuple((other, float(other == time)) for other in instants)
        temperature = Temperature(groups, values[k], reference, hat)
        object.__setattr__(temperature, "times", instants)
        object.__setattr__(temperature, "place", k)
        temperatures.append(temperature)
    return temperatures


def checked_times(times: Sequence[float], count: int) -> tuple[float, ...]:
    """Return the load factors of the instants of a history; ModelError unless they are `count`, at least two, and ascend."""
    checked = np.asarray(times, float)
    if checked.shape != (count,) or count < 2:
        raise ModelError(
            f"the temperature has {count} instants, but {checked.size} times: give the load factor of each, at least two"
        )
    if not (np.isfinite(checked).all() and (np.diff(checked) > 0.0).all()):
        raise ModelError(f"the times of the temperature must ascend, not {checked.tolist()}")
    return tuple(checked.tolist())
