"""Tables of texts as HTML, which notebooks show in the place of a repr."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence


def html_table(rows: Iterable[Sequence[object]], head: Sequence[object] = (), caption: str = "") -> str:
    """Return rows as an HTML table; what they hold is text, whatever characters are in it."""
    above = f"<caption style='text-align:left'>{html.escape(caption)}</caption>" if caption else ""
    top = f"<thead>{_row(head, 'th')}</thead>" if head else ""
    body = "".join(_row(cells, "td") for cells in rows)
    return f"<table>{above}{top}<tbody>{body}</tbody></table>"


def _row(cells: Sequence[object], tag: str) -> str:
    inside = "".join(f"<{tag} style='text-align:left'>{html.escape(str(cell))}</{tag}>" for cell in cells)
    return f"<tr>{inside}</tr>"
