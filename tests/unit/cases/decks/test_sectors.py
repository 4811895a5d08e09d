"""Cyclic symmetry in decks: a quarter of a ring; refusals."""

import numpy as np
import pytest
from deck_text import deck_of

import fastcontact as fc

# A quarter of a ring of one element round, radii 1 and 2, thickness 1.
QUARTER = """*Node
1, 1., 0., 0.
2, 2., 0., 0.
3, 0., 2., 0.
4, 0., 1., 0.
5, 1., 0., 1.
6, 2., 0., 1.
7, 0., 2., 1.
8, 0., 1., 1.
*Element, type=C3D8, elset=ring
1, 1, 2, 3, 4, 5, 6, 7, 8
*Surface, name=right
1, S3
*Surface, name=left
1, S5
*Surface, name=outside
1, S4
*Nset, nset=ends_y
3, 4, 7, 8
*Surface, name=left_nodes, type=NODE
ends_y
*Material, name=steel
*Elastic
1000., 0.3
*Solid Section, elset=ring, material=steel
"""
TIE = "*Tie, name=round, cyclic symmetry, position tolerance=0.1\nleft, right\n"
MODEL = "*Cyclic Symmetry Model, n=4, ngraph=1, tie=round\n0., 0., 0., 0., 0., 1.\n"
STEP = "*Boundary\n1, 3\n2, 3\n1, 2\n*Step\n*Static\n*Dsload\noutside, P, 10.\n*End Step\n"


def test_a_quarter_of_a_ring_stays_one(tmp_path):
    deck = deck_of(tmp_path, QUARTER + TIE + MODEL + STEP)
    (step,) = deck.solve()
    right, left = ([deck.point(n) for n in own] for own in ((1, 2, 5, 6), (4, 3, 8, 7)))
    u, v = step.displacement[right], step.displacement[left]
    assert v == pytest.approx(np.column_stack([-u[:, 1], u[:, 0], u[:, 2]]), abs=1e-12)
    assert (u[:, 0] < -1e-4).all()
    assert step.reaction[:, :2] == pytest.approx(np.zeros((8, 2)), abs=1e-9)  # nothing but the ends holds it
    without_name = TIE.replace("name=round, ", "").replace("left, right", "right, left_nodes")
    again = deck_of(tmp_path, QUARTER + without_name + MODEL.replace(", tie=round", "") + STEP)
    assert again.solve()[0].displacement == pytest.approx(step.displacement, abs=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (TIE + MODEL.replace("n=4", "n=1"), r"\*CYCLIC SYMMETRY MODEL: N=1: a whole number of sectors"),
        (TIE + MODEL.replace("n=4", "n=4.5"), "N=4.5: a whole number of sectors"),
        (TIE + MODEL.replace("n=4", "n=5"), r"turned by 1/5 of a turn, lies .* from the nearest node .* check axis"),
        (TIE + MODEL.replace("0., 0., 1.", "0., 0., 0."), "the two points of the axis are the same"),
        (TIE + MODEL + "0., 0., 0., 0., 0., 1.\n", "2 data lines, but one is needed"),
        (TIE + MODEL.replace("tie=round", "tie=other"), "TIE=other, and the ties with CYCLIC SYMMETRY are: round"),
        (MODEL, "TIE=round, and the ties with CYCLIC SYMMETRY are: none"),
        (TIE, r"\*TIE: no \*CYCLIC SYMMETRY MODEL defines the number of sectors"),
        (TIE.replace("left, right", "left"), r"\*TIE: cyclic symmetry needs two surfaces"),
        (TIE.replace("left,", "west,") + MODEL, r"\*TIE: surface 'west' is not defined"),
        (TIE.replace(", cyclic", ", multistage, cyclic") + MODEL, r"parameter MULTISTAGE of \*TIE is not supported"),
    ],
)
def test_what_is_refused(text, message, tmp_path):
    with pytest.raises(fc.CaseError, match=message):
        deck_of(tmp_path, QUARTER + text + STEP)
