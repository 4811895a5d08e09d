"""Compilation in a first run: ``python bench/first_run.py run data/cases/forma04a.toml`` runs a command with an empty cache.

The script prints the CPU time of the process with one thread, and thus without helper processes, the number of compiled
kernels, how many of these are called from Python, and the kernels that are compiled for several sets of argument types.
"""

from __future__ import annotations

import os
import sys
import tempfile
import time
from collections import Counter
from typing import Any


def main() -> int:
    with tempfile.TemporaryDirectory() as folder:
        os.environ |= {"NUMBA_CACHE_DIR": folder, "NUMBA_NUM_THREADS": "1"}
        from numba.core import event

        from fastcontact.cli import main as run

        kernels: list[tuple[str, bool, float]] = []
        started: list[float] = []

        class Compiled(event.Listener):  # type: ignore[misc]
            def on_start(self, raised_event: Any) -> None:
                started.append(time.process_time())

            def on_end(self, raised_event: Any) -> None:
                seconds, dispatcher = time.process_time() - started.pop(), raised_event.data["dispatcher"]
                if dispatcher.__module__.startswith("fastcontact."):
                    kernels.append((f"{dispatcher.__module__}.{dispatcher.__qualname__}", bool(started), seconds))

        event.register("numba:compile", Compiled())
        code = int(run([*sys.argv[1:], "-q", "-o", f"{folder}/result.vtkhdf"]))
    outermost = [seconds for _, is_nested, seconds in kernels if not is_nested]
    print(
        f"{time.process_time():.1f} CPU s, {sum(outermost):.1f} in {len(kernels)} kernels, "
        f"{len(outermost)} called from Python"
    )
    for name, count in Counter(name for name, _, _ in kernels).items():
        if count > 1:
            print(f"  {count} times: {name}")
    return code


if __name__ == "__main__":
    sys.exit(main())
