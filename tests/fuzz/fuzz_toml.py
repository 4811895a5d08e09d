"""Damage to case files that remain valid TOML: other values and types, missing and additional keys."""

import copy
import json
import tomllib
from typing import Any

import numpy as np

from fastcontact._tools.toml_text import dump

WILD = [
    0, -1, 2**31, 2**63 - 1, 10**18, True, False, float("nan"), float("inf"), 1e308, 5e-324, -0.0, 1e-12, 1.5,
    "", "x", "../..", "/etc/hostname", "\x00", "é" * 50, "a" * 5000, "../outside/bait.h5", [], [1], [[]], [[1, 2], [3]],
    ["x", 2], {}, {"x": 1}, {"kind": "sphere"}, [{"group": "CONT1"}], 1000, "CONT1", "mortar", "amg", [0.0] * 300,
]  # fmt: skip
KEYS = [
    "x", "y", "group", "kind", "", "é", "ramp", "formulation", "friction", "penalty", "self", "model", "mesh", "shape",
    "__class__",
]  # fmt: skip


def damaged(text: str, random: np.random.Generator) -> str:
    """Return a case with some of its entries changed."""
    data = tomllib.loads(text)
    for _ in range(1 + int(random.integers(3))):
        places = list(_places(data))
        holder, key = places[int(random.integers(len(places)))]
        kind = random.random()
        if kind < 0.6:
            holder[key] = _wild(random)
        elif kind < 0.75:
            del holder[key]
        elif kind < 0.9:
            other, name = places[int(random.integers(len(places)))]
            holder[key] = json.loads(json.dumps(other[name])) if name in range(10**6) or name in other else 0
        elif isinstance(holder, dict):
            holder[KEYS[int(random.integers(len(KEYS)))]] = _wild(random)
    return dump(data)


def _wild(random: np.random.Generator) -> Any:
    return copy.deepcopy(WILD[int(random.integers(len(WILD)))])


def _places(data: Any) -> Any:
    items = data.items() if isinstance(data, dict) else enumerate(data) if isinstance(data, list) else ()
    for key, value in list(items):
        yield data, key
        yield from _places(value)
