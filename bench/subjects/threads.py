"""Steps of a contact analysis on one, two, four ... threads, each in a separate process.

A sphere on a block, solved by multigrid, mesh excluded, assembly included. A run is timed without and with Python's
profiler, which gives the wall time of every stage in the main thread. A stage is a function of the package with its calls
outside the package. Its serial part follows from the wall times on N threads by Amdahl's law, ``t(N) = s + p / N`` with
nonnegative s and p, in the least-squares sense. Waiting of the main thread belongs to the stage that distributes the work.
Limited memory bandwidth counts as serial, too: for comparison, the table gives the bytes per second of a product with the
finest matrix and of a sum over a long array.
"""

from __future__ import annotations

import cProfile
import json
import os
import pstats
import subprocess
import sys
import time
from pathlib import Path

SIZES = (280_000,)
SMALLEST = 1_500
STEPS = 20
# Bytes of the array whose sum tells how fast memory is read: far more than caches hold. A small run takes fewer.
LONG, SHORT = 480_000_000, 8_000_000
# Calls of which the fastest counts.
CALLS = 9
# Stages that take this part of the run on all threads, or more, are told.
TOLD = 0.01
BENCH = Path(__file__).resolve().parents[1]


def counts():
    """Return the numbers of threads: powers of two, and all cores."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return sorted({*(2**k for k in range(cores.bit_length()) if 2**k <= cores), cores})


def entries(smallest, tell, sizes=None):
    """Return the figures, one entry a size: runs by number of threads, efficiency, and the serial part of each stage."""
    steps, threads = (2, [1, 2]) if smallest else (STEPS, counts())
    found = []
    for size in [SMALLEST] if smallest else sizes or SIZES:
        runs = []
        for count in threads:
            tell(f"{size} unknowns, {count} threads")
            runs.append({"threads": count, **child(size, steps, count, False), **child(size, steps, count, True)})
        found.append(entry(steps, runs))
    return found


def child(size, steps, threads, profiled):
    """Run `alone` in a process with a number of threads and return what it measures."""
    names = [f"{name}_NUM_THREADS" for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")]
    path = os.pathsep.join([str(BENCH), str(BENCH.parent), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        [sys.executable, __file__, str(size), str(steps), str(int(profiled))], stdout=subprocess.PIPE, text=True,
        check=True, env={**os.environ, **dict.fromkeys(names, str(threads)), "PYTHONPATH": path},
    )  # fmt: skip
    return json.loads(done.stdout.splitlines()[-1])


def alone(size, steps, profiled):
    """Return the figures of one run in this process, warm: a small one runs first and loads the kernels."""
    from suite.subjects import load
    from suite.timing import peak_bytes

    contact = load("contact")
    _march(contact, contact.sphere_on_block(SMALLEST), 2)
    model = contact.sphere_on_block(size)
    if profiled:
        profile = cProfile.Profile()
        profile.runcall(_march, contact, model, steps)
        return {"stages": stages(pstats.Stats(profile).stats)}
    cpu = time.process_time()
    cold, wall, solver = _march(contact, model, steps)
    found = {
        "n_dofs": model.n_dofs, "wall_s": wall, "cold_wall_s": cold, "cpu_s": time.process_time() - cpu,
        "iterations": solver.counters.iterations, "peak_bytes": peak_bytes(),
    }  # fmt: skip
    return found | bandwidths(solver, SHORT if size <= SMALLEST else LONG)


def bandwidths(solver, size):
    """Return the bytes a second that a sum over `size` bytes reads; bytes and seconds of products with the finest matrix."""
    import numpy as np

    from fastcontact.linear.krylov.iterations import Iteration

    long, iteration = np.ones(size // 8), Iteration(size // 8)
    found = {"read_rate": size / _fastest(lambda: iteration.dot(long, long))}
    A, n = solver.hierarchy.levels[0].A, solver.hierarchy.n
    where = sum(part.nbytes for part in (A.storage[:3] if A.storage[3] else (A.indptr, A.indices)))
    for name, matrix, parts in (("single", A, (A.data,)), ("exact", solver.K.scaled, solver.K.scaled.exact_data)):
        x, y = np.ones((2, n), A.data.dtype if name == "single" else float)
        seconds = _fastest(lambda matrix=matrix, x=x, y=y: matrix.multiply(x, y))
        read = sum(part.nbytes for part in parts) + where + x.nbytes + y.nbytes
        found |= {f"{name}_bytes": read, f"{name}_s": seconds}
    return found


def _fastest(work):
    """Return the wall time of the fastest of some calls [s]."""
    walls = []
    for _ in range(CALLS):
        begin = time.perf_counter()
        work()
        walls.append(time.perf_counter() - begin)
    return min(walls)


def _march(contact, model, count):
    """Assemble and make all steps; return the wall time of the first step, assembly included, and of all, and the solver."""
    begin, cold = time.perf_counter(), 0.0
    problem = contact.started(model, "amg", count)
    state = problem.initial_state()
    for index, instant in enumerate(problem.ramp.instants, start=1):
        state, _ = contact.load_step(problem, state, index, instant)
        cold = cold or time.perf_counter() - begin
    return cold, time.perf_counter() - begin, problem.solver


def stages(stats):
    """Return the seconds of each function of the package, with what it calls outside of the package."""
    found, shares = {}, {}
    for function, (_, _, own, _, callers) in stats.items():
        for name, share in _owners(function, callers, stats, shares).items():
            found[name] = found.get(name, 0.0) + share * own
    return found


def _owners(function, callers, stats, shares):
    """Return which functions of the package, in what shares, the own time of a function belongs to."""
    name = _stage(function)
    if name is not None:
        return {name: 1.0}
    if function not in shares:
        shares[function] = {"other": 1.0}  # while it is looked for: functions that call themselves
        total = sum(times[2] for times in callers.values())
        found = {}
        for caller, times in callers.items() if total > 0.0 else ():
            for owner, share in _owners(caller, stats[caller][4], stats, shares).items():
                found[owner] = found.get(owner, 0.0) + share * times[2] / total
        shares[function] = found or {"other": 1.0}
    return shares[function]


def _stage(function):
    """Return the name of a function of the package; None for others."""
    file, _, name = function
    parts = Path(file).parts
    inside = len(parts) - 1 - parts[::-1].index("fastcontact") if "fastcontact" in parts else None
    return None if inside is None or inside + 1 == len(parts) else "/".join((*parts[inside + 1 :], name))


def entry(steps, runs):
    """Return the figures of all runs of one size: efficiencies, and the serial part as a whole and of stages."""
    one = runs[0]
    for run in runs:
        run["speed_up"] = one["wall_s"] / run["wall_s"]
        run["efficiency"] = run["speed_up"] * one["threads"] / run["threads"]
        for name in ("single", "exact"):
            run[f"{name}_rate"] = run[f"{name}_bytes"] / run[f"{name}_s"]
    threads = [run["threads"] for run in runs]
    serial, shared = amdahl(threads, [run["wall_s"] for run in runs])
    told = []
    for name in {name for run in runs for name in run["stages"]}:
        walls = [run["stages"].get(name, 0.0) for run in runs]
        told.append({"stage": name, "wall_s": walls, "serial_s": amdahl(threads, walls)[0]})
    last = sum(runs[-1]["stages"].values())
    told = [stage for stage in told if stage["wall_s"][-1] > TOLD * last]
    return {
        "n_dofs": one["n_dofs"], "steps": steps, "runs": runs, "serial_share": serial / ((serial + shared) or 1.0),
        "stages": sorted(told, key=lambda stage: -stage["serial_s"]),
    }  # fmt: skip


def amdahl(threads, walls):
    """Return the serial and the shared seconds (s, p) of ``walls = s + p / threads`` in least squares, none negative."""
    n, mean = len(walls), sum(walls) / len(walls)
    inverse = [1.0 / count for count in threads]
    middle = sum(inverse) / n
    spread = sum((x - middle) ** 2 for x in inverse)
    if spread == 0.0:
        return mean, 0.0
    shared = sum((x - middle) * wall for x, wall in zip(inverse, walls, strict=True)) / spread
    serial = mean - shared * middle
    if shared < 0.0:
        return mean, 0.0
    if serial < 0.0:
        through = sum(x * wall for x, wall in zip(inverse, walls, strict=True)) / sum(x * x for x in inverse)
        return 0.0, through
    return serial, shared


def lines(found):
    """Return the table."""
    table = []
    for entry in found:
        table.append(f"{entry['n_dofs']} unknowns, {entry['steps']} steps")
        table.append(
            f"{'threads':>8} {'wall s':>8} {'CPU s':>8} {'cold step s':>11} {'speed-up':>8} {'efficiency':>10} "
            f"{'iterations':>10} {'peak bytes an unknown':>21}"
        )
        table += [
            f"{run['threads']:>8} {run['wall_s']:>8.2f} {run['cpu_s']:>8.2f} {run['cold_wall_s']:>11.2f} "
            f"{run['speed_up']:>8.2f} {run['efficiency']:>10.2f} {run['iterations']:>10} "
            f"{run['peak_bytes'] / run['n_dofs']:>21.0f}"
            for run in entry["runs"]
        ]
        table += _memory(entry["runs"])
        table.append(f"serial part by Amdahl's law: {100 * entry['serial_share']:.1f} % of the run on one thread")
        threads = " ".join(f"{'on ' + str(run['threads']):>8}" for run in entry["runs"])
        table.append(f"{'serial s':>8} {threads}  stage, wall s (profiled)")
        for stage in entry["stages"]:
            walls = " ".join(f"{wall:>8.3f}" for wall in stage["wall_s"])
            table.append(f"{stage['serial_s']:>8.3f} {walls}  {stage['stage']}")
    return table


def _memory(runs):
    """Return the lines that tell how near products come to the limit of the memory."""
    table = [
        f"{'threads':>8} {'sum GB/s':>8} {'product MB':>10} {'ms':>7} {'GB/s':>6} {'of sum':>6} {'exact MB':>8} "
        f"{'ms':>7} {'GB/s':>6} {'of sum':>6}  memory read by a sum, and by products with the finest matrix"
    ]
    for run in runs:
        row = f"{run['threads']:>8} {run['read_rate'] / 1e9:>8.1f}"
        for name, width in (("single", 10), ("exact", 8)):
            rate = run[f"{name}_rate"]
            row += f" {run[f'{name}_bytes'] / 1e6:>{width}.1f} {1e3 * run[f'{name}_s']:>7.2f} {rate / 1e9:>6.1f}"
            row += f" {rate / run['read_rate']:>6.2f}"
        table.append(row)
    return table


if __name__ == "__main__":
    print(json.dumps(alone(*(int(text) for text in sys.argv[1:]))))
