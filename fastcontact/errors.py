"""Every exception and warning that fastcontact raises, under one base class."""

from __future__ import annotations

import difflib
import os
import sys
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

LONGEST = 1500  # largest number of characters of a message


def printable(text: str) -> str:
    """Return a text in which control and format characters, except line ends, are replaced by escapes."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text)


class FastcontactError(Exception):
    """Base class of every error that fastcontact raises deliberately; its message is one line."""

    def __str__(self) -> str:
        # Names and values from files may contain anything: line ends, terminal control codes, thousands of characters.
        text = printable(" ".join(super().__str__().splitlines()))
        return text if len(text) <= LONGEST else f"{text[: LONGEST // 2]} ... {text[-LONGEST // 3 :]}"


class MeshError(FastcontactError):
    """The mesh cannot be used: an invalid cell, a missing group, a wrong number."""


class ModelError(FastcontactError):
    """The model is incomplete or contradictory (materials, supports, loads)."""


class ContactError(FastcontactError):
    """A contact pair cannot be set up: wrong side, empty surface, illegal option."""


class CaseError(FastcontactError):
    """A case file or a command-line option is wrong."""


class FileError(FastcontactError):
    """A file cannot be read or written."""


class ConvergenceError(FastcontactError):
    """The solution of a load step did not converge.

    Attributes
    ----------
    history : list of dict
        One entry per iteration of the failed step: residual, active constraints, displacement change.
    smaller_steps_help : bool
        Whether smaller load steps may converge.
    """

    def __init__(
        self, message: str, history: Sequence[Mapping[str, Any]] = (), *, smaller_steps_help: bool = True
    ) -> None:
        super().__init__(message)
        self.history = [dict(entry) for entry in history]
        self.smaller_steps_help = smaller_steps_help


class FastcontactWarning(UserWarning):
    """A doubtful model or result; the message states a number."""

    def __str__(self) -> str:
        return printable(super().__str__())


@contextmanager
def in_file(path: str | os.PathLike[str]) -> Iterator[None]:
    """Prefix errors of the package from the block with a file name, or a location in it, unless they have one."""
    try:
        yield
    except FastcontactError as error:
        if isinstance(error, ConvergenceError) or str(path) in str(error):
            raise
        raise type(error)(f"{path}: {error}") from error


def warn(text: str) -> None:
    """Issue a FastcontactWarning at the calling line outside the package."""
    package = os.path.dirname(__file__) + os.sep
    level, frame = 2, sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_filename.startswith(package):
        level, frame = level + 1, frame.f_back
    warnings.warn(text, FastcontactWarning, stacklevel=level)


# Largest number of characters that a message shows of an unknown name.
LONGEST_NAME = 120


def no_attribute(module: str, name: str, known: Iterable[str]) -> AttributeError:
    """Return the error for a name that a module does not have, with the nearest ones."""
    text = f"module '{module}' has no attribute '{name}'"
    if name.startswith("_"):  # a name probed by tools
        return AttributeError(text)
    near = difflib.get_close_matches(name.casefold(), known, n=3, cutoff=0.5)
    remedy = ": did you mean " + " or ".join(map(repr, near)) + "?" if near else ""
    return AttributeError(
        text + remedy, name=name, obj=text
    )  # with a text as object, Python does not append its own suggestions


def names_of(module: str, known: list[str]) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """Return ``__getattr__`` and ``__dir__`` of a module with lazily loaded public names."""

    def missing(name: str) -> object:
        raise no_attribute(module, name, known)

    return missing, lambda: known


def check_known(
    kind: str, name: object, known: Collection[str], error: type[FastcontactError], about: str = ""
) -> None:
    """Raise `error` for a name that is not among the `known` ones, with the nearest of them, and `about` before its text."""
    if not isinstance(name, str) or name not in known:
        raise error(about + unknown(kind, str(name), known))


def unknown(kind: str, name: str, known: Iterable[str]) -> str:
    """Return the message for an unknown name: the name, and the nearest known names or, if none is near, the first ones."""
    names, name = sorted(known), str(name)
    name = name if len(name) <= LONGEST_NAME else f"{name[:LONGEST_NAME]}..."
    if not names:
        return f"unknown {kind} '{name}': there is none here"
    near = difflib.get_close_matches(name, names, n=3, cutoff=0.5)
    if not near:
        folded = {candidate.casefold(): candidate for candidate in names}
        near = [folded[key] for key in difflib.get_close_matches(name.casefold(), folded, n=3, cutoff=0.5)]
    if near:
        return f"unknown {kind} '{name}': did you mean " + " or ".join(f"'{candidate}'" for candidate in near) + "?"
    shown = ", ".join(names[:12]) + (f", ... ({len(names)} in all)" if len(names) > 12 else "")
    return f"unknown {kind} '{name}': known are {shown}"
