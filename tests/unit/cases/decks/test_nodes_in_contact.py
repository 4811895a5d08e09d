"""Surfaces of nodes that form no complete faces: contact, ties and couplings of these nodes alone."""

import pytest
from deck_text import CONTACT, MATERIAL, NODES, STEP, SUPPORTS, WHOLE, deck_of

import fastcontact as fc

EDGE = "*Nset, nset=edge\n11, 14\n*Surface, name=nodes, type=NODE\nedge\n"
ALL = "*Surface, name=nodes, type=NODE\n11, \n12, \n13, \n14, \n"
ON_NODES = CONTACT.replace("ss, sm", "nodes, sm")


def test_an_edge_of_nodes_carries_alone(tmp_path):
    """The upper cube stands on the nodes of one edge, held against turning: 100 N go through two nodes."""
    held = SUPPORTS.replace("y0, 2\n", "y0, 2\ntop, 1, 2\n12, 3\n13, 3\n")
    deck = deck_of(tmp_path, NODES + EDGE + MATERIAL + ON_NODES + held + STEP)
    (step,) = deck.solve()
    contact = step.contact["nodes/sm"]
    at = dict(zip(contact.points.tolist(), contact.force_vectors[:, 2], strict=True))
    held_up = step.reaction[[deck.point(12), deck.point(13)], 2].sum()
    assert at[deck.point(11)] == pytest.approx(at[deck.point(14)])
    assert at[deck.point(11)] + at[deck.point(14)] + held_up == pytest.approx(100.0)
    assert at.get(deck.point(12), 0.0) == 0.0
    assert at[deck.point(11)] > 10.0
    assert any("do not form whole faces" in note for note in deck.notes)


def test_all_nodes_of_a_face_are_that_face(tmp_path):
    deck = deck_of(tmp_path, NODES + ALL + MATERIAL + ON_NODES + SUPPORTS + STEP)
    faces = deck_of(tmp_path, WHOLE)
    assert deck.solve()[0].displacement == pytest.approx(faces.solve()[0].displacement, abs=1e-15)
    assert deck.notes == faces.notes


def test_nodes_are_tied_alone(tmp_path):
    """Of the two nodes of a tied edge neither opens when the cube is lifted; the others do."""
    tie = "*Tie, name=t\nnodes, sm\n"
    held = SUPPORTS.replace("y0, 2\n", "y0, 2\ntop, 1, 2\n17, 3\n16, 3\n")
    deck = deck_of(tmp_path, NODES + EDGE + MATERIAL + tie + held + STEP.replace("P, 100.", "P, -100."))
    (step,) = deck.solve()
    u = step.displacement[:, 2]
    low, high = ([deck.point(n) for n in own] for own in ((5, 8), (11, 14)))
    assert u[high] == pytest.approx(u[low], abs=1e-15)
    assert abs(u[deck.point(12)] - u[deck.point(6)]) > 1e-6


def test_kinematic_coupling_of_nodes(tmp_path):
    coupled = "*Node\n90, 0.5, 0.5, 3.\n*Surface, name=some, type=NODE\n15, \n17, \n"
    coupled += "*Coupling, ref node=90, surface=some, constraint name=c\n*Kinematic\n3, 3\n"
    load = "*Dsload\nroof, P, 100.\n"
    held = SUPPORTS + "90, 4, 6\n90, 1, 2\n"
    deck = deck_of(tmp_path, NODES + MATERIAL + CONTACT + coupled + held + STEP.replace(load, "*Cload\n90, 3, -100.\n"))
    (step,) = deck.solve()
    u = step.displacement[:, 2]
    assert u[[deck.point(15), deck.point(17)]] == pytest.approx(u[deck.point(90)])
    assert step.reaction[deck.points_of("bottom"), 2].sum() == pytest.approx(100.0)


@pytest.mark.parametrize(
    ("extra", "pair", "message"),
    [
        (
            EDGE + "*Node\n90, 0.5, 0.5, 3.\n*Nset, nset=edge\n90\n",
            "nodes, sm",
            r"line \d+, \*SURFACE: node 90 of surface 'nodes' is on no",
        ),
        (
            EDGE,
            "sm, nodes",
            r"line \d+, \*SURFACE: the nodes of surface 'nodes' do not form whole faces: 2 belong to none "
            r"\(first: node 11\), and \*CONTACT PAIR in line \d+ needs faces",
        ),
    ],
)
def test_what_is_refused(extra, pair, message, tmp_path):
    with pytest.raises(fc.CaseError, match=message):
        deck_of(tmp_path, NODES + extra + MATERIAL + CONTACT.replace("ss, sm", pair) + SUPPORTS + STEP)
