"""Timing of a benchmark: warm-up, medians, CPU seconds of all threads and child processes, and wall time."""

from __future__ import annotations

import resource
import statistics
import sys
import time
from collections.abc import Callable
from types import ModuleType
from typing import Any

Work = Callable[[], Any]
# Counted calls; short ones are called more often, so long as all of them together take less than so many CPU seconds.
REPEATS, MOST_REPEATS, SHORT = 3, 15, 3.0


def cpu_seconds() -> float:
    """Return the CPU seconds [s] of this process, all threads, and of its finished children."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def peak_bytes() -> int:
    """Return the largest resident memory of this process so far [byte]."""
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit


def once(work: Work) -> tuple[float, float]:
    """Return the CPU and wall seconds of one call."""
    cpu, wall = cpu_seconds(), time.perf_counter()
    work()
    return cpu_seconds() - cpu, time.perf_counter() - wall


def measured(subject: ModuleType, size: int, repeats: int = REPEATS) -> dict[str, Any]:
    """Time all works of a subject at one size.

    Parameters
    ----------
    subject : module
        ``works(size)`` returns the number of unknowns and named works; the last of them is what the others are
        measured in.
    size : int
        About how many unknowns.
    repeats : int
        Counted calls of each work, after one that compiles and fills the caches; more of short ones, whose first calls
        still find memory that was never touched.

    Returns
    -------
    dict
        ``n_dofs``, ``peak_bytes`` of the process so far, and ``works``: by name the medians ``cpu_s`` and ``wall_s``,
        and ``ratio``, CPU seconds in those of the last work.
    """
    n_dofs, works = subject.works(size)
    for work in works.values():
        work()
    # In turn, so that a machine that slows down does so for all works alike.
    runs: list[dict[str, tuple[float, float]]] = []
    begin = cpu_seconds()
    while len(runs) < repeats or (repeats > 1 and len(runs) < MOST_REPEATS and cpu_seconds() - begin < SHORT):
        runs.append({name: once(work) for name, work in works.items()})
    found = {}
    for name in works:
        cpu, wall = zip(*(run[name] for run in runs), strict=True)
        found[name] = {"cpu_s": statistics.median(cpu), "wall_s": statistics.median(wall)}
    unit = found[next(reversed(found))]["cpu_s"]
    for entry in found.values():
        entry["ratio"] = entry["cpu_s"] / unit if unit else float("nan")
    return {"n_dofs": n_dofs, "peak_bytes": peak_bytes(), "works": found}
