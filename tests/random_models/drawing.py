"""A random contact model from a seed."""

import logging
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from bodies import Random
from wording import SpokenModel

import fastcontact as fc

log = logging.getLogger(__name__)
# Unknowns beyond which a model is drawn again.
LARGEST = 3000


@dataclass
class Draft:
    """A model that is being built, with what the table of results tells about it."""

    model: SpokenModel
    family: str
    length: float
    stiffness: float
    labels: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Drawn:
    """A model and how to solve it."""

    seed: int
    model: SpokenModel
    ramp: fc.Ramp
    options: dict[str, Any]
    labels: dict[str, Any]


def drawn(seed: int) -> Drawn:
    """Return the model of a seed; what the package refuses while it is built raises its errors."""
    from families import FAMILIES

    for attempt in range(20):
        random = np.random.default_rng([seed, attempt])
        family = str(random.choice(list(FAMILIES), p=[one.share for one in FAMILIES.values()]))
        try:
            draft = FAMILIES[family].build(random)
        except fc.MeshError as error:  # a crown that turned cells inside out, a size beyond what a generator takes
            log.info("seed %d: %s", seed, error)
            continue
        if draft.model.n_dofs <= LARGEST:
            break
    labels = {"family": family, "kinematics": draft.model.kinematics, "dofs": draft.model.n_dofs, **draft.labels}
    labels["pairs"] = len(draft.model.contact)
    labels["formulation"] = "; ".join(sorted({pair.method for pair in draft.model.contact}))
    return Drawn(seed, draft.model, ramp(random), solving(random), labels)


def ramp(random: Random) -> fc.Ramp:
    """Return one to three steps up, or a step up and one half back."""
    if random.random() < 0.15:
        return fc.Ramp((1.0, 2.0), ((0.0, 0.0), (1.0, 1.0), (2.0, 0.5)))
    return fc.linear_ramp(int(random.choice([1, 1, 2, 3])))


def solving(random: Random) -> dict[str, Any]:
    """Return options of `solve`: none, mostly."""
    return {"linear_solver": str(random.choice(["amg", "direct"]))} if random.random() < 0.15 else {}


def material(random: Random, unit: float, decades: tuple[float, float] = (-0.5, 0.5)) -> fc.LinearElastic:
    """Return a material; its modulus is `unit` times a power of ten between two `decades`."""
    nu = float(random.choice([0.3, 0.3, 0.3, 0.0, random.uniform(0, 0.45), 0.49, 0.499, 0.4999]))
    return fc.LinearElastic(float(unit * 10.0 ** random.uniform(*decades)), nu)


def materials(random: Random, draft: Draft, groups: list[str]) -> None:
    """Give every body a material of its own, or all the same; a quarter of the models mix moduli up to 1 to 1e6."""
    unit = 10.0 ** random.uniform(0, 11)
    contrast = random.random() < 0.25
    lowest = random.uniform(-3, 0)
    decades = (lowest, lowest + 6) if contrast else (-0.5, 0.5)
    same = random.random() < 0.4 and not contrast
    found = [material(random, unit, decades) for _ in groups]
    for k, group in enumerate(groups):
        draft.model.add_material(found[0 if same else k], [group])
    given = [own for own, _ in draft.model.materials]
    moduli = [own.E for own in given]
    draft.stiffness = min(moduli)
    draft.labels |= {"contrast": round(float(np.log10(max(moduli) / min(moduli))), 1), "nu": max(m.nu for m in given)}


def pair_options(
    random: Random, length: float, obstacle: bool = False, friction: float = 0.3, clearance: float | None = None
) -> dict[str, Any]:
    """Return the options of a pair: mostly none.

    `length` is that by which it is pressed, `friction` how many have friction, `clearance` that of all but tied ones.
    """
    options: dict[str, Any] = {}
    if random.random() < 0.3:
        options |= formulation(random, obstacle)
    if random.random() < friction:
        options["friction"] = round(float(random.uniform(0.05, 0.8)), 3)
    if random.random() < 0.25:
        options["clearance"] = float(random.uniform(-1.0, 0.5) * length)
        if not obstacle and options.get("formulation") is None and random.random() < 0.2:
            options["clearance_ramp"] = ((0.0, 0.0), (1.0, 1.0), (2.0, 1.0))
    if random.random() < 0.05:
        options["search_distance"] = 100 * length
    if random.random() < 0.08 and "friction" not in options:
        kinds = ["bilateral", "bilateral_once_closed"] + ["tied"] * (not obstacle and "clearance" not in options)
        options["kind"] = str(random.choice(kinds))
        if options["kind"] == "tied":
            options.pop("search_distance", None)
    if clearance is not None and options.get("kind") != "tied":
        options.pop("clearance_ramp", None)
        options["clearance"] = clearance
    return options


def formulation(random: Random, obstacle: bool) -> dict[str, Any]:
    """Return an explicit formulation with options of its own."""
    nts = {"formulation": "node_to_segment"}
    continuous = {"formulation": "continuous"}
    mortar = {"formulation": "mortar"}
    rule = {"integration": str(random.choice(["gauss", "simpson", "node"]))}
    if obstacle:
        return [nts, {**continuous, **rule}][int(random.integers(2))]
    dual = {**mortar, "multipliers": "dual", "normals": str(random.choice(["facet", "averaged", "secondary"]))}
    choices = [nts, {**nts, "normals": "averaged"}, continuous, {**continuous, **rule}, mortar, mortar, dual]
    return choices[int(random.integers(len(choices)))]


def add_contact(random: Random, draft: Draft, sides: tuple[str, str], pressed: float, **more: Any) -> None:
    """Add a pair, either side of it secondary."""
    if random.random() < 0.5:
        sides = sides[::-1]
    options = pair_options(random, pressed, **more)
    name = f"pair {len(draft.model.contact)}"
    draft.model.add_contact(name, secondary=sides[0], primary=sides[1], **options)
    note(draft, options)


def add_obstacle(
    random: Random, draft: Draft, side: str, obstacle: Any, pressed: float, driven: dict[str, Any]
) -> None:
    """Add a rigid obstacle."""
    options = pair_options(random, pressed, obstacle=True)
    draft.model.add_obstacle(
        f"obstacle {len(draft.model.contact)}", secondary=side, obstacle=obstacle, **driven, **options
    )
    note(draft, {**options, "obstacle": True})


def note(draft: Draft, options: dict[str, Any]) -> None:
    for name in ("friction", "clearance", "kind", "obstacle", "formulation"):
        if name in options:
            draft.labels[name] = options[name]
