"""The command line: one file a sub-command; only here do things print and parse arguments."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Sequence

INTERRUPTED, TERMINATED = 130, 143  # as shells have them


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
    # Threads of BLAS spin between the small products here; loops of our own have those of Numba.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        code = main()
    except SystemExit as asked:  # of --help and --version
        code = int(asked.code or 0)
    from fastcontact.cli._terminal import flushed

    code = flushed(code)
    signal.signal(signal.SIGINT, signal.SIG_DFL)  # nothing is left to say: a second Ctrl-C ends at once
    if code in (INTERRUPTED, TERMINATED):
        sys.unraisablehook = lambda found: None  # finalisers of what was left half made
    sys.exit(code)
