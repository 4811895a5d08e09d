"""Initial stresses and strains, and stress-free strains due to temperature."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fastcontact.arrays import Array, Indices
from fastcontact.elasticity.loads import LARGEST, Table, check_number, listed
from fastcontact.elasticity.material_axes import Axes, checked_axes, frames, rotations
from fastcontact.elasticity.varying_constants import Cells, Varying, positions, wrapped
from fastcontact.errors import ModelError, check_known
from fastcontact.round_off import ROUND_OFF

COMPONENTS = ("xx", "yy", "zz", "xy", "yz", "xz")
# Ramp of states that act in full from the first step on.
ALWAYS: Table = ((-LARGEST, 1.0), (LARGEST, 1.0))


@dataclass(frozen=True, eq=False)
class InitialState:
    """An initial stress, or strain, of groups of solid cells, or of all.

    Attributes
    ----------
    kind : str
        ``"stress"`` or ``"strain"``.
    groups : tuple of str or None
        Groups of solid cells; None: all.
    cells : Cells
        The cells of these groups.
    components : mapping of int to float or Varying
        By the number of the component in `COMPONENTS`: stresses [pressure], or strains with engineering shears [-].
    axes : Axes
        Axes of the components, as for materials.
    kinematics : str
    ramp : tuple
        Pairs of instant and multiplier.
    """

    kind: str
    groups: tuple[str, ...] | None
    cells: Cells
    components: Mapping[int, Any]
    axes: Axes
    kinematics: str
    ramp: Table = ALWAYS

    @property
    def name(self) -> str:
        """Kind and groups, for messages."""
        return f"the initial {self.kind} of {listed(self.groups)}"

    def values(self, name: str, rows: Indices, N: Array) -> Array:
        """Return components (n_rows, n, n_components) [pressure] or [-] along x, y, z, in cells of the element type `name`.

        `rows` (n_rows,) of int are the numbers of the cells, `N` (n, n_nodes) [-] values of the shape functions at the
        points. Components are zero in cells of other groups.
        """
        size = 6 if self.kinematics == "3d" else 4
        inside = np.isin(rows, self.cells.rows.get(name, ()))
        members = rows[inside]
        local = np.zeros((len(members) * len(N), 6))
        for component, value in self.components.items():
            local[:, component] = value.at(name, members, N) if isinstance(value, Varying) else value
        if self.axes is not None:
            places = positions(self.cells.mesh, self.cells.mesh.cells[name][members], N)
            turn = rotations(frames(self.axes, places, self.kinematics))
            if self.kind == "strain":  # engineering strains transform by the inverse transpose
                turn = np.asarray(np.linalg.inv(turn).transpose(0, 2, 1))
            local = np.einsum("nij,nj->ni", turn, local)
        out = np.abs(local[:, size:]).max(initial=0.0)
        if out > ROUND_OFF * np.abs(local).max(initial=0.0) or self._out_of_plane(local):
            raise ModelError(
                f"{self.name} has out-of-plane components, which {self.kinematics} does not have: change its axes"
            )
        values = np.zeros((len(rows), len(N), size))
        values[inside] = local[:, :size].reshape(len(members), len(N), size)
        return values

    def _out_of_plane(self, values: Array) -> bool:
        """Return whether an initial stress (n, 6) [pressure] has a component zz in plane stress."""
        largest = np.abs(values).max(initial=0.0)
        plane = self.kind == "stress" and self.kinematics == "plane_stress"
        return bool(plane and np.abs(values[:, 2]).max(initial=0.0) > ROUND_OFF * largest)

    def check(self) -> None:
        """Raise ModelError if a component is not admissible."""
        for element, rows, N in self.cells.samples():
            self.values(element, rows, N)


def initial_state(
    kind: str, groups: tuple[str, ...] | None, cells: Cells, given: Mapping[str, Any], axes: Axes, kinematics: str,
    ramp: Table | None,
) -> InitialState:  # fmt: skip
    """Return the initial state of `kind` given by the names of its components; ModelError if it is not admissible."""
    label = f"the initial {kind} of {listed(groups)}"
    components: dict[int, Any] = {}
    for component in given:
        check_known(f"component of {label}", component, COMPONENTS, ModelError)
    for number, component in enumerate(COMPONENTS):
        value = wrapped(given.get(component))
        if value is None:
            continue
        if number > 3 and kinematics != "3d":
            raise ModelError(f"{label} has the component {component}, which {kinematics} does not have")
        if isinstance(value, Varying):
            value = Varying(value.given, cells, f"the component {component} of {label}")
        else:
            check_number(f"the component {component} of {label}", value)
        components[number] = value
    if not components:
        raise ModelError(f"{label} has no component: give for example xx=...")
    state = InitialState(kind, groups, cells, components, checked_axes(axes), kinematics, ramp or ALWAYS)
    state.check()
    return state


@dataclass(frozen=True, eq=False)
class StressOffset:
    """Stress in cells in addition to that of the displacements: due to temperature, initial strains and initial stresses.

    Attributes
    ----------
    rise : ndarray (n_points,)
        Rise of the temperature [temperature].
    expansion : ndarray (n_moduli, n_components)
        Thermal strains per unit of temperature [1 / temperature].
    states : sequence of (float, InitialState)
        Initial stresses and strains, each with its factor.
    """

    rise: Array
    expansion: Array
    states: Sequence[tuple[float, InitialState]] = ()

    def initial(self, kind: str, name: str, rows: Indices, N: Array) -> Array | None:
        """Return the sum of initial stresses or strains (n_rows, n, n_components) [pressure] or [-]; None without any.

        `rows` (n_rows,) of int are the numbers of the cells, `N` (n, n_nodes) [-] the shape functions at the points.
        """
        values = [factor * state.values(name, rows, N) for factor, state in self.states if state.kind == kind]
        return np.asarray(np.sum(values, axis=0)) if values else None
