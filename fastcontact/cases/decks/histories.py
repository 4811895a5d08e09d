"""Histories of supports and loads over the steps of a deck: step k runs from load factor k - 1 to k."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Generic, TypeVar

import numpy as np

from fastcontact.cases.decks.blocks import Location, folded
from fastcontact.cases.decks.content import Amplitude, Content, Step
from fastcontact.model.ramp import Table

Name = TypeVar("Name", bound=Hashable)
# How long a jump lasts at the beginning of a step, of its length.
JUMP = 1e-9
# Digits to which histories must agree, up to a factor, to count as one.
ALIKE = 12


@dataclass(slots=True)
class Track:
    """The value of quantities that were always given together, through the steps, as points (load factor, value)."""

    points: list[tuple[float, float]]
    location: Location
    size: int
    alive: bool = True
    shape: tuple[float, Amplitude] | None = None

    @property
    def last(self) -> float:
        """The value at the end of the last step so far."""
        return self.points[-1][1]

    def add(self, points: Iterable[tuple[float, float]]) -> None:
        """Go on with further points; one at the time of the last point and of another value becomes a jump."""
        for time, value in points:
            end, before = self.points[-1]
            if time <= end:
                if value == before:
                    continue
                time = end + JUMP
            self.points.append((time, value))


@dataclass
class Histories(Generic[Name]):
    """Histories by what they act on.

    `changing` are those given in the current step, with the place of each, `dying` those that earlier steps gave and this one
    lets go; `rest` what quantities have before they are given, zero where it does not say; `first` what was given before all
    steps for the first one, unless that says otherwise; `time` where the current step begins; `lasting` the tracks whose
    amplitudes go on in total time.
    """

    content: Content
    tracks: dict[Name, Track] = field(default_factory=dict)
    changing: dict[Name, tuple[float, str, Location]] = field(default_factory=dict)
    dying: dict[Name, None] = field(default_factory=dict)
    rest: Mapping[Name, float] = field(default_factory=dict)
    first: dict[Name, tuple[float, str, Location]] = field(default_factory=dict)
    time: float = 0.0
    lasting: dict[int, Track] = field(default_factory=dict)

    def give(self, name: Name, value: float, amplitude: str, location: Location) -> None:
        """Give a value for the current step; CaseError if the step has another one for the same."""
        if name in self.changing and self.changing[name][:2] != (value, amplitude):
            raise location.refuse(
                f"{value:g} is the second value here in one step, after {self.changing[name][0]:g} in line "
                f"{self.changing[name][2].line}: programs differ in what that means, so give it once"
            )
        self.changing[name] = (value, amplitude, location)
        self.dying.pop(name, None)

    def hold(self, name: Name, location: Location) -> None:
        """Keep the value that the last step ended with."""
        if name in self.tracks:
            self.changing[name] = (self.tracks[name].last, "", location)
            self.dying.pop(name, None)

    def begin(self) -> None:
        """Take what was given before all steps as there from the beginning, at zero, and reached in the first step."""
        for _, _, location in [*self.changing.values()][:1]:
            self.tracks = dict.fromkeys(self.changing, Track([(0.0, 0.0)], location, len(self.changing)))
        self.first, self.changing = self.changing, {}

    def forget(self, which: Callable[[Name], bool] = lambda name: True) -> None:
        """Drop what earlier steps gave."""
        self.first = {}
        for name, track in self.tracks.items():
            if track.alive and name not in self.changing and which(name):
                self.dying[name] = None

    def advance(self, number: int, step: Step) -> None:
        """Go on to the end of step `number`, from 1."""
        begin, start = float(number - 1), self.time
        self.time += step.period
        given = {**self.first, **self.changing}
        alike: dict[tuple[int, float, str, float, bool], list[Name]] = {}
        for name, (value, amplitude, _) in given.items():
            key = (id(self.tracks.get(name)), value, amplitude, self.rest.get(name, 0.0), True)
            alike.setdefault(key, []).append(name)
        for name in self.dying:
            rest = self.rest.get(name, 0.0)
            alike.setdefault((id(self.tracks[name]), rest, "", rest, False), []).append(name)
        changed = set()
        for (_, value, amplitude, rest, alive), names in alike.items():
            track = self._track(names, rest, given.get(names[0]))
            changed.add(id(track))
            track.alive = alive
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
        self.changing, self.first, self.dying = {}, {}, {}

    def _track(self, names: list[Name], rest: float, given: tuple[float, str, Location] | None) -> Track:
        """Return the track that these names alone have: theirs, a new one, or one apart from others that had the same."""
        track = self.tracks.get(names[0])
        if track is not None and track.size == len(names):
            return track
        if track is None:
            assert given is not None
            track = Track([(0.0, rest)], given[2], len(names))
        else:
            track.size -= len(names)
            track = replace(track, points=[*track.points], size=len(names))
        self.tracks.update(dict.fromkeys(names, track))
        return track

    def distinct(self) -> list[Track]:
        """Return all tracks, each once."""
        return list({id(track): track for track in self.tracks.values()}.values())

    def table(self, name: Name) -> Table:
        """Return the whole history as a table of load factor and value."""
        points, end = self.tracks[name].points, float(len(self.content.steps))
        return tuple(points) if points[-1][0] >= end else (*points, (end, points[-1][1]))

    def alike(self) -> list[tuple[Table, list[Name]]]:
        """Return all histories, each once, with what has it."""
        members: dict[int, list[Name]] = {}
        for name, track in self.tracks.items():
            members.setdefault(id(track), []).append(name)
        tables: dict[Table, list[Name]] = {}
        for names in members.values():
            tables.setdefault(self.table(names[0]), []).extend(names)
        return list(tables.items())


def shape_of(table: Table) -> tuple[float, Table]:
    """Return the largest value of a history by size, and the history over it."""
    size = max((value for _, value in table), key=abs)
    return size, tuple((time, round(value / size, ALIKE)) for time, value in table) if size else table


def _shaped(value: float, shape: Amplitude, begin: float, start: float, period: float) -> list[tuple[float, float]]:
    """Return the points (load factor, value) of an amplitude in a step that begins at the load factor `begin`."""
    first = start if shape.total else 0.0
    low, high = bisect_right(shape.times, first), bisect_left(shape.times, first + period)
    times = [first, *shape.times[low:high], first + period]
    around = slice(max(low - 1, 0), high + 1)
    values = np.interp(times, shape.times[around], shape.values[around])
    ends = [(t - first) / period for t in times[:-1]] + [1.0]
    return [(begin + t, value * float(v)) for t, v in zip(ends, values, strict=True)]
