"""Checks of the numbers that enter a formula; every message names the parameter and says what it must be."""

from __future__ import annotations

import math
import numbers

from fastcontact.errors import ModelError, unknown


def number(name: str, value: object) -> float:
    """Return `value` as a finite float, or raise ModelError."""
    if isinstance(value, bool) or not isinstance(value, numbers.Real) or not math.isfinite(value):
        raise ModelError(f"{name} is {value!r}: it must be a finite number")
    return float(value)


def positive(name: str, value: object, *, infinite: bool = False) -> float:
    """Return `value` as a positive float; infinity only where the formula has that limit."""
    if infinite and isinstance(value, numbers.Real) and value == math.inf:
        return math.inf
    checked = number(name, value)
    if checked <= 0.0:
        raise ModelError(f"{name} is {checked:g}: it must be positive")
    return checked


def not_negative(name: str, value: object) -> float:
    """Return `value` as a float that is zero or positive."""
    checked = number(name, value)
    if checked < 0.0:
        raise ModelError(f"{name} is {checked:g}: it must not be negative")
    return checked


def poisson(name: str, value: object) -> float:
    """Return a Poisson ratio in (-1, 0.5]."""
    checked = number(name, value)
    if not -1.0 < checked <= 0.5:
        raise ModelError(f"{name} is {checked:g}: a Poisson ratio lies in (-1, 0.5]")
    return checked


def exactly_one(**given: float | None) -> tuple[str, float]:
    """Return name and value of the one argument that is not None; the value must be positive."""
    present = [name for name, value in given.items() if value is not None]
    if len(present) != 1:
        found = " and ".join(present) if present else "none"
        raise ModelError(f"give exactly one of {', '.join(given)}: got {found}")
    return present[0], positive(present[0], given[present[0]])


def one_of(name: str, value: str, known: tuple[str, ...]) -> str:
    """Return `value` if it is one of the `known` words."""
    if value not in known:
        raise ModelError(unknown(name, str(value), known))
    return value
