"""Dispatch to the subcommands, and conversion of errors to exit codes.

The exit codes are 0 for success, 1 for invalid input, for files that cannot be read or written and for a study that is
interrupted from the keyboard, 2 for failed convergence, failed runs of a study or an adaptive study that misses its
tolerance, 3 for a failed check of the case (``run --strict``), 130 for an interruption of other commands from the keyboard,
143 for SIGTERM and 129 for SIGHUP. Invalid input is reported in one line. After failed convergence or an interruption, the
result file contains all converged steps.
"""

from __future__ import annotations

import argparse
import importlib
import logging
import os
import pkgutil
import re
import signal
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from fastcontact._jit import compiling
from fastcontact._version import __version__
from fastcontact.cli._arguments import add_verbosity, declare
from fastcontact.cli._interrupts import EXIT_CODES, interruptible, release_objects, restoring_interrupt
from fastcontact.cli._terminal import encodable, say, stderr_is_terminal, warnings_shown
from fastcontact.errors import ConvergenceError, FastcontactError, printable, unknown

SHELLS = ("bash", "zsh", "tcsh")
# Options of the main command. With them, the mesh generators need not be declared.
GLOBAL_OPTIONS = ("-h", "--help", "--version")
# Names and metavars of the arguments whose values are file names.
FILES = ("case", "file", "output", "mesh", "FILE", "PNG", "FOLDER", "DIR")


class PrintCompletion(argparse.Action):
    """Action of ``--print-completion SHELL``: print the completion script of a shell and exit."""

    def __call__(self, parser: argparse.ArgumentParser, namespace: Any, values: Any, option_string: Any = None) -> None:
        """Print the completion script. Raises FastcontactError if shtab is not installed."""
        try:
            import shtab
        except ImportError as error:
            raise FastcontactError("completion in shells needs shtab: pip install 'fastcontact[completion]'") from error
        _mark_files(parser, shtab.FILE)
        say(shtab.complete(parser, shell=values))
        parser.exit()


def _mark_files(parser: argparse.ArgumentParser, kind: Any) -> None:
    """Mark the arguments of a parser and its subcommands that are file names with the completion `kind` of shtab."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for subparser in action.choices.values():
                _mark_files(subparser, kind)
        elif {action.dest, action.metavar} & {*FILES}:
            action.complete = kind  # type: ignore[attr-defined]


log = logging.getLogger("fastcontact")
_FLAG = re.compile(r"(?<![\w-])--?[A-Za-z][\w-]*")
_SEVERAL = re.compile(r"expected \d+ arguments")
# Message of argparse for an invalid choice, with the valid names.
_CHOICE = re.compile(r"argument (?P<kind>[\w-]+): invalid choice: '(?P<given>.*)' \(choose from (?P<known>.*)\)")
_NAME = re.compile(r"[\w-]+")


class _EscapingHandler(logging.StreamHandler[Any]):
    """A log handler that escapes control characters, which names from files may contain."""

    def format(self, record: logging.LogRecord) -> str:
        """Return the line of a record, which overwrites the progress bar on a terminal."""
        line = encodable(printable(super().format(record)), self.stream)
        return f"\r\x1b[K{line}" if stderr_is_terminal() else line


class Parser(argparse.ArgumentParser):
    """An argument parser that reports errors as the package does, in one line and with exit code 1."""

    def error(self, message: str) -> None:  # type: ignore[override]
        """Raise FastcontactError instead of exiting with code 2. For an invalid choice, a similar valid one is suggested."""
        choice = _CHOICE.search(message)
        if choice:
            message = unknown(choice["kind"].lower(), choice["given"], _NAME.findall(choice["known"]))
            if choice["kind"] == "COMMAND" and choice["given"].endswith((".toml", ".inp")):
                message += f"; to solve a file, write '{self.prog} run {choice['given']}'"
        message = _SEVERAL.sub(r"\g<0>, separated by blanks", message)
        raise FastcontactError(f"{message}; see '{self.prog} --help'")

    def _print_message(self, message: str, file: Any = None) -> None:
        """Print the help or the version, and report write errors, which argparse ignores."""
        say(message.rstrip("\n"))

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse arguments. Raises FastcontactError for an unknown argument, with the usage of this parser, not its parent."""
        options, unparsed = super().parse_known_args(args, namespace)
        flags = [*_FLAG.findall(self.format_usage()), "--help"] if unparsed else []
        for flag in (text.partition("=")[0] for text in unparsed if _FLAG.match(text)):
            self.error(unknown("option", flag, flags))
        for text in unparsed:
            flag = f"--{os.path.splitext(text)[1][1:].replace('rmed', 'med')}"
            self.error(f"unexpected argument '{text}'" + f": write {flag} {text}" * (flag in flags))
        return options, unparsed


def parser(command: str | None = None) -> argparse.ArgumentParser:
    """Return the parser of the subcommand `command`, or of all subcommands if none has this name.

    If `command` is given, mesh generators, whose import takes most of the time, are declared only for the subcommand
    `mesh`.
    """
    top = Parser(prog="fastcontact", description="Finite-element analysis of elastic contact problems.")
    top.add_argument("--version", action="version", version=f"fastcontact {__version__}")
    top.add_argument(
        "--print-completion", metavar="SHELL", choices=SHELLS, action=PrintCompletion,
        help=f"print the completion script of a shell: {', '.join(SHELLS)}",
    )  # fmt: skip
    commands = top.add_subparsers(dest="command", metavar="COMMAND", required=True)
    names = [name for _, name, _ in pkgutil.iter_modules([os.path.dirname(__file__)]) if not name.startswith("_")]
    for name in [command] if command in names else names:
        module = importlib.import_module(f"{__package__}.{name}")
        subparser = commands.add_parser(name, help=module.HELP, description=module.HELP)
        if hasattr(module, "ARGUMENTS"):
            declare(subparser, module.ARGUMENTS)
        elif command in (None, name):
            module.add_generators(subparser)
        subparser.set_defaults(run=module.run)
        add_verbosity(subparser, default=False)
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    received_signals: list[int] = []
    with interruptible(received_signals):  # the block includes the printing of error messages
        return _run_with_exit_code(sys.argv[1:] if argv is None else list(argv), received_signals)


def _run_with_exit_code(words: list[str], received_signals: list[int]) -> int:
    """Run a command, print its error and return the exit code; `received_signals` contains the numbers of signals."""
    try:
        with restoring_interrupt(received_signals):
            return _run(words)
    except ConvergenceError as error:
        say("\n".join([f"no convergence: {error}", *history_lines(error.history), *_notes(error)]), error=True)
        return 2
    except FastcontactError as error:
        say(f"error: {error}", error=True)
        release_objects(error)  # an interrupted study raises this error
        return EXIT_CODES[received_signals[0]] if received_signals and received_signals[0] != signal.SIGINT else 1
    except BrokenPipeError:
        return 1
    except KeyboardInterrupt as error:
        number = received_signals[0] if received_signals else signal.SIGINT
        say("\n".join(["interrupted" if number == signal.SIGINT else "terminated", *_notes(error)]), error=True)
        release_objects(error)
        return EXIT_CODES[number]


def _run(words: list[str]) -> int:
    """Parse the arguments, set up logging, and run the subcommand; return its exit code."""
    words = words or ["--help"]
    command = None if words[0] not in GLOBAL_OPTIONS and words[0].startswith("-") else words[0]
    arguments = parser(command).parse_args(words)
    handler = _EscapingHandler()
    log.handlers[:] = [handler]
    log.setLevel(logging.INFO if arguments.verbose else logging.WARNING)
    notify = stderr_is_terminal() and not (arguments.quiet or arguments.verbose)  # -v writes this message to the log
    compiling.listeners[:] = [_say_compiling] if notify else []
    with warnings_shown():
        return int(arguments.run(arguments) or 0)


def _say_compiling() -> None:
    """Print once that kernels are being compiled."""
    compiling.listeners.remove(_say_compiling)
    say(f"{compiling.ANNOUNCEMENT} ...", error=True)


def _notes(error: BaseException) -> list[str]:
    """Return the notes of an error as indented lines."""
    return [f"  {note}" for note in getattr(error, "__notes__", ())]


def history_lines(history: Sequence[Mapping[str, Any]], shown: int = 10) -> list[str]:
    """Return lines on the last `shown` iterations of a failed step: displacement change, active constraints, residual."""
    if not history:
        return []
    first = max(len(history) - shown, 0)
    lines = [f"  iterations {first + 1} to {len(history)}: change of the displacement, active constraints, residual"]
    for number, entry in enumerate(history[first:], start=first + 1):
        residual = f"{entry['residual']:.3e}" if "residual" in entry else "-"
        lines.append(f"  {number:4d}  {entry['displacement_change']:.3e}  {entry['active']:6d}  {residual}")
    return lines
