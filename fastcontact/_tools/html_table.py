"""HTML tables for notebooks and reports."""

from __future__ import annotations

import html
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

# Largest number of entries of an array that is shown in full.
MAX_ENTRIES = 9


def html_table(
    rows: Iterable[Sequence[object]], head: Sequence[object] = (), caption: str = "", style: str = "text-align:left"
) -> str:
    """Return rows as an HTML table, with an optional header row and caption.

    Texts are escaped, and `style` is the CSS of all cells.
    """
    style = f" style='{style}'" if style else ""

    def row(cells: Sequence[object], tag: str) -> str:
        return f"<tr>{''.join(f'<{tag}{style}>{html.escape(str(cell))}</{tag}>' for cell in cells)}</tr>"

    title = f"<caption{style}>{html.escape(caption)}</caption>" if caption else ""
    header = f"<thead>{row(head, 'th')}</thead>" if head else ""
    body = "".join(row(cells, "td") for cells in rows)
    return f"<table>{title}{header}<tbody>{body}</tbody></table>"


def fields_table(result: Any) -> str:
    """Return the fields and numeric properties of a dataclass as an HTML table; long arrays are shown by their range."""
    names = [member.name for member in fields(result) if member.repr]
    names += [name for name, member in vars(type(result)).items() if isinstance(member, property)]
    rows = [(name.replace("_", " "), _text(getattr(result, name))) for name in names]
    return html_table(rows, caption=type(result).__name__)


def _text(value: Any) -> str:
    """Return a number, an array or a mapping of numbers as text."""
    if isinstance(value, Mapping):
        return ", ".join(f"{' '.join(map(str, key))}: {number:.6g}" for key, number in value.items())
    numbers = np.atleast_1d(value)
    if numbers.size > MAX_ENTRIES:
        return f"{numbers.size} numbers, {numbers.min():.6g} to {numbers.max():.6g}"
    return ", ".join(f"{number:.6g}" for number in numbers.ravel())
