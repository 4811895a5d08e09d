"""``fastcontact env``: versions, threads, cache folder; compiles all kernels on request."""

from __future__ import annotations

import argparse
import os
import time

from fastcontact.cli._terminal import say, somebody_watches
from fastcontact.errors import FastcontactError

HELP = "show versions, threads and the cache folder of compiled kernels"


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of this command."""
    parser.add_argument("--warmup", action="store_true", help="compile the kernels now, so that later runs start fast")


def run(options: argparse.Namespace) -> int:
    """Print the environment."""
    from fastcontact._jit import cache, decorators
    from fastcontact._tools.versions import versions
    from fastcontact.elasticity import element_2d_kernels

    for name, version in versions().items():
        say(f"{name:<12} {version}")
    say(f"{'threads':<12} {decorators.threads()} of {os.cpu_count()}")
    files = cache.files.get(getattr(element_2d_kernels.add_stiffness, "py_func", None))
    say(f"{'cache':<12} {getattr(files, 'folder', 'none: kernels compile in every process')}")
    if options.warmup:
        started = time.perf_counter()
        done = _warm_up(show=somebody_watches() and not options.quiet)
        say(f"{'warm-up':<12} {done} kernels, {time.perf_counter() - started:.1f} s")
    return 0


def _warm_up(show: bool) -> int:
    """Compile all kernels of the table, side by side in a process for each processor; return their number."""
    from fastcontact._jit import ahead, decorators
    from fastcontact.analysis.progress import StatusLine

    total, ours, theirs = len(ahead.kernels_of(())), *os.pipe()
    processes = ahead.start((), decorators.threads(), theirs)
    os.close(theirs)
    done = 0
    with open(ours, encoding="ascii") as lines, StatusLine(len("compiling kernels: 000 of 000"), show) as status:
        for done, _ in enumerate(lines, start=1):
            status.draw(f"compiling kernels: {done} of {total}")
    codes = [process.wait() for process in processes]
    if done < total or any(codes):
        raise FastcontactError(f"only {done} of {total} kernels were compiled: was a process ended by lack of memory?")
    return done
