"""Meshes of a study, level by level: a recipe of plain data, and the mesh that is made from it."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any

from fastcontact.errors import CaseError, FastcontactError, unknown
from fastcontact.mesh import elements, generate
from fastcontact.mesh.generate import Circle, circles, linearised, refined, to_quadratic
from fastcontact.mesh.mesh import Mesh
from fastcontact.studies.settings import Settings, makeable, shape_of

Arguments = dict[str, Any]
Recipe = dict[str, Any]
# Of a generator: defaults that depend on other arguments, arguments to halve, arguments to double.
Rule = tuple[Arguments, tuple[str, ...], tuple[str, ...]]


def _spheres(element: str, given: Mapping[str, Any]) -> Rule:
    R = float(given.get("R", 50.0))
    if shape_of(element) == "triangles":
        return {"size": R / 25}, ("size", "contact_size"), ()
    return {"arc_sizes": (R / 250, R / 25), "segments": 15}, ("arc_sizes", "radial_sizes"), ("segments",)


def _cylinder(element: str, given: Mapping[str, Any]) -> Rule:
    R = float(given.get("R", 50.0))
    far = float(given.get("size", R / 10))
    return {"size": far, "contact_size": min(R / 100, far)}, ("size", "contact_size"), ()


RULES: dict[str, Callable[[str, Mapping[str, Any]], Rule]] = {
    "half-spheres": _spheres,
    "cylinder-on-block": _cylinder,
    "block-on-block": lambda element, given: ({}, (), ("divisions_lower", "divisions_upper")),
    "box": lambda element, given: ({}, (), ("divisions",)),
}


def recipe(settings: Settings, element: str | None, level: int) -> Recipe:
    """Return the recipe of the mesh of a level: plain data, equal for equal meshes.

    Raises CaseError if the element cannot be made of the case's mesh, or nothing is known of the generator's arguments.
    """
    if element is not None and not makeable(settings, element):
        raise CaseError(_not_makeable(settings, element))
    if settings.generator is None:
        curves = settings.curves and [[list(c.centre), c.radius, c.group] for c in settings.curves]
        return {"refinements": level, "element": element, "curves": curves}
    element = element or "tri3"
    shape = shape_of(element)
    # Where level 0 is given by shape, it is that of quadratic cells; linear ones have the same nodes.
    finer = level + int(shape in settings.arguments and elements.get(element).order == 1)
    given = settings.arguments.get(shape, settings.arguments.get("", {}))
    # Free triangles of another size lie in another pattern, which changes the largest pressure at random: refine them.
    halvings, refinements = (0, finer) if shape == "triangles" else (finer, 0)
    arguments = _finer(settings, element, given, halvings)
    return {"generator": settings.generator, "arguments": arguments, "refinements": refinements}


def _not_makeable(settings: Settings, element: str) -> str:
    own = settings.own.element or "mixed cells"
    if settings.by_shape:
        shape = shape_of(element) or "triangles"
        return f"there are no meshes of {element} in this study: give the arguments of level 0 in [study.{shape}]"
    return (
        f"meshes of {element} cannot be made from the case's {own}: give a generator and its arguments of level 0 in "
        "[study], or choose an element on the same corners"
    )


def _finer(settings: Settings, element: str, given: Mapping[str, Any], level: int) -> Arguments:
    """Return a generator's arguments with sizes halved and counts doubled `level` times."""
    name = str(settings.generator)
    if name not in generate.GENERATORS:
        raise CaseError(unknown("study.generator", name, generate.GENERATORS))
    signature = inspect.signature(generate.GENERATORS[name]).parameters
    for key in given:
        if key not in signature:
            raise CaseError(unknown(f"argument of the generator {name} in [study]", key, signature))
    defaults, halve, double = RULES[name](element, given) if name in RULES else ({}, (), ())
    halve, double = settings.halve or halve, settings.double or double
    if not (halve or double):
        raise CaseError(
            f"it is not known how the generator '{name}' makes finer meshes: name its arguments in [study] as "
            "halve = [...] or double = [...]"
        )
    arguments = {**defaults, **given, **({"element": element} if "element" in signature else {})}
    for names, factor in ((halve, 0.5**level), (double, 2**level)):
        for key in names:
            value = arguments.get(key, signature[key].default if key in signature else None)
            if value is not None:
                arguments[key] = _scaled(value, factor)
    return {key: list(value) if isinstance(value, tuple) else value for key, value in arguments.items()}


def _scaled(value: Any, factor: float) -> Any:
    return [entry * factor for entry in value] if isinstance(value, (list, tuple)) else value * factor


def make_mesh(recipe: Recipe, base: Mesh | None) -> Mesh:
    """Return the mesh of a recipe; `base` is the loaded mesh that is refined where no generator is named."""
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
