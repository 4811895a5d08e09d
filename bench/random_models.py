"""Random models: each must end in a correct result or in an error of the package.

    python bench/random_models.py [--count 2000] [--first 0] [--workers 1] [--limit 120] [--json FILE]
    python bench/random_models.py --seed 137 --show
    python bench/random_models.py --law adhesion [...]

Each seed determines a model (tests/random_models): in 2D or 3D, with one to three contact pairs, any element, materials of
any contrast, moving and rotating rigid obstacles, clearances, friction, shifted, rotated, graded and partly covered meshes,
cyclic sectors and periods, plates, orthotropic rings, bolts, couplings and heat. The script checks the invariants of each
result (tests/mechanics.py), and compares it with the result of an equivalent model (rotated, renumbered, or with supports
along normals, along axes, or as multi-point constraints). The outcome "told" is a result that fails a check and has a warning
about it. With --law, all pairs have this interface law (tests/random_models/laws.py). The script prints the numbers of models
by dimension, formulation, equivalent model and outcome, the errors by their first words, and the seeds of all findings; the
exit code is 1 if there are findings.
"""

from __future__ import annotations

import argparse
import collections
import json
import multiprocessing
import sys
import time
import traceback
from collections.abc import Iterator
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parents[1]
for folder in ("tests", "tests/random_models"):
    sys.path.insert(0, str(HERE / folder))

FINDINGS = ("failed check", "raw error", "too long", "process died")


def work(pipe: Any, law: str) -> None:
    """Receive seeds from a pipe and send the outcomes of their models, until None is received."""
    from outcome import outcome

    while (seed := pipe.recv()) is not None:
        pipe.send(outcome(seed, law))


class Worker:
    """A process that solves one model at a time."""

    def __init__(self, law: str) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, other = context.Pipe()
        self.process = context.Process(target=work, args=(other, law), daemon=True)
        self.process.start()
        other.close()
        self.seed, self.begin = -1, 0.0

    def give(self, seed: int) -> None:
        self.seed, self.begin = seed, time.monotonic()
        self.pipe.send(seed)

    def answer(self, limit: float) -> dict[str, Any] | None:
        """Return the outcome of the current model, also if the process has died or takes too long; None if it is running."""
        try:
            if self.pipe.poll(0.0):
                return dict(self.pipe.recv())
        except (EOFError, OSError):
            return {"seed": self.seed, "outcome": "process died", "text": f"exit code {self.process.exitcode}"}
        if time.monotonic() - self.begin > limit:
            return {"seed": self.seed, "outcome": "too long", "text": f"more than {limit:g} s"}
        return None

    def end(self) -> None:
        self.process.kill()
        self.process.join()


def rows(seeds: list[int], workers: int, limit: float, law: str) -> Iterator[dict[str, Any]]:
    """Yield the outcomes of all seeds, in the order in which the models are finished."""
    waiting = seeds[::-1]
    pool = [Worker(law) for _ in range(min(workers, len(seeds)))]
    for worker in pool:
        worker.give(waiting.pop())
    while pool:
        for worker in list(pool):
            row = worker.answer(limit)
            if row is None:
                continue
            yield row
            if row["outcome"] in ("process died", "too long"):
                worker.end()
                pool.remove(worker)
                worker = Worker(law) if waiting else worker
                pool += [worker] if waiting else []
            if waiting:
                worker.give(waiting.pop())
            elif worker in pool:
                worker.end()
                pool.remove(worker)
        time.sleep(0.01)


def table(results: list[dict[str, Any]], key: str) -> str:
    """Return a table in Markdown with the numbers of outcomes and the percentage of results, by the value of a key."""
    outcomes = ["result", "told", "own error", *FINDINGS]
    counts: dict[str, collections.Counter[str]] = collections.defaultdict(collections.Counter)
    for row in results:
        counts[str(row.get(key, "(not built)"))][row["outcome"]] += 1
        counts["all"][row["outcome"]] += 1
    lines = [f"| {key} | models | " + " | ".join(outcomes) + " | results |", "| --- " * (3 + len(outcomes)) + "|"]
    for name, count in sorted(counts.items(), key=lambda item: (item[0] == "all", -sum(item[1].values()))):
        total = sum(count.values())
        cells = " | ".join(str(count[outcome]) for outcome in outcomes)
        lines.append(f"| {name} | {total} | {cells} | {100 * count['result'] / total:.1f} % |")
    return "\n".join(lines)


def first_words(text: str) -> str:
    """Return the beginning of a message with asterisks in place of numbers and names, so that equal messages are counted."""
    words = ["*" if any(sign.isdigit() or sign in "'\"" for sign in word) else word for word in text.split()]
    return " ".join(words[:14])


def summary(results: list[dict[str, Any]]) -> str:
    """Return all tables, the errors by their first words, and the findings."""
    parts = [table(results, key) for key in ("kinematics", "family", "formulation", "pairs", "words")]
    errors = [row for row in results if row["outcome"] == "own error"]
    by_text: dict[str, list[int]] = collections.defaultdict(list)
    for row in errors:
        by_text[first_words(row["text"])].append(row["seed"])
    lines = [
        f"{len(seeds):4d}  {text} ... (seeds {', '.join(map(str, seeds[:5]))})"
        for text, seeds in sorted(by_text.items(), key=lambda item: -len(item[1]))
    ]
    worst = []
    names = (
        "balance",
        "given back",
        "moment",
        "penetration",
        "tension",
        "product",
        "cone",
        "driving",
        "carried",
        "said again",
    )
    for name in names:
        row = max(results, key=lambda outcome: outcome.get(name, 0.0))
        worst.append(f"{name} {row.get(name, 0.0):.2g} (seed {row['seed']})")
    findings = [
        f"seed {row['seed']}: {row['outcome']}: {row['text'][:300]}" for row in results if row["outcome"] in FINDINGS
    ]
    return "\n\n".join([*parts, "\n".join(lines), "largest: " + ", ".join(worst), "\n".join(findings)])


def show(seed: int, law: str) -> None:
    """Print the description of a model and its outcome."""
    from drawing import drawn
    from outcome import outcome

    try:
        model = drawn(seed)
        print(model.model.describe(), f"ramp {model.ramp}, options {model.options}", model.labels, sep="\n")
        for pair in model.model.contact:
            print(pair)
    except Exception:
        traceback.print_exc()
    for name, value in outcome(seed, law).items():
        print(f"{name:>14} {value}")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=2000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, action="append")
    parser.add_argument("--show", action="store_true", help="print the models, and solve them in this process")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--limit", type=float, default=120.0, help="seconds for one model")
    parser.add_argument("--law", default="", help="interface law of all pairs, such as adhesion")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    seeds = options.seed or list(range(options.first, options.first + options.count))
    if options.show:
        for seed in seeds:
            show(seed, options.law)
        return 0
    begin, results = time.perf_counter(), []
    for row in rows(seeds, options.workers, options.limit, options.law):
        results.append(row)
        if row["outcome"] in FINDINGS:
            print(f"seed {row['seed']}: {row['outcome']}: {row['text'][:200]}", flush=True)
        if options.json and (len(results) % 20 == 0 or len(results) == len(seeds)):
            options.json.write_text(json.dumps(results, indent=0, default=str))
    print(summary(results))
    print(
        f"{len(results)} models, {sum(row.get('seconds', 0.0) for row in results):.0f} CPU s, "
        f"{time.perf_counter() - begin:.0f} s"
    )
    return 1 if any(row["outcome"] in FINDINGS for row in results) else 0


if __name__ == "__main__":
    sys.exit(main())
