"""Keys of case files and the types of their values, and checks of tables against them."""

from __future__ import annotations

import contextlib
import inspect
import re
import reprlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from fastcontact.analysis.criteria import Criteria
from fastcontact.errors import CaseError, FastcontactError, unknown

NUMBER = (int, float)
# Message of `fastcontact._tools.argument_types` about an argument of a wrong type.
_ARGUMENT = re.compile(r"the argument (?P<key>\w+) of [\w.]+ must be (?P<kinds>.*), not (?P<given>.*)")
# Words for types in messages about arguments, and the corresponding words for values in TOML.
_TOML_WORDS = {
    "a sequence of": "a list of",
    "an array of": "a list of",
    "sequences of two": "pairs",
    "a dictionary": "a table",
    "True or False": "true or false",
    **dict.fromkeys((" or a function", " or None"), ""),
}


def kinds_of(function: Callable[..., Any]) -> dict[str, Any]:
    """Return the arguments of a function as keys of a table: with the type bool if they are Boolean, otherwise with None.

    Functions check the types of their arguments, but admit the numbers 0 and 1 as Boolean arguments.
    """
    annotations = {key: str(p.annotation) for key, p in inspect.signature(function).parameters.items()}
    return {key: bool if text in ("bool", "bool | None") else None for key, text in annotations.items()}


# Keys of the tables of a case file, with the TOML types of their values.
UNITS = {"length": str, "force": str, "pressure": str}
RAMP = {"steps": int, "end": NUMBER, "instants": list, "table": list}
SOLVE: dict[str, Any] = {"linear_solver": str, "linear_tolerance": NUMBER, **kinds_of(Criteria)}
# Keys of a rigid surface that consists of the facets of a group, in a file or in the mesh of the model.
SURFACE = {"file": str, "group": str, "flip": bool, "crease": NUMBER}
SENSITIVITY: dict[str, Any] = {"quantity": list, "by": list}
FIELD: dict[str, Any] = {"file": str, "field": str, "over": str, "instant": NUMBER}
# Settings of studies of the case, which `fastcontact.studies.settings` reads.
STUDY: dict[str, Any] = {
    "generator": str,
    "contact": str,
    "load_steps": int,
    **dict.fromkeys(("halve", "double", "curves", "combinations", "quantities"), list),
    **dict.fromkeys(("triangles", "quadrangles", "options", "parameters"), dict),
}
# Types of the entries of lists and tables in ``[study]``, and their description in messages.
STUDY_ENTRIES: dict[str, tuple[Any, str]] = {
    **dict.fromkeys(("halve", "double"), (str, 'the name of an argument, such as "size"')),
    "quantities": (str, 'the name of a quantity, such as "PROBE.stress.yy"'),
    "combinations": ((str, list), 'an element and a formulation, such as "quad8 mortar"'),
    "options": (dict, "a table of options of a formulation"),
    "parameters": (dict, 'a table of expressions by path, { "material[0].E" = "value" }'),
}
MODES: dict[str, Any] = {"n": int, "stress_stiffening": bool, "hold_sliding": bool, "nodal_diameters": (int, str, list)}
TOP_LEVEL: dict[str, Any] = {
    "title": str,
    "kinematics": str,
    "strain": str,
    "reference_temperature": NUMBER,
    "contact": (dict, str),
    "units": (dict, str),
    **dict.fromkeys(("mesh", "contacts", "obstacle", "ramp", "solve", "probes", "theory", "study", "modes"), dict),
    **dict.fromkeys(("check", "sensitivity"), list),
}


def check_keys(where: str, data: Any, known: Mapping[str, Any], required: Iterable[str] = ()) -> None:
    """Raise CaseError unless `data` is a table with all `required` keys and no keys other than those in `known`.

    The values must have the types in `known`; the type None admits any value. In messages, the table is called `where`, which
    is empty for the whole file.
    """
    if not isinstance(data, dict):
        raise CaseError(f"'{where}' must be a table of keys, not {reprlib.repr(data)}")
    for key, value in data.items():
        label = f"{where}.{key}" if where else key
        if key == "thickness" and key not in known:
            raise CaseError(
                f"unknown key '{label}': forces of plane models are per unit thickness; divide by the thickness"
            )
        if key not in known:
            raise CaseError(unknown("key", label, [f"{where}.{k}" if where else k for k in known]))
        check_kind(label, value, known[key])
    for key in required:
        if key not in data:
            raise CaseError(f"{where} needs '{key}'")


def check_kind(label: str, value: Any, kind: Any) -> None:
    """Raise CaseError unless the value of a key has the type or one of the types `kind`; None admits any value."""
    kinds = kind if isinstance(kind, tuple | None) else (kind,)
    if kinds is None or (isinstance(value, kinds) and (bool in kinds or not isinstance(value, bool))):
        return
    if kinds == (list,) and isinstance(value, dict):
        raise CaseError(f"there may be several of '{label}': write [[{label}]] in place of [{label}]")
    if dict in kinds and isinstance(value, list) and any(isinstance(entry, dict) for entry in value):
        name = ".NAME" if label in ("contact", "obstacle") else ""
        raise CaseError(f"write [{label}{name}] in place of [[{label}]]")
    names = "true or false" if kinds == (bool,) else "of type " + " or ".join(kind.__name__ for kind in kinds)
    raise CaseError(f"the value of '{label}' must be {names}, not {reprlib.repr(value)}")


def check_settings(data: Mapping[str, Any]) -> None:
    """Raise CaseError if a table of settings, such as ``[study]``, has an unknown key or an invalid value."""
    for key, known in (("study", STUDY), ("units", UNITS), ("solve", SOLVE), ("modes", MODES)):
        if not (key == "units" and isinstance(data.get(key), str)):
            check_keys(key, data.get(key, {}), known)
    if data.get("modes", {}).get("n", 1) < 1:
        raise CaseError(f"modes.n = {data['modes']['n']}: request one mode or more")
    diameters = data.get("modes", {}).get("nodal_diameters", "all")
    invalid = isinstance(diameters, list) and any(type(d) is not int or d < 0 for d in diameters)
    if invalid or (isinstance(diameters, str) and diameters != "all"):
        raise CaseError(f'modes.nodal_diameters = {diameters!r}: write "all", or non-negative whole numbers')
    for key, (kind, form) in STUDY_ENTRIES.items():
        entries = data.get("study", {}).get(key, ())
        for index, entry in entries.items() if isinstance(entries, dict) else enumerate(entries):
            if not isinstance(entry, kind):
                where = f"study.{key}.{index}" if isinstance(entries, dict) else f"study.{key}[{index}]"
                raise CaseError(f"'{where}' must be {form}, not {entry!r}")


def call_with_keys(where: str, function: Callable[..., Any], arguments: dict[str, Any]) -> Any:
    """Return the result of `function` with the keys of the table `where` of a case file as arguments.

    Raises CaseError if a key is unknown or missing, or if the function rejects the type or the value of a key.
    """
    parameters = inspect.signature(function).parameters
    check_keys(where, arguments, kinds_of(function))
    if missing := [key for key, p in parameters.items() if p.default is p.empty and key not in arguments]:
        raise CaseError(f"'{where}' needs {' and '.join(repr(key) for key in missing)}")
    try:
        return function(**arguments)
    except (TypeError, ValueError) as error:
        values = ", ".join(f"{key} = {reprlib.repr(value)}" for key, value in arguments.items())
        raise CaseError(f"'{where}': {values} are invalid ({error})") from error
    except FastcontactError as error:
        raise CaseError(_message_about_key(where, str(error)) or f"'{where}': {error}") from error


@contextlib.contextmanager
def errors_at(where: str) -> Iterator[None]:
    """Prefix the messages of errors raised in a ``with`` block with `where`, the table of the case file that causes them."""
    try:
        yield
    except CaseError:
        raise
    except FastcontactError as error:
        if where.replace(".", " '", 1) + "'" in str(error):  # the message names the table
            raise
        if message := _message_about_key(where, str(error)):
            raise CaseError(message) from error
        raise type(error)(f"{where}: {error}") from error


def _message_about_key(where: str, text: str) -> str:
    """Return a message about an argument of a function as a message about a key, or an empty string for other messages."""
    match = _ARGUMENT.fullmatch(text)
    if match is None:
        return ""
    kinds = match["kinds"]
    for python, toml in _TOML_WORDS.items():
        kinds = kinds.replace(python, toml)
    return f"the value of '{where}.{match['key']}' must be {kinds}, not {match['given']}"


def list_of_tables(where: str, entries: Any) -> list[dict[str, Any]]:
    """Return `entries`. Raises CaseError if they are not a list of tables, such as ``[[where]]`` in a case file."""
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise CaseError(f"'{where}' must be a list of tables: write [[{where}]] above each")
    return entries
