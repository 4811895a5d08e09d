"""Announcement of the compilation of kernels, which may take a minute, and requests for helper processes."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable

ANNOUNCEMENT = "compiling kernels, which takes up to a minute; later runs reuse them"
log = logging.getLogger("fastcontact")
count = 0  # number of kernels that this process has compiled, or has run in Python instead
_announced = False


def notify() -> None:
    """Announce that a kernel is being compiled, count it, and request helpers."""
    announce()
    count_uncompiled()


def announce() -> None:
    """Notify all listeners that kernels are being compiled, and log this once per process at level INFO."""
    global _announced
    if not _announced:
        _announced = True
        log.info(ANNOUNCEMENT)
    for listener in list(listeners):
        listener()


def count_uncompiled() -> None:
    """Count a kernel that has no compiled version, and request helpers."""
    global count
    count += 1
    for request in list(helper_requests):
        request()


def wait(name: str) -> bool:
    """Wait for helpers that compile a kernel called `name`; return whether there were any.

    If there were any, the file of the kernel may now exist.
    """
    return any(waiter(name) for waiter in waiters)


def print_announcement() -> None:
    """Print the announcement once in a terminal or a notebook, unless the log or another listener shows it."""
    listeners.remove(print_announcement)
    visible = sys.stderr is not None and (sys.stderr.isatty() or "ipykernel" in sys.modules)
    if not listeners and not log.isEnabledFor(logging.INFO) and visible and not in_worker():
        print(f"fastcontact: {ANNOUNCEMENT}", file=sys.stderr, flush=True)


def in_worker() -> bool:
    """Return whether this is a worker process of `multiprocessing`, without importing that module."""
    multiprocessing = sys.modules.get("multiprocessing")
    return multiprocessing is not None and multiprocessing.parent_process() is not None


# Functions that are called when this process compiles a kernel or waits for one, but not when it reads a kernel from the
# cache.
listeners: list[Callable[[], None]] = [print_announcement]
# Functions of `ahead` that are called when a kernel has no compiled version, to start helpers.
helper_requests: list[Callable[[], None]] = []
# Functions of `ahead` that wait for a helper that compiles a kernel.
waiters: list[Callable[[str], bool]] = []
