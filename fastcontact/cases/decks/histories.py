"""Histories of supports and loads over the steps of a deck: step k runs from load factor k - 1 to k."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Generic, TypeVar

import numpy as np

from fastcontact.cases.decks.blocks import Place, folded
from fastcontact.cases.decks.content import Amplitude, Content, Step
from fastcontact.model.ramp import Table

Name = TypeVar("Name", bound=Hashable)
# How long a jump lasts at the beginning of a step, of its length.
JUMP = 1e-9


@dataclass
class Track:
    """The value of one quantity through the steps, as points (load factor, value)."""

    points: list[tuple[float, float]]
    place: Place
    alive: bool = True
    lasting: tuple[float, Amplitude] | None = None

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

    `changing` are those given in the current step, with the place of each; `rest` what quantities have before they are given,
    zero where it does not say; `first` what was given before all steps for the first one, unless that says otherwise.
    """

    content: Content
    tracks: dict[Name, Track] = field(default_factory=dict)
    changing: dict[Name, tuple[float, str, Place]] = field(default_factory=dict)
    rest: Mapping[Name, float] = field(default_factory=dict)
    first: dict[Name, tuple[float, str, Place]] = field(default_factory=dict)

    def give(self, name: Name, value: float, amplitude: str, place: Place) -> None:
        """Give a value for the current step; CaseError if the step has another one for the same."""
        if name in self.changing and self.changing[name][:2] != (value, amplitude):
            raise place.refuse(
                f"{value:g} is the second value here in one step, after {self.changing[name][0]:g} in line "
                f"{self.changing[name][2].line}: programs differ in what that means, so give it once"
            )
        self.changing[name] = (value, amplitude, place)

    def hold(self, name: Name, place: Place) -> None:
        """Keep the value that the last step ended with."""
        if name in self.tracks:
            self.changing[name] = (self.tracks[name].last, "", place)

    def begin(self) -> None:
        """Take what was given before all steps as there from the beginning, at zero, and reached in the first step."""
        for name, (_, _, place) in self.changing.items():
            self.tracks[name] = Track([(0.0, 0.0)], place)
        self.first, self.changing = self.changing, {}

    def forget(self) -> None:
        """Drop what earlier steps gave."""
        self.first = {}
        for name, track in self.tracks.items():
            track.alive = name in self.changing

    def advance(self, number: int, step: Step) -> None:
        """Go on to the end of step `number`, from 1."""
        begin, start = float(number - 1), sum(s.period for s in self.content.steps[: number - 1])
        self.changing, self.first = {**self.first, **self.changing}, {}
        for name, (value, amplitude, place) in self.changing.items():
            if name not in self.tracks:
                rest = self.rest.get(name, 0.0)
                self.tracks[name] = Track([(0.0, rest)] + [(begin, rest)] * (number > 1), place)
            track = self.tracks[name]
            track.alive, track.lasting = True, None
            if amplitude:
                shape = self.content.amplitudes[folded(amplitude)]
                track.add(_shaped(value, shape, begin, start, step.period))
                track.lasting = (value, shape) if shape.total else None
            else:
                track.add([(begin, track.last), (begin + 1, value)])
        for name, track in self.tracks.items():
            if name in self.changing:
                continue
            if track.lasting and track.alive:
                track.add(_shaped(*track.lasting, begin, start, step.period))
            else:
                track.add([(begin, track.last), (begin + 1, track.last if track.alive else self.rest.get(name, 0.0))])
        self.changing = {}

    def table(self, name: Name) -> Table:
        """Return the whole history as a table of load factor and value."""
        return tuple(self.tracks[name].points)


def _shaped(value: float, shape: Amplitude, begin: float, start: float, period: float) -> list[tuple[float, float]]:
    """Return the points (load factor, value) of an amplitude in a step that begins at the load factor `begin`."""
    shift = start if shape.total else 0.0
    inside = [t - shift for t in shape.times if 0.0 < t - shift < period]
    times = [0.0, *inside, period]
    values = np.interp([t + shift for t in times], shape.times, shape.values)
    return [(begin + t / period, value * float(v)) for t, v in zip(times, values, strict=True)]
