"""Families of random models: stacked layers, adjacent punches, and meshes of the generators."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import engineering
import generated
import numpy as np
from bodies import FLAT, SOLIDS, Array, Body, Placement, Random, flat, rotation
from drawing import Draft, add_contact, materials
from holding import hold, load
from wording import SpokenModel

import fastcontact as fc


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
    n = int(random.choice([2, 3, 4], p=[0.4, 0.4, 0.2]))
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
    draft = Draft(SpokenModel(mesh, kinematics), "layers", length, 1.0)
    draft.labels |= {"elements": " ".join(body.element for body in bodies), "bent": at.radius is not None}
    materials(random, draft, [body.name for body in bodies])
    hold(random, draft, bodies, at, pressed)
    for below, above in pairwise(bodies):
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
    if dim == 2:
        cells = (int(random.integers(2, 25 if element in ("tri3", "quad4") else 14)), int(random.integers(1, 7)))
    else:
        most = 7 if element in ("hex8", "tet4", "wedge6", "pyramid5") else 4
        cells = (*random.integers(1, most, 2).tolist(), int(random.integers(1, 4)))
    crown = -random.uniform(0, 0.15) / length if random.random() < 0.35 and name != "B0" else 0.0
    middle = 0.5 * (low[:-1] + high[:-1]) if start < 0 else low[:-1]
    under = partial(crowned, shares[0], middle, -crown)
    grading = (random.uniform(0.6, 1.6), random.uniform(0.7, 1.4)) if random.random() < 0.3 else (1.0, 1.0)
    return Body(name, element, low, high, cells, under, shares[1], grading, random.uniform(0, 0.2) if dim == 2 else 0.0)


def _of_solids() -> Array:
    shares = np.array([4, 2, 2, 2, 2, 1, 1, 1, 1, 1], float)
    return shares / shares.sum()


def punches(random: Random) -> Draft:
    """Return one to three blocks beside each other on a wide one."""
    kinematics = str(random.choice(["plane_strain", "plane_stress", "3d"], p=[0.45, 0.2, 0.35]))
    dim, length = 3 if kinematics == "3d" else 2, 10.0 ** random.uniform(-2, 3)
    at = replace(placement(random, dim, kinematics, length), radius=None)
    n = int(random.choice([1, 2, 3]))
    pressed = length * 10.0 ** random.uniform(-4, -2)
    bodies = [foundation(random, dim, length)]
    bodies += [punch(random, f"B{i + 1}", bodies[0], (i, n), kinematics) for i in range(n)]
    draft = Draft(
        SpokenModel(fc.generate.union(*(body.mesh(at) for body in bodies)), kinematics), "punches", length, 1.0
    )
    draft.labels |= {"elements": " ".join(body.element for body in bodies), "bent": False}
    materials(random, draft, [body.name for body in bodies])
    draft.model.fix("B0_BOTTOM", "xyz"[:dim])
    for body in bodies[1:]:
        load(random, draft, body, at, pressed)
        add_contact(random, draft, (f"{body.name}_BOTTOM", "B0_TOP"), pressed)
    return draft


def foundation(random: Random, dim: int, length: float) -> Body:
    """Return the block below, its top at the height 0."""
    size = length * np.array([1.0, 0.4] if dim == 2 else [1.0, 0.4, 0.4])
    low, high = np.zeros(dim), size.copy()
    low[-1], high[-1] = -size[-1], 0.0
    element = str(random.choice(FLAT if dim == 2 else SOLIDS, p=None if dim == 2 else _of_solids()))
    cells = (
        (int(random.integers(4, 28)), 3) if dim == 2 else (int(random.integers(3, 9)), int(random.integers(2, 5)), 2)
    )
    return Body("B0", element, low, high, cells, flat, flat, distortion=random.uniform(0, 0.2) if dim == 2 else 0.0)


def punch(random: Random, name: str, base: Body, place: tuple[int, int], kinematics: str) -> Body:
    """Return one of several blocks on the block below, the first sometimes standing out beyond its end."""
    dim, length = len(base.low), float(base.high[0])
    one = layer(random, name, dim, length, 0.0, (flat, flat), kinematics, Placement(dim))
    share = length / place[1]
    width = share * random.uniform(0.3, 0.8)
    start = share * (place[0] + random.uniform(0.0, 0.2)) - (0.2 * width if random.random() < 0.2 else 0.0)
    low, high = np.full(dim, start), np.full(dim, start + width)
    if dim == 3:
        low[1], high[1] = length * np.array([random.uniform(-0.1, 0.1), random.uniform(0.3, 0.5)])
    low[-1], high[-1] = 0.0, length * random.uniform(0.1, 0.4)
    crown = random.uniform(0, 0.3) / length if random.random() < 0.4 else 0.0
    under = partial(crowned, flat, 0.5 * (low[:-1] + high[:-1]), crown)
    return replace(one, low=low, high=high, under=under, over=flat)


FAMILIES = {
    "layers": Family(0.3, layers),
    "punches": Family(0.15, punches),
    "generated": Family(0.2, generated.build),
    "engineering": Family(0.35, engineering.build),
}
