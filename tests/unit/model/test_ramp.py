import pytest

import fastcontact as fc


def test_the_default_ramp_has_equal_steps_to_one():
    ramp = fc.linear_ramp(4)
    assert ramp.instants == (0.25, 0.5, 0.75, 1.0)
    assert [ramp.value(t) for t in ramp.instants] == [0.25, 0.5, 0.75, 1.0]


def test_a_piecewise_linear_table_is_interpolated():
    ramp = fc.Ramp((0.5, 1.0, 1.5), ((0, 0), (1, 2), (2, 0)))
    assert [ramp.value(t) for t in ramp.instants] == [1.0, 2.0, 1.0]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (((),), "no instants"),
        (((0.5, 0.4),), "must ascend"),
        (((0.5, 1.5),), "lies outside"),
        (((0.5,), ((0, 0),)), "at least two points"),
        (((0.5,), ((0, 0), (0, 1))), "ascending"),
    ],
)
def test_wrong_ramps(arguments, message):
    with pytest.raises(fc.ModelError, match=message):
        fc.Ramp(*arguments)


@pytest.mark.parametrize(("steps", "end"), [(0, 1.0), (2.5, 1.0), (3, 0.0)])
def test_wrong_linear_ramps(steps, end):
    with pytest.raises(fc.ModelError):
        fc.linear_ramp(steps, end)
