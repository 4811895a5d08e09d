"""Nonlinear bodies of a deck: *PLASTIC, *HYPERELASTIC, and the effect of NLGEOM."""

from __future__ import annotations

from typing import Any

from fastcontact.cases.decks.blocks import Block
from fastcontact.cases.decks.content import Content, Material
from fastcontact.cases.decks.refusals import refusing
from fastcontact.elasticity.materials import LinearElastic
from fastcontact.elasticity.nonlinear_materials import STRAINS, ElasticPlastic, MooneyRivlin, NeoHookean, Ogden, Yeoh

# Poisson's ratio of hyperelastic materials with zero compressibility constant, as in CalculiX.
UNGIVEN = 0.475
# Numbers of deviatoric constants, and of compressibility constants.
HYPERELASTIC = {"NEO HOOKE": (1, 1), "MOONEY-RIVLIN": (2, 1), "YEOH": (3, 3), "OGDEN": (2, 1)}


def plastic(content: Content, current: Material, block: Block) -> None:
    """*PLASTIC: yield stresses by equivalent plastic strain, after the *ELASTIC of the material."""
    hardening = block.choice("HARDENING", ("ISOTROPIC", "KINEMATIC"))
    elastic = None if current.law is None else current.law(None)
    if type(elastic) is not LinearElastic:
        raise block.refuse(f"material '{current.name}': isotropic *ELASTIC constants come before it")
    table = [(row.number(1, 0.0), row.number(0)) for row in block.rows]
    if not table:
        raise block.refuse("a data line with a yield stress is needed")
    if table[0][0] != 0.0:
        raise block.rows[0].refuse(f"material '{current.name}': the first plastic strain {table[0][0]:g} must be zero")
    if any(row.text(2) for row in block.rows) and len({row.text(2) for row in block.rows}) > 1:
        raise block.refuse(f"material '{current.name}': one temperature is supported")
    kinematic = 0.0
    if hardening == "KINEMATIC":
        if len(table) > 2:
            raise block.refuse(
                f"material '{current.name}': kinematic hardening is linear: two points, not {len(table)}"
            )
        kinematic = (table[1][1] - table[0][1]) / table[1][0] if len(table) == 2 else 0.0
        table = table[:1]
    with refusing(block, f"material '{current.name}': "):
        law = ElasticPlastic(E=elastic.E, nu=elastic.nu, yield_stress=table[0][1], hardening=table, kinematic=kinematic)
    current.law = lambda axes: law


def hyperelastic(content: Content, current: Material, block: Block) -> None:
    """*HYPERELASTIC: constants of the deviatoric part, then of the compressibility."""
    kinds = [kind for kind in HYPERELASTIC if kind in block.parameters]
    if len(kinds) != 1:
        raise block.refuse(f"material '{current.name}': one of {', '.join(HYPERELASTIC)} is supported")
    kind, terms = kinds[0], int(block.get("N", "1")) if kinds[0] == "OGDEN" else 1
    numbers, (first, rest) = block.numbers(), (count * terms for count in HYPERELASTIC[kind])
    if len(numbers) < first:
        raise block.refuse(f"material '{current.name}': {kind} has {first} constants, {len(numbers)} are given")
    constants, compressible = numbers[:first], [*numbers[first : first + rest], *[0.0] * rest][:rest]
    if any(compressible[1:]):
        raise block.refuse(f"material '{current.name}': of the compressibility only D1 is supported")
    mu = _shear_modulus(kind, constants)
    bulk = 2.0 / compressible[0] if compressible[0] else 2.0 * mu * (1.0 + UNGIVEN) / (3.0 * (1.0 - 2.0 * UNGIVEN))
    if not compressible[0]:
        content.note(block, f"D1 = 0: the bulk modulus is that of nu = {UNGIVEN}")
    with refusing(block, f"material '{current.name}': "):
        law = _law(kind, constants, mu, bulk)
    current.law = lambda axes: law


def _shear_modulus(kind: str, constants: list[float]) -> float:
    if kind == "OGDEN":
        return sum(constants[::2])
    return 2.0 * (constants[0] + (constants[1] if kind == "MOONEY-RIVLIN" else 0.0))


def _law(kind: str, constants: list[float], mu: float, bulk: float) -> Any:
    if kind == "NEO HOOKE":
        return NeoHookean(E=9.0 * bulk * mu / (3.0 * bulk + mu), nu=(3.0 * bulk - 2.0 * mu) / (2.0 * (3.0 * bulk + mu)))
    if kind == "OGDEN":
        return Ogden(constants[::2], constants[1::2], bulk=bulk)
    if kind == "MOONEY-RIVLIN":
        return MooneyRivlin(constants[0], constants[1], bulk)
    return Yeoh(constants[0], constants[1], constants[2], bulk)


def strain_of(content: Content, laws: list[Any]) -> tuple[str, str]:
    """Return the strain measure of the model, and the reason why NLGEOM is not followed; empty if it is."""
    if any("small" not in getattr(law, "strains", STRAINS) for law in laws):
        return "finite", ""
    if content.heat == "alone" or not any(step.nonlinear for step in content.steps):
        return "small", ""
    reasons = {
        "kinematic hardening": any(isinstance(law, ElasticPlastic) and law.kinematic for law in laws),
        "a nearly incompressible elastic material": any(
            law.averaged and not isinstance(law, ElasticPlastic) for law in laws
        ),
        "initial stresses": bool(content.stresses),
        "couplings, rigid bodies and multi-point constraints": bool(
            content.links or content.pins or content.multi_points
        ),
        "pretension sections": bool(content.pretensions),
        "incompatible modes": any(law.incompatible_modes for law in laws),
    }
    why = [name for name, there in reasons.items() if there]
    return ("small", why[0]) if why else ("finite", "")
