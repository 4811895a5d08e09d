"""A sweep tells if no parameter changes the theory with which its values are compared."""

import pytest

import fastcontact as fc


@pytest.mark.parametrize(
    ("case", "values", "same"),
    [
        ("flat-punch", {"obstacle.punch.motion.y": [-0.001, -0.002]}, True),
        ("flat-punch", {"theory.punch.approach": [0.001, 0.002]}, False),
        ("forma04c", {"approach": [0.4, 4.0]}, False),
    ],
)
def test_a_remark_tells_of_a_theory_that_stays(case, values, same):
    sweep = fc.parameter_sweep(case, values, level=0, workers=1)
    assert any("theory is the same for all points" in text for text in sweep.remarks()) is same
