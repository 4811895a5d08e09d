"""Writing and reading a result file of 5 steps, in units of copying the same stresses to a plain NumPy file."""

import tempfile
from pathlib import Path

import numpy as np

import fastcontact as fc

SIZES = (1_000, 10_000, 100_000)


def works(size):
    n = max(2, round((size / 3) ** (1 / 3)) - 1)
    model = fc.Model(fc.generate.box((1.0, 1.0, 1.0), (n, n, n)), kinematics="3d")
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
    model.fix("ZMIN", "xyz")
    model.prescribe("ZMAX", x=0.0, y=0.0, z=-0.01)
    steps = fc.solve(model, fc.linear_ramp(5))
    folder = tempfile.TemporaryDirectory()
    path = Path(folder.name) / "result.vtkhdf"

    def write():
        with fc.ResultWriter(path, model) as out:
            for step in steps:
                out.write(step)

    def read():
        with fc.open_results(path) as results:
            return [step.stress for step in results]

    def plain(kept=folder):
        np.save(Path(kept.name) / "plain.npy", np.stack([step.stress for step in steps]))

    return model.n_dofs, {"write": write, "read": read, "plain NumPy file": plain}
