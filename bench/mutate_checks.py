"""Remove the checks of the package one by one: a test should fail each time.

    python bench/mutate_checks.py [--work FOLDER] [--collect TESTS ...] [--files PATTERN ...] [--sample N] [--again]

A check is a `raise` of an error of the package (or of a ValueError that becomes one). It is replaced by `pass` in a copy of
the project, and the tests that reach it are run there, the fastest first. A check that no test reaches has survived. Since a
mutant may do what its check forbids, such as replacing a device, the script refuses to run as root. The first run, or
--collect, records which checks each test reaches; records are accumulated. An interrupted run continues; --again repeats
survivors with the current tests. Prints survivors and figures; exit code 1 if there are survivors.
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
# Tests run in one go: first the quickest few.
PORTIONS = (10, 90)
Reached = dict[str, dict[str, float]]
LIMIT = 90.0


def main() -> int:
    """Collect, judge, print."""
    given = arguments()
    if os.geteuid() == 0 or os.access("/dev", os.W_OK):
        raise SystemExit("mutants may replace devices or remove files: run this as a user who owns nothing else")
    given.work.mkdir(parents=True, exist_ok=True)
    tree = copied(given.work)
    if given.collect or not (given.work / "reached.json").exists():
        collect(given.work, tree, given.collect or TESTS, given.workers)
    reached, verdicts = known(given.work / "reached.json"), known(given.work / "verdicts.json")
    checks = [s for s in sites(tree / "fastcontact") if any(fnmatch.fnmatch(s.file, p) for p in given.files)]
    if given.sample:
        checks = random.Random(given.seed).sample(checks, min(given.sample, len(checks)))
    left = [c for c in checks if c.key not in verdicts or (given.again and verdicts[c.key] != "killed")]

    reached = without_failing(tree, left, reached, given.work / "log.txt")
    write(given.work / "reached.json", reached)
    begin = time.monotonic()
    for number, check in enumerate(left, start=1):
        if time.monotonic() - begin > 60 * given.minutes:
            break
        tests = sorted(reached.get(check.key, {}), key=reached.get(check.key, {}).get)
        found = judged(check, tree, tests, given.work / "log.txt")
        verdicts[check.key] = found
        write(given.work / "verdicts.json", verdicts)
        print(f"{number}/{len(left)} {found} ({len(tests)} tests): {check.key}", flush=True)
    return told(checks, verdicts, reached)


def arguments() -> argparse.Namespace:
    """Return what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--work", type=Path, default=Path(tempfile.gettempdir(), "fastcontact-mutation"))
    parser.add_argument("--collect", nargs="+", metavar="TESTS", help="see which checks these tests reach")
    parser.add_argument("--files", nargs="+", default=["*"], metavar="PATTERN", help="only checks in these files")
    parser.add_argument("--sample", type=int, help="only so many checks, chosen by chance")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--again", action="store_true", help="judge survivors anew")
    parser.add_argument("--minutes", type=float, default=1e9, help="stop after this time")
    parser.add_argument("--workers", type=int, default=2, help="processes that collect")
    return parser.parse_args()


def copied(work: Path) -> Path:
    """Copy the project as it is now, so that what is not checked in counts too; compiled kernels stay."""
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
    beside = ROOT.parent / "shared"  # cases that some tests read, where they are there
    if beside.is_dir() and not (work / "shared").exists():
        (work / "shared").symlink_to(beside)
    return tree


def _without_sources(folder: Path) -> None:
    for path in folder.rglob("*.py"):
        path.unlink()


def collect(work: Path, tree: Path, tests: list[str], workers: int) -> None:
    """Run tests once and add to what is known which checks they reach."""
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
            "-n",
            str(workers),
            *tests,
        ]
        subprocess.run(command, cwd=tree, env=environment, check=False)
        found = [json.loads(path.read_text(encoding="utf-8")) for path in sorted(Path(notes).glob("*.json"))]
    reached: dict[str, dict[str, float]] = known(work / "reached.json")
    lines: dict[tuple[str, int], str] = {}
    for check in sites(tree / "fastcontact"):
        lines |= {(check.file, line): check.key for line in range(check.first, check.last + 1)}
    for part in found:
        for test, (seconds, places) in part.items():
            for key in {lines[tuple(place)] for place in places if tuple(place) in lines}:
                reached.setdefault(key, {})[test] = seconds
    write(work / "reached.json", reached)


def without_failing(tree: Path, checks: list[Site], reached: Reached, log: Path) -> Reached:
    """Return what is reached without the tests that fail here anyway: they would seem to notice everything."""
    import judge

    judge.load()
    tests: dict[str, float] = {}
    for check in checks:
        tests |= dict(sorted(reached.get(check.key, {}).items(), key=lambda entry: entry[1])[: PORTIONS[0]])
    failing = set(judge.failing(tree, list(tests), log)) if tests else set()
    return {key: {test: t for test, t in found.items() if test not in failing} for key, found in reached.items()}


def judged(check: Site, tree: Path, tests: list[str], log: Path) -> str:
    """Return whether tests notice that a check is not there."""
    import judge

    path = tree / "fastcontact" / check.file
    text, found = path.read_text(encoding="utf-8"), "survived"
    path.write_text(check.without(text), encoding="utf-8")
    try:
        first = 0
        for size in PORTIONS:
            if found == "survived" and tests[first : first + size]:
                found = judge.verdict(tree, tests[first : first + size], LIMIT, log)
            first += size
    finally:
        path.write_text(text, encoding="utf-8")
    return found


def told(checks: list[Site], verdicts: dict[str, str], reached: dict[str, dict[str, float]]) -> int:
    """Print survivors and figures."""
    for check in checks:
        if verdicts.get(check.key) == "survived":
            what = "survived" if reached.get(check.key) else "no test reaches"
            print(f"{what}: fastcontact/{check.file}:{check.first}: {check.key.partition('::')[2]}")
    counts = Counter(verdicts.get(check.key, "left") for check in checks)
    print(f"{len(checks)} checks: " + ", ".join(f"{count} {what}" for what, count in counts.most_common()))
    return 1 if counts["survived"] else 0


def known(path: Path) -> dict:
    """Return what a file of an earlier run says."""
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def write(path: Path, numbers: dict) -> None:
    """Replace a file as a whole."""
    new = path.with_suffix(".new")
    new.write_text(json.dumps(numbers, indent=1), encoding="utf-8")
    os.replace(new, path)


if __name__ == "__main__":
    sys.exit(main())
