"""Errors with a deck location: names defined twice or not at all, and errors of the model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, TypeVar

from fastcontact.cases.decks.blocks import Located, Location, folded
from fastcontact.errors import CaseError, FastcontactError

Entry = TypeVar("Entry")


@contextmanager
def refusing(at: Location | Located, about: str = "") -> Iterator[None]:
    """Re-raise errors of the package as CaseError at a location of the deck; the message begins with `about`."""
    try:
        yield
    except CaseError:  # has a location already
        raise
    except FastcontactError as error:
        raise at.refuse(f"{about}{error}") from error


def registered(kind: str, name: str, table: dict[str, Entry], entry: Entry, at: Location | Located) -> Entry:
    """Add an entry to a table under its name and return it; raises CaseError if the name is in the table already."""
    if folded(name) in table:
        raise at.refuse(f"{kind} '{name}' is defined twice")
    table[folded(name)] = entry
    return entry


def defined(kind: str, name: str, table: Mapping[str, Any], at: Location | Located) -> Any:
    """Return the entry of a table with a name; raises CaseError with the names of all entries if there is none."""
    if folded(name) not in table:
        known = ", ".join(entry.name for entry in table.values()) or "none"
        raise at.refuse(f"{kind} '{name}' is not defined; {kind.rpartition(' ')[2]}s: {known}")
    return table[folded(name)]
