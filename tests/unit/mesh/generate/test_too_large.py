"""Meshes of unreasonable size are refused before memory is allocated."""

import tracemalloc

import pytest

from fastcontact import generate
from fastcontact.errors import MeshError, ModelError
from fastcontact.model.ramp import linear_ramp

TOO_LARGE = [
    ("half-spheres", {"element": "tri3", "size": 1e-12}, r"5e\+13 segments, more than 1000000"),
    ("half-spheres", {"element": "tri3", "size": 1e-4}, r"e\+11 cells, more than 5000000"),
    ("half-spheres", {"element": "tri3", "contact_size": 1e-12}, r"segments, more than 1000000"),
    (
        "half-spheres",
        {"element": "quad4", "arc_sizes": (1e-3, 1e-3), "radial_sizes": (1e-3, 1e-3)},
        r"cells, more than",
    ),
    (
        "block-on-block",
        {"divisions_lower": (2**32, 2)},
        r"divisions\[0\] = 4294967296 is out of range: .* at most 1000000",
    ),
    ("block-on-block", {"divisions_lower": (100_000, 100_000)}, r"1e\+10 cells, more than 5000000"),
    ("box", {"divisions": (1000, 1000, 1000)}, r"1e\+09 cells"),
    ("box", {"divisions": (100, 100, 100), "element": "tet4"}, r"6e\+06 cells"),
    ("rings", {"divisions_inner": (100_000, 100_000)}, r"1e\+10 cells"),
    ("crowned-blocks", {"element": "quad4", "contact_size": 1e-9}, "segments, more than 1000000"),
    ("quarter-disc", {"element": "tri3", "R": 1e-200}, r"R = 1e-200 is out of range: it must be at least 1e-100"),
    (
        "quarter-disc",
        {"element": "tri3", "R": 1e200},
        r"R = 1e\+200 is out of range: its magnitude must be at most 1e\+100",
    ),
]


@pytest.mark.parametrize(("name", "options", "message"), TOO_LARGE)
def test_meshes_that_nobody_can_mean(name, options, message):
    tracemalloc.start()
    with pytest.raises(MeshError, match=message):
        generate.GENERATORS[name](**options)
    taken = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert taken < 1 << 29


def test_ramps_of_more_steps_than_anyone_waits_for():
    with pytest.raises(ModelError, match="4294967297 load steps are more than 1000000"):
        linear_ramp(4_294_967_297)
    assert len(linear_ramp(1000)) == 1000
