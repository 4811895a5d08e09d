"""Case files: a contact problem as TOML, checked whole before anything runs. They hold data, no code."""

from __future__ import annotations

import contextlib
import inspect
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from reprlib import repr
from typing import Any

from fastcontact import analytic
from fastcontact.analysis.criteria import Criteria
from fastcontact.cases.checks import KEYS, Check, read_check
from fastcontact.cases.shipped import case_path
from fastcontact.contact.obstacles import SHAPES, MeshedSurface, Obstacle
from fastcontact.elasticity.materials import LinearElastic
from fastcontact.errors import CaseError, FastcontactError, unknown
from fastcontact.mesh import generate
from fastcontact.mesh.files.mesh_files import read_mesh
from fastcontact.mesh.mesh import Mesh
from fastcontact.model.model import Model
from fastcontact.model.ramp import Ramp, Table, linear_ramp

_NUMBER = (int, float)
_UNITS = {"length": str, "force": str, "pressure": str}
_RAMP = {"steps": int, "end": _NUMBER, "instants": list, "table": list}
_SOLVE = {
    "linear_solver": str,
    "linear_tolerance": _NUMBER,
    "relative": _NUMBER,
    "absolute": _NUMBER,
    "geometry_updates": int,
    "geometry": _NUMBER,
    "keep_pairing": bool,
    "max_geometry_updates": int,
    "max_active_set_iterations": int,
    "max_halvings": int,
}
_AXES = {"x": _NUMBER, "y": _NUMBER, "z": _NUMBER}
# Tables of loads, relations and springs: their keys, the method of the model that takes them, and the keys they need.
_LOADS: dict[str, tuple[dict[str, Any], Callable[..., None], tuple[str, ...]]] = {
    "pressure": ({"group": str, "value": _NUMBER, "ramp": list}, Model.add_pressure, ("group", "value")),
    "traction": ({"group": str, **_AXES, "ramp": list}, Model.add_traction, ("group",)),
    "body_force": ({"groups": (list, str), **_AXES, "ramp": list}, Model.add_body_force, ()),
    "force": ({"group": str, **_AXES, "distribute": bool, "ramp": list}, Model.add_force, ("group",)),
    "couple": ({"group": str, "component": str}, Model.couple, ("group", "component")),
    "relation": ({"terms": list, "value": _NUMBER, "ramp": list}, Model.relate, ("terms",)),
    "spring": (
        {"group": (str, int), "to": (str, int), **_AXES, "axial": _NUMBER},
        Model.add_spring,
        ("group",),
    ),
}
# A rigid surface: the facets of a group of a file, or of the mesh of the model.
_SURFACE = {"file": str, "group": str, "flip": bool, "crease": _NUMBER}
# What a mesh-convergence study or a sweep of this case needs to know; `fastcontact.convergence` reads it.
STUDY = {
    "generator": str,
    "triangles": dict,
    "quadrangles": dict,
    "halve": list,
    "double": list,
    "curves": list,
    "load_steps": int,
    "combinations": list,
    "options": dict,
    "contact": str,
    "quantities": list,
    "parameters": dict,
}
TOP = {
    "title": str,
    "kinematics": str,
    "units": dict,
    "mesh": dict,
    "material": list,
    "support": list,
    **dict.fromkeys(_LOADS, list),
    "contact": dict,
    "obstacle": dict,
    "ramp": dict,
    "solve": dict,
    "probes": dict,
    "theory": dict,
    "check": list,
    "study": dict,
}


@dataclass(frozen=True, eq=False)
class Case:
    """A case file, checked and ready to run.

    Attributes
    ----------
    name, title, text : str
        File name without suffix, its title, its text.
    mesh : Mesh
    model : Model
    ramp : Ramp
    criteria : Criteria
    linear_solver : str
    linear_tolerance : float
    probes : dict of str to int
        Point number by probe name.
    theories : dict of str to dict
        By contact pair: ``"theory"`` and, where given, ``"mesh_converged"``, objects of `fastcontact.analytic`; and
        ``"share"``, the part of the theory's contact that the model holds: 0.25 for a quarter of it.
    checks : list of Check
    units : dict of str to str
        Names of the units of length, force and pressure, for labels.
    approach : dict of str to float
        Approach of the theory by contact pair, where it was given [length].
    """

    name: str
    title: str
    text: str
    mesh: Mesh
    model: Model
    ramp: Ramp
    criteria: Criteria
    linear_solver: str
    linear_tolerance: float
    probes: dict[str, int]
    theories: dict[str, dict[str, Any]] = field(default_factory=dict)
    checks: list[Check] = field(default_factory=list)
    units: dict[str, str] = field(default_factory=dict)
    approach: dict[str, float] = field(default_factory=dict)


def read_case(path: str | Path) -> Case:
    """Read a case file, or a ready case by its name, and build its model.

    Raises
    ------
    CaseError
        If the file is missing, no TOML, or has an unknown key or a wrong value; the message names file and key.
    FastcontactError
        If its mesh or model is wrong.
    """
    path = case_path(path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise CaseError(f"cannot read the case file '{path}': {_unreadable(path, error)}") from error
    try:
        data = tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # tomllib's own error, and those of numbers too long, tables too deep
        raise CaseError(f"the case file '{path}' is not valid TOML: {error}") from error
    try:
        return build_case(data, name=path.stem, folder=path.parent, text=text)
    except CaseError as error:
        raise CaseError(f"{path}: {error}") from error
    except (ArithmeticError, AttributeError, LookupError, MemoryError, RecursionError, TypeError, ValueError) as error:
        # A value that passed all checks by key; what Python says of it is the best there is to tell.
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise CaseError(f"{path}: a value is of the wrong kind or size ({reason}): see the ready cases") from error


def _unreadable(path: Path, error: Exception) -> str:
    """Return why a case file cannot be read, and what to do."""
    if path.is_dir():
        return "it is a folder; name a file in it"
    if not path.exists():
        return "it does not exist"
    if isinstance(error, OSError):
        return error.strerror or type(error).__name__
    return "it is no text in UTF-8; name a TOML file"


def build_case(
    data: dict[str, Any], *, name: str, folder: str | Path = ".", text: str = "", mesh: Mesh | None = None
) -> Case:
    """Build a case from the parsed data of a case file.

    Parameters
    ----------
    data : dict
        As `tomllib` returns it.
    name : str
        Name of the case.
    folder : path-like
        Where the mesh file is looked for.
    text : str
        The case file, kept in result files.
    mesh : Mesh, optional
        Used instead of the one that ``[mesh]`` names.

    Raises
    ------
    CaseError
        If a key is unknown or a value wrong.
    FastcontactError
        If the mesh or the model is wrong.
    """
    _check_keys("", data, TOP)
    _check_keys("study", data.get("study", {}), STUDY)
    for key in ("kinematics", "mesh", "material"):
        if key not in data:
            raise CaseError(f"the key '{key}' is missing")
    units = data.get("units", {})
    _check_keys("units", units, _UNITS)
    solve = data.get("solve", {})
    _check_keys("solve", solve, _SOLVE)
    ramp = _ramp(data.get("ramp", {}))
    criteria = Criteria(**{k: v for k, v in solve.items() if not k.startswith("linear_")})
    theories, approach = _theories(data.get("theory", {}), {**data.get("contact", {}), **data.get("obstacle", {})})
    if mesh is None:
        mesh = _mesh(Path(folder), data["mesh"])
    model = _model(mesh, data, text, Path(folder))
    probes = _probes(mesh, data.get("probes", {}))
    pairs = {**data.get("contact", {}), **data.get("obstacle", {})}
    checks = []
    for i, entry in enumerate(_tables("check", data.get("check", []))):
        _check_keys(f"check[{i}]", entry, KEYS)
        checks.append(read_check(f"check[{i}]", entry, probes, pairs, theories))
    return Case(
        name=name,
        title=data.get("title", name),
        text=text,
        mesh=mesh,
        model=model,
        ramp=ramp,
        criteria=criteria,
        linear_solver=solve.get("linear_solver", "auto"),
        linear_tolerance=float(solve.get("linear_tolerance", 1e-10)),
        probes=probes,
        theories=theories,
        checks=checks,
        units={"length": "-", "force": "-", "pressure": "-", **units},
        approach=approach,
    )


def _check_keys(where: str, data: Any, known: Mapping[str, Any]) -> None:
    """Raise CaseError for a key that is not in `known`, or a value not of the type there (None: any)."""
    if not isinstance(data, dict):
        raise CaseError(f"'{where}' must be a table of keys, not {repr(data)}")
    for key, value in data.items():
        label = f"{where}.{key}" if where else key
        if key not in known:
            raise CaseError(unknown("key", label, [f"{where}.{k}" if where else k for k in known]))
        kind = known[key]
        if kind is not None and (not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool)):
            names = " or ".join(k.__name__ for k in (kind if isinstance(kind, tuple) else (kind,)))
            raise CaseError(f"the value of '{label}' must be of type {names}, not {repr(value)}")


def called(where: str, function: Callable[..., Any], arguments: dict[str, Any]) -> Any:
    """Call `function` with the keys of a table of a case file.

    Raises
    ------
    CaseError
        If a key is unknown or missing, or a value is of another type than the function wants, or refused by it.
    """
    parameters = inspect.signature(function).parameters
    _check_keys(where, arguments, dict.fromkeys(parameters))
    missing = [key for key, p in parameters.items() if p.default is p.empty and key not in arguments]
    if missing:
        raise CaseError(f"'{where}' needs {' and '.join(repr(key) for key in missing)}")
    for key, value in arguments.items():
        wanted = str(parameters[key].annotation)
        if "float" in wanted and isinstance(value, str) and "str" not in wanted:
            raise CaseError(f"the value of '{where}.{key}' must be a number, not {repr(value)}")
    try:
        return function(**arguments)
    except (TypeError, ValueError) as error:
        given = ", ".join(f"{key} = {repr(value)}" for key, value in arguments.items())
        raise CaseError(f"'{where}': {given} are not of the kinds that it takes ({error})") from error
    except FastcontactError as error:
        raise CaseError(f"'{where}': {error}") from error


@contextlib.contextmanager
def _at(where: str) -> Iterator[None]:
    """Put before the message of an error the place in the case file that it comes from."""
    try:
        yield
    except CaseError:
        raise
    except FastcontactError as error:
        if where.replace(".", " '", 1) + "'" in str(error):  # it says so itself
            raise
        raise type(error)(f"{where}: {error}") from error


def _tables(where: str, entries: Any) -> list[dict[str, Any]]:
    if not isinstance(entries, list) or not all(isinstance(entry, dict) for entry in entries):
        raise CaseError(f"'{where}' must be a list of tables: write [[{where}]] above each")
    return entries


def _mesh(folder: Path, data: dict[str, Any]) -> Mesh:
    if "file" in data:
        _check_keys("mesh", data, {"file": str, "name": str})
        return read_mesh(folder / data["file"], mesh_name=data.get("name"))
    if "generator" not in data:
        raise CaseError("'mesh' needs either the key 'file' or the key 'generator'")
    name = data["generator"]
    if not isinstance(name, str) or name not in generate.GENERATORS:
        raise CaseError(unknown("mesh.generator", str(name), generate.GENERATORS))
    arguments = {key: tuple(v) if isinstance(v, list) else v for key, v in data.items() if key != "generator"}
    return called("mesh", generate.GENERATORS[name], arguments)


def _model(mesh: Mesh, data: dict[str, Any], text: str, folder: Path) -> Model:
    model = Model(mesh, data["kinematics"], case_text=text)
    model.units = dict(data.get("units", {}))
    for i, entry in enumerate(_tables("material", data["material"])):
        _check_keys(f"material[{i}]", entry, {"E": _NUMBER, "nu": _NUMBER, "groups": (list, str)})
        for key in ("E", "nu"):
            if key not in entry:
                raise CaseError(f"material[{i}] needs '{key}'")
        with _at(f"material[{i}]"):
            model.add_material(LinearElastic(E=float(entry["E"]), nu=float(entry["nu"])), entry.get("groups"))
    for i, entry in enumerate(_tables("support", data.get("support", []))):
        _check_keys(f"support[{i}]", entry, {"group": str, **_AXES, "ramp": list})
        if "group" not in entry:
            raise CaseError(f"support[{i}] needs 'group'")
        with _at(f"support[{i}]"):
            model.prescribe(**_arguments(f"support[{i}]", entry))
    _add_loads(model, data)
    for name, entry in data.get("contact", {}).items():
        if not isinstance(entry, dict):
            raise CaseError(f"'contact' needs a name for each pair: write [contact.NAME] above its keys, not '{name}'")
        for key in ("secondary", "primary"):
            if not isinstance(entry.get(key), str):
                raise CaseError(f"contact.{name} needs '{key}', the name of a group of facets")
        with _at(f"contact.{name}"):
            model.add_contact(name, **entry)
    for name, entry in data.get("obstacle", {}).items():
        _add_obstacle(model, name, entry, folder)
    return model


def _add_obstacle(model: Model, name: str, entry: Any, folder: Path) -> None:
    """Give the model a rigid obstacle: its shape by kind and arguments, the rest as for `Model.add_obstacle`."""
    where = f"obstacle.{name}"
    if not isinstance(entry, dict) or not isinstance(entry.get("secondary"), str):
        raise CaseError(f"{where} needs 'secondary', the name of a group of facets")
    rest = {key: value for key, value in entry.items() if key != "shape"}
    shape = entry.get("shape")
    if shape == "mesh":  # its few arguments may stand beside it
        shape = {"kind": "mesh", **{key: rest.pop(key) for key in _SURFACE if key in rest}}
    obstacle = _obstacle(f"{where}.shape", shape, model.mesh, folder)
    for key in ("motion", "force"):
        if key in rest:
            _check_keys(f"{where}.{key}", rest[key], _AXES)
    with _at(where):
        model.add_obstacle(name, obstacle=obstacle, **_arguments(where, rest))


def _obstacle(where: str, shape: Any, mesh: Mesh, folder: Path) -> Obstacle:
    """Return the rigid shape that a table with its kind and arguments describes; `mesh` is that of the model."""
    kind = shape.get("kind", "") if isinstance(shape, dict) else shape if isinstance(shape, str) else ""
    if not isinstance(shape, dict) or kind not in (*SHAPES, "mesh"):
        raise CaseError(unknown(f"{where}.kind", str(kind), (*SHAPES, "mesh")))
    arguments: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in shape.items() if k != "kind"}
    if kind == "mesh":
        _check_keys(where, arguments, _SURFACE)
        if "group" not in arguments:
            raise CaseError(f"'{where}' needs 'group', the facets of the rigid surface")
        file = arguments.pop("file", None)
        return MeshedSurface(mesh if file is None else read_mesh(folder / file), **arguments)
    obstacle: Obstacle = called(where, SHAPES[kind], arguments)
    return obstacle


def _add_loads(model: Model, data: dict[str, Any]) -> None:
    """Give the model the loads and relations of a case."""
    for kind, (known, add, needed) in _LOADS.items():
        for i, entry in enumerate(_tables(kind, data.get(kind, []))):
            where = f"{kind}[{i}]"
            _check_keys(where, entry, known)
            for key in needed:
                if key not in entry:
                    raise CaseError(f"{where} needs '{key}'")
            with _at(where):
                add(model, **_arguments(where, entry))


def _arguments(where: str, entry: dict[str, Any]) -> dict[str, Any]:
    """Return an entry as arguments of a method of the model, its lists of numbers and terms checked."""
    arguments = dict(entry)
    if "ramp" in entry:
        arguments["ramp"] = _points(entry["ramp"], f"{where}.ramp")
    for term in entry.get("terms", []):
        kinds: list[Any] = [(str, int), str, _NUMBER]
        if not isinstance(term, list) or len(term) != 3 or not all(isinstance(v, k) for v, k in zip(term, kinds)):
            raise CaseError(
                f"'{where}.terms' must be a list of [group or point, component, coefficient], not {repr(term)}"
            )
    return arguments


def _ramp(data: dict[str, Any]) -> Ramp:
    _check_keys("ramp", data, _RAMP)
    if "instants" not in data:
        if "table" in data:
            table = _points(data["table"])
            return Ramp(linear_ramp(data.get("steps", 20), table[-1][0]).instants, table)
        return linear_ramp(data.get("steps", 20), float(data.get("end", 1.0)))
    if "steps" in data or "end" in data:
        raise CaseError("'ramp' takes either 'instants', or 'steps' and 'end', not both")
    instants = tuple(float(t) for t in data["instants"])
    table = _points(data["table"]) if "table" in data else ((0.0, 0.0), (1.0, 1.0))
    return Ramp(instants, table)


def _points(table: list[Any], where: str = "ramp.table") -> Table:
    pairs = all(isinstance(row, list) and len(row) == 2 and all(isinstance(v, _NUMBER) for v in row) for row in table)
    if not table or not pairs:
        raise CaseError(f"'{where}' must be a list of pairs [instant, multiplier of the loads]")
    return tuple((float(t), float(v)) for t, v in table)


def _probes(mesh: Mesh, data: dict[str, Any]) -> dict[str, int]:
    _check_keys("probes", data, dict.fromkeys(data, str))
    return {name: mesh.point(group) for name, group in data.items()}


def _theories(data: dict[str, Any], pairs: Mapping[str, Any]) -> tuple[dict[str, dict[str, Any]], dict[str, float]]:
    """Build the theories of ``[theory.PAIR]`` and, below it, ``mesh_converged``."""
    theories: dict[str, dict[str, Any]] = {}
    approach = {}
    for pair, entry in data.items():
        if pair not in pairs:
            raise CaseError(unknown("contact pair in 'theory'", pair, pairs))
        own = {key: value for key, value in entry.items() if key not in ("mesh_converged", "share")}
        theories[pair] = {"theory": _theory(f"theory.{pair}", own), "share": _share(f"theory.{pair}", entry)}
        if "mesh_converged" in entry:
            theories[pair]["mesh_converged"] = _theory(f"theory.{pair}.mesh_converged", entry["mesh_converged"])
        if "approach" in own:
            approach[pair] = float(own["approach"])
    return theories, approach


def _share(where: str, data: dict[str, Any]) -> float:
    """Return the part of the theory's contact that the model holds, 1 by default."""
    _check_keys(where, {"share": data.get("share", 1.0)}, {"share": _NUMBER})
    share = float(data.get("share", 1.0))
    if not 0.0 < share <= 1.0:
        raise CaseError(
            f"{where}.share = {share:g} must be more than 0 and at most 1: 0.25 for a quarter of the contact"
        )
    return share


def _theory(where: str, data: dict[str, Any]) -> Any:
    if not isinstance(data, dict) or "kind" not in data:
        raise CaseError(f"'{where}' needs the key 'kind', one of {', '.join(analytic.THEORIES)}")
    if not isinstance(data["kind"], str) or data["kind"] not in analytic.THEORIES:
        raise CaseError(unknown(f"{where}.kind", str(data["kind"]), analytic.THEORIES))
    return called(where, analytic.THEORIES[data["kind"]], {key: v for key, v in data.items() if key != "kind"})


def described(data: dict[str, Any]) -> dict[str, Any]:
    """Return what pictures need of a case: ``title``, ``units``; ``theories``, ``shares``, ``approach`` by contact pair.

    `data` is the parsed text kept in a result file; it may be empty.
    """
    theories, approach = _theories(data.get("theory", {}), {**data.get("contact", {}), **data.get("obstacle", {})})
    return {
        "title": data.get("title", ""),
        "units": {"length": "-", "force": "-", "pressure": "-", **data.get("units", {})},
        "theories": {pair: entry["theory"] for pair, entry in theories.items()},
        "shares": {pair: entry["share"] for pair, entry in theories.items()},
        "approach": approach,
    }
