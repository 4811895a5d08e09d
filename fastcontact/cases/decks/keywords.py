"""The keywords of decks: their context, the function that reads them, their parameters; and the unsupported keywords."""

from __future__ import annotations

import difflib
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

from fastcontact.cases.decks import (
    cohesive,
    connections,
    cyclic_symmetry,
    geometry,
    heat,
    nonlinear,
    pretension,
    properties,
    stepping,
    temperatures,
)
from fastcontact.cases.decks.blocks import Block

# Placeholder for a keyword that accepts any parameter.
ANYTHING = "*"


@dataclass(frozen=True)
class Keyword:
    """Context of a keyword, the function that reads it, and its parameters: those in use and those without effect."""

    place: Literal["deck", "part", "material", "interaction", "model", "step", "procedure"]
    read: Callable[..., None] | None = None
    used: str = ""
    harmless: str = ""

    @property
    def parameters(self) -> set[str]:
        """All accepted parameters."""
        return {*self.used.split("; "), *self.harmless.split("; ")} - {""}


# Parameters of steps that control their solution.
STEERING = "SOLVER; DIRECT; STABILIZE; ALLSDTOL; CONTINUE; EXPLICIT; DELTMX; MXDEM; END"
# Supported keywords.
TRANSLATED = {
    # Keywords handled by the reader itself.
    "ASSEMBLY": Keyword("deck", None, "NAME"),
    "CHANGE FRICTION": Keyword("deck", None, "INTERACTION"),
    "COUPLING": Keyword("deck", None, "REF NODE; SURFACE; ORIENTATION", "CONSTRAINT NAME"),
    "DISTRIBUTING": Keyword("deck"),
    "END ASSEMBLY": Keyword("deck"),
    "END INSTANCE": Keyword("deck"),
    "END PART": Keyword("deck"),
    "END STEP": Keyword("deck"),
    "HEADING": Keyword("deck", None, ANYTHING),
    "INSTANCE": Keyword("deck", None, "NAME; PART"),
    "KINEMATIC": Keyword("deck"),
    "MATERIAL": Keyword("deck", None, "NAME"),
    "PART": Keyword("deck", None, "NAME"),
    "STEP": Keyword(
        "deck", None, "NLGEOM; AMPLITUDE", "NAME; INC; PERTURBATION; UNSYMM; EXTRAPOLATION; CONVERT SDI; SOLVER"
    ),
    "SURFACE INTERACTION": Keyword("deck", None, "NAME"),
    # In parts, or in decks without parts.
    "DISTRIBUTION": Keyword("part", properties.distribution, "NAME; LOCATION", "TABLE"),
    "DISTRIBUTION TABLE": Keyword("part", properties.distribution_table, ANYTHING),
    "ELEMENT": Keyword("part", geometry.cells, "TYPE; ELSET"),
    "ELSET": Keyword("part", geometry.element_set, "ELSET; GENERATE; INSTANCE", "INTERNAL; UNSORTED"),
    "NODE": Keyword("part", geometry.nodes, "NSET; SYSTEM"),
    "NSET": Keyword("part", geometry.node_set, "NSET; GENERATE; INSTANCE", "INTERNAL; UNSORTED; FREQUENCY"),
    "ORIENTATION": Keyword("part", properties.orientation, "NAME; SYSTEM; DEFINITION"),
    "SOLID SECTION": Keyword("part", properties.section, "ELSET; MATERIAL; ORIENTATION", "CONTROLS"),
    "SURFACE": Keyword("part", geometry.surface, "NAME; TYPE", "INTERNAL"),
    # Below *MATERIAL.
    "CONDUCTIVITY": Keyword("material", heat.conductivity, ANYTHING),
    "DENSITY": Keyword("material", properties.density),
    "ELASTIC": Keyword("material", properties.elastic, "TYPE"),
    "EXPANSION": Keyword("material", temperatures.expansion, "TYPE", "ZERO"),
    "HYPERELASTIC": Keyword("material", nonlinear.hyperelastic, "NEO HOOKE; MOONEY-RIVLIN; YEOH; OGDEN; N", "MODULI"),
    "PLASTIC": Keyword("material", nonlinear.plastic, "HARDENING"),
    "SPECIFIC HEAT": Keyword("material", heat.specific_heat, ANYTHING),
    # Below *SURFACE INTERACTION.
    "COHESIVE BEHAVIOR": Keyword("interaction", cohesive.keep, "TYPE; ELIGIBILITY"),
    "DAMAGE EVOLUTION": Keyword(
        "interaction", cohesive.keep, "TYPE; SOFTENING; MIXED MODE BEHAVIOR; POWER; MODE MIX RATIO", "DEGRADATION"
    ),
    "DAMAGE INITIATION": Keyword("interaction", cohesive.keep, "CRITERION"),
    "DAMAGE STABILIZATION": Keyword("interaction", cohesive.stabilization, ANYTHING),
    "FRICTION": Keyword("interaction", properties.friction),
    "GAP CONDUCTANCE": Keyword("interaction", heat.gap_conductance, "PRESSURE"),
    "GAP HEAT GENERATION": Keyword("interaction", heat.gap_heat_generation),
    "SURFACE BEHAVIOR": Keyword("interaction", properties.behaviour, "PRESSURE-OVERCLOSURE; NO SEPARATION"),
    # In the whole model.
    "AMPLITUDE": Keyword("model", properties.amplitude, "NAME; TIME; DEFINITION; VALUE"),
    "CLEARANCE": Keyword("model", connections.clearance, "SLAVE; MASTER; SECONDARY; MAIN; VALUE"),
    "CONTACT PAIR": Keyword("model", connections.contact_pair, "INTERACTION; TYPE; ADJUST; SMALL SLIDING", "CPSET"),
    "CYCLIC SYMMETRY MODEL": Keyword("model", cyclic_symmetry.cyclic_symmetry_model, "N; TIE", "NGRAPH; CHECK; ELSET"),
    "EQUATION": Keyword("model", connections.equation),
    "GAP": Keyword("model", properties.gap, "ELSET"),
    "INITIAL CONDITIONS": Keyword("model", temperatures.initial_conditions, "TYPE"),
    "MPC": Keyword("model", connections.multi_point),
    "PHYSICAL CONSTANTS": Keyword("model", heat.physical_constants, ANYTHING),
    "PRE-TENSION SECTION": Keyword("model", pretension.pretension_section, "SURFACE; NODE"),
    "RIGID BODY": Keyword("model", connections.rigid_body, "NSET; ELSET; REF NODE; ROT NODE"),
    "SPRING": Keyword("model", properties.spring, "ELSET"),
    "TIE": Keyword("model", connections.tie, "POSITION TOLERANCE; ADJUST; CYCLIC SYMMETRY; NAME", "TYPE; NO ROTATION"),
    "TRANSFORM": Keyword("model", connections.transform, "NSET; TYPE"),
    # Supports and loads in steps.
    "BOUNDARY": Keyword("step", stepping.given, "OP; AMPLITUDE; FIXED; TYPE"),
    "CFLUX": Keyword("step", stepping.given, "OP; AMPLITUDE"),
    "CLOAD": Keyword("step", stepping.given, "OP; AMPLITUDE"),
    "DFLUX": Keyword("step", stepping.given, "OP; AMPLITUDE"),
    "DLOAD": Keyword("step", stepping.given, "OP; AMPLITUDE"),
    "DSFLUX": Keyword("step", stepping.given, "OP; AMPLITUDE"),
    "DSLOAD": Keyword("step", stepping.given, "OP; AMPLITUDE"),
    "FILM": Keyword("step", stepping.given, "OP; AMPLITUDE"),
    "SFILM": Keyword("step", stepping.given, "OP; AMPLITUDE"),
    "TEMPERATURE": Keyword("step", stepping.given, "OP; AMPLITUDE"),
    # Procedures of steps.
    "COUPLED TEMPERATURE-DISPLACEMENT": Keyword("procedure", stepping.heated, "STEADY STATE", STEERING),
    "FREQUENCY": Keyword("procedure", stepping.frequency, "", "EIGENSOLVER; NORMALIZATION; SOLVER; STORAGE; GLOBAL"),
    "HEAT TRANSFER": Keyword("procedure", stepping.heated, "STEADY STATE", STEERING),
    "STATIC": Keyword("procedure", stepping.static, "", STEERING),
    "UNCOUPLED TEMPERATURE-DISPLACEMENT": Keyword("procedure", stepping.heated, "STEADY STATE", STEERING),
}
# Output requests, since results contain all output, and convergence controls, since the package has its own criteria.
OUTPUT = (
    "CONTACT FILE", "CONTACT OUTPUT", "CONTACT PRINT", "EL FILE", "EL PRINT", "ELEMENT OUTPUT", "ENERGY FILE",
    "ENERGY OUTPUT",
    "ENERGY PRINT", "FACE PRINT", "FILE FORMAT", "FILE OUTPUT", "MONITOR", "NODE FILE", "NODE OUTPUT", "NODE PRINT", "OUTPUT",
    "PREPRINT", "PRINT", "RESTART", "SECTION FILE", "SECTION PRINT", "TIME POINTS", "CONTROLS",
)  # fmt: skip
# Reasons why other keywords of the format are refused.
LINEAR = "is outside the scope of fastcontact (elastic, elastic-plastic and hyperelastic materials)"
STATIC = "is outside the scope of fastcontact (quasi-static: *STATIC, steady heat, and *FREQUENCY behind them)"
SOLIDS = "is outside the scope of fastcontact (solid elements only)"
HEAT = "is outside the scope of fastcontact (steady conduction of heat, without radiation)"
NOT_YET = "is not supported"
REFUSED = {
    **dict.fromkeys(
        ("HYPERFOAM", "CREEP", "CYCLIC HARDENING",
         "DEFORMATION PLASTICITY", "DRUCKER PRAGER", "MOHR COULOMB", "VISCOELASTIC", "USER MATERIAL", "DEPVAR",
         "CONCRETE DAMAGED PLASTICITY", "GASKET BEHAVIOR", "RATE DEPENDENT", "NO COMPRESSION"), LINEAR),
    **dict.fromkeys(
        ("DYNAMIC", "BUCKLE", "MODAL DYNAMIC", "STEADY STATE DYNAMICS", "VISCO", "ELECTROMAGNETICS",
         "COMPLEX FREQUENCY", "SENSITIVITY",
         "DAMPING", "MODAL DAMPING", "GREEN", "CRACK PROPAGATION", "GEOSTATIC", "CONTACT DAMPING",
         "FEASIBLE DIRECTION"), STATIC),
    **dict.fromkeys(
        ("SHELL SECTION", "BEAM SECTION", "MEMBRANE SECTION", "BEAM GENERAL SECTION", "SHELL GENERAL SECTION",
         "FLUID SECTION",
         "CONNECTOR SECTION", "COHESIVE SECTION", "GASKET SECTION", "MASS", "ROTARY INERTIA", "DASHPOT", "NODAL THICKNESS",
         "SURFACE SECTION", "RIGID SURFACE", "TRANSVERSE SHEAR STIFFNESS"), SOLIDS),
    **dict.fromkeys(
        ("RADIATE", "SRADIATE", "CAVITY DEFINITION", "FILM PROPERTY", "CFILM", "GAP RADIATION"), HEAT),
    **dict.fromkeys(
        ("CONTACT", "CONTACT INCLUSIONS", "CONTACT PROPERTY ASSIGNMENT",
         "BASE MOTION",
         "SUBMODEL", "MODEL CHANGE", "CHANGE CONTACT TYPE", "CONTACT CONTROLS", "FRACTURE CRITERION", "DEBOND",
         "CONTACT INITIALIZATION DATA", "CONTACT STABILIZATION", "SYSTEM", "NGEN", "NFILL", "ELGEN", "NCOPY",
         "ELCOPY", "PARAMETER", "MATRIX INPUT", "SUPER ELEMENT", "USER ELEMENT", "DISTRIBUTING COUPLING",
         "KINEMATIC COUPLING",
         "CONNECTOR BEHAVIOR", "EMBEDDED ELEMENT", "FIELD", "VALUES AT INFINITY", "FILTER", "IMPERFECTION",
         "IMPORT"), NOT_YET),
}  # fmt: skip


_SPELLED = {name.replace(" ", ""): name for name in (*TRANSLATED, *OUTPUT, *REFUSED)}


def spelled(block: Block) -> Block:
    """Return a block with the usual blanks in its keyword and parameters: CalculiX accepts them without blanks."""
    keyword = _SPELLED.get(block.keyword.replace(" ", ""), block.keyword)
    known = TRANSLATED.get(keyword)
    names = {name.replace(" ", ""): name for name in known.parameters} if known else {}
    parameters = {names.get(name.replace(" ", ""), name): value for name, value in block.parameters.items()}
    return replace(block, location=replace(block.location, keyword=keyword), parameters=parameters)


def checked(block: Block, about: str) -> Keyword:
    """Return the entry of a keyword; refuse unknown and unsupported keywords and parameters.

    `about` names the material in messages.
    """
    keyword = block.keyword
    if keyword in REFUSED:
        raise block.refuse(f"{about}*{keyword} {REFUSED[keyword]}")
    known = TRANSLATED.get(keyword)
    if known is None:
        near = difflib.get_close_matches(keyword, [*TRANSLATED, *OUTPUT, *REFUSED, "INCLUDE"], n=1, cutoff=0.6)
        meant = f"; is *{near[0]} meant?" if near else ""
        raise block.refuse(f"unknown keyword *{keyword}{meant}")
    for name in block.parameters:
        if known.used != ANYTHING and name not in known.parameters:
            takes = ", ".join(sorted(known.parameters)) or "none"
            raise block.refuse(f"the parameter {name[:40]} of *{keyword} is not supported; it takes {takes}")
    return known
