"""Removal of the checks of the package one at a time, after which a test should fail.

    python bench/mutate_checks.py [--work FOLDER] [--collect TESTS ...] [--files PATTERN ...] [--sample N] [--again]

A check is a `raise` of an error of the package, or of a ValueError that becomes one. It is replaced by `pass` in a copy of
the project, where the tests that reach it are run, the fastest first. A check survives if no test fails, or if no test
reaches it. A package without a check may do what the check prevents, such as replacing a device, and the script therefore
refuses to run as root. The first run, or --collect, records which checks each test reaches; records are accumulated. An
interrupted run continues, and --again repeats survivors with the current tests. The script prints the survivors and the
numbers of checks by outcome; the exit code is 1 if there are survivors.
"""

from __future__ import annotations

import argparse
import fnmatch
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
HERE = ROOT / "bench" / "mutation"
sys.path.insert(0, str(HERE))

from sites import Site, sites  # noqa: E402

COPIED = ("fastcontact", "tests", "data", "docs", "bench", "README.md", "pyproject.toml", "CHANGELOG.md", ".ci")
TESTS = ["tests/unit", "tests/mistakes"]
# Numbers of tests that are run at a time for a check, beginning with the fastest tests.
PORTIONS = (10, 90)
Reached = dict[str, dict[str, float]]
LIMIT = 90.0  # largest time of a set of tests [s]


def main() -> int:
    """Collect the records, test the checks, and print the results."""
    options = arguments()
    if os.geteuid() == 0 or os.access("/dev", os.W_OK):
        raise SystemExit("mutants may replace devices or remove files: run this as a user who owns nothing else")
    options.work.mkdir(parents=True, exist_ok=True)
    tree = copy_project(options.work)
    if options.collect or not (options.work / "reached.json").exists():
        collect(options.work, tree, options.collect or TESTS, options.workers)
    reached, verdicts = read_json(options.work / "reached.json"), read_json(options.work / "verdicts.json")
    checks = [s for s in sites(tree / "fastcontact") if any(fnmatch.fnmatch(s.file, p) for p in options.files)]
    if options.sample:
        checks = random.Random(options.seed).sample(checks, min(options.sample, len(checks)))
    left = [c for c in checks if c.key not in verdicts or (options.again and verdicts[c.key] != "killed")]

    reached = without_failing(tree, left, reached, options.work / "log.txt")
    write(options.work / "reached.json", reached)
    begin = time.monotonic()
    for number, check in enumerate(left, start=1):
        if time.monotonic() - begin > 60 * options.minutes:
            break
        tests = sorted(reached.get(check.key, {}), key=reached.get(check.key, {}).get)
        verdict = verdict_without(check, tree, tests, options.work / "log.txt")
        verdicts[check.key] = verdict
        write(options.work / "verdicts.json", verdicts)
        print(f"{number}/{len(left)} {verdict} ({len(tests)} tests): {check.key}", flush=True)
    return print_summary(checks, verdicts, reached)


def arguments() -> argparse.Namespace:
    """Return the arguments of the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--work", type=Path, default=Path(tempfile.gettempdir(), "fastcontact-mutation"))
    parser.add_argument("--collect", nargs="+", metavar="TESTS", help="record which checks these tests reach")
    parser.add_argument(
        "--files", nargs="+", default=["*"], metavar="PATTERN", help="test only the checks in these files"
    )
    parser.add_argument("--sample", type=int, help="number of checks, which are selected at random")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--again", action="store_true", help="test survivors again")
    parser.add_argument("--minutes", type=float, default=1e9, help="duration after which the script stops")
    parser.add_argument("--workers", type=int, default=2, help="number of processes for --collect")
    return parser.parse_args()


def copy_project(work: Path) -> Path:
    """Copy the working tree with uncommitted changes, and return the path of the copy, which keeps its compiled kernels."""
    tree = work / "tree"
    tree.mkdir(exist_ok=True)
    for name in COPIED:
        source, target = ROOT / name, tree / name
        if source.is_file():
            shutil.copy2(source, target)
        elif source.is_dir():
            if target.exists():
                _without_sources(target)
            shutil.copytree(source, target, dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__", "_build"))
    shared = ROOT.parent / "shared"  # further cases, which some tests read if they are available
    if shared.is_dir() and not (work / "shared").exists():
        (work / "shared").symlink_to(shared)
    return tree


def _without_sources(folder: Path) -> None:
    for path in folder.rglob("*.py"):
        path.unlink()


def collect(work: Path, tree: Path, tests: list[str], workers: int) -> None:
    """Run tests once, and add the checks that they reach to the records."""
    with tempfile.TemporaryDirectory(dir=work) as notes:
        environment = {
            **os.environ,
            "PYTHONPATH": os.pathsep.join([str(tree), str(HERE)]),
            "MUTATION_NOTES": notes,
            "MUTATION_PACKAGE": str(tree / "fastcontact"),
        }
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-p",
            "reached",
            "-p",
            "no:cacheprovider",
            "-m",
            "not slow",
            "-n",
            str(workers),
            *tests,
        ]
        subprocess.run(command, cwd=tree, env=environment, check=False)
        records = [json.loads(path.read_text(encoding="utf-8")) for path in sorted(Path(notes).glob("*.json"))]
    reached: dict[str, dict[str, float]] = read_json(work / "reached.json")
    lines: dict[tuple[str, int], str] = {}
    for check in sites(tree / "fastcontact"):
        lines |= {(check.file, line): check.key for line in range(check.first, check.last + 1)}
    for record in records:
        for test, (seconds, places) in record.items():
            for key in {lines[tuple(place)] for place in places if tuple(place) in lines}:
                reached.setdefault(key, {})[test] = seconds
    write(work / "reached.json", reached)


def without_failing(tree: Path, checks: list[Site], reached: Reached, log: Path) -> Reached:
    """Return the records without the tests that fail even with all checks, and which would seem to detect any removal."""
    import judge

    judge.load()
    tests: dict[str, float] = {}
    for check in checks:
        tests |= dict(sorted(reached.get(check.key, {}).items(), key=lambda entry: entry[1])[: PORTIONS[0]])
    failing = set(judge.failing(tree, list(tests), log)) if tests else set()
    return {key: {test: t for test, t in times.items() if test not in failing} for key, times in reached.items()}


def verdict_without(check: Site, tree: Path, tests: list[str], log: Path) -> str:
    """Return the verdict of tests that are run without a check, such as "killed" or "survived"."""
    import judge

    path = tree / "fastcontact" / check.file
    text, verdict = path.read_text(encoding="utf-8"), "survived"
    path.write_text(check.without(text), encoding="utf-8")
    try:
        first = 0
        for size in PORTIONS:
            if verdict == "survived" and tests[first : first + size]:
                verdict = judge.verdict(tree, tests[first : first + size], LIMIT, log)
            first += size
    finally:
        path.write_text(text, encoding="utf-8")
    return verdict


def print_summary(checks: list[Site], verdicts: dict[str, str], reached: dict[str, dict[str, float]]) -> int:
    """Print the survivors and the numbers of checks by verdict; return the exit code."""
    for check in checks:
        if verdicts.get(check.key) == "survived":
            kind = "survived" if reached.get(check.key) else "no test reaches"
            print(f"{kind}: fastcontact/{check.file}:{check.first}: {check.key.partition('::')[2]}")
    counts = Counter(verdicts.get(check.key, "left") for check in checks)
    print(f"{len(checks)} checks: " + ", ".join(f"{count} {verdict}" for verdict, count in counts.most_common()))
    return 1 if counts["survived"] else 0


def read_json(path: Path) -> dict:
    """Return the contents of a JSON file; empty if the file does not exist."""
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def write(path: Path, numbers: dict) -> None:
    """Write a JSON file atomically."""
    new = path.with_suffix(".new")
    new.write_text(json.dumps(numbers, indent=1), encoding="utf-8")
    os.replace(new, path)


if __name__ == "__main__":
    sys.exit(main())
