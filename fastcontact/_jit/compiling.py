"""Notification that kernels are being compiled, which may take a minute."""

from __future__ import annotations

import logging
import multiprocessing
import sys
from collections.abc import Callable

TEXT = "compiling kernels: once, for up to a minute; they are kept for later runs"
log = logging.getLogger("fastcontact")
count = 0  # of kernels that were compiled in this process, and of calls that Python computed in their place
_told = False


def notify() -> None:
    """Tell that a kernel is compiled, and call for help."""
    tell()
    replace()


def tell() -> None:
    """Tell all listeners, and once in a process the log at level INFO, that kernels are being compiled."""
    global _told
    if not _told:
        _told = True
        log.info(TEXT)
    for listener in list(listeners):
        listener()


def replace() -> None:
    """Count a kernel that was not found compiled, and call for help."""
    global count
    count += 1
    for helper in list(helpers):
        helper()


def wait(name: str) -> bool:
    """Wait for a helper that compiles a kernel of this name; return whether one did, so that the file may be there."""
    return any(waiter(name) for waiter in waiters)


def tell_who_waits() -> None:
    """Say it once where somebody waits at a terminal or a notebook, and neither the log nor another listener says it."""
    listeners.remove(tell_who_waits)
    if not listeners and not log.isEnabledFor(logging.INFO) and _somebody_waits():
        print(f"fastcontact: {TEXT}", file=sys.stderr, flush=True)


def _somebody_waits() -> bool:
    """Return whether somebody sees the error output, and this is no process that works for another one."""
    seen = sys.stderr is not None and (sys.stderr.isatty() or "ipykernel" in sys.modules)
    return seen and multiprocessing.parent_process() is None


# Called as a kernel is compiled or waited for; not where one is read from the disk cache.
listeners: list[Callable[[], None]] = [tell_who_waits]
# Called where a kernel is not found compiled, and where one is needed that a helper may be compiling: see `ahead`.
helpers: list[Callable[[], None]] = []
waiters: list[Callable[[str], bool]] = []
