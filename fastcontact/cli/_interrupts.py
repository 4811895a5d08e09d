"""Handling of Ctrl-C, SIGTERM and SIGHUP, which are sent again if Python loses the exception.

SIGTERM, which schedulers send, and SIGHUP, which a closing terminal sends, are handled like Ctrl-C, because by default they
would leave incomplete files.

Python can raise KeyboardInterrupt at any point of a program. In a finaliser or in a callback from a C library, such as LLVM
during the compilation of a kernel, Python prints the exception and discards it, and the command would continue. While a C
extension module is imported, the exception may become another error.
"""

from __future__ import annotations

import contextlib
import signal
import sys
import threading
import time
import traceback
from collections.abc import Iterator
from types import FrameType
from typing import Any

AGAIN = 0.05  # delay before a signal is repeated [s]
# Time in which another signal is treated as a repetition of the last one [s].
REPEATED = 0.5
HANDLERS: dict[int, Any] = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
if hasattr(signal, "SIGHUP"):
    HANDLERS[signal.SIGHUP] = signal.SIG_DFL
# Exit codes by signal, as in shells.
CODES: dict[int, int] = {number: 128 + number for number in HANDLERS}
IMPORTING = ("importlib._bootstrap", "_frozen_importlib")
COMMAND_LINE = "fastcontact.cli._main"


@contextlib.contextmanager
def interruptible(raised: list[int] | None = None) -> Iterator[None]:
    """Let Ctrl-C, SIGTERM and SIGHUP interrupt the block at a point where the exception is not lost.

    The numbers of the signals received are appended to the list `raised`. Signals whose handler is not the default keep
    their handler.
    """
    heard: list[float] = []  # times of signals whose exception was not lost
    raised = [] if raised is None else raised
    in_main_thread = threading.current_thread() is threading.main_thread()
    numbers = [number for number, usual in HANDLERS.items() if in_main_thread and signal.getsignal(number) == usual]

    def interrupt(number: int, frame: FrameType | None) -> None:
        if heard and time.monotonic() - heard[-1] < REPEATED:
            return
        if _is_importing(frame):
            _again(number)
        else:
            raised.append(number)
            heard.append(time.monotonic())
            raise KeyboardInterrupt

    try:
        with _lost_ones_come_again(raised, heard), meant(raised):
            for number in numbers:
                signal.signal(number, interrupt)
            yield
    finally:
        for number in numbers:
            signal.signal(number, HANDLERS[number])


@contextlib.contextmanager
def meant(raised: list[int]) -> Iterator[None]:
    """Raise KeyboardInterrupt if a signal was `raised` and a C function has replaced the exception by another error."""
    try:
        yield
    except Exception as error:
        if raised and not isinstance(
            error.__context__, KeyboardInterrupt
        ):  # otherwise the exception was not lost, and the error is genuine
            raise KeyboardInterrupt from error
        raise


@contextlib.contextmanager
def _lost_ones_come_again(raised: list[int], heard: list[float]) -> Iterator[None]:
    """Repeat an interruption that Python would discard; after a signal was `raised`, errors in finalisers are not printed."""
    before = sys.unraisablehook

    def lost(unraisable: sys.UnraisableHookArgs) -> None:
        if issubclass(unraisable.exc_type, KeyboardInterrupt):
            heard.clear()
            _again(raised[-1] if raised else signal.SIGINT)
        elif not raised:
            before(unraisable)

    sys.unraisablehook = lost
    try:
        yield
    finally:
        sys.unraisablehook = before


def forget(error: BaseException | None) -> None:
    """Release the objects that an interrupted command was creating, without the messages of failing finalisers."""
    before, sys.unraisablehook = sys.unraisablehook, lambda ignored: None
    try:
        while error is not None:
            traceback.clear_frames(error.__traceback__)
            error = error.__context__
    finally:
        sys.unraisablehook = before


def to_main_thread(number: int) -> None:
    """Send a signal to the main thread, which interrupts it even while it waits for a lock."""
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
    """Return whether a frame belongs to an import that the command has begun."""
    while frame is not None and frame.f_globals.get("__name__") != COMMAND_LINE:
        if frame.f_globals.get("__name__") in IMPORTING:
            return True
        frame = frame.f_back
    return False
