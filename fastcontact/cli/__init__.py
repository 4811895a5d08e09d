"""The command line: one file a sub-command; only here do things print and parse arguments."""

from __future__ import annotations

import atexit
import contextlib
import os
import signal
import sys
import threading
from collections.abc import Sequence

INTERRUPTED = 130  # as shells have it
STOPPED = (129, 130, 143)  # by a signal


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    try:
        from fastcontact.cli._main import main as run  # may be interrupted, too

        return run(argv)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return INTERRUPTED


def entry_point() -> None:
    """Run the command line and exit with its code."""
    _open_standard_files()
    # Threads of BLAS spin between the small products here; loops of our own have those of Numba.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        code = main()
    except SystemExit as asked:  # of --help and --version
        code = int(asked.code or 0)
    from fastcontact.cli._terminal import flushed

    code = flushed(code)
    if code in STOPPED:
        for stopped in STOPPED:  # nothing that comes now changes the exit code
            with contextlib.suppress(ValueError):  # a system without this signal
                signal.signal(stopped - 128, signal.SIG_IGN)
        sys.unraisablehook = lambda found: None  # finalisers of what was left half made
    else:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # nothing is left to say: Ctrl-C ends at once
        _end_at_once(code)
    sys.exit(code)


def _end_at_once(code: int) -> None:
    """End the process without freeing its memory object by object, which takes a tenth of a short run."""
    if threading.active_count() == 1:
        atexit._run_exitfuncs()
        os._exit(code)


def _open_standard_files() -> None:
    """Open files 0 to 2 on nothing where a process is started without them: the next file opened would take their place."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
