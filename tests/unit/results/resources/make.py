"""Write the result files of this version that later versions must read, with their contents in JSON.

    python tests/unit/results/resources/make.py

To be run once when `layout.SCHEMA` is raised, before the release; existing files are never replaced. Small runs
with all that a file can hold: friction, an obstacle, cell fields, warnings, the restart state.
"""

from __future__ import annotations

import gzip
import json
import math
import tempfile
from pathlib import Path

import numpy as np

import fastcontact as fc
from fastcontact.mesh.generate import block, box
from fastcontact.results import layout

HERE = Path(__file__).parent
CASE_TEXT = 'title = "old"\n'
FIELDS = ("displacement", "stress", "von_mises", "von_mises_signed", "reaction")
CONTACT = ("points", "gap", "pressure", "multiplier", "force", "radius", "active", "dissipation", "shear", "slip")
CONTACT += ("slip_total",)


def spheres() -> fc.Model:
    model = fc.Model(fc.generate.half_spheres("quad4", arc_sizes=(6.0, 12.0), segments=2), "axisymmetric")
    model.add_material(fc.LinearElastic(E=20_000.0, nu=0.3))
    model.fix("A1A2", "x")
    model.prescribe("A2B2", y=-2.0)
    model.prescribe("A1B1", y=+2.0)
    model.add_contact("hertz", secondary="CONT1", primary="CONT2", friction=0.3)
    return model


def obstacle(dim: int) -> fc.Model:
    if dim == 2:
        mesh, kinematics = block((2.0, 1.0), (6, 3), "quad8", origin=(-1.0, -1.0)), "plane_strain"
        top, down, bottom, held = "TOP", "y", "BOTTOM", "xy"
    else:
        mesh, kinematics = box((2.0, 2.0, 1.0), (2, 2, 1), "hex8", (-1.0, -1.0, -1.0)), "3d"
        top, down, bottom, held = "ZMAX", "z", "ZMIN", "xyz"
    model = fc.Model(mesh, kinematics)
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
    model.fix(bottom, held)
    ball = fc.obstacles.Sphere((0.0,) * (dim - 1) + (3.0,), 3.0)
    model.add_obstacle("ball", secondary=top, obstacle=ball, force={down: -8.0}, motion={"x": 0.01}, friction=0.2)
    return model


def told(steps: list[fc.StepResult], model: fc.Model) -> dict:
    """What a reader must find; sums are exact, so that no order of summation matters."""
    found = []
    for step in steps:
        (contact,) = step.contact.values()
        entry = {name: getattr(step, name) for name in ("index", "load_factor", "iterations")}
        for name in FIELDS:
            values = getattr(step, name)
            entry[name] = [math.fsum(values.ravel()), np.abs(values).max()]
        entry["contact"] = {name: getattr(contact, name) for name in CONTACT}
        if contact.obstacle_displacement is not None:
            entry["contact"]["obstacle_displacement"] = contact.obstacle_displacement
        entry["warnings"] = list(step.warnings)
        entry["cell_fields"] = step.cell_fields
        found.append(entry)
    return {"groups": model.mesh.group_names, "n_points": model.mesh.n_points, "steps": found}


def make(name: str, model: fc.Model) -> None:
    target = HERE / f"schema{layout.SCHEMA}-{name}"
    if target.with_suffix(".json").exists():
        print(f"{target.name} is there already")
        return
    count, steps = sum(map(len, model.mesh.solids.values())), []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.vtkhdf"
        with fc.ResultWriter(path, model, case_text=CASE_TEXT, cell_fields=["error"]) as out:

            def on_step(step: fc.StepResult) -> None:
                step.cell_fields["error"] = np.arange(count) / 7.0 + step.index
                steps.append(step)
                out.write(step)

            fc.solve(model, fc.linear_ramp(2), on_step=on_step)
        target.with_suffix(".vtkhdf.gz").write_bytes(gzip.compress(path.read_bytes(), 9, mtime=0))
    text = json.dumps(told(steps, model), default=lambda value: value.tolist())
    target.with_suffix(".json").write_text(text + "\n", encoding="utf-8")
    print(f"{target.name}: written")


if __name__ == "__main__":
    make("friction", spheres())
    make("obstacle", obstacle(2))
    make("obstacle-3d", obstacle(3))
