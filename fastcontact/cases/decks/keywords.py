"""Keywords of decks with their context, their reading function and their parameters, and the reader of all blocks."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from fastcontact.cases.decks import axes, constraints, geometry, interactions, materials, steps
from fastcontact.cases.decks.blocks import Block
from fastcontact.cases.decks.content import Content, Instance, Interaction, Material, Part, Step

# Entry for a keyword that accepts any parameter.
ANYTHING = "*"


@dataclass(frozen=True)
class Keyword:
    """Properties of a keyword.

    `context` states where the keyword is admissible:

    - "material", "interaction", "coupling" and "procedure": below an open material, interaction, coupling or step;
    - "part": in a part or in the assembly, outside instances and steps;
    - "property": outside steps;
    - "model": outside parts, instances and steps; *AMPLITUDE also in a step;
    - "step": outside parts and instances, in a step or, if `read` admits it, before the steps;
    - "deck": anywhere.

    `read` is the function that reads the keyword. `used` lists the parameters that have an effect, and `ignored` those
    that are accepted without effect. `opens` is the attribute of `Reader` to which the result of `read` is assigned: the
    object to which the next keywords belong, or None for a keyword that closes it.
    """

    context: Literal["deck", "part", "material", "interaction", "coupling", "property", "model", "step", "procedure"]
    read: Callable[..., Any]
    used: str = ""
    ignored: str = ""
    opens: str = ""

    @property
    def parameters(self) -> set[str]:
        """All accepted parameters."""
        return {*self.used.split("; "), *self.ignored.split("; ")} - {""}


def heading(content: Content, block: Block) -> None:
    """Read *HEADING: the title, which is the first data line."""
    content.title = " ".join(" ".join(", ".join(row.entries) for row in block.rows[:1]).split())


def ignore_with_note(text: str) -> Callable[..., None]:
    """Return the reading function of a keyword that has no effect apart from the note `text`."""
    return lambda content, *owner_and_block: content.note(owner_and_block[-1], text)


def store(content: Content, *owner_and_block: Any) -> None:
    """Store a block, which is interpreted when the model is built."""
    content.blocks[owner_and_block[-1].keyword].append(owner_and_block[-1])


def end(content: Content, block: Block) -> None:
    """Read the beginning of the assembly, or the end of a part, an instance or the assembly."""


# Parameters of procedures that only control the solution.
SOLUTION_CONTROLS = "SOLVER; DIRECT; STABILIZE; ALLSDTOL; CONTINUE; EXPLICIT; DELTMX; MXDEM; END"
# Parameters of *STEP without effect.
IGNORED_BY_STEPS = "NAME; INC; UNSYMM; EXTRAPOLATION; CONVERT SDI; SOLVER"
# Properties of the supported keywords, in groups of the same context.
TRANSLATED = {
    # Keywords that open or close an object to which others belong.
    "ASSEMBLY": Keyword("deck", end, "NAME", opens="part"),
    **dict.fromkeys(("END ASSEMBLY", "END PART"), Keyword("deck", end, opens="part")),
    "END INSTANCE": Keyword("deck", end, opens="instance"),
    "PART": Keyword("deck", geometry.new_part, "NAME", opens="part"),
    "INSTANCE": Keyword("deck", geometry.instance, "NAME; PART", opens="instance"),
    "MATERIAL": Keyword("property", materials.material, "NAME", opens="material"),
    "SURFACE INTERACTION": Keyword("property", interactions.interaction, "NAME", opens="interaction"),
    "CHANGE FRICTION": Keyword("procedure", interactions.changed_interaction, "INTERACTION", opens="interaction"),
    "COUPLING": Keyword(
        "property", lambda content, block: block, "REF NODE; SURFACE; ORIENTATION", "CONSTRAINT NAME", "coupling"
    ),
    **dict.fromkeys(("DISTRIBUTING", "KINEMATIC"), Keyword("coupling", constraints.coupling, opens="coupling")),
    "STEP": Keyword("step", steps.new_step, "NLGEOM; AMPLITUDE; PERTURBATION", IGNORED_BY_STEPS, "step"),
    "END STEP": Keyword("step", steps.end_step, opens="step"),
    "HEADING": Keyword("deck", heading, ANYTHING),
    # In parts, or in decks without parts.
    "DISTRIBUTION": Keyword("part", axes.distribution, "NAME; LOCATION", "TABLE"),
    "DISTRIBUTION TABLE": Keyword("part", axes.distribution_table, ANYTHING),
    "ELEMENT": Keyword("part", geometry.cells, "TYPE; ELSET"),
    "ELSET": Keyword("part", geometry.group, "ELSET; GENERATE; INSTANCE", "INTERNAL; UNSORTED"),
    "NODE": Keyword("part", geometry.nodes, "NSET; SYSTEM"),
    "NSET": Keyword("part", geometry.group, "NSET; GENERATE; INSTANCE", "INTERNAL; UNSORTED; FREQUENCY"),
    "ORIENTATION": Keyword("part", axes.orientation, "NAME; SYSTEM; DEFINITION"),
    "SOLID SECTION": Keyword("part", geometry.section, "ELSET; MATERIAL; ORIENTATION", "CONTROLS"),
    "SURFACE": Keyword("part", geometry.surface, "NAME; TYPE", "INTERNAL"),
    # Below *MATERIAL.
    "CONDUCTIVITY": Keyword("material", materials.conductivity, ANYTHING),
    "DENSITY": Keyword("material", materials.density),
    "ELASTIC": Keyword("material", materials.elastic, "TYPE"),
    "EXPANSION": Keyword("material", materials.expansion, "TYPE", "ZERO"),
    "HYPERELASTIC": Keyword("material", materials.hyperelastic, "NEO HOOKE; MOONEY-RIVLIN; YEOH; OGDEN; N", "MODULI"),
    "PLASTIC": Keyword("material", materials.plastic, "HARDENING"),
    "SPECIFIC HEAT": Keyword(
        "material", ignore_with_note("no effect, because heat conduction is steady or temperatures are given"), ANYTHING
    ),
    # Below *SURFACE INTERACTION.
    "COHESIVE BEHAVIOR": Keyword("interaction", interactions.store, "TYPE; ELIGIBILITY"),
    "DAMAGE EVOLUTION": Keyword(
        "interaction", interactions.store, "TYPE; SOFTENING; MIXED MODE BEHAVIOR; POWER; MODE MIX RATIO", "DEGRADATION"
    ),
    "DAMAGE INITIATION": Keyword("interaction", interactions.store, "CRITERION"),
    "DAMAGE STABILIZATION": Keyword(
        "interaction", ignore_with_note("no effect: damage has no viscous regularisation"), ANYTHING
    ),
    "FRICTION": Keyword("interaction", interactions.friction),
    "GAP CONDUCTANCE": Keyword("interaction", interactions.gap_conductance, "PRESSURE"),
    "GAP HEAT GENERATION": Keyword("interaction", interactions.gap_heat_generation),
    "SURFACE BEHAVIOR": Keyword("interaction", interactions.behaviour, "PRESSURE-OVERCLOSURE; NO SEPARATION"),
    # In the whole model.
    "AMPLITUDE": Keyword("model", steps.amplitude, "NAME; TIME; DEFINITION; VALUE"),
    "CLEARANCE": Keyword("model", constraints.clearance, "SLAVE; MASTER; SECONDARY; MAIN; VALUE"),
    "CONTACT PAIR": Keyword("model", constraints.contact_pair, "INTERACTION; TYPE; ADJUST; SMALL SLIDING", "CPSET"),
    "CYCLIC SYMMETRY MODEL": Keyword("model", store, "N; TIE", "NGRAPH; CHECK; ELSET"),
    "EQUATION": Keyword("model", store),
    "GAP": Keyword("model", store, "ELSET"),
    "INITIAL CONDITIONS": Keyword("model", steps.initial_conditions, "TYPE"),
    "MPC": Keyword("model", constraints.multi_point),
    "PHYSICAL CONSTANTS": Keyword("model", ignore_with_note("no effect: there is no radiation"), ANYTHING),
    "PRE-TENSION SECTION": Keyword("model", store, "SURFACE; NODE"),
    "RIGID BODY": Keyword("model", constraints.rigid_body, "NSET; ELSET; REF NODE; ROT NODE"),
    "SPRING": Keyword("model", store, "ELSET"),
    "TIE": Keyword("model", constraints.tie, "POSITION TOLERANCE; ADJUST; CYCLIC SYMMETRY; NAME", "TYPE; NO ROTATION"),
    "TRANSFORM": Keyword("model", store, "NSET; TYPE"),
    # Supports and loads in steps.
    "BOUNDARY": Keyword("step", steps.condition, "OP; AMPLITUDE; FIXED; TYPE"),
    **dict.fromkeys(
        ("CFLUX", "CLOAD", "DFLUX", "DLOAD", "DSFLUX", "DSLOAD", "FILM", "SFILM", "TEMPERATURE"),
        Keyword("step", steps.condition, "OP; AMPLITUDE"),
    ),
    # Procedures of steps.
    **dict.fromkeys(
        ("COUPLED TEMPERATURE-DISPLACEMENT", "HEAT TRANSFER", "UNCOUPLED TEMPERATURE-DISPLACEMENT"),
        Keyword("procedure", steps.heat_procedure, "STEADY STATE", SOLUTION_CONTROLS),
    ),
    "FREQUENCY": Keyword("procedure", steps.frequency, "", "EIGENSOLVER; NORMALIZATION; SOLVER; STORAGE; GLOBAL"),
    "STATIC": Keyword("procedure", steps.static, "", SOLUTION_CONTROLS),
}
# Ignored keywords: output requests, because results contain all output, and convergence controls.
_OUTPUT = (
    "CONTACT FILE; CONTACT OUTPUT; CONTACT PRINT; EL FILE; EL PRINT; ELEMENT OUTPUT; ENERGY FILE; ENERGY OUTPUT; "
    "ENERGY PRINT; FACE PRINT; FILE FORMAT; FILE OUTPUT; MONITOR; NODE FILE; NODE OUTPUT; NODE PRINT; OUTPUT; "
    "PREPRINT; PRINT; RESTART; SECTION FILE; SECTION PRINT; TIME POINTS; CONTROLS"
)
OUTPUT = _OUTPUT.split("; ")
# Unsupported keywords by the reason in the error message.
_REASONS = {
    "is outside the scope of fastcontact (elastic, elastic-plastic and hyperelastic materials)": (
        "HYPERFOAM; CREEP; CYCLIC HARDENING; DEFORMATION PLASTICITY; DRUCKER PRAGER; MOHR COULOMB; VISCOELASTIC; "
        "USER MATERIAL; DEPVAR; CONCRETE DAMAGED PLASTICITY; GASKET BEHAVIOR; RATE DEPENDENT; NO COMPRESSION"
    ),
    "is outside the scope of fastcontact (quasi-static: *STATIC, steady heat, and *FREQUENCY after them)": (
        "DYNAMIC; BUCKLE; MODAL DYNAMIC; STEADY STATE DYNAMICS; VISCO; ELECTROMAGNETICS; COMPLEX FREQUENCY; "
        "SENSITIVITY; DAMPING; MODAL DAMPING; GREEN; CRACK PROPAGATION; GEOSTATIC; CONTACT DAMPING; "
        "FEASIBLE DIRECTION"
    ),
    "is outside the scope of fastcontact (solid elements only)": (
        "SHELL SECTION; BEAM SECTION; MEMBRANE SECTION; BEAM GENERAL SECTION; SHELL GENERAL SECTION; FLUID SECTION; "
        "CONNECTOR SECTION; COHESIVE SECTION; GASKET SECTION; MASS; ROTARY INERTIA; DASHPOT; NODAL THICKNESS; "
        "SURFACE SECTION; RIGID SURFACE; TRANSVERSE SHEAR STIFFNESS"
    ),
    "is outside the scope of fastcontact (steady conduction of heat, without radiation)": (
        "RADIATE; SRADIATE; CAVITY DEFINITION; FILM PROPERTY; CFILM; GAP RADIATION"
    ),
    "is not supported": (
        "CONTACT; CONTACT INCLUSIONS; CONTACT PROPERTY ASSIGNMENT; BASE MOTION; SUBMODEL; MODEL CHANGE; "
        "CHANGE CONTACT TYPE; CONTACT CONTROLS; FRACTURE CRITERION; DEBOND; CONTACT INITIALIZATION DATA; "
        "CONTACT STABILIZATION; SYSTEM; NGEN; NFILL; ELGEN; NCOPY; ELCOPY; PARAMETER; MATRIX INPUT; SUPER ELEMENT; "
        "USER ELEMENT; DISTRIBUTING COUPLING; KINEMATIC COUPLING; CONNECTOR BEHAVIOR; EMBEDDED ELEMENT; FIELD; "
        "VALUES AT INFINITY; FILTER; IMPERFECTION; IMPORT"
    ),
}
REFUSED = {name: reason for reason, names in _REASONS.items() for name in names.split("; ")}
# Keywords with their usual blanks, by keyword without blanks.
_STANDARD_SPELLING = {name.replace(" ", ""): name for name in (*TRANSLATED, *OUTPUT, *REFUSED)}


def standard_spelling(block: Block) -> Block:
    """Return a block with the usual blanks in its keyword and parameters, which CalculiX also accepts without blanks."""
    keyword = _STANDARD_SPELLING.get(block.keyword.replace(" ", ""), block.keyword)
    entry = TRANSLATED.get(keyword)
    names = {name.replace(" ", ""): name for name in entry.parameters} if entry else {}
    parameters = {names.get(name.replace(" ", ""), name): value for name, value in block.parameters.items()}
    return replace(block, location=replace(block.location, keyword=keyword), parameters=parameters)


def keyword_properties(block: Block, prefix: str) -> Keyword:
    """Return the properties of a keyword.

    Raises CaseError if the keyword or one of its parameters is unknown or not supported. Messages about keywords outside the
    scope of the package begin with `prefix`.
    """
    keyword = block.keyword
    if keyword in REFUSED:
        raise block.error(f"{prefix}*{keyword} {REFUSED[keyword]}")
    entry = TRANSLATED.get(keyword)
    if entry is None:
        similar = difflib.get_close_matches(keyword, [*TRANSLATED, *OUTPUT, *REFUSED, "INCLUDE"], n=1, cutoff=0.6)
        suggestion = f": did you mean *{similar[0]}?" if similar else ""
        raise block.error(f"unknown keyword *{keyword}{suggestion}")
    for name in block.parameters:
        if entry.used != ANYTHING and name not in entry.parameters:
            accepted = ", ".join(sorted(entry.parameters)) or "none"
            raise block.error(f"the parameter {name[:40]} of *{keyword} is not supported; it takes {accepted}")
    return entry


# Contexts that require an open material, interaction, coupling or step, with the message if none is open.
MISSING_OWNERS = {
    "material": "belongs below *MATERIAL",
    "interaction": "belongs below *SURFACE INTERACTION",
    "coupling": "belongs below *COUPLING",
    "procedure": "belongs in a step",
}
# Damage keywords, which are supported below *SURFACE INTERACTION but not below *MATERIAL.
COHESIVE_DAMAGE = ("DAMAGE INITIATION", "DAMAGE EVOLUTION", "DAMAGE STABILIZATION")


@dataclass
class Reader:
    """State of reading a deck: its content so far, and the open part, instance, material, interaction, step and coupling."""

    content: Content = field(default_factory=Content)
    part: Part | None = None
    instance: Instance | None = None
    material: Material | None = None
    interaction: Interaction | None = None
    step: Step | None = None
    coupling: Block | None = None

    def read_block(self, block: Block) -> None:
        """Read one block, which closes the open objects to which its keyword cannot belong."""
        keyword, content = block.keyword, self.content
        if keyword == "RESTART" and "READ" in block.parameters:
            raise block.error("READ is not supported: give all steps in one deck")
        if keyword in OUTPUT:
            content.outputs.append(block.location)
            return
        properties = keyword_properties(block, self.material.prefix if self.material else "")
        context = properties.context
        if self.coupling is not None and keyword not in ("KINEMATIC", "DISTRIBUTING"):
            raise self.coupling.error("*KINEMATIC or *DISTRIBUTING must follow")
        if self.material is not None and keyword in COHESIVE_DAMAGE:
            raise block.error(f"{self.material.prefix}damage is supported for cohesive layers only, not in bodies")
        owner = {
            "part": self.part or content.root, "material": self.material, "interaction": self.interaction,
            "coupling": self.coupling, "procedure": self.step, "step": self.step,
        }.get(context)  # fmt: skip
        if owner is None and context in MISSING_OWNERS:
            raise block.error(MISSING_OWNERS[context])
        if context != "material":
            self.material = None
        if context not in ("material", "interaction"):
            self.interaction = None
        if context in ("part", "property", "model") and keyword != "AMPLITUDE" and self.step is not None:
            raise block.error("cannot be inside a step")
        if context in ("model", "step") and not (self.part is None and self.instance is None):
            raise block.error("is supported for the whole assembly only, not inside a part or instance")
        if context == "part" and self.instance is not None:
            raise block.error("is not supported inside an instance: put it into the part or the assembly")
        new_object = properties.read(content, *([] if context in ("deck", "property", "model") else [owner]), block)
        if properties.opens:
            setattr(self, properties.opens, new_object)


def read_content(blocks: Iterable[Block]) -> Content:
    """Return the content of a deck from its blocks. Raises CaseError with file, line and keyword if a block is invalid."""
    reader = Reader()
    for block in blocks:
        reader.read_block(standard_spelling(block))
    if reader.step is not None:
        raise reader.step.error("the step has no *END STEP: the deck is cut off, or the line is missing")
    if reader.coupling is not None:
        raise reader.coupling.error("*KINEMATIC or *DISTRIBUTING must follow")
    steps.check_steps(reader.content)
    return reader.content
