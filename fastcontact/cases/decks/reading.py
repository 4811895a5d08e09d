"""Read the blocks of a deck into its content, and check that each keyword is in its place."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from fastcontact.cases.decks import connections, geometry, heat, properties, stepping
from fastcontact.cases.decks.blocks import Block
from fastcontact.cases.decks.content import Content, Instance, Interaction, Material, Part, Step
from fastcontact.cases.decks.keywords import OUTPUT, checked, spelled

# Damage keywords, which are supported for cohesive layers only.
COHESIVE_DAMAGE = ("DAMAGE INITIATION", "DAMAGE EVOLUTION", "DAMAGE STABILIZATION")


@dataclass
class Reader:
    """State while a deck is read: the open part, instance, material, interaction, step and coupling."""

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
        known = checked(block, f"material '{self.material.name}': " if self.material else "")
        read = known.read or getattr(self, "_" + keyword.lower().replace(" ", "_"))
        if self.coupling is not None and keyword not in ("KINEMATIC", "DISTRIBUTING"):
            raise self.coupling.refuse("*KINEMATIC or *DISTRIBUTING must follow")
        if known.place == "material":
            if self.material is None:
                raise block.refuse("belongs below *MATERIAL")
            read(content, self.material, block)
            return
        if self.material is not None and keyword in COHESIVE_DAMAGE:
            name = self.material.name
            raise block.refuse(f"material '{name}': damage is supported for cohesive layers only, not in bodies")
        self.material = None
        if known.place == "interaction":
            if self.interaction is None:
                raise block.refuse("belongs below *SURFACE INTERACTION")
            read(content, self.interaction, block)
            return
        self.interaction = None
        if known.place == "part":
            self._not_in_step(block)
            if self.instance is not None:
                raise block.refuse("is not supported inside an instance: put it into the part or the assembly")
            read(content, self.part or self.content.root, block)
        elif known.place == "model":
            if keyword != "AMPLITUDE":
                self._not_in_step(block)
            self._not_in_part(block)
            read(content, block)
        elif known.place == "step":
            self._not_in_part(block)
            read(content, self.step, block)
        elif known.place == "procedure":
            if self.step is None:
                raise block.refuse("belongs in a step")
            read(content, self.step, block)
        else:
            read(block)

    def _not_in_step(self, block: Block) -> None:
        if self.step is not None:
            raise block.refuse("cannot be inside a step")

    def _not_in_part(self, block: Block) -> None:
        if self.part is not None or self.instance is not None:
            raise block.refuse("is supported for the whole assembly only, not inside a part or instance")

    def _heading(self, block: Block) -> None:
        self.content.title = " ".join(" ".join(", ".join(row.entries) for row in block.rows[:1]).split())

    def _assembly(self, block: Block) -> None:
        self.part = None

    _end_part = _end_assembly = _assembly

    def _part(self, block: Block) -> None:
        self.part = geometry.new_part(self.content, block)

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
            raise block.refuse("belongs in a step")
        self.interaction = properties.changed_interaction(self.content, block)

    def _coupling(self, block: Block) -> None:
        self._not_in_step(block)
        self.coupling = block

    def _kinematic(self, block: Block) -> None:
        if self.coupling is None:
            raise block.refuse("belongs below *COUPLING")
        connections.coupling(self.content, self.coupling, block)
        self.coupling = None

    _distributing = _kinematic

    def _step(self, block: Block) -> None:
        if self.step is not None:
            raise block.refuse("the previous step has no *END STEP")
        self._not_in_part(block)
        self.step = stepping.new_step(self.content, block)

    def _end_step(self, block: Block) -> None:
        if self.step is None:
            raise block.refuse("there is no step to end")
        stepping.end_step(self.content, self.step)
        self.step = None


def read_content(blocks: Iterable[Block]) -> Content:
    """Return the content of the blocks of a deck; raises CaseError with file, line and keyword if it is invalid."""
    reader = Reader()
    for block in blocks:
        reader.take(spelled(block))
    if reader.step is not None:
        raise reader.step.refuse("the step has no *END STEP: the deck is cut off, or the line is missing")
    if reader.coupling is not None:
        raise reader.coupling.refuse("*KINEMATIC or *DISTRIBUTING must follow")
    heat.check_steps(reader.content)
    return reader.content
