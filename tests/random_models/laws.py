"""Random models whose pairs have an interface law or another option that drawn models lack."""

from dataclasses import replace
from typing import Any

import numpy as np
from drawing import Drawn
from wording import SpokenModel

import fastcontact as fc

# What other options a law excludes.
EXCLUDED = {"adhesion": ("friction", "kind", "penalty"), "cohesion": ("friction", "kind", "penalty")}


def options(law: str, stress: float, length: float) -> dict[str, Any]:
    """Return the options of a pair with a law, for a model of given largest stress and displacement."""
    return {
        "adhesion": {"adhesion": {"strength": 0.5 * stress, "work": stress * length}},
        "cohesion": {"cohesion": {"strength": 0.5 * stress, "energy": stress * length}},
        "penalty": {"penalty": 10.0 * stress / length},
        "tangential penalty": {"friction": 0.3, "tangential_penalty": stress / length},
        "wear": {"friction": 0.3, "wear": 0.1 / stress},
        "friction ramp": {"friction": 0.3, "friction_ramp": ((0.0, 0.2), (0.5, 1.0), (2.0, 0.5))},
    }[law]


def with_law(given: Drawn, law: str) -> Drawn:
    """Return a drawn model all of whose pairs have a law."""
    last = fc.solve(given.model, given.ramp, **given.options)[-1]
    added = options(law, float(last.von_mises.max()) or 1.0, float(np.abs(last.displacement).max()) or 1.0)
    excluded = EXCLUDED.get(law, ("kind",))
    model = SpokenModel(given.model.mesh, given.model.kinematics, given.model.strain)
    for name, arguments, named in given.model.calls:
        if name == "add_contact" or (name == "add_obstacle" and law != "cohesion"):
            named = {key: value for key, value in named.items() if key not in excluded} | added
        getattr(model, name)(*arguments, **named)
    return replace(given, model=model, labels={**given.labels, "law": law})
