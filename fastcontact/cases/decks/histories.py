"""Histories of supports and loads over the steps of a deck: step k runs from load factor k - 1 to k."""

from __future__ import annotations

from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Generic, TypeVar

import numpy as np

from fastcontact.arrays import AnyArray, Array, Indices
from fastcontact.cases.decks.blocks import Location, folded
from fastcontact.cases.decks.content import Amplitude, Content, Given, Step
from fastcontact.model.ramp import Table

Name = TypeVar("Name", bound=Hashable)
# Duration of a jump at the start of a step, relative to the duration of the step.
JUMP = 1e-9
# Number of decimals to which scaled histories must agree to be merged.
ALIKE = 12


@dataclass(slots=True)
class Track:
    """The common history of quantities that have always been prescribed together.

    `numbers` contains load factors and values in turn. Each node may have a separate track, and a list of pairs would take
    three times the memory. `size` is the number of quantities, and `alive` is false once a step has removed them.
    """

    numbers: array[float]
    location: Location
    size: int
    alive: bool = True
    shape: tuple[float, Amplitude] | None = None

    @property
    def last(self) -> float:
        """The value at the end of the latest step."""
        return self.numbers[-1]

    @property
    def points(self) -> Table:
        """Load factor and value of each point."""
        return tuple(zip(self.numbers[::2], self.numbers[1::2], strict=True))

    def add(self, points: Iterable[tuple[float, float]]) -> None:
        """Append points; a point with the time of the last point and another value becomes a jump."""
        for time, value in points:
            end, before = self.numbers[-2:]
            if time <= end:
                if value == before:
                    continue
                time = end + JUMP
            self.numbers.extend((time, value))


@dataclass
class Values(Generic[Name]):
    """Values of a step by name, stored in columns of values, line numbers and indices of blocks.

    Each node may have a separate value, and an object per value would take several times the memory of its line.
    """

    rows: dict[Name, int] = field(default_factory=dict)
    values: array[float] = field(default_factory=lambda: array("d"))
    lines: array[int] = field(default_factory=lambda: array("q"))
    origins: array[int] = field(default_factory=lambda: array("q"))
    blocks: list[tuple[str, Location]] = field(default_factory=list)  # amplitude and a line of each block
    last: tuple[float, int, int] | None = None
    row: int = 0

    def __contains__(self, name: object) -> bool:
        return name in self.rows

    def __iter__(self) -> Iterator[Name]:
        return iter(self.rows)

    def put(self, name: Name, value: float, amplitude: str, location: Location) -> None:
        """Store a value, which replaces an earlier value with the same name."""
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
    changing : Values
        Values of the current step.
    dying : dict
        Names of earlier values that the current step removes.
    rest : mapping
        Values without any load or support, by default zero.
    first : Values
        Values given before all steps, which are effective in the first step unless that step changes them.
    time : float
        Total time at the start of the current step.
    lasting : dict
        Tracks whose amplitudes are in total time, by the identity of the track.
    """

    content: Content
    tracks: dict[Name, Track] = field(default_factory=dict)
    changing: Values[Name] = field(default_factory=Values)
    dying: dict[Name, None] = field(default_factory=dict)
    rest: Mapping[Name, float] = field(default_factory=dict)
    first: Values[Name] = field(default_factory=Values)
    time: float = 0.0
    lasting: dict[int, Track] = field(default_factory=dict)

    def give(self, name: Name, value: float, amplitude: str, location: Location) -> None:
        """Set a value for the current step; CaseError if this step has set a different value."""
        if name in self.changing:
            first, other, before = self.changing.get(name)
            if (first, other) != (value, amplitude):
                raise location.refuse(
                    f"{value:g} is the second value in this step, after {first:g} in line {before.line}, which programs "
                    "interpret differently: give one value"
                )
        self.changing.put(name, value, amplitude, location)
        self.dying.pop(name, None)

    def take(
        self, given: Given, entries: Iterable[tuple[Name, float, Location]], which: Callable[[Name], bool] | None = None
    ) -> None:
        """Set the values of the lines of a block; OP=NEW removes the values of earlier steps that satisfy `which`."""
        if given.new:
            self.forget(which)
        for name, value, location in entries:
            self.give(name, value, given.amplitude, location)

    def hold(self, name: Name, location: Location) -> None:
        """Hold the value that was reached at the end of the latest step."""
        if name in self.tracks:
            self.changing.put(name, self.tracks[name].last, "", location)
            self.dying.pop(name, None)

    def begin(self) -> None:
        """Begin the histories of values given before all steps at their rest values; the first step reaches the values."""
        alike: dict[float, list[Name]] = {}
        for name in self.changing:
            alike.setdefault(self.rest.get(name, 0.0), []).append(name)
        for value, names in alike.items():
            track = Track(array("d", (0.0, value)), self.changing.get(names[0])[2], len(names))
            self.tracks.update((name, track) for name in names)
        self.first, self.changing = self.changing, Values()

    def forget(self, which: Callable[[Name], bool] | None = None) -> None:
        """Remove the values of earlier steps, by default all, or those whose names satisfy `which`."""
        self.first = Values()
        for name, track in self.tracks.items():
            if track.alive and name not in self.changing and (which is None or which(name)):
                self.dying[name] = None

    def advance(self, number: int, step: Step) -> None:
        """Advance to the end of step `number`, counted from 1."""
        begin, start = float(number - 1), self.time
        self.time += step.period
        given = self.first if self.first.rows else self.changing
        if given is self.first:
            given.update(self.changing)
        names = [*given, *self.dying]
        rests = np.fromiter((self.rest.get(name, 0.0) for name in names), float, len(names))
        values, amplitudes = given.columns()
        alive = np.arange(len(names)) < len(values)
        values, amplitudes = np.append(values, rests[len(values) :]), [*amplitudes, *[""] * len(self.dying)]
        shared = np.fromiter((id(self.tracks.get(name)) for name in names), np.intp, len(names))
        changed = set()
        for rows in _equal(shared, values, np.array(amplitudes), rests, alive):
            value, amplitude = float(values[rows[0]]), amplitudes[rows[0]]
            track = self._track([names[row] for row in rows], float(rests[rows[0]]), given)
            changed.add(id(track))
            track.alive = bool(alive[rows[0]])
            self.lasting.pop(id(track), None)
            track.add([(begin, track.last)])
            if amplitude:
                shape = self.content.amplitudes[folded(amplitude)]
                track.add(_shaped(value, shape, begin, start, step.period))
                if shape.total:
                    track.shape, self.lasting[id(track)] = (value, shape), track
            else:
                track.add([(begin + 1, value)])
        for number_of_track, track in self.lasting.items():
            if number_of_track not in changed and track.shape is not None:
                track.add(_shaped(*track.shape, begin, start, step.period))
        self.changing, self.first, self.dying = Values(), Values(), {}

    def _track(self, names: list[Name], rest: float, given: Values[Name]) -> Track:
        """Return a track for these names only: the existing track, a new track, or a copy of a track with more names."""
        track = self.tracks.get(names[0])
        if track is not None and track.size == len(names):
            return track
        if track is None:
            track = Track(array("d", (0.0, rest)), given.get(names[0])[2], len(names))
        else:
            track.size -= len(names)
            track = replace(track, numbers=track.numbers[:], size=len(names))
        self.tracks.update((name, track) for name in names)
        return track

    def distinct(self) -> list[Track]:
        """Return all tracks without repetition."""
        return list({id(track): track for track in self.tracks.values()}.values())

    def table(self, name: Name) -> Table:
        """Return the history up to the end of the last step as load factors and values."""
        points, end = self.tracks[name].points, float(len(self.content.steps))
        return points if points[-1][0] >= end else (*points, (end, points[-1][1]))

    def alike(self) -> Iterator[tuple[Table, list[Name]]]:
        """Yield each distinct history with the names that share it."""
        members: dict[bytes, list[Name]] = {}
        for name, track in self.tracks.items():
            members.setdefault(track.numbers.tobytes(), []).append(name)
        for names in members.values():
            yield self.table(names[0]), names


def _equal(*columns: AnyArray) -> Iterator[Indices]:
    """Yield groups of rows with equal entries in all columns (n,), in order of first occurrence."""
    order = np.lexsort(columns)
    differs = np.zeros(max(len(order) - 1, 0), bool)
    for column in columns:
        ascending = column[order]
        differs |= ascending[1:] != ascending[:-1]
    bounds = np.array([0, *(np.flatnonzero(differs) + 1), len(order)])[len(order) == 0 :]
    for group in np.argsort(order[bounds[:-1]]):
        yield order[bounds[group] : bounds[group + 1]]


class ByShape(Generic[Name]):
    """Histories of points along axes, grouped by axis and shape, so that many nodal values become a few loads.

    For body forces, points are cells and axes are kinds of force. Iteration yields the axis, the points, the value and the
    history of each group. The value is 1 if it is uniform; otherwise it is a function that returns the values of the points,
    which are in ascending order.
    """

    def __init__(self) -> None:
        self._members: dict[tuple[Name, Table], tuple[Table, array[float], array[int]]] = {}

    def add(self, axis: Name, table: Table, points: Sequence[int]) -> None:
        """Add the history of some points along an axis."""
        size = max((value for _, value in table), key=abs)
        shape = tuple((time, round(value / size, ALIKE)) for time, value in table) if size else table
        _, sizes, members = self._members.setdefault((axis, shape), (table, array("d"), array("q")))
        sizes.extend([size] * len(points))
        members.extend(points)

    @staticmethod
    def of(alike: Iterable[tuple[Table, Sequence[int]]]) -> ByShape[int]:
        """Return the histories of quantities without a direction; their axis is 0."""
        by_shape = ByShape[int]()
        for table, points in alike:
            by_shape.add(0, table, points)
        return by_shape

    def __iter__(self) -> Iterator[tuple[Name, Indices, Any, Table]]:
        for (axis, shape), (table, sizes, members) in self._members.items():
            points, which = np.unique(members, return_inverse=True)
            if len(points) == len(members) and min(sizes) == max(sizes):
                yield axis, np.asarray(members), 1.0, table
            else:  # several values at a point are added
                yield axis, points, partial(given_values, np.bincount(which, sizes).astype(float)), shape


def given_values(values: Array, positions: Array) -> Array:
    """Return `values` (n,), each repeated k times for k n positions; the positions (k n, dim) [length] are not used."""
    return np.repeat(values, len(positions) // len(values))


def _shaped(value: float, shape: Amplitude, begin: float, start: float, period: float) -> list[tuple[float, float]]:
    """Return load factors and values of an amplitude in a step that begins at the load factor `begin`.

    `start` is the total time at the start of the step and `period` its duration.
    """
    first = start if shape.total else 0.0
    low, high = bisect_right(shape.times, first), bisect_left(shape.times, first + period)
    times = [first, *shape.times[low:high], first + period]
    around = slice(max(low - 1, 0), high + 1)
    values = np.interp(times, shape.times[around], shape.values[around])
    ends = [(t - first) / period for t in times[:-1]] + [1.0]
    return [(begin + t, value * float(v)) for t, v in zip(ends, values, strict=True)]
