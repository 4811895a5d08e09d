"""Supports that begin or end between the steps of a deck."""

import numpy as np
import pytest
from case_texts import COMING, CUBE, HELD, pressed
from deck_text import CONTACT, MATERIAL, NODES, SUPPORTS, deck_of

import fastcontact as fc

# Pressed by 100 and 200, the cube is stretched by 0.0003 and 0.0006 where nothing holds it.
STRETCH = [0.0003, 0.0003, 0.0, 0.0006, 0.0005]


def test_supports_come_and_go(tmp_path):
    deck = deck_of(tmp_path, CUBE + COMING)
    steps = deck.solve()
    x1 = deck.points_of("x1")
    for result, stretch, pressure in zip(steps, STRETCH, (100, 200, 200, 200, 200), strict=True):
        assert result.displacement[x1, 0] == pytest.approx(np.full(4, stretch), abs=1e-15)
        # Uniaxial along x beside the pressure: E e_x = s_x + nu p.
        force = 1e5 * stretch - 0.3 * pressure
        assert result.reaction[x1, 0].sum() == pytest.approx(force, abs=1e-9)
        assert result.reaction[:, 2].sum() == pytest.approx(pressure)


def test_an_auxiliary_support_is_taken_away(tmp_path):
    """The upper cube is held until it is pressed on, and then stands on contact alone."""
    apart = NODES.replace(", 1.\n12", ", 1.01\n12")  # nodes of its lower face, a little above the other cube
    for number, place in ((11, "0., 0."), (12, "1., 0."), (13, "1., 1."), (14, "0., 1.")):
        apart = apart.replace(f"{number}, {place}, 1.\n", f"{number}, {place}, 1.001\n")
    first = "*Step\n*Static\n*Boundary\ntop, 3, 3, -0.0012\n*End Step\n"
    second = f"*Step\n*Static\n*Boundary, op=new\n{SUPPORTS.partition(chr(10))[2]}*Dsload\nroof, P, 100.\n*End Step\n"
    deck = deck_of(tmp_path, apart + MATERIAL + CONTACT + SUPPORTS + first + second)
    held, free = deck.solve()
    top, bottom = deck.points_of("top"), deck.points_of("bottom")
    assert held.reaction[top, 2].sum() == pytest.approx(-held.reaction[bottom, 2].sum())
    assert held.reaction[top, 2].sum() < -1.0
    assert free.reaction[top, 2] == pytest.approx(np.zeros(4), abs=1e-9)
    assert free.reaction[bottom, 2].sum() == pytest.approx(100.0)
    assert free.contact["ss/sm"].force[2] == pytest.approx(100.0)


def test_a_body_that_nothing_holds_any_more(tmp_path):
    deck = deck_of(tmp_path, CUBE + pressed("*Boundary\n" + HELD) + pressed("*Boundary, op=new\n1, 1, 3\n"))
    with pytest.raises(fc.ModelError, match=r"in the load steps after 1: .* rigid-body motions are not restrained"):
        deck.solve()


def test_local_axes(tmp_path):
    """The same along axes turned by 45 degrees about z, and with axes that are those of space turned by 90."""
    for axes, stretch in (("0., 1., 0., -1., 0., 0.", 2), ("1., 0., 0., 0., 1., 0.", 1)):
        turned = f"*Transform, nset=x1, type=R\n{axes}\n"
        back = f"*Boundary\nx1, {stretch}\n"
        first = pressed("*Boundary\n1, 1, 3\n4, 1\n4, 3\n5, 1\n8, 1\n2, 3\n3, 3\n")
        deck = deck_of(tmp_path, CUBE + turned + first + pressed(back))
        steps = deck.solve()
        x1 = deck.points_of("x1")
        assert steps[0].displacement[x1, 0] == pytest.approx(np.full(4, 0.0003))
        assert steps[1].displacement[x1, 0] == pytest.approx(np.zeros(4), abs=1e-15)
