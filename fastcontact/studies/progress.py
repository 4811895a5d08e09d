"""Progress of studies on a terminal or in a notebook, as a line that is redrawn after each run."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from typing import Any

from fastcontact.analysis.progress import StatusLine


class Runs(StatusLine):
    """Status line of a study with the last run, the number of remaining runs, and the remaining time."""

    def __init__(self, show: bool) -> None:
        super().__init__(100, show)
        self._stored = 0

    def __enter__(self) -> Runs:
        self.draw("the first runs")
        return super().__enter__()

    def __call__(self, progress: Any) -> None:
        """Redraw the line after a run; `progress` is a `fastcontact.studies.execute.Progress`."""
        self._stored += progress.stored
        solved = progress.done - self._stored
        outcome = "failed" if progress.error else "found in the store" if progress.stored else "done"
        each, count = (time.perf_counter() - self._started) / max(solved, 1), len(progress.left)
        left = f", {count} left: about {each * count:.0f} s" if solved and count else ""
        self.draw(f"{progress.done}/{progress.total} {progress.label} {outcome}{left}")


@contextlib.contextmanager
def reporting(on_progress: Callable[[Any], None] | None, show: bool) -> Iterator[Callable[[Any], None]]:
    """Yield a function to call after each run, which calls `on_progress` and, if `show` is true, redraws a status line."""
    with Runs(show) as line:

        def ended(progress: Any) -> None:
            line(progress)
            if on_progress is not None:
                on_progress(progress)

        yield ended
