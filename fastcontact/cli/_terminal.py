"""What is printed: names and titles come from files, so that characters that steer a terminal are shown, not sent.

Escape sequences could change what a terminal shows or does; characters that turn the direction of writing could hide a
part of a line (Boucher and Anderson, 2023). Characters that the terminal's encoding lacks are shown by their number.
"""

from __future__ import annotations

import argparse
import os
import sys
from typing import Any, TextIO

from fastcontact.errors import FileError, printable


def add_loudness(parser: argparse.ArgumentParser, default: Any) -> None:
    """Add the options of every command on how much it prints, set to `default` where they are not given."""
    loudness = parser.add_mutually_exclusive_group()
    for flags, text in {
        ("-v", "--verbose"): "say what is being done and why",
        ("-q", "--quiet"): "print nothing but errors and warnings",
    }.items():
        loudness.add_argument(*flags, action="store_true", default=default, help=text)


def somebody_watches() -> bool:
    """Return whether standard error is a terminal; a process may be started without any."""
    return sys.stderr is not None and sys.stderr.isatty()


def say(text: object, *, error: bool = False) -> None:
    """Print a text on standard output, or on standard error, of which nobody could be told that it cannot be written."""
    stream: TextIO | None = sys.stderr if error else sys.stdout
    if stream is None:  # closed before the process was started
        return
    try:
        print(encodable(printable(str(text)), stream), file=stream)
    except BrokenPipeError:
        raise
    except OSError as refused:
        if not error:
            raise FileError(_unwritten(refused)) from refused


def flushed(code: int) -> int:
    """Return an exit code when all that was printed is written; if it cannot be, say so in one line and return 1."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError as refused:
        # Python would try once more as it ends, and tell it in words of its own.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not code and not isinstance(refused, BrokenPipeError):
            say(f"error: {_unwritten(refused)}", error=True)
        return code or 1
    return code


def _unwritten(error: OSError) -> str:
    """Return what is said where standard output leads to a full disk."""
    return f"cannot write to standard output ({error.strerror}): send it elsewhere"


def encodable(text: str, stream: TextIO) -> str:
    """Return a text with all characters that a stream cannot write replaced by their escapes."""
    encoding = getattr(stream, "encoding", None) or "utf-8"
    return text.encode(encoding, "backslashreplace").decode(encoding)
