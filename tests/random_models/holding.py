"""Supports and loads of random models."""

import numpy as np
from bodies import Body, Placement, Random
from drawing import Draft, add_obstacle

import fastcontact as fc


def slides(draft: Draft, name: str) -> None:
    """Let a body slide along its planes of symmetry."""
    model, dim = draft.model, draft.model.mesh.dim
    for side in ("LEFT", "FRONT")[: dim - 1]:
        if (
            model.kinematics == "axisymmetric"
            and np.abs(model.mesh.points[model.mesh.points_of(f"{name}_{side}"), 0]).max() == 0
        ):
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
        smooth = axisymmetric and not at.upright and random.random() < 0.5
        model.fix(f"{below}_BOTTOM", "y" if smooth else "xyz"[:dim])
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
    if (way in ("aside", "obstacle") and bent) or (way == "aside" and model.kinematics == "axisymmetric"):
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
