"""The command line: one file a sub-command; only here do things print and parse arguments."""

from __future__ import annotations

from fastcontact.cli._main import entry_point, main

__all__ = ["entry_point", "main"]
