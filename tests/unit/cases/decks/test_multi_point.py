"""*MPC of decks: PIN, TIE and BEAM, and what is refused."""

import numpy as np
import pytest
from deck_text import MATERIAL, NODES, STEP, SUPPORTS, deck_of

import fastcontact as fc

SETS = "*Nset, nset=low_face, generate\n5, 8\n*Nset, nset=up_face, generate\n11, 14\n"


@pytest.mark.parametrize(
    "lines",
    [
        "PIN, 11, 5\nTIE, 12, 6\nPin, 13, 7\nTie, 14, 8\n",
        "TIE, up_face, low_face\n",
    ],
)
def test_pinned_cubes_are_one_bar(lines, tmp_path):
    deck = deck_of(tmp_path, NODES + SETS + MATERIAL + "*MPC\n" + lines + SUPPORTS + STEP)
    (step,) = deck.solve()
    assert step.displacement[deck.points_of("top"), 2] == pytest.approx(-100.0 * 2.0 / 2e5)
    low, up = deck.points_of("low_face"), deck.points_of("up_face")
    assert step.displacement[up] == pytest.approx(step.displacement[low], abs=1e-15)
    assert step.reaction[deck.points_of("bottom"), 2].sum() == pytest.approx(100.0)
    assert step.reaction[up, 2] == pytest.approx(0.0, abs=1e-9)


def test_beams_carry_a_force_and_a_moment(tmp_path):
    """The top is as if clamped to a node above it: pressed down, and turned about y by a force beside the middle."""
    beams = "*Node, nset=ref\n90, 0.7, 0.5, 3.\n*MPC\nBEAM, top, 90\n" + "*MPC\nTIE, up_face, low_face\n"
    held = "*Boundary\nbottom, 1, 3\n"
    load = "*Dsload\nroof, P, 100.\n"
    deck = deck_of(tmp_path, NODES + SETS + MATERIAL + beams + held + STEP.replace(load, "*Cload\n90, 3, -100.\n"))
    (step,) = deck.solve()
    top, points = deck.points_of("top"), deck.model.mesh.points
    u = step.displacement[top]
    assert np.ptp(u[:, 2] - (u[:, 2] @ (points[top, 0] - 0.5)) * (points[top, 0] - 0.5)) < 1e-12  # a plane about y
    assert step.displacement[deck.point(90), 2] < u[:, 2].mean() < 0.0
    bottom = deck.points_of("bottom")
    force = step.reaction[bottom]
    assert force.sum(axis=0) == pytest.approx([0.0, 0.0, 100.0], abs=1e-9)
    assert force[:, 2] @ points[bottom, 0] == pytest.approx(70.0)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("LINEAR, 11, 5, 6\n", r"line 48, \*MPC: an MPC of type LINEAR is not supported, only PIN, TIE and BEAM"),
        ("PIN, 11\n", "PIN needs two nodes"),
        ("PIN, 11, 5, 6\n", "PIN needs two nodes"),
        ("PIN, low_face, x0\n", "'low_face' and 'x0' have 4 and 8 nodes"),
        ("PIN, 11, 11\n", "'11' and '11' have 1 and 1 nodes"),
        ("TIE, 99, 5\n", "node 99"),
        ("BEAM, 11, top\n", "'top' holds 4 nodes where one is needed"),
    ],
)
def test_what_is_refused(line, message, tmp_path):
    with pytest.raises(fc.CaseError, match=message):
        deck_of(tmp_path, NODES + SETS + MATERIAL + "*MPC\n" + line + SUPPORTS + STEP)
