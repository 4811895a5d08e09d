"""The steps of an analysis as a list with a concise representation."""

from __future__ import annotations

from collections.abc import Iterable
from typing import SupportsIndex, overload

from fastcontact._tools.html_table import html_table
from fastcontact.results.step import StepResult

# Length of the longest list whose steps are all shown.
SHOWN = 30


class Steps(list[StepResult]):
    """A list of `StepResult`; in a notebook it shows a table."""

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
        """Return a table, a row for each contact pair of each step, for notebooks."""
        rows = [row for step in _shown(self) for row in rows_of(step)]
        left_out = f", {len(self) - SHOWN} of them not shown" if len(self) > SHOWN else ""
        return html_table(rows, HEAD, f"{len(self)} steps{left_out}")


HEAD = ("step", "load factor", "pairings", "contact", "force", "largest pressure", "closed", "contact radius")


def _shown(steps: Steps) -> Iterable[StepResult]:
    """Return the steps to show: the last ones of a long list."""
    return list(steps)[-SHOWN:]


def rows_of(step: StepResult) -> list[tuple[str, ...]]:
    """Return a row of texts for each contact pair of a step, under `HEAD`; one row without pairs."""
    begin = (str(step.index), f"{step.load_factor:.6g}", str(step.iterations.get("geometry_updates", "")))
    pairs = [(name, *contact.shown.values()) for name, contact in step.contact.items()]
    return [(*begin, *pair) for pair in pairs] or [(*begin, *[""] * (len(HEAD) - len(begin)))]
