"""Cohesive behaviour of decks: tractions between stiff cubes by the laws of Abaqus; refusals."""

import numpy as np
import pytest
from deck_text import CONTACT, SUPPORTS, WHOLE, deck_of

import fastcontact as fc

K, TN, TS, GN, GS, POWER = 1000.0, 10.0, 20.0, 0.5, 1.5, 1.45
LAYER = """*Surface Interaction, name=si
*Surface Behavior, pressure-overclosure=HARD
*Cohesive Behavior, eligibility=ORIGINAL CONTACTS
1000., 1000., 1000.
*Damage Initiation, criterion={}
{}
*Damage Evolution, {}
{}
"""
STEPS = """*Step
*Static
1., 1.
*Boundary
up, 1, 1, {0}
up, 3, 3, {1}
*End Step
"""


def pulled(folder, motions, criterion="QUADS", strengths=f"{TN}, {TS}, {TS}", kind=None, energies=f"{GN}, {GS}, {GS}"):
    """Return by step the traction on the upper cube, along x and z, as its nodes move."""
    kind = kind or f"type=ENERGY, mixed mode behavior=BK, power={POWER}"
    layer = LAYER.format(criterion, strengths, kind, energies)
    head = WHOLE[: WHOLE.index("*Step\n")].replace(CONTACT[: CONTACT.index("*Contact Pair")], layer)
    head = head.replace("200000.", "1.E9").replace(
        SUPPORTS, "*Nset, nset=up\n15, 16, 17, 18\n*Boundary\nbottom, 1, 3\nup, 2\n"
    )
    deck = deck_of(folder, head + "".join(STEPS.format(*motion) for motion in motions))
    return [step.contact["ss/sm"].force[[0, 2]] for step in deck.solve() if step.load_factor == round(step.load_factor)]


def traction(sliding, opening, criterion="QUADS", mode="BK"):
    """Return the traction of a layer that was never stretched farther, its damage by the energy that remains."""
    size = np.hypot(opening, sliding)
    n, s = K * opening / TN, K * sliding / TS
    onset = size / (np.hypot(n, s) if criterion == "QUADS" else max(n, s))
    share = sliding**2 / size**2
    energy = GN + (GS - GN) * share**POWER
    if mode == "POWER LAW":
        energy = (((1 - share) / GN) ** POWER + (share / GS) ** POWER) ** (-1 / POWER)
    end = 2.0 * energy / (K * onset)
    kept = 1.0 if size < onset else max(onset * (end - size) / (size * (end - onset)), 0.0)
    return -kept * K * np.array([sliding, opening])


@pytest.mark.each_value
@pytest.mark.filterwarnings("ignore:hex8 cells are too stiff")
@pytest.mark.parametrize("criterion", ["QUADS", "MAXS"])
@pytest.mark.parametrize("mode", ["BK", "POWER LAW"])
def test_mixed_modes(tmp_path, criterion, mode):
    """Before damage, while the layer breaks, on the way back, and when it is broken."""
    path = [(0.004, 0.006), (0.03, 0.045), (0.015, 0.0225), (0.2, 0.3)]
    found = pulled(tmp_path, path, criterion, kind=f"type=ENERGY, mixed mode behavior={mode}, power={POWER}")
    whole = [traction(*motion, criterion, mode) for motion in path]
    exact = [whole[0], whole[1], whole[1] / 2.0, np.zeros(2)]
    facing = 1.0 - np.array([sliding for sliding, _ in path])[:, None]
    assert np.array(found) / facing == pytest.approx(np.array(exact), rel=1e-4, abs=1e-5)


@pytest.mark.parametrize("evolution", [("type=DISPLACEMENT", "0.09"), ("type=ENERGY, softening=LINEAR", "0.5")])
def test_pure_opening(tmp_path, evolution):
    """Of one strength, 10: broken at an opening of 0.1, 0.09 beyond that of the largest traction."""
    found = pulled(tmp_path, [(0.0, 0.055)], "QUADS", "10., 10., 10.", *evolution)
    assert found[0][1] == pytest.approx(-5.0, rel=1e-4)


def test_without_stiffness_and_damage_the_sides_are_tied(tmp_path):
    text = WHOLE.replace("name=si\n", "name=si\n*Cohesive Behavior\n", 1).replace("roof, P, 100.", "roof, P, -100.")
    deck = deck_of(tmp_path, text)
    assert deck.model.contact[0].options["kind"] == "tied"
    assert deck.solve()[0].contact["ss/sm"].force[2] == pytest.approx(-100.0, rel=1e-9)


WHOLE_LAYER = LAYER.format("QUADS", "1., 2., 2.", "type=ENERGY, mixed mode behavior=BK, power=2.", "1., 2., 2.")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("1000., 1000., 1000.", "1000., 10., 10.", r"\*COHESIVE BEHAVIOR: a layer must have the same stiffness"),
        ("criterion=QUADS", "criterion=MAXE", r"\*DAMAGE INITIATION: CRITERION=MAXE is not supported"),
        ("\n1., 2., 2.\n*Damage", "\n1., 2., 3.\n*Damage", r"\*DAMAGE INITIATION: the strengths along both shear"),
        ("power=2.", "softening=EXPONENTIAL", r"\*DAMAGE EVOLUTION: SOFTENING=EXPONENTIAL"),
        ("*Damage Initiation, criterion=QUADS\n1., 2., 2.\n", "", "INITIATION and .DAMAGE EVOLUTION are both needed"),
        (", power=2.", "", r"\*DAMAGE EVOLUTION: the parameter POWER is missing"),
        ("type=ENERGY, mixed mode behavior=BK, power=2.", "type=DISPLACEMENT", r"QUADS and equal strengths"),
        ("*Cohesive Behavior, eligibility=ORIGINAL CONTACTS\n1000., 1000., 1000.\n", "", r"has no \*COHESIVE BEHAVIOR"),
        ("*Surface Behavior", "*Friction\n0.3\n*Surface Behavior", r"BEHAVIOR: a cohesive layer excludes \*FRICTION"),
        ("eligibility=ORIGINAL CONTACTS", "repeated contacts", r"the parameter REPEATED CONTACTS"),
        ("1000., 1000., 1000.", "0.1, 0.1, 0.1", r"line 52.*would break before its traction falls"),
    ],
)  # fmt: skip
def test_what_is_refused(tmp_path, old, new, said):
    assert WHOLE_LAYER.count(old) == 1
    text = WHOLE.replace(CONTACT[: CONTACT.index("*Contact Pair")], WHOLE_LAYER.replace(old, new))
    with pytest.raises(fc.FastcontactError, match=said):
        deck_of(tmp_path, text)


def test_sides_that_are_apart_are_refused(tmp_path):
    text = WHOLE.replace(CONTACT[: CONTACT.index("*Contact Pair")], WHOLE_LAYER)
    for node in (11, 12, 13, 14):
        text = text.replace(f"\n{node}, ", f"\n{node}, ")
    text = "\n".join(line[:-2] + "1.1" if line[:3] in ("11,", "12,", "13,", "14,") and line.endswith(" 1.") else line
                     for line in text.split("\n"))  # fmt: skip
    with pytest.raises(fc.CaseError, match=r"\*CONTACT PAIR: a cohesive layer between sides that are 0.1 apart"):
        deck_of(tmp_path, text)


def test_damage_of_a_material_is_none_of_a_layer(tmp_path):
    text = WHOLE.replace("200000., 0.\n", "200000., 0.\n*Damage Initiation, criterion=QUADS\n1., 2., 2.\n")
    with pytest.raises(fc.CaseError, match="material 'steel': damage is supported for cohesive layers only"):
        deck_of(tmp_path, text)
