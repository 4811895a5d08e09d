"""Settings of a study from the table ``[study]`` of a case file, and recipes of its meshes on all levels."""

from __future__ import annotations

import inspect
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from fastcontact.cases.case import Case
from fastcontact.cases.keys import call_with_keys, check_keys
from fastcontact.contact.formulations import FORMULATIONS
from fastcontact.errors import CaseError, FastcontactError, check_known
from fastcontact.mesh import elements
from fastcontact.mesh.generate import GENERATORS, Circle, circles, linearised, refined, to_quadratic
from fastcontact.mesh.mesh import Mesh

# Elements by the shape of their cells.
SHAPES = {"triangles": ("tri3", "tri6"), "quadrangles": ("quad4", "quad8", "quad9")}
# Elements that the name "all" selects.
ALL_ELEMENTS = ("quad4", "quad8", "tri3", "tri6")


@dataclass(frozen=True)
class Combination:
    """An element and a contact formulation.

    `element` is None for a mesh with several element types, and `formulation` is None without contact. In the study of a
    function instead of a case both are None, and `function` is its name.
    """

    element: str | None
    formulation: str | None
    function: str = ""

    def __str__(self) -> str:
        formulation = (self.formulation or "no contact").replace("_", "-")
        return self.function or f"{self.element or 'mixed cells'} {formulation}"

    @property
    def rank(self) -> tuple[int, int, int]:
        """Sort key of the expected accuracy, by formulation (node-to-segment last), order and shape of the cells."""
        order = elements.get(self.element).order if self.element else 0
        return int(self.formulation != "node_to_segment"), order, int((self.element or "").startswith("quad"))


@dataclass(frozen=True)
class Settings:
    """Checked settings of a study."""

    data: dict[str, Any]  # parsed case file
    case_combination: Combination  # element and formulation of the case
    pair: str | None  # contact pair to evaluate
    formulations: dict[str, str]  # formulations of the contact pairs and obstacles of the case, by name
    generator: str | None  # mesh generator; None if the mesh of the case is read from a file
    # Arguments of the generator on level 0, by shape of the cells (a key of `SHAPES`); "" for the arguments of the case.
    arguments: dict[str, dict[str, Any]]
    halve: tuple[str, ...] = ()  # arguments to halve on each level; if empty, those of `RULES`
    double: tuple[str, ...] = ()  # arguments to double on each level; if empty, those of `RULES`
    curves: tuple[Circle, ...] | None = None  # curved boundaries of a mesh file; None if circles are to be detected
    load_steps: int | None = None  # number of load steps of each run; None for the steps of the case
    options: dict[str, dict[str, Any]] = field(default_factory=dict)  # options of the contact pair, by formulation
    quantities: tuple[str, ...] = ()  # quantities in addition to the standard quantities
    combinations: tuple[Combination, ...] = ()  # combinations that are compared by default

    @property
    def by_shape(self) -> bool:
        """Whether ``[study]`` gives the arguments of the generator on level 0 by the shape of the cells."""
        return self.generator is not None and "" not in self.arguments


def data_of(case: Case) -> dict[str, Any]:
    """Return the parsed data of a case file; CaseError if the case is not from a case file."""
    try:
        data = tomllib.loads(case.text) if case.deck is None else {}
    except ValueError:
        data = {}
    if "mesh" not in data:
        kind = "an input deck" if case.deck is not None else "made of data that a case file cannot represent"
        studies = "studies change the mesh and the values of a case file (TOML); write such a file"
        raise CaseError(f"'{case.name}' is {kind}: {studies}")
    return data


def settings(case: Case, data: dict[str, Any] | None = None) -> Settings:
    """Return the checked settings of the studies of a case; if given, `data` replaces the data of its case file.

    Raises CaseError if the table ``[study]`` has an invalid value or the case is not from a case file.
    """
    data = data_of(case) if data is None else data
    study = data.get("study", {})
    pair = study.get("contact") or next((contact_pair.name for contact_pair in case.model.contact), None)
    contact = data.get("contact", {})
    tables = {**(contact if isinstance(contact, dict) else {}), **data.get("obstacle", {})}
    formulations = {
        pair.name: str(tables.get(pair.name, {}).get("formulation", pair.formulation)).replace("-", "_")
        for pair in case.model.contact
    }
    if pair is not None:
        check_known("contact pair in study.contact", pair, formulations, CaseError)
    solids = list(case.mesh.solids)
    if "generator" in data["mesh"] and "element" in data["mesh"]:  # a sweep may change it
        solids = [data["mesh"]["element"]]
        check_known("element in mesh.element", solids[0], elements.ELEMENTS, CaseError)
    combination = Combination(solids[0] if len(solids) == 1 else None, formulations.get(pair or ""))
    generator, arguments = _generator(data, study)
    for name in study.get("options", {}):
        check_known("formulation in study.options", name, FORMULATIONS, CaseError)
    curves = tuple(_circle(i, entry) for i, entry in enumerate(study.get("curves", ())))
    combinations = tuple(_parse_combination(entry) for entry in study.get("combinations", ())) or (combination,)
    return Settings(
        data, combination, pair, formulations, generator, arguments, curves=curves if "curves" in study else None,
        load_steps=study.get("load_steps"), options=study.get("options", {}), combinations=combinations,
        **{name: tuple(study.get(name, ())) for name in ("halve", "double", "quantities")},
    )  # fmt: skip


def _generator(data: dict[str, Any], study: dict[str, Any]) -> tuple[str | None, dict[str, dict[str, Any]]]:
    """Return the fields `generator` and `arguments` of `Settings`; CaseError if they are inconsistent."""
    by_shape = {shape: dict(study[shape]) for shape in SHAPES if shape in study}
    generator = study.get("generator", data["mesh"].get("generator"))
    if generator is not None:
        check_known("study.generator", generator, GENERATORS, CaseError)
    if by_shape and generator is None:
        raise CaseError(f"study.{next(iter(by_shape))} needs 'study.generator', the generator to which it applies")
    if not by_shape and "generator" in study and study["generator"] != data["mesh"].get("generator"):
        raise CaseError("'study.generator' needs the arguments of level 0 in [study.triangles] or [study.quadrangles]")
    for shape, arguments in by_shape.items():
        check_keys(f"study.{shape}", arguments, dict.fromkeys(inspect.signature(GENERATORS[str(generator)]).parameters))
    if by_shape or generator is None:
        return generator, by_shape
    return generator, {"": {key: v for key, v in data["mesh"].items() if key not in ("generator", "element")}}


def _circle(index: int, entry: Any) -> Circle:
    """Return the circle that an entry of ``study.curves`` describes; CaseError if it is invalid."""
    try:
        return Circle(tuple(entry["centre"]), float(entry["radius"]), entry.get("group"))
    except (TypeError, KeyError, ValueError) as error:
        form = "{ group = 'NAME', centre = [x, y], radius = R }"
        raise CaseError(f"study.curves[{index}] must be {form}, not {entry!r}") from error


def _parse_combination(entry: Any) -> Combination:
    """Return the combination that an entry such as ``"quad8 mortar"`` names; CaseError if it is invalid."""
    words = entry.split() if isinstance(entry, str) else list(entry)
    if len(words) != 2:
        raise CaseError(f"an entry of study.combinations must name an element and a formulation, not {entry!r}")
    return _make_combination(*words)


def _make_combination(element: str | None, formulation: str | None) -> Combination:
    """Return a combination, whose formulation may be written with hyphens; CaseError if one of the names is unknown."""
    if element is not None:
        check_known("element", element, elements.ELEMENTS, CaseError)
    if formulation is not None:
        formulation = formulation.replace("-", "_")
        check_known("contact formulation", formulation, FORMULATIONS, CaseError)
    return Combination(element, formulation)


def combinations(
    settings: Settings, element_names: Sequence[str] | None, formulations: Sequence[str] | None
) -> tuple[Combination, ...]:
    """Return all combinations of elements and formulations, given their names; by default those of the settings.

    Raises CaseError if an element or a formulation is unknown, or if formulations are given without a contact pair.
    """
    if element_names is None and formulations is None:
        return settings.combinations
    selected = [settings.case_combination.element] if element_names is None else list(element_names)
    if selected == ["all"]:
        selected = [name for name in ALL_ELEMENTS if can_mesh(settings, name)]
    if formulations is not None and settings.pair is None:
        raise CaseError("this case has no contact pair, so there are no formulations to compare")
    formulation_names = [settings.case_combination.formulation] if formulations is None else list(formulations)
    if formulation_names == ["all"]:
        formulation_names = list(FORMULATIONS)
    return tuple(_make_combination(element, formulation) for element in selected for formulation in formulation_names)


def matching_combination(settings: Settings, element: str | None, formulation: str | None) -> Combination:
    """Return the last combination of ``[study]`` with the given element and formulation, where None matches any.

    If there is none, the result is a new combination, in which None is replaced by the value of the last combination.
    """
    formulation = formulation.replace("-", "_") if formulation else None
    for combination in reversed(settings.combinations):
        if element in (None, combination.element) and formulation in (None, combination.formulation):
            return combination
    last = settings.combinations[-1]
    return _make_combination(element or last.element, formulation or last.formulation)


def can_mesh(settings: Settings, element: str) -> bool:
    """Return whether meshes of an element can be made for the case."""
    if settings.by_shape:
        return shape_of(element) in settings.arguments
    original = settings.case_combination.element
    return elements.get(original).linear == elements.get(element).linear if original else settings.generator is not None


def shape_of(element: str) -> str:
    """Return ``"triangles"`` or ``"quadrangles"``, or an empty string for other elements."""
    return next((shape for shape, members in SHAPES.items() if element in members), "")


Arguments = dict[str, Any]
# Data, in types of JSON, from which `make_mesh` makes a mesh. They contain the number of refinements, and either the
# generator with its arguments or, if the mesh of the case is refined, the element and the curved boundaries.
Recipe = dict[str, Any]


@dataclass(frozen=True)
class Rule:
    """Rule by which the arguments of a generator change from one level to the next."""

    defaults: Arguments = field(default_factory=dict)  # values on level 0 of arguments that the case does not give
    halve: tuple[str, ...] = ()  # arguments that are halved
    double: tuple[str, ...] = ()  # arguments that are doubled
    root: tuple[str, ...] = ()  # ratios of neighbouring edges, which are replaced by their square roots


def _sphere_rule(element: str, arguments: Mapping[str, Any]) -> Rule:
    """Return the rule of half-spheres and discs of radius R."""
    R = float(arguments.get("R", 50.0))
    if shape_of(element) == "triangles":
        return Rule({"size": R / 25}, ("size", "contact_size"))
    return Rule({"arc_sizes": (R / 250, R / 25), "segments": 15}, ("arc_sizes", "radial_sizes"), ("segments",))


def _round_body_rule(arguments: Mapping[str, Any], coarse: int, fine: int, *further: str) -> Rule:
    """Return the rule of a body of radius R, which halves the edge lengths and the arguments `further`.

    The default edge lengths on level 0 are R / `coarse`, and R / `fine` at the contact.
    """
    R = float(arguments.get("R", 50.0))
    size = float(arguments.get("size", R / coarse))
    return Rule({"size": size, "contact_size": min(R / fine, size)}, ("size", "contact_size", *further))


def _half_space_rule(_: str, arguments: Mapping[str, Any]) -> Rule:
    """Return the rule of a block that represents a half-space."""
    width = float(arguments.get("width", 10.0))
    radius, size = float(arguments.get("contact_radius", width / 10)), float(arguments.get("size", width / 4))
    smallest = min(radius, float(arguments.get("contact_radius_y", radius)))
    return Rule({"size": size, "contact_size": min(smallest / 10, size)}, ("size", "contact_size", "growth"))


# Rules of the generators, as functions of the element and the arguments on level 0. A `growth` that is the increase of the
# edge length per distance is halved. A `growth` that is the ratio of neighbouring edges is replaced by its square root.
RULES: dict[str, Callable[[str, Mapping[str, Any]], Rule]] = {
    "half-spheres": _sphere_rule,
    "quarter-disc": _sphere_rule,
    "cylinder-on-block": lambda _, given: _round_body_rule(given, 10, 100),
    "block-on-block": lambda *_: Rule(double=("divisions_lower", "divisions_upper")),
    **dict.fromkeys(("block", "box"), lambda *_: Rule(double=("divisions",))),
    "rings": lambda *_: Rule(double=("divisions_inner", "divisions_outer")),
    "graded-block": _half_space_rule,
    "punched-block": lambda _, given: Rule(
        {"edge_size": float(given.get("punch_radius", 1.0)) / 200}, ("edge_size",), root=("growth",)
    ),
    "crowned-blocks": lambda *_: Rule(halve=("contact_size",), root=("growth",)),
    **dict.fromkeys(("sphere-on-block", "sphere-octant"), lambda _, given: _round_body_rule(given, 4, 50, "growth")),
}


def recipe(settings: Settings, element: str | None, level: int) -> Recipe:
    """Return the recipe of the mesh of a level; equal recipes give equal meshes.

    Raises CaseError if meshes of the element cannot be made for the case, or an argument of the generator is unknown.
    """
    if element is not None and not can_mesh(settings, element):
        raise CaseError(_no_mesh_message(settings, element))
    if settings.generator is None:
        curves = settings.curves and [[list(c.centre), c.radius, c.group] for c in settings.curves]
        return {"refinements": level, "element": element, "curves": curves}
    element = element or str(inspect.signature(GENERATORS[settings.generator]).parameters["element"].default)
    shape = shape_of(element)
    # The arguments on level 0 by shape are those of quadratic cells. Linear cells of half the size have the same nodes.
    n_halvings = level + int(settings.by_shape and elements.get(element).order == 1)
    level_0 = settings.arguments.get(shape, settings.arguments.get("", {}))
    # Triangle meshes are refined, because a new free triangulation on each level would change the largest pressure at random.
    halvings, refinements = (0, n_halvings) if shape == "triangles" else (n_halvings, 0)
    arguments = _refined_arguments(settings, element, level_0, halvings)
    return {"generator": settings.generator, "arguments": arguments, "refinements": refinements}


def _no_mesh_message(settings: Settings, element: str) -> str:
    """Return the message that meshes of an element cannot be made for the case, with a remedy."""
    original = settings.case_combination.element or "mixed cells"
    if settings.by_shape:
        shape = shape_of(element) or "triangles"
        return f"there are no meshes of {element} in this study: give the arguments of level 0 in [study.{shape}]"
    return (
        f"meshes of {element} cannot be made from the case's {original}: give a generator and its arguments of level 0 in "
        "[study], or choose an element with the same corners"
    )


def _refined_arguments(settings: Settings, element: str, level_0: Mapping[str, Any], level: int) -> Arguments:
    """Return the arguments of the generator with sizes halved and counts doubled `level` times.

    Raises CaseError if an argument is unknown, or if it is not known which arguments make the mesh finer.
    """
    name = str(settings.generator)
    signature = inspect.signature(GENERATORS[name]).parameters
    for key in (*level_0, *settings.halve, *settings.double):
        check_known(f"argument of the generator {name} in [study]", key, signature, CaseError)
    rule = RULES[name](element, level_0) if name in RULES else Rule()
    explicit = bool(settings.halve or settings.double)  # the rule for `growth` may not apply to explicit arguments
    halve, double = settings.halve or rule.halve, settings.double or rule.double
    if not (halve or double):
        raise CaseError(
            f"it is not known how the generator '{name}' makes finer meshes: name its arguments in [study] as "
            "halve = [...] or double = [...]"
        )
    arguments = {**rule.defaults, **level_0, **({"element": element} if "element" in signature else {})}
    for key, factor in [(key, 0.5**level) for key in halve] + [(key, 2**level) for key in double]:
        value = arguments.get(key, signature[key].default if key in signature else None)
        if value is not None:
            is_sequence = isinstance(value, (list, tuple))
            arguments[key] = [entry * factor for entry in value] if is_sequence else value * factor
    for key in () if explicit else rule.root:
        arguments[key] = arguments.get(key, signature[key].default) ** (0.5**level)
    return {key: list(value) if isinstance(value, tuple) else value for key, value in arguments.items()}


def make_mesh(recipe: Recipe, base: Mesh | None) -> Mesh:
    """Return the mesh of a recipe; a recipe without a generator refines the mesh `base`."""
    if "generator" in recipe:
        arguments = {key: tuple(v) if isinstance(v, list) else v for key, v in recipe["arguments"].items()}
        mesh = call_with_keys("mesh", GENERATORS[recipe["generator"]], arguments)
        return _refine_repeatedly(mesh, recipe["refinements"], circles(mesh) if recipe["refinements"] else [])
    if base is None:
        raise FastcontactError("the refinement of a mesh needs the initial mesh")
    return _refined_mesh(recipe, base)


def _refined_mesh(recipe: Recipe, base: Mesh) -> Mesh:
    """Return the refined mesh of a case, with cells of the order of the element in the recipe."""
    entries, element = recipe["curves"], recipe["element"]
    curves = circles(base) if entries is None else [Circle(tuple(c), radius, group) for c, radius, group in entries]
    order, orders = element and elements.get(element).order, {elements.get(name).order for name in base.solids}
    mesh = linearised(base) if order == 1 and orders != {1} else base
    mesh = _refine_repeatedly(mesh, recipe["refinements"], curves)
    if order == 2 and (orders == {1} or element not in mesh.solids):
        mesh = to_quadratic(linearised(mesh), curves, centre_nodes=element == "quad9")
    return mesh


def _refine_repeatedly(mesh: Mesh, times: int, curves: list[Circle]) -> Mesh:
    for _ in range(times):
        mesh = refined(mesh, curves)
    return mesh
