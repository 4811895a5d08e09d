"""Notification of the user that kernels are being compiled, which may take a minute."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable

TEXT = "compiling kernels: once, for up to a minute; they are kept for later runs"
log = logging.getLogger("fastcontact")
count = 0  # kernels compiled in this process, plus calls computed in Python instead
_reported = False


def notify() -> None:
    """Notify that a kernel is being compiled, and request helpers."""
    tell()
    replace()


def tell() -> None:
    """Notify all listeners that kernels are being compiled; log this once per process at level INFO."""
    global _reported
    if not _reported:
        _reported = True
        log.info(TEXT)
    for listener in list(listeners):
        listener()


def replace() -> None:
    """Count a kernel without compiled version, and request helpers."""
    global count
    count += 1
    for helper in list(helpers):
        helper()


def wait(name: str) -> bool:
    """Wait for a helper that compiles a kernel of this name; return whether there was one, so that the file may exist."""
    return any(waiter(name) for waiter in waiters)


def tell_who_waits() -> None:
    """Print the notification once to a terminal or a notebook, unless the log or another listener shows it."""
    listeners.remove(tell_who_waits)
    if not listeners and not log.isEnabledFor(logging.INFO) and _somebody_waits():
        print(f"fastcontact: {TEXT}", file=sys.stderr, flush=True)


def _somebody_waits() -> bool:
    """Return whether the error output is visible to a user, and this is not a worker process."""
    seen = sys.stderr is not None and (sys.stderr.isatty() or "ipykernel" in sys.modules)
    return seen and not in_worker()


def in_worker() -> bool:
    """Return whether this is a worker process, in which `multiprocessing` is already imported."""
    processes = sys.modules.get("multiprocessing")
    return processes is not None and processes.parent_process() is not None


# Called when a kernel is compiled or waited for, but not when it is read from the disk cache.
listeners: list[Callable[[], None]] = [tell_who_waits]
# Called when a kernel has no compiled version, and when a helper may be compiling a needed kernel: see `ahead`.
helpers: list[Callable[[], None]] = []
waiters: list[Callable[[str], bool]] = []
