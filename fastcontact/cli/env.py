"""``fastcontact env``: show versions, threads and the cache folder, and compile all kernels on request."""

from __future__ import annotations

import os
import signal
import tempfile
import time
from argparse import Namespace

from fastcontact.cli._terminal import say, stderr_is_terminal
from fastcontact.errors import FastcontactError

HELP = "show versions, threads and the cache folder of compiled kernels"
ARGUMENTS = {"--warmup": "compile all kernels, so that later runs start fast"}


def run(options: Namespace) -> int:
    """Print the environment and, if requested, compile the kernels."""
    from fastcontact._jit import cache, decorators
    from fastcontact._tools.versions import versions
    from fastcontact.elasticity import element_2d_kernels

    for name, version in versions().items():
        say(f"{name:<12} {version}")
    say(f"{'threads':<12} {decorators.threads()} of {os.cpu_count()}")
    files = cache.files.get(getattr(element_2d_kernels.add_stiffness, "py_func", None))
    say(f"{'cache':<12} {getattr(files, 'folder', 'none: kernels are compiled in every process')}")
    if options.warmup:
        start_time = time.perf_counter()
        n_kernels = _warm_up(show=stderr_is_terminal() and not options.quiet)
        say(f"{'warm-up':<12} {n_kernels} kernels, {time.perf_counter() - start_time:.1f} s")
    return 0


def _warm_up(show: bool) -> int:
    """Compile all registered kernels in as many processes as there are threads, and return the number of kernels."""
    from fastcontact._jit import ahead, decorators
    from fastcontact.analysis.progress import StatusLine

    total, reading_end, writing_end, n_started = len(ahead.kernel_numbers(())), *os.pipe(), 0
    with tempfile.TemporaryFile("w+", encoding="utf-8") as errors:
        processes = ahead.start((), decorators.threads(), writing_end, errors.fileno())
        os.close(writing_end)
        with (
            open(reading_end, encoding="ascii") as lines,
            StatusLine(len("compiling kernels: 000 of 000"), show) as status,
        ):
            for n_started, _ in enumerate(lines, start=1):
                status.draw(f"compiling kernels: {n_started} of {total}")
        codes = [code for code in (process.wait() for process in processes) if code]
        errors.seek(0)
        error_lines = errors.read().split("\n")
    if codes:
        manner = f"on {signal.Signals(-codes[0]).name}" if codes[0] < 0 else f"with exit code {codes[0]}"
        reason = next(filter(None, reversed(error_lines)), "perhaps out of memory")
        raise FastcontactError(
            f"a process that compiles kernels ended {manner} after starting {n_started} of {total} kernels: {reason}"
        )
    return n_started
