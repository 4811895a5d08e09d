"""Ctrl-C, which waits until it can be heard.

Python raises KeyboardInterrupt wherever it happens to be. In a finaliser, and in a function that a library in C calls back,
such as LLVM while a kernel is compiled, it prints the exception and forgets it: the command would go on. Modules in C make
another error of it while they are imported.
"""

from __future__ import annotations

import contextlib
import signal
import sys
import threading
import traceback
from collections.abc import Iterator
from types import FrameType

AGAIN = 0.05  # [s]
IMPORTING = ("importlib._bootstrap", "_frozen_importlib")
COMMAND_LINE = "fastcontact.cli._main"


@contextlib.contextmanager
def interruptible() -> Iterator[None]:
    """Let Ctrl-C interrupt the block where the exception is not lost; nothing is done where another handler is set."""
    ours = threading.current_thread() is threading.main_thread()
    if not ours or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    raised = threading.Event()

    def interrupt(number: int, frame: FrameType | None) -> None:
        if _is_importing(frame):
            _again(number)
        else:
            raised.set()
            raise KeyboardInterrupt

    try:
        with _lost_ones_come_again(raised):
            signal.signal(signal.SIGINT, interrupt)
            yield
    except Exception as error:
        # Some functions in C make another error of it; what is raised where it was caught is meant.
        if raised.is_set() and not isinstance(error.__context__, KeyboardInterrupt):
            raise KeyboardInterrupt from error
        raise
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@contextlib.contextmanager
def _lost_ones_come_again(raised: threading.Event) -> Iterator[None]:
    """Repeat an interruption that Python would print and forget; once one was `raised`, finalisers have nothing to say."""
    before = sys.unraisablehook

    def lost(found: sys.UnraisableHookArgs) -> None:
        if issubclass(found.exc_type, KeyboardInterrupt):
            _again(signal.SIGINT)
        elif not raised.is_set():
            before(found)

    sys.unraisablehook = lost
    try:
        yield
    finally:
        sys.unraisablehook = before


def forget(error: BaseException | None) -> None:
    """Let go of what was being made when a command was interrupted: finalisers of half of it may fail, and say so."""
    before, sys.unraisablehook = sys.unraisablehook, lambda found: None
    try:
        while error is not None:
            traceback.clear_frames(error.__traceback__)
            error = error.__context__
    finally:
        sys.unraisablehook = before


def to_main_thread(number: int) -> None:
    """Send a signal to the main thread, which wakes it also where it waits for a lock."""
    main = threading.main_thread().ident
    if hasattr(signal, "pthread_kill") and main is not None:
        signal.pthread_kill(main, number)
    else:
        signal.raise_signal(number)


def _again(number: int) -> None:
    timer = threading.Timer(AGAIN, to_main_thread, (number,))
    timer.daemon = True
    timer.start()


def _is_importing(frame: FrameType | None) -> bool:
    """Return whether something is imported between the command line and the place where Python is."""
    while frame is not None and frame.f_globals.get("__name__") != COMMAND_LINE:
        if frame.f_globals.get("__name__") in IMPORTING:
            return True
        frame = frame.f_back
    return False
