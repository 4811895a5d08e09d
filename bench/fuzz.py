"""Read thousands of damaged files: each must give a correct result or one clear error.

    python bench/fuzz.py [--count 10000] [--seed 1] [--workers 2] [--failures FOLDER]
        [--formats .deck .msh ...] [--only NUMBER ...]

Starts from small valid files of every format (tests/fuzz/fuzz_seeds.py), damages them byte by byte or in their structure
(HDF5, TOML), and reads them in processes with at most 1 GiB of additional memory and 10 s of CPU time. The same seed gives
the same files. Prints a table with a line for each format: files read, files refused with a clear error, and failures: other
errors, messages of several lines, more memory, other files touched, crashes, hangs. Failing files are kept; exit code 1 if
there are any.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "fuzz"))

import fuzz_run


def main() -> int:
    """Fuzz and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--failures", type=Path, default=Path("fuzz-failures"))
    parser.add_argument("--formats", nargs="+", metavar="SUFFIX", help="make and read only files of these formats")
    parser.add_argument("--only", type=int, nargs="+", help="make and read only the files of these numbers")
    given = parser.parse_args()
    started = time.perf_counter()
    with tempfile.TemporaryDirectory() as name:
        fuzz_run.prepare(Path(name))
        numbers = given.only or fuzz_run.numbers(Path(name), given.seed, given.count, given.formats)
        found = fuzz_run.run(numbers, given.seed, Path(name), given.failures, given.workers)
    print(found.table())
    for entry in sorted(found.failures, key=lambda entry: (entry["kind"], entry["name"])):
        print(f"{entry['kind']}: file {entry['number']} ({entry['name']}): {entry['message'][:200]}")
    for entry in found.once:
        print(
            f"once and not again: {entry['kind']}: file {entry['number']} ({entry['name']}): {entry['message'][:200]}"
        )
    seconds, which = found.slowest
    print(f"slowest: {which}, {seconds:.2f} s CPU; seed {given.seed}, {time.perf_counter() - started:.0f} s in all")
    return 1 if found.failures else 0


if __name__ == "__main__":
    sys.exit(main())
