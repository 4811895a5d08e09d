"""A validation spec of code_aster (JSON, with a MED mesh) as a model of fastcontact.

`problem` translates one run of a spec: mesh, groups, materials, loads with their histories, contact. What cannot be
translated raises `Missing` with the reason; nothing is left out in silence.
"""

from __future__ import annotations

import functools
import json
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

import fastcontact as fc

Entry = dict[str, Any]
KINEMATICS = {"AXIS": "axisymmetric", "D_PLAN": "plane_strain", "C_PLAN": "plane_stress", "3D": "3d"}
AXES = {"DX": "x", "DY": "y", "DZ": "z", "FX": "x", "FY": "y", "FZ": "z"}
DISCRETE_ELEMENTS = ("DIS_T", "2D_DIS_T", "DIS_TR", "2D_DIS_TR")
PLACES = ("TOUT", "GROUP_MA", "GROUP_NO", "NOEUD", "MAILLE")
# How code_aster iterates, how it describes the same thing to itself, and what an exact method does not need.
IGNORED_CONTACT = {
    "command", "name", "zones", "FORMULATION", "FROTTEMENT", "REAC_GEOM", "NB_ITER_GEOM", "LISSAGE", "VERI_NORM",
    "ALGO_RESO_CONT", "ALGO_RESO_GEOM", "ALGO_RESO_FROT", "ITER_GEOM_MAXI", "ITER_CONT_MAXI", "ITER_CONT_MULT",
    "ITER_FROT_MAXI", "ITER_CONT_TYPE", "RESI_GEOM", "RESI_FROT", "RESI_CONT", "RESI_ABSO", "STOP_SINGULIER",
    "NB_RESOL", "LISS", "MODELE", "INFO", "STOP_INTERP", "ITER_GCP_MAXI", "PRE_COND", "COEF_RESI", "RECH_LINEAIRE",
}  # fmt: skip
IGNORED_ZONE = {
    "master", "slave", "interface", "ALGO_CONT", "ALGO_FROT", "APPARIEMENT", "NORMALE", "INTEGRATION", "ORDRE_INT",
    "CONTACT_INIT", "COEF_CONT", "COEF_FROT", "COEF_PENA_CONT", "COEF_PENA_FROT", "E_N", "E_T", "COEF_MATR_FROT",
    "COULOMB", "TOLE_PROJ_EXT", "TOLE_PROJ_INT", "TOLE_APPA", "ADAPTATION", "SEUIL_INIT", "SEUIL_AUTO", "TYPE_APPA",
    "TYPE_PROJECTION", "GRAND_GLIS", "TYPE_JACOBIEN", "VECT_MAIT", "VECT_ESCL", "MAIT_VECT_Y", "ESCL_VECT_Y",
    "PENE_MAXI", "GLIS_MAXI", "RESOLUTION", "SANS_GROUP_NO_FR", "SANS_NOEUD_FR", "GLISSIERE", "TOLE_INTERP",
}  # fmt: skip
INTEGRATION = {"AUTO": "node", "GAUSS": "gauss", "SIMPSON": "simpson"}
MESH_OPERATIONS = {"ORIE_PEAU", "DECOUPE_LAC", "DEFORME"}


class Missing(Exception):
    """What a spec asks for and fastcontact, or this translation, does not have."""


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


@dataclass
class _Support:
    nodes: np.ndarray
    component: str
    value: float | Callable[[np.ndarray], np.ndarray]
    history: tuple[tuple[float, float], ...]
    group: str = field(default="")


def specs(folder: Path) -> Iterator[tuple[Path, int]]:
    """Yield (file, number of the run) of every run in the specs of a folder."""
    for path in sorted(folder.glob("*.json")):
        for run in read(path)["runs"]:
            yield path, run["run"]


@functools.cache
def read(path: Path) -> Entry:
    """Return the spec in a file."""
    return json.loads(path.read_text(encoding="utf-8"))


def problem(path: Path, number: int) -> Problem:
    """Translate run `number` of the spec in a file.

    Raises
    ------
    Missing
        With what is not there.
    """
    spec = read(path)
    run = next(run for run in spec["runs"] if run["run"] == number)
    _check_run(spec, run)
    model_spec = run.get("model") or spec["model"]
    mesh = _mesh(path.parent, spec, model_spec)
    kinematics = _kinematics(model_spec)
    times = _times(run)
    supports = list(_supports(spec, run, mesh, times))
    mesh = mesh.with_groups(points={support.group: support.nodes for support in supports})
    model = fc.Model(mesh, kinematics)
    for entry in run.get("materials") or spec["materials"]:
        groups = None if entry["groups"] == "ALL" else entry["groups"]
        model.add_material(_material(entry), groups)
    for support in supports:
        model.prescribe(support.group, ramp=support.history, **{support.component: support.value})
    for load in run["loads"]:
        _add_loads(model, spec, run, load, times)
    for index, zone in enumerate(run["contact"]["zones"]):
        name, options = formulation(run["contact"], zone, mesh, supports)
        model.add_contact(
            f"zone {index}", secondary=zone["slave"], primary=zone["master"], formulation=name, **options
        )
    ramp = fc.Ramp(tuple(times[1:]), ((times[0], 1.0), (times[-1], 1.0)))
    return Problem(spec, run, mesh, model, ramp, _criteria(run["contact"]), times)


def _check_run(spec: Entry, run: Entry) -> None:
    behaviours = run.get("behaviour") or []
    for behaviour in behaviours if isinstance(behaviours, list) else [behaviours]:
        if behaviour.get("RELATION", "ELAS") != "ELAS":
            raise Missing(f"needs the behaviour {behaviour['RELATION']}")
    for entry in run.get("elementary_characteristics", {}).get("DISCRET", ()):
        raise Missing(f"needs springs {entry['CARA']}")
    for operation in spec.get("mesh_operations") or ():
        for keyword in operation["kw"]:
            if keyword not in MESH_OPERATIONS:
                raise Missing(f"needs the mesh operation {operation['cmd']} {keyword}")
    if not run.get("contact") or not run["contact"].get("zones"):
        raise Missing("has no contact zones")


def _times(run: Entry) -> list[float]:
    options = run.get("increment_options") or {}
    for keyword in options:
        if keyword not in ("NUME_INST_FIN", "INST_FIN", "NUME_INST_INIT", "INST_INIT", "PRECISION"):
            raise Missing(f"needs the increment option {keyword}")
    if options.get("NUME_INST_INIT") or options.get("INST_INIT"):
        raise Missing("needs a run that goes on from another one (INST_INIT)")
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
        raise Missing(f"needs the kinematics {', '.join(sorted(found))}")
    return KINEMATICS[found.pop()]


def _material(entry: Entry) -> fc.LinearElastic:
    elastic = entry.get("ELAS")
    if not elastic or not {"E", "NU"} <= set(elastic) or not all(isinstance(v, (int, float)) for v in elastic.values()):
        raise Missing(f"needs the material {sorted(set(entry) - {'groups', 'material'})} with {elastic}")
    return fc.LinearElastic(E=float(elastic["E"]), nu=float(elastic["NU"]))


# Mesh and groups


def _mesh(folder: Path, spec: Entry, model: Entry) -> fc.Mesh:
    mesh_spec = next(
        (m for m in spec["meshes"] if Path(m["snapshot_path"]).name == Path(model["mesh"] or "").name), spec["meshes"][0]
    )
    mesh = _file(folder / mesh_spec["file"])
    for entry in mesh_spec.get("derived_groups") or ():
        mesh = _with_derived(mesh, entry)
    return _modelled(mesh, model)


@functools.cache
def _file(path: Path) -> fc.Mesh:
    return fc.read_mesh(path)


def _with_derived(mesh: fc.Mesh, entry: Entry) -> fc.Mesh:
    """Return the mesh with the groups that DEFI_GROUP makes."""
    if any(key.startswith("unresolved") for key in entry):
        return mesh
    how = entry.get("how", "")
    sources = re.findall(r"'([^']+)'", how) or re.findall(r"same cells as (\S+)", how)
    if "new_node_groups" in entry:
        groups = {name: nodes_of(mesh, {"GROUP_MA": name}) for name in mesh.cell_groups}
        return mesh.with_groups(points={**groups, **mesh.point_groups})
    if "new_node_group" in entry and how.startswith("nodes of cell group"):
        nodes = nodes_of(mesh, {"GROUP_MA": sources})
        return mesh.with_groups(points=dict.fromkeys(_listed(entry["new_node_group"]), nodes))
    if "new_cell_group" in entry and how.startswith(("UNION", "same cells")):
        members = np.concatenate([mesh.cell_groups[name] for name in sources])
        return mesh.with_groups(cells=dict.fromkeys(_listed(entry["new_cell_group"]), members))
    raise Missing(f"needs the derived group {entry}")


def _modelled(mesh: fc.Mesh, model: Entry) -> fc.Mesh:
    """Return the mesh without the solid cells that no part of the model names."""
    if any(part.get("TOUT") == "OUI" for part in model["parts"]):
        return mesh
    groups = [name for part in model["parts"] for name in _listed(part.get("GROUP_MA", ()))]
    named = np.unique(np.concatenate([mesh.cell_groups[name] for name in groups]))
    solid = np.concatenate([mesh.offsets[name] + np.arange(len(block)) for name, block in mesh.solids.items()])
    if not np.isin(solid, named).all():
        raise Missing(f"needs a model of a part of the mesh ({', '.join(groups)})")
    return mesh


def nodes_of(mesh: fc.Mesh, place: Entry) -> np.ndarray:
    """Return the points that the keywords TOUT, GROUP_MA, GROUP_NO and NOEUD of an entry name."""
    found = []
    if place.get("TOUT") == "OUI":
        found.append(np.arange(mesh.n_points))
    for name in _listed(place.get("GROUP_NO", ())):
        found.append(mesh.points_of(name))
    for name in _listed(place.get("GROUP_MA", ())):
        found += [block.ravel() for block in mesh.cells_of(name).values()]
        if not mesh.cells_of(name):  # a group of vertices
            found.append(mesh.points_of(name))
    for name in _listed(place.get("NOEUD", ())):
        found.append(np.array([int(str(name).lstrip("N")) - 1]))
    if "MAILLE" in place:
        raise Missing("needs cells by their number (MAILLE)")
    return np.unique(np.concatenate(found)) if found else np.empty(0, int)


def _listed(value: Any) -> list[Any]:
    return list(value) if isinstance(value, (list, tuple)) else [value]


# Loads


def _entries(load: Entry) -> Iterator[tuple[str, int, Entry]]:
    """Yield (keyword, number, entry) of the terms of a load."""
    for keyword, entries in load["terms"].items():
        for number, entry in enumerate(_listed(entries)):
            yield keyword, number, entry


def _history(load: Entry, times: Sequence[float]) -> tuple[tuple[float, float], ...]:
    """Return pairs (instant, multiplier) at the instants of the run."""
    function = load.get("time_multiplier", 1.0)
    if not isinstance(function, dict):
        return tuple((t, float(function)) for t in times)
    if function["function"] == "constant":
        return tuple((t, float(function["value"])) for t in times)
    if function["function"] != "piecewise_linear":
        raise Missing(f"needs the time multiplier {function['function']}")
    return tuple((t, _piecewise_linear(function, t)) for t in times)


def _piecewise_linear(function: Entry, at: float) -> float:
    x, y = np.array(function["points"], float).T
    side = "extrapolation_left" if at < x[0] else "extrapolation_right" if at > x[-1] else None
    if side is None or function.get(side) == "CONSTANT":
        return float(np.interp(at, x, y))
    if function.get(side) == "LINEAIRE" and len(x) > 1:
        i = 0 if at < x[0] else len(x) - 2
        return float(y[i] + (y[i + 1] - y[i]) * (at - x[i]) / (x[i + 1] - x[i]))
    raise Missing(f"needs the function {function.get('name')} outside its table, at {at}")


def _supports(spec: Entry, run: Entry, mesh: fc.Mesh, times: Sequence[float]) -> Iterator[_Support]:
    """Yield prescribed displacements; within a load a later entry overrides an earlier one, as in code_aster."""
    for load_number, load in enumerate(run["loads"]):
        taken: dict[str, np.ndarray] = {}
        entries = [e for e in _entries(load) if e[0] in ("DDL_IMPO", "MECA_IMPO", "FACE_IMPO", "ARETE_IMPO")]
        for keyword, number, entry in reversed(entries):
            for key in entry:
                if key not in (*PLACES, "DX", "DY", "DZ"):
                    raise Missing(f"needs {key} of {keyword}")
            for key in ("DX", "DY", "DZ"):
                if key not in entry:
                    continue
                nodes = np.setdiff1d(nodes_of(mesh, entry), taken.get(key, np.empty(0, int)))
                taken[key] = np.union1d(nodes, taken.get(key, np.empty(0, int)))
                value = _value(spec, load, keyword, number, entry[key], key)
                name = f"{load_number}:{keyword}:{number}:{key}"
                if len(nodes):
                    yield _Support(nodes, AXES[key], value, _history(load, times), name)


def _value(
    spec: Entry, load: Entry, keyword: str, number: int, value: Any, key: str
) -> float | Callable[[np.ndarray], np.ndarray]:
    """Return a number, or the function of position that the spec tabulates at nodes."""
    if not isinstance(value, dict):
        return float(value)
    if value.get("function") == "constant":
        return float(value["value"])
    for table in spec.get("tabulated_functions") or ():
        if (table.get("charge"), table.get("key"), table.get("entry")) == (load["charge"], keyword, number):
            return _at_nodes(table, key)
    raise Missing(f"needs the function {value.get('name')} of {keyword}")


def _at_nodes(table: Entry, key: str) -> Callable[[np.ndarray], np.ndarray]:
    """Return the function that is known at the nodes of a table and nowhere else."""
    tree, values = cKDTree(np.array(table["coords"], float)), np.array(table[key], float)
    size = float(np.ptp(np.array(table["coords"]), axis=0).max())

    def function(positions: np.ndarray) -> np.ndarray:
        distance, nearest = tree.query(positions)
        if distance.max(initial=0.0) > 1e-8 * size:
            raise Missing(f"needs the tabulated function {key} of {table['key']} between nodes")
        return values[nearest]

    return function


def _add_loads(model: fc.Model, spec: Entry, run: Entry, load: Entry, times: Sequence[float]) -> None:
    for keyword, number, entry in _entries(load):
        history = _history(load, times)
        if keyword in ("DDL_IMPO", "MECA_IMPO", "FACE_IMPO", "ARETE_IMPO"):
            continue
        if keyword == "PRES_REP":
            pressure = _value(spec, load, keyword, number, entry["PRES"], "PRES")
            _no_more_than(keyword, entry, ("PRES",))
            for group in _listed(entry["GROUP_MA"]):
                model.add_pressure(group, pressure, ramp=history)
        elif keyword in ("FORCE_CONTOUR", "FORCE_FACE"):
            for group in _listed(entry["GROUP_MA"]):
                model.add_traction(group, ramp=history, **_forces(spec, load, keyword, number, entry))
        elif keyword == "FORCE_NODALE":
            # Forces are per radian there, and over the full circle here.
            circle = 2 * np.pi if model.kinematics == "axisymmetric" else 1.0
            forces = {axis: circle * f for axis, f in _forces(spec, load, keyword, number, entry).items()}
            for group in _listed(entry["GROUP_NO"]):
                model.add_force(group, distribute=False, ramp=history, **forces)
        elif keyword == "FORCE_INTERNE":
            groups = None if entry.get("TOUT") == "OUI" else _listed(entry["GROUP_MA"])
            model.add_body_force(groups, ramp=history, **_forces(spec, load, keyword, number, entry))
        elif keyword == "LIAISON_UNIF":
            for group in _listed(entry.get("GROUP_NO", entry.get("GROUP_MA"))):
                model.couple(group, "".join(AXES[name] for name in _listed(entry["DDL"])))
        elif keyword == "LIAISON_DDL":
            places = [model.mesh.point(name) for name in _listed(entry["GROUP_NO"])]
            axes = [AXES[name] for name in _listed(entry["DDL"])]
            terms = zip(places, axes, map(float, _listed(entry["COEF_MULT"])), strict=True)
            model.relate(terms, _value(spec, load, keyword, number, entry["COEF_IMPO"], "COEF_IMPO"), ramp=history)
        else:
            raise Missing(f"needs {keyword}")


def _forces(spec: Entry, load: Entry, keyword: str, number: int, entry: Entry) -> Entry:
    _no_more_than(keyword, entry, ("FX", "FY", "FZ"))
    return {
        AXES[key]: _value(spec, load, keyword, number, entry[key], key) for key in ("FX", "FY", "FZ") if key in entry
    }


def _no_more_than(keyword: str, entry: Entry, known: Sequence[str]) -> None:
    for key in entry:
        if key not in (*known, *PLACES):
            raise Missing(f"needs {key} of {keyword}")


# Contact


def formulation(
    contact: Entry, zone: Entry, mesh: fc.Mesh, supports: Sequence[_Support]
) -> tuple[str, dict[str, Any]]:
    """Return the formulation that stands for a zone of DEFI_CONTACT, and its options.

    The discrete method is node-to-segment. The continuous one is mortar where code_aster integrates over cut facets,
    where facets are quadratic, and where meshes do not match; elsewhere, and where the slave nodes are the integration
    points (a value on a coarse mesh depends on that), it is the continuous one. A penalty, which only approximates the
    exact method, is replaced by it.
    """
    _check_zone(contact, zone, mesh, supports)
    sides = [name for side in ("slave", "master") for name in mesh.cells_of(zone[side], dim=mesh.dim - 1)]
    quadratic = any(name not in ("line2", "tri3", "quad4") for name in sides)
    rule = INTEGRATION.get(zone.get("INTEGRATION", "AUTO"), "gauss")
    plain = not quadratic and zone.get("APPARIEMENT") != "MORTAR" and (rule == "node" or zone["interface"]["matching"])
    options: dict[str, Any] = {}
    method = contact.get("FORMULATION", "DISCRETE")
    if method == "DISCRETE":
        name = "node_to_segment"
    elif method != "CONTINUE":
        raise Missing(f"needs the contact FORMULATION {method}")
    elif plain:
        name, options["integration"] = "continuous", rule
    else:
        name = "mortar"
    if contact.get("LISSAGE") == "OUI":
        options["normals"] = "averaged"
    if "TOLE_PROJ_EXT" in zone and name != "mortar":
        options["projection_tolerance"] = float(zone["TOLE_PROJ_EXT"])
    if contact.get("FROTTEMENT", "SANS") == "COULOMB" and zone.get("COULOMB"):
        options["friction"] = float(zone["COULOMB"])
    return name, options


def _check_zone(contact: Entry, zone: Entry, mesh: fc.Mesh, supports: Sequence[_Support]) -> None:
    for key in contact:
        if key not in IGNORED_CONTACT:
            raise Missing(f"needs {key} of DEFI_CONTACT")
    if contact.get("FROTTEMENT", "SANS") not in ("SANS", "COULOMB"):
        raise Missing(f"needs the friction law {contact['FROTTEMENT']}")
    for key in ("DIST_ESCL", "DIST_MAIT", "DIST_POUTRE", "DIST_COQUE"):
        if key in zone and zone[key] != "NON":
            raise Missing(f"needs gap offsets {key}")
    for key in ("SANS_GROUP_NO", "SANS_NOEUD", "SANS_GROUP_MA", "SANS_MAILLE"):
        if key in zone:
            raise Missing(f"needs nodes excluded from contact ({key})")
    if zone.get("GLISSIERE") == "OUI":
        raise Missing("needs bilateral contact (GLISSIERE)")
    if zone.get("RESOLUTION", "OUI") != "OUI":
        raise Missing("needs contact that is only checked (RESOLUTION='NON')")
    for key in zone:
        if key not in IGNORED_ZONE | {"DIST_ESCL", "DIST_MAIT", "DIST_POUTRE", "DIST_COQUE"}:
            raise Missing(f"needs {key} of a contact zone")
    _check_frictionless_nodes(zone, mesh, supports)
    solid = np.unique(np.concatenate([block.ravel() for block in mesh.solids.values()]))
    for side in ("slave", "master"):
        if not np.isin(nodes_of(mesh, {"GROUP_MA": zone[side]}), solid).all():
            raise Missing(f"needs a rigid meshed surface without solid ({zone[side]})")


def _check_frictionless_nodes(zone: Entry, mesh: fc.Mesh, supports: Sequence[_Support]) -> None:
    """Accept nodes without friction where a support already holds them, as on an axis: no force is left to friction."""
    place = {"GROUP_NO": zone.get("SANS_GROUP_NO_FR", ()), "NOEUD": zone.get("SANS_NOEUD_FR", ())}
    nodes = nodes_of(mesh, {key: value for key, value in place.items() if value})
    held = mesh.dim == 2 and all(any(node in support.nodes for support in supports) for node in nodes)
    if len(nodes) and not held:
        raise Missing("needs nodes without friction (SANS_GROUP_NO_FR)")


def _criteria(contact: Entry) -> fc.Criteria:
    """Return how often to pair: fixed numbers where code_aster's user asks for one, otherwise until it stands still."""
    updates = str(contact.get("REAC_GEOM", "AUTOMATIQUE")).split()[0]
    if updates == "SANS":
        return fc.Criteria(geometry_updates=0)
    if updates == "CONTROLE":
        return fc.Criteria(geometry_updates=int(contact.get("NB_ITER_GEOM", 2)))
    return fc.Criteria()
