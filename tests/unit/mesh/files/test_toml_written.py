"""Round trip of data through TOML; data that TOML cannot hold are refused."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastcontact._tools.toml_text import dump, parse

simple = st.booleans() | st.integers(-(2**53), 2**53) | st.floats(allow_nan=False) | st.text(max_size=20)
values = st.recursive(simple, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3))


@given(st.dictionaries(st.text(), values, max_size=4))
def test_what_is_written_is_read_back(data):
    assert parse(dump(data)) == data


def test_numpy_s_numbers_and_arrays_are_plain_ones():
    data = {"E": np.float64(0.1), "steps": np.int64(3), "on": np.bool_(True), "axes": np.eye(2), "size": (1.0, 2)}
    assert parse(dump(data)) == {"E": 0.1, "steps": 3, "on": True, "axes": [[1.0, 0.0], [0.0, 1.0]], "size": [1.0, 2]}
    assert math.isnan(parse(dump({"value": np.nan}))["value"])


@pytest.mark.parametrize("data", [{"value": None}, {"value": lambda x: x}, {1: 2}, {"value": {1: 2}}, {"value": 1j}])
def test_what_toml_has_not_is_told(data):
    with pytest.raises(ValueError, match=r"not a TOML type|not a string"):
        dump(data)
