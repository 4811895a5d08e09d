"""Covering arrays: of a product of parameters, the cases that contain every pair of values; the others are slow.

Almost all faults show with one or two parameters (Kuhn, Wallace and Gallo, IEEE Trans. Software Eng. 30, 2004). A test
with the mark `pairwise` runs a covering array of its cases by default, all of them with ``-m ''``. A test with the mark
`each_value` takes so many that each value of each parameter is there once: for what costs more, where another test holds the
pairs (those of elements and formulations: `test_every_solver` and the patch tests).
"""

from collections import defaultdict
from collections.abc import Sequence
from itertools import combinations
from typing import Any

import pytest


def first_of(count: int, cases: Sequence[Any]) -> list[Any]:
    """Return the cases of one parameter, or of several in tuples, those after the first `count` marked as slow."""
    rest = (pytest.param(*(c if isinstance(c, tuple) else (c,)), marks=pytest.mark.slow) for c in cases[count:])
    return [*cases[:count], *rest]


def covering(cases: list[dict[str, str]], strength: int = 2) -> list[int]:
    """Return the numbers of cases, parameters by name, that hold every pair of values there is: greedily, in their order.

    >>> covering([{"a": a, "b": b, "c": c} for a in "01" for b in "01" for c in "01"])
    [0, 3, 5, 6]
    >>> covering([{"a": a, "b": b, "c": c} for a in "01" for b in "01" for c in "01"], strength=1)
    [0, 7]
    """
    pairs = [set(combinations(sorted(case.items()), strength)) for case in cases]
    left, chosen = set().union(*pairs), []
    while left:
        best = max(range(len(cases)), key=lambda k: len(pairs[k] & left))
        left -= pairs[best]
        chosen.append(best)
    return sorted(chosen)


def mark_the_rest(items: list[pytest.Item]) -> None:
    """Mark as slow what is beyond the covering array of each test that asks for one."""
    by_test = defaultdict(list)
    for item in items:
        chosen = item.get_closest_marker("pairwise") or item.get_closest_marker("each_value")
        if chosen and hasattr(item, "callspec") and not item.get_closest_marker("slow"):
            by_test[item.nodeid.partition("[")[0]].append(item)
    for members in by_test.values():
        cases = [{name: repr(value) for name, value in item.callspec.params.items()} for item in members]
        strength = 1 if members[0].get_closest_marker("each_value") else 2
        kept = set(covering(cases, strength)) if len(cases[0]) > 1 else set(range(len(cases)))
        for number, item in enumerate(members):
            if number not in kept:
                item.add_marker(pytest.mark.slow)
