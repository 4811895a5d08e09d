"""Reading of TOML from untrusted sources in bounded time, and writing of TOML.

The number of parts of a dotted key is limited, because the time that `tomllib` takes is quadratic in this number.
"""

from __future__ import annotations

import json
import re
import tomllib
from typing import Any

MAX_CHARACTERS = 1 << 23  # largest number of characters of a text
MAX_PARTS = 50  # largest number of parts of a dotted key
# Possessive quantifiers and the lookbehind avoid backtracking, so that the search is linear in the text.
LONG_KEY = re.compile(rf"""(?<![\w-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){{{MAX_PARTS},}}""")


def parse(text: str) -> dict[str, Any]:
    """Return the data of a text in TOML format.

    Raises
    ------
    ValueError
        If the text is not TOML or longer than `MAX_CHARACTERS`, if tables are nested too deeply, or if a key has more than
        `MAX_PARTS` parts.
    """
    if len(text) > MAX_CHARACTERS:
        raise ValueError(f"it is larger than {MAX_CHARACTERS >> 20} MB")
    if match := LONG_KEY.search(text):
        line = text.count("\n", 0, match.start()) + 1
        raise ValueError(f"a key of more than {MAX_PARTS} parts in line {line}: no key is that long")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ValueError("tables or lists are nested too deeply") from None


def dump(data: Any) -> str:
    """Return data as a text that `parse` can read. Raises ValueError for data that TOML cannot represent."""
    return "".join(f"{_key(name)} = {_value(value)}\n" for name, value in data.items())


def _key(name: Any) -> str:
    """Return a key, in quotation marks if necessary."""
    if not isinstance(name, str):
        raise ValueError(f"the key {name!r} is not a string")
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _value(name)


def _value(value: Any) -> str:
    """Return a value in TOML format."""
    if hasattr(value, "tolist"):  # an array or a scalar of NumPy
        value = value.tolist()
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return repr(value)  # `repr` keeps all digits, and writes inf and nan as TOML does
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_key(name)} = {_value(entry)}" for name, entry in value.items()) + "}"
    raise ValueError(f"{type(value).__name__} is not a TOML type")
