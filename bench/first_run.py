"""Compilation in a first run: ``python bench/first_run.py run data/cases/forma04a.toml`` runs a command with an empty cache.

Prints CPU seconds of the process with one thread, and thus without helper processes, the compiled kernels, how many of them
are called by other kernels, and those compiled for several sets of types.
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
            def on_start(self, told: Any) -> None:
                started.append(time.process_time())

            def on_end(self, told: Any) -> None:
                spent, of = time.process_time() - started.pop(), told.data["dispatcher"]
                if of.__module__.startswith("fastcontact."):
                    kernels.append((f"{of.__module__}.{of.__qualname__}", bool(started), spent))

        event.register("numba:compile", Compiled())
        code = int(run([*sys.argv[1:], "-q", "-o", f"{folder}/result.vtkhdf"]))
    called = [spent for _, inside, spent in kernels if not inside]
    print(
        f"{time.process_time():.1f} CPU s, {sum(called):.1f} in {len(kernels)} kernels, {len(called)} called from Python"
    )
    for name, count in Counter(name for name, _, _ in kernels).items():
        if count > 1:
            print(f"  {count} times: {name}")
    return code


if __name__ == "__main__":
    sys.exit(main())
