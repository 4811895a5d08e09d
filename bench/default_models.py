"""Contact models for `defaults.py`, which cover the mesh generators, with reference values of force and pressure."""

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
    """A contact problem on a coarse mesh.

    Attributes
    ----------
    name : str
        Kind of problem, element, mesh and secondary side.
    build : callable
        Function of the options of the contact pair and of the level that returns a model. Cells are halved on each level.
    force, pressure : float, optional
        Values of the theory [force], [pressure]; without them, those of `reference` are used.
    uniform : bool
        Whether the pressure is the same at all closed nodes; otherwise it is the largest pressure. None if the pressure is
        singular and is not evaluated.
    obstacle : bool
        Whether the contact is with a rigid obstacle.
    reference : callable, optional
        Function that returns the model on a refined mesh with quadratic cells, whose results are the reference values if
        there is no theory. Problems with the same reference share its solution.
    """

    name: str
    build: Build
    force: float | None = None
    pressure: float | None = None
    uniform: bool | None = False
    obstacle: bool = False
    reference: Callable[[], fc.Model] | None = None


def elastic_model(mesh: fc.Mesh, kinematics: str, nu: float = NU) -> fc.Model:
    model = fc.Model(mesh, kinematics)
    model.add_material(fc.LinearElastic(E, nu))
    return model


def with_prefix(mesh: fc.Mesh, prefix: str) -> fc.Mesh:
    return generate.renamed(mesh, {group: f"{prefix}_{group}" for group in mesh.group_names})


def stacked_blocks(element: str, widths: tuple[float, float], cells: tuple[int, int], shift: float = 0.0) -> fc.Mesh:
    """Return the mesh of a block of height 1 on another one, in 2D or 3D. The groups L_TOP and U_BOTTOM face each other."""
    parts = []
    for name, width, n, x, z in (("L", widths[0], cells[0], 0.0, -1.0), ("U", widths[1], cells[1], shift, 0.0)):
        high = max(2, round(n / width))
        if element in PLANE:
            part = generate.block((width, 1.0), (n, high), element, (x, z))
        else:
            part = generate.box((width, width, 1.0), (n, n, high), element, (x, x, z))
            part = generate.renamed(part, {"ZMIN": "BOTTOM", "ZMAX": "TOP"}.get)
        parts.append(with_prefix(part, name))
    return generate.union(*parts)


def blocks(
    element: str, cells: tuple[int, int], swapped: bool, *, widths: tuple[float, float] = (2.0, 2.0), shift: float = 0.0,
    nu: float = 0.0, whole: bool = False, slide: float = 0.0,
) -> Build:  # fmt: skip
    """Return the builder of two blocks that are pressed together by 1 % and displaced tangentially by `slide`.

    If `whole` is true, the flanks of the upper block belong to the contact surface.
    """

    def build(options: dict[str, Any], level: int) -> fc.Model:
        mesh = stacked_blocks(element, widths, (cells[0] << level, cells[1] << level), shift)
        dim = mesh.dim
        up = "xyz"[dim - 1]
        model = elastic_model(mesh, "plane_strain" if dim == 2 else "3d", nu)
        model.fix("L_BOTTOM", "xyz"[:dim])
        model.prescribe("U_TOP", **{axis: slide if axis == "x" else 0.0 for axis in "xyz"[: dim - 1]}, **{up: -0.02})
        punch = "U_BOTTOM"
        if whole:
            sides = [mesh.cell_groups[group] for group in ("U_BOTTOM", "U_LEFT", "U_RIGHT")]
            mesh = mesh.with_groups(cells={"U_WHOLE": np.concatenate(sides)})
            model, punch = copy_on_mesh(mesh, model), "U_WHOLE"
        sides = ("L_TOP", punch) if swapped else (punch, "L_TOP")
        model.add_contact("c", secondary=sides[0], primary=sides[1], **options)
        return model

    return build


def copy_on_mesh(mesh: fc.Mesh, model: fc.Model) -> fc.Model:
    """Return a copy of a model, with its materials and supports, on a mesh that has further groups."""
    copied = fc.Model(mesh, model.kinematics)
    copied.materials, copied.supports = model.materials, model.supports
    return copied


def rings(element: str, around: tuple[int, int], swapped: bool) -> Build:
    """Return the builder of a press fit of two quarter rings."""

    def build(options: dict[str, Any], level: int) -> fc.Model:
        divisions = [(6 << level, n << level) for n in around]
        model = elastic_model(
            generate.rings(element, divisions_inner=divisions[0], divisions_outer=divisions[1]), "plane_strain"
        )
        model.fix("SYMMETRY_X", "x")
        model.fix("SYMMETRY_Y", "y")
        sides = ("CONT_OUTER", "CONT_INNER") if swapped else ("CONT_INNER", "CONT_OUTER")
        model.add_contact("c", secondary=sides[0], primary=sides[1], clearance=-0.05, **options)
        return model

    return build


def bent_block(element: str, radii: tuple[float, float], cells: tuple[int, int], begin: float, end: float) -> fc.Mesh:
    """Return the mesh of a ring segment between two angles, with BOTTOM at the first radius and TOP at the second."""
    mesh = generate.block((1.0, 1.0), cells, element)
    angle = begin + (end - begin) * mesh.points[:, 0]
    radius = radii[0] + (radii[1] - radii[0]) * mesh.points[:, 1]
    return mesh.replace(points=radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]))


def closed_rings(element: str, around: tuple[int, int], swapped: bool) -> Build:
    """Return the builder of two full rings, whose rim is fixed and whose bore is displaced outwards."""

    def build(options: dict[str, Any], level: int) -> fc.Model:
        parts = []
        for name, radii, n in (("I", (20.0, 50.0), around[0] << level), ("O", (50.0, 100.0), around[1] << level)):
            whole = bent_block(element, radii, (n, 6 << level), 0.0, -2.0 * np.pi)
            parts.append(with_prefix(generate.merge_points(whole, 1e-6), name))
        model = elastic_model(generate.union(*parts), "plane_strain")
        model.fix("O_TOP", "xy")
        model.prescribe("I_BOTTOM", **{a: lambda X, k=k: 0.02 * X[:, k] / np.hypot(*X.T) for k, a in enumerate("xy")})
        sides = ("O_BOTTOM", "I_TOP") if swapped else ("I_TOP", "O_BOTTOM")
        model.add_contact("c", secondary=sides[0], primary=sides[1], **options)
        return model

    return build


def saddle(element: str, cells: tuple[int, int], swapped: bool, slide: float) -> Build:
    """Return the builder of a shoe in a longer hollow of the same radius 50.

    The shoe is pressed outwards and turned by the fraction `slide` of the length of its facets.
    """

    def build(options: dict[str, Any], level: int) -> fc.Model:
        n = [k << level for k in cells]
        shoe = bent_block(element, (48.0, 50.0), (n[0], 2 << level), -0.4 * np.pi, -0.6 * np.pi)
        hollow = bent_block(element, (50.0, 54.0), (n[1], 4 << level), -0.3 * np.pi, -0.7 * np.pi)
        model = elastic_model(generate.union(with_prefix(shoe, "S"), with_prefix(hollow, "H")), "plane_strain")
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
    """Return the builder of half a pin in a hole of radius 10 with a clearance, loaded upwards at its bore (Persson)."""

    def build(options: dict[str, Any], level: int) -> fc.Model:
        sizes = [k << level for k in around]
        pin = bent_block(element, (1.0, 10.0 - clearance), (sizes[0], 8 << level), 0.5 * np.pi, -0.5 * np.pi)
        pin = generate.transformed(pin, translate=(0.0, clearance))
        far = bent_block(element, (10.0, 120.0), (sizes[1], 16 << level), 0.5 * np.pi, -0.5 * np.pi)
        model = elastic_model(generate.union(with_prefix(pin, "P"), with_prefix(graded_ring(far), "H")), "plane_strain")
        for group in ("P_LEFT", "P_RIGHT", "H_LEFT", "H_RIGHT"):
            model.fix(group, "x")
        model.fix("H_TOP", "y")
        model.add_traction("P_BOTTOM", y=2000.0 / (2.0 * np.pi))
        sides = ("H_BOTTOM", "P_TOP") if swapped else ("P_TOP", "H_BOTTOM")
        model.add_contact("c", secondary=sides[0], primary=sides[1], **options)
        return model

    return build


def graded_ring(hole: fc.Mesh) -> fc.Mesh:
    """Return the mesh of a ring of radii 10 and 120 with cells whose size is proportional to the radius."""
    radius = np.hypot(*hole.points.T)
    return hole.replace(points=hole.points / radius[:, None] * (10.0 * 12.0 ** ((radius - 10.0) / 110.0))[:, None])


def cylinder(element: str, swapped: bool) -> Build:
    """Return the builder of half a cylinder of radius 50 that is pressed onto a block by 0.5."""

    def build(options: dict[str, Any], level: int) -> fc.Model:
        size = 0.5**level
        model = elastic_model(
            generate.cylinder_on_block(element, size=8.0 * size, contact_size=0.8 * size), "plane_strain"
        )
        model.fix("AXIS", "x")
        model.fix("BLOCK_BOTTOM", "y")
        model.prescribe("CYLINDER_TOP", y=-0.5)
        sides = ("CONT_BLOCK", "CONT_CYLINDER") if swapped else ("CONT_CYLINDER", "CONT_BLOCK")
        model.add_contact("c", secondary=sides[0], primary=sides[1], **options)
        return model

    return build


def half_spheres(element: str, swapped: bool, *, shifted: bool = False) -> Build:
    """Return the builder of the half-spheres of FORMA04, which are pressed together by 4."""

    def build(options: dict[str, Any], level: int) -> fc.Model:
        size = 0.5**level
        bodies = (generate.quarter_disc(element, body=body, size=8.0 * size, contact_size=finest * size) for body, finest
                  in (("lower", 1.0), ("upper", 1.3 if shifted else 1.0)))  # fmt: skip
        model = fc.Model(generate.union(*bodies), "axisymmetric")
        model.add_material(fc.LinearElastic(20_000.0, 0.3))
        model.fix("A1A2", "x")
        model.prescribe("A2B2", y=-2.0)
        model.prescribe("A1B1", y=+2.0)
        sides = ("CONT2", "CONT1") if swapped else ("CONT1", "CONT2")
        model.add_contact("c", secondary=sides[0], primary=sides[1], **options)
        return model

    return build


def sphere(element: str, swapped: bool) -> Build:
    """Return the builder of a quarter of a half-sphere of radius 50 that is pressed onto a block by 0.5."""

    def build(options: dict[str, Any], level: int) -> fc.Model:
        size = 0.5**level
        mesh = generate.sphere_on_block(element, size=16 * size, contact_size=2.0 * size, contact_radius=5.0)
        model = elastic_model(mesh, "3d")
        model.fix("SYMMETRY_X", "x")
        model.fix("SYMMETRY_Z", "z")
        model.fix("BLOCK_BOTTOM", "y")
        model.prescribe("SPHERE_TOP", y=-0.5)
        sides = ("CONT_BLOCK", "CONT_SPHERE") if swapped else ("CONT_SPHERE", "CONT_BLOCK")
        model.add_contact("c", secondary=sides[0], primary=sides[1], **options)
        return model

    return build


def indented(element: str, shape: str) -> Build:
    """Return the builder of a block under a rigid ball of radius 50, displaced by 0.1, or a rigid wall, displaced by 0.02."""

    def build(options: dict[str, Any], level: int) -> fc.Model:
        size = 0.5**level
        mesh = generate.graded_block(element, width=10.0, contact_radius=2.5, contact_size=0.5 * size, size=2.5 * size)
        dim, up = mesh.dim, "xyz"[mesh.dim - 1]
        model = elastic_model(mesh, "axisymmetric" if dim == 2 else "3d")
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
    """Return the pressure at radius 50 in a disc whose bore is displaced outwards and whose rim is fixed (Lamé)."""
    c1, c2 = np.linalg.solve([[inner, 1 / inner], [rim, 1 / rim]], [push, 0.0])
    return float(E / (1 + NU) * (c2 / 50.0**2 - c1 / (1 - 2 * NU)))


def both_sides(
    name: str, make: Any, elements: Any, meshes: Any, fine: int | None = None, same: str = "", **more: Any
) -> Iterator[Problem]:
    """Yield a problem for each mesh, each element and both choices of the secondary side.

    The mesh of the reference is `fine` levels finer and has quadratic cells. The reference does not use the option `same` of
    `make`, on which results should not depend.
    """
    best = "hex20" if elements[0] in SOLIDS else "quad8"
    plain = {same: False} if same else {}
    for mesh in meshes:
        mesh_arguments = [mesh] if mesh else []
        reference = None if fine is None else partial(reference_model, make, best, mesh_arguments, plain, fine)
        for element in elements:
            for swapped in (False, True):
                words = [
                    name,
                    element,
                    *([" on ".join(map(str, mesh))] if mesh else []),
                    *(["swapped"] if swapped else []),
                ]
                yield Problem(", ".join(words), make(element, *mesh_arguments, swapped), reference=reference, **more)


def reference_model(make: Any, element: str, mesh_arguments: list[Any], plain: dict[str, Any], level: int) -> fc.Model:
    """Return the model on a finer mesh with the most accurate formulation."""
    return make(element, *mesh_arguments, False, **plain)({"formulation": "mortar"}, level)


def plane_problems() -> Iterator[Problem]:
    """Yield the problems in two dimensions."""
    fit = fc.analytic.press_fit_cylinders(E_inner=E, nu_inner=NU, E_outer=E, nu_outer=NU, inner_radius=20.0,
                                          interface_radius=50.0, outer_radius=100.0, interference=0.05)  # fmt: skip
    along = fit.pressure * 50.0 * np.sqrt(2.0)
    # The sagitta of a facet must be smaller than the interference.
    for elements, n in (((*LINEAR, *QUADRATIC), ((16, 16),)), (LINEAR, ((64, 81),)), (QUADRATIC, ((16, 21),))):
        yield from both_sides("rings", rings, elements, n, force=along, pressure=fit.pressure, uniform=True)
    truth = lame(20.0, 100.0, 0.02)
    for elements, n in (((*LINEAR, *QUADRATIC), ((40, 40),)), (QUADRATIC, ((40, 54),))):
        yield from both_sides("closed rings", closed_rings, elements, n, pressure=truth, uniform=True)
    for slide in (0.0, 0.1, 0.5):
        shoe = partial(_last, saddle, slide=slide)
        cells = ((16, 32), (16, 24))
        yield from both_sides(
            f"shoe slid by {slide} facets", shoe, ("quad4", "tri6", "quad8"), cells, fine=2, pressure=np.nan
        )
    pin = fc.analytic.persson_pin(E=E, nu=NU, R=10.0, clearance=0.05, force=2000.0)
    yield from both_sides("pin in a hole", pin_in_hole, PLANE, ((90, 90), (90, 97)), pressure=pin.pressure_max)
    flat = partial(_last, blocks)
    yield from both_sides(
        "blocks", flat, PLANE, ((8, 8), (8, 11)), force=2.0 * 0.01 * E, pressure=0.01 * E, uniform=True
    )
    slid = partial(_last, blocks, nu=NU, slide=0.1)
    yield from both_sides("blocks slid", slid, PLANE, ((8, 8), (8, 11)), fine=2, pressure=np.nan)
    for name, more in {
        "punch": {"widths": (2.0, 1.0), "shift": 0.5},
        "punch beside the nodes": {"widths": (2.0, 1.0), "shift": 0.53},
        "blocks partly over each other": {"shift": 0.6},
        "punch with its flanks": {"widths": (2.0, 1.0), "shift": 0.5, "whole": True},
        "blocks partly over each other with flanks": {"shift": 0.5, "whole": True},
    }.items():
        cells = ((8, 8), (8, 11)) if "partly" in name else ((8, 4), (8, 7))
        yield from both_sides(
            name, partial(_last, blocks, nu=NU, **more), PLANE, cells, fine=3, pressure=np.nan, same="whole"
        )
    yield from both_sides("cylinder on block", cylinder, PLANE, (None,), fine=2)
    yield from both_sides(
        "half-spheres", half_spheres, ("tri3", "tri6"), (None,), force=659_773.142, pressure=2910.4071
    )
    off = partial(half_spheres, shifted=True)
    yield from both_sides(
        "half-spheres that do not match", off, ("tri3", "tri6"), (None,), force=659_773.142, pressure=2910.4071
    )


def space_problems() -> Iterator[Problem]:
    """Yield the problems in three dimensions."""
    flat = partial(_last, blocks)
    yield from both_sides(
        "blocks", flat, SOLIDS, ((4, 4), (4, 5)), force=4.0 * 0.01 * E, pressure=0.01 * E, uniform=True
    )
    for name, more in {
        "punch": {"widths": (2.0, 1.0), "shift": 0.5},
        "punch beside the nodes": {"widths": (2.0, 1.0), "shift": 0.53},
        "blocks partly over each other": {"shift": 0.5},
    }.items():
        cells = ((4, 4), (4, 5)) if "partly" in name else ((8, 4), (8, 5))
        yield from both_sides(name, partial(_last, blocks, nu=NU, **more), SOLIDS, cells, fine=1, pressure=np.nan)
    yield from both_sides("sphere on block", sphere, SOLIDS[:4], (None,), fine=1)


def obstacle_problems() -> Iterator[Problem]:
    """Yield the problems with rigid obstacles."""
    for element in (*PLANE, *SOLIDS):
        plane = element in PLANE
        reference = partial(under_ball, *(("quad9", "continuous", 2) if plane else ("hex27", "node_to_segment", 1)))
        yield Problem(f"ball, {element}", indented(element, "ball"), obstacle=True, reference=reference)
        pressure, area = E * 0.02 / 10.0, 100.0 * (np.pi if plane else 1.0)
        theory = {"force": pressure * area, "pressure": pressure, "uniform": True}
        yield Problem(f"wall, {element}", indented(element, "wall"), obstacle=True, **theory)


def under_ball(element: str, formulation: str, level: int) -> fc.Model:
    return indented(element, "ball")({"formulation": formulation}, level)


def _last(make: Any, element: str, mesh: Any, swapped: bool, **more: Any) -> Build:
    return make(element, mesh, swapped, **more)
