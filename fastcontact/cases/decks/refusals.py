"""Names that a deck defines twice or not at all, and what the model refuses, told at the line of the deck."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from fastcontact.cases.decks.blocks import Location, folded
from fastcontact.errors import CaseError, FastcontactError


@contextmanager
def refusing(location: Location, about: str = "") -> Iterator[None]:
    """Refuse, at a location of the deck, what the package refuses in the block; the message begins with what it is about."""
    try:
        yield
    except CaseError:  # which has a location
        raise
    except FastcontactError as error:
        raise location.refuse(f"{about}{error}") from error


def check_new(kind: str, name: str, table: Mapping[str, Any], location: Location) -> None:
    """Refuse a name that is in a table already."""
    if folded(name) in table:
        raise location.refuse(f"{kind} '{name}' is defined twice")


def defined(kind: str, name: str, table: Mapping[str, Any], location: Location) -> Any:
    """Return the entry of a table with a name; refused with the names of all entries if there is none."""
    if folded(name) not in table:
        known = ", ".join(entry.name for entry in table.values()) or "none"
        raise location.refuse(f"{kind} '{name}' is not defined; {kind.rpartition(' ')[2]}s: {known}")
    return table[folded(name)]
