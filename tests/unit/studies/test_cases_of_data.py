"""Studies of cases built from data in Python, and unsuitable cases."""

import pytest

import fastcontact as fc
from fastcontact.cases.case import build_case, read_case
from fastcontact.errors import CaseError

DATA = {
    "kinematics": "plane_strain",
    "mesh": {"generator": "block", "size": [2.0, 1.0], "divisions": [4, 2]},
    "material": [{"E": 1000.0, "nu": 0.3}],
    "support": [{"group": "BOTTOM", "x": 0.0, "y": 0.0}],
    "obstacle": {
        "plane": {
            "secondary": "TOP",
            "shape": {"kind": "half_space", "point": [0.0, 1.0], "normal": [0.0, -1.0]},
            "motion": {"y": -0.01},
        }
    },
    "ramp": {"steps": 1},
}
DECK = """
*NODE
1, 0., 0.
2, 1., 0.
3, 1., 1.
4, 0., 1.
*ELEMENT, TYPE=CPE4, ELSET=ALL
1, 1, 2, 3, 4
*MATERIAL, NAME=M
*ELASTIC
1000., 0.3
*SOLID SECTION, ELSET=ALL, MATERIAL=M
*BOUNDARY
1, 1, 2
2, 2
*STEP
*STATIC
*CLOAD
3, 2, 1.
*END STEP
"""


def test_a_case_of_data_can_be_studied():
    case = build_case(DATA, name="mine")
    study = fc.convergence_study(case, levels=2, workers=1)
    assert [level.n_dofs for level in study.series[0].levels] == [30, 90]
    sweep = fc.parameter_sweep(case, {"material[0].E": [1000.0, 2000.0]}, workers=1)
    soft, stiff = (point.values["force"] for point in sweep.points)
    assert stiff == pytest.approx(2.0 * soft, rel=1e-6)
    assert len(repr(study.series[0].levels)) < 2000  # profiles of nodes are no part of it
    assert "profile" not in repr(sweep.points[0])
    adaptive = fc.adaptive_study(case, "force", 0.5, max_rounds=1)
    assert adaptive.rounds[0].values["force"] == pytest.approx(soft, rel=1e-6)
    assert read_again(case.text).describe() == case.model.describe()


def read_again(text):
    import tomllib

    return build_case(tomllib.loads(text), name="again").model


@pytest.mark.parametrize(
    "study",
    [
        lambda case: fc.convergence_study(case, 2),
        lambda case: fc.parameter_sweep(case, {"material[0].E": [1.0, 2.0]}),
        lambda case: fc.adaptive_study(case, "force"),
    ],
)
def test_what_is_no_case_file_is_refused(study, tmp_path):
    (tmp_path / "plate.inp").write_text(DECK)
    with pytest.raises(
        CaseError, match="'plate' is an input deck: studies change the mesh and the numbers of a case file"
    ):
        study(read_case(tmp_path / "plate.inp"))
