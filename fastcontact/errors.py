"""Exceptions and warnings of fastcontact, and error messages that suggest similar names for unknown ones."""

from __future__ import annotations

import difflib
import os
import re
import sys
import warnings
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

MAX_LENGTH = 1500  # largest number of characters of a message
# NumPy scalars in the representation of a list, dictionary or other object, such as np.float64(0.5) and np.True_.
NUMPY_SCALAR = re.compile(r"\bnp\.(?:(?:float|int|uint|complex|str)\d*_?\(([^()]*)\)|(True|False)_)")


def printable(text: str) -> str:
    """Return a string with NumPy scalars as plain numbers, and escapes for control characters, except line ends and tabs."""
    text = NUMPY_SCALAR.sub(lambda scalar: scalar[1] or scalar[2] or "", text)
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text)


class FastcontactError(Exception):
    """Base class of the errors that fastcontact raises, whose messages consist of one line."""

    def __str__(self) -> str:
        # Names and values from files may contain newlines, control characters and thousands of characters.
        text = printable(" ".join(super().__str__().splitlines()))
        return text if len(text) <= MAX_LENGTH else f"{text[: MAX_LENGTH // 2]} ... {text[-MAX_LENGTH // 3 :]}"


class MeshError(FastcontactError):
    """A mesh is invalid, for example because of an inverted cell or a missing group."""


class ModelError(FastcontactError):
    """A model, a part of it (such as a material or a load) or an argument is incomplete, invalid or contradictory."""


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
        Residual, number of active constraints and change of the displacement in each iteration of the failed step.
    smaller_steps_help : bool
        True if smaller load steps may converge.
    """

    def __init__(
        self, message: str, history: Sequence[Mapping[str, Any]] = (), *, smaller_steps_help: bool = True
    ) -> None:
        super().__init__(message)
        self.history = [dict(entry) for entry in history]
        self.smaller_steps_help = smaller_steps_help


class FastcontactWarning(UserWarning):
    """A model or a result is doubtful, for a reason that the message quantifies."""

    def __str__(self) -> str:
        return printable(super().__str__())


@contextmanager
def in_file(path: str | os.PathLike[str]) -> Iterator[None]:
    """Prefix the messages of errors in a ``with`` block with a file name, unless they contain the name.

    A ConvergenceError is unchanged.
    """
    try:
        yield
    except FastcontactError as error:
        if isinstance(error, ConvergenceError) or str(path) in str(error):
            raise
        raise type(error)(f"{path}: {error}") from error


def warn(text: str) -> None:
    """Issue a FastcontactWarning, attributed to the line of the user's code that called the package."""
    package = os.path.dirname(__file__) + os.sep
    level, frame = 2, sys._getframe(1)
    while frame.f_back is not None and frame.f_code.co_filename.startswith(package):
        level, frame = level + 1, frame.f_back
    warnings.warn(text, FastcontactWarning, stacklevel=level)


MAX_NAME_LENGTH = 120  # largest number of characters of an unknown name in a message
MAX_LISTED = 20  # largest number of known names in the message about an unknown one
# Smallest similarity ratio (difflib) of a name that is suggested; that of "loads" and "nodes" is 0.6.
SIMILARITY = 0.65
# Words that users may know from other programs or from other parts of fastcontact, with the corresponding names in
# fastcontact, separated by spaces.
OTHER_WORDS = {
    "slave": "secondary", "master": "primary", "mu": "friction", "interference": "clearance", "gap": "clearance",
    "h": "coefficient", "k": "coefficient", "plane": "half_space", "circle": "sphere", "ball": "sphere",
    "fix": "support", "prescribe": "support", "relate": "relation", "relate_groups": "group_relation",
    "alpha": "expansion", "rho": "density", "sigma_y": "yield_stress", "nlgeom": "strain", "large": "finite",
    "2d": "plane_strain plane_stress axisymmetric", "steps": "ramp", "n_steps": "ramp", "load_steps": "ramp",
    "hertz": "hertz_point", "hertz_sphere": "hertz_point", "hertz_cylinder": "hertz_line",
    "lame": "thick_cylinder thick_sphere press_fit_cylinders", "sphere": "sphere_octant sphere_on_block half_spheres",
    "material": "linear_elastic", "steel": "linear_elastic", "young": "E", "poisson": "nu", "rectangle": "block",
    "youngs_modulus": "E", "poisson_ratio": "nu", "friction_coefficient": "friction",
    "cylinder": "rings", "rotate": "transformed", "rotated": "transformed", "scale": "transformed", "scaled": "transformed",
    "u": "displacement", "time": "load_factor", "forces": "reaction", "traction": "shear", "nodes": "points",
    "elements": "cells", "groups": "group_names", "status": "active", "add_load": "add_force", "add_bolt": "add_pretension",
    "plastic_strain": "cell_fields", "work": "dissipation", "save": "result_writer", "to_vtk": "result_writer",
    "archard": "wear", "add_preload": "add_pretension", "add_displacement": "prescribe", "add_symmetry": "fix",
    "add_friction": "add_contact", "boundary": "support", "load": "pressure force traction",
    "loads": "pressure force traction", "solve": "run", "study": "converge sweep", "convert": "export",
    "show": "info plot", "view": "plot", "examples": "cases", "list": "cases", "restart": "resume", "cores": "threads",
    "nproc": "threads", "constraint": "support", "displacement": "support motion", "boundary_condition": "support",
    "interaction": "contact", "friction": "contact", "preload": "pretension", "bolt": "pretension",
    "p_max": "pressure_max", "radius": "R", "wear_depth": "wear",
    "tangential_force": "force_parts", "add_support": "fix prescribe", "add_mpc": "relate",
}  # fmt: skip


def nearest(name: str, known: Collection[str]) -> list[str]:
    """Return the known names that `name` may stand for, according to `OTHER_WORDS`, or up to three similar ones.

    A prefix that all names share, such as "support[1].", is ignored.
    """
    prefix = name[: name.rfind(".") + 1]
    start = len(prefix) if all(candidate.startswith(prefix) for candidate in known) else 0
    by_key = {candidate[start:].lstrip("-"): candidate for candidate in reversed([*known])}
    folded = {key.casefold(): candidate for key, candidate in by_key.items()}
    name = name[start:].lstrip("-")
    synonyms = OTHER_WORDS.get(name.rpartition(".")[2].casefold(), "").casefold().replace("_", "").split()
    without_underscores = {key.replace("_", ""): candidate for key, candidate in reversed(folded.items())}
    similar = [candidate for key, candidate in without_underscores.items() if key.rpartition(".")[2] in synonyms]
    similar = similar or [by_key[key] for key in difflib.get_close_matches(name, by_key, n=3, cutoff=SIMILARITY)]
    name = name.casefold()
    similar = similar or [folded[key] for key in difflib.get_close_matches(name, folded, n=3, cutoff=SIMILARITY)]
    return similar or [folded[key] for key in reversed(folded) if len(name) > 2 and name in key][:3]


def attribute_error(owner: str, name: str, known: Collection[str]) -> AttributeError:
    """Return the AttributeError for a missing attribute, with similar known names; `owner` is a text like "module 'x'"."""
    text = f"{owner} has no attribute '{name}'"
    public = {"fastcontact": "fastcontact", "fastcontact.mesh.generate": "fastcontact.generate"}
    owners = [public[module] for module in public if name in getattr(sys.modules.get(module), "__all__", ())]
    if owners:
        text += f": use {owners[0]}.{name}"
    elif similar := nearest(name, known):
        text += ": did you mean " + " or ".join(map(repr, similar)) + "?"
    return AttributeError(text, name=name)  # without `obj`, Python adds no suggestion


class NameSuggestions:
    """Base class of objects whose AttributeError for a missing attribute suggests similar names."""

    if not TYPE_CHECKING:  # hidden from type checkers, which report unknown names themselves

        def __getattr__(self, name: str) -> object:
            # Tools such as IPython look up private names. An attribute of the class is missing only if its property has
            # raised an AttributeError, which the second lookup raises again.
            if name.startswith("_") or hasattr(type(self), name):
                return object.__getattribute__(self, name)
            public = [attribute for attribute in dir(self) if not attribute.startswith("_")]
            raise attribute_error(f"'{type(self).__name__}' object", name, public)


def getattr_and_dir(module: str, known: list[str]) -> tuple[Callable[[str], object], Callable[[], list[str]]]:
    """Return ``__getattr__`` and ``__dir__`` for the module called `module` with the public names `known`."""

    def attribute(name: str) -> object:
        raise AttributeError(name) if name.startswith("_") else attribute_error(f"module '{module}'", name, known)

    return attribute, lambda: known


def check_known(
    kind: str, name: object, known: Collection[str], error: type[FastcontactError], prefix: str = ""
) -> None:
    """Raise `error`, with similar known names, unless `name` is in `known`; `prefix` precedes the message."""
    if not isinstance(name, str) or name not in known:
        raise error(prefix + unknown(kind, str(name), known))


def unknown(kind: str, name: str, known: Iterable[str]) -> str:
    """Return the message about an unknown name, with similar known names or, if there are none, the first known names."""
    names, name = sorted(known), str(name)
    name = name if len(name) <= MAX_NAME_LENGTH else f"{name[:MAX_NAME_LENGTH]}..."
    if not names:
        return f"unknown {kind} '{name}': none is defined"
    if similar := nearest(name, names):
        return f"unknown {kind} '{name}': did you mean " + " or ".join(f"'{candidate}'" for candidate in similar) + "?"
    listed = ", ".join(names[:MAX_LISTED]) + (f", ... ({len(names)} in all)" if len(names) > MAX_LISTED else "")
    return f"unknown {kind} '{name}': expected one of {listed}"
