"""Substitution of values in a parsed case file by path, such as ``support[1].y`` or ``theory.hertz.approach``."""

from __future__ import annotations

import copy
import re
from collections.abc import Iterable, Mapping
from typing import Any

from fastcontact.errors import CaseError, unknown
from fastcontact.model.pair_options import SHARED_OPTIONS

# Keys outside tables that change results, each with a single value.
SCALARS = ("kinematics", "reference_temperature", "strain")
# A part of a path: a key and the indices that follow it in brackets.
_PATH_PART = re.compile(r"([^.\[\]]+)((?:\[\d{1,9}\])*)$")
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
# A law "a*value^p", whose groups are the numbers a and p.
_LAW = re.compile(rf"\s*(?:({_NUMBER})\s*\*\s*)?value(?:\s*\^\s*({_NUMBER}))?\s*$")


def substitute(data: Mapping[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return a copy of a parsed case file with new values of parameters.

    A parameter is a path, or a name in the table ``[study.parameters]``. A name sets several paths, each by a law
    ``"a*value^p"``. Raises CaseError if a path or a name does not exist, or if a law is invalid.
    """
    case: dict[str, Any] = copy.deepcopy(dict(data))
    linked = data.get("study", {}).get("parameters", {})
    for parameter, value in values.items():
        if parameter not in linked:
            _set_value(case, parameter, value, linked)
        for path, law in linked.get(parameter, {}).items():
            _set_value(case, path, law_value(law, value, f"study.parameters.{parameter}.'{path}'"), ())
    return case


def law_value(law: Any, value: Any, where: str) -> Any:
    """Return the value of a law ``"a*value^p"``.

    Raises CaseError, with the location `where`, if the law is invalid or cannot be applied to `value`.
    """
    match = _LAW.match(law) if isinstance(law, str) else None
    if match is None:
        raise CaseError(f"{where} = {law!r} must be 'value', 'a*value' or 'a*value^p' with numbers a and p")
    if match[1] is None and match[2] is None:
        return value
    if isinstance(value, str) or (match[2] is not None and value < 0):
        raise CaseError(f"{where} = '{law}' cannot be evaluated for {value!r}")
    try:
        return float(match[1] or 1.0) * float(value) ** float(match[2] or 1.0)
    except ArithmeticError:
        raise CaseError(f"{where} = '{law}' is too large a number for {value!r}") from None


def _set_value(data: dict[str, Any], path: str, value: Any, names: Iterable[str]) -> None:
    """Set the value at a path of a parsed case file; messages about unknown paths suggest one of `names`."""
    keys, kinds = _keys(path), [kind for kind in ("contact", "obstacle") if isinstance(data.get(kind), dict)]
    pairs = [f"{kind}.{name}" for kind in kinds for name in data[kind]]
    if pairs and path in ("friction", *SHARED_OPTIONS):
        raise CaseError(f"'{path}' belongs to a pair: write {' or '.join(f'{pair}.{path}' for pair in pairs)}")
    if len(keys) == 1 and path not in SCALARS:
        raise CaseError(unknown("parameter", path, [*names, *SCALARS]))
    entry: Any = data
    for key in keys[:-1]:
        entry = _member(entry, key, path)
    last: Any = keys[-1]
    if isinstance(last, int) or not isinstance(entry, dict):
        _member(entry, last, path)
    current = entry[last] if isinstance(entry, list) else entry.get(last)
    if isinstance(current, (dict, list)):
        example = f"{path}[0]" if isinstance(current, list) else f"{path}.{next(iter(current), 'KEY')}"
        raise CaseError(f"'{path}' is a table or a list of the case: name a single value in it, such as {example}")
    entry[last] = value


def _keys(path: str) -> list[str | int]:
    """Return the keys of tables and the indices of lists in a path; CaseError if it is not a path."""
    keys: list[str | int] = []
    for key in path.split("."):
        match = _PATH_PART.match(key)
        if match is None:
            raise CaseError(f"'{path}' is not a path in a case file: write for example support[1].y")
        keys.append(match[1])
        keys += [int(number) for number in re.findall(r"\d+", match[2])]
    return keys


def _member(entry: Any, key: str | int, path: str) -> Any:
    """Return the member of a table or a list; CaseError if it does not exist."""
    if isinstance(key, int):
        if not isinstance(entry, list) or key >= len(entry):
            count = len(entry) if isinstance(entry, list) else 0
            raise CaseError(f"'{path}' refers to entry [{key}], counted from [0], and the case has {count} there")
    elif isinstance(entry, list):
        raise CaseError(f"'{path}' needs the number of a table before '{key}', such as [0]")
    elif not isinstance(entry, dict) or key not in entry:
        raise CaseError(unknown(f"entry of the case in '{path}'", key, entry if isinstance(entry, dict) else ()))
    return entry[key]
