"""Spacing of nodes on a line, triangulation of outlines, and refusals of meshes of unreasonable size."""

import tracemalloc

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused

import fastcontact as fc
from fastcontact.mesh.generate._spacing import Spacing, divide, progression
from fastcontact.mesh.generate._triangulate import delaunay, stars_of, triangulated_body
from fastcontact.mesh.generate.quadratic import ends_of, unique_edges

size = st.floats(0.01, 1.0)


@given(length=st.floats(1.0, 50.0), first=size, last=size)
@settings(max_examples=200, deadline=None)
def test_a_geometric_line_keeps_the_ratio_and_the_limits_with_the_fewest_segments(length, first, last):
    steps = length * np.diff(progression(length, first, last))
    assert steps.sum() == pytest.approx(length)
    assert (steps > 0).all()
    n = len(steps)
    if n > 1 and first != last:
        assert steps[-1] / steps[0] == pytest.approx(last / first, rel=1e-6)
        assert np.ptp(steps[1:] / steps[:-1]) < 1e-6
    assert steps[0] <= first * (1 + 1e-6)
    assert steps[-1] <= last * (1 + 1e-6)
    if n > 2:
        fewer = np.geomspace(first, last, n - 1).sum() if first != last else (n - 1) * first
        assert fewer < length * (1 + 1e-6)


@given(near=st.floats(0.01, 0.5), far=st.floats(0.5, 3.0), plateau=st.floats(0.0, 3.0))
@settings(max_examples=50, deadline=None)
def test_segments_follow_the_size_function(near, far, plateau):
    spacing = Spacing(near, far, plateau=plateau, reach=10.0)
    nodes = divide(lambda s: np.column_stack([10.0 * s, 0.0 * s]), 10.0, spacing)
    steps = np.diff(nodes[:, 0])
    middles = 0.5 * (nodes[:-1] + nodes[1:])
    assert nodes[0].tolist() == [0.0, 0.0]
    assert nodes[-1].tolist() == [10.0, 0.0]
    ratio = steps / spacing(middles)
    assert ratio.max() < 1.05  # but for the kinks of the size function, 1
    assert steps.max() <= far * (1 + 1e-9)
    assert ratio.min() > 0.6 or len(steps) < 4


def test_the_size_function_is_flat_then_linear_then_flat():
    spacing = Spacing(1.0, 3.0, plateau=2.0, reach=6.0)
    points = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 4.0], [6.0, 0.0], [99.0, 0.0]])
    assert spacing(points).tolist() == [1.0, 1.0, 2.0, 3.0, 3.0]


def polygon(corners, spacing):
    sides = []
    for k, (start, end) in enumerate(zip(corners, corners[1:] + corners[:1], strict=True)):
        a, b = np.array(start, float), np.array(end, float)
        line = divide(lambda s, a=a, b=b: a + s[:, None] * (b - a), float(np.linalg.norm(b - a)), spacing)
        sides.append((f"SIDE{k}", line))
    return triangulated_body("BODY", sides, spacing)


@pytest.mark.each_value
@pytest.mark.parametrize(
    "corners",
    [
        [(0, 0), (4, 0), (4, 1), (0, 1)],
        [(0, 0), (3, 0), (0, 3)],
        [(0, 0), (2, -1), (4, 0), (4, 3), (0, 3)],
        [(0, 0), (10, 0), (10, 0.5), (0, 0.5)],
    ],
)
@pytest.mark.parametrize("far", [0.5, 0.23])
def test_other_convex_outlines_are_filled_too(corners, far):
    mesh = polygon(corners, Spacing(far, far))
    x, y = np.array(corners, float).T
    area = 0.5 * abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))
    quality = fc.quality(mesh)
    assert quality.measure == pytest.approx(area)
    assert quality.longest_edge <= far * (1 + 1e-9)
    assert quality.smallest_angle > 29.0
    assert quality.n_bad == 0


def test_triangles_cover_the_hull_and_stars_close_around_inner_points():
    points = np.array([[0.0, 0], [2, 0], [2, 2], [0, 2], [1, 0], [1.0, 0.9]])
    triangles = delaunay(points)
    u, v = points[triangles[:, 1]] - points[triangles[:, 0]], points[triangles[:, 2]] - points[triangles[:, 0]]
    assert 0.5 * (u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]).sum() == pytest.approx(4.0)
    edges = ends_of(unique_edges({"tri3": triangles}))
    assert len(points) - len(edges) + len(triangles) == 1
    star = stars_of(triangles, len(points))[5]
    ring = star[star[:, 0] >= 0]
    assert sorted(ring[:, 0]) == sorted(ring[:, 1]) == [0, 1, 2, 3, 4]


def test_a_segment_as_long_as_the_line_to_rounding_makes_two():
    assert len(progression(1.0, 0.9999999999999999, 0.36741607936191695)) == 3


TOO_LARGE = [
    ("half-spheres", {"element": "tri3", "size": 1e-12}, r"5e\+13 segments, more than 1000000"),
    ("half-spheres", {"element": "tri3", "size": 1e-4}, r"e\+11 cells, more than 5000000"),
    ("half-spheres", {"element": "tri3", "contact_size": 1e-12}, r"segments, more than 1000000"),
    ("half-spheres", {"element": "quad4", "arc_sizes": (1e-3, 1e-3), "radial_sizes": (1e-3, 1e-3)}, r"cells, more"),
    ("block-on-block", {"divisions_lower": (2**32, 2)}, r"divisions\[0\] = 4294967296 is out .* at most 1000000"),
    ("block-on-block", {"divisions_lower": (100_000, 100_000)}, r"1e\+10 cells, more than 5000000"),
    ("box", {"divisions": (1000, 1000, 1000)}, r"1e\+09 cells"),
    ("box", {"divisions": (100, 100, 100), "element": "tet4"}, r"6e\+06 cells"),
    ("rings", {"divisions_inner": (100_000, 100_000)}, r"1e\+10 cells"),
    ("crowned-blocks", {"element": "quad4", "contact_size": 1e-9}, "segments, more than 1000000"),
    ("quarter-disc", {"element": "tri3", "R": 1e-200}, r"R = 1e-200 is out of range: it must be at least 1e-100"),
    ("quarter-disc", {"element": "tri3", "R": 1e200}, r"R = 1e\+200 is out of range: .* must be at most 1e\+100"),
]


@pytest.mark.parametrize(("name", "options", "message"), TOO_LARGE)
def test_meshes_that_nobody_can_mean(name, options, message):
    tracemalloc.start()
    refused(fc.MeshError, message, fc.generate.GENERATORS[name], **options)
    taken = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert taken < 1 << 29


def test_ramps_of_more_steps_than_anyone_waits_for():
    refused(fc.ModelError, "4294967297 load steps are more than 1000000", fc.linear_ramp, 4_294_967_297)
    assert len(fc.linear_ramp(1000)) == 1000
