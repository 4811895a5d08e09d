"""Checks of the arguments of generators. Their messages contain the name of the argument and the admissible range."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from reprlib import repr
from typing import Any, TypeVar

from fastcontact.errors import MeshError, check_known

TRIANGLES = ("tri3", "tri6")
QUADRANGLES = ("quad4", "quad8", "quad9")
FACES = TRIANGLES + QUADRANGLES
# Largest admissible number, whose cube can still be represented.
LARGEST = 1e100
# Largest numbers of segments of a line and of cells of a mesh. Larger numbers are probably due to wrong units or
# decimal points.
MOST_SEGMENTS = 1_000_000
MOST_CELLS = 5_000_000

Number = TypeVar("Number", int, float)


def number(name: str, value: Any) -> float:
    """Return `value` as a float. Raises MeshError if it is not a finite number, or too large."""
    result = float(value)
    if not math.isfinite(result):
        raise MeshError(f"{name} must be a finite number, not {repr(value)}")
    if abs(result) > LARGEST:
        raise MeshError(f"{name} = {result:g} is out of range: its magnitude must be at most {LARGEST:g}")
    return result


def positive(name: str, value: Any, at_most: float = math.inf, limit: str = "") -> float:
    """Return `value` as a float. Raises MeshError unless 1 / LARGEST <= value <= at_most.

    `limit` is the name of the upper bound in the message.
    """
    result = number(name, value)
    if 0.0 < result < 1.0 / LARGEST:
        raise MeshError(f"{name} = {result:g} is out of range: it must be at least {1.0 / LARGEST:g}")
    if not 0.0 < result <= at_most * (1 + 1e-12):
        upper = "" if at_most == math.inf else f" and at most {limit + ' = ' if limit else ''}{at_most:g}"
        raise MeshError(f"{name} = {result:g} is out of range: it must be greater than 0{upper}")
    return result


def growth_of(name: str, value: Any) -> float:
    """Return the ratio of the lengths of adjacent edges as a float. Raises MeshError unless it is greater than 1."""
    result = positive(name, value)
    if not result > 1.0:
        raise MeshError(f"{name} = {result:g} is out of range: it must be more than 1")
    return result


def within(name: str, value: Any, low: float, high: float) -> float:
    """Return `value` as a float. Raises MeshError unless low <= value <= high."""
    result = number(name, value)
    if not low <= result <= high:
        raise MeshError(f"{name} = {result:g} is out of range: it must be between {low:g} and {high:g}")
    return result


def count(name: str, value: Any) -> int:
    """Return `value` as an int. Raises MeshError unless it is an integer from 1 to MOST_SEGMENTS."""
    result = number(name, value)
    if result != int(result) or result < 1:
        raise MeshError(f"{name} = {repr(value)} is out of range: it must be a whole number, at least 1")
    if result > MOST_SEGMENTS:
        raise MeshError(f"{name} = {repr(value)} is out of range: it must be at most {MOST_SEGMENTS}")
    return int(result)


def segments(quotient: float) -> int:
    """Return `quotient` rounded up to a number of segments, at least 1. Raises MeshError if it is too large."""
    if not quotient <= MOST_SEGMENTS:
        raise MeshError(
            f"a line of the mesh would be divided into {quotient:.3g} segments, more than {MOST_SEGMENTS}: check the units "
            "of the element sizes, or request larger elements"
        )
    return max(1, math.ceil(quotient - 1e-9))


def check_size(n_cells: float) -> None:
    """Raise MeshError if a mesh has more than about MOST_CELLS cells."""
    if not n_cells <= MOST_CELLS:
        raise MeshError(
            f"the mesh would have about {n_cells:.3g} cells, more than {MOST_CELLS}: check the units of the element sizes, "
            "or request larger elements or fewer divisions"
        )


def each(check: Callable[[str, Any], Number], name: str, value: Sequence[Any]) -> list[Number]:
    """Return the members of `value` after checking each of them."""
    return [check(f"{name}[{i}]", member) for i, member in enumerate(value)]


def one_of(name: str, value: str, known: Sequence[str]) -> str:
    """Return `value`. Raises MeshError, with similar names, unless it is one of `known`."""
    check_known(name, value, known, MeshError)
    return value


def refuse(element: str, *alternatives: str, **arguments: Any) -> None:
    """Raise MeshError if an argument without effect on `element` is not None. The message suggests the `alternatives`."""
    remedy = f"use {', '.join(alternatives)}" if alternatives else "omit it"
    for name, value in arguments.items():
        if value is not None:
            raise MeshError(f"{name} = {repr(value)} has no effect on {element} meshes: {remedy}")
