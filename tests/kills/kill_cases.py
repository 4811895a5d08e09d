"""Cases whose runs are killed: with and without friction, in two and three dimensions."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import feature_cases
from case_texts import spheres

ROOT = Path(__file__).resolve().parents[2]

# A quarter of a half-sphere is pressed on a block and then pushed along it, so that it sticks here and slides there.
RUBBING = """
title = "a part of a sphere rubs a block"
kinematics = "3d"
[mesh]
generator = "sphere-on-block"
R = 20.0
size = 8.0
contact_size = 1.2
contact_radius = 6.0
growth = 1.0
[[material]]
E = 20000.0
nu = 0.3
[[support]]
group = "BLOCK_BOTTOM"
x = 0.0
y = 0.0
z = 0.0
[[support]]
group = "SPHERE_TOP"
y = -0.6
z = 0.0
ramp = [[0.0, 0.0], [0.5, 1.0], [1.0, 1.0]]
[[support]]
group = "SPHERE_TOP"
x = 0.5
ramp = [[0.0, 0.0], [0.5, 0.0], [1.0, 1.0]]
[contact.pair]
secondary = "CONT_SPHERE"
primary = "CONT_BLOCK"
formulation = "node_to_segment"
friction = 0.3
[ramp]
steps = 12
"""


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
