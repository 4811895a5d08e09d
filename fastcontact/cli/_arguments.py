"""Arguments of commands as tables, from which those of argparse are made."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

# By usage, such as ``"-o --output FILE"``, the help, or the kind of the value and the help. The kind is a type, a default
# value, or further settings of argparse. A nested table is a group with its key as title; without a title, the arguments
# exclude each other.
Arguments = Mapping[str, Any]


def declare(parser: Any, table: Arguments, **common: Any) -> None:
    """Add the arguments of a table to a parser or to a group of one; `common` are settings of argparse for all."""
    for usage, entry in table.items():
        if isinstance(entry, Mapping):
            declare(parser.add_argument_group(usage) if usage else parser.add_mutually_exclusive_group(), entry)
            continue
        kind, text = entry if isinstance(entry, tuple) else ({}, entry)
        if not isinstance(kind, dict):
            kind = {"type": kind} if isinstance(kind, type) else {"type": type(kind), "default": kind}
        flags = [word for word in usage.split() if word.startswith("-")]
        value = usage.split()[len(flags) :]
        shown = {} if not flags else {"metavar": value[0]} if value else {"action": "store_true"}
        parser.add_argument(*(flags or value), **{"help": text, **shown, **kind, **common})
