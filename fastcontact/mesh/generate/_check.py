"""Checks of the generators' arguments: each message names the argument and the admissible range."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from reprlib import repr
from typing import Any, TypeVar

from fastcontact.errors import MeshError, check_known

TRIANGLES = ("tri3", "tri6")
QUADRANGLES = ("quad4", "quad8", "quad9")
FACES = TRIANGLES + QUADRANGLES
# Largest admissible number, whose cube can still be represented, and largest numbers of segments and cells. Larger numbers
# are probably mistakes in units or decimal points, and would not fit into memory.
LARGEST = 1e100
MOST_ALONG = 1_000_000
MOST_CELLS = 5_000_000

Number = TypeVar("Number", int, float)


def number(name: str, value: Any) -> float:
    """Return `value` as a float; MeshError if it is not a finite number."""
    result = float(value)
    if not math.isfinite(result):
        raise MeshError(f"{name} must be a finite number, not {repr(value)}")
    if abs(result) > LARGEST:
        raise MeshError(f"{name} = {result:g} is out of range: its magnitude must be at most {LARGEST:g}")
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
    """Return `wanted` rounded up, at least 1; MeshError if it is more than MOST_ALONG."""
    if not wanted <= MOST_ALONG:
        raise MeshError(
            f"a line of the mesh would be divided into {wanted:.3g} segments, more than {MOST_ALONG}: check the units of "
            "the element sizes, or request larger elements"
        )
    return max(1, math.ceil(wanted - 1e-9))


def affordable(n_cells: float) -> None:
    """Raise MeshError if a mesh has more than about MOST_CELLS cells."""
    if not n_cells <= MOST_CELLS:
        raise MeshError(
            f"the mesh would have about {n_cells:.3g} cells, more than {MOST_CELLS}: check the units of the element sizes, "
            "or request larger elements or fewer divisions"
        )


def each(check: Callable[[str, Any], Number], name: str, value: Sequence[Any]) -> list[Number]:
    """Return the members of `value`, checked one by one."""
    return [check(f"{name}[{i}]", member) for i, member in enumerate(value)]


def one_of(name: str, value: str, known: Sequence[str]) -> str:
    """Return `value`; MeshError with similar names unless it is one of `known`."""
    check_known(name, value, known, MeshError)
    return value


def unused(element: str, *instead: str, **arguments: Any) -> None:
    """Raise MeshError if an argument without effect on `element` is given (not None); suggest arguments with an effect."""
    remedy = f"use {', '.join(instead)}" if instead else "omit it"
    for name, value in arguments.items():
        if value is not None:
            raise MeshError(f"{name} = {repr(value)} has no effect on {element} meshes: {remedy}")
