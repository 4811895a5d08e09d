"""Prices of nonlinear bodies: user CPU seconds of whole processes, ours and a peer's in turn on the same machine.

``python bench/nonlinear.py block PYTHON_WITH_FELUPE [N] [STEPS]``: a neo-Hookean block of N^3 hex8, drawn by a tenth of its
height and sheared by as much. FElupe solves by conjugate gradients with Jacobi's preconditioner, which takes less than its
default, SuperLU.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import time

import numpy as np

OURS = """
import sys, numpy as np, fastcontact as fc
n, steps = map(int, sys.argv[1:])
mesh = fc.generate.box((1.0, 1.0, 1.0), (n, n, n), element="hex8")
model = fc.Model(mesh, "3d", strain="finite")
model.add_material(fc.NeoHookean(E=18.0 / 7.0, nu=2.0 / 7.0))
model.fix("ZMIN", "xyz")
model.prescribe("ZMAX", x=0.1, y=0.0, z=0.1)
found = fc.solve(model, steps)
force = found[-1].reaction[mesh.points_of("ZMAX")].sum(axis=0)
print(mesh.points.size, sum(len(s.iterations["history"]) for s in found), *force)
"""
THEIRS = """
import sys, numpy as np, felupe as fem
from scipy.sparse import diags
from scipy.sparse.linalg import cg
n, steps = map(int, sys.argv[1:])
mesh = fem.Cube(n=n + 1)
field = fem.FieldContainer([fem.Field(fem.RegionHexahedron(mesh), dim=3)])
solid = fem.SolidBody(fem.NeoHooke(mu=1.0, bulk=2.0), field)
top, count = np.isclose(mesh.points[:, 2], 1.0), 0

def solver(A, b):
    return cg(A, b, rtol=1e-8, M=diags(1.0 / A.diagonal()), maxiter=10000)[0]

for part in np.linspace(0.0, 1.0, steps + 1)[1:]:
    held = {"bottom": fem.Boundary(field[0], fz=0.0)}
    for axis, value in enumerate((0.1, 0.0, 0.1)):
        skip = [1, 1, 1]
        skip[axis] = 0
        held[f"top{axis}"] = fem.Boundary(field[0], mask=top, skip=tuple(skip), value=part * value)
    dof0, dof1 = fem.dof.partition(field, held)
    found = fem.newtonrhapson(
        items=[solid], dof0=dof0, dof1=dof1, ext0=fem.dof.apply(field, held, dof0), tol=1e-6, verbose=0, solver=solver
    )
    count += found.iterations
force = found.fun.toarray() if hasattr(found.fun, "toarray") else np.asarray(found.fun)
print(mesh.points.size, count, *force.reshape(-1, 3)[top].sum(axis=0))
"""


def timed(command: list[str]) -> tuple[float, float, str]:
    """Return user CPU and wall time [s] of a process, and the last line that it prints."""
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime, time.perf_counter()
    told = subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip().splitlines()
    after = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    return after - before, time.perf_counter() - begin, told[-1] if told else ""


def block(theirs: str, n: str = "31", steps: str = "10") -> None:
    """Print times, iterations and forces of three pairs of runs, after one of ours that compiles."""
    timed([sys.executable, "-c", OURS, "2", "1"])
    ratios = []
    for _ in range(3):
        ours, peer = timed([sys.executable, "-c", OURS, n, steps]), timed([theirs, "-c", THEIRS, n, steps])
        for name, (user, wall, told) in (("fastcontact", ours), ("FElupe", peer)):
            print(
                f"{name}: user {user:.1f} s, wall {wall:.1f} s; unknowns, iterations, force on top: {told}", flush=True
            )
        ratios.append(peer[0] / ours[0])
    print(f"FElupe over fastcontact: {np.median(ratios):.2f}")


if __name__ == "__main__":
    block(*sys.argv[2:])
