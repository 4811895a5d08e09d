"""Materials of a deck: their keywords, and the resulting materials of the model with axes, expansion and conductivity."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from fastcontact.arrays import Array
from fastcontact.cases.decks.blocks import Block, as_number, errors_at, register
from fastcontact.cases.decks.content import Content, Material
from fastcontact.elasticity import nonlinear_materials as nonlinear
from fastcontact.elasticity.anisotropic_materials import Anisotropic, Orthotropic
from fastcontact.elasticity.materials import LinearElastic

# Number of constants of *ELASTIC by type.
CONSTANTS = {"ISOTROPIC": 2, "ENGINEERING CONSTANTS": 9, "ORTHOTROPIC": 9, "ANISOTROPIC": 21}
# Poisson's ratio at small strains of a hyperelastic material whose compressibility constant D1 is zero, as in CalculiX.
DEFAULT_POISSON_RATIO = 0.475
# Number of deviatoric constants and of compressibility constants of each hyperelastic law, and for Ogden of each term.
HYPERELASTIC = {"NEO HOOKE": (1, 1), "MOONEY-RIVLIN": (2, 1), "YEOH": (3, 3), "OGDEN": (2, 1)}
# Number of coefficients of expansion and conductivity by type.
COEFFICIENTS = {"ISO": 1, "ORTHO": 3}
# Elastic constants for decks with heat transfer only. They have no effect, since all displacements are fixed.
ARBITRARY_LAW = LinearElastic(E=1.0, nu=0.0)


def material(content: Content, block: Block) -> Material:
    """Read *MATERIAL and return the new material, to which the following keywords belong."""
    name = block.required("NAME")
    return register("material", name, content.materials, Material(name, block.location), block)


def elastic(content: Content, current: Material, block: Block) -> None:
    """Read *ELASTIC: elastic constants at one temperature; TYPE may be abbreviated to three letters, as in Abaqus."""
    kind = "".join(block.get("TYPE", "ISOTROPIC").upper().split())
    kinds = [name for name in CONSTANTS if len(kind) >= 3 and name.replace(" ", "").startswith(kind)]
    if not kinds:
        names = ", ".join(CONSTANTS)
        raise block.error(f"{current.prefix}TYPE={kind[:40]} is not supported; expected one of {names}")
    if kinds[0] != "ISOTROPIC":
        _read_anisotropic(current, block, kinds[0])
        return
    row = block.only_row("temperatures" if len(block.rows) > 1 else "")
    E, nu = row.number(0), row.number(1, 0.0)
    if row.text(2):
        content.note(row, "the temperature of the constants has no effect: there is one set of them")
    with errors_at(row, current.prefix):
        law = LinearElastic(E=E, nu=nu)
    current.law = lambda axes: law


def _read_anisotropic(current: Material, block: Block, kind: str) -> None:
    """Read the constants of an anisotropic material, which may fill several lines and be followed by a temperature."""
    numbers, count = block.numbers(), CONSTANTS[kind]
    if not count <= len(numbers) <= count + 1:
        raise block.error(f"{current.prefix}{len(numbers)} constants where {kind} has {count}, at one temperature")
    values = numbers[:count]

    def law(axes: Any) -> Orthotropic | Anisotropic:
        if kind == "ENGINEERING CONSTANTS":
            return Orthotropic(E=values[:3], nu=values[3:6], G=values[6:], axes=axes)
        return Anisotropic(_moduli(values), axes=axes)

    with errors_at(block, current.prefix):
        law(None)
    current.law = law


def _moduli(values: list[float]) -> Array:
    """Return the moduli (6, 6) [pressure], in the order 11, 22, 33, 12, 23, 13.

    `values` [pressure] is the upper triangle by columns, in the order 11, 22, 33, 12, 13, 23, without the entries that are
    zero in an orthotropic material if there are nine values.
    """
    D = np.zeros((6, 6))
    entries = [(i, j) for j in range(6) for i in range(j + 1)]
    if len(values) == CONSTANTS["ORTHOTROPIC"]:
        entries = [(i, j) for i, j in entries if i == j or j < 3]
    for (i, j), value in zip(entries, values, strict=True):
        D[i, j] = D[j, i] = value
    order = [0, 1, 2, 3, 5, 4]
    return D[np.ix_(order, order)]


def density(content: Content, current: Material, block: Block) -> None:
    """Read *DENSITY: the mass per volume."""
    current.density = block.only_row().positive(0, "density")


def plastic(content: Content, current: Material, block: Block) -> None:
    """Read *PLASTIC: yield stresses by equivalent plastic strain; *ELASTIC must precede it."""
    hardening = block.choice("HARDENING", ("ISOTROPIC", "KINEMATIC"))
    elastic = None if current.law is None else current.law(None)
    if type(elastic) is not LinearElastic:
        raise block.error(f"{current.prefix}isotropic *ELASTIC constants must precede it")
    table = [(row.number(1, 0.0), row.number(0)) for row in block.rows]
    if not table:
        raise block.error("a data line with a yield stress is needed")
    if table[0][0] != 0.0:
        raise block.rows[0].error(f"{current.prefix}the first plastic strain {table[0][0]:g} must be zero")
    if len({row.text(2) for row in block.rows}) > 1:
        raise block.error(f"{current.prefix}only one temperature is supported")
    modulus = 0.0  # of kinematic hardening
    if hardening == "KINEMATIC":
        if len(table) > 2:
            raise block.error(f"{current.prefix}kinematic hardening is linear: two points, not {len(table)}")
        modulus = (table[1][1] - table[0][1]) / table[1][0] if len(table) == 2 else 0.0
        table = table[:1]
    with errors_at(block, current.prefix):
        E, nu, yield_stress = elastic.E, elastic.nu, table[0][1]
        law = nonlinear.ElasticPlastic(E=E, nu=nu, yield_stress=yield_stress, hardening=table, kinematic=modulus)
    current.law = lambda axes: law


def hyperelastic(content: Content, current: Material, block: Block) -> None:
    """Read *HYPERELASTIC: the deviatoric constants, then the compressibility constants."""
    kinds = [kind for kind in HYPERELASTIC if kind in block.parameters]
    if len(kinds) != 1:
        raise block.error(f"{current.prefix}one of {', '.join(HYPERELASTIC)} is supported")
    kind = kinds[0]
    terms = as_number(block.location, block.get("N", "1")) if kind == "OGDEN" else 1.0
    if not terms.is_integer() or terms < 1.0:
        raise block.error(f"{current.prefix}the number of terms N = {terms:g} must be a positive whole number")
    n_deviatoric, n_volumetric = (count * int(terms) for count in HYPERELASTIC[kind])
    numbers = [row.number(i, 0.0) for row in block.rows for i in range(len(row.entries))]
    if len(numbers) < n_deviatoric:
        raise block.error(f"{current.prefix}{kind} has {n_deviatoric} constants, {len(numbers)} are given")
    if len(numbers) > n_deviatoric + n_volumetric + 1:
        raise block.error(f"{current.prefix}{kind} has {n_deviatoric + n_volumetric} constants, at one temperature")
    constants, (D1, *others) = numbers[:n_deviatoric], [*numbers[n_deviatoric:], 0.0][:n_volumetric]
    if any(others):
        raise block.error(f"{current.prefix}only the compressibility constant D1 is supported")
    # Shear modulus at small strains: the sum of mu_i (Ogden), 2 (C10 + C01) (Mooney-Rivlin) or 2 C10.
    mu = sum(constants[::2]) if kind == "OGDEN" else 2.0 * sum(constants[: 2 if kind == "MOONEY-RIVLIN" else 1])
    nu = DEFAULT_POISSON_RATIO
    bulk = 2.0 / D1 if D1 else 2.0 * mu * (1.0 + nu) / (3.0 * (1.0 - 2.0 * nu))
    if not D1:
        content.note(block, f"D1 = 0: the bulk modulus is that of nu = {nu}")
    with errors_at(block, current.prefix):
        law = _hyperelastic_law(kind, constants, mu, bulk)
    current.law = lambda axes: law


def _hyperelastic_law(kind: str, constants: list[float], mu: float, bulk: float) -> Any:
    """Return a hyperelastic material from its deviatoric constants, and its shear and bulk moduli at small strains."""
    if kind == "NEO HOOKE":
        E, nu = 9.0 * bulk * mu / (3.0 * bulk + mu), (3.0 * bulk - 2.0 * mu) / (2.0 * (3.0 * bulk + mu))
        return nonlinear.NeoHookean(E, nu)
    if kind == "OGDEN":
        return nonlinear.Ogden(constants[::2], constants[1::2], bulk=bulk)
    law: Any = nonlinear.MooneyRivlin if kind == "MOONEY-RIVLIN" else nonlinear.Yeoh
    return law(*constants, bulk)


def conductivity(content: Content, current: Material, block: Block) -> None:
    """Store *CONDUCTIVITY, whose meaning depends on the steps, which are read later."""
    current.conductivity = block


def expansion(content: Content, current: Material, block: Block) -> None:
    """Read *EXPANSION: coefficients of thermal expansion at one temperature."""
    current.expansion = coefficients_of(current, block)
    if "ZERO" in block.parameters:
        content.note(block, "ZERO has no effect: strains refer to the initial temperatures, coefficients are constant")


def coefficients_of(current: Material, block: Block) -> float | tuple[float, ...]:
    """Return the coefficient of a block, or its coefficients along the axes.

    Raises CaseError if they depend on the temperature.
    """
    kind = block.choice("TYPE", tuple(COEFFICIENTS))
    row, count = block.only_row("temperatures"), COEFFICIENTS[kind]
    values = tuple(row.number(index) for index in range(count))
    if any(row.entries[count + 1 :]):
        raise row.error(f"{current.prefix}TYPE={kind} has {count} coefficients, at one temperature")
    return values[0] if kind == "ISO" else values


def law_of(content: Content, material: Material, axes: Any, incompatible_modes: bool) -> Any:
    """Return the material of the model with the given `axes` and, if `incompatible_modes` is true, these modes."""
    if content.heat == "uncoupled":
        return _add_constants(material, ARBITRARY_LAW, axes, conductivity=_conductivity(content, material))
    assert material.law is not None
    law, expansion = material.law(axes), material.expansion
    law = replace(law, density=material.density)
    if isinstance(law, nonlinear.NonlinearElastic) and incompatible_modes:
        content.note(material, f"{material.prefix}incompatible modes are left out, since it is nonlinear")
    elif incompatible_modes:
        law = replace(law, incompatible_modes=True)
    if content.heat or material.conductivity is not None:
        law = _add_constants(material, law, axes, conductivity=_conductivity(content, material))
    blocks = (block for step in content.steps for block in step.conditions)
    heated = content.heat or any(block.keyword == "TEMPERATURE" for block in blocks)
    if expansion is None:
        if heated:
            content.note(material, f"material '{material.name}' has no *EXPANSION: temperatures cause no strain")
        return replace(law, expansion=0.0) if heated else law
    if not heated:
        content.note(material, f"{material.prefix}without temperatures the expansion has no effect")
    return _add_constants(material, law, axes, expansion=expansion)


def _conductivity(content: Content, material: Material) -> float | tuple[float, ...] | None:
    """Return the conductivity of a material.

    Raises CaseError if temperatures are computed and it is missing or not positive.
    """
    block = material.conductivity
    if block is None:
        if content.heat:
            raise material.error(f"material '{material.name}' has no *CONDUCTIVITY")
        return None
    if not content.heat:
        content.note(block, f"{material.prefix}*CONDUCTIVITY has no effect, because temperatures are prescribed")
        return None
    values = coefficients_of(material, block)
    if not np.min(values) > 0.0:
        raise block.error(f"{material.prefix}the conductivity {np.min(values):g} must be positive")
    return values


def _add_constants(material: Material, law: Any, axes: Any, **constants: Any) -> Any:
    """Return a material with additional constants; an elastic one becomes orthotropic for constants along the axes."""
    if isinstance(law, LinearElastic) and any(isinstance(value, tuple) for value in constants.values()):
        if isinstance(law, nonlinear.NonlinearElastic):
            raise material.error(
                f"{material.prefix}expansion and conductivity along axes are supported in linear elastic materials only"
            )
        G = law.E / (2.0 * (1.0 + law.nu))
        optional = {name: getattr(law, name) for name in ("density", "expansion", "conductivity")}
        law = Orthotropic((law.E,) * 3, (law.nu,) * 3, (G,) * 3, axes, **optional)
    return replace(law, **constants)


def strain_of(content: Content, laws: list[Any]) -> tuple[str, str]:
    """Return the strain measure of the model, and the reason why NLGEOM is ignored, or an empty string."""
    if any("small" not in getattr(law, "strains", nonlinear.STRAINS) for law in laws):
        return "finite", ""
    if content.heat == "uncoupled" or not any(step.nonlinear for step in content.steps):
        return "small", ""
    plastic_laws = [law for law in laws if isinstance(law, nonlinear.ElasticPlastic)]
    reasons = {
        "kinematic hardening": any(law.kinematic for law in plastic_laws),
        "a nearly incompressible elastic material": any(law.averaged and law not in plastic_laws for law in laws),
        "initial stresses": bool(content.blocks["INITIAL STRESS"]),
        "couplings, rigid bodies and multi-point constraints": bool(content.couplings or content.multi_points),
        "pretension sections": bool(content.blocks["PRE-TENSION SECTION"]),
        "incompatible modes": any(law.incompatible_modes for law in laws),
    }
    reason = next((name for name, applies in reasons.items() if applies), "")
    if not (reason or content.steps[0].nonlinear):
        first = next(step for step in content.steps if step.nonlinear)
        content.note(first, "NLGEOM applies to all steps: finite strains are assumed in the preceding steps, too")
    return ("small" if reason else "finite"), reason
