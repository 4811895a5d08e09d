"""The command line, with a module for each subcommand; only these modules print and parse arguments."""

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
    # Nearly all objects that a command creates live to its end, and searching them for cycles takes a sixth of a short run.
    gc.set_threshold(50_000)
    # BLAS threads would spin between the small products of the package, whose loops use Numba threads.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        code = main()
    except SystemExit as exit_request:  # raised by --help and --version
        code = int(exit_request.code or 0)
    from fastcontact.cli._terminal import flushed

    code = flushed(code)
    if code in STOPPED:
        for stopped in STOPPED:  # later signals do not change the exit code
            with contextlib.suppress(ValueError):  # the platform lacks this signal
                signal.signal(stopped - 128, signal.SIG_IGN)
        sys.unraisablehook = lambda ignored: None  # errors in finalisers of partly created objects
    else:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # all output is written, and Ctrl-C may end the process
    gc.freeze()  # the interpreter would search them as well when it exits
    sys.exit(code)


def _open_standard_files() -> None:
    """Open missing standard files 0 to 2 on the null device, since the next opened file would take their descriptors."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
