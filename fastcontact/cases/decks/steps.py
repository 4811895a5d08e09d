"""Keywords of steps: *STEP and its procedures, *AMPLITUDE, supports, loads and initial conditions; and checks of steps."""

from __future__ import annotations

from itertools import pairwise

from fastcontact.cases.decks.blocks import Block, key_of, look_up
from fastcontact.cases.decks.content import Amplitude, Content, Step

# Largest number of increments into which a step of a path-dependent model is divided.
MOST_INCREMENTS = 20


def new_step(content: Content, step: Step | None, block: Block) -> Step:
    """Read *STEP and return the new step."""
    if step is not None:
        raise block.error("the previous step has no *END STEP")
    nonlinear = "NLGEOM" in block.parameters and block.get("NLGEOM", "YES").upper() != "NO"
    if content.modes is not None:
        raise block.error("follows a step with *FREQUENCY, which must be the last step")
    block.choice("AMPLITUDE", ("RAMP",))
    content.steps.append(Step(block.location, nonlinear, perturbation="PERTURBATION" in block.parameters))
    return content.steps[-1]


def static(content: Content, step: Step, block: Block) -> None:
    """Read *STATIC: the duration of the step divided by its initial increment is the number of increments."""
    if step.has_procedure:
        raise block.error("the step has this keyword twice")
    if step.n_modes:
        raise block.error("a step has either *STATIC or one *FREQUENCY")
    if step.perturbation:
        raise step.error("PERTURBATION is not supported with *STATIC, only with *FREQUENCY")
    step.has_procedure = True
    if "STABILIZE" in block.parameters:
        content.note(block, "STABILIZE has no effect: bodies that are held by contact alone need no damping")
    for row in block.rows[:1]:
        step.increment, step.period = row.positive(0, "increment", 1.0), row.positive(1, "length of the step", 1.0)
        for index in (2, 3):
            row.number(index, 1.0)


def heat_procedure(content: Content, step: Step, block: Block) -> None:
    """Read *HEAT TRANSFER, *COUPLED or *UNCOUPLED TEMPERATURE-DISPLACEMENT: *STATIC with steady heat conduction."""
    if "STEADY STATE" not in block.parameters:
        raise block.error("only STEADY STATE is supported, not transient heat conduction")
    static(content, step, block)
    step.heat = "uncoupled" if block.keyword == "HEAT TRANSFER" else "coupled"
    if block.keyword[:2] == "UN":
        content.note(block, "temperatures and displacements are solved together")


def frequency(content: Content, step: Step, block: Block) -> None:
    """Read *FREQUENCY: the number of modes, which is 10 by default."""
    if step.has_procedure or step.n_modes:
        raise block.error("a step has either *STATIC or one *FREQUENCY")
    number = block.rows[0].integer(0, 10) if block.rows else 10
    if number < 1:
        raise block.rows[0].error("the number of modes must be at least 1")
    step.n_modes = number


def end_step(content: Content, step: Step | None, block: Block) -> None:
    """Read *END STEP; a step with *FREQUENCY is removed from the load steps and stored as a request for modes."""
    if step is None:
        raise block.error("there is no step to end")
    if not step.n_modes:
        if not step.has_procedure:
            raise step.error("the step has no *STATIC or other procedure")
        return
    if step.conditions:
        raise step.conditions[0].error(
            "cannot be in a step with *FREQUENCY: the modes use the supports of the preceding steps"
        )
    content.steps.pop()
    if not content.steps:
        raise step.error("*FREQUENCY needs a step with *STATIC before it: modes are vibrations about its last state")
    if content.steps[-1].heat == "uncoupled":
        raise step.error("*FREQUENCY after *HEAT TRANSFER is not supported: displacements are fixed there")
    stiffening = step.perturbation or any(earlier.nonlinear for earlier in content.steps)
    content.modes = {"n": step.n_modes, "stress_stiffening": stiffening}
    content.note(
        step,
        f"{step.n_modes} modes at the last step, {'with' if stiffening else 'without'} the initial-stress stiffness "
        "(included with PERTURBATION, or after a step with NLGEOM)",
    )


def condition(content: Content, step: Step | None, block: Block) -> None:
    """Store a block of supports or loads of a step, or a *BOUNDARY that precedes all steps."""
    if name := block.get("AMPLITUDE"):
        look_up("amplitude", name, content.amplitudes, block)
    block.choice("OP", ("MOD", "NEW"))
    if step is not None:
        step.conditions.append(block)
    elif block.keyword == "BOUNDARY":
        content.blocks["BOUNDARY"].append(block)
    else:
        raise block.error("loads belong in a step")


def amplitude(content: Content, block: Block) -> None:
    """Read *AMPLITUDE: pairs of time and multiplier."""
    name = block.required("NAME")
    block.choice("DEFINITION", ("TABULAR",))
    block.choice("VALUE", ("RELATIVE",))
    total_time = block.choice("TIME", ("STEP TIME", "TOTAL TIME")) == "TOTAL TIME"
    numbers = block.numbers()
    times, values = numbers[::2], numbers[1::2]
    if not times or len(times) != len(values) or any(b <= a for a, b in pairwise(times)):
        raise block.error(f"amplitude '{name}' needs pairs of time and multiplier, with ascending times")
    content.amplitudes[key_of(name)] = Amplitude(block.location, name, tuple(times), tuple(values), total_time)


def initial_conditions(content: Content, block: Block) -> None:
    """Store a block *INITIAL CONDITIONS, which gives nodal temperatures or element stresses before the first step."""
    block.required("TYPE")
    content.blocks[f"INITIAL {block.choice('TYPE', ('TEMPERATURE', 'STRESS'))}"].append(block)


# Keywords of heat loads.
HEAT_LOADS = ("CFLUX", "DFLUX", "DSFLUX", "FILM", "SFILM")


def check_steps(content: Content) -> None:
    """Raise CaseError if the procedures or the loads of the steps are inconsistent."""
    first = next((step for step in content.steps if step.heat), None)
    for number, step in enumerate(content.steps):
        if first and step.heat != first.heat and (first.heat == "uncoupled" or number > content.steps.index(first)):
            raise step.error(
                "*HEAT TRANSFER cannot be combined with other procedures, and *COUPLED TEMPERATURE-DISPLACEMENT cannot "
                "precede them: use *HEAT TRANSFER for all steps, or *COUPLED TEMPERATURE-DISPLACEMENT for all"
            )
        for block in step.conditions:
            if block.keyword in HEAT_LOADS and not step.heat:
                raise block.error("needs a step with *HEAT TRANSFER or *COUPLED TEMPERATURE-DISPLACEMENT")
            if block.keyword == "TEMPERATURE" and first:
                raise block.error("temperatures are computed in this deck: prescribe degree of freedom 11 by *BOUNDARY")
            if block.keyword in ("CLOAD", "DLOAD", "DSLOAD") and step.heat == "uncoupled":
                raise block.error(
                    "is not a heat load: use *COUPLED TEMPERATURE-DISPLACEMENT in place of *HEAT TRANSFER"
                )
