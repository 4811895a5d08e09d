"""Who is told that kernels are being compiled, which takes some seconds where all were silent."""

from __future__ import annotations

import logging
from collections.abc import Callable

TEXT = "compiling kernels: once, for some seconds; they are kept for later runs"
log = logging.getLogger("fastcontact")
# Called as a kernel is compiled; one that is read from the disk cache is not.
listeners: list[Callable[[], None]] = []
_told = False


def notify() -> None:
    """Tell all listeners, and once in a process the log at level INFO."""
    global _told
    if not _told:
        _told = True
        log.info(TEXT)
    for listener in tuple(listeners):
        listener()
