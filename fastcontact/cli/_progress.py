"""Progress on a terminal: one line, drawn anew after every load step, run or mesh."""

from __future__ import annotations

import sys
import time
from typing import Any

from fastcontact.results.step import StepResult

WIDTH = 30


class StatusLine:
    """A line of `width` characters on standard error; nothing at all unless `show`."""

    def __init__(self, width: int, show: bool) -> None:
        self._width, self._show = width, show
        self._started = time.perf_counter()

    def draw(self, text: str) -> None:
        """Replace the line."""
        if self._show:
            sys.stderr.write(f"\r{text:<{self._width}}")
            sys.stderr.flush()

    def close(self) -> None:
        """Clear the line."""
        if self._show:
            sys.stderr.write("\r" + " " * self._width + "\r")
            sys.stderr.flush()


class Progress(StatusLine):
    """Load steps of a run: steps done, nodes in contact, time left."""

    def __init__(self, total: int, show: bool, done: int = 0) -> None:
        super().__init__(WIDTH + 54, show)
        self._total, self._before = total, done

    def step(self, step: StepResult) -> None:
        """Redraw after a step."""
        if not self._show:
            return
        each = (time.perf_counter() - self._started) / max(step.index - self._before, 1)
        bar = "#" * round(WIDTH * step.index / self._total)
        closed = sum(int(contact.active.sum()) for contact in step.contact.values())
        left = each * (self._total - step.index)
        self.draw(f"[{bar:<{WIDTH}}] step {step.index}/{self._total}, {closed} nodes in contact, {left:.0f} s left")


class Runs(StatusLine):
    """Runs of a study: the one that has ended, how many are left, and for how long."""

    def __init__(self, show: bool) -> None:
        super().__init__(100, show)
        self._stored = 0

    def __call__(self, progress: Any) -> None:
        """Redraw after a run; `progress` is a `fastcontact.studies.execute.Progress`."""
        self._stored += progress.stored
        solved = progress.done - self._stored
        outcome = "failed" if progress.error else "found in the store" if progress.stored else "done"
        each, count = (time.perf_counter() - self._started) / max(solved, 1), len(progress.left)
        left = f", {count} left: about {each * count:.0f} s" if solved and count else ""
        self.draw(f"{progress.done}/{progress.total} {progress.label} {outcome}{left}")
