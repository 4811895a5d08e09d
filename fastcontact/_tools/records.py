"""Data classes that are not public, and the functions of `dataclasses` for them."""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import field as field
from dataclasses import replace as replace
from typing import TypeVar, dataclass_transform

T = TypeVar("T")


@dataclass_transform(frozen_default=True, eq_default=False, field_specifiers=(field,))
def record(cls: type[T]) -> type[T]:
    """Add a constructor to a class whose annotations declare its attributes.

    For type checkers, this is ``dataclass(frozen=True, eq=False)``, which rejects assignments to attributes. Python does not
    check them, because the methods for this would double the time in which the classes are created at each start.
    """
    return dataclass(eq=False, repr=False)(cls)
