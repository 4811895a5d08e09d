"""Tables of text for terminals, and the format of their numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence

Rows = list[list[str]]


def number(value: float, digits: int = 6) -> str:
    """Return a number as text, or a dash for NaN and infinity."""
    return f"{value:.{digits}g}" if math.isfinite(value) else "-"


def percent(value: float | None, uncertainty: float | None = None) -> str:
    """Return a relative difference as a signed percentage, or a dash for None, NaN and infinity.

    The percentage has three decimals, or four if the relative `uncertainty` is positive and below 1e-5.

    Examples
    --------
    >>> percent(0.04005, 0.00003), percent(0.5)
    ('+4.005 %', '+50.000 %')
    """
    if value is None or not math.isfinite(value):
        return "-"
    return f"{100 * value:+.{4 if uncertainty is not None and 0 < uncertainty < 1e-5 else 3}f} %"


def by_columns(columns: Sequence[tuple[str, Sequence[str]]]) -> Rows:
    """Return the rows of a table whose columns are given as headers and strings; the first row contains the headers."""
    return [[name for name, _ in columns], *map(list, zip(*(texts for _, texts in columns), strict=True))]


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows of strings as lines with right-aligned columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  " + "  ".join(text.rjust(width) for text, width in zip(row, widths, strict=True)) for row in rows]
