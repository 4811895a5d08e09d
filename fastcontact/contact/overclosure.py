"""Pressure-overclosure laws, given by tables or by an exponential function."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np
from scipy.special import wrightomega

from fastcontact._tools.argument_types import number_pairs
from fastcontact.arrays import Array
from fastcontact.errors import ContactError

# Overclosure, in multiples of the clearance c0, beyond which the exponential law is linear. With 1,
# `test_an_exponential_law` fails.
LARGEST_OVERCLOSURE = 3.0


class OverclosureLaw(ABC):
    """Contact pressure as a function of the overclosure, which is minus the gap."""

    @abstractmethod
    def tangent(self, overclosure: Array, compliance: float = 0.0) -> tuple[Array, Array]:
        """Return slopes (m,) [pressure / length] and zeros (m,) [length] of tangents of the law.

        The zero of a tangent is the overclosure at which its pressure vanishes. The law acts in series with a linear
        `compliance` [length / pressure], and `overclosure` (m,) [length] is the sum of the overclosures of both.
        """

    @abstractmethod
    def energy(self, pressure: Array) -> Array:
        """Return the energy per area (m,) [pressure length] at pressures (m,) [pressure]."""


class TabularLaw(OverclosureLaw):
    """A piecewise linear pressure, zero up to the first overclosure, and extrapolated linearly beyond the last.

    Raises ContactError for an invalid table.

    Parameters
    ----------
    name : str
        Name of the contact pair, for messages.
    table : array_like (n, 2)
        Overclosures in ascending order, negative for gaps [length], and pressures, which ascend from zero [pressure].
    """

    def __init__(self, name: str, table: Sequence[Any] | Array) -> None:
        rows = number_pairs(table)
        ascending = rows is not None and np.isfinite(rows).all() and (np.diff(rows, axis=0) > 0.0).all()
        if rows is None or not ascending or len(rows) < 2 or rows[0, 1] != 0.0:
            raise ContactError(
                f"the penalty of contact '{name}' must be a number, or a table of overclosures and pressures that both "
                "ascend, the first pressure zero: [(0.0, 0.0), (0.001, 5.0), (0.002, 20.0)]"
            )
        self.table = rows
        self._slopes = np.diff(rows[:, 1]) / np.diff(rows[:, 0])

    def tangent(self, overclosure: Array, compliance: float = 0.0) -> tuple[Array, Array]:
        """See `OverclosureLaw.tangent`."""
        sums = self.table[:, 0] + compliance * self.table[:, 1]
        interval = np.clip(np.searchsorted(sums, overclosure, side="right") - 1, 0, len(self._slopes) - 1)
        return self._slopes[interval], self.table[interval, 0] - self.table[interval, 1] / self._slopes[interval]

    def energy(self, pressure: Array) -> Array:
        """See `OverclosureLaw.energy`."""
        p, (overclosures, pressures) = np.maximum(pressure, 0.0), self.table.T
        energies = np.append(0.0, np.cumsum(0.5 * (pressures[1:] + pressures[:-1]) * np.diff(overclosures)))
        interval = np.clip(np.searchsorted(self.table[:, 1], p, side="right") - 1, 0, len(self._slopes) - 1)
        start = self.table[interval, 1]
        return np.asarray(energies[interval] + 0.5 * (p**2 - start**2) / self._slopes[interval])


class ExponentialLaw(OverclosureLaw):
    """The pressure ``p0 exp(h ln(100) / c0)`` of overclosures h, as in CalculiX; linear for h < -c0 and for h > 3 c0.

    Parameters
    ----------
    clearance : float
        Gap c0 at which the pressure is a hundredth of p0 [length].
    pressure : float
        Pressure p0 at a gap of zero [pressure].
    """

    def __init__(self, clearance: float, pressure: float) -> None:
        self._clearance, self._pressure, self._rate = clearance, pressure, np.log(100.0) / clearance

    def tangent(self, overclosure: Array, compliance: float = 0.0) -> tuple[Array, Array]:
        """See `OverclosureLaw.tangent`."""
        if compliance:
            # The product w of the rate and the overclosure of the compliance satisfies w + ln w = z.
            z = self._rate * overclosure + np.log(self._rate * compliance * self._pressure)
            overclosure = overclosure - wrightomega(z) / self._rate
        h = np.clip(overclosure, -self._clearance, LARGEST_OVERCLOSURE * self._clearance)
        return self._rate * self._pressure * np.exp(self._rate * h), h - 1.0 / self._rate

    def energy(self, pressure: Array) -> Array:
        """See `OverclosureLaw.energy`."""
        low, high = self._pressure * np.exp(self._rate * self._clearance * np.array([-1.0, LARGEST_OVERCLOSURE]))
        p, exponential_part = np.maximum(pressure, 0.0), np.clip(pressure, low, high)
        below, beyond = np.minimum(p, low), np.maximum(p, high)
        linear_parts = 0.5 * below**2 / low + 0.5 * (beyond**2 - high**2) / high
        return np.asarray((linear_parts + exponential_part - low) / self._rate)
