"""*MPC, and surfaces of nodes that form no complete faces; refusals."""

import numpy as np
import pytest
from deck_text import CONTACT, MATERIAL, NODES, STEP, SUPPORTS, WHOLE, deck_of

import fastcontact as fc

SETS = "*Nset, nset=low_face, generate\n5, 8\n*Nset, nset=up_face, generate\n11, 14\n"


@pytest.mark.parametrize("lines", ["PIN, 11, 5\nTIE, 12, 6\nPin, 13, 7\nTie, 14, 8\n", "TIE, up_face, low_face\n"])
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


STACK = (
    NODES[: NODES.index("*Surface")].replace("11, 12, 13, 14, 15", "5, 6, 7, 8, 15")
    + "*Node\n20, 0., 0., 1.\n*Material, name=steel\n*Elastic\n1000., 0.3\n"
    + "*Solid Section, elset=low, material=steel\n*Solid Section, elset=up, material=steel\n"
)
LOADS = "*Cload\n15, 3, -0.01\n17, 1, 0.02\n*End Step\n"
LOADED = "*Boundary\nbottom, 1, 3\n*Step\n*Static\n*Boundary\n20, 1, 1, 0.0001\n" + LOADS
# Displacements of nodes 5 to 8 and 15 to 18 by CalculiX 2.20 [1e-5].
CALCULIX = [
    [16.32646, -3.067850, 6.241834], [18.07036, -1.526219, -11.99051], [10.45942, 1.678312, -7.905223],
    [12.41006, -5.252675, 10.32622], [44.63075, -13.38602, 2.934954], [42.55859, -0.6385982, -13.78184],
    [40.33827, -1.345495, -13.17047], [32.12612, -13.87342, 15.23307],
]  # fmt: skip


def test_a_mean_rotation_and_a_plane_as_in_calculix(tmp_path):
    """Its constraints follow the rotation, ours are linear: 3e-4 of the largest displacement."""
    lines = "*Mpc\nMEANROT, 15, 15, 15, 16, 16, 16, 17, 17, 17,\n18, 18, 18, 20\n*Mpc\nPLANE, 5, 6, 7, 8\n"
    deck = deck_of(tmp_path, STACK + lines + LOADED)
    (step,) = deck.solve()
    found = step.displacement[[deck.point(n) for n in (5, 6, 7, 8, 15, 16, 17, 18)]] * 1e5
    assert found == pytest.approx(np.array(CALCULIX), abs=3e-4 * 44.6)


def test_a_line_stays_straight(tmp_path):
    deck = deck_of(tmp_path, STACK + "*Mpc\nSTRAIGHT, 1, 5, 15\n" + LOADED.replace("20, 1, 1", "16, 1, 1"))
    (step,) = deck.solve()
    low, middle, high = step.displacement[[deck.point(n) for n in (1, 5, 15)], :2]
    assert np.abs(high).max() > 1e-5
    assert middle == pytest.approx(0.5 * (low + high), abs=1e-15)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("LINEAR, 11, 5, 6\n", r"line 48, \*MPC: an MPC of type LINEAR is not supported, only PIN, TIE, BEAM, PLANE"),
        ("PIN, 11\n", "PIN needs two nodes"),
        ("PIN, 11, 5, 6\n", "PIN needs two nodes"),
        ("PIN, low_face, x0\n", "'low_face' and 'x0' have 4 and 8 nodes"),
        ("PIN, 11, 11\n", "'11' and '11' have 1 and 1 nodes"),
        ("PIN, low_face, 5\n", "'low_face' and '5' have 4 and 1 nodes: .* no node may be tied to itself"),
        ("TIE, 99, 5\n", "node 99"),
        ("BEAM, 11, top\n", "'top' has 4 nodes, but one is needed"),
        ("PLANE, 5, 6, 7\n", r"line 48, \*MPC: PLANE needs 4 different nodes or more"),
        ("PLANE, 5, 1, 11, 7\n", "the first three nodes of PLANE lie on a line"),
        ("STRAIGHT, 5, 11, 6\n", "the first two nodes of STRAIGHT coincide"),
        ("MEANROT, 5, 5, 5, 6, 6, 6, 1\n", "the last node of MEANROT are the direction of the axis, which must not be"),
    ],
)
def test_what_is_refused(line, message, tmp_path):
    with pytest.raises(fc.CaseError, match=message):
        deck_of(tmp_path, NODES + SETS + MATERIAL + "*MPC\n" + line + SUPPORTS + STEP)


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
        (EDGE + "*Node\n90, 0.5, 0.5, 3.\n*Nset, nset=edge\n90\n", "nodes, sm", r"node 90 of surface 'nodes' is on no"),
        (
            EDGE,
            "sm, nodes",
            r"line \d+, \*SURFACE: the nodes of surface 'nodes' do not form whole faces: 2 belong to none "
            r"\(first: node 11\), and \*CONTACT PAIR in line \d+ needs faces",
        ),
    ],
)
def test_what_is_refused_of_nodes_in_contact(extra, pair, message, tmp_path):
    with pytest.raises(fc.CaseError, match=message):
        deck_of(tmp_path, NODES + extra + MATERIAL + CONTACT.replace("ss, sm", pair) + SUPPORTS + STEP)
