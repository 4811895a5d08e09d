"""Cost of a linear solution by multigrid, and of a contact analysis relative to it.

Usage: python bench/linear.py [--problem box|blocks|sphere] [--dofs N ...] [--steps 20] [--pyamg] [--json FILE]

The problem ``box`` is a cube of hex8 that is fixed at its base and compressed at its top; it measures set-up, linear solution
and bandwidth. ``blocks`` are two tied cubes with non-matching meshes. ``sphere`` is a quarter of a half-sphere on a block,
with a single step to the full load and with 20 steps, both with converged geometry.

Times are CPU times of the process. L is the cost of a linear solution on the same mesh to the same tolerance, without set-up,
measured in the same run, and ``triad`` is the memory bandwidth of a core. A small problem runs first and compiles the
kernels.
"""

from __future__ import annotations

import argparse
import json
import resource
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.sparse import csr_array
from threadpoolctl import threadpool_limits

import fastcontact as fc
from fastcontact._jit import decorators
from fastcontact.analysis.criteria import Criteria
from fastcontact.analysis.load_step import load_step
from fastcontact.analysis.problem import Problem, near_nullspace, prepare
from fastcontact.contact.configuration import Configuration
from fastcontact.linear.krylov import krylov_kernels
from fastcontact.linear.multigrid.level import DEGREE
from fastcontact.linear.solvers.amg import Amg
from fastcontact.linear.solvers.pyamg import Pyamg


def timed(work: Any) -> tuple[Any, float, float]:
    """Return the result of a call, its CPU time [s] and its wall time [s]."""
    cpu, wall = time.process_time(), time.perf_counter()
    result = work()
    return result, time.process_time() - cpu, time.perf_counter() - wall


def triad() -> float:
    """Return the memory bandwidth of a core [GB/s], the median of nine operations ``p = z + beta p`` on long vectors."""
    z, p = np.ones(20_000_000), np.ones(20_000_000)
    krylov_kernels.direction(0, len(p), 0.5, z, p)
    return float(
        np.median([24e-9 * len(z) / timed(lambda: krylov_kernels.direction(0, len(p), 0.5, z, p))[1] for _ in range(9)])
    )


def material(model: fc.Model) -> fc.Model:
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
    return model


def box(dofs: int) -> fc.Model:
    n = round((dofs / 3) ** (1 / 3)) - 1
    model = material(fc.Model(fc.generate.box((1.0, 1.0, 1.0), (n, n, n)), kinematics="3d"))
    model.fix("ZMIN", "xyz")
    model.prescribe("ZMAX", x=0.0, y=0.0, z=-0.01)
    return model


def blocks(dofs: int) -> fc.Model:
    n = round((dofs / 3 / 1.35) ** (1 / 3)) - 1
    m = max(2, round(0.7 * n))
    low = fc.generate.box((1.0, 1.0, 1.0), (n, n, n), name="LOW")
    high = fc.generate.box((1.0, 1.0, 1.0), (m, m, m), origin=(0.0, 0.0, 1.0), name="HIGH")
    named = [fc.generate.renamed(mesh, {k: f"{k}_{name}" for k in mesh.cell_groups}) for mesh, name in
             ((low, "LOW"), (high, "HIGH"))]  # fmt: skip
    model = material(fc.Model(fc.generate.union(*named), kinematics="3d"))
    model.fix("ZMIN_LOW", "xyz")
    model.prescribe("ZMAX_HIGH", x=0.0, y=0.0, z=-0.01)
    model.add_contact("c", secondary="ZMIN_HIGH", primary="ZMAX_LOW", formulation="node_to_segment")
    return model


def sphere(dofs: int) -> fc.Model:
    h = 0.06 * (114_036 / dofs) ** (1 / 3)
    mesh = fc.generate.sphere_on_block("hex8", R=1.0, size=h, contact_size=h / 3, contact_radius=0.2)
    model = material(fc.Model(mesh, kinematics="3d"))
    model.fix("SYMMETRY_X", "x")
    model.fix("SYMMETRY_Z", "z")
    model.fix("BLOCK_BOTTOM", "y")
    model.prescribe("SPHERE_TOP", y=-0.02)
    model.add_contact("c", secondary="CONT_SPHERE", primary="CONT_BLOCK", formulation="node_to_segment")
    return model


def bytes_per_iteration(solver: Amg) -> int:
    """Return what one iteration must read of matrices at least: K once, levels and prolongators as the cycle does."""
    cycle_bytes = (
        2 * DEGREE * sum(level.A.nbytes + level.inverse_diagonal.nbytes for level in solver.hierarchy.levels[:-1])
    )
    transfer_bytes = 2 * sum(level.P.nbytes for level in solver.hierarchy.levels if level.P is not None)
    K = solver.K.scaled
    return K.nbytes + (0 if K.low is None else K.low.nbytes) + cycle_bytes + transfer_bytes


def linear_solution(problem: Problem, tolerance: float) -> dict[str, Any]:
    """Solve for the full load without contact; return the cost of the second of two runs."""
    solver = problem.solver
    solver.tolerance = tolerance
    lift = problem.load_at(1.0).lift
    loaded = solver.load(problem.system.right_side(np.zeros_like(lift), lift))
    none = csr_array((0, len(lift))), np.empty(0)
    for _ in range(2):
        before = solver.counters.iterations
        _, cpu, wall = timed(lambda: loaded.solve(*none))
    return {"cpu_s": cpu, "wall_s": wall, "iterations": solver.counters.iterations - before}


def pyamg_solution(problem: Problem) -> dict[str, Any]:
    """Return what preparation and solution cost with pyamg's multigrid and SciPy's conjugate gradients, one BLAS thread."""
    solver, lift = Pyamg(1e-8), problem.load_at(1.0).lift
    K, modes = problem.solver.K.restored(), problem.system.unknowns_of(near_nullspace(problem.model))
    with threadpool_limits(1):
        _, setup, _ = timed(lambda: solver.prepare(K, modes))
        loaded = solver.load(problem.system.right_side(np.zeros_like(lift), lift))
        _, cpu, wall = timed(lambda: loaded.solve(csr_array((0, len(lift))), np.empty(0)))
    return {"setup_cpu_s": setup, "cpu_s": cpu, "wall_s": wall, "iterations": solver.counters.iterations}


def steps(problem: Problem, count: int, tolerance: float, contact: dict[str, Any]) -> None:
    """Solve a problem with an existing hierarchy and add its cost to `contact`."""
    solver, ramp = problem.solver, fc.linear_ramp(count)
    assert isinstance(solver, Amg)
    solver.tolerance = tolerance
    problem = replace(problem, criteria=Criteria(geometry=tolerance), ramp=ramp)
    state = problem.initial_state()
    cpu, before = 0.0, solver.counters.iterations
    inside = [0.0]
    solution = solver.solution

    def timed_call(*arguments: Any) -> Any:
        result, seconds, _ = timed(lambda: solution(*arguments))
        inside[0] += seconds
        return result

    solver.solution = timed_call
    updates = 0
    for index, instant in enumerate(ramp.instants, start=1):
        (state, result), seconds, _ = timed(
            lambda at=state, index=index, instant=instant: load_step(problem, at, index, instant)
        )
        cpu += seconds
        updates += result.iterations["geometry_updates"] + 1
    solver.solution = solution
    contact |= {"cpu_s": cpu, "solver_cpu_s": inside[0], "iterations": solver.counters.iterations - before,
                "pairings": updates, "active": int(state.active["c"].sum()), "setups": solver.counters.setups}  # fmt: skip


def prepare_problem(name: str, dofs: int) -> tuple[Problem, float]:
    """Return a problem with its hierarchy, and the CPU time of the set-up of the hierarchy [s]."""
    model = {"box": box, "blocks": blocks, "sphere": sphere}[name](dofs)
    seconds: list[float] = []
    prepare_solver = Amg.prepare

    def timed_call(*arguments: Any, **options: Any) -> Any:
        result, cpu, _ = timed(lambda: prepare_solver(*arguments, **options))
        seconds.append(cpu)
        return result

    Amg.prepare = timed_call  # type: ignore[method-assign]
    try:
        problem = prepare(model, fc.linear_ramp(), Criteria(), linear_solver="amg", linear_tolerance=1e-8)
        return problem, seconds[-1]
    finally:
        Amg.prepare = prepare_solver  # type: ignore[method-assign]


def measure(name: str, dofs: int, count: int, with_pyamg: bool) -> dict[str, Any]:
    bandwidth = triad()
    problem, setup = prepare_problem(name, 5_000)  # compiles
    problem, setup = prepare_problem(name, dofs)
    solver, model = problem.solver, problem.model
    assert isinstance(solver, Amg)
    n = model.n_dofs
    results: dict[str, Any] = {"problem": name, "n_dofs": n, "threads": decorators.threads()}
    results |= {"triad_GB_per_cpu_s": bandwidth, "setup_cpu_s": setup}
    if with_pyamg:
        results["pyamg"] = pyamg_solution(problem)
    L = linear_solution(problem, 1e-8)
    factor = 1e9 / (n * L["iterations"])
    L |= {"ns_per_dof_iteration_cpu": L["cpu_s"] * factor, "ns_per_dof_iteration_wall": L["wall_s"] * factor}
    L["GB_per_cpu_s"] = 1e-9 * bytes_per_iteration(solver) * L["iterations"] / L["cpu_s"]
    L["part_of_triad"] = L["GB_per_cpu_s"] / bandwidth
    results |= {"linear": L, "hierarchy": repr(solver)}
    if name == "blocks":
        rows = problem.pairs["c"].constraints(Configuration.undeformed(model.mesh.points))
        lift = problem.load_at(1.0).lift
        B, gap0 = problem.system.rows(rows.B, rows.gap0, lift)
        use = np.flatnonzero(np.diff(B.indptr) > 0)
        loaded = solver.load(problem.system.right_side(np.zeros_like(lift), lift))
        for _ in range(2):
            before = solver.counters.iterations
            _, cpu, _ = timed(lambda: loaded.solve(B[use], -gap0[use]))
        results["tied"] = {"cpu_s": cpu, "iterations": solver.counters.iterations - before, "equations": len(use)}
    if name == "sphere":
        steps(problem, 1, 1e-2, {})  # compiles
        results["linear_1e-4"] = linear_solution(problem, 1e-4)
        for name, number, tolerance in (("cold", 1, 1e-8), ("steps", count, 1e-8), ("steps_1e-4", count, 1e-4)):
            results[name] = {}
            steps(problem, number, tolerance, results[name])
            unit = results["linear_1e-4" if tolerance > 1e-6 else "linear"]
            results[name] |= {
                "iterations_in_L": results[name]["iterations"] / unit["iterations"],
                "solver_cpu_in_L": results[name]["solver_cpu_s"] / unit["cpu_s"],
                "cpu_in_L": results[name]["cpu_s"] / unit["cpu_s"],
            }
    results["peak_kB_per_dof"] = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / n
    return results


def report(results: dict[str, Any]) -> str:
    """Return the results as indented lines."""
    lines = [
        f"{results['problem']}, {results['n_dofs']} unknowns, {results['threads']} threads: {results['hierarchy']}"
    ]
    for key, value in results.items():
        if isinstance(value, dict):
            value = ", ".join(f"{k} {v:.4g}" for k, v in value.items())
        lines.append(f"  {key:<20} {value:.4g}" if isinstance(value, float) else f"  {key:<20} {value}")
    return "\n".join(lines[:1] + [line for line in lines[1:] if "hierarchy" not in line])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--problem", choices=("box", "blocks", "sphere"), default="sphere")
    parser.add_argument("--dofs", type=int, nargs="+", default=[30_000, 100_000])
    parser.add_argument("--steps", type=int, default=20)
    parser.add_argument("--pyamg", action="store_true", help="also time pyamg's set-up")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    results = []
    for dofs in options.dofs:
        results.append(measure(options.problem, dofs, options.steps, options.pyamg))
        print(report(results[-1]), flush=True)
    if options.json:
        options.json.write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
