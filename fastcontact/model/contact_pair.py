"""The user's description of a contact pair."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from fastcontact.contact.obstacles import Obstacle
from fastcontact.contact.obstacles.rigid_side import Rotation
from fastcontact.model.pair_options import clearance_ramp, friction_ramp
from fastcontact.model.ramp import Table

# Force on an obstacle by component, None for prescribed components; empty without any force.
Driving = tuple[float | None, ...]


@dataclass(frozen=True)
class FluidPressure:
    """Fluid of a `pressure` at multiplier 1 [pressure] from the group `source`, with its ramp or None."""

    pressure: float
    source: str
    ramp: Table | None = None


@dataclass(frozen=True)
class ContactPair:
    """Two groups of facets that may touch, or a group and a rigid obstacle, with a formulation and its options.

    With an `obstacle`, `primary` is empty; `motion` is the obstacle's displacement at multiplier 1 [length], and `ramp` its
    ramp or None. Components of `force` that are not None drive the obstacle at multiplier 1 [force]. The obstacle rotates by
    `rotation` along `rotation_ramp`, by default `ramp`. For automatically detected pairs, `found_gap` is the smallest gap at
    detection [length].
    """

    name: str
    secondary: str
    primary: str
    formulation: str
    options: dict[str, Any] = field(default_factory=dict)
    obstacle: Obstacle | None = None
    motion: tuple[float, ...] = ()
    ramp: Table | None = None
    force: Driving = ()
    rotation: Rotation | None = None
    rotation_ramp: Table | None = None
    fluid: FluidPressure | None = None
    found_gap: float | None = None

    @property
    def method(self) -> str:
        """The formulation and the kind of its multipliers, if the pair specifies one, for messages."""
        return method(self.formulation, self.options)

    @cached_property
    def clearance_ramp(self) -> Table | None:
        """Ramp of the clearance; None if it is constant."""
        return clearance_ramp(self.name, self.options)

    @cached_property
    def friction_ramp(self) -> Table | None:
        """Ramp of the coefficient of friction; None if it is constant."""
        return friction_ramp(self.name, self.options)

    @property
    def opposite(self) -> str:
        """Name of the opposite side, for messages."""
        return self.primary if self.obstacle is None else "a rigid obstacle"


def method(formulation: str, options: Mapping[str, Any]) -> str:
    """Return a formulation and the kind of its multipliers, if options specify one."""
    return f"{formulation} with {options['multipliers']} multipliers" if "multipliers" in options else formulation
