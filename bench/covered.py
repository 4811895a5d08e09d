"""Statement and branch coverage of the package, kernels included.

Usage: python bench/covered.py [--workers N] [--data FOLDER] [--again] [--missing]

Runs the tests that `tests/modes/coverage.toml` names, including the commands that they start, and a second time without
compilation (NUMBA_DISABLE_JIT=1) those that it names for the lines of kernels. Exit code 1 if less than 95 % is covered, or
if a line or branch is uncovered that the same file does not list with its reason. `--missing` prints such lines in the
format of that list; `--again` evaluates the data of the last run.
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
LISTED = ROOT / "tests" / "modes" / "coverage.toml"
ENOUGH = 95.0
Place = tuple[str, str, str]


def measure(tests: dict[str, list[str]], workers: int, data: Path) -> int:
    """Run the tests under coverage, compiled and not; return the largest exit code of pytest."""
    data.mkdir(parents=True, exist_ok=True)
    for old in data.glob(".coverage*"):
        old.unlink()
    codes = [_run(tests["compiled"], workers, data, "0"), _run(tests["slow"], workers, data, "0", "-m", "slow")]
    codes.append(_run(tests["interpreted"], workers, data, "1"))
    _coverage(data, "combine", "-q")
    return max(codes)


def _run(tests: list[str], workers: int, data: Path, disable: str, *options: str) -> int:
    """Run tests under coverage, with `disable` for NUMBA_DISABLE_JIT; return the exit code of pytest."""
    environment = {
        "NUMBA_DISABLE_JIT": disable,
        "PYTHONPATH": str(ROOT),  # commands, too, run what stands here, not what is installed
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
    """Give file, function ("" outside of any) and text of every line not run, and of every branch not taken."""
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
    """Return the places that no entry with a reason stands for: some lines, a whole function, or a whole file."""
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
    """Return the places as entries of the list."""
    together = defaultdict(list)
    for file, function, line in places:
        together[file, function].append(line)
    entries = []
    for (file, function), lines in together.items():
        texts = "".join(f"  {json.dumps(line, ensure_ascii=False)},\n" for line in dict.fromkeys(lines))
        entries.append(f'[[uncovered]]\nfile = "{file}"\nfunction = "{function}"\nlines = [\n{texts}]\nreason = ""\n')
    return "\n".join(entries)


def main(arguments: list[str] | None = None) -> int:
    """Measure, compare with the list, and say what is missing."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--workers", type=int, default=2, help="processes that run tests (2)")
    parser.add_argument("--data", type=Path, default=ROOT / ".coverage-data", help="folder of what was measured")
    parser.add_argument("--again", action="store_true", help="look at the data of the last run")
    parser.add_argument("--missing", action="store_true", help="print unlisted lines as entries of the list")
    given = parser.parse_args(arguments)
    with LISTED.open("rb") as file:
        listed = tomllib.load(file)
    code = 0 if given.again else measure(listed["tests"], given.workers, given.data)
    _coverage(given.data, "json", "-q", "-o", str(given.data / "report.json"))
    report = json.loads((given.data / "report.json").read_text(encoding="utf-8"))
    covered = report["totals"]["percent_covered"]
    places = list(uncovered(report))
    missing = unlisted(places, listed.get("uncovered", []))
    print(
        f"statements and branches covered: {covered:.2f} %; lines not covered: {len(places)}, unlisted {len(missing)}"
    )
    if given.missing:
        print(listing(missing))
    else:
        print("\n".join(f"{file}: {function}: {line}" for file, function, line in missing))
    return 1 if code or missing or covered < ENOUGH else 0


if __name__ == "__main__":
    sys.exit(main())
