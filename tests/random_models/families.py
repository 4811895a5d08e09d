"""The kinds of random models: layers on each other, punches beside each other, and what the generators make."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from drawing import Draft, add_contact, add_obstacle, material
from layers import FLAT, SOLIDS, Array, Body, Placement, Random, flat, rotation

import fastcontact as fc
import generated


@dataclass(frozen=True)
class Family:
    """How to build a model, and what part of all models it is."""

    share: float
    build: Callable[[Random], Draft]


def placement(random: Random, dim: int, kinematics: str, length: float) -> Placement:
    """Return where the bodies come to lie: as they are, or turned and shifted; layers may be bent or upright."""
    upright = kinematics == "axisymmetric" and random.random() < 0.4
    turned = kinematics != "axisymmetric" and random.random() < 0.35
    Q = rotation(random, dim) if turned else np.eye(3)
    shift = np.zeros(3)
    if random.random() < 0.3:
        shift = length * 10.0 ** random.uniform(-1, 2) * random.normal(size=3)
    if kinematics == "axisymmetric":
        shift[0] = 0.0
    radius = length * random.uniform(0.5, 4.0) if kinematics != "axisymmetric" and random.random() < 0.3 else None
    return Placement(dim, radius, upright, Q, shift)


def heights(random: Random, length: float, dim: int) -> Callable[[Array], Array]:
    """Return a height that both sides of an interface share: none, mostly."""
    if random.random() < 0.7:
        return flat
    amplitude, waves = length * random.uniform(0.02, 0.1), random.uniform(0.5, 2.0) / length

    def wave(x: Array) -> Array:
        return amplitude * np.sin(2 * np.pi * waves * x[:, 0]) * (np.cos(x[:, 1] / length) if dim == 3 else 1.0)

    return wave


def crowned(shared: Callable[[Array], Array], middle: Array, crown: float, x: Array) -> Array:
    """Return the shared height and a crown."""
    return shared(x) + crown * ((x - middle) ** 2).sum(axis=1)


def layers(random: Random) -> Draft:
    """Return two to four layers on each other."""
    kinematics = str(random.choice(["plane_strain", "plane_stress", "axisymmetric", "3d"], p=[0.3, 0.15, 0.25, 0.3]))
    dim, length = 3 if kinematics == "3d" else 2, 10.0 ** random.uniform(-2, 3)
    at = placement(random, dim, kinematics, length)
    n = int(random.choice([2, 3, 4], p=[0.55, 0.3, 0.15]))
    pressed = length * 10.0 ** random.uniform(-4, -1.7)
    shares = [heights(random, length, dim) for _ in range(n + 1)]
    shares[0] = shares[-1] = flat
    bodies, level = [], 0.0
    for i in range(n):
        bodies.append(layer(random, f"B{i}", dim, length, level, (shares[i], shares[i + 1]), kinematics, at))
        level = bodies[-1].high[-1] + (pressed * random.uniform(0, 1) if random.random() < 0.3 else 0.0)
    if at.upright:
        at = Placement(dim, None, True, at.Q, at.shift + np.array([length * random.choice([0.0, 0.5, 2.0]), 0, 0]))
    mesh = fc.generate.union(*(body.mesh(at) for body in bodies))
    draft = Draft(fc.Model(mesh, kinematics), "layers", length, 1.0)
    draft.labels |= {"elements": " ".join(body.element for body in bodies), "bent": at.radius is not None}
    materials(random, draft, [body.name for body in bodies])
    hold(random, draft, bodies, at, pressed)
    for below, above in zip(bodies[:-1], bodies[1:], strict=True):
        add_contact(random, draft, (f"{above.name}_BOTTOM", f"{below.name}_TOP"), pressed)
    return draft


def layer(
    random: Random, name: str, dim: int, length: float, level: float, shares: tuple, kinematics: str, at: Placement
) -> Body:
    """Return a layer on the height `level`."""
    width, height = length, length * random.uniform(0.2, 0.8)
    start = 0.0 if kinematics == "axisymmetric" else -0.5 * length
    if random.random() < 0.35 and not (at.upright and name == "B0"):  # partly covered
        width, start = length * random.uniform(0.5, 1.3), start + length * random.uniform(0.0, 0.3)
    low, high = np.full(dim, start), np.full(dim, start + width)
    low[-1], high[-1] = level, level + height
    element = str(random.choice(FLAT if dim == 2 else SOLIDS, p=None if dim == 2 else _of_solids()))
    fine = element in ("tri3", "quad4")
    cells = (int(random.integers(2, 13 if fine else 8)), int(random.integers(1, 5))) if dim == 2 else (
        *random.integers(1, 5 if element in ("hex8", "tet4", "wedge6", "pyramid5") else 3, 2).tolist(), int(random.integers(1, 3))
    )  # fmt: skip
    crown = -random.uniform(0, 0.15) / length if random.random() < 0.35 and name != "B0" else 0.0
    middle = 0.5 * (low[:-1] + high[:-1]) if start < 0 else low[:-1]
    under = partial(crowned, shares[0], middle, -crown)
    grading = (random.uniform(0.6, 1.6), random.uniform(0.7, 1.4)) if random.random() < 0.3 else (1.0, 1.0)
    return Body(
        name, element, low, high, cells, under, shares[1], grading, random.uniform(0, 0.2) if dim == 2 else 0.0
    )


def _of_solids() -> Array:
    shares = np.array([4, 2, 2, 2, 2, 1, 1, 1, 1, 1], float)
    return shares / shares.sum()


def materials(random: Random, draft: Draft, groups: list[str]) -> None:
    """Give every body a material of its own, or all the same."""
    unit = 10.0 ** random.uniform(0, 11)
    contrast = random.random() < 0.25
    own = random.random() < 0.6 or contrast
    first = material(random, unit, False)
    found = []
    for group in groups:
        found.append(material(random, unit, contrast and bool(found)) if own else first)
        draft.model.add_material(found[-1], [group])
    moduli = [one.E for one in found]
    draft.stiffness = min(moduli)
    draft.labels |= {"contrast": round(float(np.log10(max(moduli) / min(moduli))), 1), "nu": max(m.nu for m in found)}


def slides(draft: Draft, name: str) -> None:
    """Let a body slide along its planes of symmetry."""
    model, dim = draft.model, draft.model.mesh.dim
    for side in ("LEFT", "FRONT")[: dim - 1]:
        if model.kinematics == "axisymmetric" and np.abs(model.mesh.points[model.mesh.points_of(f"{name}_{side}"), 0]).max() == 0:
            continue  # the axis
        model.fix(f"{name}_{side}", "normal")


def hold(random: Random, draft: Draft, bodies: list[Body], at: Placement, pressed: float) -> None:
    """Hold the lowest body, let the others slide along their left sides, and press on the last one."""
    model, dim = draft.model, draft.model.mesh.dim
    straight = at.radius is None and not at.upright
    axisymmetric = model.kinematics == "axisymmetric"
    below = bodies[0].name
    tube_without_hole = at.upright and np.abs(model.mesh.points[model.mesh.points_of(f"{below}_BOTTOM"), 0]).max() == 0
    if straight and random.random() < 0.1:
        draft.labels["stands on"] = "obstacle"
        plane = fc.obstacles.HalfSpace(
            tuple(at.places(np.zeros((1, dim)))[0]), tuple(at.direction(*[0.0] * (dim - 1), 1.0))
        )
        add_obstacle(random, draft, f"{below}_BOTTOM", plane, 0.0, {})
        slides(draft, below)
    elif tube_without_hole:
        model.fix(f"{below}_LEFT", "y")
    else:
        model.fix(f"{below}_BOTTOM", "xyz"[:dim] if not axisymmetric or random.random() < 0.5 else "y" if not at.upright else "xy")
    for body in bodies[1:-1]:
        sliding(draft, body.name, at)
    load(random, draft, bodies[-1], at, pressed)


def sliding(draft: Draft, name: str, at: Placement) -> None:
    if at.upright:
        draft.model.fix(f"{name}_LEFT", "y")
    else:
        slides(draft, name)


def load(random: Random, draft: Draft, body: Body, at: Placement, pressed: float) -> None:
    """Press on the top of a body: by its displacement, a pressure, or a rigid obstacle."""
    model, dim, top = draft.model, draft.model.mesh.dim, f"{body.name}_TOP"
    height = body.high[-1]
    way = str(random.choice(["displacement", "pressure", "aside", "obstacle"], p=[0.4, 0.25, 0.2, 0.15]))
    bent = at.radius is not None or at.upright
    if way in ("aside", "obstacle") and bent or way == "aside" and model.kinematics == "axisymmetric":
        way = "displacement"
    draft.labels["loaded by"] = way
    if way == "aside":
        vector = at.direction(*(pressed * random.uniform(-1, 1, dim - 1)), -pressed)
        model.prescribe(top, **{"xyz"[k]: float(vector[k]) for k in range(dim)})
        return
    sliding(draft, body.name, at)
    if way == "displacement":
        model.prescribe(top, normal=-pressed)
    elif way == "pressure":
        model.add_pressure(top, draft.stiffness * pressed / height * random.uniform(0.1, 1.0))
    else:
        normal = at.direction(*[0.0] * (dim - 1), -1.0)
        tip = np.array([*(0.5 * (body.low + body.high))[:-1], height])
        if model.kinematics == "axisymmetric":
            tip[0] = 0.0
        tip = at.places(tip[None])[0]
        R = draft.length * random.uniform(0.5, 5.0)
        shape = (
            fc.obstacles.HalfSpace(tuple(tip), tuple(normal))
            if random.random() < 0.4
            else fc.obstacles.Sphere(tuple(tip - R * normal), float(R))
        )
        motion = {"xyz"[k]: float(pressed * normal[k]) for k in range(dim)}
        add_obstacle(random, draft, top, shape, pressed, {"motion": motion})


def punches(random: Random) -> Draft:
    """Return one to three blocks beside each other on a wide one."""
    kinematics = str(random.choice(["plane_strain", "plane_stress", "3d"], p=[0.45, 0.2, 0.35]))
    dim, length = 3 if kinematics == "3d" else 2, 10.0 ** random.uniform(-2, 3)
    at = placement(random, dim, kinematics, length)
    at = Placement(dim, None, False, at.Q, at.shift)
    n = int(random.integers(1, 4))
    pressed = length * 10.0 ** random.uniform(-4, -2)
    base = layer(random, "B0", dim, length, -0.5 * length, (flat, flat), kinematics, at)
    base = Body("B0", base.element, np.array([0.0, 0.0, -0.4 * length])[-dim:] if dim == 3 else np.array([0.0, -0.4 * length]),
                length * np.array([1.0, 0.4, 0.0])[[0, 1, 2] if dim == 3 else [0, 2]],
                ((int(random.integers(4, 14)), 3) if dim == 2 else (int(random.integers(3, 7)), 2, 1)), flat, flat, base.grading,
                base.distortion)  # fmt: skip
    bodies = [base]
    for i in range(n):
        one = layer(random, f"B{i + 1}", dim, length, 0.0, (flat, flat), kinematics, at)
        width = length / n * random.uniform(0.3, 0.8)
        start = length / n * (i + random.uniform(0.0, 0.2)) - (0.2 * width if random.random() < 0.2 else 0.0)
        low, high = np.full(dim, start), np.full(dim, start + width)
        if dim == 3:
            low[1], high[1] = length * np.array([random.uniform(-0.1, 0.1), random.uniform(0.3, 0.5)])
        low[-1], high[-1] = 0.0, length * random.uniform(0.1, 0.4)
        middle = 0.5 * (low[:-1] + high[:-1])
        crown = random.uniform(0, 0.3) / length if random.random() < 0.4 else 0.0
        bodies.append(Body(one.name, one.element, low, high, one.cells, partial(crowned, flat, middle, crown), flat))
    draft = Draft(fc.Model(fc.generate.union(*(body.mesh(at) for body in bodies)), kinematics), "punches", length, 1.0)
    draft.labels |= {"elements": " ".join(body.element for body in bodies), "bent": False}
    materials(random, draft, [body.name for body in bodies])
    draft.model.fix("B0_BOTTOM", "xyz"[:dim])
    for body in bodies[1:]:
        load(random, draft, body, at, pressed)
        if len(draft.model.contact) < 3:
            add_contact(random, draft, (f"{body.name}_BOTTOM", "B0_TOP"), pressed)
        else:
            draft.model.fix(f"{body.name}_BOTTOM", "xyz"[:dim])
    return draft


FAMILIES = {"layers": Family(0.5, layers), "punches": Family(0.2, punches), "generated": Family(0.3, generated.build)}
