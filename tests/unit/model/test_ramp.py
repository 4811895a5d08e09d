import numpy as np
import pytest

import fastcontact as fc
from fastcontact.model.ramp import ramp_of


def test_the_default_ramp_has_equal_steps_to_one():
    ramp = fc.linear_ramp(4)
    assert ramp.instants == (0.25, 0.5, 0.75, 1.0)
    assert [ramp.value(t) for t in ramp.instants] == [0.25, 0.5, 0.75, 1.0]


def test_a_piecewise_linear_table_is_interpolated():
    ramp = fc.Ramp((0.5, 1.0, 1.5), ((0, 0), (1, 2), (2, 0)))
    assert [ramp.value(t) for t in ramp.instants] == [1.0, 2.0, 1.0]


@pytest.mark.parametrize(
    ("given", "instants", "table"),
    [
        (4, (0.25, 0.5, 0.75, 1.0), ((0.0, 0.0), (1.0, 1.0))),
        (np.int64(2), (0.5, 1.0), ((0.0, 0.0), (1.0, 1.0))),
        (np.array([0.5, 0.75]), (0.5, 0.75), ((0.0, 0.0), (1.0, 1.0))),
        ([0.5, 1.0, 1.5], (0.5, 1.0, 1.5), ((0.0, 0.0), (1.5, 1.5))),
        (np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 0.2]]), (1.0, 2.0), ((0.0, 0.0), (1.0, 1.0), (2.0, 0.2))),
        ([(0.0, 0.0), (1.0, 1.0)], (1.0,), ((0.0, 0.0), (1.0, 1.0))),
        (iter([0.5, 1.0]), (0.5, 1.0), ((0.0, 0.0), (1.0, 1.0))),
    ],
)
def test_numbers_and_arrays_are_ramps(given, instants, table):
    ramp = ramp_of(given)
    assert ramp.instants == instants
    assert ramp.table == table


def test_a_ramp_stays_itself_and_none_is_the_default():
    ramp = fc.Ramp((1.0,))
    assert ramp_of(ramp) is ramp
    assert ramp_of(None) == fc.linear_ramp(20)
    assert fc.Ramp(np.array([0.5, 1.0])) == fc.Ramp((0.5, 1.0))


@pytest.mark.parametrize("given", [[1.0, 0.5], [[0.0, 0.0, 0.0]], [["a", "b"]], np.zeros((2, 2, 2)), [np.nan]])
def test_what_is_no_ramp(given):
    with pytest.raises(fc.ModelError):
        ramp_of(given)
