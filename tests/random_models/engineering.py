"""Random models of sectors, periods, rotating obstacles, plates, orthotropic rings, bolts, couplings and heat."""

from collections.abc import Callable

import numpy as np
from bodies import Array, Body, Placement, Random, flat, rotation
from drawing import Draft, add_contact, add_obstacle, material, materials
from models import supported
from wording import SpokenModel

import fastcontact as fc

LINEAR, QUADRATIC = {2: ("tri3", "quad4"), 3: ("hex8", "tet4", "wedge6")}, {2: ("tri6", "quad8"), 3: ("hex20", "tet10")}


def build(random: Random) -> Draft:
    """Return one of them."""
    made = KINDS[int(random.integers(len(KINDS)))]
    draft = made(random)
    draft.labels |= {"family": made.__name__}
    return draft


def space(random: Random) -> tuple[str, int, float]:
    """Return kinematics without an axis of symmetry, the dimension, a length."""
    kinematics = str(random.choice(["plane_strain", "plane_stress", "3d"], p=[0.4, 0.2, 0.4]))
    return kinematics, 3 if kinematics == "3d" else 2, 10.0 ** random.uniform(-2, 3)


def element_of(random: Random, dim: int) -> str:
    return str(random.choice((LINEAR if random.random() < 0.6 else QUADRATIC)[dim]))


def slab(random: Random, name: str, low: Array, high: Array, **shape: Callable[[Array], Array]) -> Body:
    """Return a block of a few cells; `shape` are its lower and upper face."""
    dim = len(low)
    cells = (*random.integers(2, 9 if dim == 2 else 4, dim - 1).tolist(), int(random.integers(1, 3)))
    return Body(name, element_of(random, dim), low, high, cells, **({"under": flat, "over": flat} | shape))


def stack(random: Random, dim: int, length: float) -> list[Body]:
    """Return two blocks on each other that do not match; their heights are half the length."""
    low, high = np.zeros(dim), np.full(dim, length)
    high[-1] = 0.5 * length
    first = slab(random, "B0", low, high)
    low, high = low.copy(), high.copy()
    low[-1], high[-1] = 0.5 * length, length
    return [first, slab(random, "B1", low, high)]


def begun(random: Random, meshes: list[fc.Mesh], kinematics: str, names: list[str], length: float) -> Draft:
    """Return a model with materials."""
    draft = Draft(SpokenModel(fc.generate.union(*meshes), kinematics), "", length, 1.0)
    materials(random, draft, names)
    draft.labels["elements"] = " ".join(draft.model.mesh.solids)
    return draft


def pressed_by(random: Random, length: float) -> float:
    return float(length * 10.0 ** random.uniform(-4, -2))


def vector(values: Array) -> dict[str, float]:
    return {"xyz"[k]: float(value) for k, value in enumerate(values)}


def somewhere(random: Random, dim: int) -> Placement:
    """Return a turn, for half of the models."""
    return Placement(dim, Q=rotation(random, dim) if random.random() < 0.5 else np.eye(3))


def turning_obstacle(random: Random) -> Draft:
    """A block under a ball or a plane that is pressed down and turns about its middle."""
    kinematics, dim, length = space(random)
    at, down = somewhere(random, dim), pressed_by(random, length)
    body = slab(random, "B0", np.zeros(dim), np.full(dim, length))
    draft = begun(random, [body.mesh(at)], kinematics, ["B0"], length)
    draft.model.fix("B0_BOTTOM", "xyz"[:dim])
    up, R = at.direction(*[0.0] * (dim - 1), 1.0), float(length * random.uniform(0.6, 3.0))
    top = at.places(np.array([[*np.full(dim - 1, 0.5 * length), length]]))[0]
    shape = fc.obstacles.Sphere(tuple(top + R * up), R)
    if random.random() < 0.4:
        shape = fc.obstacles.HalfSpace(tuple(top), tuple(-up))
    rotated = {"centre": tuple(top + R * up), "angle": float(down / R * random.uniform(-1, 1))}
    if dim == 3:
        rotated["axis"] = tuple(at.direction(*random.normal(size=2), 0.0))
    if random.random() < 0.5:
        rotated["ramp"] = ((0.0, 0.0), (1.0, 0.5), (2.0, 1.0), (3.0, 1.0))
    motion = at.direction(*(down * random.uniform(-0.5, 0.5, dim - 1)), -down)
    add_obstacle(random, draft, "B0_TOP", shape, down, {"motion": vector(motion), "rotation": rotated})
    return draft


def polar(random: Random, name: str, radii: tuple[float, float], angle: float, dim: int) -> fc.Mesh:
    """Return a sector of a ring from the angle 0 on: BOTTOM and TOP are inside and outside, LEFT and RIGHT its ends."""
    low, high = np.zeros(dim), np.full(dim, angle)
    low[-1], high[-1] = radii
    if dim == 3:
        high[1] = 0.3 * radii[1]
    mesh = slab(random, name, low, high).mesh(Placement(dim))
    turn, r = mesh.points[:, 0], mesh.points[:, -1]
    x = np.column_stack([r * np.cos(turn), r * np.sin(turn)] + ([mesh.points[:, 1]] if dim == 3 else []))
    if dim == 3:
        return mesh.replace(points=x)  # (angle, z, r) to (x, y, z) keeps the sense
    cells = {kind: block[:, fc.mesh.elements.get(kind).reversed] for kind, block in mesh.cells.items()}
    return mesh.replace(points=x, cells=cells)


def sector(random: Random) -> Draft:
    """A sector of a press fit or of a loaded bush, with cyclic ends."""
    kinematics, dim, R = space(random)
    sectors = int(random.integers(5, 30))
    radii = (R * random.uniform(0.4, 0.8), R, R * random.uniform(1.2, 2.0))
    angle = 2 * np.pi / sectors
    meshes = [polar(random, f"B{k}", radii[k : k + 2], angle, dim) for k in range(2)]
    draft = begun(random, meshes, kinematics, ["B0", "B1"], R)
    model, deep = draft.model, pressed_by(random, R) + 0.13 * R * angle**2
    for k in range(2):
        model.add_cyclic_symmetry(f"B{k}_LEFT", f"B{k}_RIGHT", sectors=sectors)
        inside = "B0_BOTTOM" if k == 0 else "B1_TOP"
        model.prescribe(inside, axes=fc.CylindricalAxes(), y=0.0)
        if dim == 3:
            model.fix(f"B{k}_FRONT", "z")
    if random.random() < 0.5:
        model.add_pressure("B0_BOTTOM", draft.stiffness * deep / R)
    else:
        model.prescribe("B0_BOTTOM", axes=fc.CylindricalAxes(), x=float(deep))
        model.prescribe("B1_TOP", axes=fc.CylindricalAxes(), x=0.0)
    add_contact(random, draft, ("B0_TOP", "B1_BOTTOM"), deep, friction=0.2)
    return draft


def period(random: Random) -> Draft:
    """One period of a wavy layer on another one, its ends open."""
    kinematics, dim, length = space(random)
    down = pressed_by(random, length)
    first, second = stack(random, dim, length)

    def wave(x: Array) -> Array:
        return 3 * down * (1 - np.cos(2 * np.pi * (x[:, 0] / length - 0.5)))

    bodies = [first, Body(**{**vars(second), "under": wave})]
    draft = begun(random, [body.mesh(Placement(dim)) for body in bodies], kinematics, ["B0", "B1"], length)
    model = draft.model
    for name in ("B0", "B1"):
        model.add_periodicity(f"{name}_LEFT", f"{name}_RIGHT", x=float(down * random.choice([0.0, 0.2])))
        if dim == 3:
            model.fix(f"{name}_FRONT", "y")
    # One period moves as the other, so that nodes at the ends are not held twice.
    for side, sign in (("B0_BOTTOM", 0.0), ("B1_TOP", -1.0)):
        model.prescribe(side, **{"xyz"[dim - 1]: sign * down})
    for name in ("B0", "B1"):
        node = int(model.mesh.points_of(f"{name}_LEFT")[0])
        model.relate([(node, "x", 1.0)])
    add_contact(random, draft, ("B1_BOTTOM", "B0_TOP"), down)
    return draft


def plate(random: Random) -> Draft:
    """A thin plate that is clamped on the left and bent down upon a support, or between its ends."""
    kinematics, dim, length = space(random)
    at, thickness = somewhere(random, dim), length * random.uniform(0.02, 0.1)
    down = thickness * 10.0 ** random.uniform(-2, -0.5)
    low, high = np.zeros(dim), np.full(dim, length)
    high[-1] = thickness
    if dim == 3:
        high[1] = 0.3 * length
    cells = (int(random.integers(4, 20)), *([2] if dim == 3 else []), int(random.integers(1, 3)))
    body = Body("B0", element_of(random, dim), low, high, cells, flat, flat)
    draft = begun(random, [body.mesh(at)], kinematics, ["B0"], length)
    draft.model.fix("B0_LEFT", "xyz"[:dim])
    if random.random() < 0.4:
        draft.model.fix("B0_RIGHT", "xyz"[:dim])
    up = at.direction(*[0.0] * (dim - 1), 1.0)
    tip = at.places(np.array([[0.7 * length, *([0.15 * length] if dim == 3 else []), 0.0]]))[0]
    R = float(length * random.uniform(0.2, 2.0))
    draft.model.add_pressure("B0_TOP", float(draft.stiffness * (thickness / length) ** 3 * down / length))
    add_obstacle(
        random, draft, "B0_BOTTOM", fc.obstacles.Sphere(tuple(tip - R * up), R), down, {"motion": vector(down * up)}
    )
    return draft


def wound(random: Random) -> Draft:
    """A press fit of a ring that is orthotropic round its axis."""
    kinematics, dim, R = space(random)
    deep = pressed_by(random, R) + 0.02 * R
    meshes = [polar(random, f"B{k}", (R * (0.6 + 0.4 * k), R * (1.0 + 0.4 * k)), 0.5 * np.pi, dim) for k in range(2)]
    draft = begun(random, meshes, kinematics, ["B0"], R)
    E = draft.stiffness * np.array([1.0, random.uniform(1, 10), 1.0])
    axes = fc.CylindricalAxes()
    G = tuple(0.4 * draft.stiffness * random.uniform(0.5, 1, 3))
    draft.model.add_material(fc.Orthotropic(E=tuple(E), nu=(0.1, 0.25, 0.1), G=G, axes=axes), ["B1"])
    for k in range(2):
        draft.model.fix(f"B{k}_LEFT", "y")
        draft.model.fix(f"B{k}_RIGHT", "x")
        if dim == 3:
            draft.model.fix(f"B{k}_FRONT", "z")
    draft.model.add_pressure("B0_BOTTOM", draft.stiffness * deep / R)
    add_contact(random, draft, ("B0_TOP", "B1_BOTTOM"), deep, friction=0.2)
    return draft


def bolted(random: Random) -> Draft:
    """Two blocks between a plate below and one above that a bolt pulls together: its section is a cut across it."""
    kinematics, dim, length = space(random)
    down = pressed_by(random, length)
    first, second = stack(random, dim, length)
    second = Body(**{**vars(second), "cells": (*second.cells[:-1], 2)})
    mesh = second.mesh(Placement(dim))
    middle = 0.75 * length
    mesh = mesh.with_facet_group("SECTION", lambda x: np.abs(x[:, -1] - middle) < 1e-9 * length, between=True)
    mesh = fc.generate.cut(mesh, "SECTION")
    draft = begun(random, [first.mesh(Placement(dim)), mesh], kinematics, ["B0", "B1"], length)
    model = draft.model
    supported(model, B0_BOTTOM="xyz"[:dim], B1_TOP="xyz"[:dim])
    if random.random() < 0.5:
        model.add_pretension("bolt", "SECTION", shortening=-down)
    else:
        area = length if dim == 2 else length**2
        model.add_pretension("bolt", "SECTION", force=-float(0.1 * draft.stiffness * down / length * area))
    add_contact(random, draft, ("B1_BOTTOM", "B0_TOP"), down)
    return draft


def coupled(random: Random) -> Draft:
    """A block on another one, its top coupled with a handle that is pushed and turned."""
    kinematics, dim, length = space(random)
    at, down = somewhere(random, dim), pressed_by(random, length)
    mesh = fc.generate.union(*(body.mesh(at) for body in stack(random, dim, length)))
    handle = at.places(np.array([[*np.full(dim - 1, 0.5 * length), 1.5 * length]]))[0]
    mesh = fc.generate.with_reference_points(mesh, {"HANDLE": tuple(handle)})
    draft = begun(random, [mesh], kinematics, ["B0", "B1"], length)
    model = draft.model
    model.fix("B0_BOTTOM", "xyz"[:dim])
    model.add_coupling("HANDLE", "B1_TOP", kind=str(random.choice(["rigid", "distributing"])))
    down_vector = at.direction(*[0.0] * (dim - 1), -1.0)
    if random.random() < 0.6:
        model.prescribe("HANDLE", **vector(down * down_vector))
        if dim == 3:
            model.fix("HANDLE rotation", "z", axes=tuple(map(tuple, at.Q.T)))
        size = 0.05 * draft.stiffness * down * length ** (dim - 1) * random.uniform(-1, 1)
        model.add_moment("HANDLE", **vector(at.direction(*(size * random.normal(size=2)), 0.0))) if dim == 3 else (
            model.add_moment("HANDLE", z=float(size))
        )
    else:
        model.fix("B1_LEFT", "normal")
        if dim == 3:
            model.fix("B1_FRONT", "normal")
        model.add_force("HANDLE", **vector(0.2 * draft.stiffness * down * length ** (dim - 2) * down_vector))
    add_contact(random, draft, ("B1_BOTTOM", "B0_TOP"), down)
    return draft


def heated(random: Random) -> Draft:
    """Two blocks between walls: what expands closes the gap."""
    kinematics, dim, length = space(random)
    at = somewhere(random, dim)
    bodies = stack(random, dim, length)
    draft = Draft(SpokenModel(fc.generate.union(*(body.mesh(at) for body in bodies)), kinematics), "", length, 1.0)
    model, rise = draft.model, 100.0
    own = [material(random, 10.0 ** random.uniform(0, 11)) for _ in bodies]
    for body, one in zip(bodies, own, strict=True):
        expanding = fc.LinearElastic(one.E, one.nu, expansion=float(10.0 ** random.uniform(-5.5, -4.5)))
        model.add_material(expanding, [body.name])
    draft.stiffness = min(one.E for one in own)
    draft.labels |= {"elements": " ".join(model.mesh.solids), "nu": max(one.nu for one in own)}
    if kinematics == "3d" and random.random() < 0.5:
        model.add_temperature(rise, ["B1"])
    else:
        model.add_temperature(rise)
    sides = ("LEFT", "FRONT")[: dim - 1]
    for body in bodies:
        for side in sides:
            model.fix(f"{body.name}_{side}", "normal")
    supported(model, B0_BOTTOM="normal", B1_TOP="normal")
    add_contact(random, draft, ("B1_BOTTOM", "B0_TOP"), 1e-3 * length)
    return draft


KINDS = (turning_obstacle, sector, period, plate, wound, bolted, coupled, heated)
