"""A study as one HTML page that holds everything, pictures too, and needs nothing from outside."""

from __future__ import annotations

import base64
import html
import io
import math
from collections.abc import Sequence
from typing import Any

from fastcontact.cases.summary import versions
from fastcontact.studies import pictures
from fastcontact.studies.fit import CONFIDENCE, Limit
from fastcontact.studies.labels import SPOKEN, percent, sentences
from fastcontact.studies.quantities import title, unit
from fastcontact.studies.study import Series, Study
from fastcontact.studies.text import SHOWN, level_rows, number

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


def html_report(study: Study) -> str:
    """Return the page."""
    parts = [_said(text) for text in sentences(study.best)]
    if len(study.series) > 1:
        parts += ["<h2>All combinations</h2>", "<p class='say'>Limits with error bars, held against theory.</p>"]
        parts += [table_html(rows, caption) for caption, rows in _comparisons(study)]
    parts += ["<h2>Pictures</h2>", *_pictures(study)]
    for series in study.series:
        parts += _of_series(series, study)
    parts += [_failed(f"{name} failed: {text}") for name, text in study.failed.items()]
    parts += ["<h2>How to read this</h2>", *(f"<p class='say'>{text}</p>" for text in _explanations())]
    if study.text:
        parts += ["<h2>The case</h2>", f"<pre>{html.escape(study.text)}</pre>"]
    made = ", ".join(f"{name} {version}" for name, version in versions().items())
    parts.append(f"<footer>Made with {html.escape(made)}.</footer>")
    return page(f"Mesh convergence: {study.title}", parts)


def page(heading: str, parts: Sequence[str]) -> str:
    """Return a whole page with a heading and parts that are HTML already."""
    return (
        "<!DOCTYPE html>\n<html lang='en'><head><meta charset='utf-8'>"
        "<meta name='viewport' content='width=device-width, initial-scale=1'>"
        f"<title>{html.escape(heading)}</title><style>{STYLE}</style></head>\n<body>\n<h1>{html.escape(heading)}</h1>\n"
        + "\n".join(parts)
        + "\n</body></html>\n"
    )


def _said(text: str) -> str:
    return f"<p class='say'>{_text(text)}</p>"


def _failed(text: str) -> str:
    return f"<p class='failed'>{html.escape(text)}</p>"


def table_html(rows: Sequence[Sequence[str]], caption: str = "") -> str:
    """Return rows of texts as a table, the first row a header."""

    def row(cells: Sequence[str], tag: str) -> str:
        inside = "".join(f"<{tag}>{_text(cell)}</{tag}>" for cell in cells)
        return f"<tr>{inside}</tr>"

    body = "".join(row(cells, "td") for cells in rows[1:])
    said = f"<caption>{_text(caption)}</caption>" if caption else ""
    return f"<div class='wide'><table>{said}<thead>{row(rows[0], 'th')}</thead><tbody>{body}</tbody></table></div>"


def _text(text: str) -> str:
    return html.escape(text).replace("+-", "&plusmn;")


def with_error_bar(limit: Limit) -> str:
    """Return a limit with its error bar, both rounded to the two leading digits of the latter.

    Examples
    --------
    >>> with_error_bar(Limit(2908.1012, 28.7, 2.0, 0.5, 5, True))
    '2908 +- 29'
    """
    bar = limit.uncertainty
    if not (math.isfinite(bar) and bar > 0):
        return number(limit.value, 8)
    digits = 1 - math.floor(math.log10(bar))
    if abs(digits) > 12:
        return f"{number(limit.value, 8)} +- {number(bar, 2)}"
    places = max(digits, 0)
    return f"{round(limit.value, digits):.{places}f} +- {round(bar, digits):.{places}f}"


def _comparisons(study: Study) -> list[tuple[str, list[list[str]]]]:
    """Return, for each quantity that is worth a sentence, a caption and rows: one for each combination."""
    found = []
    for name in (name for name in SPOKEN if name in study.best.quantities):
        rows = [
            ["combination", "levels", "finest DOF", "limit", "order", "mesh error", "model error", "at equal force"]
        ]
        for series in study.series:
            start = [str(series.combination), str(len(series.levels)), str(series.finest.n_dofs)]
            rows.append([*start, *_limit_cells(series, name)])
        found.append((_named(name, study.units), rows))
    return found


def _named(quantity: str, units: dict[str, str]) -> str:
    kind = unit(quantity, units)
    return f"{title(quantity)} [{kind}]" if kind else title(quantity)


def _limit_cells(series: Series, quantity: str) -> list[str]:
    """Return limit, order, mesh error, and model error at equal approach and at equal force of a quantity."""
    limit, found = series.limits.get(quantity), series.split(quantity)
    if limit is None:
        return ["-"] * 5
    same = series.split_equal_force(quantity) if quantity != "force" else None
    mesh = found.mesh if found else series.errors(quantity)[-1]
    order = f"{limit.order:.2f} +- {limit.order_uncertainty:.2f}" if math.isfinite(limit.order) else "-"
    model = [percent(entry.model) if entry else "-" for entry in (found, same)]
    return [with_error_bar(limit), order, percent(mesh) if math.isfinite(mesh) else "-", *model]


def _limits(series: Series, units: dict[str, str]) -> list[list[str]]:
    """Return header and rows of theory, limit, order and errors of every quantity that has a limit."""
    rows = [["quantity", "theory", "limit", "order", "mesh error", "model error", "at equal force"]]
    for name in series.quantities:
        if name in series.limits:
            theory = number(series.theory.get(name, math.nan), 8)
            rows.append([_named(name, units), theory, *_limit_cells(series, name)])
    return rows


def image(figure: Any, words: str) -> str:
    """Return a figure as an image element that holds the picture."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    data = base64.b64encode(buffer.getvalue()).decode("ascii")
    return f"<p><img alt='{html.escape(words, quote=True)}' src='data:image/png;base64,{data}'></p>"


def _pictures(study: Study) -> list[str]:
    found = [image(pictures.error_figure(study), "mesh errors over the mesh size, doubly logarithmic")]
    differences = pictures.theory_figure(study)
    if differences is not None:
        found.append(image(differences, "difference from theory over the mesh size: model and mesh error"))
    if study.best.finest.profile:
        found.append(image(pictures.profile_figure(study), "contact pressure of all levels over theory"))
    return found


def _of_series(series: Series, study: Study) -> list[str]:
    parts = [f"<h2>{html.escape(str(series.combination))}</h2>"]
    main = [name for name in SHOWN if name in series.quantities]
    for start in range(0, len(main), 2):
        parts.append(table_html(level_rows(series, study.units, main[start : start + 2])))
    rows = _limits(series, study.units)
    if len(rows) > 1:
        parts.append(table_html(rows))
    parts += [_failed(f"level {number} failed: {text}") for number, text in series.failed.items()]
    warned = sorted({text for level in series.levels for text in level.warnings})
    parts += [f"<p class='say'>Warning: {html.escape(text)}</p>" for text in warned]
    return parts


def _explanations() -> list[str]:
    return [
        "The <em>limit</em> is what the values tend to on ever finer meshes, from a fit of value = limit + C "
        f"h<sup>order</sup>; it lies within the error bar with a probability of {CONFIDENCE:.0%}. Orders from one level "
        "to the next are erratic, because the edge of the contact cuts another facet each time: judge by the fitted order.",
        "The <em>mesh error</em> is the finest mesh's difference from the limit; a finer mesh makes it smaller. The "
        "<em>model error</em> is the limit's difference from theory; it stays on every mesh, because theory and model "
        "are about different bodies. Both are relative to the theory and sum up to the whole difference.",
        "<em>Equal approach</em> compares at the same displacement, <em>equal force</em> at the same contact force.",
    ]
