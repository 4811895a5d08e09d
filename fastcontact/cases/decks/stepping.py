"""Keywords of the steps: *STEP, *STATIC, and the blocks of supports and loads in them."""

from __future__ import annotations

from fastcontact.cases.decks.blocks import Block, folded
from fastcontact.cases.decks.content import Content, Given, Step

# Parts of a step whose pair has friction, at most.
MOST_PARTS = 20


def new_step(content: Content, block: Block) -> Step:
    """*STEP."""
    nonlinear = "NLGEOM" in block.parameters and block.get("NLGEOM", "YES").upper() != "NO"
    if "PERTURBATION" in block.parameters:
        raise block.place.refuse("PERTURBATION is not supported: contact has no linear perturbation")
    block.choice("AMPLITUDE", ("RAMP",))
    content.steps.append(Step(block.place, nonlinear))
    return content.steps[-1]


def static(content: Content, step: Step, block: Block) -> None:
    """*STATIC: first increment and length of the step; how it is cut is decided here."""
    if step.static:
        raise block.place.refuse("the step has two of it")
    step.static = True
    if "STABILIZE" in block.parameters:
        content.note(
            block.place, "STABILIZE has no effect: contact is exact, and bodies that it alone holds need no damping"
        )
    for row in block.rows[:1]:
        step.increment = row.number(0, 1.0)
        step.period = row.number(1, 1.0)
        for index in (2, 3):
            row.number(index, 1.0)
        if not (step.period > 0 and step.increment > 0):
            raise row.place.refuse("the increment and the length of the step must be positive")


def given(content: Content, step: Step | None, block: Block) -> None:
    """Keep a block of supports or loads, in its step or before all steps."""
    name = block.get("AMPLITUDE")
    if name and folded(name) not in content.amplitudes:
        known = ", ".join(content.amplitudes) or "none"
        raise block.place.refuse(f"amplitude '{name}' is not defined above this line; amplitudes: {known}")
    made = Given(block, block.choice("OP", ("MOD", "NEW")) == "NEW", name)
    if step is not None:
        step.given.append(made)
    elif block.keyword == "BOUNDARY":
        content.supports.append(made)
    else:
        raise block.place.refuse("loads belong into a step")
