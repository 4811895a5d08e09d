"""A whole process: CPU seconds of all its threads and peak memory, from the operating system."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any


def measured(command: list[str], *, threads: int, folder: Path, limit_s: float) -> dict[str, Any]:
    """Run a command to its end in `folder`.

    Returns
    -------
    dict
        ``cpu_s`` (user and system), ``wall_s``, ``peak_bytes``, ``status`` (0: ended well, negative: killed by that
        signal) and ``said``, the last lines it wrote. CPU time beyond `limit_s` ends it. The system counts the memory of
        the process that starts another as that one's too, so a light one should.
    """
    log = folder / "said.txt"
    start = time.perf_counter()
    with log.open("wb") as out:
        process = subprocess.Popen(
            ["/bin/sh", "-c", f'ulimit -t {int(limit_s)}; exec "$@"', "sh", *command],
            stdout=out, stderr=subprocess.STDOUT, cwd=folder, env=environment(threads),
        )  # fmt: skip
        _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    return {
        "cpu_s": usage.ru_utime + usage.ru_stime,
        "wall_s": time.perf_counter() - start,
        "peak_bytes": usage.ru_maxrss * (1 if sys.platform == "darwin" else 1024),
        "status": process.returncode,
        "said": log.read_text(errors="replace")[-2000:],
    }


def environment(threads: int) -> Mapping[str, str]:
    """Return the environment of a run: the same number of threads for everything that asks."""
    names = [f"{name}_NUM_THREADS" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")]
    return {**os.environ, **dict.fromkeys([*names, "CCX_NPROC_EQUATION_SOLVER"], str(threads))}
