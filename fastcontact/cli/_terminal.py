"""Output of text and warnings on terminals, with control characters escaped.

Names and titles from files may contain escape sequences, which could change the display or the behaviour of a terminal, and
bidirectional control characters, which could hide part of a line (Boucher and Anderson, 2023). Characters that the encoding
of the terminal lacks are escaped as well.
"""

from __future__ import annotations

import contextlib
import logging
import os
import sys
import warnings
from collections.abc import Iterator
from typing import TextIO

from fastcontact.errors import FastcontactWarning, FileError, printable


def stderr_is_terminal() -> bool:
    """Return whether standard error exists and is a terminal."""
    return sys.stderr is not None and sys.stderr.isatty()


def say(text: object, *, error: bool = False) -> None:
    """Print a string on standard output, or on standard error without reporting write errors.

    Raises FileError if writing to standard output fails, and BrokenPipeError if the process that reads it has exited.
    """
    stream: TextIO | None = sys.stderr if error else sys.stdout
    if stream is None:  # the stream was closed before the process started
        return
    try:
        print(encodable(printable(str(text)), stream), file=stream)
    except BrokenPipeError:
        raise
    except OSError as failure:
        if not error:
            raise FileError(_write_error_message(failure)) from failure


def flush_output(code: int) -> int:
    """Flush standard output and return the exit code, or 1 in place of 0 if this fails.

    The error is reported if `code` is 0, except for a broken pipe.
    """
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except OSError as failure:
        # At exit Python flushes again and would print another message. Redirecting the output to the null device
        # prevents this message.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if not code and not isinstance(failure, BrokenPipeError):
            say(f"error: {_write_error_message(failure)}", error=True)
        return code or 1
    return code


def _write_error_message(error: OSError) -> str:
    """Return the message about a failed write to standard output, for example on a full disk."""
    return f"cannot write to standard output ({error.strerror}): redirect it"


def encodable(text: str, stream: TextIO) -> str:
    """Return a string in which escapes replace the characters that a stream cannot encode."""
    encoding = getattr(stream, "encoding", None) or "utf-8"
    return text.encode(encoding, "backslashreplace").decode(encoding)


log = logging.getLogger("fastcontact")


@contextlib.contextmanager
def warnings_shown() -> Iterator[list[str]]:
    """Log each distinct warning of the package once, in one line, when it is issued; yield a list of the texts."""
    texts: list[str] = []
    with warnings.catch_warnings():
        warnings.simplefilter("always", FastcontactWarning)
        original = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *location: object) -> None:
            if not issubclass(category, FastcontactWarning):
                original(message, category, *location)  # type: ignore[arg-type]
            elif str(message) not in texts:
                texts.append(str(message))
                log.warning("warning: %s", message)

        warnings.showwarning = show  # type: ignore[assignment]
        yield texts
