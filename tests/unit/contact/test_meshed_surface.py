"""Rigid shapes and surfaces of facets: distances, normals and signs compared with exact ones, refusals."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused
from scipy.spatial.transform import Rotation

import fastcontact as fc
from fastcontact.contact.obstacles import MeshedSurface
from fastcontact.mesh import elements
from fastcontact.mesh.flat_pieces import flat_triangles
from fastcontact.mesh.generate import block, box, quarter_disc, sphere_octant
from fastcontact.model.body_overlap import winding_numbers

SOLIDS_3D = ("hex8", "hex20", "hex27", "tet4", "tet10", "wedge6", "wedge15", "pyramid5")


def shell(mesh):
    """The outer facets of a mesh alone, as group SHELL, normals out of the solid."""
    facets = fc.topology.outer_facets(mesh)
    count = sum(map(len, facets.values()))
    return fc.Mesh(mesh.points, facets, cell_groups={"SHELL": np.arange(count)})


def box_distance(points):
    """Signed distance from the box (0, 1)^dim."""
    beyond = np.abs(points - 0.5) - 0.5
    return np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0)


@pytest.mark.parametrize("element", [*SOLIDS_3D, "tri3", "quad4", "tri6", "quad8"])
def test_distances_from_a_box_are_exact(element):
    dim = elements.get(element).dim
    mesh = box((1.0, 1.0, 1.0), (2, 3, 2), element) if dim == 3 else block((1.0, 1.0), (3, 2), element)
    points = np.random.default_rng(1).uniform(-0.6, 1.6, (500, dim))
    turn = Rotation.random(random_state=2).as_matrix() if dim == 3 else np.eye(2)
    surface = MeshedSurface(shell(mesh.replace(points=mesh.points @ turn.T)), "SHELL")
    distance, normal = surface.distance(points @ turn.T)
    assert np.abs(distance - box_distance(points)).max() < 1e-14
    assert np.abs(np.linalg.norm(normal, axis=1) - 1).max() < 1e-14
    # The normal is the gradient of the distance, but for points with several closest places.
    h = 1e-6
    slope = np.stack([(box_distance(points + h * e) - box_distance(points - h * e)) / (2 * h) for e in np.eye(dim)], 1)
    single = np.abs(np.linalg.norm(slope, axis=1) - 1) < 1e-6
    assert single.mean() > 0.95
    assert np.abs(normal @ turn - slope)[single].max() < 1e-5


@settings(max_examples=25, deadline=None)
@given(angle=st.sampled_from([6.0, 25.0, 200.0, 340.0]), seed=st.integers(0, 1000))
def test_at_sharp_edges_and_tips_the_sign_is_that_of_the_winding_number(angle, seed):
    mesh = box((1.0, 1.0, 1.0), (3, 2, 2), "hex8")
    r, t, z = 0.2 + mesh.points[:, 0], (mesh.points[:, 1] - 0.5) * np.radians(angle), mesh.points[:, 2]
    mesh = shell(mesh.replace(points=np.column_stack([r * np.cos(t), r * np.sin(t), z * (1 + 0.3 * r)])))
    # Flat facets, so that triangles and surface are the same.
    triangles = mesh.cells["quad4"][:, flat_triangles(4)].reshape(-1, 3)
    flat = fc.Mesh(mesh.points, {"tri3": triangles}, cell_groups={"SHELL": np.arange(len(triangles))})
    points = np.random.default_rng(seed).uniform([-1.3, -1.3, -0.1], [1.3, 1.3, 1.3], (300, 3))
    distance, _ = MeshedSurface(flat, "SHELL").distance(points)
    assert np.array_equal(distance < 0, winding_numbers(points, mesh.points[triangles]) > 0.5)


@pytest.mark.parametrize("angle", [4.0, 60.0, 170.0, 300.0, 350.0])
def test_at_sharp_corners_in_two_dimensions_the_sign_is_right(angle):
    """A pie of the given angle, against the polar angle and the radius of its points."""
    half, n = np.radians(angle) / 2, 60
    t = np.linspace(-half, half, n)
    corners = np.vstack([[[0.0, 0.0]], np.column_stack([np.cos(t), np.sin(t)])])
    lines = np.column_stack([np.arange(n + 1), np.roll(np.arange(n + 1), -1)])
    pie = MeshedSurface(fc.Mesh(corners, {"line2": lines}, cell_groups={"PIE": np.arange(n + 1)}), "PIE")
    points = np.random.default_rng(3).uniform(-1.2, 1.2, (2000, 2))
    radius, polar = np.linalg.norm(points, axis=1), np.abs(np.arctan2(points[:, 1], points[:, 0]))
    clear = np.abs(radius - 1) > 0.01  # the arc is a polygon
    assert np.array_equal((pie.distance(points)[0] < 0)[clear], ((radius < 1) & (polar < half))[clear])


@pytest.mark.parametrize("element", ["line2", "line3"])
def test_a_circle_of_lines_is_as_exact_as_its_lines(element):
    order = elements.get(element).order
    errors = []
    for n in (16, 32, 64):
        t = np.linspace(0, 2 * np.pi, n * order, endpoint=False)
        k = np.arange(n) * order
        ends = [k, (k + order) % (n * order)] + ([k + 1] if order == 2 else [])
        mesh = fc.Mesh(2.0 * np.column_stack([np.cos(t), np.sin(t)]), {element: np.column_stack(ends)},
                    cell_groups={"CIRCLE": np.arange(n)})  # fmt: skip
        points = np.random.default_rng(4).uniform(-3, 3, (400, 2))
        points = points[np.linalg.norm(points, axis=1) > 0.5]
        distance, normal = MeshedSurface(mesh, "CIRCLE").distance(points)
        radius = np.linalg.norm(points, axis=1)
        errors.append(np.abs(distance - (radius - 2.0)).max())
        near = np.abs(radius - 2.0) < 0.05
        assert near.sum() > 5
        assert np.abs(normal - points / radius[:, None])[near].max() < 0.2 / n  # smooth where facets meet
    expected = 2 if order == 1 else 4
    assert np.log2(errors[0] / errors[1]) > expected - 0.3
    assert np.log2(errors[1] / errors[2]) > expected - 0.3


@pytest.mark.parametrize(("element", "tolerance"), [("hex20", 5e-3), ("tet10", 5e-3), ("hex8", 8e-2), ("tet4", 8e-2)])
def test_an_octant_of_a_ball(element, tolerance):
    mesh = sphere_octant(element, R=2.0, size=0.8, contact_size=0.4, contact_radius=0.4)
    mesh = mesh.merged_groups("BALL", ("CONT_SPHERE", "SPHERE_SIDE"))
    way = np.random.default_rng(5).uniform(0.05, 1.0, (300, 3)) * [1, -1, 1]
    way /= np.linalg.norm(way, axis=1)[:, None]
    radius = np.random.default_rng(6).uniform(1.5, 2.5, 300)
    distance, normal = MeshedSurface(mesh, "BALL").distance([0, 2, 0] + radius[:, None] * way)
    assert np.isfinite(distance).all()
    assert np.abs(distance - (radius - 2.0)).max() < tolerance
    assert (np.einsum("nd,nd->n", normal, way) > 0.98).all()
    flipped, other = MeshedSurface(mesh, "BALL", flip=True).distance([0, 2, 0] + radius[:, None] * way)
    np.testing.assert_allclose(flipped, -distance, rtol=0, atol=1e-12)
    np.testing.assert_allclose(other, -normal, rtol=0, atol=1e-6)


def test_facets_of_solids_look_out_of_them_however_they_run():
    mesh = quarter_disc("quad8", arc_sizes=(2.0, 8.0), radial_sizes=(2.0, 10.0))
    for flip in (False, True):
        arc = mesh.cells_of("CONT1")["line3"]
        numbers = mesh.cell_groups["CONT1"]
        cells = dict(mesh.cells)
        if flip:
            lines = cells["line3"].copy()
            lines[numbers - mesh.offsets["line3"]] = arc[:, [1, 0, 2]]
            cells["line3"] = lines
        surface = MeshedSurface(mesh.replace(cells=cells), "CONT1")
        centre = mesh.points[mesh.points_of("CONT1")].mean(axis=0)
        assert surface.distance(centre[None])[0][0] < 0


def test_beyond_the_border_of_an_open_surface_there_is_nothing():
    floor = fc.Mesh([[-1.0, 0.0], [0.0, 0.0], [1.0, 0.0]], {"line2": [[2, 1], [1, 0]]}, cell_groups={"F": [0, 1]})
    distance, normal = MeshedSurface(floor, "F").distance(np.array([[0.9, -0.1], [1.2, -0.1], [0.0, 0.3], [1.2, 3.0]]))
    assert distance[:3].tolist() == [-0.1, np.inf, 0.3]
    assert np.isfinite(distance[3])  # seen from afar, the end of the floor is as good as its inside
    assert normal[:3].tolist() == [[0.0, 1.0]] * 3


def test_a_crease_keeps_an_edge_sharp():
    roof = fc.Mesh([[-1.0, -0.2], [0.0, 0.0], [1.0, -0.2]], {"line2": [[2, 1], [1, 0]]}, cell_groups={"R": [0, 1]})
    own = np.array([0.2, 1.0]) / np.hypot(0.2, 1.0)
    at = np.array([[0.05, -0.01]]) + 1e-3 * own  # above the right side, near the ridge
    smooth = MeshedSurface(roof, "R", crease=30.0).distance(at)[1][0]
    sharp = MeshedSurface(roof, "R", crease=10.0).distance(at)[1][0]
    facets = MeshedSurface(roof, "R", crease=0.0).distance(at)[1][0]
    assert sharp == pytest.approx(own, abs=1e-14)
    assert facets == pytest.approx(own, abs=1e-14)
    assert 0 < smooth[0] < 0.02
    ridge = MeshedSurface(roof, "R", crease=10.0).distance(np.array([[0.02, 0.5]]))
    assert ridge[0][0] == pytest.approx(np.hypot(0.02, 0.5))
    assert ridge[1][0] == pytest.approx(np.array([0.02, 0.5]) / np.hypot(0.02, 0.5))


def strip(turned=()):
    lines = [[k, k + 1] if k in turned else [k + 1, k] for k in range(6)]
    points = np.column_stack([np.arange(7.0), np.zeros(7)])
    return fc.Mesh(points, {"line2": lines}, cell_groups={"STRIP": np.arange(6)})


def test_an_inconsistent_orientation_names_the_facet_to_turn():
    with pytest.raises(fc.ContactError, match=r"facet 4 \(line2 near \(4.5, 0\)\) .*'STRIP' has the opposite"):
        MeshedSurface(strip(turned=(4,)), "STRIP")
    plate = shell(box((1.0, 1.0, 1.0), (2, 2, 2), "tet4"))
    cells = plate.cells["tri3"].copy()
    cells[7] = cells[7][[0, 2, 1]]
    with pytest.raises(fc.ContactError, match=r"facet 7 \(tri3 near .* has the opposite orientation .*reverse it"):
        MeshedSurface(plate.replace(cells={"tri3": cells}), "SHELL")


def test_what_is_no_surface_is_refused():
    points = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [1.0, 1.0]]
    branch = fc.Mesh(points, {"line2": [[1, 0], [2, 1], [3, 1]]}, cell_groups={"B": [0, 1, 2]})
    refused(fc.ContactError, r"'B' shares an edge with more than one other facet", MeshedSurface, branch, "B")
    with pytest.raises(fc.ContactError, match=r"facet 0 .* has no area"):
        MeshedSurface(fc.Mesh([[0.0, 0.0], [0.0, 0.0]], {"line2": [[0, 1]]}, cell_groups={"N": [0]}), "N")
    with pytest.raises(fc.ContactError, match="contains no facets"):
        MeshedSurface(block((1.0, 1.0), (1, 1), "quad4", name="B").with_groups(cells={"E": []}), "E")
    refused(fc.MeshError, "did you mean 'STRIP'", MeshedSurface, strip(), "STRIPE")
    refused(fc.ContactError, "crease", MeshedSurface, strip(), "STRIP", crease=-1.0)
    with pytest.raises(fc.ContactError, match="has 2 dimensions, but the model 3"):
        MeshedSurface(strip(), "STRIP").distance(np.zeros((1, 3)))


def test_a_surface_of_the_model_itself_stands_apart():
    body = block((1.0, 1.0), (2, 2), "quad4")
    model = fc.Model(body, "plane_strain")
    with pytest.raises(fc.ContactError, match=r"of the rigid surface .TOP. belong to solid cells .*number: 3"):
        model.add_obstacle("o", secondary="BOTTOM", obstacle=MeshedSurface(body, "TOP"))


SHAPES_2D = {
    "half_space": fc.obstacles.HalfSpace((0.3, -0.2), (1.0, 2.0)),
    "sphere": fc.obstacles.Sphere((0.1, 2.0), 1.5),
    "hollow": fc.obstacles.Sphere((0.1, 0.2), 5.0, hollow=True),
    "paraboloid": fc.obstacles.paraboloid(3.0),
    "paraboloid_below": fc.obstacles.paraboloid(3.0, tip=-0.5, side="below"),
    "cone": fc.obstacles.cone(0.3),
}
SHAPES_3D = {
    "half_space": fc.obstacles.HalfSpace((0.3, -0.2, 0.1), (1.0, 2.0, -1.0)),
    "sphere": fc.obstacles.Sphere((0.1, 2.0, 0.4), 1.5),
    "cylinder": fc.obstacles.Cylinder((0.0, 0.0, 2.0), (1.0, 0.5, 0.0), 1.2),
    "paraboloid": fc.obstacles.paraboloid(3.0),
    "cone": fc.obstacles.cone(0.3),
}
CASES = [(2, name, shape) for name, shape in SHAPES_2D.items()] + [(3, n, s) for n, s in SHAPES_3D.items()]


def points(dim):
    return np.random.default_rng(dim).uniform(-1, 1, (40, dim))


@pytest.mark.parametrize(("dim", "name", "shape"), CASES, ids=lambda v: v if isinstance(v, str) else None)
def test_distances_vanish_on_the_surface_and_grow_along_the_normals(dim, name, shape):
    x = points(dim)
    distance, normal = shape.distance(x)
    assert np.abs(np.linalg.norm(normal, axis=1) - 1).max() < 1e-14
    assert (shape.distance(x + 1e-6 * normal)[0] > distance).all()
    for _ in range(60):
        distance, normal = shape.distance(x)
        x = x - distance[:, None] * normal
    assert np.abs(shape.distance(x)[0]).max() < 1e-10
    x = x[np.linalg.norm(x[:, :-1], axis=1) > 1e-3]  # not at the tip of a cone
    slope = [(shape.distance(x + h)[0] - shape.distance(x - h)[0]) / 2e-6 for h in 1e-6 * np.eye(dim)]
    assert np.abs(np.array(slope).T - shape.distance(x)[1]).max() < 1e-5


def test_a_flat_punch_ends_at_its_edge():
    distance, normal = fc.obstacles.FlatPunch(1.0, height=0.5).distance(np.array([[0.9, 0.2], [1.1, 0.2], [0.0, 0.7]]))
    assert distance.tolist() == pytest.approx([0.3, np.inf, -0.2])
    assert normal[:, 1].tolist() == [-1.0, -1.0, -1.0]


def test_at_the_tip_of_a_cone_the_normal_is_the_axis_up_to_round_off():
    points = np.array([[1e-19, 0.0], [-1e-19, 0.0], [1.0, 0.0]])
    normals = fc.obstacles.cone(0.3).distance(points)[1]
    np.testing.assert_allclose(np.abs(normals[:2]), [[0.0, 1.0]] * 2, atol=1e-15)
    assert abs(normals[2, 0]) > 0.2
