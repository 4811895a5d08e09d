"""Run of many steps that is killed and resumed at random: identical results, constant memory and constant cost of a step.

    python bench/long_run.py [--steps 10000] [--kills 12] [--seed 1]
    python bench/long_run.py --unknowns 1e6 --hours 2 [--folder FOLDER]

Two small blocks, or a quarter of a sphere on a block with about the given number of unknowns, are loaded and partly unloaded
in cycles of 20 steps, so that all parts of the run have the same cost. The analysis is run without interruption, in a process
that records its resources every hundred steps (for the sphere, every cycle), and again by `fastcontact run --resume`, which
is killed at random times and restarted until it is complete. With `--hours`, the uninterrupted run lasts half of this time.

The two result files are compared bit by bit. The second and the last tenth of the uninterrupted run are compared with respect
to CPU time, written bytes and write calls per step, objects and memory. Each step is written to the disk before the next one
begins. The script prints a line for each criterion; the exit code is 1 if a criterion is not met. Files for a million
unknowns take tens of gigabytes, and the run stops after its first records if the disk has too little space.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import fastcontact as fc
from fastcontact.cases.case import read_case

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT / "tests"), str(ROOT / "tests" / "kills")]

import kill_cases  # noqa: E402
import killing  # noqa: E402

BLOCKS = """
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
"""
SPHERE = """
title = "sphere on a block"
kinematics = "3d"
[mesh]
generator = "sphere-on-block"
element = "hex8"
R = 1.0
size = {size!r}
contact_size = {contact_size!r}
contact_radius = 0.2
[[material]]
E = 20000.0
nu = 0.3
[[support]]
group = "SYMMETRY_X"
x = 0.0
[[support]]
group = "SYMMETRY_Z"
z = 0.0
[[support]]
group = "BLOCK_BOTTOM"
y = 0.0
[[support]]
group = "SPHERE_TOP"
y = -0.01
[contact.pair]
secondary = "CONT_SPHERE"
primary = "CONT_BLOCK"
"""
CYCLE = 20  # steps
MIN_STEPS = 4 * CYCLE  # smallest number of steps that can be evaluated
STEPS_PER_SECOND = {False: 100, True: 20}  # upper bounds for small and for large models
MAX_RATIO = {"cpu": 1.15, "bytes": 1.05, "calls": 1.05}  # of the last tenth of the steps to the second
# The memory may grow by the larger of this number [kB] per 1000 steps, and this fraction of it in the entire run.
MAX_GROWTH = 1000.0
MAX_SHARE = 0.01


@dataclass
class Settings:
    """Number of unknowns, number of steps or duration [s], and number of steps between two records of the resources."""

    unknowns: float | None
    steps: int
    seconds: float | None
    every: int

    @classmethod
    def of(cls, options: argparse.Namespace) -> Settings:
        large = options.unknowns is not None
        seconds = None if options.hours is None else 3600 * options.hours
        steps = options.steps if seconds is None else max(int(seconds / 2 * STEPS_PER_SECOND[large]), MIN_STEPS)
        every = CYCLE if large or steps < 2000 else 5 * CYCLE
        if steps < MIN_STEPS:
            raise SystemExit(f"{steps} steps are too few to judge: ask for {MIN_STEPS} or more")
        return cls(options.unknowns, steps, seconds, every)


def case_text(settings: Settings, steps: int) -> str:
    """Return a case file with the given number of steps. Steps do not depend on the number of later steps."""
    model = BLOCKS if settings.unknowns is None else SPHERE.format(**sizes(settings.unknowns))
    instants = [round(float(n), 1) for n in range(1, steps + 1)]
    turns = range(0, steps + CYCLE, CYCLE // 2)
    table = [[float(turn), 0.0 if not turn else 1.0 if turn % CYCLE else 0.5] for turn in turns]
    return f"{model}[ramp]\ninstants = {instants}\ntable = {table}\n"


def sizes(unknowns: float) -> dict[str, float]:
    """Return the edge lengths far from the contact and at it of a sphere on a block with about `unknowns` unknowns."""
    edge = 0.06 * (114_036 / unknowns) ** (1 / 3)
    while True:
        mesh = fc.generate.sphere_on_block("hex8", R=1.0, size=edge, contact_size=edge / 3, contact_radius=0.2)
        ratio = 3 * mesh.n_points / unknowns
        if 0.9 < ratio < 1.1:
            return {"size": edge, "contact_size": edge / 3}
        edge *= ratio ** (1 / 3)


def resources_used() -> dict[str, float]:
    """Return the CPU time [s], the written bytes, the write calls, the objects and the memory [kB] of this process."""
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


def measure_run(case_file: Path, path: Path, every: int, seconds: float | None) -> None:
    """Run without interruption, to the end or for some seconds, and print the resources as JSON.

    They are recorded after every `every` steps.
    """
    case = read_case(case_file)
    records: list[dict[str, float]] = []
    begin = time.monotonic()
    with fc.ResultWriter(path, case.model, case_text=case.text, synchronise=True) as out:
        options = {
            "linear_solver": case.linear_solver,
            "linear_tolerance": case.linear_tolerance,
            "criteria": case.criteria,
        }
        for step in fc.solve_steps(case.model, case.ramp, **options):  # as the command does
            out.write(step)
            if step.index % every:
                continue
            records.append(resources_used())
            passed = time.monotonic() - begin
            if len(records) == 1:
                expected = len(case.ramp.instants) if seconds is None else seconds / passed * every
                check_disk_space(path, min(expected, len(case.ramp.instants)) / every)
            if seconds is not None and passed > seconds and step.index >= MIN_STEPS:
                break
    print(json.dumps({"steps": out.n_steps, "unknowns": case.model.n_dofs, "records": records}))


def check_disk_space(path: Path, times: float) -> None:
    """Raise SystemExit if the disk has too little space for two files that are `times` times as large as this one."""
    needed, free = 2 * times * path.stat().st_size, shutil.disk_usage(path.parent).free
    if needed > 0.9 * free:
        raise SystemExit(
            f"two files of {needed / 2e9:.1f} GB each are expected and {free / 1e9:.1f} GB are free in '{path.parent}': "
            "name another folder with --folder, or ask for less"
        )


def run_with_kills(
    case: kill_cases.KilledCase, path: Path, kills: int, seconds: float, seed: int
) -> tuple[int, list[int]]:
    """Run, kill and resume a case until it is complete; return the number of kills and the number of steps after each."""
    random, times, n_steps = np.random.default_rng(seed), 0, []
    while True:
        process = killing.started(case, path, resume=True)
        try:
            # The start and the reading of existing steps take two seconds. After the last kill the run may complete.
            longest = 2.0 + 3.0 * random.random() * seconds / kills if times < kills else None
            errors = process.communicate(timeout=longest)[1]
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
            process.communicate()
            times += 1
            if path.exists():
                with fc.open_results(path) as results:
                    n_steps.append(len(results))
            continue
        if process.returncode:
            raise SystemExit(f"the run ended with code {process.returncode}: {errors}")
        return times, n_steps


def different_steps(path: Path, other: Path) -> list[int]:
    """Return the numbers of the steps that differ in any bit, or [-1] if the numbers of steps differ."""
    with fc.open_results(path) as first, fc.open_results(other) as second:
        if len(first) != len(second):
            return [-1]
        pairs = zip(first, second, strict=True)
        return [step.index for step, expected in pairs if killing.difference(step, expected) != 0.0]


def arguments() -> argparse.Namespace:
    """Return the arguments of the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=10_000)
    parser.add_argument("--hours", type=float, help="total duration of both runs, instead of a number of steps")
    parser.add_argument(
        "--unknowns", type=float, help="number of unknowns of a sphere on a block, instead of two small blocks"
    )
    parser.add_argument("--kills", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--folder", type=Path, help="folder of temporary result files")
    parser.add_argument("--measure", nargs=2, type=Path, metavar=("CASE", "FILE"), help=argparse.SUPPRESS)
    return parser.parse_args()


def main() -> int:
    """Execute both runs, print the criteria and return the exit code."""
    options = arguments()
    settings = Settings.of(options)
    if options.measure:
        measure_run(*options.measure, settings.every, settings.seconds and settings.seconds / 2)
        return 0
    with tempfile.TemporaryDirectory(dir=options.folder) as name:
        folder = Path(name)
        case = kill_cases.KilledCase(folder / "case.toml", 0.0)
        case.path.write_text(case_text(settings, settings.steps), encoding="utf-8")
        whole, path = folder / "whole.vtkhdf", folder / "killed.vtkhdf"
        begin = time.monotonic()
        command = [sys.executable, *sys.argv, "--measure", str(case.path), str(whole)]
        done = subprocess.run(command, stdout=subprocess.PIPE, check=False, text=True)
        if done.returncode:
            return done.returncode
        seconds = time.monotonic() - begin
        run = json.loads(done.stdout)
        print(f"{run['steps']} steps of {run['unknowns']} unknowns in {seconds:.0f} s", flush=True)
        case.path.write_text(case_text(settings, run["steps"]), encoding="utf-8")
        times, n_steps = run_with_kills(case, path, options.kills, seconds, options.seed)
        kills = f"{times} kills, after {min(n_steps, default=0)} to {max(n_steps, default=0)} steps: "
        return print_criteria(run, settings.every, kills, different_steps(path, whole))


def print_criteria(run: dict[str, Any], every: int, kills: str, differing_steps: list[int]) -> int:
    """Print the criteria and whether they are met; return the exit code."""
    records, steps = run["records"], run["steps"]
    tenth = max(len(records) // 10, 1)
    criteria = {f"{kills}{len(differing_steps)} of {steps} steps differ in any bit (0)": not differing_steps}
    for resource, limit in MAX_RATIO.items():
        early = records[2 * tenth - 1][resource] - records[tenth - 1][resource]
        late = records[-1][resource] - records[-1 - tenth][resource]
        criteria[f"{resource} for a step: {late / tenth / every:.4g}, drift {late / early:.3f} (at most {limit})"] = (
            late <= limit * early
        )
    grown, thousands = (
        records[-1]["memory"] - records[2 * tenth - 1]["memory"],
        (len(records) - 2 * tenth) * every / 1000,
    )
    allowed = max(MAX_GROWTH * thousands, MAX_SHARE * records[-1]["memory"])
    criteria[
        f"memory: {records[-1]['memory']:.0f} kB, grows by {grown / thousands:.0f} kB in 1000 steps (at most "
        f"{allowed / thousands:.0f})"
    ] = grown <= allowed
    print(f"objects: {records[-1]['objects'] - records[2 * tenth - 1]['objects']:+.0f} from the second tenth on")
    for text, is_met in criteria.items():
        print(("kept:   " if is_met else "MISSED: ") + text)
    return 0 if all(criteria.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
