"""A study of many small runs in one process: memory must stay constant, files be closed, and runs stay as fast.

    python bench/thousand.py [--runs 1000]

Each run reads a case, changes its approach, solves it and writes a result file. Memory is the resident size of the process;
growth is counted from run 50 on, when all kernels and caches are warm. Prints a table and a line for each criterion; exit
code 1 if one is not met.
"""

from __future__ import annotations

import argparse
import gc
import os
import sys
import tempfile
import time
import tomllib
from pathlib import Path

import numpy as np

import fastcontact as fc
from fastcontact.cases.case import build_case

WARM = 50
MOST_GROWTH = 1.0  # MB
MOST_DRIFT = 1.1


def resident() -> float:
    """Resident memory [MB]."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def handles() -> int:
    """Open file handles."""
    return len(os.listdir("/proc/self/fd"))


def one(case_file: Path, folder: Path, approach: float) -> float:
    """Solve, write, read back; return the contact force."""
    data = tomllib.loads(case_file.read_text(encoding="utf-8"))
    data["support"][1]["y"] = -0.5 * approach
    case = build_case(data, folder=case_file.parent, name=case_file.stem)
    path = folder / "run.vtkhdf"
    with fc.ResultWriter(path, case.model) as out:
        fc.solve(case.model, fc.linear_ramp(2), criteria=case.criteria, on_step=out.write)
    with fc.open_results(path) as results:
        return float(np.linalg.norm(results[-1].contact["hertz"].force))


def main() -> int:
    """Run and judge."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=1000)
    runs = parser.parse_args().runs
    case_file = Path(__file__).resolve().parents[1] / "data/cases/forma04a.toml"
    random = np.random.default_rng(0)
    memory, seconds = np.zeros((2, runs))  # made at once: numbers kept one by one pin the memory around them
    with tempfile.TemporaryDirectory() as name:
        for number in range(runs):
            started = time.process_time()
            one(case_file, Path(name), random.uniform(2.0, 4.0))
            seconds[number] = time.process_time() - started
            if number in (WARM, runs - 1):
                gc.collect()
            memory[number] = resident()
            if number == WARM:
                open_before = handles()
            if (number + 1) % max(runs // 10, 1) == 0:
                milliseconds = 1e3 * np.median(seconds[max(number - 99, 0) : number + 1])
                print(f"run {number + 1:5d}: {memory[number]:7.1f} MB, {milliseconds:6.1f} ms CPU, {handles()} handles")
    growth = memory[-1] - memory[WARM]
    tenth = max((runs - WARM) // 10, 1)
    drift = float(np.median(seconds[-tenth:]) / np.median(seconds[WARM : WARM + tenth]))
    left = handles() - open_before
    bars = {
        f"memory grows by {growth:+.2f} MB from run {WARM} on (at most {MOST_GROWTH} MB)": growth <= MOST_GROWTH,
        f"{left} more file handles (0)": left == 0,
        f"time of a run drifts by a factor {drift:.3f} (at most {MOST_DRIFT})": drift <= MOST_DRIFT,
    }
    for text, kept in bars.items():
        print(("kept:   " if kept else "MISSED: ") + text)
    return 0 if all(bars.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
