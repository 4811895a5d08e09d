"""Shell completion of commands, options and file names, by the library shtab."""

from __future__ import annotations

import argparse
from typing import Any

from fastcontact.cli._terminal import say
from fastcontact.errors import FastcontactError

SHELLS = ("bash", "zsh", "tcsh")
# Arguments whose values are files, by name or metavar.
FILES = ("case", "file", "output", "mesh", "FILE", "PNG", "FOLDER", "DIR")


class PrintCompletion(argparse.Action):
    """``--print-completion SHELL``: print the completion script of a shell for this command line, and exit."""

    def __call__(self, parser: argparse.ArgumentParser, namespace: Any, values: Any, option_string: Any = None) -> None:
        """Print the script; raises FastcontactError without shtab."""
        try:
            import shtab
        except ImportError as error:
            raise FastcontactError("completion in shells needs shtab: pip install 'fastcontact[completion]'") from error
        _mark_files(parser, shtab.FILE)
        say(shtab.complete(parser, shell=values))
        parser.exit()


def _mark_files(parser: argparse.ArgumentParser, kind: Any) -> None:
    """Mark for shtab the arguments of a parser and its sub-commands that are file names."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for sub in action.choices.values():
                _mark_files(sub, kind)
        elif {action.dest, action.metavar} & {*FILES}:
            action.complete = kind  # type: ignore[attr-defined]
