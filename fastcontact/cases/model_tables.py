"""Construction of the model of a case file: materials, supports, loads, constraints, springs, contact pairs and obstacles."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from reprlib import repr
from typing import Any

from fastcontact._tools.argument_types import types_of
from fastcontact.cases.keys import AXES, FIELD, NUMBER, ROTATION, SURFACE, at, called, check_keys, tables, toml_types
from fastcontact.contact.obstacles import SHAPES, MeshedSurface, Obstacle
from fastcontact.elasticity.anisotropic_materials import Anisotropic, Orthotropic
from fastcontact.elasticity.initial_states import COMPONENTS
from fastcontact.elasticity.material_axes import CylindricalAxes
from fastcontact.elasticity.materials import CONSTANTS, LinearElastic, Material, check_conductivity, check_expansion
from fastcontact.elasticity.nonlinear_materials import ElasticPlastic, MooneyRivlin, NeoHookean, Ogden, Yeoh
from fastcontact.elasticity.varying_constants import Tabulated
from fastcontact.errors import OTHER_WORDS, CaseError, check_known, unknown
from fastcontact.mesh.files.mesh_fields import read_field
from fastcontact.mesh.files.mesh_files import read_mesh
from fastcontact.mesh.generate.cut import cut
from fastcontact.mesh.generate.transform import with_reference_points
from fastcontact.mesh.mesh import OPPOSITE, Mesh
from fastcontact.model.model import Model
from fastcontact.model.ramp import Table

# Keys whose values may depend on the position.
VALUES = ("E", "nu", "G", "density", "expansion", "conductivity", "value", "coefficient", "ambient", *COMPONENTS)


def _add_material(model: Model, groups: Any = None, **constants: Any) -> None:
    """Add a material with the given constants; `_material_law` selects its law."""
    kind = _material_law(constants)
    constants.pop("law", None)
    if kind is LinearElastic:
        # A list contains the components along the axes. Values by cell are given by tables instead.
        if isinstance(constants.get("expansion"), list):
            check_expansion(constants["expansion"], 1)
        if isinstance(constants.get("conductivity"), list):
            check_conductivity(constants["conductivity"], 1)
        constants = {key: float(value) if type(value) is int else value for key, value in constants.items()}
    model.add_material(kind(**constants), groups)


def _add_temperature(model: Model, **given: Any) -> None:
    """Add a temperature that is given by a value or by a field in files."""
    if ("value" in given) == ("file" in given):
        raise CaseError("a temperature needs either 'value', or 'file' and 'field'")
    if "value" in given:
        for key in ("field", "instant", "times"):
            if key in given:
                raise CaseError(f"the key '{key}' belongs to a temperature with 'file'")
        model.add_temperature(**given)
    elif "field" not in given:
        raise CaseError("a temperature with 'file' needs 'field', the name of the field in the file")
    else:
        model.add_temperature_file(**given)


@functools.wraps(Model.add_coupling)
def _add_coupling(model: Model, place: Any = None, **given: Any) -> None:
    """Add a coupling; `_with_references` has added its reference point at `place` to the mesh."""
    model.add_coupling(**given)


def _material_law(entry: dict[str, Any]) -> type[Material]:
    """Return the law of a material from its key `law` or, without it, from the other keys.

    A material with `yield_stress` is elastic-plastic, a material with D is anisotropic, a material with G or with a list E or
    nu is orthotropic, and others are isotropic.
    """
    law = entry.get("law", "elastic_plastic" if "yield_stress" in entry else "linear_elastic")
    check_known("law", law, ["linear_elastic", *NONLINEAR], CaseError)
    if law in NONLINEAR:
        return NONLINEAR[law]
    if "D" in entry:
        return Anisotropic
    return (
        Orthotropic if "G" in entry or any(isinstance(entry.get(key), list) for key in ("E", "nu")) else LinearElastic
    )


def _without_default(function: Callable[..., Any]) -> list[str]:
    """Return the required arguments of a function."""
    return [key for key, given in inspect.signature(function).parameters.items() if given.default is given.empty]


def _check_material(where: str, entry: dict[str, Any]) -> None:
    """Raise CaseError for a key that the material law does not take."""
    law = _material_law(entry)
    for key in entry:
        if key not in ("groups", "law") and key not in inspect.signature(law).parameters:
            raise CaseError(f"the key '{where}.{key}' does not belong to {_LAWS[law]}")


# Nonlinear laws by name in case files.
NONLINEAR: dict[str, type[Material]] = {
    "elastic_plastic": ElasticPlastic,
    "neo_hookean": NeoHookean,
    "mooney_rivlin": MooneyRivlin,
    "yeoh": Yeoh,
    "ogden": Ogden,
}
# Descriptions of materials by law, for messages.
_LAWS: dict[type[Material], str] = {
    LinearElastic: "an isotropic material",
    Orthotropic: "an orthotropic material (E, nu and G are lists of three)",
    Anisotropic: "an anisotropic material (D is a matrix)",
    **{law: f"a material with the law '{name}'" for name, law in NONLINEAR.items()},
}
# Order in which messages list the types of a value.
_ORDER = (*NUMBER, list, dict)


def _constants() -> dict[str, tuple[type, ...]]:
    """Return the types of the keys of all material laws from the annotations of their fields."""
    known: dict[str, set[type]] = {}
    for law in _LAWS:
        for key, annotation in {k: v for base in reversed(law.__mro__) for k, v in types_of(base).items()}.items():
            if key in inspect.signature(law).parameters:
                known.setdefault(key, set()).update(toml_types(annotation))
    return {key: tuple(sorted(kinds, key=[*_ORDER, bool, str].index)) for key, kinds in known.items()}


# Functions by kind of table, for the kinds whose keys are not the arguments of a method `add_KIND` of `Model`.
_NAMED: dict[str, Callable[..., None]] = {
    "material": _add_material,
    "support": Model.prescribe,
    "temperature": _add_temperature,
    "fixed_temperature": Model.fix_temperature,
    "coupling": _add_coupling,
    "couple": Model.couple,
    "relation": Model.relate,
    "group_relation": Model.relate_groups,
}
# All functions by kind of table, in the order in which the tables are added to the model.
_ADD: dict[str, Callable[..., None]] = {
    kind: _NAMED.get(kind) or getattr(Model, f"add_{kind}")
    for kind in (
        "material", "support", "pressure", "traction", "body_force", "gravity", "centrifugal", "temperature",
        "fixed_temperature", "heat_flux", "heat_source", "nodal_heat", "film", "initial_stress", "initial_strain", "force",
        "moment", "hydrostatic_pressure", "coupling", "couple", "relation", "group_relation", "periodicity",
        "cyclic_symmetry", "spring", "pretension",
    )
}  # fmt: skip
# Functions for tables that refer to contact pairs and are therefore added after the pairs.
_ADD_TO_CONTACT: dict[str, Callable[..., None]] = {"fluid_pressure": Model.add_fluid_pressure}


def _keys(*adding: Callable[..., None], **further: Any) -> tuple[dict[str, Any], list[str]]:
    """Return the types of the keys of a table and its required keys, from the signatures of `adding`."""
    known: dict[str, Any] = {}
    required = []
    for add in adding:
        annotated = types_of(inspect.unwrap(add))
        for key, parameter in [*inspect.signature(add).parameters.items()][1:]:  # the first parameter is the model
            kinds = toml_types(annotated[key])
            if parameter.kind is parameter.VAR_KEYWORD:
                initial = add in (Model.add_initial_stress, Model.add_initial_strain)
                known |= dict.fromkeys(COMPONENTS, kinds) if initial else AXES
            else:
                known[key] = kinds if key in (*VALUES, "axes") else tuple(kind for kind in kinds if kind is not dict)
                required += [key] * (parameter.default is parameter.empty)
    return {**known, **further}, required


# Types of the keys and required keys by kind of table.
LISTS: dict[str, tuple[dict[str, Any], Sequence[str]]] = {
    **{
        kind: _keys(add)
        for kind, add in {**_ADD, **_ADD_TO_CONTACT}.items()
        if kind not in ("material", "temperature", "coupling")
    },
    "coupling": _keys(_add_coupling, place=list),
    "support": _keys(Model.prescribe, rotation=dict),
    "material": (
        {
            **{**_constants(), "groups": (list, str), "law": str},
            **{"D": list, "hardening": list, **dict.fromkeys(("mu", "alpha"), (*NUMBER, list))},
        },
        (),
    ),
    # A temperature is given by a value or by a file, so no key is required in both cases.
    "temperature": (_keys(Model.add_temperature, Model.add_temperature_file)[0], ()),
}


def build_model(mesh: Mesh, data: dict[str, Any], text: str, folder: Path) -> Model:
    """Return the model of the parsed `data` of a case file; paths in the data are relative to `folder`."""
    mesh = _with_references(_cut(mesh, data.get("pretension", [])), data.get("coupling", []))
    model = Model(
        mesh,
        data["kinematics"],
        case_text=text,
        strain=data.get("strain", "small"),
        reference_temperature=float(data.get("reference_temperature", 0.0)),
        units=data.get("units", {}),
    )
    _add_lists(model, data, folder, _ADD)
    _add_contacts(model, data)
    for name, entry in data.get("obstacle", {}).items():
        _add_obstacle(model, name, entry, folder)
    _add_lists(model, data, folder, _ADD_TO_CONTACT)
    return model


def _add_lists(model: Model, data: dict[str, Any], folder: Path, adding: Mapping[str, Callable[..., None]]) -> None:
    """Add the entries of the lists of tables of the kinds in `adding`; CaseError if one is invalid."""
    for kind, add in adding.items():
        known, required = LISTS[kind]
        for i, entry in enumerate(tables(kind, data.get(kind, []))):
            where = f"{kind}[{i}]"
            check_keys(where, entry, known)
            if kind == "material":
                _check_material(where, entry)
            for key in _without_default(_material_law(entry)) if kind == "material" else required:
                if key not in entry:
                    raise CaseError(f"{where} needs '{key}'")
            with at(where):
                given = _from_files(where, entry, model.mesh, folder) if kind == "material" else entry
                add(model, **_arguments(where, _with_paths(folder, _changed(where, given, VALUES, _function))))


def _add_contacts(model: Model, data: dict[str, Any]) -> None:
    """Add the contact pairs of a case file, and then the automatically detected pairs if the file requests them."""
    named = data.get("contact", {})
    if isinstance(named, str) and named != "auto":
        raise CaseError(f"'contact' must be \"auto\" or tables [contact.NAME], not {repr(named)}")
    for name, entry in named.items() if isinstance(named, dict) else ():
        if not isinstance(entry, dict):
            raise CaseError(
                f"'contact' needs a name for each pair: write [contact.NAME] above its keys instead of '{name}'"
            )
        for key in ("secondary", "primary"):
            if not isinstance(entry.get(key), str):
                renamed = "".join(f"; rename '{other}' to '{key}'" for other in entry if OTHER_WORDS.get(other) == key)
                raise CaseError(f"contact.{name} needs '{key}', the name of a group of facets{renamed}")
        with at(f"contact.{name}"):
            model.add_contact(name, **entry)
    if named == "auto" or "contacts" in data:
        with at("contacts"):
            model.add_contacts(**data.get("contacts", {}))


def _from_files(where: str, entry: dict[str, Any], mesh: Mesh, folder: Path) -> dict[str, Any]:
    """Return a material entry in which arrays replace constants that are given as fields in files."""

    def read(name: str, value: Any) -> Any:
        if not (isinstance(value, dict) and "file" in value):
            return value
        check_keys(name, value, FIELD)
        if "field" not in value:
            raise CaseError(f"'{name}' needs 'field', the name of the field in the file")
        return read_field(mesh, groups=entry.get("groups"), **_with_paths(folder, value))

    return _changed(where, entry, CONSTANTS, read)


def _changed(
    where: str, entry: dict[str, Any], keys: Sequence[str], change: Callable[[str, Any], Any]
) -> dict[str, Any]:
    """Return an entry with `change` applied to the values of `keys`, or to each value of a list.

    `change` receives the location of the value in the case file, for messages, and the value.
    """
    values = dict(entry)
    for key in (key for key in keys if key in entry):
        value = entry[key]
        if isinstance(value, list):
            values[key] = [change(f"{where}.{key}[{i}]", member) for i, member in enumerate(value)]
        else:
            values[key] = change(f"{where}.{key}", value)
    return values


def _with_paths(folder: Path, entry: dict[str, Any]) -> dict[str, Any]:
    """Return an entry with the paths in `file` resolved relative to the folder of the case file."""
    file = entry.get("file")
    if file is None:
        return entry
    given = [file] if isinstance(file, str) else file
    if not all(isinstance(name, str) for name in given):
        raise CaseError(f"'file' must be a path or a list of paths, not {repr(file)}")
    paths = [folder / name for name in given]
    return {**entry, "file": paths[0] if isinstance(file, str) else paths}


def _function(where: str, value: Any) -> Any:
    """Return the function that a table of values by position defines; other values are returned unchanged."""
    return called(where, Tabulated, value) if isinstance(value, dict) else value


def _cut(mesh: Mesh, sections: Any) -> Mesh:
    """Return the mesh cut along the pretension sections without an opposite side."""
    for i, entry in enumerate(tables("pretension", sections)):
        name = entry.get("section")
        if isinstance(name, str) and "opposite" not in entry and name + OPPOSITE not in mesh.group_names:
            with at(f"pretension[{i}]"):
                mesh = cut(mesh, name, entry.get("normal"))
    return mesh


def _with_references(mesh: Mesh, couplings: Any) -> Mesh:
    """Return the mesh with the reference points of the couplings."""
    for i, entry in enumerate(tables("coupling", couplings)):
        name, place = entry.get("reference"), entry.get("place")
        if isinstance(name, str) and isinstance(place, list):
            with at(f"coupling[{i}]"):
                mesh = with_reference_points(mesh, {name: place})
    return mesh


def _add_obstacle(model: Model, name: str, entry: Any, folder: Path) -> None:
    """Add a rigid obstacle with the `shape` of the entry; the other keys are arguments of `Model.add_obstacle`."""
    where = f"obstacle.{name}"
    if not isinstance(entry, dict) or not isinstance(entry.get("secondary"), str):
        raise CaseError(f"{where} needs 'secondary', the name of a group of facets")
    rest = {key: value for key, value in entry.items() if key != "shape"}
    shape = entry.get("shape")
    if shape == "mesh":  # arguments of the shape may be given as keys of the obstacle
        shape = {"kind": "mesh", **{key: rest.pop(key) for key in SURFACE if key in rest}}
    obstacle = _obstacle(f"{where}.shape", shape, model.mesh, folder)
    for key in ("motion", "force"):
        if key in rest:
            check_keys(f"{where}.{key}", rest[key], AXES)
    with at(where):
        model.add_obstacle(name, obstacle=obstacle, **_arguments(where, rest))


def _obstacle(where: str, shape: Any, mesh: Mesh, folder: Path) -> Obstacle:
    """Return the rigid shape of a table with its kind and its arguments; `mesh` is the mesh of the model."""
    kind = shape.get("kind", "") if isinstance(shape, dict) else shape if isinstance(shape, str) else ""
    if not isinstance(shape, dict) or kind not in (*SHAPES, "mesh"):
        raise CaseError(unknown(f"{where}.kind", str(kind), (*SHAPES, "mesh")))
    arguments: dict[str, Any] = {k: tuple(v) if isinstance(v, list) else v for k, v in shape.items() if k != "kind"}
    if kind == "mesh":
        check_keys(where, arguments, SURFACE)
        if "group" not in arguments:
            raise CaseError(f"'{where}' needs 'group', the facets of the rigid surface")
        file = arguments.pop("file", None)
        return MeshedSurface(mesh if file is None else read_mesh(folder / file), **arguments)
    obstacle: Obstacle = called(where, SHAPES[kind], arguments)
    return obstacle


def _arguments(where: str, entry: dict[str, Any]) -> dict[str, Any]:
    """Return an entry as arguments of a method of `Model`, with checked axes, rotation, ramp and terms."""
    arguments = dict(entry)
    if isinstance(entry.get("axes"), dict):
        arguments["axes"] = called(f"{where}.axes", CylindricalAxes, entry["axes"])
    if "rotation" in entry:
        check_keys(f"{where}.rotation", entry["rotation"], ROTATION)
        arguments["rotation"] = _arguments(f"{where}.rotation", entry["rotation"])
    if "ramp" in entry:
        arguments["ramp"] = ramp_points(entry["ramp"], f"{where}.ramp")
    for term in entry.get("terms", []):
        kinds: list[Any] = [(str, int), str, NUMBER]
        if not isinstance(term, list) or len(term) != 3 or not all(isinstance(v, k) for v, k in zip(term, kinds)):
            raise CaseError(
                f"'{where}.terms' must be a list of [group or point, component, coefficient], not {repr(term)}"
            )
    return arguments


def ramp_points(table: list[Any], where: str = "ramp.table") -> Table:
    """Return a ramp as pairs of instant and load multiplier [-]; CaseError if it is not a list of pairs of numbers."""
    pairs = isinstance(table, list) and all(
        isinstance(row, list) and len(row) == 2 and all(isinstance(v, NUMBER) for v in row) for row in table
    )
    if not table or not pairs:
        raise CaseError(f"'{where}' must be a list of pairs [instant, multiplier of the loads]")
    return tuple((float(t), float(v)) for t, v in table)
