"""Layout of plots of bodies: size, visible part, title, labels, colour bar and legend."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np

from fastcontact.arrays import Array
from fastcontact.results.plot._axes import Units
from fastcontact.results.plot.fields import Field
from fastcontact.results.units import labelled

LETTER = 0.09  # mean width of a letter of a label [inch]


def size_around(points: Array, least: float = 3.2) -> tuple[float, float]:
    """Return width and height [inch] of a figure for a body, with space for colour bar, labels and title."""
    width, height = np.ptp(points, axis=0) / np.ptp(points, axis=0).max()
    return max(4.2 * float(width) + 1.9, 5.0), max(4.2 * float(height) + 2.0, least)


def part_shown(middle: Array, half: float, points: Array) -> tuple[Array, Array]:
    """Return the lower and upper corners of a square with a centre (2,) and a half width, clipped to points (n, 2)."""
    low, high = points.min(axis=0) - 0.05 * half, points.max(axis=0) + 0.05 * half
    return np.maximum(middle - half, low), np.minimum(middle + half, high)


def framed(
    axes: Any, drawn: Any, shown: Field, heading: str, units: Units, labels: Sequence[str], points: Array | None = None,
    *, alone: bool = True,
) -> Any:  # fmt: skip
    """Add a colour bar, a title, a label for each direction and a legend to axes, and return the axes.

    `points` (n, 2) [length] are the points of a body in the plane, and None for axes in space. `alone` is whether the figure
    has no other axes.
    """
    caption, length, below = labelled(shown.caption, units, shown.quantity), 0.6, 0.02
    if points is not None:
        width, height = np.ptp(points, axis=0)
        caption = textwrap.fill(caption, int(size_around(points)[1] / LETTER))
        length = float(np.clip(2.0 * height / max(width, 1e-300), 0.45, 0.8))  # shorter for flat bodies
        half_inch = -0.5 / max(4.2 * float(height) / max(float(width), float(height)), 0.2)
        below = half_inch if alone else -0.09
        axes.set_aspect("equal")
    axes.figure.colorbar(drawn, ax=axes, label=caption, shrink=length)
    axes.set_title(heading, fontsize="medium", pad=18 if points is None else None)
    axes.set(**{f"{axis}label": labelled(label, units, "length") for axis, label in zip("xyz", labels)})
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, below))
    return axes
