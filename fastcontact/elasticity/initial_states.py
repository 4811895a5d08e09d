"""Initial stresses and strains, and stress-free strains due to temperature."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fastcontact._tools.records import record
from fastcontact.arrays import Array, Indices
from fastcontact.elasticity.loads import LARGEST, Table, check_number, listed
from fastcontact.elasticity.material_axes import Axes, checked_axes, frames, rotations
from fastcontact.elasticity.varying_constants import Cells, Varying, positions, wrap_varying
from fastcontact.errors import ModelError, check_known
from fastcontact.round_off import ROUND_OFF

COMPONENTS = ("xx", "yy", "zz", "xy", "yz", "xz")
# Ramp of states with the multiplier 1 at all instants.
ALWAYS: Table = ((-LARGEST, 1.0), (LARGEST, 1.0))


@record
class InitialState:
    """An initial stress or strain of groups of solid cells, or of all solid cells.

    Attributes
    ----------
    kind : str
        ``"stress"`` or ``"strain"``.
    groups : tuple of str or None
        Groups of solid cells; None means all solid cells.
    cells : Cells
        The cells of these groups.
    components : mapping of int to float or Varying
        Stresses [pressure], or strains [-] with engineering shear strains, by the number of the component in `COMPONENTS`.
    axes : Axes
        Axes to which the components refer, in the forms of material axes.
    kinematics : str
    ramp : tuple
        Points (load factor, multiplier) of the ramp.
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

    def values(self, element: str, rows: Indices, N: Array) -> Array:
        """Return the components (n_rows, n, n_components) in the axes x, y and z, in cells of the type `element`.

        The components are stresses [pressure] or strains [-], and are zero in cells of other groups. `rows` (n_rows,) of int
        contains the numbers of the cells, and `N` (n, n_nodes) [-] the shape functions at n points of a cell. Raises
        ModelError if a component does not exist in the kinematics.
        """
        size = 6 if self.kinematics == "3d" else 4
        is_member = np.isin(rows, self.cells.rows.get(element, ()))
        members = rows[is_member]
        values = np.zeros((len(members) * len(N), 6))
        for component, value in self.components.items():
            values[:, component] = value.at(element, members, N) if isinstance(value, Varying) else value
        if self.axes is not None:
            points = positions(self.cells.mesh, self.cells.mesh.cells[element][members], N)
            rotation = rotations(frames(self.axes, points, self.kinematics))
            if self.kind == "strain":  # engineering strains transform by the inverse transpose
                rotation = np.asarray(np.linalg.inv(rotation).transpose(0, 2, 1))
            values = np.einsum("nij,nj->ni", rotation, values)
        # In plane stress, an initial strain zz is admissible, but an initial stress zz is not.
        inadmissible = [*range(size, 6), *([2] if (self.kind, self.kinematics) == ("stress", "plane_stress") else [])]
        if np.abs(values[:, inadmissible]).max(initial=0.0) > ROUND_OFF * np.abs(values).max(initial=0.0):
            raise ModelError(
                f"{self.name} has out-of-plane components, which {self.kinematics} does not have: change its axes"
            )
        all_values = np.zeros((len(rows), len(N), size))
        all_values[is_member] = values[:, :size].reshape(len(members), len(N), size)
        return all_values

    def check(self) -> None:
        """Raise ModelError if a component is not admissible in one of the cells."""
        for element, rows, N in self.cells.samples():
            self.values(element, rows, N)


def initial_state(
    kind: str, groups: tuple[str, ...] | None, cells: Cells, values: Mapping[str, Any], axes: Axes, kinematics: str,
    ramp: Table | None,
) -> InitialState:  # fmt: skip
    """Return an initial stress or strain, given the `values` of its components by name; raise ModelError if inadmissible.

    The other arguments are attributes of `InitialState`.
    """
    label = f"the initial {kind} of {listed(groups)}"
    components: dict[int, Any] = {}
    for component in values:
        check_known(f"component of {label}", component, COMPONENTS, ModelError)
    for number, component in enumerate(COMPONENTS):
        value = wrap_varying(values.get(component))
        if value is None:
            continue
        if number > 3 and kinematics != "3d":
            raise ModelError(f"{label} has the component {component}, which {kinematics} does not have")
        if isinstance(value, Varying):
            value = Varying(value.source, cells, f"the component {component} of {label}")
        else:
            check_number(f"the component {component} of {label}", value)
        components[number] = value
    if not components:
        raise ModelError(f"{label} has no component: specify, for example, xx=...")
    state = InitialState(kind, groups, cells, components, checked_axes(axes), kinematics, ramp or ALWAYS)
    state.check()
    return state


# Initial states with their multipliers.
ScaledStates = Sequence[tuple[float, InitialState]]


@record
class StressOffset:
    """Stress in addition to that caused by displacements, due to temperature, initial strains and initial stresses.

    Attributes
    ----------
    rise : ndarray (n_points,)
        Temperature rise above the reference temperature [temperature].
    expansion : ndarray (n_moduli, n_components)
        Thermal strains per unit temperature rise, for each row of elastic moduli [1 / temperature].
    states : sequence of (float, InitialState)
        Initial stresses and strains, each with its multiplier.
    """

    rise: Array
    expansion: Array
    states: ScaledStates = ()

    def sum_of_states(self, kind: str, element: str, rows: Indices, N: Array) -> Array | None:
        """Return the sum of initial stresses [pressure] or strains [-], (n_rows, n, n_components); None if there are none.

        The `kind` is ``"stress"`` or ``"strain"``, and the other arguments are those of `InitialState.values`.
        """
        values = [factor * state.values(element, rows, N) for factor, state in self.states if state.kind == kind]
        return np.asarray(np.sum(values, axis=0)) if values else None
