"""Statement and branch coverage of the package, kernels included.

Usage: python bench/covered.py [--workers N] [--data FOLDER] [--again] [--missing]

The script runs the tests in `tests/modes/coverage.toml`, including the commands that they start. The tests in its list
`interpreted` are run without compilation (NUMBA_DISABLE_JIT=1), for the lines of kernels. The exit code is 1 if less than 95
% is covered, or if an uncovered line or branch is not listed in the same file with a reason. `--missing` prints such lines in
the format of the file, and `--again` evaluates the data of the last run.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
LIST_FILE = ROOT / "tests" / "modes" / "coverage.toml"
LEAST_COVERAGE = 95.0
Place = tuple[str, str, str]


def measure(tests: dict[str, list[str]], workers: int, data: Path) -> int:
    """Run the tests under coverage, with and without compilation, and return the largest exit code of pytest."""
    data.mkdir(parents=True, exist_ok=True)
    for old in data.glob(".coverage*"):
        old.unlink()
    kinds = (("compiled", "0", "not slow"), ("slow", "0", "slow"), ("interpreted", "1", "not slow"))
    codes = [_run(tests[kind], workers, data, disable, "-m", marks) for kind, disable, marks in kinds]
    _coverage(data, "combine", "-q")
    return max(codes)


def _run(tests: list[str], workers: int, data: Path, disable: str, *options: str) -> int:
    """Run tests under coverage with the value `disable` of NUMBA_DISABLE_JIT, and return the exit code of pytest."""
    environment = {
        "NUMBA_DISABLE_JIT": disable,
        "PYTHONPATH": str(ROOT),  # commands use the package of this checkout instead of an installed one
        "OPENBLAS_NUM_THREADS": "1",
        "COVERAGE_CORE": "ctrace",
        "COVERAGE_FILE": f"{data}/.coverage",
    }
    command = ["-m", "coverage", "run", "-m", "pytest", "-n", str(workers), "-p", "no:cacheprovider", "--tb=short"]
    return subprocess.run(
        [sys.executable, *command, *options, *tests], cwd=ROOT, env={**os.environ, **environment}
    ).returncode


def _coverage(data: Path, *arguments: str) -> None:
    command = [sys.executable, "-m", "coverage", *arguments, f"--data-file={data}/.coverage"]
    subprocess.run(command, cwd=ROOT, check=True)


def uncovered(report: dict) -> Iterator[Place]:
    """Yield file, function (empty outside functions) and text of all lines and branches that were not executed."""
    for name, file in sorted(report["files"].items()):
        text = (ROOT / name).read_text(encoding="utf-8").splitlines()
        for function, part in file["functions"].items():
            missing = set(part["missing_lines"])
            for line in sorted(missing):
                yield name, function, text[line - 1].strip()
            for line in sorted({start for start, _ in part["missing_branches"]} - missing):
                if not missing.intersection(abs(end) for start, end in part["missing_branches"] if start == line):
                    yield name, function, "branch: " + text[line - 1].strip()


def unlisted(places: list[Place], entries: list[dict]) -> list[Place]:
    """Return the places that are not covered by an entry with a reason for lines, for a function or for a file."""
    known: set[tuple[str, ...]] = set()
    for entry in entries:
        if not entry.get("reason", "").strip():
            continue
        if "lines" in entry:
            known |= {(entry["file"], entry["function"], line) for line in entry["lines"]}
        else:
            known.add((entry["file"], entry["function"]) if "function" in entry else (entry["file"],))
    return [place for place in places if known.isdisjoint({place, place[:2], place[:1]})]


def listing(places: list[Place]) -> str:
    """Return places in the format of the list of uncovered lines."""
    by_function = defaultdict(list)
    for file, function, line in places:
        by_function[file, function].append(line)
    entries = []
    for (file, function), lines in by_function.items():
        texts = "".join(f"  {json.dumps(line, ensure_ascii=False)},\n" for line in dict.fromkeys(lines))
        entries.append(f'[[uncovered]]\nfile = "{file}"\nfunction = "{function}"\nlines = [\n{texts}]\nreason = ""\n')
    return "\n".join(entries)


def main(arguments: list[str] | None = None) -> int:
    """Measure the coverage, compare it with the list, and print unlisted places."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--workers", type=int, default=2, help="number of processes that run tests (2)")
    parser.add_argument("--data", type=Path, default=ROOT / ".coverage-data", help="folder of the coverage data")
    parser.add_argument("--again", action="store_true", help="evaluate the data of the last run")
    parser.add_argument("--missing", action="store_true", help="print unlisted lines as entries of the list")
    options = parser.parse_args(arguments)
    with LIST_FILE.open("rb") as file:
        listed = tomllib.load(file)
    code = 0 if options.again else measure(listed["tests"], options.workers, options.data)
    _coverage(options.data, "json", "-q", "-o", str(options.data / "report.json"))
    report = json.loads((options.data / "report.json").read_text(encoding="utf-8"))
    covered = report["totals"]["percent_covered"]
    places = list(uncovered(report))
    missing = unlisted(places, listed.get("uncovered", []))
    print(
        f"statements and branches covered: {covered:.2f} %; lines not covered: {len(places)}, unlisted {len(missing)}"
    )
    if options.missing:
        print(listing(missing))
    else:
        print("\n".join(f"{file}: {function}: {line}" for file, function, line in missing))
    return 1 if code or missing or covered < LEAST_COVERAGE else 0


if __name__ == "__main__":
    sys.exit(main())
