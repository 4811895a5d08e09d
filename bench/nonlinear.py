"""Cost of nonlinear bodies in comparison with other programs: user CPU time of processes, which run alternately.

``python bench/nonlinear.py block PYTHON_WITH_FELUPE [N] [STEPS]`` solves a neo-Hookean block of N^3 hex8, which is stretched
and sheared by a tenth of its height. FElupe uses conjugate gradients with a Jacobi preconditioner, which are faster than its
default, SuperLU. Both programs run in one thread, because threads of BLAS would spin and add to the CPU time of FElupe.

``python bench/nonlinear.py indentation [SIZE] [STEPS] [RADIUS]`` solves an axisymmetric model in which a rigid ball is
pressed into an elastic-plastic block, both with quad8. SIZE is the length of facets up to the radius RADIUS; the defaults are
0.02 and 0.6. CalculiX (``ccx``) uses the same mesh (CAX8R), surface-to-surface penalty contact and the same number of fixed
increments; fastcontact uses mortar. The ball has at most 20 cells along the arc, because CalculiX 2.20 rejects narrower cells
on the axis.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from peers.calculix_deck import contact_surface, node_set, table

FASTCONTACT_BLOCK = """
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
FELUPE_BLOCK = """
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
INDENTATION = """
import sys, numpy as np, fastcontact as fc
size, steps, radius = float(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])
block = fc.generate.graded_block("quad8", width=6.0, contact_radius=radius, contact_size=size)
cap = fc.generate.block((1.0, 1.0), (min(round(0.8 / size), 20), 2), "quad8", name="BALL")
angle, radii = 0.4 * cap.points[:, 0], 2.5 - 0.2 * cap.points[:, 1]
cap = cap.replace(points=np.column_stack([radii * np.sin(angle), 2.5 - radii * np.cos(angle)]))
cap = fc.generate.renamed(cap, lambda group: {"BALL": "BALL", "BOTTOM": "ARC"}.get(group))
mesh = fc.generate.union(block, cap)
model = fc.Model(mesh, "axisymmetric")
model.add_material(fc.LinearElastic(E=200e3, nu=0.3), "BALL")
model.add_material(fc.ElasticPlastic(E=200e3, nu=0.3, yield_stress=400.0, hardening=[(0.0, 400.0), (1.0, 1400.0)]), "BLOCK")
model.fix("BOTTOM", "xy")
model.fix("SYMMETRY_X", "x")
model.prescribe("BALL", x=0.0, y=-0.04)
model.add_contact("ball", secondary="CONTACT", primary="ARC")
if sys.argv[4:]:
    np.savez(sys.argv[4], points=mesh.points, cells=mesh.cells["quad8"],
             of_ball=mesh.split(mesh.cell_groups["BALL"])["quad8"],
             top=mesh.cells_of("CONTACT")["line3"], arc=mesh.cells_of("ARC")["line3"],
             **{name: mesh.points_of(name) for name in ("BOTTOM", "SYMMETRY_X", "BALL")})
    sys.exit()
found = fc.solve(model, steps)
print(mesh.points.size, sum(len(s.iterations["history"]) for s in found), -found[-1].contact["ball"].force[1])
"""


def deck(problem: Path, steps: int, path: Path) -> None:
    """Write the deck of CalculiX for the mesh that INDENTATION has saved in `problem`."""
    arrays = np.load(problem)
    cells = arrays["cells"]
    ball = np.isin(np.arange(len(cells)), arrays["of_ball"])
    with path.open("w") as file:
        file.write("*NODE,NSET=ALL\n")
        table(file, np.arange(1, len(arrays["points"]) + 1), arrays["points"], "%.16g")
        for name, in_set in (("BLOCK", ~ball), ("BALLS", ball)):
            file.write(f"*ELEMENT,TYPE=CAX8R,ELSET={name}\n")
            table(file, np.flatnonzero(in_set) + 1, cells[in_set] + 1, "%d")
        for name in ("BOTTOM", "SYMMETRY_X", "BALL"):
            node_set(file, name, arrays[name])
        contact_surface(file, "TOP", cells[:, :4], arrays["top"][:, :2])
        contact_surface(file, "ARC", cells[:, :4], arrays["arc"][:, :2])
        file.write(
            "*MATERIAL,NAME=STEEL\n*ELASTIC\n200000.,.3\n*SOLID SECTION,ELSET=BALLS,MATERIAL=STEEL\n"
            "*MATERIAL,NAME=YIELDS\n*ELASTIC\n200000.,.3\n*PLASTIC\n400.,0.\n1400.,1.\n"
            "*SOLID SECTION,ELSET=BLOCK,MATERIAL=YIELDS\n"
            "*SURFACE INTERACTION,NAME=I\n*SURFACE BEHAVIOR,PRESSURE-OVERCLOSURE=LINEAR\n2.E7\n"
            "*CONTACT PAIR,INTERACTION=I,TYPE=SURFACE TO SURFACE\nTOP,ARC\n"
            f"*STEP,INC={10 * steps}\n*STATIC,DIRECT\n{1 / steps},1.0\n"
            "*BOUNDARY\nBOTTOM,1,2,0.0\nSYMMETRY_X,1,1,0.0\nBALL,1,1,0.0\nBALL,2,2,-0.04\n"
            f"*NODE PRINT,NSET=BALL,TOTALS=ONLY,FREQUENCY={steps}\nRF\n*END STEP\n"
        )


def indentation(size: str = "0.02", steps: str = "40", radius: str = "0.6") -> None:
    """Print times, unknowns, iterations and forces of a run with each program, after a run that compiles the kernels."""
    timed([sys.executable, "-c", INDENTATION, "0.1", "1", "0.6"])
    ours = timed([sys.executable, "-c", INDENTATION, size, steps, radius])
    print(
        f"fastcontact: user {ours[0]:.1f} s, wall {ours[1]:.1f} s; unknowns, iterations, force: {ours[2]}", flush=True
    )
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        timed([sys.executable, "-c", INDENTATION, size, steps, radius, str(folder / "problem.npz")])
        deck(folder / "problem.npz", int(steps), folder / "deck.inp")
        theirs = timed(["ccx", "deck"], folder)
        totals = [line.split() for line in (folder / "deck.dat").read_text().splitlines() if line.strip()]
    force = -180.0 * float(totals[-1][1])  # CalculiX models a wedge of two degrees
    print(f"CalculiX: user {theirs[0]:.1f} s, wall {theirs[1]:.1f} s; force: {force}")
    print(f"CalculiX over fastcontact: {theirs[0] / ours[0]:.2f}")


def timed(command: list[str], folder: Path | None = None) -> tuple[float, float, str]:
    """Run a command in a folder with one thread; return its user CPU time [s], its wall time [s] and its last output line."""
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime, time.perf_counter()
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
    done = subprocess.run(command, check=True, capture_output=True, text=True, cwd=folder, env=os.environ | threads)
    output = done.stdout.strip().splitlines()
    after = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    return after - before, time.perf_counter() - begin, output[-1] if output else ""


def block(theirs: str, n: str = "31", steps: str = "10") -> None:
    """Print times, iterations and forces of three runs with each program, after a run that compiles the kernels."""
    timed([sys.executable, "-c", FASTCONTACT_BLOCK, "2", "1"])
    ratios = []
    for _ in range(3):
        ours, peer = (
            timed([sys.executable, "-c", FASTCONTACT_BLOCK, n, steps]),
            timed([theirs, "-c", FELUPE_BLOCK, n, steps]),
        )
        for name, (user, wall, output) in (("fastcontact", ours), ("FElupe", peer)):
            print(
                f"{name}: user {user:.1f} s, wall {wall:.1f} s; unknowns, iterations, force on top: {output}",
                flush=True,
            )
        ratios.append(peer[0] / ours[0])
    print(f"FElupe over fastcontact: {np.median(ratios):.2f}")


if __name__ == "__main__":
    {"block": block, "indentation": indentation}[sys.argv[1]](*sys.argv[2:])
