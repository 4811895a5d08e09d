"""From the blocks of a deck to its content, one keyword after the other, each where it may stand."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from fastcontact.cases.decks import (
    connections,
    cyclic_symmetry,
    geometry,
    nonlinear,
    pretension,
    properties,
    stepping,
    temperatures,
)
from fastcontact.cases.decks.blocks import Block
from fastcontact.cases.decks.content import Content, Instance, Interaction, Material, Part, Step
from fastcontact.cases.decks.keywords import OUTPUT, check, spelled

IN_PARTS: dict[str, Callable[[Content, Part, Block], None]] = {
    "NODE": geometry.nodes,
    "ELEMENT": geometry.cells,
    "NSET": geometry.node_set,
    "ELSET": geometry.element_set,
    "SURFACE": geometry.surface,
    "SOLID SECTION": properties.section,
}
OF_MATERIALS: dict[str, Callable[[Content, Material, Block], None]] = {
    "ELASTIC": properties.elastic,
    "PLASTIC": nonlinear.plastic,
    "HYPERELASTIC": nonlinear.hyperelastic,
    "DENSITY": properties.density,
    "EXPANSION": temperatures.expansion,
    "CONDUCTIVITY": temperatures.without_effect,
    "SPECIFIC HEAT": temperatures.without_effect,
}
OF_INTERACTIONS: dict[str, Callable[[Content, Interaction, Block], None]] = {
    "SURFACE BEHAVIOR": properties.behaviour,
    "FRICTION": properties.friction,
}
OF_MODELS: dict[str, Callable[[Content, Block], None]] = {
    "AMPLITUDE": properties.amplitude,
    "GAP": properties.gap,
    "INITIAL CONDITIONS": temperatures.initial_conditions,
    "ORIENTATION": properties.orientation,
    "PRE-TENSION SECTION": pretension.pretension_section,
    "SPRING": properties.spring,
    "CONTACT PAIR": connections.contact_pair,
    "CLEARANCE": connections.clearance,
    "CYCLIC SYMMETRY MODEL": cyclic_symmetry.cyclic_symmetry_model,
    "TIE": connections.tie,
    "EQUATION": connections.equation,
    "MPC": connections.multi_point,
    "RIGID BODY": connections.rigid_body,
    "TRANSFORM": connections.transform,
}
IN_STEPS = ("BOUNDARY", "CLOAD", "DLOAD", "DSLOAD", "TEMPERATURE")


@dataclass
class Reader:
    """What is open while a deck is read: part, instance, material, interaction, step, coupling."""

    content: Content = field(default_factory=Content)
    part: Part | None = None
    instance: Instance | None = None
    material: Material | None = None
    interaction: Interaction | None = None
    step: Step | None = None
    coupling: Block | None = None

    def take(self, block: Block) -> None:
        """Read one block."""
        keyword, content = block.keyword, self.content
        if keyword in OUTPUT:
            content.outputs.append(block.location)
            return
        check(block, f"material '{self.material.name}': " if self.material else "")
        if self.coupling is not None and keyword not in ("KINEMATIC", "DISTRIBUTING"):
            raise self.coupling.location.refuse("*KINEMATIC or *DISTRIBUTING must follow")
        if keyword in OF_MATERIALS:
            if self.material is None:
                raise block.location.refuse("belongs below *MATERIAL")
            OF_MATERIALS[keyword](content, self.material, block)
            return
        self.material = None
        if keyword in OF_INTERACTIONS:
            if self.interaction is None:
                raise block.location.refuse("belongs below *SURFACE INTERACTION")
            OF_INTERACTIONS[keyword](content, self.interaction, block)
            return
        self.interaction = None
        if keyword in IN_PARTS:
            self._not_in_step(block)
            if self.instance is not None:
                raise block.location.refuse(
                    "is not supported inside of an instance: put it into the part or the assembly"
                )
            IN_PARTS[keyword](content, self._open_part(), block)
        elif keyword in OF_MODELS:
            if keyword != "AMPLITUDE":
                self._not_in_step(block)
            self._not_in_part(block)
            OF_MODELS[keyword](content, block)
        elif keyword in IN_STEPS:
            self._not_in_part(block)
            stepping.given(content, self.step, block)
        else:
            getattr(self, "_" + keyword.lower().replace(" ", "_"))(block)

    def _open_part(self) -> Part:
        return self.part or self.content.root

    def _not_in_step(self, block: Block) -> None:
        if self.step is not None:
            raise block.location.refuse("cannot stand inside of a step")

    def _not_in_part(self, block: Block) -> None:
        if self.part is not None or self.instance is not None:
            raise block.location.refuse("is supported for the whole assembly only, not inside of a part or instance")

    def _heading(self, block: Block) -> None:
        self.content.title = " ".join(" ".join(", ".join(row.entries) for row in block.rows[:1]).split())

    def _assembly(self, block: Block) -> None:
        self.part = None

    def _end_assembly(self, block: Block) -> None:
        self.part = None

    def _part(self, block: Block) -> None:
        self.part = geometry.new_part(self.content, block)

    def _end_part(self, block: Block) -> None:
        self.part = None

    def _instance(self, block: Block) -> None:
        self.instance = geometry.instance(self.content, block)

    def _end_instance(self, block: Block) -> None:
        self.instance = None

    def _material(self, block: Block) -> None:
        self._not_in_step(block)
        self.material = properties.material(self.content, block)

    def _surface_interaction(self, block: Block) -> None:
        self._not_in_step(block)
        self.interaction = properties.interaction(self.content, block)

    def _change_friction(self, block: Block) -> None:
        if self.step is None:
            raise block.location.refuse("belongs into a step")
        self.interaction = properties.changed_interaction(self.content, block)

    def _coupling(self, block: Block) -> None:
        self._not_in_step(block)
        self.coupling = block

    def _kinematic(self, block: Block) -> None:
        if self.coupling is None:
            raise block.location.refuse("belongs below *COUPLING")
        connections.coupling(self.content, self.coupling, block)
        self.coupling = None

    _distributing = _kinematic

    def _step(self, block: Block) -> None:
        if self.step is not None:
            raise block.location.refuse("the step before has no *END STEP")
        self._not_in_part(block)
        self.step = stepping.new_step(self.content, block)

    def _static(self, block: Block) -> None:
        if self.step is None:
            raise block.location.refuse("belongs into a step")
        stepping.static(self.content, self.step, block)

    def _frequency(self, block: Block) -> None:
        if self.step is None:
            raise block.location.refuse("belongs into a step")
        stepping.frequency(self.step, block)

    def _end_step(self, block: Block) -> None:
        if self.step is None:
            raise block.location.refuse("there is no step to end")
        stepping.end_step(self.content, self.step)
        self.step = None


def read_content(blocks: Iterable[Block]) -> Content:
    """Return what the blocks of a deck say; CaseError with file, line and keyword where something is wrong."""
    reader = Reader()
    for block in blocks:
        reader.take(spelled(block))
    if reader.step is not None:
        raise reader.step.location.refuse("the step has no *END STEP: the deck is cut off, or the line is missing")
    if reader.coupling is not None:
        raise reader.coupling.location.refuse("*KINEMATIC or *DISTRIBUTING must follow")
    return reader.content
