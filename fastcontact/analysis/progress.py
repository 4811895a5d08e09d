"""Progress on a terminal or in a notebook: one line on standard error, redrawn after every load step."""

from __future__ import annotations

import sys
import time
from typing import Self

from fastcontact._jit import compiling
from fastcontact.analysis import step_halving
from fastcontact.results.step import StepResult

# Number of characters of the bar, and number of characters reserved for its brackets and the text.
WIDTH, TEXT_WIDTH = 30, 54


class StatusLine:
    """A status line of `width` characters on standard error, shown only if `show` is true."""

    def __init__(self, width: int, show: bool) -> None:
        self._width, self._show = width, show
        self._started = time.perf_counter()
        self._reported = False

    def __enter__(self) -> Self:
        compiling.listeners.append(self._report_compilation)
        return self

    def __exit__(self, *_: object) -> None:
        compiling.listeners.remove(self._report_compilation)
        self.close()

    def _report_compilation(self) -> None:
        if not self._reported:
            self._reported = True
            self.draw(compiling.ANNOUNCEMENT)

    def draw(self, text: str) -> None:
        """Replace the line."""
        if self._show:
            # Return to the beginning of the line, so that a warning overwrites it.
            sys.stderr.write(f"\r{text:<{self._width}}\r")
            sys.stderr.flush()

    def close(self) -> None:
        """Clear the line."""
        self.draw("")


class Progress(StatusLine):
    """Progress of a run: completed load steps, nodes in contact, remaining time, and bisections of steps.

    The run has `total` steps, of which `done` are complete at the beginning.
    """

    def __init__(self, total: int, show: bool, done: int = 0) -> None:
        super().__init__(WIDTH + TEXT_WIDTH, show)
        self._total, self._n_untimed = total, done
        self._compiled = compiling.count

    def __enter__(self) -> Self:
        step_halving.listeners.append(self._report_halving)
        return super().__enter__()

    def __exit__(self, *raised: object) -> None:
        step_halving.listeners.remove(self._report_halving)
        super().__exit__(*raised)

    def _report_halving(self, index: int, begin: float, end: float) -> None:
        self.draw(f"step {index}/{self._total} does not converge, halved: {begin:.6g} to {end:.6g}")

    def step(self, step: StepResult, complete: int | None = None) -> None:
        """Redraw after a step; `complete` steps are done, by default all up to this one."""
        index = step.index if complete is None else complete
        if not self._show or not index:
            return
        bar = "#" * round(WIDTH * index / self._total)
        closed = sum(int(contact.active.sum()) for contact in step.contact.values())
        nodes = "1 node" if closed == 1 else f"{closed} nodes"
        self.draw(f"[{bar:<{WIDTH}}] step {index}/{self._total}, {nodes} in contact{self._remaining_time(index)}")

    def _remaining_time(self, index: int) -> str:
        """Return the text of the remaining time after a step; empty if kernels were compiled in this step."""
        if self._compiled != compiling.count:  # not representative of the following steps
            self._compiled, self._n_untimed, self._started = compiling.count, index, time.perf_counter()
            return ""
        seconds_per_step = (time.perf_counter() - self._started) / max(index - self._n_untimed, 1)
        return f", {seconds_per_step * (self._total - index):.0f} s left"
