"""Handling of Ctrl-C, SIGTERM and SIGHUP, which are sent again if Python discards the exception that they cause.

SIGTERM, which schedulers send, and SIGHUP, which a closing terminal sends, are handled like Ctrl-C, because by default they
would end the process and leave incomplete files.

Python can raise KeyboardInterrupt at any point of a program. In a finaliser or in a callback from a C library, such as LLVM
during the compilation of a kernel, Python prints and discards the exception, and the command would continue. During the
import of a C extension module, another error may replace the exception.
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

DELAY = 0.05  # time after which a signal is sent again [s]
# Time after a signal in which further signals are ignored as repetitions [s].
REPETITION_TIME = 0.5
DEFAULT_HANDLERS: dict[int, Any] = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}
if hasattr(signal, "SIGHUP"):
    DEFAULT_HANDLERS[signal.SIGHUP] = signal.SIG_DFL
# Exit codes by signal, as in shells.
EXIT_CODES: dict[int, int] = {number: 128 + number for number in DEFAULT_HANDLERS}
IMPORT_MODULES = ("importlib._bootstrap", "_frozen_importlib")
COMMAND_LINE = "fastcontact.cli._main"


@contextlib.contextmanager
def interruptible(received_signals: list[int] | None = None) -> Iterator[None]:
    """Let Ctrl-C, SIGTERM and SIGHUP interrupt a ``with`` block by KeyboardInterrupt, even if Python discards it at first.

    The numbers of the signals are appended to the list `received_signals`. Signals with a handler other than the default one
    keep it.
    """
    times: list[float] = []  # times of the signals whose exception was not discarded [s]
    received_signals = [] if received_signals is None else received_signals
    in_main_thread = threading.current_thread() is threading.main_thread()
    numbers = [n for n, default in DEFAULT_HANDLERS.items() if in_main_thread and signal.getsignal(n) == default]

    def interrupt(number: int, frame: FrameType | None) -> None:
        if times and time.monotonic() - times[-1] < REPETITION_TIME:
            return
        if _is_importing(frame):
            _send_later(number)
        else:
            received_signals.append(number)
            times.append(time.monotonic())
            raise KeyboardInterrupt

    try:
        with _repeating_discarded_interrupts(received_signals, times), restoring_interrupt(received_signals):
            for number in numbers:
                signal.signal(number, interrupt)
            yield
    finally:
        for number in numbers:
            signal.signal(number, DEFAULT_HANDLERS[number])


@contextlib.contextmanager
def restoring_interrupt(received_signals: list[int]) -> Iterator[None]:
    """Raise KeyboardInterrupt if a C function has replaced the KeyboardInterrupt of a signal by another error.

    `received_signals` contains the numbers of signals. An error that is raised while KeyboardInterrupt is handled is genuine.
    """
    try:
        yield
    except Exception as error:
        if received_signals and not isinstance(error.__context__, KeyboardInterrupt):
            raise KeyboardInterrupt from error
        raise


@contextlib.contextmanager
def _repeating_discarded_interrupts(received_signals: list[int], times: list[float]) -> Iterator[None]:
    """Send a signal again if Python discards its KeyboardInterrupt; hide errors in finalisers after a signal.

    `received_signals` contains the numbers of signals, and `times` the times of those whose exception was not discarded.
    """
    original = sys.unraisablehook

    def handle(unraisable: sys.UnraisableHookArgs) -> None:
        if issubclass(unraisable.exc_type, KeyboardInterrupt):
            times.clear()
            _send_later(received_signals[-1] if received_signals else signal.SIGINT)
        elif not received_signals:
            original(unraisable)

    sys.unraisablehook = handle
    try:
        yield
    finally:
        sys.unraisablehook = original


def release_objects(error: BaseException | None) -> None:
    """Release the objects that are referenced by the traceback of an error, and hide messages of failing finalisers."""
    original, sys.unraisablehook = sys.unraisablehook, lambda ignored: None
    try:
        while error is not None:
            traceback.clear_frames(error.__traceback__)
            error = error.__context__
    finally:
        sys.unraisablehook = original


def send_to_main_thread(number: int) -> None:
    """Send a signal to the main thread, which interrupts it even while it waits for a lock."""
    main = threading.main_thread().ident
    if hasattr(signal, "pthread_kill") and main is not None:
        signal.pthread_kill(main, number)
    else:
        signal.raise_signal(number)


def _send_later(number: int) -> None:
    """Send a signal to the main thread after a delay."""
    timer = threading.Timer(DELAY, send_to_main_thread, (number,))
    timer.daemon = True
    timer.start()


def _is_importing(frame: FrameType | None) -> bool:
    """Return whether a frame belongs to the import of a module by the command."""
    while frame is not None and frame.f_globals.get("__name__") != COMMAND_LINE:
        if frame.f_globals.get("__name__") in IMPORT_MODULES:
            return True
        frame = frame.f_back
    return False
