"""Export of curves to project files of Grace (xmgrace 5.1), with round axis limits, a legend and titles."""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fastcontact._tools.argument_types import typed
from fastcontact._tools.paths import PathLike, replacing
from fastcontact.arrays import Array
from fastcontact.errors import CaseError, FileError, check_known

STYLES = ("line", "symbols", "line+symbols")

# Numbers of colours (after white, the colour 0), symbols and line styles of Grace through which curves cycle.
N_COLOURS, N_SYMBOLS, N_LINE_STYLES = 14, 6, 5

# Grace uses Latin-1. Each Greek letter without accents has a counterpart in Grace's font Symbol.
_GREEK = dict(zip("αβγδεζηθικλμνξοπρςστυφχψω", "abgdezhqiklmnxoprVstufcyw"))
_GREEK |= dict(zip("ΑΒΓΔΕΖΗΘΙΚΛΜΝΞΟΠΡΣΤΥΦΧΨΩ", "ABGDEZHQIKLMNXOPRSTUFCYW"))
_MARKUP = {letter: f"\\f{{Symbol}}{symbol}\\f{{}}" for letter, symbol in _GREEK.items()} | {"\\": "\\\\", '"': '\\"'}
_PLAIN = str.maketrans("\u2212\u2013\u2014\u2018\u2019\u201c\u201d", "---''\"\"")


@typed(CaseError)
@dataclass(frozen=True, eq=False)
class Curve:
    """A curve of a plot.

    Parameters
    ----------
    x, y : array_like (n,)
        Coordinates [units of the axes]; points that are not finite are omitted.
    legend : str
        Text in the legend; the curve has no entry if it is empty.
    style : {"line", "symbols", "line+symbols"}
        Style of the curve, for example a line for theory and symbols for nodal values.

    Raises
    ------
    CaseError
        If `x` and `y` are not vectors of the same length, or if the style is unknown.
    """

    x: Array
    y: Array
    legend: str = ""
    style: str = "line"

    def __post_init__(self) -> None:
        x, y = (np.asarray(values, np.float64) for values in (self.x, self.y))
        if x.ndim != 1 or x.shape != y.shape:
            raise CaseError(f"curve '{self.legend}': x has shape {x.shape} and y {y.shape}, not both (n,)")
        check_known("curve style", self.style, STYLES, CaseError)
        finite = np.isfinite(x) & np.isfinite(y)
        object.__setattr__(self, "x", x[finite])
        object.__setattr__(self, "y", y[finite])


@typed(FileError)
def write_agr(
    path: PathLike, curves: Sequence[Curve], *, title: str, subtitle: str = "", xlabel: str, ylabel: str
) -> None:
    """Write curves as a Grace project file.

    Parameters
    ----------
    path : path-like
        File to write, with suffix ``.agr``; an existing file is replaced.
    curves : sequence of Curve
        Curves in drawing order; later curves cover earlier ones.
    title, subtitle : str
        Title and subtitle of the plot. In all texts, Greek letters are supported, markup of Grace is
        escaped, and other characters outside Latin-1 are replaced by similar ASCII characters or question marks.
    xlabel, ylabel : str
        Labels of the axes.

    Raises
    ------
    CaseError
        If no curve has a finite point.
    FileError
        If the file cannot be written.

    Examples
    --------
    >>> import numpy as np
    >>> import fastcontact as fc
    >>> from fastcontact.results.xmgrace import Curve
    >>> x = np.linspace(0.0, 1.0, 50)
    >>> curve = Curve(x, np.sqrt(1.0 - x**2), legend="Hertz")
    >>> fc.write_agr("hertz.agr", [curve], title="Pressure", xlabel="r / a", ylabel="p / p0")
    """
    shown = [curve for curve in curves if len(curve.x)]
    if not shown:
        raise CaseError(f"nothing to draw in '{path}': none of the {len(curves)} curves has a finite point")
    x_axis = round_axis(np.concatenate([curve.x for curve in shown]))
    y_axis = round_axis(np.concatenate([curve.y for curve in shown]))
    lines = ["# Grace project file", "@version 50122", "@page size 792, 612"]
    lines += ["@g0 on", "@g0 type XY", "@with g0"]
    lines.append(f"@    world {x_axis[0]:.12g}, {y_axis[0]:.12g}, {x_axis[1]:.12g}, {y_axis[1]:.12g}")
    lines.append("@    view 0.18, 0.15, 1.20, 0.85")
    lines += [f'@    title "{escape(title)}"', f'@    subtitle "{escape(subtitle)}"']
    lines += [*_axis("x", xlabel, x_axis), *_axis("y", ylabel, y_axis)]
    legend_state = "on" if any(curve.legend for curve in shown) else "off"
    lines += [f"@    legend {setting}" for setting in (legend_state, "loctype view", "0.82, 0.82", "char size 0.8")]
    for number, curve in enumerate(shown):
        lines += _style_lines(number, curve)
    for number, curve in enumerate(shown):
        lines += [f"@target G0.S{number}", "@type xy"]
        lines += [f"{x:.17g} {y:.17g}" for x, y in zip(curve.x.tolist(), curve.y.tolist())]
        lines.append("&")
    with replacing(path) as temporary, open(temporary, "w", encoding="latin-1") as file:
        file.write("\n".join(lines) + "\n")


def round_axis(values: ArrayLike) -> tuple[float, float, float]:
    """Return the first tick, the last tick and the tick spacing of an axis with round limits for finite `values` (n,).

    The spacing is 1, 2 or 5 times a power of ten, with about 4 to 10 intervals.

    Examples
    --------
    >>> round_axis([0.3, 9.6])
    (0.0, 10.0, 2.0)
    """
    numbers = np.asarray(values, np.float64)
    low, high = float(numbers.min()), float(numbers.max())
    magnitude = max(abs(low), abs(high))
    if high - low <= 1e-9 * magnitude or magnitude < 1e-300:  # a single value is shown in the middle of the axis
        half_range = 0.5 * magnitude if magnitude >= 1e-300 else 1.0
        low, high = low - half_range, high + half_range
    least_spacing = (high - low) / 8.0
    power = 10.0 ** math.floor(math.log10(least_spacing))
    spacing = next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= least_spacing * (1 - 1e-9))
    # With the tolerance, round-off in quotients such as 0.3 / 0.1 does not add a tick.
    first, last = math.floor(low / spacing + 1e-9), math.ceil(high / spacing - 1e-9)
    return first * spacing, last * spacing, spacing


def escape(text: str) -> str:
    """Return a Grace string that shows `text` literally, in Latin-1 with Greek letters from the Symbol font."""
    plain = " ".join(text.translate(_PLAIN).split())
    return "".join(_MARKUP.get(letter, letter) for text in map(_supported_text, plain) for letter in text)


def _supported_text(letter: str) -> str:
    """Return a letter if Grace supports it, otherwise similar ASCII characters or a question mark."""
    if letter in _GREEK or (letter.isprintable() and ord(letter) < 256):
        return letter
    similar = unicodedata.normalize("NFKD", letter).encode("ascii", "ignore").decode("ascii")
    return similar if similar.isprintable() and similar else "?"


def _axis(name: str, label: str, axis: tuple[float, float, float]) -> list[str]:
    settings = [f'label "{escape(label)}"', f"tick major {axis[2]:.12g}", "tick minor ticks 1", "tick major grid on"]
    settings += ["tick major linestyle 2", "ticklabel format general", "ticklabel prec 6"]
    return [f"@    {name}axis  {setting}" for setting in settings]


def _style_lines(number: int, curve: Curve) -> list[str]:
    colour = 1 + number % N_COLOURS
    symbol = 1 + number % N_SYMBOLS if "symbols" in curve.style else 0
    line = 1 + number // N_COLOURS % N_LINE_STYLES if "line" in curve.style else 0
    settings = ["type xy", f"symbol {symbol}", "symbol size 0.6", f"symbol color {colour}"]
    settings += [f"line type {min(line, 1)}", f"line linestyle {line}", "line linewidth 1.5", f"line color {colour}"]
    return [f"@    s{number} {setting}" for setting in (*settings, f'legend "{escape(curve.legend)}"')]
