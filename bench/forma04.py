"""Cost of the training case FORMA04: CPU time and peak memory of ``fastcontact run`` with cached kernels.

Usage: python bench/forma04.py [--runs N] [CASE.toml ...]
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

CASES = Path(__file__).resolve().parent.parent / "data" / "cases"


def measure(command: list[str]) -> tuple[float, float]:
    """Run a command; return its CPU seconds (user and system) and peak memory [MB]."""
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        raise SystemExit(f"{' '.join(command)} ended with status {status}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("cases", nargs="*", default=[str(CASES / f"forma04{letter}.toml") for letter in "abc"])
    parser.add_argument("--runs", type=int, default=5, help="measured runs of each case, after a warm-up (default 5)")
    options = parser.parse_args()
    print(f"{'case':<24} {'CPU s (median)':>14} {'min':>8} {'max':>8} {'peak MB':>9}")
    with tempfile.TemporaryDirectory() as folder:
        for case in options.cases:
            command = [sys.executable, "-m", "fastcontact", "run", case, "-q", "-o", f"{folder}/result.vtkhdf"]
            measure(command)
            runs = [measure(command) for _ in range(options.runs)]
            seconds, memory = zip(*runs, strict=True)
            median = statistics.median(seconds)
            print(
                f"{Path(case).stem:<24} {median:>14.2f} {min(seconds):>8.2f} {max(seconds):>8.2f} {max(memory):>9.0f}"
            )


if __name__ == "__main__":
    main()
