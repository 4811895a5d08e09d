"""Histories of supports and loads over the steps of a deck; step k runs from load factor k - 1 to k."""

from __future__ import annotations

from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from fastcontact._tools.grouping import grouped
from fastcontact.arrays import Array, Indices
from fastcontact.cases.decks.blocks import Block, Location, key_of
from fastcontact.cases.decks.content import Amplitude, Content, Step
from fastcontact.model.ramp import Table
from fastcontact.round_off import ROUND_OFF

Key = TypeVar("Key", bound=Hashable)
# Duration of a jump, relative to the duration of a step.
JUMP = 1e-9
# Number of decimals to which histories, scaled to a peak of 1, must agree to be merged.
DECIMALS = 12


@dataclass(frozen=True, slots=True)
class Period:
    """Period in which a support or load acts.

    Attributes
    ----------
    begins, ends : float
        Load factors [-] between which it acts.
    location : Location or None
        Line of the deck that prescribes it, if it acts only from a later step on; otherwise None.
    fixed : bool
        True if the value remains equal to that at the start of the period (FIXED).
    """

    begins: float = 0.0
    ends: float = np.inf
    location: Location | None = None
    fixed: bool = False

    @property
    def permanent(self) -> bool:
        """Whether the period comprises all steps."""
        return self.begins == 0.0 and self.ends == np.inf


@dataclass(eq=False, slots=True)
class Track:
    """The common history of quantities that have had equal values in all steps so far.

    `numbers` alternates between load factors and values, since each node may have a separate track and a list of pairs would
    take three times the memory. `periods` are those in which the quantities act. `value_in_total_time` is the current value
    with its amplitude, if the amplitude is in total time.
    """

    numbers: array[float]
    periods: tuple[Period, ...] = ()
    value_in_total_time: tuple[float, Amplitude] | None = None

    @property
    def in_effect(self) -> bool:
        """Whether no step has removed the quantities."""
        return bool(self.periods) and self.periods[-1].ends == np.inf

    @property
    def last(self) -> float:
        """The value at the end of the last step so far."""
        return self.numbers[-1]

    @property
    def table(self) -> Table:
        """Pairs of load factor and value."""
        return tuple(zip(self.numbers[::2], self.numbers[1::2], strict=True))

    def add(self, points: Iterable[tuple[float, float]]) -> None:
        """Append points. A point with the time of the last point but another value is a jump."""
        for time, value in points:
            end, last = self.numbers[-2:]
            if time <= end:
                if value == last:
                    continue
                time = end + JUMP
            self.numbers.extend((time, value))


class Value(NamedTuple):
    """A value of a step, with its amplitude and its location. All keys of a line share one object, which saves memory."""

    value: float
    amplitude: str
    location: Location


@dataclass(eq=False)
class Histories(Generic[Key]):
    """Histories of loads or supports by key, which is a `Component`, a `Target` or a point.

    Attributes
    ----------
    content : Content
        Content of the deck.
    tracks : dict
        Track by key.
    step_values : dict
        Values of the current step by key.
    removals : dict
        Keys of earlier values that the current step removes.
    baseline : mapping
        Values in the absence of a load or support, by key.
    initial : dict
        Values given before all steps by key, which the first step reaches unless it changes or removes them.
    fixed_keys : set
        Keys of the values that the current step fixes at their present size (FIXED).
    default : float
        Value in the absence of a load or support of a key without `baseline`.
    time : float
        Total time [time] at the start of the current step.
    additive : bool
        Whether CalculiX adds the values that a step sets for one key.
    repeated : list
        Pairs of values that the current step has set for one key. They must be equal but for round-off, or zero if they add.
    first_blocks : dict of str to Block
        First block of the current step by keyword. *DLOAD and *DSLOAD, which form one list in CalculiX, count as one.
    """

    content: Content
    tracks: dict[Key, Track] = field(default_factory=dict)
    step_values: dict[Key, Value] = field(default_factory=dict)
    removals: dict[Key, None] = field(default_factory=dict)
    baseline: Mapping[Key, float] = field(default_factory=dict)
    initial: dict[Key, Value] = field(default_factory=dict)
    fixed_keys: set[Key] = field(default_factory=set)
    default: float = 0.0
    time: float = 0.0
    additive: bool = False
    repeated: list[tuple[Value, Value]] = field(default_factory=list)
    first_blocks: dict[str, Block] = field(default_factory=dict)

    def set_value(self, key: Key, value: Value) -> None:
        """Set a value for the current step, which `advance` compares with a value that this step has already set."""
        earlier = self.step_values.get(key)
        if earlier is not None and ((self.additive and value.value) or earlier[:2] != value[:2]):
            self.repeated.append((earlier, value))
        self.step_values[key] = value
        self.removals.pop(key, None)
        self.fixed_keys.discard(key)

    def record(self, block: Block, entries: Iterable[tuple[Iterable[Key], float, Location]]) -> None:
        """Set the values of the lines of a block."""
        self.begin(block)
        for keys, value, location in entries:
            shared = Value(value, block.get("AMPLITUDE"), location)
            for key in keys:
                self.set_value(key, shared)

    def fix(self, key: Key, value: Value) -> None:
        """Fix a value as it is at the end of the last step (FIXED); if there is none, set the given value."""
        if key in self.tracks and self.tracks[key].in_effect:
            self.step_values[key] = Value(self.tracks[key].last, "", value.location)
            self.removals.pop(key, None)
        else:
            self.set_value(key, value)
        self.fixed_keys.add(key)

    def begin(self, block: Block) -> None:
        """Begin a block of the current step. With OP=NEW, the earlier values of its keyword are removed.

        Raises CaseError if it has OP=NEW, but not the first block of the step, where CalculiX reads this parameter.
        """
        first = self.first_blocks.setdefault(block.keyword.replace("DSLOAD", "DLOAD"), block)
        if not block.removes_earlier:
            return
        if not first.removes_earlier:
            raise block.error(f"OP=NEW is missing in the first *{first.keyword}, line {first.location.line}")
        self.initial = {}
        earlier = (key for key in self.tracks if getattr(key, "keyword", block.keyword) == block.keyword)
        self.removals.update(dict.fromkeys(filter(self.keeps, earlier)))

    def keeps(self, key: Key) -> bool:
        """Whether the value of an earlier step has been neither changed nor removed by the current step so far."""
        changed = key in self.step_values or key in self.removals
        return key in self.tracks and self.tracks[key].in_effect and not changed

    def advance(self, number: int, step: Step) -> None:
        """Advance to the end of step `number`, counted from 1. Raises CaseError if the step sets two different values."""
        start_factor, start_time = float(number - 1), self.time
        self.time += step.period
        current = self.initial | self.step_values if self.initial else self.step_values
        self._compare_repeated(current.values())
        changed: dict[tuple[Any, ...], Track] = {}
        for key in (*current, *self.removals):
            previous, baseline, new = self.tracks.get(key), self.baseline.get(key, self.default), current.get(key)
            value, amplitude = new[:2] if new else (baseline, "")
            periods = self._periods(key, new, start_factor)
            evolution = previous, value, amplitude, baseline, periods
            if evolution not in changed:
                numbers = array("d", (0.0, baseline)) if previous is None else previous.numbers[:]
                track = changed[evolution] = Track(numbers, periods)
                track.add([(start_factor, track.last)])
                if amplitude:
                    history = self.content.amplitudes[key_of(amplitude)]
                    track.add(_amplitude_points(value, history, start_factor, start_time, step.period))
                    track.value_in_total_time = (value, history) if history.total else None
                else:
                    track.add([(start_factor + 1, value)])
            self.tracks[key] = changed[evolution]
        continued = {track: pair for track in self.tracks.values() if (pair := track.value_in_total_time) is not None}
        for track in continued.keys() - changed.values():
            track.add(_amplitude_points(*continued[track], start_factor, start_time, step.period))
        self.step_values, self.initial, self.removals, self.fixed_keys, self.first_blocks = {}, {}, {}, set(), {}

    def _compare_repeated(self, values: Iterable[Value]) -> None:
        """Raise CaseError if two values of a key add, or differ by more than round-off of the largest of the `values`."""
        round_off = ROUND_OFF * max((abs(value.value) for value in values), default=0.0)
        for earlier, value in self.repeated:
            if self.additive or earlier.amplitude != value.amplitude or abs(earlier.value - value.value) > round_off:
                raise value.location.error(
                    f"{value.value:.15g} is the second value in this step, after {earlier.value:.15g} in line "
                    f"{earlier.location.line}: programs interpret this differently, so give one value"
                )
        self.repeated = []

    def _periods(self, key: Key, new: Value | None, begin: float) -> tuple[Period, ...]:
        """Return the periods of a quantity with the value `new` in the current step, which begins at load factor `begin`.

        A new value ends the period of a value with FIXED, and a new period begins.
        """
        previous, fixed = self.tracks.get(key), key in self.fixed_keys
        periods = previous.periods if previous else ()
        if previous and previous.in_effect:
            if new is not None and (fixed or not periods[-1].fixed):
                return periods
            periods = (*periods[:-1], replace(periods[-1], ends=begin))
        if new is None:
            return periods
        return (*periods, Period(begin, location=new.location if begin else None, fixed=fixed))

    def table(self, key: Key) -> Table:
        """Return the history as pairs of load factor and value, up to the end of the last step of the deck."""
        table, end = self.tracks[key].table, float(len(self.content.steps))
        return table if table[-1][0] >= end else (*table, (end, table[-1][1]))

    def distinct_tables(self) -> Iterator[tuple[Table, list[Key]]]:
        """Yield each distinct history with the keys that share it."""
        for keys in grouped((track.numbers.tobytes(), key) for key, track in self.tracks.items()).values():
            yield self.table(keys[0]), keys

    def tables_by_period(self) -> Iterator[tuple[Table, Period, list[Key]]]:
        """Yield each distinct history with each period in which it acts, and the keys that share both."""
        for table, keys in self.distinct_tables():
            members = grouped((period, key) for key in keys for period in self.tracks[key].periods)
            yield from ((table, period, group) for period, group in members.items() if period.begins < period.ends)


class ShapeGroups(Generic[Key]):
    """Histories of nodes, facets or cells, grouped by a key, such as an axis, and by shape, so that few loads are needed.

    Iteration yields the key, the numbers of the members, the value and the history of each group. The value is 1 if all
    members have the same history; otherwise it is a function that returns one value for each member, in ascending order.
    """

    def __init__(self) -> None:
        self._members: dict[tuple[Key, Table], tuple[Table, array[float], array[int]]] = {}

    def add(self, key: Key, table: Table, numbers: Sequence[int]) -> None:
        """Add the history of the nodes, facets or cells with these `numbers` under a key."""
        peak = max((value for _, value in table), key=abs)
        shape = tuple((factor, round(value / peak, DECIMALS)) for factor, value in table) if peak else table
        _, peaks, members = self._members.setdefault((key, shape), (table, array("d"), array("q")))
        peaks.extend([peak] * len(numbers))
        members.extend(numbers)

    @staticmethod
    def of(histories: Iterable[tuple[Table, Sequence[int]]]) -> ShapeGroups[int]:
        """Return the histories of scalar quantities, whose key is 0."""
        by_shape = ShapeGroups[int]()
        for table, numbers in histories:
            by_shape.add(0, table, numbers)
        return by_shape

    def __iter__(self) -> Iterator[tuple[Key, Indices, Any, Table]]:
        for (key, shape), (table, peaks, members) in self._members.items():
            numbers, inverse = np.unique(members, return_inverse=True)
            if len(numbers) == len(members) and min(peaks) == max(peaks):
                yield key, np.asarray(members), 1.0, table
            else:  # several values of a member are added
                yield key, numbers, partial(repeated_values, np.bincount(inverse, peaks).astype(float)), shape


def repeated_values(values: Array, positions: Array) -> Array:
    """Return `values` (n,), each repeated k times; only the number of `positions` (k n, dim) [length] is used."""
    return np.repeat(values, len(positions) // len(values))


def _amplitude_points(
    value: float, amplitude: Amplitude, start_factor: float, start_time: float, period: float
) -> list[tuple[float, float]]:
    """Return pairs of load factor and `value` times amplitude for a step.

    The step begins at the load factor `start_factor` and the total time `start_time`, and has the duration `period`.
    """
    first = start_time if amplitude.total else 0.0
    low, high = bisect_right(amplitude.times, first), bisect_left(amplitude.times, first + period)
    times = [first, *amplitude.times[low:high], first + period]
    neighbours = slice(max(low - 1, 0), high + 1)
    values = np.interp(times, amplitude.times[neighbours], amplitude.values[neighbours])
    fractions = [(t - first) / period for t in times[:-1]] + [1.0]
    return [(start_factor + t, value * float(v)) for t, v in zip(fractions, values, strict=True)]
