"""The options of a contact pair as named arguments with types, for `help` and editors; see `ModelContact.add_contact`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypedDict

from numpy.typing import ArrayLike

from fastcontact.elasticity.loads import Value
from fastcontact.model.ramp import History


class ContactOptions(TypedDict, total=False):
    """What `add_contact` takes beside the sides: of every formulation first, then fields of single formulations."""

    friction: float | None
    kind: str | None
    clearance: Value | None
    clearance_primary: Value | None
    clearance_ramp: History
    friction_ramp: History
    surface_smoothing: bool | None
    excluded: str | Sequence[str] | None
    frictionless: str | Sequence[str] | None
    frictionless_along: ArrayLike | None
    penalty: float | Sequence[tuple[float, float]] | None
    tangential_penalty: Value | None
    cohesion: Mapping[str, float | str] | None
    adhesion: Mapping[str, float] | None
    slip: str | None
    wear: float | None
    conductance: Any
    friction_heat: float | None
    obstacle_temperature: float | None
    search_distance: float | None
    normals: str | ArrayLike | None
    projection_tolerance: float | None
    opposite: str | None
    multipliers: str | None
    augmentation: float | None
    integration: str | None
    n_gauss: int | None
