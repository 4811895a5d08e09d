"""The options of a contact pair as named arguments with types, for `help` and editors; see `ModelContact.add_contact`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypedDict

from numpy.typing import ArrayLike

from fastcontact.elasticity.loads import Value
from fastcontact.model.ramp import History


class FormulationOptions(TypedDict, total=False):
    """Options of formulations: those of all first, then those of single ones."""

    friction: float | None
    surface_smoothing: bool | None
    slip: str | None
    normals: str | ArrayLike | None
    projection_tolerance: float | None
    opposite: str | None
    multipliers: str | None
    augmentation: float | None
    integration: str | None
    n_gauss: int | None


class SharedOptions(TypedDict, total=False):
    """Options of every contact pair, whatever its formulation."""

    kind: str | None
    clearance: Value | None
    clearance_primary: Value | None
    clearance_ramp: History
    friction_ramp: History
    excluded: str | Sequence[str] | None
    frictionless: str | Sequence[str] | None
    frictionless_along: ArrayLike | None
    penalty: float | Sequence[tuple[float, float]] | Mapping[str, float] | None
    tangential_penalty: Value | None
    cohesion: Mapping[str, float | str] | None
    adhesion: Mapping[str, float] | None
    wear: float | None
    conductance: Any
    friction_heat: float | None
    obstacle_temperature: float | None
    search_distance: float | None


class ContactOptions(FormulationOptions, SharedOptions, total=False):
    """Options of `add_contact` other than the sides."""


SHARED_OPTIONS = tuple(sorted(SharedOptions.__annotations__))
