"""A run of many small steps, killed and resumed at random: the same bits, flat memory, steps that stay as cheap?

    python bench/long_run.py [--steps 10000] [--kills 12] [--seed 1]

The run is made once undisturbed, in a process that notes every hundred steps what it has used; and once more by
`fastcontact run --resume`, which is killed at random instants and started again until it is done. Both files are read
step by step and compared bit by bit. Of the undisturbed run the second tenth and the last are compared: CPU time, bytes and
calls of writing for a step, objects and memory. Prints one line a bar; exit code 1 if a bar is missed.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import fastcontact as fc
from fastcontact.cases.case import read_case

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests" / "kills"))

import kill_cases  # noqa: E402
import killing  # noqa: E402

CASE = """
title = "two blocks"
kinematics = "plane_strain"
[mesh]
generator = "block-on-block"
element = "quad4"
divisions_lower = [2, 1]
divisions_upper = [2, 1]
[[material]]
E = 20000.0
nu = 0.3
[[support]]
group = "LOWER_BOTTOM"
x = 0.0
y = 0.0
[[support]]
group = "UPPER_TOP"
x = 0.0
y = -0.001
[contact.pair]
secondary = "CONT_UPPER"
primary = "CONT_LOWER"
[ramp]
steps = {steps}
"""
EVERY = 100
MOST = {"cpu": 1.15, "bytes": 1.05, "calls": 1.05}  # the last tenth of the steps against the second
MOST_GROWTH = 1000.0  # of the memory, a thousand steps [kB]: HDF5 keeps where each step stands


def used() -> dict[str, float]:
    """Return what this process has used so far."""
    gc.collect()
    counts = dict(line.split(": ") for line in Path("/proc/self/io").read_text(encoding="ascii").splitlines())
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1])
    return {
        "cpu": time.process_time(),
        "bytes": float(counts["wchar"]),
        "calls": float(counts["syscw"]),
        "objects": float(sys.getallocatedblocks()),
        "memory": pages * os.sysconf("SC_PAGE_SIZE") / 1e3,
    }


def measured(case_file: Path, path: Path) -> None:
    """Run undisturbed, and print what was used every hundred steps as JSON."""
    case = read_case(case_file)
    notes = []
    with fc.ResultWriter(path, case.model, case_text=case.text) as out:
        for step in fc.solve_steps(case.model, case.ramp):
            out.write(step)
            if step.index % EVERY == 0:
                notes.append(used())
    print(json.dumps(notes))


def killed(case: kill_cases.KilledCase, path: Path, kills: int, seconds: float, seed: int) -> tuple[int, list[int]]:
    """Run, kill and resume until all is done; return how often it was killed, and how many steps were there each time."""
    random, times, found = np.random.default_rng(seed), 0, []
    while True:
        process = killing.started(case, path, resume=True)
        try:
            # Starting, and reading what is there, take their time, too; after so many kills it may end.
            longest = 2.0 + 3.0 * random.random() * seconds / kills if times < kills else None
            told = process.communicate(timeout=longest)[1]
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
            process.communicate()
            times += 1
            if path.exists():
                with fc.open_results(path) as results:
                    found.append(len(results))
            continue
        if process.returncode:
            raise SystemExit(f"the run ended with code {process.returncode}: {told}")
        return times, found


def different(one: Path, other: Path) -> list[int]:
    """Return the numbers of the steps that differ in any bit; -1 if there are not as many."""
    with fc.open_results(one) as first, fc.open_results(other) as second:
        if len(first) != len(second):
            return [-1]
        pairs = zip(first, second, strict=True)
        return [step.index for step, expected in pairs if killing.difference(step, expected) != 0.0]


def main() -> int:
    """Run and judge."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=10_000)
    parser.add_argument("--kills", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--measure", nargs=2, type=Path, metavar=("CASE", "FILE"), help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.measure:
        measured(*given.measure)
        return 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        case = kill_cases.KilledCase(folder / "blocks.toml", 0.0)
        case.path.write_text(CASE.format(steps=given.steps), encoding="utf-8")
        whole, path = folder / "whole.vtkhdf", folder / "killed.vtkhdf"
        begin = time.monotonic()
        command = [sys.executable, __file__, "--measure", str(case.path), str(whole)]
        done = subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True)
        seconds = time.monotonic() - begin
        times, left = killed(case, path, given.kills, seconds, given.seed)
        unlike = different(path, whole)
    notes = json.loads(done.stdout)
    return judged(notes, given.steps, times, left, unlike)


def judged(notes: list[dict[str, float]], steps: int, times: int, left: list[int], unlike: list[int]) -> int:
    """Print the bars; return the exit code."""
    tenth = max(len(notes) // 10, 1)
    bars = {
        f"{times} kills, with {min(left, default=0)} to {max(left, default=0)} steps there: {len(unlike)} of {steps} steps "
        "differ in any bit (0)": not unlike,
    }
    for what, most in MOST.items():
        early = notes[2 * tenth - 1][what] - notes[tenth - 1][what]
        late = notes[-1][what] - notes[-1 - tenth][what]
        bars[f"{what} for a step: {late / tenth / EVERY:.4g}, drift {late / early:.3f} (at most {most})"] = (
            late <= most * early
        )
    growth = (notes[-1]["memory"] - notes[2 * tenth - 1]["memory"]) / ((len(notes) - 2 * tenth) * EVERY / 1000)
    bars[
        f"memory: {notes[-1]['memory']:.0f} kB, grows by {growth:.0f} kB in 1000 steps (at most {MOST_GROWTH:.0f})"
    ] = growth <= MOST_GROWTH
    print(f"objects: {notes[-1]['objects'] - notes[2 * tenth - 1]['objects']:+.0f} from the second tenth on")
    for text, kept in bars.items():
        print(("kept:   " if kept else "MISSED: ") + text)
    return 0 if all(bars.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
