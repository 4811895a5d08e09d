"""Whole runs in a separate process: print the results as JSON, bits as digests, sizes as numbers.

Usage: python whole_runs.py NAME ... with the names of `RUNS`. The environment chooses the mode: number of threads, cache
folder, compiled or not.
"""

import hashlib
import json
import sys

import numpy as np

import fastcontact as fc
from fastcontact._jit import parallel


def plane() -> list[fc.StepResult]:
    """Two half-spheres, a factorisation."""
    model = fc.Model(fc.generate.half_spheres("tri3", size=10.0), "axisymmetric")
    model.add_material(fc.LinearElastic(E=20_000.0, nu=0.3))
    model.fix("A1A2", "x")
    model.prescribe("A2B2", y=-2.0)
    model.prescribe("A1B1", y=2.0)
    model.add_contact("pair", secondary="CONT1", primary="CONT2", formulation="node_to_segment")
    return fc.solve(model, fc.linear_ramp(2), linear_solver="direct")


def cubes(
    n: int,
    m: int,
    solver: str,
    law: fc.LinearElastic | fc.NeoHookean | fc.ElasticPlastic | None = None,
    **options: object,
) -> list[fc.StepResult]:
    """Two cubes of n and m cells a side, pressed together and a little along each other."""
    parts = [
        fc.generate.renamed(mesh, {group: f"{group}_{name}" for group in mesh.cell_groups})
        for name, mesh in {
            "LOW": fc.generate.box((1.0, 1.0, 1.0), (n, n, n), name="LOW"),
            "HIGH": fc.generate.box((1.0, 1.0, 1.0), (m, m, m), origin=(0.0, 0.0, 1.0), name="HIGH"),
        }.items()
    ]
    model = fc.Model(fc.generate.union(*parts), "3d", strain="finite" if isinstance(law, fc.NeoHookean) else "small")
    model.add_material(law or fc.LinearElastic(E=1000.0, nu=0.3))
    model.fix("ZMIN_LOW", "xyz")
    model.prescribe("ZMAX_HIGH", x=0.002, y=0.0, z=-0.01)
    model.add_contact("pair", secondary="ZMIN_HIGH", primary="ZMAX_LOW", formulation="node_to_segment", **options)
    return fc.solve(model, fc.linear_ramp(1), linear_solver=solver)


# "solid" has so many unknowns that sums of conjugate gradients are shared by threads, "small" is for other modes.
RUNS = {
    "plane": plane,
    "solid": lambda: cubes(18, 12, "amg"),
    "friction": lambda: cubes(3, 2, "direct", friction=0.3),
    "stretched": lambda: cubes(3, 2, "direct", fc.NeoHookean(E=1000.0, nu=0.499), friction=0.3),
    "yielding": lambda: cubes(3, 2, "amg", fc.ElasticPlastic(E=1000.0, nu=0.3, yield_stress=2.0, kinematic=10.0)),
    "small": lambda: cubes(3, 2, "amg"),
}


def found(steps: list[fc.StepResult]) -> dict[str, object]:
    """Digest of all bits of displacement, stress and contact force, and their sizes."""
    arrays = [a for step in steps for a in (step.displacement, step.stress, step.contact["pair"].force_vectors)]
    bits = hashlib.sha256(b"".join(np.ascontiguousarray(a).tobytes() for a in arrays)).hexdigest()
    return {"bits": bits, "sizes": [float(np.abs(a).max()) for a in arrays]}


if __name__ == "__main__":
    parallel.SINGLE_THREAD_WORK = 0  # small meshes are shared by threads as large ones are
    print(json.dumps({name: found(RUNS[name]()) for name in sys.argv[1:]}))
