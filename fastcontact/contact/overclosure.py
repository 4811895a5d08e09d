"""Tabular pressure-overclosure relations."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fastcontact.arrays import Array
from fastcontact.errors import ContactError

# Rows of the table that stands for an exponential law, and the least pressure of one, over that at a gap of zero.
ROWS, LEAST = 129, 0.01


class OverclosureLaw:
    """A piecewise linear pressure, zero up to the first overclosure, and going on beyond the last with its slope.

    ContactError if it is not such a table.

    Parameters
    ----------
    name : str
        Of the contact pair, for messages.
    table : array_like (n, 2)
        Overclosures, ascending, negative ones being gaps [length], and pressures, ascending from zero [pressure].
    """

    def __init__(self, name: str, table: Sequence[Any] | Array) -> None:
        try:
            rows = np.array([[float(value) for value in row] for row in table]).reshape(-1, 2)
        except (TypeError, ValueError):
            rows = np.empty((0, 2))
        if len(rows) < 2 or not np.isfinite(rows).all() or rows[0, 1] != 0.0 or not (np.diff(rows, axis=0) > 0.0).all():
            raise ContactError(
                f"the penalty of contact '{name}' must be a number, or a table of overclosures and pressures that both "
                "ascend, the first pressure zero: [(0.0, 0.0), (0.001, 5.0), (0.002, 20.0)]"
            )
        self.table = rows
        self._slopes = np.diff(rows[:, 1]) / np.diff(rows[:, 0])

    def line(self, overclosure: Array) -> tuple[Array, Array]:
        """Return slopes (m,) [pressure / length] at overclosures (m,) [length], and where their lines have no pressure."""
        interval = np.clip(np.searchsorted(self.table[:, 0], overclosure, side="right") - 1, 0, len(self._slopes) - 1)
        return self._slopes[interval], self.table[interval, 0] - self.table[interval, 1] / self._slopes[interval]

    def energy(self, pressure: Array) -> Array:
        """Return the energy by area (m,) [pressure length] at pressures (m,) [pressure]."""
        p = np.maximum(pressure, 0.0)
        before = np.concatenate(
            [[0.0], np.cumsum(0.5 * (self.table[1:, 1] + self.table[:-1, 1]) * np.diff(self.table[:, 0]))]
        )
        interval = np.clip(np.searchsorted(self.table[:, 1], p, side="right") - 1, 0, len(self._slopes) - 1)
        start = self.table[interval, 1]
        return np.asarray(before[interval] + 0.5 * (p**2 - start**2) / self._slopes[interval])


def exponential(clearance: float, pressure: float) -> list[tuple[float, float]]:
    """Return a table of ``p0 exp(h ln(100) / c0)``: p0 at a gap of zero [pressure], a hundredth of it at the gap c0 [length].

    That is the exponential law of CalculiX, up to an overclosure of 3 c0.
    """
    overclosures = clearance * np.linspace(-1.0, 3.0, ROWS)
    pressures = pressure * LEAST ** (-overclosures / clearance)
    pressures[0] = 0.0
    return list(zip(overclosures.tolist(), pressures.tolist(), strict=True))
