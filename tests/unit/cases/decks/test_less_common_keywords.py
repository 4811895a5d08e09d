"""Less common keywords of decks, verified by forces and displacements."""

from pathlib import Path

import numpy as np
import pytest
from case_texts import FLAT, square
from deck_text import CONTACT, MATERIAL, NODES, STEP, SUPPORTS, WHOLE, deck_of, static_steps
from refusals import refused
from test_refusals import SPRING, before, in_parts
from test_temperatures import TIED, heated
from test_tightening import BAR, HELD, TIGHT, cooled

import fastcontact as fc
from fastcontact.cli import main


def notes_of(deck):
    return "\n".join(deck.notes)


def test_a_node_set_of_an_assembly_names_sets_of_instances(tmp_path):
    """`i.bottom` is the set of the part, in the instance."""
    sets = "*Nset, nset=held\ni.bottom\n"
    text = in_parts(further=sets) + CONTACT.replace("ss, sm", "i.ss, i.sm")
    text += SUPPORTS.replace("bottom,", "held,").replace("x0,", "i.x0,").replace("y0,", "i.y0,")
    deck = deck_of(tmp_path, text + STEP.replace("roof", "i.roof"))
    (step,) = deck.solve()
    assert step.reaction[deck.points_of("held"), 2].sum() == pytest.approx(100.0)


def test_a_keyword_goes_on_over_comments_and_to_the_end_of_the_file(tmp_path):
    text = WHOLE.replace("*Surface Interaction, name=si\n", "*Surface Interaction,\n** a comment\nname=si\n")
    assert deck_of(tmp_path, text).solve()[0].contact["ss/sm"].force[2] == pytest.approx(100.0)
    assert deck_of(tmp_path, WHOLE.replace("*End Step\n", "*End Step,")).ramp.instants == (1.0,)


@pytest.mark.parametrize("asked", ["*Node Print, nset=x0\nU\n", "*Controls, reset\n", ""])
def test_notes_tell_of_output_and_of_controls_by_themselves(tmp_path, asked):
    notes = notes_of(deck_of(tmp_path, WHOLE.replace("*End Step", asked + "*End Step")))
    assert ("*NODE PRINT: no effect, the result file contains all output" in notes) == asked.startswith("*Node")
    assert ("*CONTROLS: no effect, the package has" in notes) == asked.startswith("*Controls")
    assert ("convergence" in notes) == asked.startswith("*Controls")


def test_a_deck_that_is_not_there(tmp_path):
    refused(fc.FileError, r"none\.inp", fc.read_deck, tmp_path / "none.inp")
    refused(fc.FileError, "is a folder: name a file in it", fc.read_deck, tmp_path)


def test_a_file_that_is_lost_while_the_deck_is_read(tmp_path, monkeypatch):
    def lost(*_, **__):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(Path, "read_bytes", lost)
    (tmp_path / "deck.inp").write_bytes(WHOLE.encode())
    refused(fc.FileError, r"cannot read '.*deck\.inp': Input/output error", fc.read_deck, tmp_path / "deck.inp")


CYLINDRICAL = """*Orientation, name=round, system=CYLINDRICAL
-5., 0.5, 0., -5., 0.5, 1.
"""


def test_materials_with_cylindrical_axes(tmp_path):
    """Far from the axis, radial is along x: a bar along z has E3."""
    law = "*Elastic, type=engineering constants\n1.e5, 5.e4, 2.e4, 0., 0., 0., 1.e4, 1.e4,\n1.e4\n"
    text = before("*Material, name=steel", CYLINDRICAL).replace("*Elastic\n200000., 0.\n", law)
    deck = deck_of(tmp_path, text.replace(", material=steel\n", ", material=steel, orientation=round\n"))
    (step,) = deck.solve()
    assert step.displacement[deck.point(17), 2] == pytest.approx(-100.0 * 2 / 2e4)


SKEW = np.array([1.0, 0.0, 1.0]) / np.sqrt(2.0)


def test_supports_along_skew_axes(tmp_path):
    """The foot slides on a plane at 45 degrees: half of the force comes back along x, and it is all found at the supports."""
    turned = "*Transform, nset=bottom, type=R\n1., 0., 1., 0., 1., 0.\n"
    text = before("*Boundary\n", turned).replace("bottom, 3\n", "bottom, 1\ntop, 1\n").replace("x0, 1\n", "")
    text = text.replace(*TIED).replace("*Dsload\nroof, P, 100.\n", "*Cload\ntop, 3, -25.\n")
    deck = deck_of(tmp_path, text)
    (step,) = deck.solve()
    foot = step.reaction[deck.points_of("bottom")]
    assert foot.sum(axis=0) @ SKEW == pytest.approx(100.0 * np.sqrt(2.0))
    assert np.abs(step.displacement[deck.points_of("bottom")] @ SKEW).max() < 1e-12
    total = step.reaction.sum(axis=0)
    assert total[[0, 2]] == pytest.approx([0.0, 100.0], abs=1e-7)
    equal = before("*Boundary\n", "*Equation\n2\n15, 3, 1., 16, 3, -1.\n", text)
    deck = deck_of(tmp_path, equal)
    (step,) = deck.solve()
    assert np.ptp(step.displacement[[deck.point(15), deck.point(16)], 2]) < 1e-14
    assert step.reaction[deck.points_of("bottom")].sum(axis=0) @ SKEW == pytest.approx(100.0 * np.sqrt(2.0))
    # Forces of the equation are no reactions.
    assert np.abs(step.reaction[[deck.point(15), deck.point(16)], 2]).max() < 1e-7


def test_two_couplings_share_the_rotation_of_a_node(tmp_path):
    """Both sides of a plane strip follow one node: a moment turns the strip as a whole."""
    links = (
        "*Node\n9, 1., 2.\n*Surface, name=left\none, S3\n*Surface, name=right\ntwo, S3\n"
        "*Coupling, constraint name=a, ref node=9, surface=left\n*Kinematic\n1, 2\n"
        "*Coupling, constraint name=b, ref node=9, surface=right\n*Kinematic\n1, 2\n"
    )
    deck = deck_of(tmp_path, before("*Material", links, FLAT).replace("5, 1, 1.\n", "9, 2, -1.\n"))
    (step,) = deck.solve()
    top = [deck.point(n) for n in (3, 4, 6)]
    moved = step.displacement[top]
    x = deck.model.mesh.points[top, 0]
    turn = np.polyfit(x, moved[:, 1], 1)
    assert np.polyval(turn, x) == pytest.approx(moved[:, 1], abs=1e-12)
    assert abs(turn[0]) > 1e-6
    assert step.reaction[:, 1].sum() == pytest.approx(1.0)


END = """*Node
9, 2., 0.5
*Surface, name=right
two, S2
*Coupling, constraint name=a, ref node=9, surface=right
*Kinematic
1, 2
"""


def test_a_plane_coupling_whose_rotation_nothing_asks_for_is_determined(tmp_path):
    deck = deck_of(tmp_path, before("*Material", END, FLAT).replace("5, 1, 1.\n", "9, 1, 1.\n"))
    (step,) = deck.solve()
    assert step.reaction[:, 0].sum() == pytest.approx(-1.0)
    assert np.ptp(step.displacement[[deck.point(5), deck.point(6)], 0]) < 1e-3 * np.abs(step.displacement).max()


def test_couplings_in_axisymmetry_are_refused(tmp_path):
    text = before("*Material", END, FLAT).replace("CPE4", "CAX4")
    with pytest.raises(fc.CaseError, match=r"is not supported in axisymmetric models: relate the nodes by \*EQUATION"):
        deck_of(tmp_path, text)


def test_body_forces_by_volume_skip_what_is_no_solid(tmp_path):
    """BX on a set of a solid and a spring."""
    both = before("*Boundary\n", SPRING + "*Spring, elset=springs\n\n1.\n*Elset, elset=both\n1, 2, 7\n")
    deck = deck_of(tmp_path, both.replace("*Dsload\nroof, P, 100.\n", "*Dload\nboth, BZ, -3.\n"))
    (step,) = deck.solve()
    assert step.reaction[deck.points_of("bottom"), 2].sum() == pytest.approx(6.0, rel=1e-6)


GAPS = f"""*Node
{square(25, 3)}*Element, type=GAPUNI, elset=gaps
31, 15, 25
32, 16, 26
33, 17, 27
34, 18, 28
*Nset, nset=ceiling, generate
25, 28
*Gap, elset=gaps
0.001, 0., 0., 1.
"""


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("bottom, 3\n", "bottom, 3\n"), "nodes that are fixed, or have the same"),
        (("15, 0., 0., 2.\n", "15, 0., 0., 2.1\n"), "their nodes lie in a plane normal to their direction"),
    ],
)
def test_gap_elements_that_are_no_plane_at_rest(tmp_path, change, said):
    held = "bottom, 3\n" if "fixed" in said else "bottom, 3\nceiling, 1, 3\n"
    text = before("*Boundary\n", GAPS).replace(*change).replace("bottom, 3\n", held)
    refused(fc.CaseError, said, deck_of, tmp_path, text)


@pytest.mark.filterwarnings("ignore:nothing determines the position of bodies")
def test_gap_elements_to_driven_nodes(tmp_path):
    """The ceiling comes down by 0.011, of which 0.001 are the gap; then it goes."""
    text = before("*Boundary\n", GAPS).replace("bottom, 3\n", "bottom, 3\nceiling, 1, 2\n")
    steps = static_steps(*(f"*Boundary\nceiling, 3, 3, {z}\n" for z in (-0.011, 0.01)))
    deck = deck_of(tmp_path, text.replace(STEP, steps))
    down, up = deck.solve()
    assert down.contact["gaps"].force[2] == pytest.approx(-1000.0, rel=1e-9)
    assert down.displacement[deck.points_of("ceiling"), 2] == pytest.approx(-0.011)
    assert down.reaction[deck.points_of("ceiling"), 2].sum() == pytest.approx(-1000.0, rel=1e-9)
    assert not up.contact["gaps"].active.any()


def test_gap_elements_between_bodies(tmp_path):
    pairs = "".join(f"{31 + k}, {5 + k}, {11 + k}\n" for k in range(4))
    between = f"*Element, type=GAPUNI, elset=gaps\n{pairs}*Gap, elset=gaps\n0.002, 0., 0., 1.\n"
    pushed = "*Step\n*Static\n*Boundary\ntop, 3, 3, -0.012\n*End Step\n"
    text = WHOLE.replace(CONTACT, between).replace(STEP, pushed)
    (step,) = deck_of(tmp_path, text).solve()
    assert abs(step.contact["gaps"].force[2]) == pytest.approx(1000.0, rel=1e-9)
    with pytest.raises(fc.CaseError, match=r"\*GAP: gap elements between bodies are supported along their direction"):
        deck_of(tmp_path, text.replace("31, 5, 11\n", "31, 5, 12\n").replace("32, 6, 12\n", "32, 6, 11\n"))


def test_fixed_supports_keep_where_they_are(tmp_path):
    """*BOUNDARY, FIXED after a step that moved them; in the first step it holds them at zero."""
    text = WHOLE.replace(STEP, static_steps("*Boundary\ntop, 3, 3, -0.01\n", "*Boundary, fixed\ntop, 3\n"))
    found = [step.contact["ss/sm"].force[2] for step in deck_of(tmp_path, text).solve()]
    assert found == pytest.approx([1000.0, 1000.0])
    text = WHOLE.replace("*Dsload\nroof, P, 100.\n", "*Boundary, fixed\ntop, 3\n*Cload\n5, 3, 100.\n")
    (step,) = deck_of(tmp_path, text).solve()
    assert np.abs(step.displacement[deck_of(tmp_path, text).points_of("top"), 2]).max() == 0.0


@pytest.mark.filterwarnings("ignore:nothing determines the position of bodies")
def test_an_amplitude_over_the_total_time_goes_on_in_later_steps(tmp_path):
    wave = "*Amplitude, name=wave, time=TOTAL TIME\n0., 0., 1., 1., 2., 0.5, 3., 0.\n"
    steps = "*Step\n*Static\n*Dsload, amplitude=wave\nroof, P, 100.\n*End Step\n" + "*Step\n*Static\n*End Step\n" * 2
    text = WHOLE.replace(SUPPORTS, wave + SUPPORTS).replace(STEP, steps)
    found = [step.contact["ss/sm"].force[2] for step in deck_of(tmp_path, text).solve()]
    assert found == pytest.approx([100.0, 50.0, 0.0], abs=1e-9)


def test_steps_one_by_one_are_those_of_solve(tmp_path):
    deck = deck_of(tmp_path, WHOLE)
    (one,), (other,) = list(deck.solve_steps()), deck.solve()
    assert np.array_equal(one.reaction, other.reaction)
    assert np.array_equal(one.displacement, other.displacement)


def test_incompatible_modes_are_left_out_in_axisymmetry_and_said(tmp_path):
    deck = deck_of(
        tmp_path,
        FLAT.replace("CPE4", "CAX4I").replace("1000., 0.3", "1000., 0.").replace("4, 1\n", "4, 1\n2, 2\n5, 2\n"),
    )
    assert "CAX4I: without incompatible modes, which makes thin parts stiffer" in notes_of(deck)
    assert not deck.model.materials[0][0].incompatible_modes


def test_initial_stresses_of_springs_are_refused_and_of_zero_change_nothing(tmp_path):
    with_spring = before("*Boundary\n", SPRING + "*Spring, elset=springs\n\n1.\n")
    with pytest.raises(fc.CaseError, match="element 7 is not a solid, so it has no initial stress"):
        deck_of(tmp_path, before("*Step", "*Initial Conditions, type=STRESS\n7, 1., 1., 1., 0., 0., 0.\n", with_spring))
    deck = deck_of(tmp_path, before("*Step", "*Initial Conditions, type=STRESS\n1, 0., 0., 0., 0., 0., 0.\n"))
    assert deck.model.initial_states == []


def test_elements_inside_out_are_turned_and_said(tmp_path):
    text = WHOLE.replace("1, 1, 2, 3, 4, 5, 6, 7, 8\n*Element", "1, 4, 3, 2, 1, 8, 7, 6, 5\n*Element")
    deck = deck_of(tmp_path, text)
    assert "1 elements were inverted and are reoriented" in notes_of(deck)
    assert deck.solve()[0].contact["ss/sm"].force[2] == pytest.approx(100.0)


def test_anisotropic_moduli_in_the_order_of_decks(tmp_path):
    """21 of them, the upper triangle by columns 11, 22, 33, 12, 13, 23: a bar along z has what the whole matrix says."""
    # Columns of the upper triangle: 11; 12, 22; 13, 23, 33; then shears without coupling.
    moduli = [3e5, 1e5, 4e5, 1e5, 1e5, 2e5, 0, 0, 0, 7e4, 0, 0, 0, 0, 8e4, 0, 0, 0, 0, 0, 9e4]
    lines = ",\n".join(", ".join(f"{v:g}" for v in moduli[k : k + 8]) for k in (0, 8, 16)) + "\n"
    deck = deck_of(tmp_path, WHOLE.replace("*Elastic\n200000., 0.\n", f"*Elastic, type=anisotropic\n{lines}"))
    D = np.array([[3e5, 1e5, 1e5], [1e5, 4e5, 1e5], [1e5, 1e5, 2e5]])
    (step,) = deck.solve()
    strain = np.linalg.solve(D, [0.0, 0.0, -100.0])
    assert step.displacement[deck.point(17)] == pytest.approx(strain * [1.0, 1.0, 2.0], rel=1e-6)
    full = deck.model.materials[0][0].moduli("3d")
    assert np.diag(full)[3:] == pytest.approx([7e4, 9e4, 8e4])  # xy, yz, xz


def test_a_locked_section_may_be_named_again_in_a_new_list(tmp_path):
    """OP=NEW must name it, or it is refused."""
    again = "*Boundary, op=NEW\nbottom, 1, 3\ntop, 1, 3\n"
    text = BAR + TIGHT + cooled(HELD) + f"*Step\n*Static\n{again}{HELD}*End Step\n"
    found = deck_of(tmp_path, text).solve()
    assert len(found) == 3
    assert np.allclose(found[2].displacement, found[1].displacement, atol=1e-12)
    with pytest.raises(fc.CaseError, match="is released here: a locked section stays locked"):
        deck_of(tmp_path, text.replace(f"{again}{HELD}", again))


def test_a_section_has_one_normal(tmp_path):
    with pytest.raises(fc.CaseError, match="2 data lines, but at most one is allowed, the normal"):
        deck_of(tmp_path, BAR.replace("0., 0., 1.\n*Boundary", "0., 0., 1.\n0., 0., 1.\n*Boundary") + TIGHT)


def test_a_distributing_coupling_whose_nodes_leave_a_rotation_free_is_refused_with_its_line(tmp_path):
    """In space, a surface that is one edge wide would do; one facet without width cannot be made, so nodes on a line are."""
    thin = NODES.replace("16, 1., 0., 2.", "16, 1e-13, 0., 2.").replace("17, 1., 1., 2.", "17, 1e-13, 1., 2.")
    coupling = "*Node\n90, 0., 0.5, 3.\n*Coupling, constraint name=c, ref node=90, surface=roof\n*Distributing\n1, 6\n"
    with pytest.raises(fc.CaseError, match=r"\*COUPLING|\*DISTRIBUTING"):
        deck_of(tmp_path, thin + coupling + MATERIAL + CONTACT + SUPPORTS + STEP)


def test_no_separation_holds_what_was_once_closed(tmp_path):
    """Pressed, then pulled: the pull goes through the contact."""
    text = WHOLE.replace("name=si\n", "name=si\n*Surface Behavior, no separation\n")
    forces = [step.contact["ss/sm"].force[2] for step in deck_of(tmp_path, text + STEP.replace("100.", "-40.")).solve()]
    assert forces == pytest.approx([100.0, -40.0])


@pytest.mark.parametrize(
    ("old", "new", "said"), [
        ("*Static\n", "*Static, stabilize=0.0002\n", "STABILIZE has no effect"),
        (
            "=si\n",
            "=si\n*Surface Behavior, pressure-overclosure=TIED\n1.\n*Friction\n0.1\n",
            "no effect in tied contact",
        ),
        (STEP, STEP + STEP.replace("*Step", "*Step, nlgeom"), "NLGEOM applies to all steps: finite strains"),
    ])  # fmt: skip
def test_what_has_no_or_a_wider_effect_is_noted(tmp_path, old, new, said):
    assert said in notes_of(deck_of(tmp_path, WHOLE.replace(old, new, 1)))


def test_temperatures_of_nodes_that_each_go_their_own_way(tmp_path):
    """No two histories have one shape: one field for each corner, and the sums are what the deck says."""
    nodes = (*range(1, 9), *range(11, 19))
    given = [{n: 20.0 + 3.0 * n**k - 7.0 * k * n for n in nodes} | {7: 20.0} for k in range(3)]
    steps = ["*Temperature\n" + "".join(f"{n}, {value}\n" for n, value in values.items()) for values in given]
    deck = deck_of(tmp_path, heated(steps=steps))
    assert len(deck.model.temperatures) == 4  # at the load factors 0, 1, 2 and 3
    for step, values in zip(deck.solve(), given, strict=True):
        rise = deck.model.temperature_rise(step.iterations["temperature_factors"])
        assert [rise[deck.point(n)] for n in nodes] == pytest.approx([values[n] - 20.0 for n in nodes])


def test_blanks_in_keywords_do_not_matter(tmp_path):
    text = WHOLE.replace("*Solid Section", "*SOLIDSECTION").replace("*Contact Pair", "*CONTACTPAIR")
    text = text.replace("type=SURFACE TO SURFACE", "type=SURFACETOSURFACE").replace("*End Step", "*ENDSTEP")
    assert deck_of(tmp_path, text).solve()[0].contact["ss/sm"].force[2] == pytest.approx(100.0)


def test_a_surface_that_nothing_uses_may_be_empty(tmp_path):
    text = WHOLE.replace("*Surface, name=roof", "*Surface, name=none\n*Surface, name=roof")
    assert deck_of(tmp_path, text).solve()[0].contact["ss/sm"].force[2] == pytest.approx(100.0)


@pytest.mark.parametrize("in_step", ["", "*Boundary\ntop, 3, 3, -0.002\n"])
def test_a_displacement_before_the_first_step_is_reached_in_it(tmp_path, in_step):
    """200 000 MPa, two cubes of 1 pressed by 0.001 or, where the step says otherwise, by 0.002."""
    text = WHOLE.replace("bottom, 3\n", "bottom, 3\ntop, 3, 3, -0.001\n").replace("*Dsload\nroof, P, 100.\n", in_step)
    deck = deck_of(tmp_path, text)
    force = 200.0 if in_step else 100.0
    assert deck.solve()[0].contact["ss/sm"].force[2] == pytest.approx(force)
    assert "a displacement prescribed before the first step is applied in that step" in notes_of(deck)


def test_adjust_closes_gaps_that_vary(tmp_path):
    """The lower corner of the upper cube stands 1e-3 off: it is taken for closed within 0.5, and left open within 1e-4."""
    skewed = WHOLE.replace("11, 0., 0., 1.", "11, 0., 0., 1.001")
    found = [
        deck_of(tmp_path, skewed.replace("type=SURFACE TO", f"adjust={within}, type=SURFACE TO"))
        for within in (0.5, 1e-4)
    ]
    pressure = [deck.solve()[0].contact["ss/sm"].pressure for deck in found]
    assert pressure[0] == pytest.approx(100.0, rel=5e-3)
    assert np.ptp(pressure[1]) > 50.0
    assert "ADJUST: the distance of 0.001 to 0.001 at 1 nodes of the sides is taken as zero" in notes_of(found[0])


COUPLED = "*Node\n90, 0.5, 0.5, 3.\n"


@pytest.mark.parametrize("kind", ["Kinematic", "Distributing"])
def test_components_of_a_coupling_count_along_its_orientation(tmp_path, kind):
    """Along the second of axes whose second is z, the same as along z of the mesh; the others stay free."""
    text = WHOLE.replace("*Dsload\nroof, P, 100.", "*Cload\n90, 3, -100.").replace(
        "*Boundary\n", "*Boundary\n90, 1, 2\n90, 4, 6\n"
    )
    oriented = "*Orientation, name=o\n0., 1., 0., 0., 0., 1.\n*Coupling, ref node=90, surface=roof, orientation=o\n"
    plain = "*Coupling, ref node=90, surface=roof\n"
    steps = [
        deck_of(tmp_path, text.replace("*Material", f"{COUPLED}{head}*{kind}\n{component}\n*Material", 1)).solve()[0]
        for head, component in ((plain, 3), (oriented, 2))
    ]
    assert steps[0].contact["ss/sm"].force[2] == pytest.approx(100.0)
    np.testing.assert_allclose(steps[1].displacement, steps[0].displacement, atol=1e-12)


# Local x, y and z are y, z and x of the mesh.
TURNED = "*Nset, nset=ref\n90\n*Transform, nset=ref\n0., 1., 0., 0., 0., 1.\n"


@pytest.mark.parametrize(
    ("name", "axes", "components"),
    [
        ("xsymm", "", (1, 5, 6)), ("ysymm", "", (2, 4, 6)), ("zsymm", "", (3, 4, 5)), ("encastre", "", range(1, 7)),
        ("xsymm", TURNED, (2, 4, 6)),
    ],
)  # fmt: skip
def test_named_supports_of_a_node_with_rotations_hold_its_rotations(tmp_path, name, axes, components):
    coupling = f"{COUPLED}*Coupling, ref node=90, surface=roof\n*Kinematic\n1, 6\n"
    by_name, by_component = (
        deck_of(tmp_path, before("*Boundary\n", coupling + further).replace("*Boundary\n", f"*Boundary\n{lines}", 1))
        for further, lines in ((axes, f"90, {name}\n"), ("", "".join(f"90, {k}\n" for k in components)))
    )
    np.testing.assert_array_equal(*(np.argwhere(deck.model.prescribed()[0]) for deck in (by_name, by_component)))


FREQUENCY = "*Step, perturbation\n*Frequency\n 2\n*End Step\n"


def test_frequencies_about_the_last_step(tmp_path, capsys):
    """A bar of two linear elements: ``w^2 = 6 E / (density h^2) (1 - cos k h) / (2 + cos k h)``, ``k h = pi / 4``."""
    text = WHOLE.replace("200000., 0.\n", "200000., 0.\n*Density\n8e-9\n").replace(
        "x0, 1\ny0, 2", "low, 1, 2\nup, 1, 2"
    )
    text = text.replace(
        "*Nset, nset=x0", "*Nset, nset=low, generate\n1, 8\n*Nset, nset=up, generate\n11, 18\n*Nset, nset=x0"
    )
    deck = deck_of(tmp_path, text + FREQUENCY)
    assert deck.modes == {"n": 2, "stress_stiffening": True}
    assert "2 modes at the last step, with the initial-stress stiffness" in notes_of(deck)
    k = np.cos(np.pi / 4)
    exact = np.sqrt(6 * 2e5 / 8e-9 * (1 - k) / (2 + k)) / (2 * np.pi)
    assert fc.modes(deck.model, deck.solve()[-1], n=1).frequencies[0] == pytest.approx(exact, rel=1e-3)  # 100 of 2e5
    assert main(["run", str(tmp_path / "deck.inp"), "-o", str(tmp_path / "r.vtkhdf")]) == 0
    assert (
        f"natural frequencies [cycles per unit of time] at the last step: {exact / 1e5:.0f}" in capsys.readouterr().out
    )
    for wrong, said in (
        (text.replace(STEP, FREQUENCY), r"\*FREQUENCY needs a step with \*STATIC before"),
        (text + FREQUENCY + STEP, r"\*STEP: follows a step with \*FREQUENCY"),
        (text + FREQUENCY.replace(" 2\n", " 2\n*Boundary\ntop, 3\n"), r"\*BOUNDARY: cannot be in a step with \*FREQ"),
        (text + FREQUENCY.replace(" 2\n", " 0\n"), "the number of modes must be at least 1"),
        (text + FREQUENCY.replace(" 2\n", " 2\n*Static\n"), r"either \*STATIC or one"),
    ):
        refused(fc.CaseError, said, deck_of, tmp_path, wrong)
