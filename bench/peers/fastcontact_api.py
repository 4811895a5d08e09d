"""fastcontact through its public functions: ``python fastcontact_api.py PROBLEM.npz STEPS ANSWER.json [again|SOLVER]``.

The geometry converges in every step, the relative residual of iterative solvers is 1e-8, and stresses are recovered in every
step. With ``again`` the analysis is done twice, and the CPU time of the second one, model included, is reported instead of
that of the process: the cost of a further analysis in a program that uses the library. SOLVER replaces "auto".
"""

import json
import sys
import time

import fastcontact as fc  # in alphabetical order, as users have it; idle threads of NumPy then sleep

# isort: split
import numpy as np

TOLERANCE = 1e-8


def of(block, dim):
    return {(2, 4): "quad4", (3, 8): "hex8", (2, 2): "line2", (3, 4): "quad4"}[dim, block.shape[1]]


def mesh_of(given):
    """Return the mesh with its contact surfaces as cell groups and its supports as point groups."""
    points, solid = given["points"], given["cells"]
    dim = points.shape[1]
    facets = {key.removeprefix("facets_"): given[key] for key in given.files if key.startswith("facets_")}
    together = np.concatenate(list(facets.values()))
    cells = {of(solid, dim): solid, of(together, dim): together}
    first, groups = len(solid), {"SOLID": np.arange(len(solid))}
    for name, block in facets.items():
        groups[name] = first + np.arange(len(block))
        first += len(block)
    fixed = {key.removeprefix("nodes_"): given[key] for key in given.files if key.startswith("nodes_")}
    return fc.Mesh(points, cells, groups, {**fixed, "POLE": [int(given["POLE"])]})


def model_of(given):
    mesh, problem = mesh_of(given), str(given["problem"])
    approach = float(given["approach"])
    model = fc.Model(mesh, kinematics="3d" if problem == "octant" else "axisymmetric")
    model.add_material(fc.LinearElastic(E=float(given["E"]), nu=float(given["nu"])), groups=["SOLID"])
    if problem == "octant":
        model.fix("SYMMETRY_X", "x")
        model.fix("SYMMETRY_Z", "z")
        model.prescribe("SPHERE_TOP", y=-approach)
    else:
        model.fix("A1A2", "x")
        model.prescribe("A2B2", y=-approach / (2 if problem == "forma04" else 1))
    if problem == "forma04":
        model.prescribe("A1B1", y=approach / 2)
        model.add_contact("c", secondary="CONT1", primary="CONT2", formulation="node_to_segment")
    else:
        plane = fc.obstacles.HalfSpace(point=(0.0,) * mesh.dim, normal=(0.0, 1.0, 0.0)[: mesh.dim])
        secondary = "CONT_SPHERE" if problem == "octant" else "CONT2"
        model.add_obstacle("c", secondary=secondary, obstacle=plane, formulation="node_to_segment")
    return model


def solved(given, steps, solver="auto"):
    """Return the last step, and the iterations of all."""
    counts, last, criteria = [], None, fc.Criteria(geometry=TOLERANCE)
    for last in fc.solve_steps(
        model_of(given), fc.linear_ramp(steps), linear_solver=solver, linear_tolerance=TOLERANCE, criteria=criteria
    ):
        counts.append(last.iterations)
    kind = "linear_iterations" if any(entry["linear_iterations"] for entry in counts) else "active_set_iterations"
    return last, sum(entry[kind] for entry in counts)


def main(problem, steps, answer, how=""):
    given, again = np.load(problem), how == "again"
    last, iterations = solved(given, int(steps), "auto" if again else how or "auto")
    start = time.process_time()
    if again:
        last, iterations = solved(given, int(steps))
    contact, pole = last.contact["c"], int(given["POLE"])
    found = {
        "version": fc.__version__,
        "contact": "node-to-segment, geometry converged",
        "force": float(abs(contact.force[1])),
        "pressure": float(contact.pressure[contact.points == pole][0]),
        "stress": float(last.stress[pole, 1]),
        "iterations": iterations,
    }
    if again:
        found["cpu_s"] = time.process_time() - start
    with open(answer, "w") as out:
        json.dump(found, out)


if __name__ == "__main__":
    main(*sys.argv[1:])
