"""Prescribed temperatures at the nodes of solid cells."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fastcontact._tools.records import record
from fastcontact.arrays import Array, scattered
from fastcontact.elasticity import loads
from fastcontact.elasticity.loads import Table, Value, check_number, check_value, evaluated
from fastcontact.errors import ModelError
from fastcontact.mesh.mesh import Mesh


@record
class Temperature:
    """A temperature at the nodes of groups of solid cells, or of all solid cells.

    Attributes
    ----------
    groups : tuple of str or None
        Groups of solid cells; None means all solid cells.
    value : float, callable or ndarray (n_points,)
        A number, a function of position, or a value for each point of the mesh [temperature].
    reference : float
        Temperature at which there is no thermal strain [temperature].
    ramp : tuple, optional
        Points (load factor, multiplier) of the ramp of the temperature rise above the reference.
    times : tuple of float
        Instants of the history to which the temperature belongs; empty if there is no history.
    instant : int
        Index of the instant of this temperature in `times`.
    """

    groups: tuple[str, ...] | None
    value: Value | Array
    reference: float
    ramp: Table | None = None
    times: tuple[float, ...] = ()
    instant: int = 0

    @property
    def name(self) -> str:
        """Text with the groups, for messages."""
        return f"the temperature of {loads.listed(self.groups)}"

    @property
    def group_names(self) -> tuple[str, ...]:
        """Names of the groups."""
        return (loads.EVERYWHERE,) if self.groups is None else self.groups

    def check(self, mesh: Mesh) -> None:
        """Raise MeshError or ModelError if a group, the value or the reference is not admissible."""
        loads.check_solids(mesh, self.groups, ": it has no temperature")
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
        """Return the rise above the reference (n_points,) [temperature] at multiplier 1; it is zero outside the groups."""
        points = loads.solid_points(mesh, self.groups)
        if isinstance(self.value, np.ndarray):
            values = self.value[points]
        else:
            values = evaluated(self.value, mesh.points[points], self.name)
        return scattered(values - self.reference, points, mesh.n_points)


def temperature_history(
    groups: tuple[str, ...] | None, values: Array, reference: float, times: Sequence[float]
) -> list[Temperature]:
    """Return a temperature for each of several instants, with ramps that interpolate linearly between the instants.

    Parameters
    ----------
    groups : tuple of str or None
    values : ndarray (n_instants, n_points)
        Temperatures [temperature].
    reference : float
        Temperature at which there is no thermal strain [temperature].
    times : sequence of float
        Ascending load factors of the instants.

    Raises
    ------
    ModelError
        If the number of times differs from that of instants, or if the times do not ascend.
    """
    factors, count = np.asarray(times, float), len(values)
    if factors.shape != (count,) or count < 2:
        raise ModelError(
            f"the temperature has {count} instants, but {factors.size} times: give one load factor per instant, at least two"
        )
    if not (np.isfinite(factors).all() and (np.diff(factors) > 0.0).all()):
        raise ModelError(f"the times of the temperature must ascend, not {factors.tolist()}")
    instants = tuple(factors.tolist())
    ramps = [tuple(zip(instants, row, strict=True)) for row in np.eye(count).tolist()]
    return [Temperature(groups, values[k], reference, ramps[k], instants, k) for k in range(count)]
