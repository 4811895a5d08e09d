"""Exceptions and warnings of fastcontact, and messages about unknown names."""

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
    """Return a string in which escapes replace control and format characters, except line ends and tabs."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text)


class FastcontactError(Exception):
    """Base class of the errors that fastcontact raises, whose messages are one line."""

    def __str__(self) -> str:
        # Names and values from files may contain line ends, control characters and thousands of characters.
        text = printable(" ".join(super().__str__().splitlines()))
        return text if len(text) <= LONGEST else f"{text[: LONGEST // 2]} ... {text[-LONGEST // 3 :]}"


class MeshError(FastcontactError):
    """A mesh is invalid, for example because of an inverted cell or a missing group."""


class ModelError(FastcontactError):
    """A model or an argument is incomplete, invalid or contradictory, for example a material, a support or a load."""


class ContactError(FastcontactError):
    """A contact pair is invalid, for example because of an empty surface or an invalid option."""


class CaseError(FastcontactError):
    """A case file, an input deck or a command-line option is invalid."""


class FileError(FastcontactError):
    """A file cannot be read or written."""


class ConvergenceError(FastcontactError):
    """The solution of a load step did not converge.

    Attributes
    ----------
    history : list of dict
        Residual, active constraints and change of the displacement in each iteration of the failed step.
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
    """A model or a result is doubtful; the message quantifies the reason."""

    def __str__(self) -> str:
        return printable(super().__str__())


@contextmanager
def in_file(path: str | os.PathLike[str]) -> Iterator[None]:
    """Prefix the messages of errors in the block with a file name, unless they contain it."""
    try:
        yield
    except FastcontactError as error:
        if isinstance(error, ConvergenceError) or str(path) in str(error):
            raise
        raise type(error)(f"{path}: {error}") from error


def warn(text: str) -> None:
    """Issue a FastcontactWarning that refers to the line outside the package from which it was called."""
    package = os.path.dirname(__file__) + os.sep
    level, frame = 2, sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_filename.startswith(package):
        level, frame = level + 1, frame.f_back
    warnings.warn(text, FastcontactWarning, stacklevel=level)


# Length to which messages shorten an unknown name.
LONGEST_NAME = 120
SHOWN = 20  # largest number of known names in the message about an unknown one
# Words of this package for words of its methods and of other programs.
OTHER_WORDS = {
    "slave": "secondary", "master": "primary", "mu": "friction", "h": "coefficient", "plane": "half_space",
    "fix": "support", "prescribe": "support", "relate": "relation", "relate_groups": "group_relation",
    "boundary": "support", "load": "pressure force traction", "loads": "pressure force traction", "young": "E",
    "poisson": "nu", "rho": "density", "alpha": "expansion", "2d": "plane_strain plane_stress axisymmetric",
    "solve": "run", "study": "converge sweep", "convert": "export", "show": "info plot", "view": "plot",
}  # fmt: skip


def no_attribute(module: str, name: str, known: Iterable[str]) -> AttributeError:
    """Return the AttributeError for a name that a module lacks, with the nearest known names."""
    text = f"module '{module}' has no attribute '{name}'"
    if name.startswith("_"):  # tools look up such names
        return AttributeError(text)
    near = difflib.get_close_matches(name.casefold(), known, n=3, cutoff=0.5)
    remedy = ": did you mean " + " or ".join(map(repr, near)) + "?" if near else ""
    return AttributeError(text + remedy, name=name, obj=text)  # a string as `obj` prevents suggestions by Python


def names_of(module: str, known: list[str]) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """Return ``__getattr__`` and ``__dir__`` for a module with the public names `known`."""

    def missing(name: str) -> object:
        raise no_attribute(module, name, known)

    return missing, lambda: known


def check_known(
    kind: str, name: object, known: Collection[str], error: type[FastcontactError], about: str = ""
) -> None:
    """Raise `error` with the nearest known names unless a name is in `known`; `about` precedes the message."""
    if not isinstance(name, str) or name not in known:
        raise error(about + unknown(kind, str(name), known))


def unknown(kind: str, name: str, known: Iterable[str]) -> str:
    """Return the message for an unknown name, with the nearest known names or, if none is near, the first known names."""
    names, name = sorted(known), str(name)
    name = name if len(name) <= LONGEST_NAME else f"{name[:LONGEST_NAME]}..."
    if not names:
        return f"unknown {kind} '{name}': there is none here"
    meant = OTHER_WORDS.get(name.rpartition(".")[2].casefold(), "").split()
    near = [candidate for candidate in names if candidate.rpartition(".")[2] in meant]
    if not near:
        plain = {candidate.casefold().lstrip("-"): candidate for candidate in reversed(names)}
        cutoff = 0.6 if name.startswith("-") else 0.5  # options are many
        near = [plain[key] for key in difflib.get_close_matches(name.casefold().lstrip("-"), plain, n=3, cutoff=cutoff)]
    if near:
        return f"unknown {kind} '{name}': did you mean " + " or ".join(f"'{candidate}'" for candidate in near) + "?"
    shown = ", ".join(names[:SHOWN]) + (f", ... ({len(names)} in all)" if len(names) > SHOWN else "")
    return f"unknown {kind} '{name}': known are {shown}"
