"""Temperatures and initial stresses in decks: free and constrained bodies, histories over steps; refusals."""

import numpy as np
import pytest
from case_texts import FLAT
from deck_text import STEP, WHOLE, deck_of, static_steps
from refusals import refused
from test_refusals import before

import fastcontact as fc

ALL = "*Nset, nset=all, generate\n1, 8\n11, 18\n"
EXPANSION = "*Expansion\n1.e-5\n"
TIED = ("name=si\n", "name=si\n*Surface Behavior, pressure-overclosure=TIED\n")
HELD = ("bottom, 3\n", "bottom, 3\ntop, 3\n")
INITIAL = "*Initial conditions, type=TEMPERATURE\nall, 20.\n"


def heated(expansion=EXPANSION, steps="*Temperature\nall, 120.\n", initial=INITIAL, change=TIED):
    """Return the two cubes, heated instead of pressed."""
    head = WHOLE.replace(STEP, "").replace("200000., 0.\n", "200000., 0.\n" + expansion)
    assert head.count(change[0]) == 1
    head = head.replace(*change)
    blocks = steps if isinstance(steps, list) else [steps]
    return head + ALL + initial + static_steps(*blocks)


def heights(deck):
    return {step.load_factor: step.displacement[deck.point(17), 2] for step in deck.solve()}


@pytest.mark.parametrize("kind", ["", ", type=ISO", ", zero=50."])
def test_free_expansion_counts_from_the_initial_temperature(tmp_path, kind):
    deck = deck_of(tmp_path, heated(EXPANSION.replace("\n1", f"{kind}\n1")))
    (step,) = deck.solve()
    lower = deck.points_of("bottom")
    assert step.displacement[deck.point(7)] == pytest.approx(1e-5 * 100.0 * np.ones(3), rel=1e-9)
    assert np.abs(step.stress).max() < 1e-6 * 200_000 * 1e-3
    assert np.abs(step.reaction[lower]).max() < 1e-6
    assert bool(kind == ", zero=50.") == any("ZERO has no effect" in note for note in deck.notes)


def test_expansion_along_axes(tmp_path):
    deck = deck_of(tmp_path, heated("*Expansion, type=ORTHO\n1.e-5, 2.e-5, 3.e-5\n"))
    (step,) = deck.solve()
    assert step.displacement[deck.point(7)] == pytest.approx([1e-3, 2e-3, 3e-3], rel=1e-9)


@pytest.mark.parametrize("law", ["*Hyperelastic, MOONEY-RIVLIN\n0.5, 0.2, 0.01\n", "*Elastic\n200., 0.3\n"])
@pytest.mark.filterwarnings("ignore:temperatures and initial states cause strains")
def test_large_free_expansion(tmp_path, law):
    text = heated("*Expansion\n1.e-3\n").replace("*Elastic\n200000., 0.\n", law).replace("*Step\n", "*Step, nlgeom\n")
    deck = deck_of(tmp_path, text)
    assert deck.model.strain == "finite"
    (step,) = deck.solve()
    assert step.displacement[deck.point(7)] == pytest.approx(0.1 * np.ones(3), rel=1e-9)
    assert np.abs(step.stress).max() < 1e-9


def test_heat_makes_a_held_bar_yield(tmp_path):
    plastic = "*Plastic\n150., 0.\n160., 0.1\n"
    (step,) = deck_of(tmp_path, heated("*Expansion\n1.e-5\n" + plastic, change=HELD)).solve()
    p = (200.0 - 150.0) / (200_000.0 + 100.0)
    assert step.cell_fields["plastic_strain"] == pytest.approx(p, rel=1e-9)
    assert step.contact["ss/sm"].force[2] == pytest.approx(150.0 + 100.0 * p, rel=1e-9)


def test_a_held_bar_is_pressed(tmp_path):
    (step,) = deck_of(tmp_path, heated(change=HELD)).solve()
    assert step.contact["ss/sm"].force[2] == pytest.approx(200_000 * 1e-5 * 100.0, rel=1e-9)


def test_temperatures_ramp_stay_go_back_and_follow_amplitudes(tmp_path):
    amplitude = "*Amplitude, name=wave\n0., 0.5, 0.25, 2., 1., 1.\n"
    steps = [
        "*Temperature\nall, 120.\n",
        "*Dsload\nroof, P, 0.\n",
        "*Temperature, op=NEW\n",
        "*Temperature, amplitude=wave\nall, 70.\n",
    ]
    found = heights(deck_of(tmp_path, heated(steps=steps, initial=INITIAL + amplitude)))
    rises = {1.0: 100.0, 2.0: 100.0, 3.0: 0.0, 3.25: 120.0, 4.0: 50.0}
    assert found == pytest.approx({t: 2e-5 * rise for t, rise in rises.items()}, rel=1e-9, abs=1e-15)


def test_a_material_without_expansion_keeps_its_size(tmp_path):
    deck = deck_of(tmp_path, heated(""))
    assert heights(deck)[1.0] == pytest.approx(0.0, abs=1e-15)
    assert any("has no *EXPANSION" in note for note in deck.notes)


def test_expansion_without_temperatures_is_noted(tmp_path):
    text = WHOLE.replace("200000., 0.\n", "200000., 0.\n" + EXPANSION + "*Conductivity\n50.\n*Specific Heat\n4e8\n")
    notes = "\n".join(deck_of(tmp_path, text).notes)
    assert "without temperatures the expansion has no effect" in notes
    assert notes.count("*CONDUCTIVITY has no effect, because temperatures are prescribed") == 1
    assert notes.count("no effect, because heat conduction is steady or temperatures are given") == 1


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (heated("*Expansion\n1.e-5, 20.\n2.e-5, 100.\n"), r"\*EXPANSION: 2 data lines, but one is needed"),
        (heated("*Expansion, type=ANISO\n1.e-5\n"), r"\*EXPANSION: TYPE=ANISO is not supported"),
        (heated("*Expansion\n1.e-5, 20., 3.\n"), r"\*EXPANSION: .*has 1 coefficients"),
        (heated(steps="*Temperature, file=heat.frd\n"), r"\*TEMPERATURE: the parameter FILE"),
        (heated(steps="*Temperature\nall, 120., 3.\n"), r"\*TEMPERATURE: temperature gradients"),
        (heated(steps="*Temperature\nnone, 120.\n"), r"\*TEMPERATURE: set 'none' is not defined"),
    ],
)
def test_what_is_refused(tmp_path, text, said):
    refused(fc.CaseError, said, deck_of, tmp_path, text)


REST = STEP.replace("100.", "0.")


def stressed(lines, change=("", ""), step=REST):
    """Return the two cubes, nu = 0, with initial stresses and without a load."""
    return WHOLE.replace(STEP, f"*Initial Conditions, type=STRESS\n{lines}" + step).replace(*change)


def test_a_stress_in_a_set_and_one_of_an_element(tmp_path):
    """Both cubes are released along z, the upper one from the stress of its later line."""
    lines = "low, 0., 0., 20., 0., 0., 0.\nup, 1., 2., 3., 4., 5., 6.\n2, 0., 0., -40., 0., 0., 0.\n"
    deck = deck_of(tmp_path, stressed(lines, TIED))
    (step,) = deck.solve()
    found = step.displacement[[deck.point(7), deck.point(17)], 2]
    np.testing.assert_allclose(found, [-20.0 / 200_000, 20.0 / 200_000], rtol=1e-9)
    assert np.abs(step.stress).max() < 1e-6


@pytest.mark.filterwarnings("ignore:contact .* supports hold .* of the .* facets")
def test_the_order_of_the_shears_is_that_of_abaqus(tmp_path):
    """12, 13, 23: held on all sides, the cubes keep their stress."""
    sets = "*Nset, nset=all, generate\n1, 8\n11, 18\n*Elset, elset=both\n1, 2\n"
    text = stressed("both, 1., 2., 3., 4., 5., 6.\n", TIED).replace("bottom, 3\nx0, 1\ny0, 2\n", "all, 1, 3\n")
    (step,) = deck_of(tmp_path, text.replace("*Boundary", sets + "*Boundary")).solve()
    expected = np.broadcast_to([1.0, 2.0, 3.0, 4.0, 6.0, 5.0], step.stress.shape)
    np.testing.assert_allclose(step.stress, expected, rtol=1e-9)


def test_in_the_plane_there_are_four_components(tmp_path):
    text = before("*Boundary", "*Initial conditions, type=stress\n1, 5., 0., 0., 0.\n2, 5., 0., 0., 0.\n", FLAT)
    deck = deck_of(tmp_path, text.replace("CPE4", "CPS4").replace("5, 1, 1.", "5, 1, 0."))
    (step,) = deck.solve()
    np.testing.assert_allclose(step.displacement[deck.point(3)], [-5e-3, 0.3 * 5e-3], rtol=1e-12)
    assert "Initial stress: xx = 5 to 5 in all solid cells." in deck.model.describe()


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ("1, 1, 20., 0., 0., 0., 0., 0.\n", r"\*INITIAL CONDITIONS: 8 entries, but 7 are needed: .* integration point"),
        ("low, 20.\n", r"2 entries, but 7 are needed"),
        ("lo, 20., 0., 0., 0., 0., 0.\n", r"line \d+, \*INITIAL CONDITIONS: .*'lo'"),
        ("low, a, 0., 0., 0., 0., 0.\n", "'a' is not a number"),
    ],
)
def test_initial_stresses_that_are_refused(tmp_path, lines, words):
    refused(fc.CaseError, words, deck_of, tmp_path, stressed(lines))


def test_axes_of_a_material_and_other_types_are_refused(tmp_path):
    turned = "*Orientation, name=o\n0., 1., 0., -1., 0., 0.\n*Solid Section, elset=low, orientation=o,"
    text = stressed("low, 20., 0., 0., 0., 0., 0.\n", ("*Solid Section, elset=low,", turned))
    refused(fc.CaseError, r"element 1 has an \*ORIENTATION", deck_of, tmp_path, text)
    with pytest.raises(fc.CaseError, match="TYPE=VELOCITY is not supported; expected one of TEMPERATURE, STRESS"):
        deck_of(tmp_path, stressed("low, 1.\n", ("type=STRESS", "type=VELOCITY")))
    with pytest.raises(fc.CaseError, match="GEOSTATIC"):
        deck_of(tmp_path, stressed("low, 1.\n", ("type=STRESS", "type=STRESS, GEOSTATIC")))
