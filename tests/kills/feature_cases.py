"""Small cases of all features with a history: nonlinear bodies, heat, cohesion, fluid, modes, supports that begin later."""

from pathlib import Path

from case_texts import COMING, CUBE, case_of, contact_pair, pressed, supports

LINEAR = "E = 1000.0\nnu = 0.3"
MESH = """generator = "block-on-block"
divisions_lower = [6, 3]
divisions_upper = [4, 2]
size_upper = [6.0, 3.0]
shift = 2.0"""


def _blocks(
    material: str = LINEAR, options: str = "", tail: str = "", top: str = "", down: float = -0.02, along: float = 0.02
) -> str:
    """Return a case of two blocks, of which the upper one is pressed down and then pushed to and fro."""
    lowered = {"y": down, "ramp": [[0.0, 0.0], [0.5, 1.0], [1.0, 0.8]]}
    pushed = {"x": along, "ramp": [[0.0, 0.0], [0.25, 0.0], [0.75, 1.0], [1.0, 0.5]]}
    tables = supports(UPPER_TOP=pushed) + contact_pair(options=options) + tail
    return f"{top}\n" + case_of(MESH, tables, material=material, ramp="steps = 6", LOWER_BOTTOM="xy", UPPER_TOP=lowered)


HOT = """[[fixed_temperature]]
group = "UPPER_TOP"
value = 120.0
ramp = [[0.0, 0.0], [0.5, 1.0], [1.0, 0.3]]
[[film]]
group = "LOWER_BOTTOM"
coefficient = 1.5
ambient = 20.0
"""
# Beside the block a wall, along which a fluid comes from the top.
WALL = """[obstacle.wall]
secondary = "UPPER_RIGHT"
shape = { kind = "half_space", point = [8.0, 0.0], normal = [-1.0, 0.0] }
[[fluid_pressure]]
contact = "wall"
pressure = 1.0
source = "UPPER_TOP"
"""
CONDUCTS = LINEAR + "\nconductivity = 50.0\nexpansion = 12e-6"
CASES = {
    "plastic": _blocks(LINEAR + "\nyield_stress = 3.0\nhardening = [[0.0, 3.0], [0.1, 9.0]]\nkinematic = 20.0"),
    "plastic with friction": _blocks(LINEAR + "\nyield_stress = 3.0", "friction = 0.3", along=0.05),
    "plastic, finite": _blocks(
        LINEAR + "\nyield_stress = 3.0\nhardening = [[0.0, 3.0], [0.1, 9.0]]",
        "friction = 0.3",
        top='strain = "finite"',
        down=-0.1,
        along=0.05,
    ),
    "rubber": _blocks(
        'law = "neo_hookean"\nE = 10.0\nnu = 0.45', "friction = 0.2", top='strain = "finite"', down=-0.3, along=0.2
    ),
    "ogden": _blocks(
        'law = "ogden"\nmu = [2.0]\nalpha = [2.5]\nbulk = 20.0', top='strain = "finite"', down=-0.3, along=0.1
    ),
    "heat": _blocks(CONDUCTS, "conductance = [[0.0, 0.1], [20.0, 40.0]]", HOT, "reference_temperature = 20.0"),
    "heat of friction": _blocks(
        CONDUCTS, "conductance = 5.0\nfriction = 0.3\nfriction_heat = 1.0", HOT, "reference_temperature = 20.0"
    ),
    "cohesive layer": _blocks(options="cohesion = {strength = 2.0, energy = 0.02}", down=0.03, along=0.02),
    "adhesion": _blocks(options="adhesion = {work = 0.02, strength = 1.0}", down=0.01, along=0.0),
    "fluid": _blocks(
        tail='[[fluid_pressure]]\ncontact = "pair"\npressure = 8.0\nsource = "UPPER_LEFT"\n', along=0.005, down=-0.05
    ),
    "heat, layer and fluid": _blocks(
        CONDUCTS,
        "cohesion = {strength = 2.0, energy = 0.02}\nconductance = 5.0",
        HOT + WALL,
        "reference_temperature = 20.0",
        down=0.03,
        along=0.02,
    ),
    "modes": _blocks(
        LINEAR + "\ndensity = 1e-9", tail="[modes]\nn = 3\nstress_stiffening = true\n", options="friction = 0.3"
    ),
    "friction ramp": _blocks(
        options="friction = 0.4\nfriction_ramp = [[0.0, 0.2], [0.5, 1.0], [1.0, 0.1]]", along=0.05
    ),
    "tangential penalty": _blocks(options="friction = 0.3\ntangential_penalty = 1e3", along=0.05),
    "wear": _blocks(options="wear = 1e-3", along=0.5),
    "hot rubber": _blocks(
        'law = "neo_hookean"\nE = 10.0\nnu = 0.45\nconductivity = 50.0\nexpansion = 1e-4',
        "conductance = 5.0",
        HOT,
        'strain = "finite"\nreference_temperature = 20.0',
        down=-0.3,
    ),
    "temporary supports": CUBE + COMING + pressed("", 100.0),
}


def written(name: str, folder: Path) -> Path:
    """Write a case by its name, a case file or a deck, and return its path."""
    path = folder / f"{name.replace(' ', '-')}{'.inp' if CASES[name].startswith('*') else '.toml'}"
    path.write_text(CASES[name], encoding="utf-8")
    return path
