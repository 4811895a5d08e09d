"""A contact pair as a user describes it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from fastcontact.contact.obstacles import Obstacle
from fastcontact.contact.obstacles.rotation import Rotation
from fastcontact.model.pair_options import clearance_ramp, friction_ramp
from fastcontact.model.ramp import Table

# Force on an obstacle by component, None where the component is prescribed; empty for none at all.
Driving = tuple[float | None, ...]


@dataclass(frozen=True)
class FluidPressure:
    """Fluid of a `pressure` at multiplier 1 [pressure] from the group `source`, with a history of its own or None."""

    pressure: float
    source: str
    ramp: Table | None = None


@dataclass(frozen=True)
class ContactPair:
    """Two groups of facets that may touch, or one and a rigid obstacle, with a formulation and its options.

    With an `obstacle`, `primary` is empty; `motion` is the obstacle's displacement at multiplier 1 [length], and `ramp`
    a history of its own or None. Components of `force` that are not None drive the obstacle at multiplier 1 [force]. It turns
    by `rotation`, with the history `rotation_ramp`, by default `ramp`. A pair that was found, not named, knows its least gap
    then, `found_gap` [length].
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
        """The formulation and the kind of its multipliers, where the pair names one, for messages."""
        return method(self.formulation, self.options)

    @property
    def clearance_ramp(self) -> Table | None:
        """History of the clearance; None where it does not change."""
        return clearance_ramp(self.name, self.options)

    @property
    def friction_ramp(self) -> Table | None:
        """History of the coefficient of friction; None where it does not change."""
        return friction_ramp(self.name, self.options)

    @property
    def opposite(self) -> str:
        """What the secondary side may touch, for messages."""
        return self.primary if self.obstacle is None else "a rigid obstacle"


def method(formulation: str, options: Mapping[str, Any]) -> str:
    """Return a formulation and the kind of its multipliers, where options name one."""
    return f"{formulation} with {options['multipliers']} multipliers" if "multipliers" in options else formulation
