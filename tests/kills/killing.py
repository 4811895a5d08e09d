"""Runs killed at random instants: what the file contains, and how they end after resuming."""

import dataclasses
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import h5py
import numpy as np
from kill_cases import KilledCase

import fastcontact as fc
from fastcontact.cli import main
from fastcontact.results.layout import OPTIONAL_COLUMNS

# Largest relative difference of a step in a file of a killed run from that of the run that was let alone.
OF_STEPS = 1e-12
POLL = 2e-4  # s
# The writes of a step follow each other within a millisecond or two. A kill falls up to so long after a change of the file,
# mostly soon [s].
WITHIN = 20e-3
# Part of the kills that fall while steps are written; the others fall anywhere between start and end.
WRITING = 0.6
# Part of the killed runs that are killed again when they are resumed.
AGAIN = 0.3
LONGEST = 600.0  # s
# Exit codes of runs that a signal ended; one that comes before Python listens, or after, ends the process by itself.
ENDS = {
    signal.SIGKILL: (-signal.SIGKILL,),
    signal.SIGTERM: (143, -signal.SIGTERM),
    signal.SIGINT: (130, -signal.SIGINT),
    signal.SIGHUP: (129, -signal.SIGHUP),
}


@dataclass
class Reference:
    """A run that nobody disturbed: its steps, how long it took [s], how often its file was seen to change."""

    case: KilledCase
    steps: list[fc.StepResult]
    seconds: float
    changes: int


@dataclass
class Found:
    """What came of the kills of one case."""

    kills: int = 0
    no_file: int = 0
    no_step: int = 0
    all_steps: int = 0
    within_a_write: int = 0
    of_resumed: int = 0
    opened: int = 0
    steps: int = 0
    steps_same_bits: int = 0
    largest_of_steps: float = 0.0
    right_ends: int = 0
    ends_same_bits: int = 0
    largest_of_ends: float = 0.0
    failures: list[str] = field(default_factory=list)

    def rows(self) -> Iterator[tuple[str, str]]:
        """Return what to print, line by line."""
        for entry in dataclasses.fields(self):
            value = getattr(self, entry.name)
            text = str(len(value)) if isinstance(value, list) else f"{value:.1e}" if value.__class__ is float else value
            yield entry.name.replace("_", " "), str(text)


def command(case: KilledCase, path: Path, resume: bool) -> list[str]:
    given = [sys.executable, "-m", "fastcontact", "run", str(case.path), "-o", str(path), "-q"]
    return [*given, "--resume"] if resume else given


def started(case: KilledCase, path: Path, resume: bool = False) -> subprocess.Popen:
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(command(case, path, resume), env={**os.environ, "OPENBLAS_NUM_THREADS": "1"}, **quiet)


def changes(path: Path, process: subprocess.Popen) -> Iterator[None]:
    """Yield whenever the file is seen to have changed, until the process ends."""
    last = None
    end = time.monotonic() + LONGEST
    while process.poll() is None and time.monotonic() < end:
        try:
            now = path.stat().st_mtime_ns
        except FileNotFoundError:
            now = None
        if now != last:
            last = now
            yield
        time.sleep(POLL)


def reference(case: KilledCase, folder: Path) -> Reference:
    """Run a case undisturbed: once here to compile, once in a process of its own to measure."""
    path = folder / "reference.vtkhdf"
    assert main(command(case, path, resume=False)[3:]) == 0
    path.unlink()
    begin = time.monotonic()
    process = started(case, path)
    count = sum(1 for _ in changes(path, process))
    told = process.communicate()[1]
    assert process.returncode == 0, told
    seconds = time.monotonic() - begin
    with fc.open_results(path) as results:
        return Reference(case, list(results), seconds, count)


def killed(
    known: Reference, path: Path, resume: bool, random: np.random.Generator, sent: int = signal.SIGKILL
) -> int | None:
    """Start a run, end it at a random instant by the signal `sent`; return its exit code, None if it came to its end."""
    writing, part, late = random.random() < WRITING, random.random(), WITHIN * random.random() ** 3
    process = started(known.case, path, resume)
    if writing:
        # Resumed runs have less to write: the change that is waited for may not come any more.
        awaited = 1 + int(part * known.changes * (0.5 if resume else 1.0))
        for number, _ in enumerate(changes(path, process), start=1):
            if number == awaited:
                break
        time.sleep(late)
    else:
        end = time.monotonic() + part * known.seconds
        while process.poll() is None and time.monotonic() < end:
            time.sleep(POLL)
    process.send_signal(sent)
    process.communicate(timeout=LONGEST)
    return process.returncode if process.returncode != 0 else None


def difference(found: fc.StepResult, expected: fc.StepResult) -> float:
    """Return the largest difference of two steps, relative to the largest entry of each field; 0 for the same bits."""
    if (found.index, found.load_factor) != (expected.index, expected.load_factor):
        return np.inf
    if list(found.contact) != list(expected.contact):
        return np.inf
    largest = 0.0
    for name in ("displacement", "stress", "von_mises", "von_mises_signed", "reaction", "temperature", "heat_reaction"):
        if (getattr(found, name) is None) != (getattr(expected, name) is None):
            return np.inf
        if getattr(found, name) is not None:
            largest = max(largest, _relative(getattr(found, name), getattr(expected, name)))
    for name, values in expected.cell_fields.items():
        largest = max(largest, _relative(found.cell_fields[name], values))
    for name, other in expected.contact.items():
        for entry in ("points", "active", "sticking"):
            if not np.array_equal(getattr(found.contact[name], entry), getattr(other, entry)):
                return np.inf
        further = [entry for entry in OPTIONAL_COLUMNS if getattr(other, entry) is not None]
        for entry in ("gap", "pressure", "multiplier", "force_vectors", "normal", "shear", "force", "radius", *further):
            largest = max(largest, _relative(getattr(found.contact[name], entry), getattr(other, entry)))
    return largest


def _relative(found: object, expected: object) -> float:
    one, other = np.asarray(found, float), np.asarray(expected, float)
    finite = np.isfinite(other)
    if one.shape != other.shape or not np.array_equal(np.isfinite(one), finite):
        return np.inf
    size = np.abs(other[finite]).max(initial=0.0)
    apart = np.abs(one[finite] - other[finite]).max(initial=0.0)
    return float(apart / size) if size else float(apart)


def check_left(path: Path, known: Reference, found: Found, where: str, resumed: bool = False) -> None:
    """Open what a killed run has left and hold its steps against those of the undisturbed run."""
    if not path.exists():
        found.no_file += 1
        return
    try:
        with fc.open_results(path) as results:
            steps = list(results)
    except fc.FileError as error:
        found.failures.append(f"{where}: does not open: {error}")
        return
    found.opened += 1
    found.no_step += not steps
    found.all_steps += len(steps) == len(known.steps)
    found.within_a_write += not resumed and _torn(path)  # what the first kill left behind may still be there
    for step, expected in zip(steps, known.steps, strict=False):
        apart = difference(step, expected)
        found.steps += 1
        found.steps_same_bits += apart == 0.0
        found.largest_of_steps = max(found.largest_of_steps, apart)
        if not apart <= OF_STEPS:
            found.failures.append(f"{where}: step {step.index} is {apart:.1e} off")
    if len(steps) > len(known.steps):
        found.failures.append(f"{where}: {len(steps)} steps instead of {len(known.steps)}")
    if steps and steps[-1].restart is None:
        found.failures.append(f"{where}: step {steps[-1].index} lost what it takes to go on")


def _torn(path: Path) -> bool:
    """Return whether more of a step was written than counts: rows of tables, or data behind what HDF5 knows of."""
    with open(path, "rb") as below, h5py.File(below, "r") as file:
        n_steps = int(file["VTKHDF/Steps"].attrs["NSteps"])
        n_points = int(file["VTKHDF/NumberOfPoints"][0])
        fields = [len(field) // n_points for field in file["VTKHDF/PointData"].values() if field.maxshape[0] is None]
        rows = max(len(file["fastcontact/steps"]), *fields)
    contents = path.read_bytes()
    return rows > n_steps or any(contents[int.from_bytes(contents[40:48], "little") :])


def arrays(path: Path) -> dict[str, np.ndarray]:
    """Return every data set of a result file but those of notes, which tell how often and when runs ended."""
    found = {}
    with h5py.File(path, "r") as file:

        def visit(name: str, item: object) -> None:
            if isinstance(item, h5py.Dataset):
                found[name] = np.asarray(item[()])

        file.visititems(visit)
    for name in ("runs", "notes", "steps"):
        del found[f"fastcontact/{name}"]
    return found


def differing(first: Path, second: Path) -> list[str]:
    """Return the names of arrays of two result files that do not have the same bits."""
    one, other = arrays(first), arrays(second)
    alike = {
        name
        for name in one.keys() & other.keys()
        if (one[name].dtype, one[name].shape) == (other[name].dtype, other[name].shape)
        and one[name].tobytes() == other[name].tobytes()
    }
    return sorted((one.keys() | other.keys()) - alike)


def check_resumed(path: Path, known: Reference, found: Found, where: str) -> None:
    """Let a copy of what is left go on to its end and hold that against the undisturbed run."""
    folder = path.with_name("resumed")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    copy = folder / path.name
    if path.exists():
        shutil.copy(path, copy)
    process = started(known.case, copy, resume=True)
    told = process.communicate(timeout=LONGEST)[1]
    if process.returncode != 0:
        found.failures.append(f"{where}: cannot be resumed: {told.strip()}")
        return
    with fc.open_results(copy) as results:
        steps, complete = list(results), results.complete
    if len(steps) != len(known.steps) or not complete or os.listdir(folder) != [copy.name]:
        found.failures.append(f"{where}: resumed with {len(steps)} steps, leaving {sorted(os.listdir(folder))}")
        return
    apart = max(difference(step, expected) for step, expected in zip(steps, known.steps, strict=True))
    found.largest_of_ends = max(found.largest_of_ends, apart)
    found.ends_same_bits += apart == 0.0
    if apart <= known.case.tolerance:
        found.right_ends += 1
    else:
        found.failures.append(f"{where}: ends {apart:.1e} off when it is resumed")


def run(
    known: Reference,
    count: int,
    seed: int,
    folder: Path,
    keep: Path | None = None,
    signals: Sequence[signal.Signals] = (signal.SIGKILL,),
) -> Found:
    """End `count` runs of a case by one of the `signals`, one after the other; files of failures are copied to `keep`."""
    random, found = np.random.default_rng(seed), Found()
    path = folder / "killed.vtkhdf"
    resume = False
    while found.kills < count:
        if not resume:
            for left in folder.glob(".killed.vtkhdf.*"):
                left.unlink()
            path.unlink(missing_ok=True)
        sent = signals[random.integers(len(signals))]
        code = killed(known, path, resume, random, sent)
        if code is None:  # it was faster
            resume = False
            continue
        found.kills += 1
        found.of_resumed += resume
        where, failed = f"{known.case.path.stem}, seed {seed}, {sent.name} {found.kills}", len(found.failures)
        if code not in ENDS[sent]:
            found.failures.append(f"{where}: ended by itself with exit code {code}")
        check_left(path, known, found, where, resume)
        check_resumed(path, known, found, where)
        if len(found.failures) > failed and keep is not None and path.exists():
            keep.mkdir(parents=True, exist_ok=True)
            shutil.copy(path, keep / f"{known.case.path.stem}-{seed}-{found.kills}.vtkhdf")
        resume = random.random() < AGAIN
    return found
