"""Values set in a parsed case file by path, and the message of a wrong path."""

import pytest

from fastcontact.errors import CaseError
from fastcontact.studies.case_parameters import substituted

DATA = {
    "material": [{"E": 1.0, "nu": 0.3}, {"E": 2.0, "nu": 0.2}],
    "contact": {"pair": {"friction": 0.1}},
    "mesh": {"arc_sizes": [1.0, 2.0]},
}
LINKED = {
    "size": {"mesh.arc_sizes[0]": "0.5*value^2", "mesh.arc_sizes[1]": "value", "contact.pair.friction": "-1e-1*value"}
}


@pytest.mark.parametrize(
    ("path", "value", "where"),
    [
        ("material[1].E", 7.0, lambda data: data["material"][1]["E"]),
        ("contact.pair.friction", 0.4, lambda data: data["contact"]["pair"]["friction"]),
        ("contact.pair.formulation", "mortar", lambda data: data["contact"]["pair"]["formulation"]),
        ("mesh.arc_sizes[0]", 3.0, lambda data: data["mesh"]["arc_sizes"][0]),
    ],
)
def test_a_path_sets_one_value_and_leaves_the_case_alone(path, value, where):
    found = substituted(DATA, path, value, {})
    assert where(found) == value
    assert DATA["material"][1]["E"] == 2.0
    assert DATA["mesh"]["arc_sizes"] == [1.0, 2.0]
    assert "formulation" not in DATA["contact"]["pair"]


def test_a_name_sets_several_paths_by_their_laws():
    found = substituted(DATA, "size", 3.0, LINKED)
    assert found["mesh"]["arc_sizes"] == [4.5, 3.0]
    assert found["contact"]["pair"]["friction"] == pytest.approx(-0.3)


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("sise", "'size'"),
        ("material[2].E", r"\[2\].*case has 2"),
        ("contact.pear.friction", "'pair'"),
        ("mesh.arc_sizes", "name a single value"),
        ("contact.pair", "name a single value"),
        ("material.E", r"the number of a table before 'E', such as \[0\]"),
        ("material[0].E.x", "unknown entry"),
        ("a..b", "not a path"),
        ("material[x].E", "not a path"),
    ],
)
def test_a_wrong_path_is_told(path, words):
    with pytest.raises(CaseError, match=words):
        substituted(DATA, path, 1.0, LINKED)


@pytest.mark.parametrize("law", ["2*valve", "value+1", "__import__('os')", 3.0, "value^x"])
def test_a_law_is_a_power_of_the_value_and_nothing_else(law):
    with pytest.raises(CaseError, match=r"a\*value\^p"):
        substituted(DATA, "n", 2.0, {"n": {"contact.pair.friction": law}})


def test_a_power_of_a_negative_number_is_refused():
    with pytest.raises(CaseError, match=r"cannot be evaluated for -2\.0"):
        substituted(DATA, "n", -2.0, {"n": {"contact.pair.friction": "value^0.5"}})
