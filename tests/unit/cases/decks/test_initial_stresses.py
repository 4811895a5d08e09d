"""Initial stresses in decks: released, held, overridden by later lines; refusals."""

import numpy as np
import pytest
from deck_text import STEP, WHOLE, deck_of

import fastcontact as fc

TIED = ("name=si\n", "name=si\n*Surface Behavior, pressure-overclosure=TIED\n")
REST = STEP.replace("100.", "0.")
CPE = """*Node
1, 0., 0.
2, 1., 0.
3, 1., 1.
4, 0., 1.
*Element, type=CPS4, elset=all
1, 1, 2, 3, 4
*Material, name=steel
*Elastic
1000., 0.3
*Solid Section, elset=all, material=steel
*Initial conditions, type=stress
1, 5., 0., 0., 0.
*Boundary
1, 1, 2
4, 1
*Step
*Static
*Cload
1, 2, 0.
*End Step
"""


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
    deck = deck_of(tmp_path, CPE)
    (step,) = deck.solve()
    np.testing.assert_allclose(step.displacement[deck.point(3)], [-5e-3, 0.3 * 5e-3], rtol=1e-12)
    assert "Initial stress: xx = 5 to 5 in all solid cells." in deck.model.describe()


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (
            "1, 1, 20., 0., 0., 0., 0., 0.\n",
            r"line \d+, \*INITIAL CONDITIONS: 8 entries, but 7 are needed: .* integration point",
        ),
        ("low, 20.\n", r"2 entries, but 7 are needed"),
        ("lo, 20., 0., 0., 0., 0., 0.\n", r"line \d+, \*INITIAL CONDITIONS: .*'lo'"),
        ("low, a, 0., 0., 0., 0., 0.\n", "'a' is not a number"),
    ],
)
def test_what_is_refused(tmp_path, lines, words):
    with pytest.raises(fc.CaseError, match=words):
        deck_of(tmp_path, stressed(lines))


def test_axes_of_a_material_and_other_types_are_refused(tmp_path):
    turned = "*Orientation, name=o\n0., 1., 0., -1., 0., 0.\n*Solid Section, elset=low, orientation=o,"
    text = stressed("low, 20., 0., 0., 0., 0., 0.\n", ("*Solid Section, elset=low,", turned))
    with pytest.raises(fc.CaseError, match=r"element 1 has an \*ORIENTATION"):
        deck_of(tmp_path, text)
    with pytest.raises(fc.CaseError, match="TYPE=VELOCITY is not supported, only TEMPERATURE and STRESS"):
        deck_of(tmp_path, stressed("low, 1.\n", ("type=STRESS", "type=VELOCITY")))
    with pytest.raises(fc.CaseError, match="GEOSTATIC"):
        deck_of(tmp_path, stressed("low, 1.\n", ("type=STRESS", "type=STRESS, GEOSTATIC")))
