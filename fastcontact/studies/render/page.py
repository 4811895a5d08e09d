"""Self-contained HTML pages of paragraphs, tables and figures."""

from __future__ import annotations

import base64
import html
from collections.abc import Sequence
from typing import Any

from fastcontact._tools.html_table import html_table
from fastcontact._tools.versions import versions
from fastcontact.results.plot._axes import png

STYLE = """
body { font-family: system-ui, sans-serif; line-height: 1.45; color: #1b1b1b; background: #fff;
  max-width: 72rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.25rem; margin-top: 2.2rem; border-bottom: 1px solid #ccc; }
table { border-collapse: collapse; margin: 0.8rem 0; font-variant-numeric: tabular-nums; font-size: 0.9rem; }
th, td { padding: 0.25rem 0.6rem; text-align: right; border-bottom: 1px solid #ddd; white-space: nowrap; }
th { background: #f3f3f3; white-space: normal; vertical-align: bottom; }
th:first-child, td:first-child { text-align: left; white-space: normal; }
caption { text-align: left; font-weight: 600; padding: 0.4rem 0; }
.wide { overflow-x: auto; } img { max-width: 100%; height: auto; } p.say { max-width: 50rem; }
pre { background: #f6f6f6; padding: 0.8rem; overflow-x: auto; font-size: 0.85rem; }
.failed { color: #a00; } footer { margin-top: 2.5rem; color: #555; font-size: 0.85rem; }
"""


def page(heading: str, blocks: Sequence[str], case_text: str) -> str:
    """Return an HTML page with a heading, blocks of HTML, the text of the case, and the versions of the software."""
    blocks = list(blocks)
    if case_text:
        blocks += [section("The case"), f"<pre>{html.escape(case_text)}</pre>"]
    made = ", ".join(f"{name} {version}" for name, version in versions().items())
    blocks.append(f"<footer>Made with {html.escape(made)}.</footer>")
    return (
        "<!DOCTYPE html>\n<html lang='en'><head><meta charset='utf-8'>"
        "<meta name='viewport' content='width=device-width, initial-scale=1'>"
        f"<title>{html.escape(heading)}</title><style>{STYLE}</style></head>\n<body>\n<h1>{html.escape(heading)}</h1>\n"
        + "\n".join(blocks)
        + "\n</body></html>\n"
    )


def section(heading: str) -> str:
    """Return the heading of a section as HTML."""
    return f"<h2>{html.escape(heading)}</h2>"


def paragraph(text: str) -> str:
    """Return a string as an HTML paragraph."""
    return f"<p class='say'>{_signs(html.escape(text))}</p>"


def failure(text: str) -> str:
    """Return the reason of a failure as an HTML paragraph."""
    return f"<p class='failed'>{html.escape(text)}</p>"


def table(rows: Sequence[Sequence[str]], caption: str = "") -> str:
    """Return rows of strings as an HTML table; the first row is the header."""
    return f"<div class='wide'>{_signs(html_table(rows[1:], rows[0], caption, style=''))}</div>"


def image(figure: Any, description: str) -> str:
    """Return a Matplotlib figure as an HTML image with embedded data."""
    data = base64.b64encode(png(figure)).decode("ascii")
    return f"<p><img alt='{html.escape(description, quote=True)}' src='data:image/png;base64,{data}'></p>"


def _signs(text: str) -> str:
    return text.replace("+-", "&plusmn;")
