"""Cases whose runs are killed: with and without friction, in two and three dimensions."""

from dataclasses import dataclass
from pathlib import Path

import feature_cases
from case_texts import case_of, contact_pair, spheres, supports

ROOT = Path(__file__).resolve().parents[2]

# A quarter of a half-sphere is pressed on a block and then pushed along it, so that it sticks here and slides there.
MESH = """generator = "sphere-on-block"
R = 20.0
size = 8.0
contact_size = 1.2
contact_radius = 6.0
growth = 1.0"""
PRESSED = {"y": -0.6, "z": 0.0, "ramp": [[0.0, 0.0], [0.5, 1.0], [1.0, 1.0]]}
PUSHED = {"x": 0.5, "ramp": [[0.0, 0.0], [0.5, 0.0], [1.0, 1.0]]}
PAIR = contact_pair("CONT_SPHERE", "CONT_BLOCK", 'formulation = "node_to_segment"\nfriction = 0.3')
RUBBING = case_of(
    MESH, supports(SPHERE_TOP=PUSHED) + PAIR, "3d", "E = 20000.0\nnu = 0.3", "steps = 12",
    BLOCK_BOTTOM="xyz", SPHERE_TOP=PRESSED,
)  # fmt: skip


@dataclass(frozen=True)
class KilledCase:
    """A case file, and how far apart the ends of an interrupted and of an uninterrupted run may be (relative)."""

    path: Path
    tolerance: float


def prepared(name: str, folder: Path) -> KilledCase:
    """Return a case by its name: "forma04c", "friction", "small", or a feature's; case files of our own go to `folder`."""
    if name == "forma04c":
        return KilledCase(ROOT / "data" / "cases" / "forma04c.toml", 1e-12)
    if name in feature_cases.CASES:
        return KilledCase(feature_cases.written(name, folder), 0.0)
    path = folder / f"{name}.toml"
    path.write_text({"friction": RUBBING, "small": spheres(6.0, 12)}[name], encoding="utf-8")
    return KilledCase(path, 1e-10 if name == "friction" else 1e-12)
