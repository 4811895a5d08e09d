"""Meshes of a study by level: recipes, which are plain data, and the meshes made from them."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from fastcontact.errors import CaseError, FastcontactError, check_known
from fastcontact.mesh import elements, generate
from fastcontact.mesh.generate import Circle, circles, linearised, refined, to_quadratic
from fastcontact.mesh.mesh import Mesh
from fastcontact.studies.settings import Settings, makeable, shape_of

Arguments = dict[str, Any]
Recipe = dict[str, Any]


@dataclass(frozen=True)
class Rule:
    """Rule by which the arguments of a generator change from one level to the next."""

    defaults: Arguments = field(default_factory=dict)  # values of arguments that the case does not give
    halve: tuple[str, ...] = ()  # arguments that are halved
    double: tuple[str, ...] = ()  # arguments that are doubled
    root: tuple[str, ...] = ()  # ratios of neighbouring edges, which are replaced by their square roots


def _spheres(element: str, arguments: Mapping[str, Any]) -> Rule:
    R = float(arguments.get("R", 50.0))
    if shape_of(element) == "triangles":
        return Rule({"size": R / 25}, ("size", "contact_size"))
    return Rule({"arc_sizes": (R / 250, R / 25), "segments": 15}, ("arc_sizes", "radial_sizes"), ("segments",))


def _round(arguments: Mapping[str, Any], coarse: int, fine: int, *further: str) -> Rule:
    """Return the rule of a body of radius R with edges of R / `coarse`, in contact of R / `fine`, on level 0."""
    R = float(arguments.get("R", 50.0))
    size = float(arguments.get("size", R / coarse))
    return Rule({"size": size, "contact_size": min(R / fine, size)}, ("size", "contact_size", *further))


def _half_space(element: str, arguments: Mapping[str, Any]) -> Rule:
    width = float(arguments.get("width", 10.0))
    radius, coarse = float(arguments.get("contact_radius", width / 10)), float(arguments.get("size", width / 4))
    least = min(radius, float(arguments.get("contact_radius_y", radius)))
    return Rule({"size": coarse, "contact_size": min(least / 10, coarse)}, ("size", "contact_size", "growth"))


# Along a graded line, the length of the edges grows by `growth` times the distance, independently of the smallest edge.
RULES: dict[str, Callable[[str, Mapping[str, Any]], Rule]] = {
    "half-spheres": _spheres,
    "quarter-disc": _spheres,
    "cylinder-on-block": lambda element, given: _round(given, 10, 100),
    "block-on-block": lambda element, given: Rule(double=("divisions_lower", "divisions_upper")),
    "block": lambda element, given: Rule(double=("divisions",)),
    "box": lambda element, given: Rule(double=("divisions",)),
    "rings": lambda element, given: Rule(double=("divisions_inner", "divisions_outer")),
    "graded-block": _half_space,
    "punched-block": lambda element, given: Rule(
        {"edge_size": float(given.get("punch_radius", 1.0)) / 200}, ("edge_size",), root=("growth",)
    ),
    "crowned-blocks": lambda element, given: Rule(halve=("contact_size",), root=("growth",)),
    **dict.fromkeys(("sphere-on-block", "sphere-octant"), lambda element, given: _round(given, 4, 50, "growth")),
}


def recipe(settings: Settings, element: str | None, level: int) -> Recipe:
    """Return the recipe of the mesh of a level; equal recipes give equal meshes.

    Raises CaseError if the element cannot be made from the mesh of the case, or an argument of the generator is unknown.
    """
    if element is not None and not makeable(settings, element):
        raise CaseError(_not_makeable(settings, element))
    if settings.generator is None:
        curves = settings.curves and [[list(c.centre), c.radius, c.group] for c in settings.curves]
        return {"refinements": level, "element": element, "curves": curves}
    element = element or str(_default_element(settings.generator))
    shape = shape_of(element)
    # Arguments of level 0 by shape are for quadratic cells. Linear cells have half their size and so the same nodes.
    finer = level + int(settings.by_shape and elements.get(element).order == 1)
    level_0 = settings.arguments.get(shape, settings.arguments.get("", {}))
    # Triangles are refined, because the pattern of a new free triangulation would change the largest pressure at random.
    halvings, refinements = (0, finer) if shape == "triangles" else (finer, 0)
    arguments = _finer(settings, element, level_0, halvings)
    return {"generator": settings.generator, "arguments": arguments, "refinements": refinements}


def _default_element(generator: str) -> Any:
    """Return the default element of a generator, or tri3 if the generator is unknown."""
    maker = generate.GENERATORS.get(generator)
    return inspect.signature(maker).parameters["element"].default if maker is not None else "tri3"


def _not_makeable(settings: Settings, element: str) -> str:
    present = settings.own.element or "mixed cells"
    if settings.by_shape:
        shape = shape_of(element) or "triangles"
        return f"there are no meshes of {element} in this study: give the arguments of level 0 in [study.{shape}]"
    return (
        f"meshes of {element} cannot be made from the case's {present}: give a generator and its arguments of level 0 in "
        "[study], or choose an element on the same corners"
    )


def _finer(settings: Settings, element: str, level_0: Mapping[str, Any], level: int) -> Arguments:
    """Return the arguments of the generator with sizes halved and counts doubled `level` times.

    Raises CaseError if an argument is unknown, or if it is not known which arguments make the mesh finer.
    """
    name = str(settings.generator)
    check_known("study.generator", name, generate.GENERATORS, CaseError)
    signature = inspect.signature(generate.GENERATORS[name]).parameters
    for key in (*level_0, *settings.halve, *settings.double):
        check_known(f"argument of the generator {name} in [study]", key, signature, CaseError)
    rule = RULES[name](element, level_0) if name in RULES else Rule()
    own_rule = bool(settings.halve or settings.double)  # the ratios of the rule may not apply
    halve, double = settings.halve or rule.halve, settings.double or rule.double
    if not (halve or double):
        raise CaseError(
            f"it is not known how the generator '{name}' makes finer meshes: name its arguments in [study] as "
            "halve = [...] or double = [...]"
        )
    arguments = {**rule.defaults, **level_0, **({"element": element} if "element" in signature else {})}
    for names, factor in ((halve, 0.5**level), (double, 2**level)):
        for key in names:
            value = arguments.get(key, signature[key].default if key in signature else None)
            if value is not None:
                arguments[key] = _scaled(value, factor)
    for key in () if own_rule else rule.root:
        arguments[key] = arguments.get(key, signature[key].default) ** (0.5**level)
    return {key: list(value) if isinstance(value, tuple) else value for key, value in arguments.items()}


def _scaled(value: Any, factor: float) -> Any:
    return [entry * factor for entry in value] if isinstance(value, (list, tuple)) else value * factor


def make_mesh(recipe: Recipe, base: Mesh | None) -> Mesh:
    """Return the mesh of a recipe; a recipe without a generator refines the mesh `base`."""
    if "generator" in recipe:
        arguments = {key: tuple(v) if isinstance(v, list) else v for key, v in recipe["arguments"].items()}
        mesh = generate.GENERATORS[recipe["generator"]](**arguments)
        return _refined(mesh, recipe["refinements"], circles(mesh) if recipe["refinements"] else [])
    if base is None:
        raise FastcontactError("a mesh that is refined needs the mesh to start from")
    return _from_file(recipe, base)


def _from_file(recipe: Recipe, base: Mesh) -> Mesh:
    given, element = recipe["curves"], recipe["element"]
    curves = circles(base) if given is None else [Circle(tuple(c), radius, group) for c, radius, group in given]
    order, orders = element and elements.get(element).order, {elements.get(name).order for name in base.solids}
    mesh = linearised(base) if order == 1 and orders != {1} else base
    mesh = _refined(mesh, recipe["refinements"], curves)
    if order == 2 and (orders == {1} or element not in mesh.solids):
        mesh = to_quadratic(linearised(mesh), curves, centre_nodes=element == "quad9")
    return mesh


def _refined(mesh: Mesh, times: int, curves: list[Circle]) -> Mesh:
    for _ in range(times):
        mesh = refined(mesh, curves)
    return mesh
