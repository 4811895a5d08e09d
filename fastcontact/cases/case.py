"""Case files, which describe contact problems in TOML and are checked before the solution, and the ready-made cases."""

from __future__ import annotations

import hashlib
import inspect
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fastcontact import analytic
from fastcontact._tools import toml_text
from fastcontact._tools.paths import existing_file, is_stream
from fastcontact.analysis.criteria import Criteria
from fastcontact.cases import keys
from fastcontact.cases.checks import Check, read_check
from fastcontact.cases.keys import NUMBER, call_with_keys, check_keys, check_settings, errors_at, list_of_tables
from fastcontact.cases.model_tables import LISTS, build_model, ramp_points
from fastcontact.errors import CaseError, check_known, in_file, unknown
from fastcontact.linear.choice import check_tolerance
from fastcontact.linear.protocol import TOLERANCE
from fastcontact.mesh.files.mesh_files import read_mesh
from fastcontact.mesh.files.meshio_files import files_of
from fastcontact.mesh.mesh import Mesh
from fastcontact.model.model import Model
from fastcontact.model.ramp import Ramp, linear_ramp, ramp_of
from fastcontact.results.step import StepResult
from fastcontact.results.units import known_units

if TYPE_CHECKING:
    from fastcontact.cases.decks.deck import Deck

# Label of a quantity, or of a parameter with respect to which it is differentiated.
Label = tuple[str | int, ...]
# File suffix of input decks of Abaqus and CalculiX.
DECK_SUFFIX = ".inp"
_PACKAGE = Path(__file__).resolve().parents[1]
# Folders of the ready-made cases, in an installed package and in a checkout.
_CASE_FOLDERS = (_PACKAGE / "data" / "cases", _PACKAGE.parent / "data" / "cases")
# Possessive quantifiers and the lookbehind keep the search linear in the length of the line.
_DECIMAL_COMMA = re.compile(
    r"(?<![\w.-])(?P<key>[\w.-]++)\s*+=\s*+(?P<whole>[+-]?\d++),(?P<digits>\d++(?:[eE][+-]?\d+)?)"
)


def ready_made_cases() -> dict[str, Path]:
    """Return the files of the ready-made cases by name, in alphabetical order."""
    folder = next((folder for folder in _CASE_FOLDERS if folder.is_dir()), None)
    return {} if folder is None else {path.stem: path for path in sorted(folder.glob("*.toml"))}


def ready_made_case(name: str) -> Path:
    """Return the path of a ready-made case. Raises CaseError, with the most similar names, if there is no such case."""
    cases = ready_made_cases()
    check_known("ready-made case", name, cases, CaseError)
    return cases[name]


def case_path(path_or_name: str | Path) -> Path:
    """Return the path of a case file that is given by its path or by the name of a ready-made case.

    A file of that name in the working directory takes precedence, and "-" stands for the standard input. Raises CaseError if
    `path_or_name` is neither a path nor the name of a ready-made case.
    """
    path, text = Path(path_or_name), str(path_or_name)
    try:
        if path.exists() or path.suffix or path.name != text:
            return path
        if path.name == "-":
            return Path("/dev/stdin")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise CaseError(f"cannot look for the case file '{text[:200]}' ({reason}): check its name") from None
    try:
        return ready_made_case(path.name)
    except CaseError as error:
        raise CaseError(f"cannot read the case file '{text}': it does not exist, and {error}") from None


def referenced_files(data: dict[str, Any], folder: Path) -> Iterator[Path]:
    """Yield the files named in the parsed data of a case file, relative to `folder`, and the files that they include."""
    for key, value in data.items():
        entries = value if isinstance(value, list) else [value]
        for entry in entries:
            if isinstance(entry, dict):
                yield from referenced_files(entry, folder)
            elif key == "file" and isinstance(entry, str):
                path = folder / entry
                yield from files_of(path) if path.is_file() else [path]


def digest(paths: Iterator[Path]) -> str:
    """Return the SHA-256 hash of the contents of files. A file that cannot be read also changes the hash."""
    hasher = hashlib.sha256()
    for path in paths:
        try:
            with open(path, "rb") as file:
                hasher.update(hashlib.file_digest(file, "sha256").digest())
        except OSError:
            hasher.update(b"missing")
    return hasher.hexdigest()


@dataclass(frozen=True, eq=False)
class Case:
    """A checked case file with its model.

    Attributes
    ----------
    name : str
        File name without its suffix.
    title : str
        Title of the case.
    text : str
        Text of the case file.
    mesh : Mesh
        Mesh of the model.
    model : Model
        Model of the contact problem.
    ramp : Ramp
        Load steps.
    criteria : Criteria
        Convergence criteria.
    linear_solver : str
        Name of the linear solver.
    linear_tolerance : float
        Relative tolerance of iterative linear solvers [-].
    probes : dict of str to int
        Point number by probe name.
    theories : dict of str to dict
        Theories by contact pair, as dictionaries with the objects ``"theory"`` and optionally ``"mesh_converged"`` of
        `fastcontact.analytic`, and with ``"share"``, the fraction [-] of the theory's contact that the model represents, for
        example 0.25 for a quarter.
    checks : list of Check
        Comparisons with theories and documented values.
    units : dict of str to str
        Names of the units of length, force and pressure, for labels.
    approach : dict of str to float
        Approach by contact pair, for theories with an approach [length].
    folder : pathlib.Path
        Absolute path of the folder to which the file names in the case are relative.
    sensitivities : list of (tuple, list of tuple)
        Quantities and their parameters, as in `fastcontact.sensitivities`.
    modes : dict, optional
        Arguments of `fastcontact.modes` at the last step; None without ``[modes]``.
    deck : Deck, optional
        The input deck from which the case was built.
    """

    name: str
    title: str
    text: str
    mesh: Mesh
    model: Model
    ramp: Ramp
    criteria: Criteria = field(default_factory=Criteria)
    linear_solver: str = "auto"
    linear_tolerance: float = TOLERANCE
    probes: dict[str, int] = field(default_factory=dict)
    theories: dict[str, dict[str, Any]] = field(default_factory=dict)
    checks: list[Check] = field(default_factory=list)
    units: dict[str, str] = field(default_factory=dict)
    approach: dict[str, float] = field(default_factory=dict)
    folder: Path = Path()
    sensitivities: list[tuple[Label, list[Label]]] = field(default_factory=list)
    modes: dict[str, Any] | None = None
    deck: Deck | None = None

    @property
    def solve_arguments(self) -> dict[str, Any]:
        """Keyword arguments of `fastcontact.solve` that the case specifies."""
        return {name: getattr(self, name) for name in ("linear_solver", "linear_tolerance", "criteria")}

    def finished(self, step: StepResult) -> StepResult:
        """Return a step as result files store it; the steps of an input deck are converted by `Deck.finished`."""
        return step if self.deck is None else self.deck.finished(step)


def read_case(path: str | Path) -> Case:
    """Read a case file, a ready-made case or an input deck, and build the model.

    Parameters
    ----------
    path : str or pathlib.Path
        Path of a TOML file or of an input deck of Abaqus or CalculiX (``.inp``), or the name of a ready-made case.

    Returns
    -------
    Case

    Raises
    ------
    CaseError
        If the file is missing, is not TOML, or has an unknown key or an invalid value. The message names the
        file and the key.
    FastcontactError
        If its mesh or model is invalid.
    """
    path = case_path(path)
    if path.suffix.lower() == DECK_SUFFIX:
        return _case_of_deck(path)
    text, data = _read_toml(path)
    try:
        with in_file(path):
            return build_case(data, name=path.stem, folder=path.parent, text=text)
    except (ArithmeticError, AttributeError, LookupError, MemoryError, RecursionError, TypeError, ValueError) as error:
        # No check covers this value. The message of Python is then the only description of the fault.
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise CaseError(f"{path}: a value is of the wrong kind or size ({reason}): see the ready-made cases") from error


def _case_of_deck(path: Path) -> Case:
    """Return the case of an input deck of Abaqus or CalculiX."""
    from fastcontact.cases.decks.deck import read_deck

    deck = read_deck(path)
    return Case(
        name=path.stem,
        text=deck.model.case_text,
        mesh=deck.model.mesh,
        units=known_units({}),
        folder=path.parent.resolve(),
        deck=deck,
        **{name: getattr(deck, name) for name in ("title", "model", "ramp", "criteria", "modes")},
    )


def files_of_case(path: str | Path) -> list[Path]:
    """Return the paths of a case file or an input deck and of all files that it names or includes.

    Raises CaseError or FileError if a file cannot be read.
    """
    path = case_path(path)
    if path.suffix.lower() == DECK_SUFFIX:
        from fastcontact.cases.decks.blocks import files_of_deck

        return files_of_deck(existing_file(path))
    return [path, *referenced_files(_read_toml(path)[1], path.parent)]


def _read_toml(path: Path) -> tuple[str, dict[str, Any]]:
    """Return the text of a case file and the data parsed from it. Raises CaseError if it cannot be read or is not TOML."""
    try:
        if is_stream(path):
            raise CaseError(f"'{path}' is a pipe or a terminal, and a case is read more than once: save it in a file")
        if path.stat().st_size > toml_text.MAX_CHARACTERS:
            raise CaseError(
                f"the case file '{path}' is larger than {toml_text.MAX_CHARACTERS >> 20} MB: put its mesh into a separate "
                "file"
            )
        text = path.read_text(encoding="utf-8-sig")  # Windows editors begin files with a byte order mark
    except (OSError, ValueError) as error:  # ValueError: a null byte in the name, or text that is not UTF-8
        raise CaseError(f"cannot read the case file '{path}': {_reading_error(path, error)}") from error
    try:
        return text, toml_text.parse(text)
    except ValueError as error:
        reason = _frequent_mistake(text, str(error)) or error
        raise CaseError(f"the case file '{path}' is not valid TOML: {reason}") from error


def _frequent_mistake(text: str, message: str) -> str:
    """Return the line, the key and the remedy of a frequent mistake, or an empty string for other messages of the parser.

    The frequent mistakes are a decimal comma, and one of several tables in single brackets.
    """
    lines, place = text.replace("\r\n", "\n").rstrip().split("\n"), re.search(r"at line (\d+), column (\d+)", message)
    number, column = (int(place[1]), int(place[2]) - 1) if place else (len(lines), len(lines[-1]))
    line = lines[number - 1] if number <= len(lines) else ""
    for comma in _DECIMAL_COMMA.finditer(line):
        if comma.end("whole") <= column <= comma.end():  # the comma, or the end of the number in inline tables
            key, correct = comma["key"], f"{comma['whole']}.{comma['digits']}"
            return f"line {number}: '{key}' has a decimal comma: write {key} = {correct}"
    table = re.match(r"\s*\[\[?\s*(\w+)\s*\]", line)
    if table and "Cannot" in message and table[1] in (*LISTS, "check", "sensitivity", "contact", "obstacle"):
        header = f"[{table[1]}.NAME]" if table[1] in ("contact", "obstacle") else f"[[{table[1]}]]"
        return f"line {number}: there is a table [{table[1]}] above: if there are several, write {header} above each"
    return ""


def _reading_error(path: Path, error: Exception) -> str:
    """Return the reason why a case file cannot be read, with a remedy if there is one."""
    if path.is_dir():
        return "it is a folder; name a file in it"
    if not path.exists():
        hint = f"; the ready-made case of this name needs no path: '{path.stem}'"
        return "it does not exist" + (hint if path.stem in ready_made_cases() else "")
    if isinstance(error, OSError):
        return error.strerror or type(error).__name__
    return "it is not UTF-8 text; name a TOML file, whose table [mesh] may name a mesh file"


def build_case(
    data: dict[str, Any], *, name: str, folder: str | Path = ".", text: str = "", mesh: Mesh | None = None
) -> Case:
    """Build a case from the parsed data of a case file, as returned by `tomllib`.

    Paths in the data are relative to `folder`, and `mesh` replaces the mesh of the table ``[mesh]``. Result files and
    studies store `text`; if it is empty, a text is generated from the data. Raises CaseError if a key is unknown or a value
    is invalid, and FastcontactError if the mesh or the model is invalid.
    """
    check_keys("", data, {**keys.TOP_LEVEL, **dict.fromkeys(LISTS, list)})
    check_settings(data)
    for key in ("kinematics", "mesh", "material"):
        if key not in data:
            raise CaseError(f"the key '{key}' is missing")
    solve = data.get("solve", {})
    ramp = _ramp(data.get("ramp", {}))
    tolerance = float(solve.get("linear_tolerance", TOLERANCE))
    check_tolerance(tolerance)
    criteria = Criteria(**{key: value for key, value in solve.items() if not key.startswith("linear_")})
    mesh = _mesh(Path(folder), data["mesh"]) if mesh is None else mesh
    model = build_model(mesh, data, text, Path(folder))
    pairs = _pairs(data, model)
    theories, approach = _theories(data, pairs)
    probes = _probes(mesh, data.get("probes", {}))
    return Case(
        name=name,
        title=data.get("title", name),
        text=text or _text_of(data),
        mesh=model.mesh,
        model=model,
        ramp=ramp,
        criteria=criteria,
        linear_solver=solve.get("linear_solver", "auto"),
        linear_tolerance=tolerance,
        probes=probes,
        theories=theories,
        checks=[
            read_check(f"check[{i}]", entry, probes, pairs, theories, str(data["kinematics"]))
            for i, entry in enumerate(list_of_tables("check", data.get("check", [])))
        ],
        units=known_units(model.units),
        approach=approach,
        folder=Path(folder).resolve(),
        sensitivities=_sensitivities(model, data),
        modes=data.get("modes"),
    )


def _text_of(data: dict[str, Any]) -> str:
    """Return the data as the text of a case file, or an empty text if TOML cannot represent them."""
    try:
        return toml_text.dump(data)
    except ValueError:
        return ""


def _pairs(data: dict[str, Any], model: Model) -> dict[str, Any]:
    """Return the tables of all contact pairs and obstacles; automatically detected pairs share the table ``[contacts]``."""
    pairs = data.get("contact", {})
    entries = {**(pairs if isinstance(pairs, dict) else {}), **data.get("obstacle", {})}
    return {pair.name: entries.get(pair.name, data.get("contacts", {})) for pair in model.contact}


def _sensitivities(model: Model, data: dict[str, Any]) -> list[tuple[Label, list[Label]]]:
    """Return the quantities and the parameters of the tables ``[[sensitivity]]``."""
    sensitivities, entries = [], list_of_tables("sensitivity", data.get("sensitivity", []))
    if entries:
        from fastcontact.analysis.sensitivities import check_arguments  # imports most of the solver
    for i, entry in enumerate(entries):
        where = f"sensitivity[{i}]"
        check_keys(where, entry, keys.SENSITIVITY, keys.SENSITIVITY)
        labels = [entry["quantity"], *entry["by"]]
        if not all(isinstance(label, list) and all(type(word) in (str, int) for word in label) for label in labels):
            raise CaseError(
                f"{where}: 'quantity' must be a list such as [\"pressure_max\", \"PAIR\"], and 'by' a list of lists such as "
                '[["E", "GROUP"]]'
            )
        quantity, *by = map(tuple, labels)
        with errors_at(where):
            check_arguments(model, quantity, by)
        sensitivities.append((quantity, by))
    return sensitivities


def _mesh(folder: Path, data: dict[str, Any]) -> Mesh:
    """Return the mesh of the table ``[mesh]``, from a file, several files that are joined, or a generator."""
    if "file" in data:
        check_keys("mesh", data, {"file": (str, list), "name": str})
        if isinstance(data["file"], str):
            return read_mesh(folder / data["file"], mesh_name=data.get("name"))
        return _joined(folder, data["file"], data.get("name"))
    if "generator" not in data:
        raise CaseError("'mesh' needs either the key 'file' or the key 'generator'")
    from fastcontact.mesh.generate import GENERATORS

    name = data["generator"]
    check_known("mesh.generator", name, GENERATORS, CaseError)
    arguments = {key: tuple(v) if isinstance(v, list) else v for key, v in data.items() if key != "generator"}
    return call_with_keys("mesh", GENERATORS[name], arguments)


def _joined(folder: Path, files: list[Any], name: str | None) -> Mesh:
    """Return the union of the meshes in several files. Raises CaseError if two of them have a group of the same name."""
    from fastcontact.mesh.generate import union

    if not files or not all(isinstance(file, str) for file in files):
        raise CaseError(f"'mesh.file' must be a path or a list of paths, not {files!r}")
    meshes, file_of = [read_mesh(folder / file, mesh_name=name) for file in files], dict[str, str]()
    for file, mesh in zip(files, meshes, strict=True):
        for group in {**mesh.cell_groups, **mesh.point_groups}:
            if group in file_of:
                raise CaseError(
                    f"mesh.file: '{file_of[group]}' and '{file}' both have a group '{group}': rename one of them"
                )
        file_of |= dict.fromkeys({**mesh.cell_groups, **mesh.point_groups}, file)
    return union(*meshes)


def _ramp(data: dict[str, Any]) -> Ramp:
    """Return the load steps of the table ``[ramp]``, by default 20 equal steps."""
    check_keys("ramp", data, keys.RAMP)
    if "instants" not in data:
        if "table" in data:
            table = ramp_points(data["table"])
            return Ramp(linear_ramp(data.get("steps", 20), table[-1][0]).instants, table)
        return linear_ramp(data.get("steps", 20), float(data.get("end", 1.0)))
    if "steps" in data or "end" in data:
        raise CaseError("'ramp' takes either 'instants', or 'steps' and 'end', not both")
    for instant in data["instants"]:
        if type(instant) not in NUMBER:
            raise CaseError(f"ramp.instants contains {instant!r}, which is not a number")
    instants = [float(t) for t in data["instants"]]
    return Ramp(tuple(instants), ramp_points(data["table"])) if "table" in data else ramp_of(instants)


def _probes(mesh: Mesh, data: dict[str, Any]) -> dict[str, int]:
    """Return the point number of each probe in the table ``[probes]``."""
    points_of_probes = {}
    for name, group in data.items():
        if not isinstance(group, str):
            raise CaseError(f"'probes.{name}' must be the name of a group of one point, not {group!r}")
        with errors_at(f"probes.{name}"):
            points_of_probes[name] = mesh.point(group)
    return points_of_probes


def _theories(
    data: dict[str, Any], pairs: Mapping[str, Any] | None = None
) -> tuple[dict[str, dict[str, Any]], dict[str, float]]:
    """Return the theories of the tables ``[theory.PAIR]`` and ``[theory.PAIR.mesh_converged]``, and the approaches [length].

    Both are in the form of `Case.theories` and `Case.approach`. Plane theories have the kinematics of the case by default.
    Raises CaseError if `pairs` is given and does not contain the pair of a theory.
    """
    theories: dict[str, dict[str, Any]] = {}
    approach, kinematics = {}, str(data.get("kinematics", ""))
    for pair, entry in data.get("theory", {}).items():
        if pairs is not None and pair not in pairs:
            raise CaseError("'theory': " + unknown("contact pair", pair, pairs))
        if not isinstance(entry, dict):
            raise CaseError(f"'theory.{pair}' must be a table with the key 'kind', not {entry!r:.80}")
        constants = {key: value for key, value in entry.items() if key not in ("mesh_converged", "share")}
        theories[pair] = {"theory": _theory(f"theory.{pair}", constants, kinematics), "share": entry.get("share", 1.0)}
        check_keys(f"theory.{pair}", {"share": theories[pair]["share"]}, {"share": NUMBER})
        if not 0.0 < theories[pair]["share"] <= 1.0:
            text = "must be more than 0 and at most 1: 0.25 for a quarter of the contact"
            raise CaseError(f"theory.{pair}.share = {entry['share']:g} {text}")
        if "mesh_converged" in entry:
            solution = _theory(f"theory.{pair}.mesh_converged", entry["mesh_converged"], kinematics)
            theories[pair]["mesh_converged"] = solution
        if "approach" in constants:
            approach[pair] = float(constants["approach"])
    return theories, approach


def _theory(where: str, data: dict[str, Any], kinematics: str) -> Any:
    """Return the object of `fastcontact.analytic` that a table describes by its kind and its arguments."""
    if not isinstance(data, dict) or "kind" not in data:
        raise CaseError(f"'{where}' needs the key 'kind', one of {', '.join(analytic.THEORIES)}")
    kind, arguments = data["kind"], {key: value for key, value in data.items() if key != "kind"}
    check_known(f"{where}.kind", kind, analytic.THEORIES, CaseError)
    if kinematics.startswith("plane_") and "kinematics" in inspect.signature(analytic.THEORIES[kind]).parameters:
        arguments = {"kinematics": kinematics, **arguments}
    return call_with_keys(where, analytic.THEORIES[kind], arguments)


def stored_description(data: dict[str, Any]) -> dict[str, Any]:
    """Return the title, the theories, the approaches and the ramp table of a case whose text a result file contains.

    `data` is the parsed text. It is empty for results without a case file.
    """
    theories, approach = _theories(data)
    ramp = _ramp(data.get("ramp", {})).table
    return {"title": data.get("title", ""), "theories": theories, "approach": approach, "ramp": ramp}
