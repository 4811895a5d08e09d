"""Assembly and stress recovery by element, with one and two threads: ``python bench/elements.py [ELEMENT ...] [--runs 9]``.

The script prints the largest rate of several alternating runs, in millions of cells per second. Assembly fills a matrix with
a known pattern, and recovery computes averaged nodal stresses from displacements. ``mean dilatation`` is the time of both
with mean dilatation, as for nu = 0.4999, relative to the time without it, with one thread. ``first touch`` is the time in
which the operating system provides the memory of the matrix, relative to the assembly with one thread; more threads hardly
reduce it.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import fastcontact as fc
from fastcontact._jit.decorators import set_threads
from fastcontact.elasticity.recovery import nodal_stress
from fastcontact.elasticity.stiffness import sparsity, stiffness

# Cells along an edge of the square or cube.
MESHES = {"quad4": 400, "tri6": 250, "tet4": 36, "hex8": 44, "hex20": 20}
COLUMNS = (
    "element",
    "cells",
    "assembly, 1 thread",
    "2 threads",
    "ratio",
    "first touch",
    "recovery, 1 thread",
    "2 threads",
    "mean dilatation: assembly, recovery",
)


def mesh_of(element: str) -> fc.Mesh:
    n = MESHES[element]
    if element in ("quad4", "tri6"):
        return fc.generate.block((1.0, 1.0), (n, n), element, origin=(1.0, 0.0))
    return fc.generate.box((1.0, 1.0, 1.0), (n, n, n), element)


def tasks(mesh: fc.Mesh, averaged: bool = False) -> tuple[Callable[[], Any], Callable[[], Any]]:
    """Return functions that assemble the stiffness and recover the stress of a mesh, with or without mean dilatation."""
    kinematics = "axisymmetric" if mesh.dim == 2 else "3d"
    model = fc.Model(mesh, kinematics)
    model.add_material(fc.LinearElastic(E=1.0, nu=0.3, volumetric="mean_dilatation" if averaged else "plain"))
    moduli, material = model.material_numbers()
    pattern, u = sparsity(mesh), np.random.default_rng(0).normal(size=mesh.points.shape)
    averaged_materials = model.averaged_materials()
    return (
        lambda: stiffness(mesh, kinematics, moduli, material, pattern, averaged_materials),
        lambda: nodal_stress(mesh, kinematics, moduli, material, u, averaged_materials),
    )


def touch_memory(nbytes: int) -> Any:
    """Return new memory of `nbytes` bytes, after writing to each page."""
    memory = np.zeros(nbytes // 8)
    memory[::512] = 1.0
    return memory


def seconds(work: Callable[[], Any]) -> float:
    start = time.perf_counter()
    result = work()
    passed = time.perf_counter() - start
    del result
    return passed


def measure(element: str, runs: int) -> tuple[str, ...]:
    """Return a row of the table. The results with one and two threads must be bitwise identical."""
    mesh = mesh_of(element)
    assemble, recover = tasks(mesh)
    set_threads(1)
    single = assemble().data, recover()
    set_threads(2)
    if not (np.array_equal(assemble().data, single[0]) and np.array_equal(recover(), single[1])):
        raise SystemExit(f"{element}: the number of threads changes the result")
    with_mean = tasks(mesh, averaged=True)
    for work in with_mean:
        work()
    nbytes, touch, best = single[0].nbytes, np.inf, {}
    del single
    for _ in range(runs):
        for count in (1, 2):
            set_threads(count)
            for name, work in (("assembly", assemble), ("recovery", recover)):
                best[name, count] = min(best.get((name, count), np.inf), seconds(work))
        set_threads(1)
        for name, work in zip(("assembly", "recovery"), with_mean):
            best[name, 0] = min(best.get((name, 0), np.inf), seconds(work))
        touch = min(touch, seconds(lambda: touch_memory(nbytes)))
    cells = len(mesh.cells[element])
    a1, a2, r1, r2 = (best[key] for key in (("assembly", 1), ("assembly", 2), ("recovery", 1), ("recovery", 2)))
    rate = [f"{1e-6 * cells / value:.3g}" for value in (a1, a2, r1, r2)]
    mean = f"{best['assembly', 0] / a1:.2f}, {best['recovery', 0] / r1:.2f}"
    return element, str(cells), rate[0], rate[1], f"{a1 / a2:.2f}", f"{touch / a1:.0%}", *rate[2:], mean


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("elements", nargs="*", metavar="ELEMENT", help=f"of {', '.join(MESHES)} (default: all)")
    parser.add_argument("--runs", type=int, default=9, help="runs of each (9)")
    options = parser.parse_args()
    if unknown := set(options.elements) - set(MESHES):
        parser.error(f"no mesh for {', '.join(sorted(unknown))}: expected one of {', '.join(MESHES)}")
    print(" | ".join(COLUMNS))
    for element in options.elements or MESHES:
        print(" | ".join(measure(element, options.runs)), flush=True)


if __name__ == "__main__":
    main()
