"""A validation spec of code_aster (JSON, with a MED mesh) as a model of fastcontact.

`problem` translates one run of a spec: mesh, groups, materials, loads with their histories, springs, contact. What cannot be
translated raises `MissingError` with the reason; nothing is left out in silence.
"""

import functools
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from aster_contact import add_zone, criteria_of, missing_in_contact
from aster_loads import add_loads, supports_of
from aster_mesh import Entry, MissingError, listed, mesh_of, nodes_of
from aster_springs import add_springs, missing_in_springs

import fastcontact as fc

KINEMATICS = {"AXIS": "axisymmetric", "D_PLAN": "plane_strain", "C_PLAN": "plane_stress", "3D": "3d"}
DISCRETE_ELEMENTS = ("DIS_T", "2D_DIS_T", "DIS_TR", "2D_DIS_TR")
KNOWN_IN_RUN = {
    "run", "result", "solver_command", "loads", "contact", "behaviour", "times", "increment_options", "newton",
    "convergence", "elementary_characteristics", "model", "materials",
}  # fmt: skip
# Two drivers of the same static problem.
COMMANDS = ("STAT_NON_LINE", "MECA_NON_LINE")
# Linear kinematics; the large displacements of the second one differ by what the test says.
DEFORMATIONS = ("PETIT", "GREEN_LAGRANGE")
KNOWN_IN_BEHAVIOUR = {"RELATION", "DEFORMATION", "TOUT"}
# How Newton's method goes, which an exact solution does not depend on.
KNOWN_IN_NEWTON = {"MATRICE", "REAC_ITER", "REAC_INCR", "PREDICTION", "EVOL_NOLI"}
MESH_OPERATIONS = {"ORIE_PEAU", "DECOUPE_LAC", "DEFORME"}


@dataclass(frozen=True, eq=False)
class Problem:
    """One run of a spec, ready to solve.

    Attributes
    ----------
    spec, run : dict
    mesh : Mesh
        With the groups that code_aster's command file defines.
    model : Model
    ramp : Ramp
    criteria : Criteria
    times : list of float
        Instants from the initial state on: code_aster's NUME_ORDRE counts them.
    """

    spec: Entry
    run: Entry
    mesh: fc.Mesh
    model: fc.Model
    ramp: fc.Ramp
    criteria: fc.Criteria
    times: list[float]


def specs(folder: Path) -> Iterator[tuple[Path, int]]:
    """Yield (file, number of the run) of every run in the specs of a folder."""
    for path in sorted(folder.glob("*.json")):
        for run in read(path).get("runs", ()):
            yield path, run["run"]


@functools.cache
def read(path: Path) -> Entry:
    """Return the spec in a file."""
    return json.loads(path.read_text(encoding="utf-8"))


def problem(path: Path, number: int) -> Problem:
    """Translate run `number` of the spec in a file.

    Raises
    ------
    MissingError
        With what is not there.
    """
    spec = read(path)
    run = next(run for run in spec["runs"] if run["run"] == number)
    missing = [*_missing_in_run(spec, run), *missing_in_contact(run.get("contact") or {})]
    if missing:
        raise MissingError("needs " + "; ".join(dict.fromkeys(missing)))
    model_spec = run.get("model") or spec["model"]
    mesh = mesh_of(path.parent, spec, model_spec)
    kinematics = _kinematics(model_spec)
    times = _times(run)
    supports = list(supports_of(spec, run, mesh, times))
    mesh = mesh.with_groups(points={support.group: support.nodes for support in supports})
    model = fc.Model(mesh, kinematics)
    for entry in run.get("materials") or spec["materials"]:
        groups = None if entry["groups"] == "ALL" else entry["groups"]
        model.add_material(_material(entry), groups)
    solid = np.unique(np.concatenate([block.ravel() for block in mesh.solids.values()]))
    masters = [nodes_of(mesh, {"GROUP_MA": zone["master"]}) for zone in run["contact"]["zones"]]
    obstacles = np.setdiff1d(np.concatenate(masters), solid)
    for support in supports:
        if np.isin(support.nodes, obstacles).all():  # `add_zone` turns these into half-spaces that stand still
            continue
        model.prescribe(support.group, ramp=support.history, **{support.component: support.value})
    for load in run["loads"]:
        add_loads(model, spec, load, times)
    add_springs(model, run)
    for index, zone in enumerate(run["contact"]["zones"]):
        add_zone(model, f"zone {index}", run["contact"], zone, supports)
    ramp = fc.Ramp(tuple(times[1:]), ((times[0], 1.0), (times[-1], 1.0)))
    return Problem(spec, run, mesh, model, ramp, criteria_of(run["contact"]), times)


def solve(problem: Problem) -> list[fc.StepResult]:
    """Return the states at all instants of a run."""
    return fc.solve(problem.model, problem.ramp, criteria=problem.criteria)


def _missing_in_run(spec: Entry, run: Entry) -> Iterator[str]:
    if run["solver_command"] not in COMMANDS:
        yield run["solver_command"]
    yield from (f"{key} of the run" for key, value in run.items() if key not in KNOWN_IN_RUN and value)
    for behaviour in listed(run.get("behaviour") or []):
        if behaviour.get("RELATION", "ELAS") != "ELAS":
            yield f"the behaviour {behaviour['RELATION']}"
        if behaviour.get("DEFORMATION", "PETIT") not in DEFORMATIONS:
            yield f"the kinematics DEFORMATION = {behaviour['DEFORMATION']}"
        yield from (f"{key} of the behaviour" for key in behaviour if key not in KNOWN_IN_BEHAVIOUR)
    yield from (f"{key} of NEWTON" for key in run.get("newton") or {} if key not in KNOWN_IN_NEWTON)
    yield from missing_in_springs(run)
    for operation in spec.get("mesh_operations") or ():
        for keyword in operation["kw"]:
            if keyword not in MESH_OPERATIONS:
                yield f"the mesh operation {operation['cmd']} {keyword}"


def _times(run: Entry) -> list[float]:
    options = run.get("increment_options") or {}
    for keyword in options:
        if keyword not in ("NUME_INST_FIN", "INST_FIN", "NUME_INST_INIT", "INST_INIT", "PRECISION"):
            raise MissingError(f"needs the increment option {keyword}")
    if options.get("NUME_INST_INIT") or options.get("INST_INIT"):
        raise MissingError("needs a run that goes on from another one (INST_INIT)")
    times = [float(t) for t in run["times"]]
    if "NUME_INST_FIN" in options:
        times = times[: options["NUME_INST_FIN"] + 1]
    if "INST_FIN" in options:
        times = [t for t in times if t <= options["INST_FIN"] + 1e-12]
    return times


def _kinematics(model: Entry) -> str:
    found = set()
    for part in model["parts"]:
        names = part["MODELISATION"]
        found.update([names] if isinstance(names, str) else names)
    found -= set(DISCRETE_ELEMENTS)
    if len(found) != 1 or not found <= set(KINEMATICS):
        raise MissingError(f"needs the kinematics {', '.join(sorted(found))}")
    return KINEMATICS[found.pop()]


def _material(entry: Entry) -> fc.LinearElastic:
    elastic = entry.get("ELAS")
    if not elastic or not {"E", "NU"} <= set(elastic) or not all(isinstance(v, (int, float)) for v in elastic.values()):
        raise MissingError(f"needs the material {sorted(set(entry) - {'groups', 'material'})} with {elastic}")
    return fc.LinearElastic(E=float(elastic["E"]), nu=float(elastic["NU"]))
