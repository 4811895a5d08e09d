"""Loads of code_aster's specs: prescribed displacements and forces, with their histories."""

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
Value = float | Callable[[np.ndarray], np.ndarray]
History = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Support:
    """A prescribed component of the points of a group that is to be made."""

    group: str
    nodes: np.ndarray
    component: str
    value: Value
    history: History


@dataclass(frozen=True)
class _Term:
    """An entry of a keyword of a load; `number` counts the entries of that keyword."""

    load: Entry
    keyword: str
    number: int
    entry: Entry
    tables: Sequence[Entry]

    def value(self, key: str) -> Value:
        """Return a number, or the function of position that the spec tabulates at nodes."""
        value = self.entry[key]
        if not isinstance(value, dict) or value.get("function") == "constant":
            return constant(value, f"{key} of {self.keyword}")
        for table in self.tables:
            if (table.get("charge"), table.get("key"), table.get("entry")) == self._place:
                return _at_nodes(table, key)
        raise MissingError(f"needs the function {value.get('name')} of {self.keyword}")

    @property
    def _place(self) -> tuple[str, str, int]:
        return self.load["charge"], self.keyword, self.number

    def values(self, *known: str) -> dict[str, Value]:
        """Return the values of those `known` keys that are there, by axis; refuse others."""
        for key in self.entry:
            if key not in (*known, *PLACES):
                raise MissingError(f"needs {key} of {self.keyword}")
        return {AXES[key]: self.value(key) for key in known if key in self.entry}

    def groups(self, *kinds: str) -> list[str]:
        """Return the groups named, of the kinds that make sense here."""
        if not set(kinds) & set(self.entry):
            raise MissingError(f"needs {self.keyword} without {' or '.join(kinds)}")
        return [group for kind in kinds for group in listed(self.entry.get(kind, ()))]


def supports_of(spec: Entry, run: Entry, mesh: fc.Mesh, times: Sequence[float]) -> Iterator[Support]:
    """Yield prescribed displacements; within a load a later entry overrides an earlier one, as in code_aster."""
    for index, load in enumerate(run["loads"]):
        taken: dict[str, np.ndarray] = {}
        for term in reversed([term for term in _terms(spec, load) if term.keyword in SUPPORTS]):
            for axis, value in term.values("DX", "DY", "DZ").items():
                before = taken.get(axis, np.empty(0, int))
                nodes = np.setdiff1d(nodes_of(mesh, term.entry), before)
                taken[axis] = np.union1d(nodes, before)
                if len(nodes):
                    name = f"load {index}, {term.keyword} {term.number}, {axis}"
                    yield Support(name, nodes, axis, value, _history(load, times))


def add_loads(model: fc.Model, spec: Entry, load: Entry, times: Sequence[float]) -> None:
    """Add the forces and linear relations of a load."""
    for term in _terms(spec, load):
        if term.keyword not in SUPPORTS:
            if term.keyword not in LOADS:
                raise MissingError(f"needs {term.keyword}")
            LOADS[term.keyword](model, term, _history(load, times))


def _pressure(model: fc.Model, term: _Term, history: History) -> None:
    if set(term.entry) - {"PRES", *PLACES}:
        raise MissingError(f"needs {sorted(set(term.entry) - {'PRES', *PLACES})} of PRES_REP")
    for group in term.groups("GROUP_MA"):
        model.add_pressure(group, term.value("PRES"), ramp=history)


def _traction(model: fc.Model, term: _Term, history: History) -> None:
    for group in term.groups("GROUP_MA"):
        model.add_traction(group, ramp=history, **term.values("FX", "FY", "FZ"))


def _nodal_force(model: fc.Model, term: _Term, history: History) -> None:
    # Forces are per radian there, and over the full circle here.
    circle = 2 * np.pi if model.kinematics == "axisymmetric" else 1.0
    forces = {axis: circle * force for axis, force in term.values("FX", "FY", "FZ").items()}
    for group in term.groups("GROUP_NO"):
        model.add_force(group, distribute=False, ramp=history, **forces)


def _body_force(model: fc.Model, term: _Term, history: History) -> None:
    groups = None if term.entry.get("TOUT") == "OUI" else term.groups("GROUP_MA")
    model.add_body_force(groups, ramp=history, **term.values("FX", "FY", "FZ"))


def _couple(model: fc.Model, term: _Term, history: History) -> None:
    for group in term.groups("GROUP_NO", "GROUP_MA"):
        model.couple(group, "".join(AXES[name] for name in listed(term.entry["DDL"])))


def _relate(model: fc.Model, term: _Term, history: History) -> None:
    points = [model.mesh.point(group) for group in term.groups("GROUP_NO")]
    axes = [AXES[name] for name in listed(term.entry["DDL"])]
    coefficients = map(float, listed(term.entry["COEF_MULT"]))
    model.relate(zip(points, axes, coefficients, strict=True), term.value("COEF_IMPO"), ramp=history)


LOADS: dict[str, Callable[[fc.Model, _Term, History], None]] = {
    "PRES_REP": _pressure,
    "FORCE_CONTOUR": _traction,
    "FORCE_FACE": _traction,
    "FORCE_NODALE": _nodal_force,
    "FORCE_INTERNE": _body_force,
    "LIAISON_UNIF": _couple,
    "LIAISON_DDL": _relate,
}


def _terms(spec: Entry, load: Entry) -> Iterator[_Term]:
    tables = spec.get("tabulated_functions") or ()
    for keyword, entries in load["terms"].items():
        for number, entry in enumerate(listed(entries)):
            yield _Term(load, keyword, number, entry, tables)


def _history(load: Entry, times: Sequence[float]) -> History:
    """Return pairs (instant, multiplier) at the instants of the run; code_aster does not evaluate the first one."""
    function = load.get("time_multiplier", 1.0)
    if isinstance(function, dict) and function.get("function") == "piecewise_linear":
        return ((times[0], 0.0), *((t, _piecewise_linear(function, t)) for t in times[1:]))
    multiplier = constant(function, "time multiplier")
    return tuple((t, multiplier) for t in times)


def _piecewise_linear(function: Entry, at: float) -> float:
    x, y = np.array(function["points"], float).T
    side = "extrapolation_left" if at < x[0] else "extrapolation_right" if at > x[-1] else None
    if side is None or function.get(side) == "CONSTANT":
        return float(np.interp(at, x, y))
    if function.get(side) == "LINEAIRE" and len(x) > 1:
        i = 0 if at < x[0] else len(x) - 2
        return float(y[i] + (y[i + 1] - y[i]) * (at - x[i]) / (x[i + 1] - x[i]))
    raise MissingError(f"needs the function {function.get('name')} outside its table, at {at}")


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
