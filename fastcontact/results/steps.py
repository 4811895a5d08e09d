"""Sequences of steps, and the list of the steps of an analysis with a concise representation."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import SupportsIndex, overload

from fastcontact._tools.html_table import html_table
from fastcontact.errors import ModelError
from fastcontact.results.step import StepResult

# Largest number of steps in the representation of a list.
SHOWN = 30


class StepSequence(Sequence[StepResult]):
    """A sequence of steps, each of which is read or computed on access."""

    @abstractmethod
    def _step(self, position: int) -> StepResult: ...

    @overload
    def __getitem__(self, number: int) -> StepResult: ...
    @overload
    def __getitem__(self, number: slice) -> list[StepResult]: ...
    def __getitem__(self, number: int | slice) -> StepResult | list[StepResult]:
        """Return a step by its index, or a list of steps for a slice."""
        chosen = self._chosen(number)
        return self._step(chosen) if isinstance(chosen, int) else [self._step(position) for position in chosen]

    def _chosen(self, number: int | slice) -> int | range:
        """Return the position of a step, or the positions of a slice."""
        return range(len(self))[number]


class Steps(list[StepResult]):
    """A list of `StepResult` that notebooks display as a table."""

    @overload
    def __getitem__(self, index: SupportsIndex) -> StepResult: ...
    @overload
    def __getitem__(self, index: slice) -> Steps: ...
    def __getitem__(self, index: SupportsIndex | slice) -> StepResult | Steps:
        """Return a step, or `Steps` for a slice."""
        if isinstance(index, slice):
            return Steps(super().__getitem__(index))
        return super().__getitem__(index)

    def __repr__(self) -> str:
        lines = (f"  {step!r}" for step in _shown(self))
        return "\n".join([f"{len(self)} steps", *lines, *(["  ..."] if len(self) > SHOWN else [])])

    def _repr_html_(self) -> str:
        """Return an HTML table with a row for each contact pair of each step."""
        rows = [row for step in _shown(self) for row in rows_of(step)]
        left_out = f", {len(self) - SHOWN} of them not shown" if len(self) > SHOWN else ""
        return html_table(rows, HEAD, f"{len(self)} steps{left_out}")


HEAD = ("step", "load factor", "pairings", "contact", "force", "largest pressure", "closed", "contact radius")


def _shown(steps: Steps) -> Iterable[StepResult]:
    """Return the steps in the representation, which are the last steps of a long list."""
    return list(steps)[-SHOWN:]


def rows_of(step: StepResult) -> list[tuple[str, ...]]:
    """Return a row of strings with the columns `HEAD` for each contact pair of a step, or one row if there are no pairs."""
    begin = (str(step.index), f"{step.load_factor:.6g}", str(step.iterations.get("geometry_updates", "")))
    pairs = [(name, *contact.shown.values()) for name, contact in step.contact.items()]
    return [(*begin, *pair) for pair in pairs] or [(*begin, *[""] * (len(HEAD) - len(begin)))]


def phases(shape: StepResult, count: int) -> list[StepResult]:
    """Return a vibration with a given shape at `count` equidistant phases, as steps.

    The load factor of a step is its phase in periods, in [0, 1). Raises ModelError if `count` is less than two.
    """
    if count < 2:
        raise ModelError(f"count = {count}: a period needs two phases or more")
    return [_times(shape, k + 1, k / count, math.cos(2.0 * math.pi * k / count)) for k in range(count)]


def _times(shape: StepResult, index: int, phase: float, factor: float) -> StepResult:
    return replace(
        shape, index=index, load_factor=phase, displacement=factor * shape.displacement, stress=factor * shape.stress,
        von_mises=abs(factor) * shape.von_mises, von_mises_signed=factor * shape.von_mises_signed, restart=None,
        iterations={"parameter": "phase"},
    )  # fmt: skip
