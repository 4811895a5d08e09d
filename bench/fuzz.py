"""Reading of thousands of damaged files, each of which must give a correct result or a single clear error.

    python bench/fuzz.py [--count 10000] [--seed 1] [--workers 2] [--failures FOLDER]
        [--formats .deck .msh ...] [--only NUMBER ...]

The script damages small valid files of every format (tests/fuzz/fuzz_seeds.py), in single bytes or in their structure (HDF5,
TOML), and reads them in processes with at most 1 GiB of additional memory and 10 s of CPU time. The same seed gives the same
files. A table contains, for each format, the numbers of files that were read, of files that were refused with a clear error,
and of failures. A failure is any other error, a message of several lines, an exceeded limit, access to other files, a crash
or a hang. Files with failures are kept, and the exit code is then 1.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "fuzz"))

import fuzz_run


def main() -> int:
    """Read the damaged files and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--failures", type=Path, default=Path("fuzz-failures"))
    parser.add_argument("--formats", nargs="+", metavar="SUFFIX", help="make and read only files of these formats")
    parser.add_argument("--only", type=int, nargs="+", help="make and read only the files of these numbers")
    options = parser.parse_args()
    started = time.perf_counter()
    with tempfile.TemporaryDirectory() as name:
        fuzz_run.prepare(Path(name))
        numbers = options.only or fuzz_run.numbers(Path(name), options.seed, options.count, options.formats)
        results = fuzz_run.run(numbers, options.seed, Path(name), options.failures, options.workers)
    print(results.table())
    for entry in sorted(results.failures, key=lambda entry: (entry["kind"], entry["name"])):
        print(f"{entry['kind']}: file {entry['number']} ({entry['name']}): {entry['message'][:200]}")
    for entry in results.once:
        print(f"not reproduced: {entry['kind']}: file {entry['number']} ({entry['name']}): {entry['message'][:200]}")
    seconds, slowest_file = results.slowest
    print(
        f"slowest: {slowest_file}, {seconds:.2f} s CPU; seed {options.seed}, {time.perf_counter() - started:.0f} s in all"
    )
    return 1 if results.failures else 0


if __name__ == "__main__":
    sys.exit(main())
