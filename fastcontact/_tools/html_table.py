"""HTML tables, which notebooks show instead of a repr."""

from __future__ import annotations

import html
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields
from typing import Any

import numpy as np

# Length of the longest array whose numbers are shown.
SHOWN = 9


def html_table(
    rows: Iterable[Sequence[object]], head: Sequence[object] = (), caption: str = "", style: str = "text-align:left"
) -> str:
    """Return rows as an HTML table; their contents are escaped, and `style` applies to all cells."""
    style = f" style='{style}'" if style else ""

    def row(cells: Sequence[object], tag: str) -> str:
        return f"<tr>{''.join(f'<{tag}{style}>{html.escape(str(cell))}</{tag}>' for cell in cells)}</tr>"

    above = f"<caption{style}>{html.escape(caption)}</caption>" if caption else ""
    top = f"<thead>{row(head, 'th')}</thead>" if head else ""
    body = "".join(row(cells, "td") for cells in rows)
    return f"<table>{above}{top}<tbody>{body}</tbody></table>"


def fields_table(result: Any) -> str:
    """Return the fields and numeric properties of a dataclass as an HTML table; long arrays are shown by their range."""
    named = [member.name for member in fields(result) if member.repr]
    properties = [name for name, member in vars(type(result)).items() if isinstance(member, property)]
    rows = [(name.replace("_", " "), _text(getattr(result, name))) for name in [*named, *properties]]
    return html_table(rows, caption=type(result).__name__)


def _text(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{' '.join(map(str, key))}: {number:.6g}" for key, number in value.items())
    numbers = np.atleast_1d(value)
    if numbers.size > SHOWN:
        return f"{numbers.size} numbers, {numbers.min():.6g} to {numbers.max():.6g}"
    return ", ".join(f"{number:.6g}" for number in numbers.ravel())
