"""Signals wait while a library that knows no exceptions is at work."""

from __future__ import annotations

import contextlib
import signal
import threading
from collections.abc import Iterator
from types import FrameType


@contextlib.contextmanager
def uninterrupted() -> Iterator[None]:
    """Let the signals that Python handles, such as Ctrl-C, wait until the block has ended.

    HDF5 calls back into Python to read and write. An exception that a signal raises there goes through C code that does
    not expect it, up to a crash. Python handles signals in its main thread only: in others there is nothing to do.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    arrived: list[tuple[int, FrameType | None]] = []
    handlers = {int(number): signal.getsignal(number) for number in signal.valid_signals()}
    try:
        with contextlib.ExitStack() as restored:  # which goes on restoring when something is raised meanwhile
            for number, handler in handlers.items():
                if callable(handler):
                    restored.callback(signal.signal, number, handler)
                    signal.signal(number, lambda *signal_and_frame: arrived.append(signal_and_frame))
            yield
    finally:
        for which, frame in arrived:
            handler = handlers[which]
            assert callable(handler)
            handler(which, frame)
