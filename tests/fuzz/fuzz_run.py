"""Fuzzing run: seeds, workers that may die, outcomes of all files."""

import json
import os
import shutil
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Collection
from dataclasses import dataclass, field
from itertools import count as count_from
from itertools import islice
from pathlib import Path

import fuzz_files
import fuzz_hdf5
import fuzz_seeds
import h5py
import numpy as np

GOOD = ("read", "refused")
BAD = ("other error", "many lines", "memory", "outside", "crash", "hang")
# What another program on the machine may cause, too: counted where it comes again in a fresh process.
FROM_OUTSIDE = ("outside", "crash", "hang", "memory")
WALL_SECONDS = 120  # the limit of CPU time is the worker's own; this one is for a process that waits


@dataclass
class Found:
    """What came of the files: how often what by seed, the slowest, those that went wrong, and those that did only once."""

    counts: dict[str, Counter] = field(default_factory=dict)
    slowest: tuple[float, str] = (0.0, "")
    failures: list[dict] = field(default_factory=list)
    once: list[dict] = field(default_factory=list)

    def add(self, entry: dict) -> None:
        self.counts.setdefault(entry["name"], Counter())[entry["kind"]] += 1
        self.slowest = max(self.slowest, (entry.get("seconds", 0.0), f"{entry['name']} {entry['number']}"))
        if entry["kind"] not in GOOD:
            self.failures.append(entry)

    def table(self) -> str:
        """Return the counts as text, a line a format."""
        lines = [f"{'format':<28}{'files':>7}" + "".join(f"{kind:>12}" for kind in (*GOOD, *BAD))]
        total: Counter = Counter()
        for name in sorted(self.counts):
            count = self.counts[name]
            total += count
            lines.append(self._line(name, count))
        return "\n".join([*lines, self._line("all", total)])

    @staticmethod
    def _line(name: str, count: Counter) -> str:
        return f"{name:<28}{count.total():>7}" + "".join(f"{count[kind]:>12}" for kind in (*GOOD, *BAD))


def prepare(folder: Path) -> None:
    """Write the seeds, and the bait that no reader may touch."""
    seeds = fuzz_seeds.make_seeds(folder / "seeds")
    names = {name: path.name for name, path in seeds.items()}
    (folder / "seeds" / "seeds.json").write_text(json.dumps(names), encoding="utf-8")
    (folder / "outside").mkdir(exist_ok=True)
    with h5py.File(folder / "outside" / fuzz_hdf5.BAIT, "w") as file:
        file["numbers"] = np.arange(1000.0)
        file.create_group("ENS_MAA/bait")


def numbers(folder: Path, seed: int, count: int, suffixes: Collection[str] | None = None) -> list[int]:
    """Return the numbers of the first `count` files, or of those that are made from seeds of the given suffixes."""
    if suffixes is None:
        return list(range(count))
    names = json.loads((folder / "seeds" / "seeds.json").read_text(encoding="utf-8"))
    seeds = {name: folder / "seeds" / file for name, file in names.items()}
    known = {path.suffix for path in seeds.values()}
    if unknown := set(suffixes) - known:
        raise SystemExit(f"no seed has the format {', '.join(sorted(unknown))}: there are {', '.join(sorted(known))}")
    wanted = (n for n in count_from() if seeds[fuzz_files.chosen(n, seed, seeds)[1]].suffix in suffixes)
    return list(islice(wanted, count))


def run(numbers: list[int], seed: int, folder: Path, failures: Path | None = None, workers: int = 1) -> Found:
    """Make and read the files of the given numbers; those that go wrong are copied to `failures`."""
    found, lock, waiting = Found(), threading.Lock(), list(reversed(numbers))

    def work(place: Path) -> None:
        place.mkdir(exist_ok=True)
        process = None
        while True:
            with lock:
                if not waiting:
                    break
                number = waiting.pop()
            if process is None or process.poll() is not None:
                process = _start(seed, folder, place)
            entry = _one(process, number)
            if entry["kind"] in FROM_OUTSIDE:
                if process.poll() is None:
                    process.stdin.close()
                    process.wait(timeout=WALL_SECONDS)
                process = _start(seed, folder, place)
                entry, before = _one(process, number), entry
                if entry["kind"] in GOOD:
                    with lock:
                        found.once.append(before)
            path = Path(entry.get("path", ""))
            with lock:
                found.add(entry)
                if failures and entry["kind"] not in GOOD and path.is_file():
                    failures.mkdir(parents=True, exist_ok=True)
                    shutil.copy(path, failures / f"{entry['kind'].replace(' ', '-')}-{path.name}")
            for left in place.glob(f"{number}.*"):
                left.unlink()
        if process is not None:
            process.stdin.close()
            process.wait(timeout=30)

    threads = [threading.Thread(target=work, args=(folder / f"work{i}",)) for i in range(workers)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return found


def _start(seed: int, folder: Path, place: Path) -> subprocess.Popen:
    here = Path(__file__).resolve().parent
    command = [
        sys.executable,
        str(here / "fuzz_worker.py"),
        str(seed),
        *map(str, (folder / "seeds", place, folder / "outside")),
    ]
    process = subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, cwd=place,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1", "TMPDIR": str(place)},
    )  # fmt: skip
    if "ready" not in (_answer(process) or {}):
        raise RuntimeError(f"the worker does not start: {' '.join(command)}")
    return process


def _one(process: subprocess.Popen, number: int) -> dict:
    entry: dict = {"number": number, "name": "not made", "kind": "crash", "message": "no answer"}
    process.stdin.write(f"{number}\n")
    process.stdin.flush()
    for _ in range(2):  # what was made, what came of it
        answer = _answer(process)
        if answer is None:
            if process.poll() is None:
                process.kill()
            code = process.wait()
            # SIGXCPU is the limit of CPU time; SIGKILL is ours.
            return {**entry, "kind": "hang" if code in (-24, -9) else "crash", "message": f"exit code {code}"}
        entry |= answer
    return entry


def _answer(process: subprocess.Popen) -> dict | None:
    killer = threading.Timer(WALL_SECONDS, process.kill)
    killer.start()
    line = process.stdout.readline()
    killer.cancel()
    return json.loads(line) if line.endswith("\n") else None
