"""Random models of nonlinear bodies: two blocks, or a block below a rigid ball; invariants of their results.

Of two blocks, the second may be of another material, and be pressed by a force and let go by half in place of a displacement.

`python tests/random_models/nonlinear.py FIRST COUNT` prints a line for each seed.
"""

import sys
import time
import warnings
from typing import Any

import numpy as np
from bodies import FLAT, SOLIDS, Random
from wording import SpokenModel, reworded

import fastcontact as fc

# Out of balance over the largest force, and moments of bodies over that times their size; change by other words, over the
# largest displacement; missing in the work of a step over the largest energy.
BALANCE, SAME, WORK = 2e-6, 1e-6, 0.02
INSTANTS = [1 / 3, 2 / 3, 1.0]


def law(random: Random, kinds: range = range(6)) -> tuple[fc.ElasticPlastic | fc.NeoHookean, str]:
    """Return a material with a shear modulus of about 1, and the strain that it is for; of one of the `kinds`."""
    mu, bulk = random.uniform(0.5, 2.0), 10.0 ** random.uniform(0.5, 3.0)
    kind = int(random.integers(kinds.start, kinds.stop))
    if kind == 0:
        hardening = [(0.0, 0.02 * mu), (0.05, 0.03 * mu)] if random.random() < 0.5 else []
        kinematic = 0.0 if hardening and random.random() < 0.5 else random.uniform(0.02, 0.2) * mu
        plastic = fc.ElasticPlastic(3.0 * mu, 0.3, yield_stress=0.02 * mu, hardening=hardening, kinematic=kinematic)
        return plastic, "small" if kinematic else "finite"
    laws = [
        fc.NeoHookean(E=3.0 * mu, nu=float(random.choice([0.3, 0.45, 0.499]))),
        fc.MooneyRivlin(0.35 * mu, 0.15 * mu, bulk=bulk),
        fc.Yeoh(0.5 * mu, -0.01 * mu, 0.005 * mu, bulk=bulk),
        fc.Ogden([0.7 * mu, 0.3 * mu], [2.5, -1.5], bulk=bulk),
        fc.LinearElastic(3.0 * mu, 0.3),
    ]
    return laws[kind - 1], "finite"


def block(random: Random, name: str, dim: int, level: float, cells: int) -> fc.Mesh:
    """Return a block one wide and half as high whose sides have the `name` before them; corners are not at cubes' places."""
    element = str(random.choice(SOLIDS if dim == 3 else FLAT))
    if dim == 3:
        coarse = 1 + cells // 2
        mesh = fc.generate.box(
            (1.0, 1.0, 0.5), (coarse, coarse, 1), element=element, origin=(0.0, 0.0, level), name=name
        )
        sides = {"ZMIN": "BOTTOM", "ZMAX": "TOP", "XMIN": "LEFT", "YMIN": "FRONT"}
    else:
        mesh = fc.generate.block((1.0, 0.5), (cells, cells // 2), element=element, origin=(0.0, level), name=name)
        sides = {"BOTTOM": "BOTTOM", "TOP": "TOP", "LEFT": "LEFT"}
    x = mesh.points.copy()
    x[:, 0] += 0.1 * random.uniform(-1, 1) * np.sin(np.pi * x[:, 0]) * np.sin(2.0 * np.pi * (x[:, -1] - level))
    return fc.generate.renamed(mesh.replace(points=x), {old: f"{name}_{new}" for old, new in sides.items()})


def drawn(seed: int) -> SpokenModel:
    """Return the model of a seed."""
    random = np.random.default_rng([seed, 32])
    kinematics = str(random.choice(["plane_strain", "plane_stress", "axisymmetric", "3d"]))
    dim, (material, strain) = 3 if kinematics == "3d" else 2, law(random)
    pressed = 0.5 * random.uniform(0.02, 0.15 if strain == "finite" else 0.02)
    friction = float(random.uniform(0.1, 0.5)) if random.random() < 0.5 else None
    two, cells = random.random() < 0.6, int(random.integers(4, 7))
    lower = block(random, "A", dim, 0.0, cells)
    mesh = fc.generate.union(lower, block(random, "B", dim, 0.5, cells + 1)) if two else lower
    model = SpokenModel(mesh, kinematics, strain)
    more = np.random.default_rng([seed, 33])
    if two and more.random() < 0.5:
        other = law(more, range(1, 6))[0] if strain == "finite" else fc.LinearElastic(more.uniform(3.0, 30.0), 0.3)
        model.add_material(material, "A")
        model.add_material(other, "B")
    else:
        model.add_material(material)
    up, along = "xyz"[dim - 1], "xyz"[: dim - 1]
    model.fix("A_BOTTOM", along + up)
    if kinematics != "axisymmetric" and two:
        model.fix("B_TOP", along[1:]) if dim == 3 else None
    if two:
        drawn_by = pressed * random.uniform(-0.5, 0.5) * (kinematics != "axisymmetric")
        if more.random() < 0.5:
            model.prescribe("B_TOP", **{up: -pressed, "x": drawn_by})
        else:
            model.prescribe("B_TOP", x=drawn_by)
            # In plane stress, blocks that yield bear hardly more than the largest yield stress.
            plastic = isinstance(material, fc.ElasticPlastic)
            stress = 1.3 * material.yield_stress if plastic else 4.0 * pressed
            model.add_traction("B_TOP", **{up: -stress}, ramp=[(0.0, 0.0), (0.7, 1.0), (1.0, 0.5)])
        model.add_contact("joint", secondary="B_BOTTOM", primary="A_TOP", friction=friction)
    else:
        centre = np.array([0.0 if kinematics == "axisymmetric" else 0.45, 0.55, 0.0])[:dim]
        centre[-1] = 0.5 + 0.8
        ball = fc.obstacles.Sphere(tuple(centre), 0.8)
        model.add_obstacle("ball", secondary="A_TOP", obstacle=ball, motion={up: -pressed}, friction=friction)
    return model


def outcome(seed: int) -> dict[str, Any]:
    """Return what became of the model of a seed: figures, and which of them are wrong."""
    begin, model = time.process_time(), drawn(seed)
    row: dict[str, Any] = {
        "seed": seed, "kinematics": model.kinematics, "elements": list(model.mesh.solids),
        "law": type(model.materials[0][0]).__name__, "wrong": [],
    }  # fmt: skip
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fc.FastcontactWarning)
        try:
            last = fc.solve(model, INSTANTS)[-1]
        except fc.FastcontactError as error:
            return row | {"error": f"{type(error).__name__}: {error}"}
        row |= figures(model, last)
        try:
            again = reworded(model, np.random.default_rng([seed, 7]))
            other = None if again is None else fc.solve(again.model, INSTANTS)[-1]
        except fc.FastcontactError as error:
            # In other words, a model that has a result must not fail.
            return row | {"error": f"{type(error).__name__}: {error}", "wrong": ["said again"]}
        if again is not None and other is not None:
            apart = np.abs(again.back(other.displacement) - last.displacement).max()
            apart /= np.abs(last.displacement).max() or 1.0  # a ball between coarse nodes may touch none
            row |= {"words": again.words, "said again": float(apart)}
    bounds = {"balance": BALANCE, "moment": BALANCE, "said again": SAME, "work": WORK}
    if any("energy of these load steps is out of balance" in text for text in last.warnings):
        bounds.pop("work")  # it is told, with the number
    row["wrong"] = [name for name, bound in bounds.items() if not row.get(name, 0.0) <= bound]
    return row | {
        "closed": sum(int(c.active.sum()) for c in last.contact.values()),
        "seconds": time.process_time() - begin,
    }


def figures(model: fc.Model, step: fc.StepResult) -> dict[str, float]:
    """Return how much of forces and of their moments nothing balances, and what is missing in the balance of work."""
    loads = [
        force * (np.interp(step.load_factor, *np.transpose(ramp)) if ramp else 1.0)
        for ramp, force in model.forces_by_ramp().items()
    ]
    contact = np.zeros_like(step.displacement)
    for pair in step.contact.values():
        np.add.at(contact, pair.points, pair.force_vectors)
        if pair.primary_points is not None and len(pair.primary_points):
            np.add.at(contact, pair.primary_points, pair.primary_force_vectors)
    outer = sum(loads, step.reaction + contact)
    size = max(np.abs(contact).max(), np.abs(step.reaction).max())
    bodies = [model.mesh.points_of(name) for name in "AB" if name in model.mesh.group_names]
    of_bodies = np.array([outer[points].sum(axis=0) for points in bodies])
    off = np.abs(of_bodies[:, 1:] if model.kinematics == "axisymmetric" else of_bodies).max()
    arms = model.mesh.points + (step.displacement if model.strain == "finite" else 0.0)
    moments = [np.abs(moment(arms[points], outer[points])).max() for points in bodies]
    if not any(isinstance(law, fc.ElasticPlastic) for law, _ in model.materials) and model.strain == "finite":
        # Nodes, too: internal forces depend on the displacements alone.
        off = max(off, np.abs(model.internal_forces(step.displacement) - outer).max())
    turning = 0.0 if model.kinematics == "axisymmetric" else max(moments)
    work = step.work
    energies = [abs(work[name]) for name in ("strain_energy", "external_work", "friction_work")]
    return {
        "balance": float(off / size) if size else 0.0, "moment": float(turning / size) if size else 0.0,
        "work": abs(work["imbalance"]) / (max(energies) or 1.0),
    }  # fmt: skip


def moment(arms: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Return the moment of forces (n, dim) about the origin (1 or 3,)."""
    if arms.shape[1] == 2:
        return np.array([(arms[:, 0] * forces[:, 1] - arms[:, 1] * forces[:, 0]).sum()])
    return np.cross(arms, forces).sum(axis=0)


if __name__ == "__main__":
    first, count = map(int, sys.argv[1:])
    for number in range(first, first + count):
        print(outcome(number), flush=True)
