"""A run of many steps, killed and resumed at random: same bits, constant memory, constant cost of a step.

    python bench/long_run.py [--steps 10000] [--kills 12] [--seed 1]
    python bench/long_run.py --unknowns 1e6 --hours 2 [--folder FOLDER]

Two small blocks, or a quarter of a sphere on a block with about the given number of unknowns, are pressed together and half
released again in cycles of 20 steps, so that every part of the run has the same work. The run is done once without
interruption, in a process that records its resources every hundred steps (for the sphere, every cycle), and once by
`fastcontact run --resume`, which is killed at random instants and restarted until it is complete. With `--hours`, the
uninterrupted run does as many steps as it can in the first half of the time.

The files are compared bit by bit. The second and the last tenth of the uninterrupted run are compared in CPU time, bytes and
calls of writing per step, objects and memory. Every step is on the disk before the next one begins. Prints a line for each
criterion; exit code 1 if one is not met. The files of a million unknowns take tens of gigabytes: the run stops at once if
the folder has too little space.
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
FEWEST = 4 * CYCLE  # steps of a run that is judged
FASTEST = {False: 100, True: 20}  # steps that a small and a large model can make in a second
MOST = {"cpu": 1.15, "bytes": 1.05, "calls": 1.05}  # the last tenth of the steps against the second
MOST_GROWTH = 1000.0  # of the memory, a thousand steps [kB], or
MOST_SHARE = 0.01  # of the memory, in the whole run


@dataclass
class Asked:
    """How large a model, how many steps or for how long [s], and how often what is used is noted."""

    unknowns: float | None
    steps: int
    seconds: float | None
    every: int

    @classmethod
    def of(cls, given: argparse.Namespace) -> Asked:
        large = given.unknowns is not None
        seconds = None if given.hours is None else 3600 * given.hours
        steps = given.steps if seconds is None else max(int(seconds / 2 * FASTEST[large]), FEWEST)
        every = CYCLE if large or steps < 2000 else 5 * CYCLE
        if steps < FEWEST:
            raise SystemExit(f"{steps} steps are too few to judge: ask for {FEWEST} or more")
        return cls(given.unknowns, steps, seconds, every)


def case_text(asked: Asked, steps: int) -> str:
    """Return a case file of so many steps; the first ones of two of them are the same."""
    model = BLOCKS if asked.unknowns is None else SPHERE.format(**sizes(asked.unknowns))
    instants = [round(float(n), 1) for n in range(1, steps + 1)]
    turns = range(0, steps + CYCLE, CYCLE // 2)
    table = [[float(turn), 0.0 if not turn else 1.0 if turn % CYCLE else 0.5] for turn in turns]
    return f"{model}[ramp]\ninstants = {instants}\ntable = {table}\n"


def sizes(unknowns: float) -> dict[str, float]:
    """Return edges far from the contact and at it of a sphere on a block with about so many unknowns."""
    edge = 0.06 * (114_036 / unknowns) ** (1 / 3)
    while True:
        mesh = fc.generate.sphere_on_block("hex8", R=1.0, size=edge, contact_size=edge / 3, contact_radius=0.2)
        found = 3 * mesh.n_points / unknowns
        if 0.9 < found < 1.1:
            return {"size": edge, "contact_size": edge / 3}
        edge *= found ** (1 / 3)


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


def measured(case_file: Path, path: Path, every: int, seconds: float | None) -> None:
    """Run undisturbed, to the end or for so long, and print as JSON the steps and what was used at every so many of them."""
    case = read_case(case_file)
    notes: list[dict[str, float]] = []
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
            notes.append(used())
            passed = time.monotonic() - begin
            if len(notes) == 1:
                expected = len(case.ramp.instants) if seconds is None else seconds / passed * every
                check_room(path, min(expected, len(case.ramp.instants)) / every)
            if seconds is not None and passed > seconds and step.index >= FEWEST:
                break
    print(json.dumps({"steps": out.n_steps, "unknowns": case.model.n_dofs, "notes": notes}))


def check_room(path: Path, times: float) -> None:
    """Stop if the disk has no room for two files so many times as large as this one."""
    needed, free = 2 * times * path.stat().st_size, shutil.disk_usage(path.parent).free
    if needed > 0.9 * free:
        raise SystemExit(
            f"two files of {needed / 2e9:.1f} GB each are expected and {free / 1e9:.1f} GB are free in '{path.parent}': "
            "name another folder with --folder, or ask for less"
        )


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


def arguments() -> argparse.Namespace:
    """Return what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=10_000)
    parser.add_argument(
        "--hours", type=float, help="instead of a number of steps, how long both runs may take together"
    )
    parser.add_argument(
        "--unknowns", type=float, help="a sphere on a block of about so many, instead of two small blocks"
    )
    parser.add_argument("--kills", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--folder", type=Path, help="where the result files are for the time being")
    parser.add_argument("--measure", nargs=2, type=Path, metavar=("CASE", "FILE"), help=argparse.SUPPRESS)
    return parser.parse_args()


def main() -> int:
    """Run and judge."""
    given = arguments()
    asked = Asked.of(given)
    if given.measure:
        measured(*given.measure, asked.every, asked.seconds and asked.seconds / 2)
        return 0
    with tempfile.TemporaryDirectory(dir=given.folder) as name:
        folder = Path(name)
        case = kill_cases.KilledCase(folder / "case.toml", 0.0)
        case.path.write_text(case_text(asked, asked.steps), encoding="utf-8")
        whole, path = folder / "whole.vtkhdf", folder / "killed.vtkhdf"
        begin = time.monotonic()
        command = [sys.executable, *sys.argv, "--measure", str(case.path), str(whole)]
        done = subprocess.run(command, stdout=subprocess.PIPE, check=False, text=True)
        if done.returncode:
            return done.returncode
        seconds = time.monotonic() - begin
        found = json.loads(done.stdout)
        print(f"{found['steps']} steps of {found['unknowns']} unknowns in {seconds:.0f} s", flush=True)
        case.path.write_text(case_text(asked, found["steps"]), encoding="utf-8")
        times, left = killed(case, path, given.kills, seconds, given.seed)
        kills = f"{times} kills, with {min(left, default=0)} to {max(left, default=0)} steps there: "
        return judged(found, asked.every, kills, different(path, whole))


def judged(found: dict[str, Any], every: int, kills: str, unlike: list[int]) -> int:
    """Print the bars; return the exit code."""
    notes, steps = found["notes"], found["steps"]
    tenth = max(len(notes) // 10, 1)
    bars = {f"{kills}{len(unlike)} of {steps} steps differ in any bit (0)": not unlike}
    for what, most in MOST.items():
        early = notes[2 * tenth - 1][what] - notes[tenth - 1][what]
        late = notes[-1][what] - notes[-1 - tenth][what]
        bars[f"{what} for a step: {late / tenth / every:.4g}, drift {late / early:.3f} (at most {most})"] = (
            late <= most * early
        )
    grown, thousands = notes[-1]["memory"] - notes[2 * tenth - 1]["memory"], (len(notes) - 2 * tenth) * every / 1000
    allowed = max(MOST_GROWTH * thousands, MOST_SHARE * notes[-1]["memory"])
    bars[
        f"memory: {notes[-1]['memory']:.0f} kB, grows by {grown / thousands:.0f} kB in 1000 steps (at most "
        f"{allowed / thousands:.0f})"
    ] = grown <= allowed
    print(f"objects: {notes[-1]['objects'] - notes[2 * tenth - 1]['objects']:+.0f} from the second tenth on")
    for text, kept in bars.items():
        print(("kept:   " if kept else "MISSED: ") + text)
    return 0 if all(bars.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
