"""Who is told that kernels are being compiled, which takes some seconds where all were silent."""

from __future__ import annotations

import logging
from collections.abc import Callable

TEXT = "compiling kernels: once, for some seconds; they are kept for later runs"
log = logging.getLogger("fastcontact")
# Called as a kernel is compiled; one that is read from the disk cache is not.
listeners: list[Callable[[], None]] = []
count = 0  # of kernels that were compiled in this process


def notify() -> None:
    """Tell all listeners, and once in a process the log at level INFO."""
    global count
    count += 1
    if count == 1:
        log.info(TEXT)
    for listener in tuple(listeners):
        listener()
