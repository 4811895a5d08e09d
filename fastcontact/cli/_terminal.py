"""What is printed: names and titles come from files, so that characters that steer a terminal are shown, not sent.

Escape sequences could change what a terminal shows or does; characters that turn the direction of writing could hide a
part of a line (Boucher and Anderson, 2023). Characters that the terminal's encoding lacks are shown by their number.
"""

from __future__ import annotations

import argparse
import sys
from typing import Any, TextIO


def add_loudness(parser: argparse.ArgumentParser, default: Any) -> None:
    """Add the options of every command on how much it prints, set to `default` where they are not given."""
    loudness = parser.add_mutually_exclusive_group()
    for flags, text in {
        ("-v", "--verbose"): "say what is being done and why",
        ("-q", "--quiet"): "print nothing but errors and warnings",
    }.items():
        loudness.add_argument(*flags, action="store_true", default=default, help=text)


def say(text: object, *, error: bool = False) -> None:
    """Print a text on standard output, or on standard error."""
    stream: TextIO = sys.stderr if error else sys.stdout
    print(encodable(printable(str(text)), stream), file=stream)


def printable(text: str) -> str:
    """Return a text with all characters that control or format replaced by their escapes, but for the ends of lines."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text)


def encodable(text: str, stream: TextIO) -> str:
    """Return a text with all characters that a stream cannot write replaced by their escapes."""
    encoding = getattr(stream, "encoding", None) or "utf-8"
    return text.encode(encoding, "backslashreplace").decode(encoding)
