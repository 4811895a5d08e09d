"""*CHANGE FRICTION: a coefficient that changes at the beginning of a step, and histories of it in a model."""

import pytest
from deck_text import CONTACT, MATERIAL, NODES, STEP, SUPPORTS, WHOLE, deck_of
from pairwise import first_of

import fastcontact as fc

RUBBING = CONTACT.replace("*Contact Pair", "*Friction\n0.1\n*Contact Pair")
HELD = "*Boundary\nbottom, 1, 3\ny0, 2\n"
CHANGE = "*Change Friction, interaction=si\n*Friction\n0.3\n"


def driven(lines, place):
    return f"*Step\n*Static, direct\n1., 1.\n{lines}*Boundary\ntop, 1, 1, {place}\n*Dsload\nroof, P, 100.\n*End Step\n"


@pytest.mark.parametrize(("text", "before"), first_of(1, [(RUBBING, 10.0), (CONTACT, 0.0)]))
def test_more_friction_from_the_third_step_on(text, before, tmp_path):
    """The upper cube, pressed by 100, is drawn along the lower one: 10 or nothing, then 30, but for its tilt."""
    steps = driven("", 0.0) + driven("", 0.01) + driven(CHANGE, 0.02) + driven("", 0.03)
    deck = deck_of(tmp_path, NODES + MATERIAL + text + HELD + steps)
    top = deck.points_of("top")
    forces = [step.reaction[top, 0].sum() for step in deck.solve()]
    assert forces == pytest.approx([0.0, before, 30.0, 30.0], rel=1e-2, abs=1e-2)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("*Change Friction, interaction=si\n", r"\*CHANGE FRICTION: must be followed by \*FRICTION"),
        (CHANGE.replace("=si", "=no"), "surface interaction 'no' is not defined; interactions: si"),
        (CHANGE.replace("0.3", "0.3, 1e5"), "a change of the stick slope"),
    ],
)
def test_what_is_refused(lines, message, tmp_path):
    steps = STEP.replace("*Dsload", lines + "*Dsload")
    with pytest.raises(fc.CaseError, match=message):
        deck_of(tmp_path, NODES + MATERIAL + RUBBING + SUPPORTS + steps)
    with pytest.raises(fc.CaseError, match=r"\*CHANGE FRICTION: belongs in a step"):
        deck_of(tmp_path, WHOLE.replace("*Boundary", CHANGE + "*Boundary"))


def test_histories_of_friction_are_checked():
    model = fc.Model(fc.generate.half_spheres("quad4", arc_sizes=(6.0, 12.0), segments=2), "axisymmetric")
    sides = {"secondary": "CONT1", "primary": "CONT2"}
    with pytest.raises(fc.ContactError, match="has a friction_ramp, but no friction that it could multiply"):
        model.add_contact("a", **sides, friction_ramp=[(0.0, 1.0), (1.0, 0.0)])
    with pytest.raises(fc.ContactError, match="negative multipliers"):
        model.add_contact("a", **sides, friction=0.1, friction_ramp=[(0.0, 1.0), (1.0, -1.0)])
