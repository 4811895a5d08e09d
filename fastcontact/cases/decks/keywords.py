"""The keywords of decks: which parameters each takes here, which have no effect, and what is outside of fastcontact."""

from __future__ import annotations

import difflib
from dataclasses import dataclass, replace

from fastcontact.cases.decks.blocks import Block


@dataclass(frozen=True)
class Keyword:
    """What a keyword takes: parameters that mean something here, and those that have no effect on the result."""

    used: frozenset[str] = frozenset()
    harmless: frozenset[str] = frozenset()
    anything: bool = False


def _keyword(used: str = "", harmless: str = "") -> Keyword:
    return Keyword(frozenset(filter(None, used.split("; "))), frozenset(filter(None, harmless.split("; "))))


# Keywords that are translated.
TRANSLATED = {
    "AMPLITUDE": _keyword("NAME; TIME; DEFINITION; VALUE"),
    "ASSEMBLY": _keyword("NAME"),
    "BOUNDARY": _keyword("OP; AMPLITUDE; FIXED; TYPE"),
    "CHANGE FRICTION": _keyword("INTERACTION"),
    "CLEARANCE": _keyword("SLAVE; MASTER; SECONDARY; MAIN; VALUE"),
    "CLOAD": _keyword("OP; AMPLITUDE"),
    "CONTACT PAIR": _keyword("INTERACTION; TYPE; ADJUST; SMALL SLIDING", "CPSET"),
    "COUPLING": _keyword("REF NODE; SURFACE; ORIENTATION", "CONSTRAINT NAME"),
    "CONDUCTIVITY": Keyword(anything=True),
    "CYCLIC SYMMETRY MODEL": _keyword("N; TIE", "NGRAPH; CHECK; ELSET"),
    "DENSITY": _keyword(),
    "DISTRIBUTING": _keyword(),
    "DLOAD": _keyword("OP; AMPLITUDE"),
    "DSLOAD": _keyword("OP; AMPLITUDE"),
    "ELASTIC": _keyword("TYPE"),
    "ELEMENT": _keyword("TYPE; ELSET"),
    "ELSET": _keyword("ELSET; GENERATE; INSTANCE", "INTERNAL; UNSORTED"),
    "END ASSEMBLY": _keyword(),
    "END INSTANCE": _keyword(),
    "END PART": _keyword(),
    "END STEP": _keyword(),
    "EQUATION": _keyword(),
    "EXPANSION": _keyword("TYPE", "ZERO"),
    "FREQUENCY": _keyword("", "EIGENSOLVER; NORMALIZATION; SOLVER; STORAGE; GLOBAL"),
    "FRICTION": _keyword(),
    "GAP": _keyword("ELSET"),
    "HEADING": Keyword(anything=True),
    "HYPERELASTIC": _keyword("NEO HOOKE; MOONEY-RIVLIN; YEOH; OGDEN; N", "MODULI"),
    "INITIAL CONDITIONS": _keyword("TYPE"),
    "INSTANCE": _keyword("NAME; PART"),
    "KINEMATIC": _keyword(),
    "MATERIAL": _keyword("NAME"),
    "MPC": _keyword(),
    "NODE": _keyword("NSET; SYSTEM"),
    "NSET": _keyword("NSET; GENERATE; INSTANCE", "INTERNAL; UNSORTED; FREQUENCY"),
    "ORIENTATION": _keyword("NAME; SYSTEM"),
    "PART": _keyword("NAME"),
    "PLASTIC": _keyword("HARDENING"),
    "PRE-TENSION SECTION": _keyword("SURFACE; NODE"),
    "RIGID BODY": _keyword("NSET; ELSET; REF NODE; ROT NODE"),
    "SOLID SECTION": _keyword("ELSET; MATERIAL; ORIENTATION", "CONTROLS"),
    "SPECIFIC HEAT": Keyword(anything=True),
    "SPRING": _keyword("ELSET"),
    "STATIC": _keyword("", "SOLVER; DIRECT; STABILIZE; ALLSDTOL; CONTINUE; EXPLICIT"),
    "STEP": _keyword("NLGEOM; AMPLITUDE", "NAME; INC; PERTURBATION; UNSYMM; EXTRAPOLATION; CONVERT SDI; SOLVER"),
    "SURFACE": _keyword("NAME; TYPE", "INTERNAL"),
    "SURFACE BEHAVIOR": _keyword("PRESSURE-OVERCLOSURE; NO SEPARATION"),
    "SURFACE INTERACTION": _keyword("NAME"),
    "TEMPERATURE": _keyword("OP; AMPLITUDE"),
    "TIE": _keyword("POSITION TOLERANCE; ADJUST; CYCLIC SYMMETRY; NAME", "TYPE; NO ROTATION"),
    "TRANSFORM": _keyword("NSET; TYPE"),
}
# Requests for output, all of which is in the results, and controls of convergence, which has criteria of its own.
OUTPUT = (
    "CONTACT FILE", "CONTACT OUTPUT", "CONTACT PRINT", "EL FILE", "EL PRINT", "ELEMENT OUTPUT", "ENERGY FILE",
    "ENERGY OUTPUT",
    "ENERGY PRINT", "FACE PRINT", "FILE FORMAT", "FILE OUTPUT", "MONITOR", "NODE FILE", "NODE OUTPUT", "NODE PRINT", "OUTPUT",
    "PREPRINT", "PRINT", "RESTART", "SECTION FILE", "SECTION PRINT", "TIME POINTS", "CONTROLS",
)  # fmt: skip
# Why other keywords of the format are refused.
LINEAR = "is outside of fastcontact (elastic, elastic-plastic and hyperelastic materials)"
STATIC = "is outside of fastcontact (quasi-static: *STATIC, and *FREQUENCY behind it)"
SOLIDS = "is outside of fastcontact (solid elements only)"
HEAT = "is outside of fastcontact (temperatures are given by *TEMPERATURE, not computed)"
NOT_YET = "is not supported"
REFUSED = {
    **dict.fromkeys(
        ("HYPERFOAM", "CREEP", "CYCLIC HARDENING", "DAMAGE INITIATION", "DAMAGE EVOLUTION",
         "DEFORMATION PLASTICITY", "DRUCKER PRAGER", "MOHR COULOMB", "VISCOELASTIC", "USER MATERIAL", "DEPVAR",
         "CONCRETE DAMAGED PLASTICITY", "GASKET BEHAVIOR", "COHESIVE BEHAVIOR", "RATE DEPENDENT", "NO COMPRESSION"), LINEAR),
    **dict.fromkeys(
        ("DYNAMIC", "BUCKLE", "MODAL DYNAMIC", "STEADY STATE DYNAMICS", "VISCO", "HEAT TRANSFER",
         "ELECTROMAGNETICS",
         "COUPLED TEMPERATURE-DISPLACEMENT", "UNCOUPLED TEMPERATURE-DISPLACEMENT",
         "COMPLEX FREQUENCY", "SENSITIVITY",
         "DAMPING", "MODAL DAMPING", "GREEN", "CRACK PROPAGATION", "GEOSTATIC", "CONTACT DAMPING",
         "FEASIBLE DIRECTION"), STATIC),
    **dict.fromkeys(
        ("SHELL SECTION", "BEAM SECTION", "MEMBRANE SECTION", "BEAM GENERAL SECTION", "SHELL GENERAL SECTION",
         "FLUID SECTION",
         "CONNECTOR SECTION", "COHESIVE SECTION", "GASKET SECTION", "MASS", "ROTARY INERTIA", "DASHPOT", "NODAL THICKNESS",
         "SURFACE SECTION", "RIGID SURFACE", "TRANSVERSE SHEAR STIFFNESS"), SOLIDS),
    **dict.fromkeys(
        ("CFLUX", "DFLUX", "FILM", "RADIATE", "PHYSICAL CONSTANTS", "GAP CONDUCTANCE", "GAP HEAT GENERATION"), HEAT),
    **dict.fromkeys(
        ("CONTACT", "CONTACT INCLUSIONS", "CONTACT PROPERTY ASSIGNMENT",
         "BASE MOTION",
         "SUBMODEL", "MODEL CHANGE", "CHANGE CONTACT TYPE", "CONTACT CONTROLS",
         "CONTACT INITIALIZATION DATA", "CONTACT STABILIZATION", "SYSTEM", "DISTRIBUTION", "NGEN", "NFILL", "ELGEN", "NCOPY",
         "ELCOPY", "PARAMETER", "MATRIX INPUT", "SUPER ELEMENT", "USER ELEMENT", "DISTRIBUTING COUPLING",
         "KINEMATIC COUPLING",
         "CONNECTOR BEHAVIOR", "EMBEDDED ELEMENT", "FIELD", "VALUES AT INFINITY", "FILTER", "IMPERFECTION",
         "IMPORT"), NOT_YET),
}  # fmt: skip


_SPELLED = {name.replace(" ", ""): name for name in (*TRANSLATED, *OUTPUT, *REFUSED)}


def spelled(block: Block) -> Block:
    """Return a block with blanks in its keyword and parameters where they belong: CalculiX reads it without any."""
    keyword = _SPELLED.get(block.keyword.replace(" ", ""), block.keyword)
    known = TRANSLATED.get(keyword, Keyword())
    names = {name.replace(" ", ""): name for name in known.used | known.harmless}
    parameters = {names.get(name.replace(" ", ""), name): value for name, value in block.parameters.items()}
    return replace(block, location=replace(block.location, keyword=keyword), parameters=parameters)


def check(block: Block, about: str) -> None:
    """Refuse a keyword that is unknown or outside of fastcontact, and parameters that are; `about` names a material."""
    keyword = block.keyword
    if keyword in REFUSED:
        raise block.location.refuse(f"{about}*{keyword} {REFUSED[keyword]}")
    known = TRANSLATED.get(keyword)
    if known is None:
        near = difflib.get_close_matches(keyword, [*TRANSLATED, *OUTPUT, *REFUSED, "INCLUDE"], n=1, cutoff=0.6)
        meant = f"; is *{near[0]} meant?" if near else ""
        raise block.location.refuse(f"unknown keyword *{keyword}{meant}")
    for name in block.parameters:
        if not known.anything and name not in known.used | known.harmless:
            takes = ", ".join(sorted(known.used | known.harmless)) or "none"
            raise block.location.refuse(f"the parameter {name[:40]} of *{keyword} is not supported; it takes {takes}")
