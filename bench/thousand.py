"""Many small runs in one process, in which memory and run time must remain constant and all files must be closed.

    python bench/thousand.py [--runs 1000]

Each run reads a case, changes its approach, solves it and writes a result file. Memory is the resident memory of the process.
Its growth is measured from run 50, after which all kernels are loaded and all caches are filled. The script prints a table
and a line for each criterion; the exit code is 1 if a criterion is not met.
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
MAX_GROWTH = 1.0  # MB
MAX_DRIFT = 1.1


def resident() -> float:
    """Return the resident memory of this process [MB]."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def handles() -> int:
    """Return the number of open file handles of this process."""
    return len(os.listdir("/proc/self/fd"))


def run_once(case_file: Path, folder: Path, approach: float) -> float:
    """Solve a case with an approach, write and read its results, and return the contact force."""
    data = tomllib.loads(case_file.read_text(encoding="utf-8"))
    data["support"][1]["y"] = -0.5 * approach
    case = build_case(data, folder=case_file.parent, name=case_file.stem)
    path = folder / "run.vtkhdf"
    with fc.ResultWriter(path, case.model) as out:
        fc.solve(case.model, fc.linear_ramp(2), criteria=case.criteria, on_step=out.write)
    with fc.open_results(path) as results:
        return float(np.linalg.norm(results[-1].contact["hertz"].force))


def main() -> int:
    """Execute the runs, print the criteria and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=1000)
    runs = parser.parse_args().runs
    case_file = Path(__file__).resolve().parents[1] / "data/cases/forma04a.toml"
    random = np.random.default_rng(0)
    memory, seconds = np.zeros((2, runs))  # separately allocated numbers would fragment the memory
    with tempfile.TemporaryDirectory() as name:
        for number in range(runs):
            started = time.process_time()
            run_once(case_file, Path(name), random.uniform(2.0, 4.0))
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
    criteria = {
        f"memory grows by {growth:+.2f} MB from run {WARM} on (at most {MAX_GROWTH} MB)": growth <= MAX_GROWTH,
        f"{left} more file handles (0)": left == 0,
        f"time of a run drifts by a factor {drift:.3f} (at most {MAX_DRIFT})": drift <= MAX_DRIFT,
    }
    for text, is_met in criteria.items():
        print(("kept:   " if is_met else "MISSED: ") + text)
    return 0 if all(criteria.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
