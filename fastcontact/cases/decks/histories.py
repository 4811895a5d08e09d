"""Histories of supports and loads over the steps of a deck; step k runs from load factor k - 1 to k."""

from __future__ import annotations

from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Generic, TypeVar

import numpy as np

from fastcontact.arrays import AnyArray, Array, Indices
from fastcontact.cases.decks.blocks import Location, key_of
from fastcontact.cases.decks.content import Amplitude, Condition, Content, Step
from fastcontact.model.ramp import Table

Name = TypeVar("Name", bound=Hashable)
# Duration of a jump, relative to the duration of a step.
JUMP = 1e-9
# Number of decimals in which scaled histories must agree to be merged.
DECIMALS = 12


@dataclass(slots=True)
class Track:
    """The common history of quantities that have had equal values in all steps so far.

    `numbers` alternates between load factors and values, since each node may have a separate track and a list of pairs would
    take three times the memory. `size` is the number of quantities. `alive` is false once a step has removed them. `shape` is
    the current value with its amplitude, if that is in total time.
    """

    numbers: array[float]
    location: Location
    size: int
    alive: bool = True
    shape: tuple[float, Amplitude] | None = None

    @property
    def last(self) -> float:
        """The value at the end of the last step so far."""
        return self.numbers[-1]

    @property
    def points(self) -> Table:
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


@dataclass
class Values(Generic[Name]):
    """Values of a step by name, stored in columns: the values, their line numbers and the indices of their blocks.

    Each node may have a separate value, and an object for each would take several times the memory of its line in the deck.
    """

    rows: dict[Name, int] = field(default_factory=dict)
    values: array[float] = field(default_factory=lambda: array("d"))
    lines: array[int] = field(default_factory=lambda: array("q"))
    origins: array[int] = field(default_factory=lambda: array("q"))
    blocks: list[tuple[str, Location]] = field(default_factory=list)  # amplitude, and location of a line
    last: tuple[float, int, int] | None = None
    row: int = 0

    def __contains__(self, name: object) -> bool:
        return name in self.rows

    def __iter__(self) -> Iterator[Name]:
        return iter(self.rows)

    def put(self, name: Name, value: float, amplitude: str, location: Location) -> None:
        """Store a value, which replaces an earlier value of the same name."""
        block = self.blocks[-1] if self.blocks else None
        if block is None or (amplitude, location.file, location.keyword) != (block[0], block[1].file, block[1].keyword):
            self.blocks.append((amplitude, location))
        line = value, location.line, len(self.blocks) - 1
        if line != self.last:  # names of one line share its row
            self.last, self.row = line, len(self.values)
            self.values.append(value)
            self.lines.append(location.line)
            self.origins.append(len(self.blocks) - 1)
        self.rows[name] = self.row

    def get(self, name: Name) -> tuple[float, str, Location]:
        """Return the value with a name, its amplitude and its location."""
        row = self.rows[name]
        amplitude, location = self.blocks[self.origins[row]]
        return self.values[row], amplitude, replace(location, line=self.lines[row])

    def update(self, other: Values[Name]) -> None:
        """Store all values of another table."""
        for name in other:
            self.put(name, *other.get(name))

    def columns(self) -> tuple[Array, list[str]]:
        """Return the values (n,) and the amplitudes of all names."""
        rows = np.fromiter(self.rows.values(), int, len(self.rows))
        origins = np.asarray(self.origins, int)[rows]
        return np.asarray(self.values, float)[rows], [self.blocks[origin][0] for origin in origins.tolist()]


@dataclass
class Histories(Generic[Name]):
    """Histories of loads or supports by name.

    Attributes
    ----------
    content : Content
        Content of the deck.
    tracks : dict
        Track by name.
    step_values : Values
        Values of the current step.
    removals : dict
        Names of earlier values that the current step removes.
    rest : mapping
        Values in the absence of a load or support, by default zero.
    initial : Values
        Values given before all steps, which the first step reaches unless it changes them.
    time : float
        Total time [time] at the start of the current step.
    in_total_time : dict
        Tracks whose amplitudes are in total time, by `id` of the track.
    """

    content: Content
    tracks: dict[Name, Track] = field(default_factory=dict)
    step_values: Values[Name] = field(default_factory=Values)
    removals: dict[Name, None] = field(default_factory=dict)
    rest: Mapping[Name, float] = field(default_factory=dict)
    initial: Values[Name] = field(default_factory=Values)
    time: float = 0.0
    in_total_time: dict[int, Track] = field(default_factory=dict)

    def set_value(self, name: Name, value: float, amplitude: str, location: Location) -> None:
        """Set a value for the current step. Raises CaseError if this step has already set a different value."""
        if name in self.step_values:
            earlier, earlier_amplitude, earlier_location = self.step_values.get(name)
            if (earlier, earlier_amplitude) != (value, amplitude):
                raise location.refuse(
                    f"{value:g} is the second value in this step, after {earlier:g} in line {earlier_location.line}: "
                    "programs interpret this differently, so give one value"
                )
        self.step_values.put(name, value, amplitude, location)
        self.removals.pop(name, None)

    def record(self, condition: Condition, entries: Iterable[tuple[Name, float, Location]]) -> None:
        """Set the values of the lines of a block; OP=NEW first removes the earlier values of its keyword."""
        if condition.new:
            self.remove_earlier(condition.block.keyword)
        for name, value, location in entries:
            self.set_value(name, value, condition.amplitude, location)

    def hold(self, name: Name, location: Location) -> None:
        """Set the value for the current step to that at the end of the last step."""
        if name in self.tracks:
            self.step_values.put(name, self.tracks[name].last, "", location)
            self.removals.pop(name, None)

    def begin(self) -> None:
        """Begin the histories of the values that are given before all steps. They start at the values of `rest`."""
        by_value: dict[float, list[Name]] = {}
        for name in self.step_values:
            by_value.setdefault(self.rest.get(name, 0.0), []).append(name)
        for value, names in by_value.items():
            track = Track(array("d", (0.0, value)), self.step_values.get(names[0])[2], len(names))
            self.tracks.update((name, track) for name in names)
        self.initial, self.step_values = self.step_values, Values()

    def remove_earlier(self, keyword: str = "") -> None:
        """Mark the values of earlier steps for removal, except those whose names have a keyword other than `keyword`."""
        self.initial = Values()
        for name, track in self.tracks.items():
            if track.alive and name not in self.step_values and getattr(name, "keyword", keyword) == keyword:
                self.removals[name] = None

    def advance(self, number: int, step: Step) -> None:
        """Advance to the end of step `number`, counted from 1."""
        begin, start = float(number - 1), self.time
        self.time += step.period
        current = self.initial if self.initial.rows else self.step_values
        if current is self.initial:
            current.update(self.step_values)
        names = [*current, *self.removals]
        rests = np.fromiter((self.rest.get(name, 0.0) for name in names), float, len(names))
        values, amplitudes = current.columns()
        alive = np.arange(len(names)) < len(values)
        values, amplitudes = np.append(values, rests[len(values) :]), [*amplitudes, *[""] * len(self.removals)]
        track_ids = np.fromiter((id(self.tracks.get(name)) for name in names), np.intp, len(names))
        changed_tracks = set()
        for rows in _equal_rows(track_ids, values, np.array(amplitudes), rests, alive):
            value, amplitude = float(values[rows[0]]), amplitudes[rows[0]]
            track = self._track([names[row] for row in rows], float(rests[rows[0]]), current)
            changed_tracks.add(id(track))
            track.alive = bool(alive[rows[0]])
            self.in_total_time.pop(id(track), None)
            track.add([(begin, track.last)])
            if amplitude:
                shape = self.content.amplitudes[key_of(amplitude)]
                track.add(_amplitude_points(value, shape, begin, start, step.period))
                if shape.total:
                    track.shape, self.in_total_time[id(track)] = (value, shape), track
            else:
                track.add([(begin + 1, value)])
        for track_id, track in self.in_total_time.items():
            if track_id not in changed_tracks and track.shape is not None:
                track.add(_amplitude_points(*track.shape, begin, start, step.period))
        self.step_values, self.initial, self.removals = Values(), Values(), {}

    def _track(self, names: list[Name], rest: float, current: Values[Name]) -> Track:
        """Return a track for these names only: the existing track, a new track, or a copy of a track with more names."""
        track = self.tracks.get(names[0])
        if track is not None and track.size == len(names):
            return track
        if track is None:
            track = Track(array("d", (0.0, rest)), current.get(names[0])[2], len(names))
        else:
            track.size -= len(names)
            track = replace(track, numbers=track.numbers[:], size=len(names))
        self.tracks.update((name, track) for name in names)
        return track

    def table(self, name: Name) -> Table:
        """Return the history as pairs of load factor and value, up to the end of the last step of the deck."""
        points, end = self.tracks[name].points, float(len(self.content.steps))
        return points if points[-1][0] >= end else (*points, (end, points[-1][1]))

    def distinct(self) -> Iterator[tuple[Table, list[Name]]]:
        """Yield each distinct history with the names that share it."""
        members: dict[bytes, list[Name]] = {}
        for name, track in self.tracks.items():
            members.setdefault(track.numbers.tobytes(), []).append(name)
        for names in members.values():
            yield self.table(names[0]), names


def _equal_rows(*columns: AnyArray) -> Iterator[Indices]:
    """Yield the groups of rows with equal entries in all columns (n,), in order of first occurrence."""
    order = np.lexsort(columns)
    differs = np.zeros(max(len(order) - 1, 0), bool)
    for column in columns:
        sorted_column = column[order]
        differs |= sorted_column[1:] != sorted_column[:-1]
    bounds = np.array([0, *(np.flatnonzero(differs) + 1), len(order)])[len(order) == 0 :]
    for group in np.argsort(order[bounds[:-1]]):
        yield order[bounds[group] : bounds[group + 1]]


class ByShape(Generic[Name]):
    """Histories of nodes, facets or cells, grouped by a key, such as an axis, and by shape, so that few loads are needed.

    Iteration yields the axis, the points, the value and the history of each group. The value is 1 if all points have the same
    history; otherwise it is a function that returns one value for each point, with the points in ascending order.
    """

    def __init__(self) -> None:
        self._members: dict[tuple[Name, Table], tuple[Table, array[float], array[int]]] = {}

    def add(self, axis: Name, table: Table, points: Sequence[int]) -> None:
        """Add the history of some points along an axis."""
        peak = max((value for _, value in table), key=abs)
        shape = tuple((factor, round(value / peak, DECIMALS)) for factor, value in table) if peak else table
        _, peaks, members = self._members.setdefault((axis, shape), (table, array("d"), array("q")))
        peaks.extend([peak] * len(points))
        members.extend(points)

    @staticmethod
    def of(histories: Iterable[tuple[Table, Sequence[int]]]) -> ByShape[int]:
        """Return the histories of scalar quantities, whose axis is 0."""
        by_shape = ByShape[int]()
        for table, points in histories:
            by_shape.add(0, table, points)
        return by_shape

    def __iter__(self) -> Iterator[tuple[Name, Indices, Any, Table]]:
        for (axis, shape), (table, peaks, members) in self._members.items():
            points, inverse = np.unique(members, return_inverse=True)
            if len(points) == len(members) and min(peaks) == max(peaks):
                yield axis, np.asarray(members), 1.0, table
            else:  # several values at a point are added
                yield axis, points, partial(repeated_values, np.bincount(inverse, peaks).astype(float)), shape


def repeated_values(values: Array, positions: Array) -> Array:
    """Return `values` (n,), each repeated k times; only the number of `positions` (k n, dim) [length] is used."""
    return np.repeat(values, len(positions) // len(values))


def _amplitude_points(
    value: float, shape: Amplitude, begin: float, start: float, period: float
) -> list[tuple[float, float]]:
    """Return pairs of load factor and `value` times amplitude for a step.

    The step begins at the load factor `begin` and the total time `start`, and has the duration `period`.
    """
    first = start if shape.total else 0.0
    low, high = bisect_right(shape.times, first), bisect_left(shape.times, first + period)
    times = [first, *shape.times[low:high], first + period]
    neighbours = slice(max(low - 1, 0), high + 1)
    values = np.interp(times, shape.times[neighbours], shape.values[neighbours])
    fractions = [(t - first) / period for t in times[:-1]] + [1.0]
    return [(begin + t, value * float(v)) for t, v in zip(fractions, values, strict=True)]
