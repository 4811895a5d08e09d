"""Random models on meshes of the generators: discs, spheres, cylinders, rings, graded and crowned blocks."""

import numpy as np
from bodies import FLAT, Random
from drawing import Draft, add_contact, add_obstacle, materials
from models import supported
from wording import SpokenModel

import fastcontact as fc

SQUARE, CUT = ("quad4", "quad8", "quad9"), ("hex8", "hex20", "hex27", "tet4", "tet10")


def build(random: Random) -> Draft:
    """Return one of them."""
    kinds = (discs, cylinder, sphere, rings, crowned, on_obstacle, indented, punched)
    made = kinds[int(random.integers(len(kinds)))]
    draft = made(random)
    draft.labels["family"] = made.__name__
    return draft


def begun(random: Random, mesh: fc.Mesh, kinematics: str, bodies: list[str], length: float, element: str) -> Draft:
    """Return a model with materials."""
    draft = Draft(SpokenModel(mesh, kinematics), "", length, 1.0)
    materials(random, draft, bodies)
    draft.labels["elements"] = element
    return draft


def sizes(random: Random) -> tuple[float, str, float]:
    """Return a length, an element of the plane, and an approach as part of the length."""
    return 10.0 ** random.uniform(-2, 3), str(random.choice(FLAT)), 10.0 ** random.uniform(-4, -1.3)


def disc_options(random: Random, element: str, R: float) -> dict:
    if element.startswith("tri"):
        return {"size": R / random.integers(4, 9), "contact_size": R / random.integers(10, 40)}
    near, far = R / random.integers(10, 40), R / random.integers(4, 8)
    return {"arc_sizes": (near, far), "radial_sizes": (near, far), "segments": int(random.integers(2, 5))}


def discs(random: Random) -> Draft:
    """Two half-spheres, or half-cylinders."""
    R, element, part = sizes(random)
    parts = [fc.generate.quarter_disc(element, body="lower", R=R, **disc_options(random, element, R))]
    options = disc_options(random, element, R) if random.random() < 0.5 else None
    other = fc.generate.quarter_disc(element, body="upper", R=R, **options) if options else fc.generate.mirrored(
        parts[0], "y", rename={"SPHBAS": "SPHHAU", "CONT1": "CONT2", "A1B1": "A2B2"}
    )  # fmt: skip
    kinematics = str(random.choice(["axisymmetric", "axisymmetric", "plane_strain", "plane_stress"]))
    draft = begun(random, fc.generate.union(*parts, other), kinematics, ["SPHBAS", "SPHHAU"], R, element)
    model = draft.model
    supported(model, A1A2="x", A1B1="y")
    if random.random() < 0.7:
        model.prescribe("A2B2", y=-part * R)
    else:
        model.add_pressure("A2B2", draft.stiffness * part**1.5)
        model.couple("A2B2", "y")
    add_contact(random, draft, ("CONT1", "CONT2"), part * R)
    return draft


def cylinder(random: Random) -> Draft:
    """Half a cylinder on a block."""
    R, element, part = sizes(random)
    near = R / random.integers(10, 40)
    mesh = fc.generate.cylinder_on_block(
        element, R=R, size=R / random.integers(3, 7), contact_size=near, block_size=(1.5 * R, R)
    )
    kinematics = str(random.choice(["plane_strain", "plane_stress", "axisymmetric"]))
    draft = begun(random, mesh, kinematics, ["CYLINDER", "BLOCK"], R, element)
    model = draft.model
    if random.random() < 0.3 and kinematics != "axisymmetric":
        supported(model, BLOCK_BOTTOM="xy", CYLINDER_TOP={"x": part * R * random.uniform(-1, 1), "y": -part * R})
    else:
        supported(model, AXIS="x", BLOCK_BOTTOM="y", CYLINDER_TOP={"y": -part * R})
    add_contact(random, draft, ("CONT_CYLINDER", "CONT_BLOCK"), part * R)
    return draft


def sphere(random: Random) -> Draft:
    """A quarter of half a sphere on a block."""
    R, _, part = sizes(random)
    element = str(random.choice(CUT, p=[0.35, 0.1, 0.05, 0.4, 0.1]))
    quadratic = element not in ("hex8", "tet4")
    mesh = fc.generate.sphere_on_block(
        element, R=R, size=R / (1.5 if quadratic else random.uniform(2, 3)),
        contact_size=R / (3 if quadratic else random.uniform(5, 8)), contact_radius=R / 5, growth=1.0,
        block_size=(0.8 * R, 0.5 * R),
    )  # fmt: skip
    draft = begun(random, mesh, "3d", ["SPHERE", "BLOCK"], R, element)
    supported(draft.model, SYMMETRY_X="x", SYMMETRY_Z="z", BLOCK_BOTTOM="y", SPHERE_TOP={"y": -part * R})
    add_contact(random, draft, ("CONT_SPHERE", "CONT_BLOCK"), part * R)
    return draft


def rings(random: Random) -> Draft:
    """A press fit, or a ring pressed outward against another one."""
    R, element, part = sizes(random)
    n = random.integers(4, 14, 2) if random.random() < 0.6 else np.full(2, random.integers(4, 14))
    mesh = fc.generate.rings(
        element, inner_radius=R * random.uniform(0.3, 0.8), interface_radius=R, outer_radius=R * random.uniform(1.2, 2.0),
        divisions_inner=(int(random.integers(1, 5)), int(n[0])), divisions_outer=(int(random.integers(1, 5)), int(n[1])),
    )  # fmt: skip
    draft = begun(random, mesh, str(random.choice(["plane_strain", "plane_stress"])), ["INNER", "OUTER"], R, element)
    model = draft.model
    supported(model, SYMMETRY_X="x", SYMMETRY_Y="y")
    # Chords lie closer to their arcs than the bodies are pressed into each other.
    sag = 0.5 * (0.5 * np.pi / (n.min() * (1 if element in ("tri3", "quad4") else 2))) ** 2 / 4
    pressed = R * (sag + part / 10)
    if random.random() < 0.5:
        add_contact(random, draft, ("CONT_INNER", "CONT_OUTER"), 0.3 * pressed, clearance=-2 * pressed)
    else:
        model.add_pressure("BORE", draft.stiffness * 2 * pressed / R)
        add_contact(random, draft, ("CONT_INNER", "CONT_OUTER"), 0.2 * pressed)
    return draft


def crowned(random: Random) -> Draft:
    """Two crowned blocks, pressed and moved aside."""
    R, _, part = sizes(random)
    element = str(random.choice(SQUARE))
    a = R * np.sqrt(part)
    mesh = fc.generate.crowned_blocks(
        element, R=R, extent=4 * a, contact_radius=a, contact_size=a / random.integers(3, 7), growth=2.0
    )
    draft = begun(random, mesh, str(random.choice(["plane_strain", "plane_stress"])), ["LOWER", "UPPER"], R, element)
    model, down = draft.model, part * R / 4
    model.fix("FAR_LOWER", "xy")
    model.prescribe("FAR_UPPER", x=float(down * random.choice([0.0, random.uniform(-0.5, 0.5)])), y=-down)
    add_contact(random, draft, ("CONT_LOWER", "CONT_UPPER"), down)
    return draft


def on_obstacle(random: Random) -> Draft:
    """Half a cylinder or sphere on a rigid shape that moves up."""
    R, element, part = sizes(random)
    if random.random() < 0.6:
        mesh = fc.generate.quarter_disc(element, R=R, **disc_options(random, element, R))
        kinematics = str(random.choice(["plane_strain", "plane_stress", "axisymmetric"]))
        draft = begun(random, mesh, kinematics, ["SPHBAS"], R, element)
        draft.model.fix("A1A2", "x")
        draft.model.fix("A1B1", "y")
        shapes = [
            fc.obstacles.HalfSpace((0.0, 0.0), (0.0, -1.0)),
            fc.obstacles.Sphere((0.0, R), R),
            fc.obstacles.Sphere((0.0, -3 * R), 3 * R, hollow=True),
            fc.obstacles.paraboloid(R),
            fc.obstacles.cone(0.1),
        ]
        shape = shapes[int(random.integers(len(shapes)))]
        driven = (
            {"motion": {"y": -part * R}} if random.random() < 0.7 else {"force": {"y": -draft.stiffness * R * R * part}}
        )
        add_obstacle(random, draft, "CONT1", shape, part * R, driven)
        return draft
    element = str(random.choice(["hex8", "tet4"]))
    mesh = fc.generate.sphere_octant(
        element, R=R, size=R / 3, contact_size=R / random.uniform(6, 12), contact_radius=R / 5
    )
    draft = begun(random, mesh, "3d", ["SPHERE"], R, element)
    draft.model.fix("SYMMETRY_X", "x")
    draft.model.fix("SYMMETRY_Z", "z")
    draft.model.fix("SPHERE_TOP", "y")
    shape = fc.obstacles.HalfSpace((0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    add_obstacle(random, draft, "CONT_SPHERE", shape, part * R, {"motion": {"y": part * R}})
    return draft


def indented(random: Random) -> Draft:
    """A graded block under a ball, a paraboloid, a cone, a cylinder or a flat punch."""
    width, _, part = sizes(random)
    solid = random.random() < 0.4
    element = str(random.choice(CUT, p=[0.4, 0.1, 0.05, 0.35, 0.1]) if solid else random.choice(FLAT))
    fine = 0.1 if not solid else 0.25
    mesh = fc.generate.graded_block(
        element, width=width, contact_radius=0.25 * width, contact_size=fine * 0.5 * width, size=0.3 * width, growth=1.0
    )
    kinematics = "3d" if solid else str(random.choice(["plane_strain", "plane_stress", "axisymmetric"]))
    draft = begun(random, mesh, kinematics, ["BLOCK"], width, element)
    up = "xyz"[mesh.dim - 1]
    draft.model.fix("BOTTOM", up)
    draft.model.fix("SYMMETRY_X", "x")
    if solid:
        draft.model.fix("SYMMETRY_Y", "y")
    R = width * random.uniform(0.5, 4)
    shapes = [
        fc.obstacles.Sphere((0.0,) * (mesh.dim - 1) + (R,), R),
        fc.obstacles.paraboloid(R),
        fc.obstacles.cone(random.uniform(0.05, 0.3)),
        fc.obstacles.FlatPunch(0.25 * width),
        fc.obstacles.Cylinder((0.0, 0.0, R), (0.0, 1.0, 0.0), R) if solid else fc.obstacles.paraboloid(2 * R),
    ]
    shape = shapes[int(random.integers(len(shapes)))]
    if random.random() < 0.7:
        driven = {"motion": {up: -part * width / 2}}
    else:
        driven = {
            "force": {up: -draft.stiffness * width ** (2 if kinematics in ("3d", "axisymmetric") else 1) * part / 5}
        }
    add_obstacle(random, draft, "TOP", shape, part * width / 2, driven)
    return draft


def punched(random: Random) -> Draft:
    """A block under a flat punch whose edge is a node."""
    a, _, part = sizes(random)
    element = str(random.choice(SQUARE))
    mesh = fc.generate.punched_block(
        element, punch_radius=a, extent=8 * a, edge_size=a / random.integers(4, 15), growth=random.uniform(1.5, 2.5)
    )
    kinematics = str(random.choice(["plane_strain", "plane_stress", "axisymmetric"]))
    draft = begun(random, mesh, kinematics, ["BLOCK"], a, element)
    draft.model.fix("BOTTOM", "y")
    draft.model.fix("SYMMETRY_X", "x")
    side = str(random.choice(["PUNCHED", "TOP"]))
    add_obstacle(random, draft, side, fc.obstacles.FlatPunch(a), part * a, {"motion": {"y": -part * a}})
    return draft
