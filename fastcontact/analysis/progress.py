"""Progress on a terminal or in a notebook: one line on standard error, drawn anew after every load step."""

from __future__ import annotations

import sys
import time
from typing import TypeVar

from fastcontact._jit import compiling
from fastcontact.results.step import StepResult

WIDTH = 30
Line = TypeVar("Line", bound="StatusLine")


class StatusLine:
    """A line of `width` characters on standard error; nothing at all unless `show`."""

    def __init__(self, width: int, show: bool) -> None:
        self._width, self._show = width, show
        self._started = time.perf_counter()

    def __enter__(self: Line) -> Line:
        compiling.listeners.append(self._compiling)
        return self

    def __exit__(self, *_: object) -> None:
        compiling.listeners.remove(self._compiling)
        self.close()

    def _compiling(self) -> None:
        self.draw(compiling.TEXT)

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
