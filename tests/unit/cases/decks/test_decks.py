"""Decks as models: every keyword translated or refused with its line, histories over steps, results."""

import numpy as np
import pytest
from commands import output_of
from deck_text import CONTACT, MATERIAL, NODES, STEP, SUPPORTS, WHOLE, deck_of, static_steps
from pairwise import first_of
from refusals import refused

import fastcontact as fc
from fastcontact.cases.case import files_of_case, read_case
from fastcontact.cli._main import main


def height(deck, steps, number=17):
    return [step.displacement[deck.point(number), 2] for step in steps]


def line_of(text, begins):
    """Return the number of the last line that begins with a text."""
    return max(number for number, line in enumerate(text.splitlines(), start=1) if line.startswith(begins))


def test_two_cubes_are_a_bar(tmp_path):
    deck = deck_of(tmp_path, WHOLE)
    (step,) = deck.solve()
    assert (deck.title, step.load_factor) == ("two cubes", 1.0)
    assert step.contact["ss/sm"].force[2] == pytest.approx(100.0)
    assert step.reaction[deck.points_of("Bottom")].sum(axis=0) == pytest.approx([0.0, 0.0, 100.0], abs=1e-9)
    assert height(deck, [step]) == pytest.approx([-100.0 * 2 / 200_000])


@pytest.mark.parametrize(
    ("old", "new", "begins", "said"),
    [
        ("*Boundary\n", "*Boundry\n", "*Boundry", r"unknown keyword \*BOUNDRY: did you mean \*BOUNDARY\?"),
        ("bottom, 3\n", "botom, 3\n", "botom, 3", "set 'botom' is not defined; node sets: bottom, top, x0, y0"),
        ("ss, sm\n", "ss, s_m\n", "ss, s_m", "surface 's_m' is not defined; surfaces: roof, sm, ss"),
        ("elset=up, material=steel", "elset=up, material=brass", "*Solid Section, elset=up",
         "material 'brass' is not defined; materials: steel"),
        ("*Solid Section, elset=up, material=steel\n", "", "2, 11, 12", r"1 element \(2\) of set 'up' has no section"),
        ("17, 18\n*Nset, nset=bottom", "17, 99\n*Nset, nset=bottom", "2, 11, 12",
         "element 2 uses node 99, which is not defined"),
        ("17, 18\n*Nset, nset=bottom", "17\n*Nset, nset=bottom", "2, 11, 12", "has 7 nodes, 8 are needed"),
        ("200000., 0.\n", "200000., O.3\n", "200000.", "'O.3' is not a number"),
        ("200000., 0.\n", "200000., 0.5\n", "200000.", "material 'steel': Poisson's ratio"),
        ("200000., 0.\n", "200000., 0.\n*Creep\n1., 0.\n", "*Creep", r"material 'steel': \*CREEP is outside the scope"),
        ("200000., 0.\n", "200000., 0.\n*Plastic, hardening=combined\n1., 0.\n", "*Plastic",
         "HARDENING=COMBINED is not supported"),
        ("200000., 0.\n", "200000., 0.\n*Plastic\n1., 0.1\n", "1., 0.1", "the first plastic strain"),
        ("200000., 0.\n", "200000., 0.\n*Hyperelastic, reduced polynomial\n1.\n", "*Hyperelastic", "REDUCED POLYNOMIAL"),
        ("*Static\n", "*Dynamic\n", "*Dynamic", "quasi-static"),
        ("*Static\n", "", "*Step", r"has no \*STATIC"),
        ("*End Step\n", "", "*Step", r"has no \*END STEP"),
        ("type=SURFACE TO SURFACE", "type=MASSLESS", "*Contact Pair", "TYPE=MASSLESS is not supported"),
        ("type=SURFACE TO SURFACE", "tied", "*Contact Pair", "the parameter TIED of .* is not supported"),
        ("interaction=si, ", "interaction=so, ", "ss, sm", "surface interaction 'so' is not defined"),
        ("roof, P, 100.", "roof, HP, 100.", "roof, HP", "load HP on a surface is not supported"),
        ("up, S2\n", "up, S7\n", "up, S7", "has no face 7"),
        ("up, S2\n", "up, SPOS\n", "up, SPOS", "face 'SPOS' is not supported"),
        ("top\n15, 16, 17, 18\n", "top\n15, 16, 17, 18, 77\n", "15, 16, 17, 18, 77", "node 77 is not defined"),
        ("top\n15, 16, 17, 18\n", "top\ntop\n", "top", "set 'top' contains itself"),
        ("2, 1., 0., 0.\n", "2, 1., 0., 0.\n1, 5.\n", "1, 5.", "node 1 is defined twice"),
        ("*Static\n", "*Static\n*Cflux\n17, 11, 3.\n", "*Cflux", "needs a step with"),
        ("roof, P, 100.\n", "roof, P, 100.\nroof, P, 1e2\n", "roof, P, 1e2", "second value in this step"),
        ("bottom, 3\n", "bottom, 3\nbottom, 3, 3, 1e-9\n", "bottom, 3, 3", "1e-09 is the second value in this step, after 0"),
        ("*Dsload\n", "*Dsload, amplitude=none\n", "*Dsload", "amplitude 'none' is not defined"),
        ("roof, P, 100.\n", "roof, P, 100.\n*Dload\nup, GRAV, 9.81, 0, 0, -1\n", "up, GRAV", r"no \*DENSITY"),
        ("bottom, 3\n", "bottom, 11\n", "bottom, 11", "not within 1 to 6"),
        ("type=C3D8, elset=up", "type=S4, elset=up", "*Element, type=S4",
         r"S4 \(shell\) is not supported; 1 element in set 'up'"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_told_by_file_line_and_keyword(tmp_path, old, new, begins, said):
    assert old in WHOLE
    line = line_of(WHOLE.replace(old, new), begins)
    refused(fc.CaseError, rf"^deck\.inp, line {line}, \*[A-Z ]+: .*{said}", deck_of, tmp_path, WHOLE.replace(old, new))


def test_two_values_of_a_node_may_differ_by_round_off_alone(tmp_path):
    text = WHOLE.replace("bottom, 3\n", "bottom, 3, 3, 0.3\nbottom, 3, 3, 0.30000000000000004\n")
    assert deck_of(tmp_path, text).solve()[-1].displacement[:, 2].max() == pytest.approx(0.3, rel=1e-12)


def test_a_deck_without_steps_says_so(tmp_path):
    refused(fc.CaseError, "no step", deck_of, tmp_path, WHOLE.replace(STEP, ""))


def test_nlgeom_is_finite_strain(tmp_path):
    deck = deck_of(tmp_path, WHOLE.replace("*Step\n", "*Step, nlgeom=YES\n").replace("P, 100.", "P, 20000."))
    assert deck.model.strain == "finite"
    top = deck.solve()[-1].displacement[deck.points_of("top"), 2].mean() / 2.0
    # Saint Venant-Kirchhoff, nu = 0: the pressure on the deformed area, which stays.
    assert 0.5 * ((1.0 + top) ** 2 - 1.0) * (1.0 + top) == pytest.approx(-0.1, rel=1e-6)


def test_nlgeom_with_kinematic_hardening_warns_and_tells_the_strain_found(tmp_path):
    plastic = WHOLE.replace("200000., 0.\n", "200000., 0.\n*Plastic, hardening=kinematic\n5000., 0.\n6000., 1.\n")
    text = plastic.replace("*Step\n", "*Step, nlgeom=YES\n").replace("P, 100.", "P, 2000.")
    with pytest.warns(fc.FastcontactWarning, match=r"deck\.inp, line 53, \*STEP: NLGEOM: with kinematic hardening"):
        deck = deck_of(tmp_path, text)
    with pytest.warns(fc.FastcontactWarning, match=r"equivalent strain is up to 0\.00667"):  # 2/3 of 0.01 at nu = 0
        deck.solve()


RUBBERS = [
    ("*Hyperelastic, neo hooke\n0.5, 0.2\n", fc.NeoHookean(E=90.0 / 31.0, nu=28.0 / 62.0)),
    ("*Hyperelastic, mooney-rivlin\n0.4, 0.1, 0.2\n", fc.MooneyRivlin(0.4, 0.1, bulk=10.0)),
    ("*Hyperelastic, yeoh\n0.5, -0.1, 0.01, 0.2\n", fc.Yeoh(0.5, -0.1, 0.01, bulk=10.0)),
    ("*Hyperelastic, ogden, n=2\n0.8, 2., 0.2, -1., 0.2\n", fc.Ogden([0.8, 0.2], [2.0, -1.0], bulk=10.0)),
]


@pytest.mark.parametrize(("keyword", "law"), first_of(2, RUBBERS))
def test_hyperelastic_materials(tmp_path, keyword, law):
    deck = deck_of(tmp_path, WHOLE.replace("*Elastic\n200000., 0.\n", keyword).replace("P, 100.", "P, 0.1"))
    (found, _), *_ = deck.model.materials
    assert found.constants == pytest.approx(law.constants)
    assert deck.model.strain == "finite"
    assert deck.solve()[-1].displacement[:, 2].min() < -0.01


@pytest.mark.parametrize(
    ("n", "message"),
    [("0", "N = 0 must be a positive whole number"), ("1.5", "N = 1.5 must be"), ("two", "'two' is not a number")],
)
def test_the_number_of_terms_of_ogden_is_checked(tmp_path, n, message):
    keyword = f"*Hyperelastic, ogden, n={n}\n0.8, 2., 0.2\n"
    with pytest.raises(fc.CaseError, match=rf"line \d+, \*HYPERELASTIC: .*{message}"):
        deck_of(tmp_path, WHOLE.replace("*Elastic\n200000., 0.\n", keyword))


def test_plastic_tables_and_kinematic_hardening(tmp_path):
    for text, law in (
        ("*Plastic\n50., 0.\n60., 0.01\n", {"hardening": [(0.0, 50.0), (0.01, 60.0)]}),
        ("*Plastic, hardening=kinematic\n50., 0.\n60., 0.01\n", {"kinematic": 1000.0}),
    ):
        deck = deck_of(tmp_path, WHOLE.replace("200000., 0.\n", "200000., 0.\n" + text).replace("P, 100.", "P, 55."))
        assert deck.model.materials[0][0] == fc.ElasticPlastic(E=200000.0, nu=0.0, yield_stress=50.0, **law)
        assert deck.solve()[-1].cell_fields["plastic_strain"] == pytest.approx(0.005, rel=1e-6)
    deck_of(tmp_path, WHOLE.replace("*Step\n", "*Step, nlgeom=NO\n"))


def test_loads_ramp_from_step_to_step_and_stay_or_go(tmp_path):
    loads = (
        "*Dsload\nroof, P, 100.\n",
        "*Cload\ntop, 3, -5.\n",
        "*Dsload, op=NEW\n",
        "*Cload\n15, 3, -25.\n*Dsload\nroof, P, 60.\n",
    )
    found = deck_of(tmp_path, WHOLE.replace(STEP, static_steps(*loads))).solve()
    assert [step.load_factor for step in found] == [1.0, 2.0, 3.0, 4.0]
    assert [step.contact["ss/sm"].force[2] for step in found] == pytest.approx([100.0, 120.0, 20.0, 100.0])


def test_prescribed_displacements_go_from_value_to_value(tmp_path):
    wave = "*Amplitude, name=wave\n0., 0., 0.5, 2., 1., 1.\n"
    again = SUPPORTS.replace("*Boundary", "*Boundary, op=NEW, amplitude=wave") + "top, 3, 3, -0.001\n"
    deck = deck_of(tmp_path, WHOLE.replace(STEP, wave + static_steps("*Boundary\ntop, 3, 3, -0.002\n", again)))
    found = {step.load_factor: step.displacement[deck.point(17), 2] for step in deck.solve()}
    assert found == pytest.approx({1.0: -0.002, 1.5: -0.002, 2.0: -0.001}, rel=1e-9)


def test_weight_and_centrifugal_force(tmp_path):
    loads = (
        "*Dload\n, GRAV, 10., 0., 0., -2.\nup, CENTRIF, 4., 0., 0., 0., 0., 0., 1.\n1, BX, 1.\n",
        "*Dload\n, GRAV, 20., 0., 2e-9, -1.\nup, CENTRIF, 8., 0., 0., 5., 0., 0., -2.\nlow, BX, 2.\n",
    )
    text = WHOLE.replace("*Elastic\n", "*Density\n3.\n*Elastic\n").replace(STEP, static_steps(*loads))
    deck = deck_of(tmp_path, text)
    for factor, step in enumerate(deck.solve(), start=1):  # the second step replaces the loads
        assert step.reaction[deck.points_of("bottom")].sum(axis=0)[2] == pytest.approx(60.0 * factor)
        assert step.contact["ss/sm"].force[2] == pytest.approx(30.0 * factor)
        assert step.reaction[deck.points_of("x0")].sum(axis=0)[0] == pytest.approx((-3.0 * 4.0 * 0.5 - 1.0) * factor)


@pytest.mark.filterwarnings("ignore:contact .* penetrates by")
def test_laws_of_overclosure(tmp_path):
    law = "*Surface Interaction, name=si\n*Surface Behavior, pressure-overclosure={}\n{}"
    text = WHOLE.replace("*Surface Interaction, name=si\n", law)
    for kind, numbers, softer in (
        ("LINEAR", "1.e6\n", 1.0),  # a penalty of that slope
        ("TABULAR", "0., 0.\n1.e3, 1.e-3\n", 1.0),
        ("TABULAR", "0., -1.e-4\n50., 0.\n150., 2.e-4\n", 1.0),
        ("EXPONENTIAL", "1.e-4, 10.\n", np.log(10.0) / np.log(100.0)),
    ):
        deck = deck_of(tmp_path, text.format(kind, numbers))
        within = 1e-5 if kind == "EXPONENTIAL" else 1e-6
        assert height(deck, deck.solve()) == pytest.approx([-0.001 - 1e-4 * softer], rel=within)
    with pytest.raises(fc.CaseError, match="ascending pressures and overclosures"):
        deck_of(tmp_path, text.format("TABULAR", "0., 0.\n1., 1.\n0.5, 2.\n"))


def test_a_clearance_opens_and_adjust_closes(tmp_path):
    apart = WHOLE.replace("11, 0., 0., 1.", "11, 0., 0., 1.0001").replace("*Nset", "*Nset, nset=feet\nup\n*Nset", 1)
    for number, where in (("12", "1., 0."), ("13", "1., 1."), ("14", "0., 1.")):
        apart = apart.replace(f"{number}, {where}, 1.\n", f"{number}, {where}, 1.0001\n")
    pressed = apart.replace("*Dsload\nroof, P, 100.", "*Boundary\ntop, 3, 3, -0.0005")
    for options, gap in (("", 1e-4), (", adjust=0.01", 0.0), (", adjust=feet", 0.0), (", adjust=0.00001", 1e-4)):
        deck = deck_of(tmp_path, pressed.replace("type=SURFACE TO SURFACE", f"type=SURFACE TO SURFACE{options}"))
        stiffness = 200_000.0 / (2.0 - 1e-4)
        assert deck.solve()[0].contact["ss/sm"].force[2] == pytest.approx(stiffness * (0.0005 - gap), rel=1e-6)
    clear = "ss, sm\n*Clearance, master=sm, slave=ss, value=0.0002\n"
    deck = deck_of(tmp_path, pressed.replace("ss, sm\n", clear))
    assert deck.solve()[0].contact["ss/sm"].force[2] == pytest.approx(stiffness * 0.0003, rel=1e-6)


def test_reactions_are_those_of_supports_alone(tmp_path):
    together = "*Equation\n2\n16, 3, 1., 15, 3, -1.\n2\n17, 3, 1., 15, 3, -1.\n2\n18, 3, 1., 15, 3, -1.\n"
    text = (NODES + MATERIAL + CONTACT + together + SUPPORTS + STEP).replace(
        "*Dsload\nroof, P, 100.", "*Cload\n15, 3, -100."
    )
    deck = deck_of(tmp_path, text)
    (step,) = deck.solve()
    assert step.contact["ss/sm"].force[2] == pytest.approx(100.0)
    assert np.abs(step.reaction[deck.points_of("top"), 2]).max() < 1e-8
    assert step.reaction[deck.points_of("bottom"), 2].sum() == pytest.approx(100.0)


@pytest.mark.parametrize("own", [False, True])
def test_a_rigid_body_turns_by_a_moment_at_its_reference_node_or_rotation_node(tmp_path, own):
    """The displacement components of a ROT NODE of its own are rotations."""
    rigid = "*Node, nset=ref\n90, 0.5, 0.5, 2.5\n*Node, nset=rot\n91, 0.5, 0.5, 2.5\n*Rigid Body, elset=up, ref node=90"
    rigid += ", rot node=91\n" if own else "\n"
    turning = [f"rot, {axis}" if own else f"ref, {3 + axis}" for axis in (1, 3, 2)]
    load = "*Boundary\nref, 1, 2\n{}\n{}\n*Cload\nref, 3, -1.\n{}, 0.1\n".format(*turning)
    text = (NODES + rigid + MATERIAL + CONTACT + "*Boundary\nbottom, 1, 3\n" + STEP).replace(
        "*Dsload\nroof, P, 100.\n", load
    )
    deck = deck_of(tmp_path, text)
    (step,) = deck.solve()
    contact = step.contact["ss/sm"]
    assert contact.force[2] == pytest.approx(1.0)
    moment = (contact.force_vectors[:, 2] * (contact.coordinates[:, 0] - 0.5)).sum()
    assert moment == pytest.approx(0.1, rel=1e-3)
    assert step.reaction[deck.points_of("bottom")].sum(axis=0)[2] == pytest.approx(1.0)
    assert abs(step.reaction[deck.point(90), 2]) < 1e-9
    (reference,) = step.reference_reactions.values()
    assert list(step.reference_reactions) == ["ref"]
    assert reference["force"] == step.reaction[deck.point(90)].tolist()
    assert reference["moment"][1] == pytest.approx(0.0, abs=1e-9)


def test_results_of_the_model_are_converted_to_those_of_the_deck(tmp_path):
    """The support that locks the rigid body in the second step is a multi-point constraint of the model."""
    rigid = "*Node, nset=ref\n90, 0.5, 0.5, 2.5\n*Rigid Body, elset=up, ref node=90\n"
    second = "*Step\n*Static\n*Boundary, fixed\nref, 3\n*Cload\nref, 3, -5.\n*End Step\n"
    load = "*Boundary\nref, 1, 2\nref, 4, 6\n*Cload\nref, 3, -1.\n"
    text = NODES + rigid + MATERIAL + CONTACT + "*Boundary\nbottom, 1, 3\n" + STEP + second
    deck = deck_of(tmp_path, text.replace("*Dsload\nroof, P, 100.\n", load))
    last, plain = deck.solve()[-1], fc.solve(deck.model, deck.ramp, criteria=deck.criteria)[-1]
    assert last.reference_reactions["ref"]["force"] == pytest.approx([0.0, 0.0, 4.0], abs=1e-9)
    assert plain.reference_reactions["ref"]["force"] == pytest.approx([0.0] * 3, abs=1e-9)
    assert deck.finished(plain).reference_reactions == last.reference_reactions


@pytest.mark.parametrize("kind", ["Kinematic", "Distributing"])
def test_forces_and_moments_at_a_coupling_reach_the_floor(tmp_path, kind):
    coupling = f"*Node\n90, 0.7, 0.5, 3.\n*Coupling, constraint name=c, ref node=90, surface=roof\n*{kind}\n1, 3\n"
    text = (NODES + coupling + MATERIAL + CONTACT + SUPPORTS + STEP).replace(
        "*Dsload\nroof, P, 100.\n", "*Cload\n90, 3, -100.\n90, 5, 5.\n"
    )
    deck = deck_of(tmp_path, text)
    (step,) = deck.solve()
    bottom = deck.points_of("bottom")
    force = step.reaction[bottom, 2]
    assert force.sum() == pytest.approx(100.0)
    assert list(step.reference_reactions) == ["90"]
    # The force acts at x = 0.7; the moment 5 about y moves its line by 0.05.
    x = deck.model.mesh.points[bottom, 0]
    sides = step.reaction[deck.points_of("x0"), 0] @ deck.model.mesh.points[deck.points_of("x0"), 2]
    assert (force @ x) == pytest.approx(75.0 + sides, abs=0.05)


def test_local_axes_turn_supports(tmp_path):
    turned = "*Transform, nset=bottom, type=R\n0., 0., 1., 1., 0., 0.\n"
    text = WHOLE.replace("*Boundary\nbottom, 3\n", f"{turned}*Boundary\nbottom, 1\n").replace("x0, 1\n", "x0, 1\n")
    text = text.replace("*Nset, nset=x0\n1, 4, 5, 8,", "*Nset, nset=x0\n5, 8,").replace(
        "nset=y0\n1, 2, 5,", "nset=y0\n5,"
    )
    deck = deck_of(tmp_path, text)
    (step,) = deck.solve()
    assert step.reaction[deck.points_of("bottom"), 2].sum() == pytest.approx(100.0)


def test_the_command_line_takes_decks(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    deck_of(tmp_path, WHOLE)
    assert "ss/sm" in output_of(capsys, ["info", "deck.inp"])
    assert main(["run", "deck.inp", "-q"]) == 0
    with fc.open_results("deck.vtkhdf") as results:
        assert results[-1].contact["ss/sm"].force[2] == pytest.approx(100.0)
    assert "complete" in output_of(capsys, ["run", "deck.inp", "--resume"])
    (tmp_path / "deck.inp").write_text(WHOLE.replace("*Boundary\n", "*Boundry\n"), encoding="utf-8")
    assert "deck.inp, line 46, *BOUNDRY" in output_of(capsys, ["run", "deck.inp"], 1)


def test_a_deck_is_a_case(tmp_path):
    deck_of(tmp_path, WHOLE)
    case = read_case(tmp_path / "deck.inp")
    assert (case.name, case.title) == ("deck", "two cubes")
    assert files_of_case(tmp_path / "deck.inp") == [tmp_path / "deck.inp"]


@pytest.mark.parametrize("source", ["deck.inp", "parts/nodes.inp", "parts/more.inp"])
@pytest.mark.parametrize("option", ["-o", "--json"])
def test_no_run_replaces_a_part_of_its_deck(option, source, tmp_path, monkeypatch, capsys):
    """Decks include files, which include others."""
    monkeypatch.chdir(tmp_path)
    parts = tmp_path / "parts"
    parts.mkdir()
    (parts / "nodes.inp").write_text("*Include,\ninput=parts/more.inp\n", encoding="utf-8")
    (parts / "more.inp").write_text(NODES, encoding="utf-8")
    deck_of(tmp_path, "*Include, input=parts/nodes.inp\n" + WHOLE.replace(NODES, ""))
    assert files_of_case(tmp_path / "deck.inp") == [tmp_path / "deck.inp", parts / "nodes.inp", parts / "more.inp"]
    before = (tmp_path / source).read_bytes()
    assert f"'{source}' is an input of this command" in output_of(capsys, ["run", "deck.inp", option, source], 1)
    assert (tmp_path / source).read_bytes() == before


def test_a_node_or_set_that_is_not_there(tmp_path):
    deck = deck_of(tmp_path, WHOLE)
    refused(fc.MeshError, r"node '99' is not defined in 'deck\.inp'", deck.point, 99)
    refused(fc.MeshError, "did you mean", deck.points_of, "botom")


def test_materials_with_axes(tmp_path):
    """A bar along z, the second axis of the material once it is turned: E2 counts."""
    turned = "*Orientation, name=turned\n1., 0., 0., 0., 0., 1.\n"
    law = "*Elastic, type=EngineeringConstants\n1.e5, 5.e4, 2.e4, 0., 0., 0., 1.e4, 1.e4,\n1.e4\n"
    text = WHOLE.replace(MATERIAL[:22], turned + MATERIAL[:22]).replace("*Elastic\n200000., 0.\n", law)
    text = text.replace(", material=steel\n", ", material=steel, orientation=turned\n")
    deck = deck_of(tmp_path, text)
    assert height(deck, deck.solve()) == pytest.approx([-100.0 * 2 / 5e4])
    moduli = "*Elastic, type=orthotropic\n1.e5, 0., 5.e4, 0., 0., 2.e4, 1.e4, 1.e4\n1.e4\n"
    other = text.replace(law, moduli)
    deck = deck_of(tmp_path, other)
    assert height(deck, deck.solve()) == pytest.approx([-100.0 * 2 / 5e4])
    with pytest.raises(fc.CaseError, match=r"\*ELASTIC: material 'steel': 8 constants where ORTHOTROPIC has 9"):
        deck_of(tmp_path, other.replace("1.e4, 1.e4\n1.e4\n", "1.e4, 1.e4\n"))
    with pytest.raises(fc.CaseError, match="orientation 'turned' is not defined; orientations: none"):
        deck_of(tmp_path, other.replace(turned, ""))


@pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")
def test_a_deck_with_a_line_left_out_cut_or_twice_is_read_or_refused_in_one_line(tmp_path):
    lines, texts = WHOLE.splitlines(), []
    for number, line in enumerate(lines):
        cut, changed = line[: len(line) // 2], (line.replace("1", "x"), line.replace(",", ",,"))
        for instead in ([], [cut], [line, line], *([text] for text in changed)):
            try:
                deck_of(tmp_path, "\n".join([*lines[:number], *instead, *lines[number + 1 :]]))
            except fc.FastcontactError as error:
                texts.append(str(error))
    assert len(texts) > len(lines)
    assert not [text for text in texts if "\n" in text]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("bottom, 3\n", "bottom, 3, 2000000000\n", r"\*BOUNDARY: components 3 to 2000000000 are not within 1 to 6"),
        ("bottom, 3\n", "bottom, 3, 9223372036854775808\n", "'9223372036854775808' is not a whole number"),
        ("generate\n1, 4\n", "generate\n1, 9223372036854775808\n", "'9223372036854775808' is not a whole number"),
    ],
)
def test_numbers_without_measure_take_neither_time_nor_memory(tmp_path, old, new, said):
    assert old in WHOLE
    refused(fc.CaseError, said, deck_of, tmp_path, WHOLE.replace(old, new))


def test_a_range_to_a_large_number_takes_what_is_there(tmp_path):
    deck = deck_of(
        tmp_path, WHOLE.replace("generate\n1, 4\n", "generate\n1, 4\n*Nset, nset=all, generate\n1, 900000000000000\n")
    )
    assert len(deck.points_of("all")) == 16


@pytest.mark.parametrize("increment", ["1e-320, 1.", "1e-9, 1.", "1., 1e-320", "1e-300, 1e308"])
def test_increments_of_any_size(tmp_path, increment):
    """With friction every increment is a load step, up to a number that ends."""
    text = WHOLE.replace("name=si\n", "name=si\n*Friction\n0.2\n").replace("*Static\n", f"*Static\n{increment}\n")
    assert 1 <= len(deck_of(tmp_path, text).ramp) < 2000
