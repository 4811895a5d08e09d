"""Command line with one module per subcommand. No other module of the package parses arguments."""

from __future__ import annotations

import contextlib
import gc
import os
import signal
import sys
from collections.abc import Sequence

INTERRUPTED = 130  # exit code after SIGINT, as in shells
STOPPED = (129, 130, 143)  # exit codes after SIGHUP, SIGINT and SIGTERM


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    try:
        from fastcontact.cli._main import main as run  # the import can be interrupted as well

        return run(argv)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return INTERRUPTED


def entry_point() -> None:
    """Run the command line and exit with its code."""
    _open_standard_files()
    # Almost all objects exist until the end of a command, and a run leaves no reference cycles. Searching the objects of a
    # short run for garbage, of which there are 200 000, would take a sixth of its time.
    gc.set_threshold(500_000)
    # Further BLAS threads would spin idly between many small products. Compiled loops use separate threads.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        code = main()
    except SystemExit as exit_request:  # raised by --help and --version
        code = int(exit_request.code or 0)
    from fastcontact.cli._terminal import flush_output

    code = flush_output(code)
    if code in STOPPED:
        for exit_code in STOPPED:  # further signals must not change the exit code
            with contextlib.suppress(ValueError):  # a platform without this signal
                signal.signal(exit_code - 128, signal.SIG_IGN)
        sys.unraisablehook = lambda ignored: None  # hides errors in finalisers of partly created objects
    else:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # Ctrl-C may end the process now that all output is written
    gc.freeze()  # excludes all objects from the garbage collection at exit
    sys.exit(code)


def _open_standard_files() -> None:
    """Open closed standard files (descriptors 0 to 2) on the null device, so that no other file takes their descriptors."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
