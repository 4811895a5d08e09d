"""Options and formulations of contact pairs, from Python and from case files, and their messages."""

import tomllib

import pytest
from case_texts import case_of, contact_pair
from refusals import refused

import fastcontact as fc
from fastcontact.cases.case import build_case, read_case
from fastcontact.cases.summary import lines, step_entry, summarise
from fastcontact.contact.formulations import FORMULATIONS, Formulation

MESH = 'generator = "block-on-block"\nelement = "quad4"\ndivisions_lower = [3, 2]\ndivisions_upper = [3, 2]'
HELD = {"LOWER_LEFT": "x", "UPPER_LEFT": "x", "LOWER_BOTTOM": "y", "UPPER_TOP": {"y": -0.02}}
CASE = case_of(MESH, ramp="steps = 2", **HELD) + contact_pair()


def case_with(options):
    return build_case(tomllib.loads(CASE + options), name="case", text=CASE + options)


def solved(case):
    return fc.solve(case.model, case.ramp)[-1]


@pytest.mark.parametrize(("options", "words"), [
    ("clearence = 0.1", "'clearence'.*'clearance'"),
    ('clearance = "0.1 * x"', "the clearance of contact 'pair' is '0.1 \\* x', which is not a finite number"),
    ("clearance = [1.0]", "the clearance of contact 'pair' is \\[1.0\\], which is not a finite number"),
    ("clearance = nan", "the clearance of contact 'pair' is nan"),
    ("clearance_ramp = [[0, 0], [1, 1]]", "has a clearance_ramp, but no clearance"),
    ("clearance = 0.1\nclearance_ramp = [[1, 0], [1, 1]]", "clearance_ramp of contact 'pair'.* increasing"),
    ('excluded = "NOWHERE"', "NOWHERE"),
    ('excluded = "LOWER_BOTTOM"', "has no nodes on the secondary side 'CONT_UPPER'"),
    ('penalty = "stiff"', "the penalty of contact 'pair' is 'stiff'"),
    ('kind = "glue"', "kind of contact 'pair' 'glue'.*bilateral.*tied"),
])  # fmt: skip
def test_wrong_options_are_named(options, words):
    refused(fc.FastcontactError, words, case_with, options)


def test_a_ramp_must_cover_the_analysis():
    case = case_with("clearance = 0.1\nclearance_ramp = [[0, 0], [0.5, 1]]")
    with pytest.raises(fc.ModelError, match=r"clearance of contact 'pair' covers 0 to 0.5, but a load step ends at 1"):
        fc.solve(case.model, case.ramp)


def test_a_clearance_that_fails_is_named():
    case = case_with("")
    case.model.contact.clear()
    case.model.add_contact("pair", secondary="CONT_UPPER", primary="CONT_LOWER", clearance=lambda x: x[:3, 0])
    refused(fc.ModelError, "clearance of contact 'pair' is a function that returned", solved, case)


def test_the_summary_tells_the_penetration(tmp_path):
    path = tmp_path / "soft.toml"
    path.write_text(CASE + "penalty = 1e5\n")
    case = read_case(path)
    steps = fc.solve(case.model, case.ramp)
    summary = summarise(case, steps[-1], [step_entry(step) for step in steps], {}, [])
    pressure = 0.02 / (10 * 0.91e-3 + 1e-5)
    assert summary["contact"]["pair"]["penetration"] == pytest.approx(pressure / 1e5, rel=1e-8)
    assert summary["contact"]["pair"]["penalty"] == 1e5
    assert any(f"penetrates by up to {pressure / 1e5:.4g}" in line for line in lines(summary))
    stiff = summarise(case_with(""), fc.solve(case_with("").model, case.ramp)[-1], [], {}, [])
    assert stiff["contact"]["pair"]["penetration"] < 1e-15
    assert stiff["contact"]["pair"]["penalty"] is None


def test_every_name_has_a_class_and_others_have_none():
    assert set(FORMULATIONS) >= {"node_to_segment", "continuous", "mortar"}
    assert len(FORMULATIONS) == len(list(FORMULATIONS))
    assert all(issubclass(kind, Formulation) for kind in FORMULATIONS.values())
    assert FORMULATIONS.get("mortal") is None
