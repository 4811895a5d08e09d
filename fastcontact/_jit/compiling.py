"""Notification that kernels are being compiled, which may take a minute."""

from __future__ import annotations

import logging
import multiprocessing
import sys
from collections.abc import Callable

TEXT = "compiling kernels: once, for up to a minute; they are kept for later runs"
log = logging.getLogger("fastcontact")
count = 0  # of kernels that were compiled in this process


def notify() -> None:
    """Tell all listeners, and once in a process the log at level INFO."""
    global count
    count += 1
    if count == 1:
        log.info(TEXT)
    for listener in tuple(listeners):
        listener()


def tell_who_waits() -> None:
    """Say it once where somebody waits at a terminal or a notebook, and neither the log nor another listener says it."""
    listeners.remove(tell_who_waits)
    if not listeners and not log.isEnabledFor(logging.INFO) and _somebody_waits():
        print(f"fastcontact: {TEXT}", file=sys.stderr, flush=True)


def _somebody_waits() -> bool:
    """Return whether somebody sees the error output, and this is no process that works for another one."""
    seen = sys.stderr is not None and (sys.stderr.isatty() or "ipykernel" in sys.modules)
    return seen and multiprocessing.parent_process() is None


# Called as a kernel is compiled; one that is read from the disk cache is not.
listeners: list[Callable[[], None]] = [tell_who_waits]
