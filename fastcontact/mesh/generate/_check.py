"""Checks of the makers' arguments: each names the argument and the allowed range."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from reprlib import repr
from typing import Any, TypeVar

from fastcontact.errors import MeshError, unknown

TRIANGLES = ("tri3", "tri6")
QUADRANGLES = ("quad4", "quad8", "quad9")
FACES = TRIANGLES + QUADRANGLES
# Largest size of a number, whose cubes can still be represented. Largest numbers of segments and of cells: more are probably
# mistakes in units or decimal points, and would not fit into memory.
LARGEST = 1e100
MOST_ALONG = 1_000_000
MOST_CELLS = 5_000_000

Number = TypeVar("Number", int, float)


def number(name: str, value: Any) -> float:
    """Return `value` as a float; MeshError if it is not a finite number."""
    try:
        result = float(value)
    except (TypeError, ValueError):
        raise MeshError(f"{name} must be a number, not {repr(value)}") from None
    if not math.isfinite(result):
        raise MeshError(f"{name} must be a finite number, not {repr(value)}")
    if abs(result) > LARGEST:
        raise MeshError(f"{name} = {result:g} is out of range: its size must be at most {LARGEST:g}")
    return result


def positive(name: str, value: Any, at_most: float = math.inf, limit: str = "") -> float:
    """Return `value` as a float; MeshError unless 0 < value <= at_most (called `limit` in the message)."""
    result = number(name, value)
    if 0.0 < result < 1.0 / LARGEST:
        raise MeshError(f"{name} = {result:g} is out of range: it must be at least {1.0 / LARGEST:g}")
    if not 0.0 < result <= at_most * (1 + 1e-12):
        upper = "" if at_most == math.inf else f" and at most {limit + ' = ' if limit else ''}{at_most:g}"
        raise MeshError(f"{name} = {result:g} is out of range: it must be greater than 0{upper}")
    return result


def growth_of(name: str, value: Any) -> float:
    """Return the ratio of neighbouring edges as a float; MeshError unless it is more than 1."""
    result = positive(name, value)
    if not result > 1.0:
        raise MeshError(f"{name} = {result:g} is out of range: it must be more than 1")
    return result


def within(name: str, value: Any, low: float, high: float) -> float:
    """Return `value` as a float; MeshError unless low <= value <= high."""
    result = number(name, value)
    if not low <= result <= high:
        raise MeshError(f"{name} = {result:g} is out of range: it must be between {low:g} and {high:g}")
    return result


def count(name: str, value: Any) -> int:
    """Return `value` as an int; MeshError unless it is a whole number from 1 to MOST_ALONG."""
    result = number(name, value)
    if result != int(result) or result < 1:
        raise MeshError(f"{name} = {repr(value)} is out of range: it must be a whole number, at least 1")
    if result > MOST_ALONG:
        raise MeshError(f"{name} = {repr(value)} is out of range: it must be at most {MOST_ALONG}")
    return int(result)


def segments(wanted: float) -> int:
    """Return the whole number next above `wanted`, at least 1; MeshError if it is more than MOST_ALONG."""
    if not wanted <= MOST_ALONG:
        raise MeshError(
            f"a line of the mesh would be divided into {wanted:.3g} segments, more than {MOST_ALONG}: check the units of "
            "the element sizes, or ask for larger elements"
        )
    return max(1, math.ceil(wanted - 1e-9))


def affordable(n_cells: float) -> None:
    """Raise MeshError if a mesh has more than about MOST_CELLS cells."""
    if not n_cells <= MOST_CELLS:
        raise MeshError(
            f"the mesh would have about {n_cells:.3g} cells, more than {MOST_CELLS}: check the units of the element sizes, "
            "or ask for larger elements or fewer divisions"
        )


def each(check: Callable[[str, Any], Number], name: str, value: Any, count: int = 2) -> list[Number]:
    """Return the two (or three) members of `value`, checked one by one; MeshError if there are not so many."""
    if isinstance(value, str) or not hasattr(value, "__len__") or len(value) != count:
        raise MeshError(f"{name} must be {'two' if count == 2 else 'three'} numbers, not {repr(value)}")
    return [check(f"{name}[{i}]", member) for i, member in enumerate(value)]


def one_of(name: str, value: Any, known: Sequence[str]) -> str:
    """Return `value`; MeshError that offers the near names unless it is one of `known`."""
    if not isinstance(value, str) or value not in known:
        raise MeshError(unknown(name, str(value)[:80], known))
    return str(value)


def unused(element: str, instead: str = "", **arguments: Any) -> None:
    """Raise MeshError if an argument without effect with `element` was given (is not None), `instead` of which others are."""
    for name, value in arguments.items():
        if value is not None:
            raise MeshError(f"{name} = {repr(value)} means nothing to {element} meshes: leave it out{instead}")
