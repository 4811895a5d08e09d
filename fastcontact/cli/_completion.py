"""Shell completion of commands, options and file names with the library shtab."""

from __future__ import annotations

import argparse
from typing import Any

from fastcontact.cli._terminal import say
from fastcontact.errors import FastcontactError

SHELLS = ("bash", "zsh", "tcsh")
# Names and metavars of arguments whose values are file names.
FILES = ("case", "file", "output", "mesh", "FILE", "PNG", "FOLDER", "DIR")


class PrintCompletion(argparse.Action):
    """Action of ``--print-completion SHELL``: print the completion script of a shell and exit."""

    def __call__(self, parser: argparse.ArgumentParser, namespace: Any, values: Any, option_string: Any = None) -> None:
        """Print the script; FastcontactError if shtab is not installed."""
        try:
            import shtab
        except ImportError as error:
            raise FastcontactError("completion in shells needs shtab: pip install 'fastcontact[completion]'") from error
        _mark_files(parser, shtab.FILE)
        say(shtab.complete(parser, shell=values))
        parser.exit()


def _mark_files(parser: argparse.ArgumentParser, kind: Any) -> None:
    """Mark the arguments of a parser and its subcommands that are file names, for shtab."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for sub in action.choices.values():
                _mark_files(sub, kind)
        elif {action.dest, action.metavar} & {*FILES}:
            action.complete = kind  # type: ignore[attr-defined]
