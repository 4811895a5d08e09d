"""Heat in decks compared with exact solutions: two bars, films, sources, histories, expansion; refusals."""

import numpy as np
import pytest
from deck_text import deck_of
from refusals import refused

import fastcontact as fc

SIDE, LENGTH = 0.05, 0.1
FACES = {"8": ("S1", "S2"), "4": ("S1", "S3")}


def two_bars(kind="DC3D8"):
    """Return two bars, one above the other along the last axis, each of two elements, cold and hot ends named."""
    plane = kind[:4] in ("DC2D", "DCAX") or kind[:3] in ("CPE", "CAX")
    base = [(0.0, 0.0), (SIDE, 0.0)] if plane else [(0.0, 0.0), (SIDE, 0.0), (SIDE, SIDE), (0.0, SIDE)]
    lines, per = ["*NODE"], len(base)
    for level, height in enumerate([0.0, 0.05, 0.1, 0.1, 0.15, 0.2]):
        for k, (x, y) in enumerate(base):
            place = f"{x}, {height}" if plane else f"{x}, {y}, {height}"
            lines.append(f"{level * per + k + 1}, {place}")
    for name, levels in (("low", (0, 1)), ("up", (3, 4))):
        lines.append(f"*ELEMENT, TYPE={kind}, ELSET={name}")
        for level in levels:
            low, up = ([n * per + k + 1 for k in range(per)] for n in (level, level + 1))
            lines.append(f"{level + 1}, " + ", ".join(map(str, [*low, *(up[::-1] if plane else up)])))
    bottom, top = FACES["4" if plane else "8"]
    lines += [f"*NSET, NSET=HOT, GENERATE\n1, {per}\n*NSET, NSET=COLD, GENERATE\n{5 * per + 1}, {6 * per}"]
    lines += [f"*NSET, NSET=LOWER, GENERATE\n1, {3 * per}\n*NSET, NSET=UPPER, GENERATE\n{3 * per + 1}, {6 * per}"]
    lines += [f"*SURFACE, NAME=LT\n2, {top}\n*SURFACE, NAME=UB\n4, {bottom}\n*SURFACE, NAME=TOP\n5, {top}"]
    return "\n".join(lines) + "\n"


MATERIALS = """*MATERIAL, NAME=A
*CONDUCTIVITY
50.
*MATERIAL, NAME=B
*CONDUCTIVITY, TYPE=ISO
20.
*SOLID SECTION, ELSET=low, MATERIAL=A
*SOLID SECTION, ELSET=up, MATERIAL=B
"""
CONTACT = "*SURFACE INTERACTION, NAME=I\n*GAP CONDUCTANCE\n1000.\n*CONTACT PAIR, INTERACTION=I\nUB, LT\n"
ENDS = "*BOUNDARY\nHOT, 11, 11, 100.\nCOLD, 11, 11, 0.\n"
STEP = "*STEP\n*HEAT TRANSFER, STEADY STATE\n{}*END STEP\n"
AREA = {"DC3D8": SIDE**2, "DC2D4": SIDE, "DCAX4": np.pi * SIDE**2}


def solved(folder, kind="DC3D8", between=CONTACT, before=ENDS, *steps, head=MATERIALS):
    deck = deck_of(folder, two_bars(kind) + head + between + before + "".join(STEP.format(s) for s in steps or ("",)))
    return deck, deck.solve()


@pytest.mark.parametrize("kind", AREA)
def test_two_bars_and_the_conductance_of_their_contact(tmp_path, kind):
    deck, (step,) = solved(tmp_path, kind)
    heat = 12_500.0 * AREA[kind]
    assert step.heat["contacts"]["UB/LT"] == pytest.approx(-heat, rel=1e-9)
    assert step.heat_reaction[deck.points_of("HOT")].sum() == pytest.approx(heat, rel=1e-9)
    by_level = step.temperature.reshape(6, -1)
    assert by_level == pytest.approx(
        np.array([100.0, 87.5, 75.0, 62.5, 31.25, 0.0])[:, None] * np.ones(by_level.shape), abs=1e-7
    )


def test_the_whole_thickness_of_a_plane_model(tmp_path):
    thick = MATERIALS.replace("MATERIAL=A\n*SOLID", "MATERIAL=A\n0.3\n*SOLID") + "0.3\n"
    deck, (step,) = solved(tmp_path, "DC2D4", head=thick)
    assert step.heat["contacts"]["UB/LT"] == pytest.approx(-12_500.0 * SIDE * 0.3, rel=1e-9)
    assert step.heat_reaction[deck.points_of("HOT")].sum() == pytest.approx(12_500.0 * SIDE * 0.3, rel=1e-9)
    one_watt = "*CFLUX\n" + "".join(f"{n}, 11, 0.5\n" for n in (11, 12))
    _, (step,) = solved(tmp_path, "DC2D4", CONTACT, "*BOUNDARY\nHOT, 11, 11, 0.\n", one_watt, head=thick)
    resistance = (LENGTH / 50.0 + 1e-3 + LENGTH / 20.0) / (SIDE * 0.3)
    assert step.temperature.max() == pytest.approx(resistance, rel=1e-9)


def test_tied_bars_are_one(tmp_path):
    deck, (step,) = solved(tmp_path, between="*TIE, NAME=glue\nUB, LT\n")
    flux = 100.0 / (LENGTH / 50.0 + LENGTH / 20.0)
    assert -step.heat["contacts"]["UB/LT"] == pytest.approx(flux * SIDE**2, rel=1e-7)
    assert any("the temperatures of the sides differ by" in note for note in deck.notes)


@pytest.mark.parametrize(
    "load",
    [
        "*CFLUX\n" + "".join(f"{n}, 11, 0.75\n" for n in (21, 22, 23, 24)),
        "*DFLUX\n5, S2, 1200.\n",
        "*DSFLUX\nTOP, S, 1200.\n",
        "*Sfilm\nTOP, F, 1020., 12.5\n*DFLUX\nup, BF, 0.\n",
    ],
)
def test_heat_into_the_top(tmp_path, load):
    """Three watts, or a film through which as much comes in: 1200 by area, from a top that is at 8.4 + 1.2 + ... degrees."""
    _, (step,) = solved(tmp_path, "DC3D8", CONTACT, "*BOUNDARY\nHOT, 11, 11, 0.\n", load)
    resistance = LENGTH / 50.0 + 1e-3 + LENGTH / 20.0
    flux = 1020.0 / (resistance + 1.0 / 12.5) if "film" in load else 1200.0
    assert step.temperature.max() == pytest.approx(flux * resistance, rel=1e-9)


def test_a_source_inside(tmp_path):
    _, (step,) = solved(tmp_path, "DC3D8", CONTACT, "*BOUNDARY\nHOT, 11, 11, 0.\n", "*DFLUX\nup, BF, 2.E4\n")
    whole = 2e4 * LENGTH
    assert -step.heat["contacts"]["UB/LT"] == pytest.approx(-whole * SIDE**2, rel=1e-9)
    tops = whole * (LENGTH / 50.0 + 1e-3) + 2e4 * LENGTH**2 / 2.0 / 20.0
    assert step.temperature.max() == pytest.approx(tops, rel=1e-9)


def test_loads_stay_change_and_go_over_steps(tmp_path):
    wave = "*AMPLITUDE, NAME=half\n0., 0., 1., 0.5\n"
    steps = (
        "*FILM\nup, F2, 20., 0.\n*DFLUX\n5, S2, 1000.\n",
        "*BOUNDARY\nHOT, 11, 11, 40.\n",
        "*DFLUX, OP=NEW\n",
        "*DFLUX, AMPLITUDE=half\n5, S2, 1000.\n",
    )
    before = "*INITIAL CONDITIONS, TYPE=TEMPERATURE\nLOWER, 20.\nUPPER, 20.\n*BOUNDARY\nHOT, 11, 11, 20.\n"
    _, found = solved(tmp_path, "DC3D8", CONTACT, before + wave, *steps)
    rise = 1000.0 * (LENGTH / 50.0 + 1e-3 + LENGTH / 20.0)
    ends = [step.temperature.max() for step in found if step.load_factor == round(step.load_factor)]
    assert ends == pytest.approx([20.0 + rise, 40.0 + rise, 40.0, 40.0 + rise / 2], rel=1e-9)


def test_a_conductance_by_clearance(tmp_path):
    table = CONTACT.replace("1000.\n", "1000., 0.\n0., 2.E-3\n")
    deck, (step,) = solved(tmp_path, between=table + "*CLEARANCE, SLAVE=UB, MASTER=LT, VALUE=1.E-3\n")
    flux = 100.0 / (LENGTH / 50.0 + 1.0 / 500.0 + LENGTH / 20.0)
    assert -step.heat["contacts"]["UB/LT"] == pytest.approx(flux * SIDE**2, rel=1e-9)
    assert any("clearance, as in Abaqus" in note for note in deck.notes)


ELASTIC = (
    MATERIALS.replace("*CONDUCTIVITY\n50.", "*CONDUCTIVITY\n50.\n*ELASTIC\n2.E11, 0.\n*EXPANSION\n1.E-5\n*DENSITY\n7800.")
    .replace("20.\n*SOLID", "20.\n*ELASTIC\n2.E11, 0.\n*EXPANSION\n2.E-5\n*SOLID")
)  # fmt: skip
SIDES = "*BOUNDARY\nLOWER, 1, 2\nUPPER, 1, 2\nHOT, 3, 3\n"
COUPLED = "*STEP\n*COUPLED TEMPERATURE-DISPLACEMENT, STEADY STATE\n0.5, 1.\n{}*END STEP\n"


@pytest.mark.parametrize("procedure", ["COUPLED", "UNCOUPLED"])
def test_pressed_bars_conduct_by_their_pressure(tmp_path, procedure):
    """The conductance at 2e6 of pressure is 1000; each bar grows by its mean temperature, sideways it is held."""
    law = CONTACT.replace("\n1000.", ", PRESSURE\n500., 0.\n1500., 4.E6")
    push = COUPLED.replace("COUPLED", procedure).format("*DSLOAD\nTOP, P, 2.E6\n")
    deck = deck_of(tmp_path, two_bars("C3D8T") + ELASTIC + law + ENDS + SIDES + push)
    (step,) = deck.solve()
    assert step.heat["contacts"]["UB/LT"] == pytest.approx(-12_500.0 * SIDE**2, rel=1e-9)
    assert step.contact["UB/LT"].force[2] == pytest.approx(2e6 * SIDE**2, rel=1e-9)
    grown = LENGTH * (1e-5 * 87.5 + 2e-5 * 31.25 - 2 * 2e6 / 2e11)
    assert step.displacement[deck.points_of("COLD"), 2] == pytest.approx(grown, rel=1e-9)


def test_a_static_step_before_and_heat_of_friction_by_time(tmp_path):
    """The upper bar slides by 1e-3 in a step that takes 2 s: mu N times slip by time becomes heat, 90 % of it."""
    law = CONTACT.replace("NAME=I\n", "NAME=I\n*FRICTION\n0.25\n*GAP HEAT GENERATION\n0.9, 0.5\n")
    sides = "*BOUNDARY\nLOWER, 1, 3\nUPPER, 2, 2\nCOLD, 1, 1\n"
    press = "*STEP\n*STATIC\n2., 2.\n*BOUNDARY\nCOLD, 3, 3, -1.E-6\n*END STEP\n"
    slide = COUPLED.replace("0.5, 1.", "2., 2.").format("*BOUNDARY\nCOLD, 1, 1, 1.E-3\n")
    cold = ELASTIC.replace("2.E-5", "0.").replace("1.E-5", "0.")
    deck = deck_of(tmp_path, two_bars("C3D8T") + cold + law + ENDS.replace("100.", "0.") + sides + press + slide)
    last = deck.solve()[-1]
    press, slip = 2e11 * 1e-6 / LENGTH, 1e-3 - 0.25 * 2e6 / 1e11 * LENGTH
    assert last.heat["friction"] == pytest.approx(0.9 * 0.25 * press * SIDE**2 * slip / 2.0, rel=1e-3)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (", STEADY STATE", "", r"line 63, \*HEAT TRANSFER: only STEADY STATE"),
        ("*CONDUCTIVITY\n50.\n", "*CONDUCTIVITY\n0.\n", r"\*CONDUCTIVITY: material 'A': the conductivity 0 must be"),
        ("STATE\n", "STATE\n*FILM\nup, F2, 20., -3.\n", r"\*FILM: the film coefficient -3 must not"),
        ("*END STEP\n", "*END STEP\n*STEP\n*FREQUENCY\n3\n*END STEP\n", r"\*STEP: \*FREQUENCY after \*HEAT TRANSFER"),
        ("*CONDUCTIVITY\n50.\n", "", r"\*MATERIAL: material 'A' has no \*CONDUCTIVITY"),
        ("*CONDUCTIVITY\n50.\n", "*CONDUCTIVITY\n50., 0.\n60., 100.\n", r"2 data lines, but one .* temperatures"),
        ("STATE\n", "STATE\n*CLOAD\nHOT, 1, 2.\n", r"\*CLOAD: is not a heat load"),
        ("STATE\n", "STATE\n*TEMPERATURE\nHOT, 2.\n", r"\*TEMPERATURE: temperatures are computed"),
        ("STATE\n", "STATE\n*RADIATE\nup, R1, 2.\n", r"\*RADIATE: .*without radiation"),
        ("STATE\n", "STATE\n*FILM\nup, F2NU, 2., 3.\n", r"\*FILM: F2NU is not supported; expected one of F1, F2"),
        ("STATE\n", "STATE\n*DFLUX\nup, S9, 2.\n", r"\*DFLUX: element 4 of type DC3D8 has no face 9"),
        ("STATE\n", "STATE\n*CFLUX\nHOT, 11, 2.\nHOT, 11, 2.\n", r"\*CFLUX: 2 is the second value in this step"),
        ("STATE\n", "STATE\n*CFLUX\nHOT, 3, 2.\n", r"\*CFLUX: degree of freedom 3 is not 11"),
        ("*GAP CONDUCTANCE\n1000.\n", "*GAP CONDUCTANCE\n1000., 0., 20.\n2000., 1., 50.\n", r"depends on the temperature"),
        ("*GAP CONDUCTANCE\n1000.\n", "*GAP CONDUCTANCE\n1000., 1.\n2000., 1.\n", r"\*GAP CONDUCTANCE: .* ascend"),
        ("*GAP CONDUCTANCE\n1000.\n", "*GAP CONDUCTANCE\n-1000.\n", r"\*GAP CONDUCTANCE: the conductance -1000"),
        ("1000.\n", "1000.\n*GAP CONDUCTANCE\n1000., 0.\n2000., 1.\n", r"a constant conductance and a table"),
        ("NAME=I\n", "NAME=I\n*GAP HEAT GENERATION\n1., 0.3\n", r"must be 0.5"),
        ("NAME=I\n", "NAME=I\n*GAP HEAT GENERATION\n1., 0.5, 3.\n", r"a prescribed sliding velocity is not supported"),
        ("HEAT TRANSFER, STEADY STATE", "STATIC", r"line 7, .*degree of freedom 11|conduct heat alone"),
        ("HOT, 11, 11, 100.", "99, 11, 11, 100.", r"node 99 is not defined"),
    ],
)  # fmt: skip
def test_what_is_refused(tmp_path, old, new, said):
    text = two_bars() + MATERIALS + CONTACT + ENDS + STEP.format("")
    assert text.count(old) == 1, text
    refused(fc.CaseError, said, deck_of, tmp_path, text.replace(old, new))


RESISTANCE = LENGTH / 50.0 + 1e-3 + LENGTH / 20.0


def flows(found):
    """Return the fluxes from the lower to the upper bar at the ends of steps."""
    return [-step.heat["contacts"]["UB/LT"] / SIDE**2 for step in found if step.load_factor == round(step.load_factor)]


def test_films_come_change_and_go_between_steps(tmp_path):
    steps = ("*FILM\n5, F2, 20., 10.\n", "*FILM\n5, F2, 30., 40.\n", "*FILM, OP=NEW\n", "*FILM\n5, F2, 0., 10.\n")
    _, found = solved(tmp_path, "DC3D8", CONTACT, "*BOUNDARY\nHOT, 11, 11, 100.\n", "", *steps)
    films = [80.0 / (RESISTANCE + 0.1), 70.0 / (RESISTANCE + 0.025), 0.0, 100.0 / (RESISTANCE + 0.1)]
    assert flows(found) == pytest.approx([0.0, *films], rel=1e-9, abs=1e-7)


def test_temperatures_come_go_and_come_again_from_what_they_find(tmp_path):
    """The film alone, then a temperature besides it, which the film does not change, then the film alone again."""
    steps = (
        "*FILM\n5, F2, 20., 10.\n",
        "*BOUNDARY\nCOLD, 11, 11, 50.\n",
        "*BOUNDARY, OP=NEW\nHOT, 11, 11, 100.\n",
        "*BOUNDARY\nCOLD, 11, 11, 0.\n",
    )
    deck, found = solved(tmp_path, "DC3D8", CONTACT, "*BOUNDARY\nHOT, 11, 11, 100.\n", *steps)
    alone, end = 80.0 / (RESISTANCE + 0.1), deck.points_of("COLD")
    assert flows(found) == pytest.approx([alone, 50.0 / RESISTANCE, alone, 100.0 / RESISTANCE], rel=1e-9)
    halves = fc.Ramp([0.5 * k for k in range(1, 9)], deck.ramp.table)
    found, reached = fc.solve(deck.model, halves), 20.0 + alone / 10.0
    halfway = {step.load_factor: step.temperature[end].mean() for step in found}
    assert halfway[1.5] == pytest.approx(0.5 * (reached + 50.0), rel=1e-9)
    assert halfway[3.5] == pytest.approx(0.5 * reached, rel=1e-9)
    early = fc.solve(deck.model, fc.Ramp(halves.instants[:3], deck.ramp.table))
    again = fc.solve(deck.model, halves, resume=early)  # in the middle of the step in which it comes
    assert all(np.array_equal(a.temperature, b.temperature) for a, b in zip(again, found, strict=True))


def test_two_films_on_a_face_and_heat_that_nothing_holds_are_refused(tmp_path):
    head = two_bars() + MATERIALS + CONTACT
    with pytest.raises(fc.CaseError, match="3 is the second film coefficient of this face in one step, after 2"):
        deck_of(tmp_path, head + ENDS + STEP.format("*FILM\n5, F2, 20., 2.\n*FILM\n5, F2, 20., 3.\n"))
    deck = deck_of(tmp_path, head + ENDS + STEP.format("") + STEP.format("*BOUNDARY, OP=NEW\n"))
    refused(fc.ModelError, "in the load steps after 1: nothing determines the temperature of body", deck.solve)
