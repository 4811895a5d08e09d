"""Pretension sections in decks: a bar of two cubes, stretched by a force, then locked."""

import pytest
from case_texts import square
from deck_text import CONTACT, WHOLE, deck_of, static_steps

import fastcontact as fc

BAR = f"""*Node
{square(1, 0)}{square(5, 1)}{square(15, 2)}99, 0., 0., 9.
*Element, type=C3D8, elset=bar
1, 1, 2, 3, 4, 5, 6, 7, 8
2, 5, 6, 7, 8, 15, 16, 17, 18
*Nset, nset=bottom, generate
1, 4
*Nset, nset=top, generate
15, 18
*Nset, nset=bolt
99
*Surface, name=cut
1, S2
*Surface, name=outside
1, S1
*Material, name=steel
*Elastic
1000., 0.
*Expansion
1.e-3
*Solid Section, elset=bar, material=steel
*Pre-tension Section, surface=cut, node=99
0., 0., 1.
*Boundary
bottom, 1, 3
top, 1, 3
"""
TIGHT = "*Step\n*Static\n*Cload\nbolt, 1, 3.\n*End Step\n"
HELD = "*Boundary, fixed\nbolt, 1\n"


def cooled(lines):
    return static_steps(f"{lines}*Temperature\n" + "".join(f"{n}, -20.\n" for n in (*range(1, 9), *range(15, 19))))


def test_force_first_then_the_length_stays(tmp_path):
    """Shortening F L / (E A), then the cooled bar pulls with E A alpha T more."""
    deck = deck_of(tmp_path, BAR + TIGHT + cooled(HELD + "*Cload, op=new\n") + cooled("*Cload, op=new\nbolt, 1, 8.\n"))
    tight, *locked = deck.solve()
    assert tight.displacement[deck.point(99)] == pytest.approx([3.0 * 2 / 1000, 0.0, 0.0], rel=1e-9)
    assert tight.pretension["cut"] == pytest.approx({"force": 3.0, "shortening": 0.006}, rel=1e-9)
    for step in locked:
        assert step.pretension["cut"] == pytest.approx({"force": 23.0, "shortening": 0.006}, rel=1e-8)
        assert step.displacement[deck.point(99), 0] == pytest.approx(0.006, rel=1e-9)
        assert step.reaction[deck.points_of("top")].sum(axis=0)[2] == pytest.approx(23.0, rel=1e-8)
        assert abs(step.reaction[deck.points_of("cut")]).max() < 1e-7  # of supports alone


def test_without_a_lock_the_force_stays(tmp_path):
    assert deck_of(tmp_path, BAR + TIGHT + cooled("")).solve()[-1].pretension["cut"]["force"] == pytest.approx(3.0)


def test_a_shortening_in_the_place_of_a_force(tmp_path):
    pulled = "*Step\n*Static\n*Boundary\nbolt, 1, 1, 0.01\n*End Step\n"
    deck = deck_of(tmp_path, BAR.replace("0., 0., 1.\n*Boundary", "*Boundary") + pulled + cooled(HELD))
    for step, force in zip(deck.solve(), (5.0, 25.0), strict=True):
        assert step.pretension["cut"] == pytest.approx({"force": force, "shortening": 0.01}, rel=1e-9)
        assert step.reaction[deck.point(99), 0] == pytest.approx(force, rel=1e-9)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (BAR.replace("node=99", "node=17") + TIGHT, r"\*PRE-TENSION SECTION: node 17 belongs to an element"),
        (BAR.replace("surface=cut", "surface=gone") + TIGHT, r"\*PRE-TENSION SECTION: surface 'gone' is not defined"),
        (BAR.replace("surface=cut", "surface=outside") + TIGHT, r"\*PRE-TENSION SECTION: facets of 'outside' do not"),
        (BAR.replace("0., 0., 1.\n*B", "0., 0., 0.\n*B") + TIGHT, r"\*PRE-TENSION SECTION: the normal is zero"),
        (BAR.replace("surface=cut, ", "") + TIGHT, r"\*PRE-TENSION SECTION: the parameter SURFACE is missing"),
        (BAR.replace("surface=cut, node", "element=3, node") + TIGHT, r"the parameter ELEMENT of \*PRE-TENSION SECT"),
        (
            BAR.replace("*Boundary", "*Pre-tension Section, surface=cut, node=99\n*Boundary") + TIGHT,
            "node 99 has a section already, in line 34",
        ),
        (
            BAR.replace("*Boundary", "*Node\n98, 0., 0., 9.\n*Pre-tension Section, surface=cut, node=98\n*Boundary")
            + TIGHT,
            "surface 'cut' has a pretension section already",
        ),
        (
            BAR + TIGHT + cooled(HELD) + cooled("*Boundary, op=new\nbottom, 1, 3\ntop, 1, 3\n"),
            "node 99 of a pretension section is released here: a locked section stays locked",
        ),
        (BAR + TIGHT + cooled(HELD) + cooled("*Boundary\nbolt, 1, 1, 1.\n"), "line 64, .*: node 99 .* is released"),
    ],
)
def test_what_is_refused(tmp_path, text, said):
    with pytest.raises(fc.CaseError, match=said):
        deck_of(tmp_path, text)


def test_what_a_tie_does_not_do_is_noted(tmp_path):
    tie = "*Tie, name=glue, position tolerance=0.1, adjust=YES\nss, sm\n"
    notes = "\n".join(deck_of(tmp_path, WHOLE.replace(CONTACT, tie)).notes)
    assert "POSITION TOLERANCE=0.1: no effect, the surfaces are tied where they face each other" in notes
    assert "ADJUST=YES: nodes are not moved" in notes
    with pytest.raises(fc.CaseError, match="POSITION TOLERANCE=-1 is negative"):
        deck_of(tmp_path, WHOLE.replace(CONTACT, tie.replace("0.1", "-1.")))
    with pytest.raises(fc.CaseError, match="ADJUST=MAYBE is not supported"):
        deck_of(tmp_path, WHOLE.replace(CONTACT, tie.replace("YES", "maybe")))


PLANE_BAR = """*Node
1, 0., 0.
2, 1., 0.
3, 0., 1.
4, 1., 1.
5, 0., 2.
6, 1., 2.
7, 0., 5.
9, 3., 9.
*Element, type=CPS4, elset=bar
1, 1, 2, 4, 3
2, 3, 4, 6, 5
*Element, type=SPRINGA, elset=spring
3, 5, 7
*Spring, elset=spring

40.
*Surface, name=cut
1, S3
*Material, name=steel
*Elastic
1000., 0.
*Solid Section, elset=bar, material=steel
5.
*Pre-tension Section, surface=cut, node=9
0., 1.
*Boundary
1, 1, 2
2, 2, 2
3, 1, 1
5, 1, 1
7, 1, 2
*Step
*Static
*Cload
9, 1, 10.
*End Step
"""


def test_forces_of_a_thick_plane_model(tmp_path):
    """The spring, the support at its end and the bolt are in series."""
    deck = deck_of(tmp_path, PLANE_BAR)
    (step,) = deck.solve()
    assert step.pretension["cut"]["force"] == pytest.approx(10.0, rel=1e-9)
    (tension,) = next(iter(fc.spring_forces(deck.model, step).values()))
    assert tension == pytest.approx(10.0, rel=1e-9)
    assert step.reaction[deck.point(7), 1] == pytest.approx(10.0, rel=1e-9)
    (of_unit_thickness,) = fc.solve(deck.model, deck.ramp, criteria=deck.criteria)
    expected = fc.support_forces(deck.model, of_unit_thickness)
    for group, force in fc.support_forces(deck.model, step).items():
        assert force == pytest.approx(5.0 * expected[group], rel=1e-9, abs=1e-9)
