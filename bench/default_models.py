"""Models for `defaults.py`: every kind of contact that the mesh generators support, with reference results."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

import fastcontact as fc
from fastcontact.mesh import generate

E, NU = 210e3, 0.3
LINEAR, QUADRATIC = ("tri3", "quad4"), ("tri6", "quad8", "quad9")
PLANE = (*LINEAR, *QUADRATIC)
SOLIDS = ("tet4", "hex8", "tet10", "hex20", "hex27")
Build = Callable[[dict[str, Any], int], fc.Model]


@dataclass(frozen=True)
class Problem:
    """A contact problem on a mesh of a few cells.

    Attributes
    ----------
    name : str
    build : callable
        From options of the pair and a level to a model; each level halves the cells.
    force, pressure : float, optional
        The truth by theory; without it, that of the refined mesh.
    uniform : bool
        Every closed node has this pressure; otherwise the largest one counts. None: the pressure is singular, none counts.
    obstacle : bool
        Against a rigid obstacle.
    reference : callable, optional
        Makes the model on a refined mesh with quadratic cells, which tells the truth where theory does not; problems that
        share it are solved once.
    """

    name: str
    build: Build
    force: float | None = None
    pressure: float | None = None
    uniform: bool | None = False
    obstacle: bool = False
    reference: Callable[[], fc.Model] | None = None


def material(mesh: fc.Mesh, kinematics: str, nu: float = NU) -> fc.Model:
    model = fc.Model(mesh, kinematics)
    model.add_material(fc.LinearElastic(E, nu))
    return model


def named(mesh: fc.Mesh, prefix: str) -> fc.Mesh:
    return generate.renamed(mesh, {group: f"{prefix}_{group}" for group in mesh.group_names})


def stacked_blocks(element: str, widths: tuple[float, float], cells: tuple[int, int], shift: float = 0.0) -> fc.Mesh:
    """Return a block of height 1 on another one, in the plane or in 3D; L_TOP and U_BOTTOM face each other."""
    parts = []
    for name, width, n, x, z in (("L", widths[0], cells[0], 0.0, -1.0), ("U", widths[1], cells[1], shift, 0.0)):
        high = max(2, round(n / width))
        if element in PLANE:
            part = generate.block((width, 1.0), (n, high), element, (x, z))
        else:
            part = generate.box((width, width, 1.0), (n, n, high), element, (x, x, z))
            part = generate.renamed(part, {"ZMIN": "BOTTOM", "ZMAX": "TOP"}.get)
        parts.append(named(part, name))
    return generate.union(*parts)


def blocks(
    element: str, cells: tuple[int, int], swapped: bool, *, widths: tuple[float, float] = (2.0, 2.0), shift: float = 0.0,
    nu: float = 0.0, whole: bool = False, slide: float = 0.0,
) -> Build:  # fmt: skip
    """Return blocks pressed together by 1 %, one slid on the other; `whole` names the punch's flanks as contact, too."""

    def build(options: dict[str, Any], level: int) -> fc.Model:
        mesh = stacked_blocks(element, widths, (cells[0] << level, cells[1] << level), shift)
        dim = mesh.dim
        up = "xyz"[dim - 1]
        model = material(mesh, "plane_strain" if dim == 2 else "3d", nu)
        model.fix("L_BOTTOM", "xyz"[:dim])
        model.prescribe("U_TOP", **{axis: slide if axis == "x" else 0.0 for axis in "xyz"[: dim - 1]}, **{up: -0.02})
        punch = "U_BOTTOM"
        if whole:
            sides = [mesh.cell_groups[group] for group in ("U_BOTTOM", "U_LEFT", "U_RIGHT")]
            mesh = mesh.with_groups(cells={"U_WHOLE": np.concatenate(sides)})
            model, punch = on(mesh, model), "U_WHOLE"
        sides = ("L_TOP", punch) if swapped else (punch, "L_TOP")
        model.add_contact("c", secondary=sides[0], primary=sides[1], **options)
        return model

    return build


def on(mesh: fc.Mesh, model: fc.Model) -> fc.Model:
    """Return a model with the supports of another one on a mesh that has more groups."""
    again = fc.Model(mesh, model.kinematics)
    again.materials, again.supports = model.materials, model.supports
    return again


def rings(element: str, around: tuple[int, int], swapped: bool) -> Build:
    """Return a press fit of two quarter rings."""

    def build(options: dict[str, Any], level: int) -> fc.Model:
        divisions = [(6 << level, n << level) for n in around]
        model = material(
            generate.rings(element, divisions_inner=divisions[0], divisions_outer=divisions[1]), "plane_strain"
        )
        model.fix("SYMMETRY_X", "x")
        model.fix("SYMMETRY_Y", "y")
        sides = ("CONT_OUTER", "CONT_INNER") if swapped else ("CONT_INNER", "CONT_OUTER")
        model.add_contact("c", secondary=sides[0], primary=sides[1], clearance=-0.05, **options)
        return model

    return build


def bent(element: str, radii: tuple[float, float], cells: tuple[int, int], begin: float, end: float) -> fc.Mesh:
    """Return a block bent to a part of a ring between two angles: BOTTOM at the first radius, TOP at the second."""
    mesh = generate.block((1.0, 1.0), cells, element)
    angle = begin + (end - begin) * mesh.points[:, 0]
    radius = radii[0] + (radii[1] - radii[0]) * mesh.points[:, 1]
    return mesh.replace(points=radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]))


def closed_rings(element: str, around: tuple[int, int], swapped: bool) -> Build:
    """Return whole rings, the bore of the inner one pressed outward against the other, whose rim stands still."""

    def build(options: dict[str, Any], level: int) -> fc.Model:
        parts = []
        for name, radii, n in (("I", (20.0, 50.0), around[0] << level), ("O", (50.0, 100.0), around[1] << level)):
            whole = bent(element, radii, (n, 6 << level), 0.0, -2.0 * np.pi)
            parts.append(named(generate.merge_points(whole, 1e-6), name))
        model = material(generate.union(*parts), "plane_strain")
        model.fix("O_TOP", "xy")
        model.prescribe("I_BOTTOM", **{a: lambda X, k=k: 0.02 * X[:, k] / np.hypot(*X.T) for k, a in enumerate("xy")})
        sides = ("O_BOTTOM", "I_TOP") if swapped else ("I_TOP", "O_BOTTOM")
        model.add_contact("c", secondary=sides[0], primary=sides[1], **options)
        return model

    return build


def saddle(element: str, cells: tuple[int, int], swapped: bool, slide: float) -> Build:
    """Return a shoe in a longer hollow of the same radius 50, pressed outward and slid by a part of its facets' length."""

    def build(options: dict[str, Any], level: int) -> fc.Model:
        n = [k << level for k in cells]
        shoe = bent(element, (48.0, 50.0), (n[0], 2 << level), -0.4 * np.pi, -0.6 * np.pi)
        hollow = bent(element, (50.0, 54.0), (n[1], 4 << level), -0.3 * np.pi, -0.7 * np.pi)
        model = material(generate.union(named(shoe, "S"), named(hollow, "H")), "plane_strain")
        angle = slide * 0.2 * np.pi / cells[0]
        model.fix("H_TOP", "xy")

        def moved(X: Any, axis: int) -> Any:
            turned = X @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
            return (turned * (1.0 + 0.05 / np.hypot(*X.T))[:, None] - X)[:, axis]

        model.prescribe("S_BOTTOM", x=lambda X: moved(X, 0), y=lambda X: moved(X, 1))
        sides = ("H_BOTTOM", "S_TOP") if swapped else ("S_TOP", "H_BOTTOM")
        model.add_contact("c", secondary=sides[0], primary=sides[1], **options)
        return model

    return build


def pin_in_hole(element: str, around: tuple[int, int], swapped: bool, clearance: float = 0.05) -> Build:
    """Return half a pin of radius 10 in a hole with little clearance, pressed upward by its bore (Persson)."""

    def build(options: dict[str, Any], level: int) -> fc.Model:
        sizes = [k << level for k in around]
        pin = bent(element, (1.0, 10.0 - clearance), (sizes[0], 8 << level), 0.5 * np.pi, -0.5 * np.pi)
        pin = generate.transformed(pin, translate=(0.0, clearance))
        far = bent(element, (10.0, 120.0), (sizes[1], 16 << level), 0.5 * np.pi, -0.5 * np.pi)
        model = material(generate.union(named(pin, "P"), named(graded(far), "H")), "plane_strain")
        for group in ("P_LEFT", "P_RIGHT", "H_LEFT", "H_RIGHT"):
            model.fix(group, "x")
        model.fix("H_TOP", "y")
        model.add_traction("P_BOTTOM", y=2000.0 / (2.0 * np.pi))
        sides = ("H_BOTTOM", "P_TOP") if swapped else ("P_TOP", "H_BOTTOM")
        model.add_contact("c", secondary=sides[0], primary=sides[1], **options)
        return model

    return build


def graded(hole: fc.Mesh) -> fc.Mesh:
    """Return a ring from 10 to 120 with cells that grow with the radius."""
    radius = np.hypot(*hole.points.T)
    return hole.replace(points=hole.points / radius[:, None] * (10.0 * 12.0 ** ((radius - 10.0) / 110.0))[:, None])


def cylinder(element: str, swapped: bool) -> Build:
    """Return half a cylinder of radius 50 pressed on a block by 0.5."""

    def build(options: dict[str, Any], level: int) -> fc.Model:
        size = 0.5**level
        model = material(generate.cylinder_on_block(element, size=8.0 * size, contact_size=0.8 * size), "plane_strain")
        model.fix("AXIS", "x")
        model.fix("BLOCK_BOTTOM", "y")
        model.prescribe("CYLINDER_TOP", y=-0.5)
        sides = ("CONT_BLOCK", "CONT_CYLINDER") if swapped else ("CONT_CYLINDER", "CONT_BLOCK")
        model.add_contact("c", secondary=sides[0], primary=sides[1], **options)
        return model

    return build


def half_spheres(element: str, swapped: bool, *, shifted: bool = False) -> Build:
    """Return the half-spheres of the training case, pressed together by 4."""

    def build(options: dict[str, Any], level: int) -> fc.Model:
        size = 0.5**level
        one, other = (generate.quarter_disc(element, body=body, size=8.0 * size, contact_size=finest * size) for body, finest
                      in (("lower", 1.0), ("upper", 1.3 if shifted else 1.0)))  # fmt: skip
        model = fc.Model(generate.union(one, other), "axisymmetric")
        model.add_material(fc.LinearElastic(20_000.0, 0.3))
        model.fix("A1A2", "x")
        model.prescribe("A2B2", y=-2.0)
        model.prescribe("A1B1", y=+2.0)
        sides = ("CONT2", "CONT1") if swapped else ("CONT1", "CONT2")
        model.add_contact("c", secondary=sides[0], primary=sides[1], **options)
        return model

    return build


def sphere(element: str, swapped: bool) -> Build:
    """Return a quarter of half a sphere of radius 50 pressed on a block by 0.5."""

    def build(options: dict[str, Any], level: int) -> fc.Model:
        size = 0.5**level
        mesh = generate.sphere_on_block(element, size=16 * size, contact_size=2.0 * size, contact_radius=5.0)
        model = material(mesh, "3d")
        model.fix("SYMMETRY_X", "x")
        model.fix("SYMMETRY_Z", "z")
        model.fix("BLOCK_BOTTOM", "y")
        model.prescribe("SPHERE_TOP", y=-0.5)
        sides = ("CONT_BLOCK", "CONT_SPHERE") if swapped else ("CONT_SPHERE", "CONT_BLOCK")
        model.add_contact("c", secondary=sides[0], primary=sides[1], **options)
        return model

    return build


def indented(element: str, shape: str) -> Build:
    """Return a block under a rigid ball of radius 50, moved by 0.1, or under a rigid wall, moved by 0.02."""

    def build(options: dict[str, Any], level: int) -> fc.Model:
        size = 0.5**level
        mesh = generate.graded_block(element, width=10.0, contact_radius=2.5, contact_size=0.5 * size, size=2.5 * size)
        dim, up = mesh.dim, "xyz"[mesh.dim - 1]
        model = material(mesh, "axisymmetric" if dim == 2 else "3d")
        model.fix("BOTTOM", up)
        model.fix("SYMMETRY_X", "x")
        if dim == 3:
            model.fix("SYMMETRY_Y", "y")
        if shape == "wall":
            obstacle = fc.obstacles.HalfSpace((0.0,) * dim, (0.0,) * (dim - 1) + (-1.0,))
            secondary, by = "TOP", 0.02
        else:
            obstacle = fc.obstacles.Sphere((0.0,) * (dim - 1) + (50.0,), 50.0)
            secondary, by = "CONTACT", 0.1
        model.add_obstacle("c", secondary=secondary, obstacle=obstacle, motion={up: -by}, **options)
        return model

    return build


def lame(inner: float, rim: float, push: float) -> float:
    """Return the interface pressure at radius 50 of a disc whose bore moves outward while its rim stands still."""
    c1, c2 = np.linalg.solve([[inner, 1 / inner], [rim, 1 / rim]], [push, 0.0])
    return float(E / (1 + NU) * (c2 / 50.0**2 - c1 / (1 - 2 * NU)))


def two_ways(
    name: str, make: Any, elements: Any, meshes: Any, fine: int | None = None, same: str = "", **more: Any
) -> Iterator[Problem]:
    """Yield a problem by element, mesh and secondary side.

    Its reference is `fine` levels finer, with quadratic cells, and without the option `same` of `make`, which must not
    matter.
    """
    best = "hex20" if elements[0] in SOLIDS else "quad8"
    plain = {same: False} if same else {}
    for mesh in meshes:
        given = [mesh] if mesh else []
        reference = None if fine is None else partial(refined, make, best, given, plain, fine)
        for element in elements:
            for swapped in (False, True):
                words = [
                    name,
                    element,
                    *([" on ".join(map(str, mesh))] if mesh else []),
                    *(["swapped"] if swapped else []),
                ]
                yield Problem(", ".join(words), make(element, *given, swapped), reference=reference, **more)


def refined(make: Any, element: str, given: list[Any], plain: dict[str, Any], level: int) -> fc.Model:
    """Return a model on a finer mesh by the method that has most digits on it."""
    return make(element, *given, False, **plain)({"formulation": "mortar"}, level)


def plane_problems() -> Iterator[Problem]:
    """Yield the problems in two dimensions."""
    fit = fc.analytic.press_fit_cylinders(E_inner=E, nu_inner=NU, E_outer=E, nu_outer=NU, inner_radius=20.0,
                                          interface_radius=50.0, outer_radius=100.0, interference=0.05)  # fmt: skip
    along = fit.pressure * 50.0 * np.sqrt(2.0)
    # Chords must lie closer to their arcs than the bodies are pressed into each other.
    for elements, n in (((*LINEAR, *QUADRATIC), ((16, 16),)), (LINEAR, ((64, 81),)), (QUADRATIC, ((16, 21),))):
        yield from two_ways("rings", rings, elements, n, force=along, pressure=fit.pressure, uniform=True)
    truth = lame(20.0, 100.0, 0.02)
    for elements, n in (((*LINEAR, *QUADRATIC), ((40, 40),)), (QUADRATIC, ((40, 54),))):
        yield from two_ways("closed rings", closed_rings, elements, n, pressure=truth, uniform=True)
    for slide in (0.0, 0.1, 0.5):
        shoe = partial(_last, saddle, slide=slide)
        cells = ((16, 32), (16, 24))
        yield from two_ways(
            f"shoe slid by {slide} facets", shoe, ("quad4", "tri6", "quad8"), cells, fine=2, pressure=np.nan
        )
    pin = fc.analytic.persson_pin(E=E, nu=NU, R=10.0, clearance=0.05, force=2000.0)
    yield from two_ways("pin in a hole", pin_in_hole, PLANE, ((90, 90), (90, 97)), pressure=pin.pressure_max)
    flat = partial(_last, blocks)
    yield from two_ways("blocks", flat, PLANE, ((8, 8), (8, 11)), force=2.0 * 0.01 * E, pressure=0.01 * E, uniform=True)
    slid = partial(_last, blocks, nu=NU, slide=0.1)
    yield from two_ways("blocks slid", slid, PLANE, ((8, 8), (8, 11)), fine=2, pressure=np.nan)
    for name, more in {
        "punch": {"widths": (2.0, 1.0), "shift": 0.5},
        "punch beside the nodes": {"widths": (2.0, 1.0), "shift": 0.53},
        "blocks partly over each other": {"shift": 0.6},
        "punch with its flanks": {"widths": (2.0, 1.0), "shift": 0.5, "whole": True},
        "blocks partly over each other with flanks": {"shift": 0.5, "whole": True},
    }.items():
        cells = ((8, 8), (8, 11)) if "partly" in name else ((8, 4), (8, 7))
        yield from two_ways(
            name, partial(_last, blocks, nu=NU, **more), PLANE, cells, fine=3, pressure=np.nan, same="whole"
        )
    yield from two_ways("cylinder on block", cylinder, PLANE, (None,), fine=2)
    yield from two_ways("half-spheres", half_spheres, ("tri3", "tri6"), (None,), force=659_773.142, pressure=2910.4071)
    off = partial(half_spheres, shifted=True)
    yield from two_ways(
        "half-spheres that do not match", off, ("tri3", "tri6"), (None,), force=659_773.142, pressure=2910.4071
    )


def space_problems() -> Iterator[Problem]:
    """Yield the problems in three dimensions."""
    flat = partial(_last, blocks)
    yield from two_ways("blocks", flat, SOLIDS, ((4, 4), (4, 5)), force=4.0 * 0.01 * E, pressure=0.01 * E, uniform=True)
    for name, more in {
        "punch": {"widths": (2.0, 1.0), "shift": 0.5},
        "punch beside the nodes": {"widths": (2.0, 1.0), "shift": 0.53},
        "blocks partly over each other": {"shift": 0.5},
    }.items():
        cells = ((4, 4), (4, 5)) if "partly" in name else ((8, 4), (8, 5))
        yield from two_ways(name, partial(_last, blocks, nu=NU, **more), SOLIDS, cells, fine=1, pressure=np.nan)
    yield from two_ways("sphere on block", sphere, SOLIDS[:4], (None,), fine=1)


def obstacle_problems() -> Iterator[Problem]:
    """Yield the problems with rigid obstacles."""
    for element in (*PLANE, *SOLIDS):
        plane = element in PLANE
        reference = partial(under_ball, *(("quad9", "continuous", 2) if plane else ("hex27", "node_to_segment", 1)))
        yield Problem(f"ball, {element}", indented(element, "ball"), obstacle=True, reference=reference)
        pressure, area = E * 0.02 / 10.0, 100.0 * (np.pi if plane else 1.0)
        given = {"force": pressure * area, "pressure": pressure, "uniform": True}
        yield Problem(f"wall, {element}", indented(element, "wall"), obstacle=True, **given)


def under_ball(element: str, formulation: str, level: int) -> fc.Model:
    return indented(element, "ball")({"formulation": formulation}, level)


def _last(make: Any, element: str, mesh: Any, swapped: bool, **more: Any) -> Build:
    return make(element, mesh, swapped, **more)
