"""Heat loads of solid cells: prescribed temperatures, heat fluxes, films, heat sources and nodal heat flows.

Fluxes, films and sources are multiplied by the shape functions and integrated, over the full circle in axisymmetry and per
unit thickness in plane models. Areas and volumes are those of the `deformed` mesh, but values are evaluated at reference
positions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.sparse import csr_array

from fastcontact.arrays import Array, scattered
from fastcontact.elasticity.loads import (
    Load,
    Table,
    Value,
    ValueLoad,
    VolumeLoad,
    add_forces,
    check_points,
    evaluated,
    quadrature_points,
)
from fastcontact.errors import ModelError
from fastcontact.linear.sparse_rows import Blocks, assembled
from fastcontact.mesh.mesh import Mesh


class TemporaryHeat(Load):
    """Base class of prescribed temperatures and films, which act in the load steps between two instants."""

    begins: float
    ends: float

    @property
    def label(self) -> str:
        """Label that distinguishes the load from others of the same kind and group in messages."""
        return self.name if self.begins == -np.inf else f"{self.name} from {self.begins:g}"

    @property
    def temporary(self) -> bool:
        """Whether the load does not act in all load steps."""
        return self.begins > -np.inf or self.ends < np.inf

    def acts_from(self, begin: float) -> bool:
        """Return whether the load acts in the load step that begins at an instant."""
        return self.begins <= begin < self.ends

    def check(self, mesh: Mesh, kinematics: str) -> None:
        """Raise MeshError or ModelError if the load cannot act on this mesh."""
        super().check(mesh, kinematics)
        if not self.begins < self.ends:
            raise ModelError(f"{self.name} begins at {self.begins:g} and ends at {self.ends:g}: it must begin earlier")


@dataclass(frozen=True)
class FixedTemperature(TemporaryHeat):
    """A temperature [temperature] prescribed at the nodes of a group; ramps multiply its rise above the reference.

    If `begins` is finite, the rise starts from its value at this instant, `reached` (n_points,), and proceeds to the next
    point of the ramp.
    """

    KIND = "the temperature"
    group: str
    value: Value
    ramp: Table | None = None
    begins: float = -np.inf
    ends: float = np.inf
    reached: Array | None = None

    def check(self, mesh: Mesh, kinematics: str) -> None:
        """Raise MeshError or ModelError if the load cannot act on this mesh."""
        super().check(mesh, kinematics)
        if self.begins > -np.inf and self.ramp is None:
            raise ModelError(
                f"{self.name} begins at {self.begins:g} without a ramp: give it a ramp; it starts from the current "
                "temperature and proceeds to the next point of the ramp"
            )

    def history(self) -> tuple[Table | None, Table]:
        """Return the ramps of the rises of `value` and `reached`; that of `reached` falls to zero at the next ramp point."""
        later = [point for point in self.ramp or () if point[0] > self.begins]
        if self.reached is None or not later:
            return self.ramp, ()
        return ((self.begins, 0.0), *later), ((self.begins, 1.0), (later[0][0], 0.0))

    def _check_groups(self, mesh: Mesh, kinematics: str) -> None:
        check_points(mesh, self.group, "no temperature can be prescribed on it")


class Heating(Load):
    """A heat load that is independent of the temperature."""

    def power(self, mesh: Mesh, kinematics: str, deformed: Mesh) -> Array:
        """Return the heat flows (n_points,) [power] into the nodes of the `deformed` mesh at multiplier 1."""
        total = np.zeros((mesh.n_points, 1))
        for element, cells in self.cells(mesh).items():
            x, N, _ = quadrature_points(mesh, element, cells, kinematics)
            measure = quadrature_points(deformed, element, cells, kinematics)[2]
            add_forces(total, cells, N, (evaluated(self.value, x, self.name) * measure)[:, :, None])
        return total[:, 0]


class HeatFlux(ValueLoad, Heating):
    """A heat flux [power / area] into the body through a group of facets."""

    KIND = "the heat flux"


@dataclass(frozen=True)
class HeatSource(VolumeLoad, Heating):
    """Heat generation per unit volume [power / length^3] in groups of solid cells, or in all solid cells."""

    KIND = "the heat source"
    groups: tuple[str, ...] | None
    value: Value
    ramp: Table | None = None


class NodalHeat(ValueLoad, Heating):
    """A heat flow [power] into each node of a group."""

    KIND = "the heat at nodes"

    def _check_groups(self, mesh: Mesh, kinematics: str) -> None:
        check_points(mesh, self.group, "no heat can be supplied to it")

    def power(self, mesh: Mesh, kinematics: str, deformed: Mesh) -> Array:
        """Return the heat flows (n_points,) [power] at multiplier 1; see `Heating.power`."""
        nodes = mesh.points_of(self.group)
        return scattered(evaluated(self.value, mesh.points[nodes], self.name), nodes, mesh.n_points)


@dataclass(frozen=True)
class Film(TemporaryHeat):
    """Convection from a group of facets to the surroundings: ``coefficient * (temperature - ambient)`` [power / area].

    Attributes
    ----------
    group : str
        Group of the facets.
    coefficient : float or callable
        Film coefficient [power / (area temperature)].
    ambient : float or callable
        Temperature of the surroundings [temperature]; the ramp multiplies its rise above the reference.
    ramp : sequence of (float, float), optional
        Ramp of this rise.
    begins, ends : float
        Instants between which the film acts.
    """

    KIND: ClassVar[str] = "the film"
    group: str
    coefficient: Value
    ambient: Value
    ramp: Table | None = None
    begins: float = -np.inf
    ends: float = np.inf

    @property
    def values(self) -> Sequence[Value]:  # type: ignore[override]
        """Coefficient and ambient temperature."""
        return [self.coefficient, self.ambient]

    def exchange(self, mesh: Mesh, kinematics: str, deformed: Mesh, reference: float) -> tuple[csr_array, Array]:
        """Return the matrix (n_points, n_points) [power / temperature] and the heat flows (n_points,) [power] of the film.

        The heat flows are due to the rise of the ambient temperature above `reference` [temperature] at multiplier 1. Raises
        ModelError if a coefficient is negative.
        """
        blocks, powers = list[Blocks](), np.zeros((mesh.n_points, 1))
        for element, facets in self.cells(mesh).items():
            x, N, _ = quadrature_points(mesh, element, facets, kinematics)
            h = evaluated(self.coefficient, x, f"the coefficient of {self.name}")
            if h.min(initial=0.0) < 0.0:
                raise ModelError(f"the coefficient of {self.name} is {h.min():g}: it must not be negative")
            h *= quadrature_points(deformed, element, facets, kinematics)[2]
            rise = evaluated(self.ambient, x, f"the ambient temperature of {self.name}") - reference
            add_forces(powers, facets, N, (h * rise)[:, :, None])
            blocks.append((facets, facets, np.einsum("fq,qa,qb->fab", h, N, N)))
        return assembled(blocks, (mesh.n_points, mesh.n_points)), powers[:, 0]
