"""Conversion of tables that declare command-line arguments to arguments of argparse."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


# A key of a table is the usage of an argument, such as ``"-o --output FILE"``. Its value is the help text, or a pair of the
# kind of the argument and the help text. The kind is a type, a default value, or a dictionary of settings of argparse. A
# nested table is a group of arguments, with its key as the title; the arguments of a group without a title are mutually
# exclusive.
def declare(parser: Any, table: Mapping[str, Any], **settings: Any) -> None:
    """Add the arguments of a table to a parser or to an argument group; `settings` are settings of all arguments."""
    for usage, entry in table.items():
        if isinstance(entry, Mapping):
            declare(parser.add_argument_group(usage) if usage else parser.add_mutually_exclusive_group(), entry)
            continue
        kind, text = entry if isinstance(entry, tuple) else ({}, entry)
        if not isinstance(kind, dict):
            kind = {"type": kind} if isinstance(kind, type) else {"type": type(kind), "default": kind}
        flags = [word for word in usage.split() if word.startswith("-")]
        names = usage.split()[len(flags) :]
        form = {} if not flags else {"metavar": names[0]} if names else {"action": "store_true"}
        parser.add_argument(*(flags or names), **{"help": text, **form, **kind, **settings})


def add_verbosity(parser: Any, default: Any) -> None:
    """Add the verbosity options, which all commands share, with the default value `default`."""
    table = {"-v --verbose": "report what is being done and why", "-q --quiet": "print nothing but errors and warnings"}
    declare(parser.add_mutually_exclusive_group(), table, default=default)
