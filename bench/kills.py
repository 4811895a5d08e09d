"""Runs that are killed at random times: files must open, steps must be correct, and resumed runs must end correctly.

    python bench/kills.py [--kills 200] [--seed 1] [--cases forma04c friction] [--signals KILL TERM] [--failures FOLDER]

By default half of the kills are for FORMA04 C and half for a 3D case with friction (tests/kills/kill_cases.py).
`--cases features` uses all features with a history, from plasticity to heat (tests/kills/feature_cases.py). 60 % of the kills
occur while a step is written, the others at any time, and 30 % of the runs are killed again after resuming. A table of the
outcomes has a column for each case. Files with failures are kept, and the exit code is then 1.
"""

from __future__ import annotations

import argparse
import signal
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "kills"))

import feature_cases
import kill_cases
import killing


def main() -> int:
    """Kill runs and print the table of outcomes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--kills", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--cases",
        nargs="+",
        choices=("forma04c", "friction", "small", "features", *feature_cases.CASES),
        default=["forma04c", "friction"],
    )
    parser.add_argument("--signals", nargs="+", choices=("KILL", "TERM", "INT", "HUP"), default=["KILL"])
    parser.add_argument("--failures", type=Path, default=Path("kill-failures"))
    options = parser.parse_args()
    begin, all_found = time.perf_counter(), {}
    names = [name for case in options.cases for name in (feature_cases.CASES if case == "features" else [case])]
    signals = [signal.Signals[f"SIG{name}"] for name in options.signals]
    for number, name in enumerate(names):
        count = options.kills * (number + 1) // len(names) - options.kills * number // len(names)
        with tempfile.TemporaryDirectory() as folder:
            reference = killing.reference(kill_cases.prepared(name, Path(folder)), Path(folder))
            all_found[name] = killing.run(reference, count, options.seed, Path(folder), options.failures, signals)
        print(f"{name}: {all_found[name].kills}, {len(all_found[name].failures)} failures", file=sys.stderr, flush=True)
    print(f"{'':<20}" + "".join(f"{name[:11]:>12}" for name in all_found))
    for row in zip(*(outcomes.rows() for outcomes in all_found.values()), strict=True):
        print(f"{row[0][0]:<20}" + "".join(f"{text:>12}" for _, text in row))
    failures = [text for outcomes in all_found.values() for text in outcomes.failures]
    print("\n".join([*failures, f"seed {options.seed}, {time.perf_counter() - begin:.0f} s in all"]))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
