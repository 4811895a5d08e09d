"""The load ramp: multiplier of the loads as a function of the load factor, which is the pseudo-time of the analysis.

A `Ramp` consists of the load factors at the ends of the load steps, called instants, and of a piecewise linear function. The
points of such a function are a `Table`. An item of a model, such as a load, may have a function of its own, called its
history.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.arrays import Array
from fastcontact.elasticity.loads import LARGEST
from fastcontact.errors import ModelError

# Points (load factor, multiplier of the loads) of a piecewise linear function.
Table = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Harmonic:
    """History of the sine of a rotation angle, or of one minus its cosine.

    The displacement of a rigid-body rotation about a fixed axis is a linear combination of these two functions.

    Attributes
    ----------
    ramp : Table, optional
        History of the angle; None means the history of the analysis.
    angle : float
        Angle at load multiplier 1 [radian].
    versine : bool
        Whether the history is one minus the cosine instead of the sine.
    """

    ramp: Table | None
    angle: float
    versine: bool

    def value(self, multiplier: float) -> float:
        """Return the sine, or one minus the cosine, of `multiplier` times the angle [-]."""
        angle = multiplier * self.angle
        return 2.0 * math.sin(0.5 * angle) ** 2 if self.versine else math.sin(angle)


# History of a part of the prescribed displacements; None means the history of the analysis.
PartHistory = Table | Harmonic | None
# Largest number of equal steps. A larger number is probably a typing error.
MAX_STEPS = 1_000_000


def checked_table(rows: Iterable[Iterable[float]], caption: str = "the ramp") -> Table:
    """Return the points (load factor, multiplier) of a piecewise linear function, called `caption` in messages.

    Raises ModelError if there are fewer than two points, their load factors are not strictly increasing, or a number is not
    finite or exceeds LARGEST in magnitude.
    """
    try:
        table = tuple((float(factor), float(value)) for factor, value in rows)
    except (OverflowError, TypeError, ValueError):
        raise ModelError(f"the table of {caption} must contain pairs (load factor, multiplier of the loads)") from None
    load_factors = np.asarray([factor for factor, _ in table])
    if len(table) < 2 or not (np.diff(load_factors) > 0).all():
        raise ModelError(f"the table of {caption} needs at least two points with strictly increasing load factors")
    if not np.isfinite(table).all():
        raise ModelError(f"the table of {caption} contains a number that is not finite: {table}")
    if np.abs(table).max() > LARGEST:
        raise ModelError(f"the table of {caption} is out of range: magnitudes must be at most {LARGEST:g}")
    return table


def table_of(ramp: History, caption: str) -> Table | None:
    """Return the table of a history, or None if it is None. Raises the errors of `checked_table`."""
    if ramp is None:
        return None
    return ramp.table if isinstance(ramp, Ramp) else checked_table(ramp, caption)


def interpolation_tables(instants: Sequence[float], caption: str) -> list[Table]:
    """Return the tables of piecewise linear functions that are 1 at one of `instants` and 0 at the others.

    All functions are zero at the load factor 0, unless the first instant is 0. Raises the errors of `checked_table`.
    """
    load_factors = instants if 0.0 in instants[:1] else [0.0, *instants]
    checked_table([(factor, 0.0) for factor in load_factors], caption)
    return [tuple((factor, float(factor == instant)) for factor in load_factors) for instant in instants]


def table_value(table: Table, instant: float) -> float:
    """Return the value of the piecewise linear function `table` at the load factor `instant`, constant beyond its ends."""
    load_factors, values = zip(*table, strict=True)
    return float(np.interp(instant, load_factors, values))


@typed(ModelError)
@dataclass(frozen=True)
class Ramp:
    """The load steps of an analysis, and the multiplier of its loads as a piecewise linear function of the load factor.

    The load factor is the pseudo-time of the analysis; its values at the ends of the load steps are called instants.

    Parameters
    ----------
    instants : sequence of float or ndarray (n_steps,)
        Load factors at the ends of the load steps, strictly increasing [-].
    table : sequence of (float, float)
        Points (load factor, multiplier of the loads) of the function, with strictly increasing load factors [-].

    Raises
    ------
    ModelError
        If the instants or the load factors of the table are not strictly increasing, or an instant lies outside the table.

    Examples
    --------
    Load in ten steps, then unload in five:

    >>> import fastcontact as fc
    >>> instants = [i / 10 for i in range(1, 11)] + [1 + i / 5 for i in range(1, 6)]
    >>> ramp = fc.Ramp(instants, [(0.0, 0.0), (1.0, 1.0), (2.0, 0.0)])
    >>> ramp.value(1.5)
    0.5
    """

    instants: tuple[float, ...]
    table: Table = ((0.0, 0.0), (1.0, 1.0))

    def __post_init__(self) -> None:
        instants = np.asarray(tuple(self.instants), float)
        table = checked_table(self.table)
        load_factors = np.asarray([factor for factor, _ in table])
        if instants.ndim != 1 or not len(instants):
            raise ModelError("the ramp has no instants: give at least one load factor to solve at")
        if not (np.isfinite(instants).all() and (np.diff(instants) > 0).all()):
            raise ModelError(f"the instants of the ramp must be strictly increasing, not {self.instants}")
        outside = instants[(instants < load_factors[0]) | (instants > load_factors[-1])]
        if len(outside):
            range_text = f"{load_factors[0]:g} to {load_factors[-1]:g}"
            raise ModelError(f"instant {outside[0]:g} lies outside the table of the ramp, which covers {range_text}")
        object.__setattr__(self, "instants", tuple(float(t) for t in instants))
        object.__setattr__(self, "table", table)

    def __len__(self) -> int:
        return len(self.instants)

    def value(self, instant: float) -> float:
        """Return the multiplier of the loads at the load factor `instant` [-]."""
        return table_value(self.table, instant)


# History of a single item of a model: a ramp, of which only the table is used, or pairs (load factor, multiplier).
History = Ramp | Iterable[Iterable[float]] | None


@typed(ModelError)
def linear_ramp(steps: int = 20, end: float = 1.0) -> Ramp:
    """Return a ramp of equal load steps, along which the multiplier of the loads increases linearly from 0 to 1.

    Parameters
    ----------
    steps : int
        Number of load steps.
    end : float
        Load factor at the end of the last step, where the multiplier is 1 [-].

    Returns
    -------
    Ramp

    Raises
    ------
    ModelError
        If `steps` is not an integer from 1 to a million or `end` is not positive.

    Examples
    --------
    >>> import fastcontact as fc
    >>> fc.linear_ramp(4).instants
    (0.25, 0.5, 0.75, 1.0)
    """
    if int(steps) != steps or steps < 1:
        raise ModelError(f"the number of load steps must be a positive whole number, not {steps}")
    if steps > MAX_STEPS:
        raise ModelError(f"{steps} load steps are more than {MAX_STEPS}, the largest possible number: use fewer steps")
    if not end > 0:
        raise ModelError(f"the ramp must end at a positive load factor, not {end}")
    return Ramp(tuple(end * (i + 1) / int(steps) for i in range(int(steps))), ((0.0, 0.0), (end, 1.0)))


RampLike = Ramp | int | Iterable[float] | Iterable[Iterable[float]]


def ramp_of(steps: RampLike | None) -> Ramp:
    """Return the ramp that `steps` describes: a `Ramp`, a number of equal steps, or an array. None means 20 equal steps.

    An array (n,) contains the load factors at the ends of the steps; the multiplier of the loads is equal to the load
    factor, also beyond 1. An array (n, 2) contains the points (load factor, multiplier) of the load function, and each
    point except the first one is the end of a step.
    """
    if steps is None:
        return linear_ramp()
    if isinstance(steps, Ramp):
        return steps
    if isinstance(steps, int | Real):
        return linear_ramp(steps)
    try:
        values = np.asarray(steps if isinstance(steps, np.ndarray) else list(steps), float)
    except (TypeError, ValueError):
        values = np.empty((0, 0, 0))
    if values.ndim == 2 and values.shape[1] == 2:
        table = checked_table(values)
        return Ramp(tuple(instant for instant, _ in table[1:]), table)
    if values.ndim != 1:
        forms = "a number of steps, load factors (n,), pairs (load factor, multiplier) (n, 2), or a Ramp"
        raise ModelError(f"the ramp must be {forms}")
    end = max(1.0, values.max(initial=1.0))
    return Ramp(tuple(values), ((0.0, 0.0), (end, end)))


def sums_by_ramp(items: Iterable[tuple[Table | None, Array]]) -> dict[Table | None, Array]:
    """Return the sums of arrays with the same history, given as pairs of history and array."""
    sums: dict[Table | None, Array] = {}
    for table, values in items:
        sums[table] = sums.get(table, 0.0) + values
    return sums


def multiplier(table: PartHistory, ramp: Ramp, instant: float) -> float:
    """Return the multiplier [-] at `instant` of an item with the history `table`, or that of the ramp if `table` is None."""
    if isinstance(table, Harmonic):
        return table.value(multiplier(table.ramp, ramp, instant))
    return table_value(ramp.table if table is None else table, instant)


def combined(by_ramp: Mapping[Any, Array], ramp: Ramp, instant: float, shape: tuple[int, ...]) -> Array:
    """Return the sum of the arrays in `by_ramp`, each of `shape`, times the multipliers of their histories at `instant`."""
    return sum((multiplier(table, ramp, instant) * values for table, values in by_ramp.items()), np.zeros(shape))


def magnitudes(by_ramp: Mapping[PartHistory, Array]) -> Array:
    """Return bounds (n,) of the magnitude, over all load factors, of the sum of arrays (n,) times their multipliers.

    The multiplier of the analysis, which is unknown, and the sines of rotations count with the magnitude 1.
    """
    tables = {table: values for table, values in by_ramp.items() if isinstance(table, tuple)}
    others = sum((np.abs(values) for table, values in by_ramp.items() if table not in tables), np.zeros(()))
    instants = {instant for table in tables for instant, _ in table}
    sums = np.array([sum(table_value(table, t) * values for table, values in tables.items()) for t in instants])
    return others + np.abs(sums).max(axis=0) if len(sums) else others
