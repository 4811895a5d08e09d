"""A progress bar on a terminal."""

from __future__ import annotations

import sys
import time

from fastcontact.results.step import StepResult

WIDTH = 30


class Progress:
    """Steps done, active nodes, time left; nothing at all unless `show`."""

    def __init__(self, total: int, show: bool, done: int = 0) -> None:
        self._total, self._show, self._before = total, show, done
        self._started = time.perf_counter()

    def step(self, step: StepResult) -> None:
        """Redraw after a step."""
        if not self._show:
            return
        done = step.index / self._total
        each = (time.perf_counter() - self._started) / max(step.index - self._before, 1)
        left = each * (self._total - step.index)
        bar = "#" * round(WIDTH * done)
        closed = sum(int(contact.active.sum()) for contact in step.contact.values())
        text = f"step {step.index}/{self._total}, {closed} nodes in contact, {left:.0f} s left"
        sys.stderr.write(f"\r[{bar:<{WIDTH}}] {text:<50}")
        sys.stderr.flush()

    def close(self) -> None:
        """Clear the line."""
        if self._show:
            sys.stderr.write("\r" + " " * (WIDTH + 54) + "\r")
            sys.stderr.flush()
