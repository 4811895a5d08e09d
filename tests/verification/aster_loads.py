"""Loads of code_aster's specs: prescribed displacements and forces, with their histories."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from aster_mesh import Entry, MissingError, listed, nodes_of
from scipy.spatial import cKDTree

import fastcontact as fc

AXES = {"DX": "x", "DY": "y", "DZ": "z", "FX": "x", "FY": "y", "FZ": "z"}
PLACES = ("TOUT", "GROUP_MA", "GROUP_NO", "NOEUD", "MAILLE")
SUPPORTS = ("DDL_IMPO", "MECA_IMPO", "FACE_IMPO", "ARETE_IMPO")


@dataclass
class Support:
    nodes: np.ndarray
    component: str
    value: float | Callable[[np.ndarray], np.ndarray]
    history: tuple[tuple[float, float], ...]
    group: str


def supports_of(spec: Entry, run: Entry, mesh: fc.Mesh, times: Sequence[float]) -> Iterator[Support]:
    """Yield prescribed displacements; within a load a later entry overrides an earlier one, as in code_aster."""
    for load_number, load in enumerate(run["loads"]):
        taken: dict[str, np.ndarray] = {}
        entries = [e for e in _entries(load) if e[0] in SUPPORTS]
        for keyword, number, entry in reversed(entries):
            for key in entry:
                if key not in (*PLACES, "DX", "DY", "DZ"):
                    raise MissingError(f"needs {key} of {keyword}")
            for key in ("DX", "DY", "DZ"):
                if key not in entry:
                    continue
                nodes = np.setdiff1d(nodes_of(mesh, entry), taken.get(key, np.empty(0, int)))
                taken[key] = np.union1d(nodes, taken.get(key, np.empty(0, int)))
                value = _value(spec, load, keyword, number, entry[key], key)
                name = f"{load_number}:{keyword}:{number}:{key}"
                if len(nodes):
                    yield Support(nodes, AXES[key], value, _history(load, times), name)


def add_loads(model: fc.Model, spec: Entry, run: Entry, load: Entry, times: Sequence[float]) -> None:
    for keyword, number, entry in _entries(load):
        history = _history(load, times)
        if keyword in SUPPORTS:
            continue
        if keyword == "PRES_REP":
            pressure = _value(spec, load, keyword, number, entry["PRES"], "PRES")
            _no_more_than(keyword, entry, ("PRES",))
            for group in listed(entry["GROUP_MA"]):
                model.add_pressure(group, pressure, ramp=history)
        elif keyword in ("FORCE_CONTOUR", "FORCE_FACE"):
            for group in listed(entry["GROUP_MA"]):
                model.add_traction(group, ramp=history, **_forces(spec, load, keyword, number, entry))
        elif keyword == "FORCE_NODALE":
            # Forces are per radian there, and over the full circle here.
            circle = 2 * np.pi if model.kinematics == "axisymmetric" else 1.0
            forces = {axis: circle * f for axis, f in _forces(spec, load, keyword, number, entry).items()}
            for group in listed(entry["GROUP_NO"]):
                model.add_force(group, distribute=False, ramp=history, **forces)
        elif keyword == "FORCE_INTERNE":
            groups = None if entry.get("TOUT") == "OUI" else listed(entry["GROUP_MA"])
            model.add_body_force(groups, ramp=history, **_forces(spec, load, keyword, number, entry))
        elif keyword == "LIAISON_UNIF":
            for group in listed(entry.get("GROUP_NO", entry.get("GROUP_MA"))):
                model.couple(group, "".join(AXES[name] for name in listed(entry["DDL"])))
        elif keyword == "LIAISON_DDL":
            places = [model.mesh.point(name) for name in listed(entry["GROUP_NO"])]
            axes = [AXES[name] for name in listed(entry["DDL"])]
            terms = zip(places, axes, map(float, listed(entry["COEF_MULT"])), strict=True)
            model.relate(terms, _value(spec, load, keyword, number, entry["COEF_IMPO"], "COEF_IMPO"), ramp=history)
        else:
            raise MissingError(f"needs {keyword}")


def _forces(spec: Entry, load: Entry, keyword: str, number: int, entry: Entry) -> Entry:
    _no_more_than(keyword, entry, ("FX", "FY", "FZ"))
    return {
        AXES[key]: _value(spec, load, keyword, number, entry[key], key) for key in ("FX", "FY", "FZ") if key in entry
    }


def _no_more_than(keyword: str, entry: Entry, known: Sequence[str]) -> None:
    for key in entry:
        if key not in (*known, *PLACES):
            raise MissingError(f"needs {key} of {keyword}")


def _entries(load: Entry) -> Iterator[tuple[str, int, Entry]]:
    """Yield (keyword, number, entry) of the terms of a load."""
    for keyword, entries in load["terms"].items():
        for number, entry in enumerate(listed(entries)):
            yield keyword, number, entry


def _history(load: Entry, times: Sequence[float]) -> tuple[tuple[float, float], ...]:
    """Return pairs (instant, multiplier) at the instants of the run."""
    function = load.get("time_multiplier", 1.0)
    if not isinstance(function, dict):
        return tuple((t, float(function)) for t in times)
    if function["function"] == "constant":
        return tuple((t, float(function["value"])) for t in times)
    if function["function"] != "piecewise_linear":
        raise MissingError(f"needs the time multiplier {function['function']}")
    return tuple((t, _piecewise_linear(function, t)) for t in times)


def _piecewise_linear(function: Entry, at: float) -> float:
    x, y = np.array(function["points"], float).T
    side = "extrapolation_left" if at < x[0] else "extrapolation_right" if at > x[-1] else None
    if side is None or function.get(side) == "CONSTANT":
        return float(np.interp(at, x, y))
    if function.get(side) == "LINEAIRE" and len(x) > 1:
        i = 0 if at < x[0] else len(x) - 2
        return float(y[i] + (y[i + 1] - y[i]) * (at - x[i]) / (x[i + 1] - x[i]))
    raise MissingError(f"needs the function {function.get('name')} outside its table, at {at}")


def _value(
    spec: Entry, load: Entry, keyword: str, number: int, value: Any, key: str
) -> float | Callable[[np.ndarray], np.ndarray]:
    """Return a number, or the function of position that the spec tabulates at nodes."""
    if not isinstance(value, dict) or value.get("function") == "constant":
        return constant(value, f"{key} of {keyword}")
    for table in spec.get("tabulated_functions") or ():
        if (table.get("charge"), table.get("key"), table.get("entry")) == (load["charge"], keyword, number):
            return _at_nodes(table, key)
    raise MissingError(f"needs the function {value.get('name')} of {keyword}")


def constant(value: Any, what: str) -> float:
    """Return a number, also where it is written as a constant function."""
    if isinstance(value, dict):
        if value.get("function") != "constant":
            raise MissingError(f"needs a function as {what}")
        value = value["value"]
    return float(value)


def _at_nodes(table: Entry, key: str) -> Callable[[np.ndarray], np.ndarray]:
    """Return the function that is known at the nodes of a table and nowhere else."""
    tree, values = cKDTree(np.array(table["coords"], float)), np.array(table[key], float)
    size = float(np.ptp(np.array(table["coords"]), axis=0).max())

    def function(positions: np.ndarray) -> np.ndarray:
        distance, nearest = tree.query(positions)
        if distance.max(initial=0.0) > 1e-8 * size:
            raise MissingError(f"needs the tabulated function {key} of {table['key']} between nodes")
        return values[nearest]

    return function
