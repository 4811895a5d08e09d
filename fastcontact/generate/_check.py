"""Checks of the makers' arguments: each names the argument and the allowed range."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from fastcontact.errors import MeshError, unknown

TRIANGLES = ("tri3", "tri6")
QUADRANGLES = ("quad4", "quad8", "quad9")
FACES = TRIANGLES + QUADRANGLES


def number(name: str, value: Any) -> float:
    """Return `value` as a float; MeshError if it is not a finite number."""
    try:
        result = float(value)
    except (TypeError, ValueError):
        raise MeshError(f"{name} must be a number, not {value!r}") from None
    if not math.isfinite(result):
        raise MeshError(f"{name} must be a finite number, not {value!r}")
    return result


def positive(name: str, value: Any, at_most: float = math.inf, limit: str = "") -> float:
    """Return `value` as a float; MeshError unless 0 < value <= at_most (called `limit` in the message)."""
    result = number(name, value)
    if not 0.0 < result <= at_most * (1 + 1e-12):
        upper = "" if at_most == math.inf else f" and at most {limit + ' = ' if limit else ''}{at_most:g}"
        raise MeshError(f"{name} = {result:g} is out of range: it must be greater than 0{upper}")
    return result


def within(name: str, value: Any, low: float, high: float) -> float:
    """Return `value` as a float; MeshError unless low <= value <= high."""
    result = number(name, value)
    if not low <= result <= high:
        raise MeshError(f"{name} = {result:g} is out of range: it must be between {low:g} and {high:g}")
    return result


def count(name: str, value: Any) -> int:
    """Return `value` as an int; MeshError unless it is a whole number >= 1."""
    result = number(name, value)
    if result != int(result) or result < 1:
        raise MeshError(f"{name} = {value!r} is out of range: it must be a whole number, at least 1")
    return int(result)


def pair(name: str, value: Any) -> tuple[Any, Any]:
    """Return `value` as a tuple of two; MeshError if it is anything else."""
    if isinstance(value, str) or not hasattr(value, "__len__") or len(value) != 2:
        raise MeshError(f"{name} must be two numbers, not {value!r}")
    return value[0], value[1]


def one_of(name: str, value: Any, known: Sequence[str]) -> str:
    """Return `value`; MeshError that offers the near names unless it is one of `known`."""
    if value not in known:
        raise MeshError(unknown(name, str(value), known))
    return str(value)


def unused(element: str, **arguments: Any) -> None:
    """Raise MeshError if an argument that means nothing to `element` was given (is not None)."""
    for name, value in arguments.items():
        if value is not None:
            raise MeshError(f"{name} = {value!r} means nothing to {element} meshes: leave it out")
