"""Meshes of half-spheres: geometry, groups, sizes, symmetry, and repeatability."""

import json
import math

import numpy as np
import pytest
from pairwise import first_of

import fastcontact as fc
from fastcontact.mesh import elements

pytestmark = pytest.mark.each_value

ELEMENTS = ("tri3", "tri6", "quad4", "quad8", "quad9")
R = 50.0
QUARTER = math.pi * R**2 / 4
S = R * math.sin(math.pi / 4)
PLACES = {"A1": (0, -R), "B1": (R, -R), "C1": (0, 0), "D1": (S, S - R)}
PLACES |= {"A2": (0, R), "B2": (R, R), "C2": (0, 0), "D2": (S, R - S)}
BLOCK_CORNERS = {"M": (0, R / 2), "N": (R / 2, R / 2), "P": (R / 2, R)}
BLOCK_CORNERS |= {f"{name}1": (x, -y) for name, (x, y) in BLOCK_CORNERS.items()}
LINES = {"A1A2", "A1B1", "A2B2", "CONT1", "CONT2", "D1B1", "D2B2"}


def coarse(element, k=1):
    """Both bodies, coarse, refined k times."""
    if element.startswith("tri"):
        return fc.generate.half_spheres(element, size=10.0 / k)
    return fc.generate.half_spheres(element, arc_sizes=(2.0 / k, 8.0 / k), segments=4 * k)


@pytest.mark.parametrize("element", ELEMENTS)
def test_area_converges_with_order_two_and_with_curved_sides_four(element):
    sizes, errors = [], []
    for k in (1, 2, 4):
        mesh = coarse(element, k)
        sizes.append(np.diff(fc.topology.ordered_line(mesh, "CONT1").abscissa).max())
        errors.append(abs(fc.quality(mesh).measure / (2 * QUARTER) - 1))
    order = 2 * elements.get(element).order
    assert np.polyfit(np.log(sizes), np.log(errors), 1)[0] == pytest.approx(order, abs=0.05 * order)
    assert errors[-1] < 1e-3 if order == 2 else errors[0] < 2e-5


@pytest.mark.parametrize("element", ELEMENTS)
def test_every_node_of_the_arcs_lies_on_its_circle_and_the_others_inside(element):
    mesh = coarse(element)
    for groups, centre in ((("CONT1", "D1B1"), -R), (("CONT2", "D2B2"), R)):
        nodes = np.unique(np.concatenate([mesh.points_of(group) for group in groups]))
        radius = np.hypot(mesh.points[nodes, 0], mesh.points[nodes, 1] - centre)
        assert np.abs(radius - R).max() < 1e-12 * R
        assert len(nodes) == (elements.get(element).order * sum(len(mesh.cell_groups[g]) for g in groups)) + 1
        inner = np.setdiff1d(mesh.points_of("SPHBAS" if centre < 0 else "SPHHAU"), nodes)
        assert np.hypot(mesh.points[inner, 0], mesh.points[inner, 1] - centre).max() < R * (1 - 1e-4)


@pytest.mark.parametrize("element", ELEMENTS)
def test_groups_are_complete_and_where_they_belong(element):
    mesh = coarse(element)
    assert set(mesh.cell_groups) == LINES | {"SPHBAS", "SPHHAU"}
    places = PLACES if element.startswith("tri") else PLACES | BLOCK_CORNERS
    assert set(mesh.point_groups) == set(places)
    for name, place in places.items():
        assert mesh.points[mesh.point(name)] == pytest.approx(place, abs=1e-12 * R)
    assert np.abs(mesh.points[mesh.points_of("A1A2"), 0]).max() == 0.0
    assert np.ptp(mesh.points[mesh.points_of("A1B1"), 1]) == 0.0
    assert mesh.points[mesh.points_of("CONT1"), 0].max() == pytest.approx(S)
    assert mesh.points[mesh.points_of("D1B1"), 0].min() == pytest.approx(S)
    for group, solid in (("A1B1", "SPHBAS"), ("CONT2", "SPHHAU")):
        assert np.isin(mesh.points_of(group), mesh.points_of(solid)).all()


@pytest.mark.parametrize("element", ELEMENTS)
def test_line_cells_are_the_outer_facets_each_once_with_the_solid_on_the_left(element):
    mesh = coarse(element)
    (lines,), (outer,) = mesh.facets.values(), fc.topology.outer_facets(mesh).values()
    assert sorted(map(tuple, lines.tolist())) == sorted(map(tuple, outer.tolist()))
    assert sum(len(mesh.cell_groups[group]) for group in LINES) == len(lines)


@pytest.mark.parametrize("element", ELEMENTS)
def test_bodies_touch_at_two_distinct_points_and_mirror_each_other(element):
    mesh = coarse(element)
    assert fc.topology.bodies(mesh)[0] == 2
    assert mesh.point("C1") != mesh.point("C2")
    assert mesh.points[mesh.point("C1")].tolist() == mesh.points[mesh.point("C2")].tolist() == [0.0, 0.0]
    lower, upper = mesh.points[mesh.points_of("SPHBAS")], mesh.points[mesh.points_of("SPHHAU")]
    assert np.array_equal(lower * [1, -1], upper)
    assert len(np.intersect1d(mesh.points_of("SPHBAS"), mesh.points_of("SPHHAU"))) == 0


@pytest.mark.parametrize("element", ELEMENTS)
@pytest.mark.parametrize("body", ["lower", "upper"])
def test_one_body_alone_is_half_of_both(element, body):
    both = coarse(element)
    sizes = {"size": 10.0} if element.startswith("tri") else {"arc_sizes": (2.0, 8.0), "segments": 4}
    one = fc.generate.quarter_disc(element, body=body, **sizes)
    solid = "SPHBAS" if body == "lower" else "SPHHAU"
    assert np.array_equal(one.points, both.points[both.points_of(solid)])
    assert set(one.cell_groups) | set(one.point_groups) < set(both.group_names)
    assert one.n_cells * 2 == both.n_cells


@pytest.mark.slow
def test_lengths_scale_with_the_radius():
    small = fc.generate.half_spheres("quad4", R=1.0)
    assert small.points * R == pytest.approx(fc.generate.half_spheres("quad4").points, abs=1e-10)
    assert fc.quality(fc.generate.half_spheres("tri3", R=1.0)).longest_edge == pytest.approx(1 / 25, rel=1e-9)


# Triangles


def test_default_triangles_are_as_many_and_as_short_as_those_of_the_reference_mesh(cases):
    facts = json.loads((cases / "forma04a.json").read_text())["meshes"][0]
    mesh, quality = fc.generate.half_spheres(), fc.quality(fc.generate.half_spheres())
    assert mesh.n_points == pytest.approx(facts["n_nodes"], rel=0.10)
    assert quality.n_cells["tri3"] == pytest.approx(facts["n_cells"]["triangle"], rel=0.10)
    for group in ("A1A2", "A1B1", "A2B2", "CONT1", "CONT2"):
        assert len(mesh.cell_groups[group]) == facts["cell_groups"][group]["cells"]["line"]
    assert quality.longest_edge == pytest.approx(2.0, rel=1e-9)
    assert quality.smallest_angle > 35.0
    assert quality.largest_angle < 105.0


@pytest.mark.parametrize("size", first_of(6, [50.0, 23.0, 10.0, 7.3, 4.0, 2.5, 1.25]))
def test_no_edge_is_longer_than_the_size_and_no_angle_small(size):
    mesh = fc.generate.quarter_disc(size=size)
    quality = fc.quality(mesh)
    assert quality.longest_edge <= size * (1 + 1e-9)
    assert quality.longest_edge > 0.75 * size
    assert quality.smallest_angle > (30.0 if size < R / 2 else 25.0)
    assert len(mesh.cell_groups["A1B1"]) == math.ceil(R / size)
    assert len(mesh.cell_groups["CONT1"]) == math.ceil(R * math.pi / 4 / size)
    edge, count = np.unique(np.sort(_edges(mesh), axis=1), axis=0, return_counts=True)
    assert count.max() == 2  # no cell lies over another
    assert len(mesh.points) - len(edge) + quality.n_cells["tri3"] == 1  # Euler: no hole


def _edges(mesh):
    block = mesh.cells["tri3"]
    return np.vstack([block[:, [0, 1]], block[:, [1, 2]], block[:, [2, 0]]])


@pytest.mark.parametrize(
    ("near", "far", "plateau"), [(0.5, 10.0, None), (0.1, 5.0, None), (0.01, 10.0, None), (1.0, 5.0, 10.0)]
)
def test_triangles_grow_linearly_from_the_pole(near, far, plateau):
    mesh = fc.generate.quarter_disc(size=far, contact_size=near, contact_radius=plateau)
    quality = fc.quality(mesh)
    assert quality.longest_edge <= far * (1 + 1e-9)
    assert quality.smallest_angle > 30.0
    ends = mesh.points[_edges(mesh)]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    distance = np.linalg.norm(ends.mean(axis=1), axis=1)
    start = plateau or 0.0
    wanted = near + (far - near) * np.clip((distance - start) / (R - start), 0.0, 1.0)
    assert (length <= wanted * (1 + 1e-3)).all()
    assert np.median(length / wanted) > 0.7
    first = np.diff(fc.topology.ordered_line(mesh, "CONT1", start="C1").abscissa)[0]
    assert 0.8 * near < first <= near * (1 + (far - near) / (R - start))


# Quadrangles


def test_arc_is_graded_in_geometric_progression_with_the_ratio_asked_for():
    arc = fc.topology.ordered_line(fc.generate.half_spheres("quad4", arc_sizes=(0.2, 2.0)), "CONT1", start="C1")
    angles = 2 * np.arcsin(np.diff(arc.abscissa) / (2 * R)) * R  # lengths of arc
    assert angles.sum() == pytest.approx(R * math.pi / 4, rel=1e-12)
    assert angles[-1] / angles[0] == pytest.approx(10.0, rel=1e-9)
    assert np.ptp(angles[1:] / angles[:-1]) < 1e-9
    assert 0.2 * 0.98 < angles[0] <= 0.2
    assert 2.0 * 0.98 < angles[-1] <= 2.0


def test_arc_distribution_is_carried_to_the_opposite_sides_of_the_three_blocks():
    mesh = fc.generate.quarter_disc("quad4", arc_sizes=(0.5, 4.0), segments=6)
    arc = fc.topology.ordered_line(mesh, "CONT1", start="C1").points
    theta = np.arctan2(mesh.points[arc, 0], mesh.points[arc, 1] + R) / (math.pi / 4)
    flat = np.sort(mesh.points[mesh.points_of("A1B1"), 0]) / (R / 2)
    assert flat[: len(arc)] == pytest.approx(theta, abs=1e-12)
    middle = mesh.points[(mesh.points[:, 1] == -R / 2) & (mesh.points[:, 0] <= R / 2), 0]
    assert np.sort(middle) / (R / 2) == pytest.approx(theta, abs=1e-12)
    n = len(mesh.cell_groups["CONT1"])
    assert mesh.cells["quad4"].shape[0] == 6 * n + 6 * n + 6 * 6
    assert len(mesh.cell_groups["A1A2"]) == 12
    assert len(mesh.cell_groups["A1B1"]) == n + 6
    assert len(mesh.cell_groups["D1B1"]) == 6
    assert mesh.n_points == 7 * (n + 1) + 6 * (n + 1) + 6 * 6


def test_radial_lines_are_graded_towards_the_contact():
    mesh = fc.generate.quarter_disc("quad4", arc_sizes=(0.5, 4.0), segments=6, radial_sizes=(0.1, 5.0))
    axis = fc.topology.ordered_line(mesh, "A1A2", start="C1")
    steps = np.diff(axis.abscissa)
    n = len(steps) - 6
    assert 0.09 < steps[0] <= 0.1
    assert steps[n - 1] == pytest.approx(50.0 * steps[0])
    assert steps[:n].sum() == pytest.approx(R / 2)
    assert steps[n:] == pytest.approx(np.full(6, R / 12))
    # The same fractions on the lines P-B and M-C.
    flat = np.sort(mesh.points[mesh.points_of("A1B1"), 0])
    assert (R - flat[::-1])[: n + 1] == pytest.approx(axis.abscissa[: n + 1], abs=1e-9)


@pytest.mark.parametrize("element", ["quad4", "quad8", "quad9"])
def test_default_quadrangles_have_positive_jacobians_and_reasonable_angles(element):
    quality = fc.quality(fc.generate.half_spheres(element))
    assert quality.n_bad == 0
    assert quality.smallest_angle > 45.0
    assert quality.largest_angle <= 135.0 + 1e-9


# Arguments
