"""The same contact problem solved by several programs, each as a whole process: ``python bench/peers PROBLEM [...]``.

bench/README.md describes the problems and lists the results.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from peers import HERE, PEERS, Peer
from process import measured

SIZES = {
    "forma04": [3_000, 12_000, 48_000, 190_000],
    "half": [12_000, 48_000, 181_000],
    "octant": [30_000, 103_000, 308_000],
}
STEPS = {"forma04": 20, "half": 20, "octant": 1}
COLUMNS = ("program", "unknowns", "CPU s", "wall s", "peak MB", "in ours", "force", "pressure", "stress", "iterations")


def main(arguments: list[str] | None = None) -> int:
    options = parsed(arguments)
    asked = dict(pair.split("=", 1) for pair in options.python)
    there: list[tuple[Peer, str]] = []
    absent = {}
    for peer in PEERS:
        if options.problem not in peer.problems or (options.only and peer.name not in options.only):
            continue
        interpreter = peer.interpreter(asked.get(peer.name))
        if interpreter is None:
            absent[peer.name] = peer.install
            print(f"{peer.label}: absent ({peer.install})")
        else:
            there.append((peer, interpreter))
            command = peer.command(interpreter, Path("PROBLEM.npz"), options.steps, Path("ANSWER"))
            print(f"{peer.label}: {' '.join(command)}")
    print("\n" + row(COLUMNS))
    rows = []
    for dofs in options.dofs:
        rows += of_size(options, dofs, there)
    if options.json:
        told = {"problem": options.problem, "steps": options.steps, "threads": options.threads}
        told |= {"cores": os.cpu_count(), "absent": absent, "runs": rows}
        options.json.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8")
    return 0 if all(found["status"] == 0 for found in rows if found["program"] == "fastcontact") else 1


def parsed(arguments: list[str] | None) -> argparse.Namespace:
    names = [peer.name for peer in PEERS]
    parser = argparse.ArgumentParser(prog="python bench/peers", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("problem", choices=sorted(STEPS), nargs="?", default="forma04")
    parser.add_argument("--dofs", type=int, nargs="+", metavar="N", help="about how many unknowns, several sizes")
    parser.add_argument("--steps", type=int, help="load steps (20; octant 1)")
    parser.add_argument("--only", nargs="+", choices=names, help="these programs")
    parser.add_argument("--python", action="append", default=[], metavar="NAME=PATH", help="a program's interpreter")
    parser.add_argument("--runs", type=int, default=1, help="counted runs; the one with the least CPU time is told")
    parser.add_argument("--threads", type=int, default=2, help="of programs that work in several (default 2)")
    parser.add_argument("--limit", type=float, default=600.0, metavar="S", help="CPU seconds that end a run")
    parser.add_argument("--cold", action="store_true", help="without the run before that fills caches of compiled code")
    parser.add_argument("--smallest", action="store_true", help="1000 unknowns, 3 steps: does everything run?")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all figures")
    options = parser.parse_args(arguments)
    if any("=" not in pair or pair.split("=")[0] not in names for pair in options.python):
        parser.error(f"--python wants NAME=PATH, NAME one of {', '.join(names)}")
    options.dofs = options.dofs or ([1_000] if options.smallest else SIZES[options.problem])
    options.steps = options.steps or min(STEPS[options.problem], 3 if options.smallest else 20)
    return options


def of_size(options: argparse.Namespace, dofs: int, there: list[tuple[Peer, str]]) -> list[dict[str, Any]]:
    """Run all programs on one mesh, in turn, and tell each at once."""
    rows: list[dict[str, Any]] = []
    ours = None
    with tempfile.TemporaryDirectory() as folder:
        given = Path(folder) / "problem.npz"
        n_dofs = write(options.problem, dofs, given)
        for peer, interpreter in there:
            found = best(options, peer, interpreter, given)
            if peer.name == "fastcontact":
                ours = found["cpu_s"]
            found |= {"program": peer.name, "n_dofs": n_dofs, "in_ours": found["cpu_s"] / ours if ours else None}
            rows.append(found)
            print(told(peer, found), flush=True)
    return rows


def write(problem: str, dofs: int, path: Path) -> int:
    """Write a problem and return the number of its unknowns; apart, since peak memory counts that of who starts it."""
    command = [sys.executable, str(HERE / "problems.py"), problem, str(dofs), str(path)]
    return int(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def best(options: argparse.Namespace, peer: Peer, interpreter: str, given: Path) -> dict[str, Any]:
    """Return the run with the least CPU time, after one on a small mesh that compiles what is kept."""
    threads = options.threads if peer.parallel else 1
    with tempfile.TemporaryDirectory() as folder:
        answer = Path(folder) / "answer.json"
        if not options.cold:
            small = Path(folder) / "small.npz"
            write(options.problem, 1_000, small)
            command = peer.command(interpreter, small, min(options.steps, 2), answer)
            measured(command, threads=threads, folder=Path(folder), limit_s=options.limit)
        runs = []
        for _ in range(options.runs):
            answer.unlink(missing_ok=True)
            command = peer.command(interpreter, given, options.steps, answer)
            found = measured(command, threads=threads, folder=Path(folder), limit_s=options.limit)
            if found["status"] == 0:
                content = json.loads(answer.read_text())
                found |= {"threads": threads, "answer": content, "cpu_s": content.pop("cpu_s", found["cpu_s"])}
            runs.append(found)
            if found["status"] != 0:
                return found
    return min(runs, key=lambda found: found["cpu_s"])


def told(peer: Peer, found: dict[str, Any]) -> str:
    cost = (f"{found['cpu_s']:.2f}", f"{found['wall_s']:.2f}", f"{found['peak_bytes'] / 1e6:.0f}")
    ratio = f"{found['in_ours']:.2f}" if found["in_ours"] else "-"
    if found["status"] != 0:
        last = (found["said"].strip().splitlines() or ["nothing said"])[-1]
        return row((peer.label, str(found["n_dofs"]), *cost, ratio)) + f"  ended with status {found['status']}: {last}"
    answer = found["answer"]
    numbers = (f"{answer[key]:.7g}" if key in answer else "-" for key in ("force", "pressure", "stress", "iterations"))
    cells = (peer.label, str(found["n_dofs"]), *cost, ratio, *numbers)
    return row(cells) + f"  {answer['version']}; {answer['contact']}"


def row(texts: Any) -> str:
    first, *rest = texts
    return f"{first:<18}" + "".join(f"{text:>11}" for text in rest)


if __name__ == "__main__":
    sys.exit(main())
