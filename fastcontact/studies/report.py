"""Reports of studies: text tables, figures with several panels, HTML pages, and the base class of results."""

from __future__ import annotations

import base64
import html
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from fastcontact._tools.grouping import grouped
from fastcontact._tools.html_table import html_table
from fastcontact._tools.versions import versions
from fastcontact.arrays import AnyArray
from fastcontact.cases.case import Case
from fastcontact.results.plot._axes import new_panels, png
from fastcontact.results.tables import data_frame, structured
from fastcontact.results.units import units_of_results
from fastcontact.studies.quantities import unit

if TYPE_CHECKING:
    import pandas

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


def to_rows(columns: Sequence[tuple[str, Sequence[str]]]) -> Rows:
    """Return the rows of a table from its columns, which are pairs of header and entries; the first row is the header."""
    return [[name for name, _ in columns], *map(list, zip(*(texts for _, texts in columns), strict=True))]


def align_columns(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows of strings as lines with right-aligned columns."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  " + "  ".join(text.rjust(width) for text, width in zip(row, widths, strict=True)) for row in rows]


MARKERS = "osD^v<>ph*"


def marker(index: int) -> str:
    """Return the marker of a curve, given its `index`, counted from 0."""
    return MARKERS[index % len(MARKERS)]


def panels(
    shape: tuple[int, int], size: tuple[float, float], title: str, widths: Sequence[float] | None = None, **style: Any
) -> Any:
    """Return the axes (rows, columns) of a new figure of `size` [inch]; `style` are options of its title.

    `widths` are the relative widths of the columns [-]; by default all columns have the same width.
    """
    axes = new_panels(*shape, size, 130, width_ratios=widths)
    axes[0, 0].figure.suptitle(title, **style)
    return axes


def show_message(ax: Any, text: str) -> None:
    """Show a message in place of axes that have no data."""
    ax.set_axis_off()
    ax.text(0.5, 0.5, text, ha="center", va="center", transform=ax.transAxes, wrap=True)


def format_axes(
    ax: Any,
    title: str,
    labels: tuple[str, str],
    *,
    scales: tuple[str, str] = ("linear", "linear"),
    grid: float = 0.4,
    title_size: float | str = "large",
    legend_size: float = 8,
) -> None:
    """Set the scales, the title, the labels and the grid of axes, and add a legend if curves have labels.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Axes with curves.
    title : str
        Title of the axes.
    labels : (str, str)
        Labels of the x axis and the y axis.
    scales : (str, str)
        Scales of the x axis and the y axis: ``"linear"``, ``"log"`` or ``"plain log"``, a logarithmic scale with decimal
        numbers instead of powers of ten.
    grid : float
        Opacity of the grid at major ticks [-]; there is no grid if it is 0.
    title_size, legend_size : float or str
        Font sizes, as defined by Matplotlib [point].
    """
    for axis, scale, setter in zip((ax.xaxis, ax.yaxis), scales, (ax.set_xscale, ax.set_yscale), strict=True):
        if scale != "linear":
            setter("log")
        if scale == "plain log":
            _label_with_decimals(axis)
    ax.set(xlabel=labels[0], ylabel=labels[1])
    ax.set_title(title, fontsize=title_size)
    if scales[1] == "linear":
        ax.ticklabel_format(axis="y", useOffset=False, scilimits=(-4, 7))
        low, high = ax.dataLim.intervaly
        if 0.0 <= high - low < 1e-6 * max(abs(low), abs(high)):  # differences are round-off
            ax.set_ylim(sorted((0.9 * low, 1.1 * low)))
    if grid:
        ax.grid(which="major", alpha=grid)
    if ax.get_legend_handles_labels()[0]:
        ax.legend(fontsize=legend_size)


def _label_with_decimals(axis: Any) -> None:
    """Label a logarithmic axis with a few decimal numbers instead of powers of ten."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = axis.get_data_interval()
    wide = low > 0 and high > 30.0 * low
    axis.set_major_locator(LogLocator(subs=(1.0,) if wide else (1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.10g}"))
    axis.set_minor_formatter(NullFormatter())


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
        blocks += ["<h2>The case</h2>", f"<pre>{html.escape(case_text)}</pre>"]
    software = ", ".join(f"{name} {version}" for name, version in versions().items())
    blocks.append(f"<footer>Made with {html.escape(software)}.</footer>")
    return (
        "<!DOCTYPE html>\n<html lang='en'><head><meta charset='utf-8'>"
        "<meta name='viewport' content='width=device-width, initial-scale=1'>"
        f"<title>{html.escape(heading)}</title><style>{STYLE}</style></head>\n<body>\n<h1>{html.escape(heading)}</h1>\n"
        + "\n".join(blocks)
        + "\n</body></html>\n"
    )


def paragraph(text: str) -> str:
    """Return a string as an HTML paragraph."""
    return f"<p class='say'>{_plus_minus_signs(html.escape(text))}</p>"


def table(rows: Sequence[Sequence[str]], caption: str = "") -> str:
    """Return rows of strings as an HTML table; the first row is the header."""
    return f"<div class='wide'>{_plus_minus_signs(html_table(rows[1:], rows[0], caption, style=''))}</div>"


def image(figure: Any, description: str) -> str:
    """Return a Matplotlib figure as an HTML image with embedded data."""
    data = base64.b64encode(png(figure)).decode("ascii")
    return f"<p><img alt='{html.escape(description, quote=True)}' src='data:image/png;base64,{data}'></p>"


def _plus_minus_signs(text: str) -> str:
    """Return HTML with plus-minus signs in place of ``+-``."""
    return text.replace("+-", "&plusmn;")


def report_fields(case: Case) -> dict[str, Any]:
    """Return the arguments of `Report` that describe a case."""
    units = units_of_results(case.units, case.model.kinematics)
    return {"name": case.name, "title": case.title, "text": case.text, "units": units}


@dataclass(frozen=True, eq=False, repr=False)
class Report:
    """The result of a study of a case or a function.

    Attributes
    ----------
    kind : str
        Name of the kind of study.
    picture : str
        Description of the figure, the alternative text of its image.
    explanations : tuple of str
        Explanations of the numbers, at the end of the report.
    name : str
        Name of the case file without suffix, or name of the function.
    title : str
        Title of the case, or first line of the docstring of the function.
    text : str
        Text of the case file, or source of the function.
    units : dict of str to str
        Names of the units of results; forces of plane models are per unit thickness.
    """

    kind: ClassVar[str]
    picture: ClassVar[str]
    explanations: ClassVar[tuple[str, ...]] = ()

    name: str
    title: str
    text: str
    units: dict[str, str]

    def tables(self) -> list[tuple[str, Rows]]:
        """Return pairs of a caption and the rows of a table, whose first row is the header."""
        raise NotImplementedError

    def figure(self) -> Any:
        """Return a Matplotlib figure of the results."""
        raise NotImplementedError

    def sentences(self) -> list[str]:
        """Return the conclusions as sentences."""
        return []

    def remarks(self) -> list[str]:
        """Return warnings and the reasons for failures."""
        return []

    def lines(self) -> list[str]:
        """Return the report as lines of text, as the command line prints it."""
        lines = [self.title]
        for caption, rows in self.tables():
            lines += ["", *filter(None, [caption]), *align_columns(rows)]
        lines += [f"  {text}" for text in self.remarks()]
        sentences = self.sentences()
        return [*lines, "", *sentences] if sentences else lines

    def html(self) -> str:
        """Return the report as a self-contained HTML page."""
        blocks = [*map(paragraph, self.sentences()), image(self.figure(), self.picture)]
        blocks += [table(rows, caption) for caption, rows in self.tables()]
        blocks += [f"<p class='failed'>{html.escape(text)}</p>" for text in self.remarks()]
        if self.explanations:
            blocks += ["<h2>How to read this</h2>", *map(paragraph, self.explanations)]
        return page(f"{self.kind}: {self.title}", blocks, self.text)

    def table(self) -> AnyArray:
        """Return the numbers as a structured array (n_rows,)."""
        raise NotImplementedError

    @staticmethod
    def structured_known(columns: Mapping[str, Sequence[Any]]) -> AnyArray:
        """Return `columns` (n_rows,) as a structured array (n_rows,), without those that contain only NaN."""
        return structured({name: values for name, values in columns.items() if any(v == v for v in values)})

    @staticmethod
    def warnings_of(runs: Iterable[tuple[str, Sequence[str]]]) -> list[str]:
        """Return a line for each distinct warning of runs, given as (label, warnings).

        If not all runs issued the warning, the line contains the labels of those that did, or the first three labels and the
        number of the others.
        """
        runs, lines = list(runs), []
        issued_by = grouped((text, label) for label, texts in runs for text in dict.fromkeys(texts))
        for text, labels in sorted(issued_by.items()):
            listed = labels if len(labels) <= 3 else [*labels[:3], f"{len(labels) - 3} more"]
            lines.append(f"warning: {text}" if len(labels) == len(runs) else f"warning ({'; '.join(listed)}): {text}")
        return lines

    def to_pandas(self) -> pandas.DataFrame:
        """Return `table` as a ``pandas.DataFrame``.

        Returns
        -------
        pandas.DataFrame
            Table whose ``attrs["units"]`` contains the names of the known units by column.

        Raises
        ------
        FileError
            If pandas is not installed.
        """
        return data_frame(self.table(), {name: unit(name, self.units) for name in self.table().dtype.names or ()})

    def __repr__(self) -> str:
        lines = self.lines()[self.title == self.name :]  # title and name are equal for a function without docstring
        return "\n".join([f"{type(self).__name__} of '{self.name}'", *lines])

    def _repr_html_(self) -> str:
        """Return the tables as HTML for notebooks."""
        captions = ((f"{self.title}: {caption}".strip(": "), rows) for caption, rows in self.tables())
        return "".join(html_table(rows[1:], rows[0], caption) for caption, rows in captions)

    def with_metadata(self, numbers: dict[str, Any]) -> dict[str, Any]:
        """Return the numbers of a study, the name of its case and the versions of the software, as ``--json`` writes them."""
        case = {"case": self.name, "title": self.title, "units": dict(self.units)}
        return {**case, **numbers, "versions": versions()}
