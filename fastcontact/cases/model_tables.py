"""Construction of the model of a case file: materials, supports, loads, constraints, springs, contact pairs and obstacles."""

from __future__ import annotations

import functools
import inspect
import reprlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from fastcontact.cases import keys
from fastcontact.cases.keys import NUMBER, call_with_keys, check_keys, check_kind, errors_at, kinds_of, list_of_tables
from fastcontact.elasticity.anisotropic_materials import Anisotropic, Orthotropic
from fastcontact.elasticity.initial_states import COMPONENTS
from fastcontact.elasticity.material_axes import CylindricalAxes
from fastcontact.elasticity.materials import CONSTANTS, LinearElastic, Material, check_conductivity, check_expansion
from fastcontact.elasticity.nonlinear_materials import ElasticPlastic, MooneyRivlin, NeoHookean, Ogden, Yeoh
from fastcontact.elasticity.varying_constants import Tabulated
from fastcontact.errors import OTHER_WORDS, CaseError, check_known, unknown
from fastcontact.mesh.files.mesh_files import read_mesh
from fastcontact.mesh.mesh import OPPOSITE, Mesh
from fastcontact.model.model import Model
from fastcontact.model.ramp import Table

# Keys whose values may depend on the position.
VARYING = ("E", "nu", "G", "density", "expansion", "conductivity", "value", "coefficient", "ambient", *COMPONENTS)


def _add_material(model: Model, groups: Any = None, **constants: Any) -> None:
    """Add a material with the given constants; `_material_law` selects its law."""
    law = _material_law(constants)
    constants.pop("law", None)
    if law is LinearElastic:
        # In a case file a list contains components along the axes. The class also accepts a list with one value per cell.
        if isinstance(constants.get("expansion"), list):
            check_expansion(constants["expansion"], 1)
        if isinstance(constants.get("conductivity"), list):
            check_conductivity(constants["conductivity"], 1)
        constants = {key: float(value) if type(value) is int else value for key, value in constants.items()}
    model.add_material(law(**constants), groups)


def _add_temperature(model: Model, **entry: Any) -> None:
    """Add the temperature that an entry specifies by a value or by a field in files."""
    if ("value" in entry) == ("file" in entry):
        raise CaseError("a temperature needs either 'value', or 'file' and 'field'")
    if "value" in entry:
        for key in ("field", "instant", "times"):
            if key in entry:
                raise CaseError(f"the key '{key}' belongs to a temperature with 'file'")
        model.add_temperature(**entry)
    elif "field" not in entry:
        raise CaseError("a temperature with 'file' needs 'field', the name of the field in the file")
    else:
        model.add_temperature_file(**entry)


def _material_law(entry: dict[str, Any]) -> type[Material]:
    """Return the class of a material, which the key `law` states or, without this key, the other keys imply.

    A material with `yield_stress` is elastic-plastic, a material with D is anisotropic, a material with G or with lists E or
    nu is orthotropic, and other materials are isotropic.
    """
    law = entry.get("law", "elastic_plastic" if "yield_stress" in entry else "linear_elastic")
    check_known("law", law, ["linear_elastic", *NONLINEAR], CaseError)
    if law in NONLINEAR:
        return NONLINEAR[law]
    if "D" in entry:
        return Anisotropic
    along_axes = "G" in entry or any(isinstance(entry.get(key), list) for key in ("E", "nu"))
    return Orthotropic if along_axes else LinearElastic


# Nonlinear laws by name in case files.
NONLINEAR: dict[str, type[Material]] = {
    "elastic_plastic": ElasticPlastic,
    "neo_hookean": NeoHookean,
    "mooney_rivlin": MooneyRivlin,
    "yeoh": Yeoh,
    "ogden": Ogden,
}
# Descriptions of materials by law, for messages.
_LAW_DESCRIPTIONS: dict[type[Material], str] = {
    LinearElastic: "an isotropic material",
    Orthotropic: "an orthotropic material (E, nu and G are lists of three)",
    Anisotropic: "an anisotropic material (D is a matrix)",
    **{law: f"a material with the law '{name}'" for name, law in NONLINEAR.items()},
}


# Functions by kind of table, for the kinds whose keys are not the arguments of a method `add_KIND` of `Model`.
_SPECIAL: dict[str, Callable[..., None]] = {
    "material": _add_material,
    "support": Model.prescribe,
    "temperature": _add_temperature,
    "fixed_temperature": Model.fix_temperature,
    "couple": Model.couple,
    "relation": Model.relate,
    "group_relation": Model.relate_groups,
}
# All functions by kind of table, in the order in which the tables are added to the model.
_ADD: dict[str, Callable[..., None]] = {
    kind: _SPECIAL.get(kind) or getattr(Model, f"add_{kind}")
    for kind in (
        "material", "support", "pressure", "traction", "body_force", "gravity", "centrifugal", "temperature",
        "fixed_temperature", "heat_flux", "heat_source", "nodal_heat", "film", "initial_stress", "initial_strain", "force",
        "moment", "hydrostatic_pressure", "coupling", "couple", "relation", "group_relation", "periodicity",
        "cyclic_symmetry", "spring", "pretension",
    )
}  # fmt: skip
# Functions for tables that refer to contact pairs and are therefore added after the pairs.
_ADD_TO_CONTACT: dict[str, Callable[..., None]] = {"fluid_pressure": Model.add_fluid_pressure}
FUNCTIONS = _ADD | _ADD_TO_CONTACT
# Kinds of tables of which a case file contains lists.
LISTS = tuple(FUNCTIONS)


@functools.cache
def keys_of_list(kind: str) -> tuple[dict[str, Any], list[str]]:
    """Return the keys of the tables of a kind, one of `LISTS`, with their types as in `kinds_of`, and the required keys.

    The keys are the arguments of the functions that add the tables to a model, which check the types of the values.
    """
    if kind == "material":  # its required keys depend on the law
        constants = {key: known for law in _LAW_DESCRIPTIONS for key, known in kinds_of(law).items()}
        return {"groups": None, "law": None, **constants}, []
    is_temperature = kind == "temperature"  # it needs either a value or a file
    functions: list[Callable[..., None]] = [FUNCTIONS[kind]]
    if is_temperature:
        functions = [Model.add_temperature, Model.add_temperature_file]
    required: list[str] = []
    known: dict[str, Any] = {"place": None} if kind == "coupling" else {}
    for function in functions:
        kinds = kinds_of(function)
        _, *parameters = inspect.signature(function).parameters.values()  # the first one is the model
        for parameter in parameters:
            if parameter.kind is parameter.VAR_KEYWORD:
                known |= dict.fromkeys(COMPONENTS if parameter.name == "tensor_components" else "xyz")
            else:
                known[parameter.name] = kinds[parameter.name]
                required += [parameter.name] * (parameter.default is parameter.empty and not is_temperature)
    return known, required


def build_model(mesh: Mesh, data: dict[str, Any], text: str, folder: Path) -> Model:
    """Return the model of the parsed `data` of a case file; paths in the data are relative to `folder`."""
    mesh = _add_references(_cut_sections(mesh, data.get("pretension", [])), data.get("coupling", []))
    options: dict[str, Any] = {"strain": data.get("strain", "small"), "units": data.get("units", {})}
    reference = float(data.get("reference_temperature", 0.0))
    model = Model(mesh, data["kinematics"], text, reference_temperature=reference, **options)
    _add_lists(model, data, folder, _ADD)
    _add_contacts(model, data)
    for name, entry in data.get("obstacle", {}).items():
        _add_obstacle(model, name, entry, folder)
    _add_lists(model, data, folder, _ADD_TO_CONTACT)
    return model


def _add_lists(model: Model, data: dict[str, Any], folder: Path, functions: Mapping[str, Callable[..., None]]) -> None:
    """Add the entries of the lists of tables to a model by the `functions`. Raises CaseError if an entry is invalid."""
    for kind, add in functions.items():
        for i, entry in enumerate(list_of_tables(kind, data.get(kind, []))):
            where, (known, required) = f"{kind}[{i}]", keys_of_list(kind)
            if kind == "material":
                check_keys(where, entry, known)
                law = _material_law(entry)
                constants = inspect.signature(law).parameters
                for key in entry:
                    if key not in ("groups", "law") and key not in constants:
                        raise CaseError(f"the key '{where}.{key}' does not belong to {_LAW_DESCRIPTIONS[law]}")
                required = [key for key, parameter in constants.items() if parameter.default is parameter.empty]
            check_keys(where, entry, known, required)
            with errors_at(where):
                add(model, **_arguments(where, entry, model.mesh, folder))


def _add_contacts(model: Model, data: dict[str, Any]) -> None:
    """Add the contact pairs of a case file, and then the automatically detected pairs if the file requests them."""
    pairs = data.get("contact", {})
    if isinstance(pairs, str) and pairs != "auto":
        raise CaseError(f"'contact' must be \"auto\" or tables [contact.NAME], not {reprlib.repr(pairs)}")
    for name, entry in pairs.items() if isinstance(pairs, dict) else ():
        if not isinstance(entry, dict):
            raise CaseError(
                f"'contact' needs a name for each pair: write [contact.NAME] above its keys instead of '{name}'"
            )
        for key in ("secondary", "primary"):
            if not isinstance(entry.get(key), str):
                hint = "".join(f"; rename '{word}' to '{key}'" for word in entry if OTHER_WORDS.get(word) == key)
                raise CaseError(f"contact.{name} needs '{key}', the name of a group of facets{hint}")
        _check_kinds(f"contact.{name}", entry, Model.add_contact)
        with errors_at(f"contact.{name}"):
            model.add_contact(name, **entry)
    if pairs == "auto" or "contacts" in data:
        _check_kinds("contacts", data.get("contacts", {}), Model.add_contacts)
        with errors_at("contacts"):
            model.add_contacts(**data.get("contacts", {}))


def _check_kinds(where: str, entry: Mapping[str, Any], function: Callable[..., Any]) -> None:
    """Raise CaseError if the value of a key is not Boolean, although the argument of this name of `function` is."""
    kinds = kinds_of(function)
    for key, value in entry.items():
        check_kind(f"{where}.{key}", value, kinds.get(key))


def _cut_sections(mesh: Mesh, sections: Any) -> Mesh:
    """Return the mesh cut along those pretension sections that have no opposite side yet."""
    for i, entry in enumerate(list_of_tables("pretension", sections)):
        name = entry.get("section")
        if isinstance(name, str) and "opposite" not in entry and name + OPPOSITE not in mesh.group_names:
            from fastcontact.mesh.generate.cut import cut

            with errors_at(f"pretension[{i}]"):
                mesh = cut(mesh, name, entry.get("normal"))
    return mesh


def _add_references(mesh: Mesh, couplings: Any) -> Mesh:
    """Return the mesh with the reference points of those couplings that state a `place`."""
    for i, entry in enumerate(list_of_tables("coupling", couplings)):
        name, coordinates = entry.get("reference"), entry.get("place")
        if isinstance(name, str) and isinstance(coordinates, list):
            from fastcontact.mesh.generate.transform import with_reference_points

            with errors_at(f"coupling[{i}]"):
                mesh = with_reference_points(mesh, {name: coordinates})
    return mesh


def _add_obstacle(model: Model, name: str, entry: Any, folder: Path) -> None:
    """Add a rigid obstacle with the `shape` of an entry, whose other keys are arguments of `Model.add_obstacle`."""
    where = f"obstacle.{name}"
    if not isinstance(entry, dict) or not isinstance(entry.get("secondary"), str):
        raise CaseError(f"{where} needs 'secondary', the name of a group of facets")
    options = {key: value for key, value in entry.items() if key != "shape"}
    _check_kinds(where, options, Model.add_obstacle)
    shape = entry.get("shape")
    if shape == "mesh":  # then the arguments of the shape are keys of the obstacle
        shape = {"kind": "mesh", **{key: options.pop(key) for key in keys.SURFACE if key in options}}
    obstacle = _obstacle(f"{where}.shape", shape, model.mesh, folder)
    with errors_at(where):
        model.add_obstacle(name, obstacle=obstacle, **_arguments(where, options, model.mesh, folder))


def _obstacle(where: str, shape: Any, mesh: Mesh, folder: Path) -> Any:
    """Return the rigid shape that a table describes by its kind and its arguments; `mesh` is the mesh of the model."""
    from fastcontact.contact.obstacles import SHAPES, MeshedSurface

    kind = shape.get("kind", "") if isinstance(shape, dict) else shape if isinstance(shape, str) else ""
    if kind not in (*SHAPES, "mesh"):
        raise CaseError(unknown(f"{where}.kind", str(kind), (*SHAPES, "mesh")))
    if not isinstance(shape, dict):
        required = [key for key, p in inspect.signature(SHAPES[kind]).parameters.items() if p.default is p.empty]
        arguments_text = "".join(f", {key} = ..." for key in required)
        raise CaseError(f"'{where}' is a table: write {{ kind = \"{kind}\"{arguments_text} }}")
    arguments: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in shape.items() if k != "kind"}
    if kind == "mesh":
        check_keys(where, arguments, keys.SURFACE)
        file = arguments.pop("file", None)
        arguments["mesh"] = mesh if file is None else read_mesh(folder / file)
    return call_with_keys(where, MeshedSurface if kind == "mesh" else SHAPES[kind], arguments)


def _arguments(where: str, entry: dict[str, Any], mesh: Mesh, folder: Path) -> dict[str, Any]:
    """Return the keys of an entry as arguments of a method of `Model`, in which objects replace tables and lists.

    `mesh` is the mesh of the model, for fields in files, and paths are relative to `folder`. Raises CaseError if a value is
    invalid.
    """
    arguments = dict(entry)
    arguments.pop("place", None)  # `_add_references` has read it
    for key, value in arguments.items():
        label, is_table = f"{where}.{key}", isinstance(value, dict)
        if key == "file":
            arguments[key] = _paths(folder, value)
        elif key == "ramp":
            arguments[key] = ramp_points(value, label)
        elif key == "terms":
            _check_terms(label, value)
        elif key == "axes" and is_table:
            arguments[key] = call_with_keys(label, CylindricalAxes, value)
        elif key == "rotation" and is_table:
            arguments[key] = _arguments(label, value, mesh, folder)
        elif key in VARYING:
            arguments[key] = _varying(label, value, mesh, entry.get("groups"), folder)
    return arguments


def _varying(where: str, value: Any, mesh: Mesh, groups: Any, folder: Path) -> Any:
    """Return the field in a file, or the function that interpolates values by position, that a table specifies.

    Members of a list are converted in the same way, and other values are returned unchanged. `where` is the location of the
    value in the case file, for messages. A file contains the field of a constant of a material of `groups`.
    """
    if isinstance(value, list):
        return [_varying(f"{where}[{i}]", member, mesh, groups, folder) for i, member in enumerate(value)]
    if not isinstance(value, dict):
        return value
    if "file" not in value or where.rpartition(".")[2].partition("[")[0] not in CONSTANTS:
        return call_with_keys(where, Tabulated, value)
    check_keys(where, value, keys.FIELD)
    if "field" not in value:
        raise CaseError(f"'{where}' needs 'field', the name of the field in the file")
    from fastcontact.mesh.files.mesh_fields import read_field

    return read_field(mesh, groups=groups, **{**value, "file": _paths(folder, value["file"])})


def _paths(folder: Path, file: Any) -> Path | list[Path]:
    """Return a path or a list of paths, which are relative to the folder of the case file."""
    if isinstance(file, str):
        return folder / file
    if not isinstance(file, list) or not all(isinstance(name, str) for name in file):
        raise CaseError(f"'file' must be a path or a list of paths, not {reprlib.repr(file)}")
    return [folder / name for name in file]


def _check_terms(where: str, terms: Any) -> None:
    """Raise CaseError unless the terms of a multi-point constraint are lists of group or point, component and coefficient."""
    kinds: list[Any] = [(str, int), str, NUMBER]
    for term in terms if isinstance(terms, list) else [terms]:
        if not isinstance(term, list) or len(term) != 3 or not all(map(isinstance, term, kinds)):
            raise CaseError(
                f"'{where}' must be a list of [group or point, component, coefficient], not {reprlib.repr(term)}"
            )


def ramp_points(table: list[Any], where: str = "ramp.table") -> Table:
    """Return the pairs of load factor and load multiplier [-] of a ramp.

    Raises CaseError if `table` is not a list of such pairs.
    """
    rows = table if isinstance(table, list) else [None]
    if not rows or not all(
        isinstance(row, list) and [isinstance(v, NUMBER) for v in row] == [True] * 2 for row in rows
    ):
        raise CaseError(f"'{where}' must be a list of pairs [load factor, multiplier of the loads]")
    return tuple((float(t), float(v)) for t, v in table)
