"""Pictures of solids and contacts: contents and positions, checked by artists and by pixels."""

import numpy as np
import pytest
from matplotlib_pictures import contact_of, polygons_of, step_of
from models import elastic_model, with_obstacle
from pairwise import first_of

import fastcontact as fc
from fastcontact.cli import main
from fastcontact.mesh.generate import block, box, union
from fastcontact.results.plot.curves import stresses_on_axis

pytest.importorskip("matplotlib", reason="pictures need matplotlib")


@pytest.fixture
def polygons(monkeypatch):
    return polygons_of(monkeypatch)


@pytest.mark.parametrize("element", first_of(2, ["hex8", "hex20", "tet4", "tet10", "wedge6", "pyramid5"]))
def test_the_three_sides_of_a_box_that_face_the_eye_are_drawn(element, polygons):
    mesh = box((1.0, 2.0, 3.0), (2, 2, 2), element)
    ax = fc.plot.deformed_shape(mesh, step_of(mesh, mesh.points[:, 2]), edges=False)
    assert ax.name == "3d"
    points = np.concatenate(polygons)
    # The eye stands at x > 0, y < 0, z > 0: the sides there, and no others.
    on = [np.isclose(points[:, 0], 1.0), np.isclose(points[:, 1], 0.0), np.isclose(points[:, 2], 3.0)]
    assert np.any(on, axis=0).all()
    area = sum(np.linalg.norm(np.cross(b - a, c - a)) / 2 for a, b, c in polygons)
    assert area == pytest.approx(1 * 2 + 1 * 3 + 2 * 3)
    assert ax.get_xlim() == pytest.approx((0.0, 1.0), abs=0.1)
    assert ax.get_zlim() == pytest.approx((0.0, 3.0), abs=0.2)
    assert ax.get_zlabel() == "z"


def test_the_deformation_is_drawn_and_the_maximum_is_marked():
    mesh = box((1.0, 1.0, 1.0), (2, 2, 2), "hex8")
    values = np.linalg.norm(mesh.points, axis=1)
    ax = fc.plot.deformed_shape(mesh, step_of(mesh, values, 0.1 * mesh.points), scale=5.0)
    (mark,) = ax.lines
    assert [float(v[0]) for v in mark.get_data_3d()] == pytest.approx([1.5, 1.5, 1.5])
    assert mark.get_label() == "maximum 1.7321 at (1.5, 1.5, 1.5)\nundeformed at (1, 1, 1)"
    assert ax.get_xlim()[1] == pytest.approx(1.5, rel=0.05)


def test_colours_follow_the_stress_and_edges_are_seen():
    """A box whose stress is high below: its picture is yellow below and dark above."""
    mesh = union(box((1.0, 1.0, 0.5), (3, 3, 2), "hex8"), box((1.0, 1.0, 0.5), (3, 3, 2), "tet10", (0, 0, 0.5)))
    step = step_of(mesh, np.where(mesh.points[:, 2] < 0.4, 100.0, 0.0))

    def pixels(edges):
        ax = fc.plot.deformed_shape(mesh, step, edges=edges)
        ax.set_axis_off()
        ax.figure.axes[1].remove()  # the colour bar
        ax.figure.canvas.draw()
        return np.asarray(ax.figure.canvas.buffer_rgba())[..., :3].astype(int)

    plain, lined = pixels(False), pixels(True)
    yellow, dark = [np.abs(plain - colour).sum(axis=2) < 60 for colour in ([253, 231, 36], [68, 1, 84])]
    rows = np.arange(len(plain))[:, None]
    assert yellow.mean() > 0.03
    assert dark.mean() > 0.05
    assert (rows * yellow).sum() / yellow.sum() > (rows * dark).sum() / dark.sum() + 50  # rows count from the top
    assert (np.abs(plain - lined).sum(axis=2) > 30).mean() > 0.005


def test_a_plane_mesh_is_still_drawn_in_the_plane():
    mesh = block((1.0, 1.0), (3, 3), "quad8")
    ax = fc.plot.deformed_shape(mesh, step_of(mesh, mesh.points[:, 0]))
    assert ax.name == "rectilinear"
    assert ax.get_legend().get_texts()[0].get_text().startswith("maximum 1 at (1, ")


def test_a_pressure_profile_in_space_is_over_the_distance_from_the_middle():
    model = elastic_model(box((1.0, 1.0, 0.5), (5, 5, 2), "hex8", (-0.5, -0.5, -0.5)), "3d", ZMIN="xyz")
    ball = fc.obstacles.Sphere((0.0, 0.0, 2.0), 2.0)
    model.add_obstacle("ball", secondary="ZMAX", obstacle=ball, motion={"z": -0.02})
    contact = fc.solve(model, fc.linear_ramp(1))[-1].contact["ball"]
    ax = fc.plot.pressure_profile(contact, stress=-contact.pressure)
    distance = ax.lines[0].get_xdata()
    assert np.isin(distance, contact.place).all()
    assert distance.max() > 0.1
    assert [text.get_text() for text in ax.get_legend().get_texts()][1] == r"$-n \cdot \sigma \cdot n$ at the nodes"


def test_the_stress_along_normals_in_space_is_that_of_the_tensor():
    """A pressure on each node's own plane, and a shear that its normal does not see."""
    random = np.random.default_rng(5)
    normal = random.normal(size=(6, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    along = np.cross(normal, random.normal(size=(6, 3)))
    tensor = -np.arange(6.0)[:, None, None] * np.einsum("ni,nj->nij", normal, normal)
    tensor += np.einsum("ni,nj->nij", normal, along) + np.einsum("ni,nj->nij", along, normal)
    stress = np.zeros((9, 6))
    points = np.array([8, 1, 3, 5, 7, 0])
    stress[points] = tensor[:, [0, 1, 2, 0, 1, 0], [0, 1, 2, 1, 2, 2]]
    contact, moved = contact_of(points, np.zeros((6, 3)), normal=normal), np.zeros((9, 3))
    step = fc.StepResult(1, 1.0, moved, stress, np.zeros(9), np.zeros(9), moved)
    np.testing.assert_allclose(fc.normal_stress(contact, step), -np.arange(6.0), atol=1e-14)


@pytest.mark.parametrize(("iterations", "reach"), [({"parameter": "frequency"}, 1.1), ({}, 51.0)], ids=["mode", "load"])
def test_a_mode_shape_is_drawn_at_a_tenth_of_the_size_of_the_mesh(iterations, reach):
    mesh = block((1.0, 0.5), (4, 2))
    step = step_of(mesh, mesh.points[:, 0], 50.0 * mesh.points)
    step.iterations.update(iterations)
    ax = fc.plot.deformed_shape(mesh, step)
    assert max(path.vertices[:, 0].max() for path in ax.collections[0].get_paths()) == pytest.approx(reach, rel=1e-6)


@pytest.fixture(scope="module")
def result(root, tmp_path_factory):
    path = tmp_path_factory.mktemp("plots") / "c.vtkhdf"
    assert main(["run", str(root / "data/cases/forma04c.toml"), "-o", str(path), "-q"]) == 0
    return path


def test_stresses_on_the_axis_are_those_of_the_nodes_there(result):
    with fc.open_results(result) as results:
        depth, side, stress = stresses_on_axis(results.mesh, results[-1], "hertz")
        assert (depth >= 0).all()
        assert set(side) == {-1, 1}
        assert (depth[side == 1] == 0).sum() == (depth[side == -1] == 0).sum() == 1
        for name, where in (("C1", -1), ("C2", 1)):
            at = np.flatnonzero((side == where) & (depth == 0))[0]
            np.testing.assert_array_equal(stress[at], results[-1].stress[results.mesh.point(name)])
        hertz = fc.analytic.hertz_point(E1=2e4, nu1=0.3, R1=50.0, E2=2e4, nu2=0.3, R2=50.0, approach=4.0)
        drawn = fc.plot.axis_stress(results.mesh, results[-1], "hertz", {"theory": hertz})
        curve = next(line for line in drawn.lines if line.get_label() == "along the axis, lower body")
        below = (side == -1) & (depth <= 4 * results[-1].contact["hertz"].radius[0])
        np.testing.assert_array_equal(curve.get_ydata(), stress[below, 1])
        assert [line.get_label() for line in drawn.lines if line.get_color() == "k"] == ["theory"]
        unlike = fc.analytic.hertz_point(E1=2e4, nu1=0.3, R1=50.0, E2=2e4, nu2=0.45, R2=50.0, approach=4.0)
        drawn = fc.plot.axis_stress(results.mesh, results[-1], "hertz", {"theory": unlike})
        labels = [line.get_label() for line in drawn.lines if line.get_color() == "k"]
        assert labels == ["theory, nu = 0.3", "theory, nu = 0.45"]
        curves = [line.get_ydata() for line in drawn.lines if len(line.get_xdata()) == 400]
        depths = np.linspace(0.0, 4 * results[-1].contact["hertz"].radius[0], 400)
        np.testing.assert_allclose(curves[5], unlike.von_mises(0.0, -depths, 0.45))


def test_zones_show_every_closed_node_of_every_step(result):
    with fc.open_results(result) as results:
        steps = list(results)
        drawn = fc.plot.contact_zones(steps, "hertz")
        closed = next(line for line in drawn.lines if line.get_label() == "closed")
        assert len(closed.get_xdata()) == sum(int(step.contact["hertz"].active.sum()) for step in steps)
        counts = [text.get_text() for text in drawn.texts]
        assert counts == [str(int(step.contact["hertz"].active.sum())) for step in steps]


def test_a_mirrored_shape_is_as_wide_on_both_sides(result):
    with fc.open_results(result) as results:
        drawn = fc.plot.deformed_shape(results.mesh, results[-1], mirrored=True)
        left, right = drawn.dataLim.intervalx
        assert left == pytest.approx(-right)


@pytest.mark.parametrize("option", first_of(2, ["--axis", "--zones", "--mirrored", "--history"]))
def test_the_command_writes_the_picture(result, tmp_path, option):
    assert main(["plot", str(result), option, "--png", str(tmp_path / "p.png"), "-q"]) == 0
    assert (tmp_path / "p.png").read_bytes()[:4] == b"\x89PNG"


def test_without_a_picture_or_a_window_it_says_what_to_name(result, capsys):
    assert main(["plot", str(result)]) == 1
    assert "--png FILE" in capsys.readouterr().err


def test_no_axis_no_picture(root):
    mesh = fc.generate.block((1.0, 1.0), (2, 2), "quad4", origin=(1.0, 0.0))
    model = elastic_model(mesh, "axisymmetric", BOTTOM="xy")
    with_obstacle(model, "floor", "TOP", fc.obstacles.HalfSpace((0.0, 1.0), (0.0, -1.0)), motion={"y": -0.01})
    step = fc.solve(model, fc.linear_ramp(1))[-1]
    with pytest.raises(fc.FastcontactError, match="no nodes on the axis of contact 'floor'"):
        fc.plot.axis_stress(mesh, step, "floor")


def test_the_view_writes_a_screenshot(result, tmp_path):
    pytest.importorskip("pyvista", reason="needs PyVista: pip install 'fastcontact[view]'")
    target = tmp_path / "v.png"
    assert main(["plot", str(result), "--view", "--png", str(target)]) == 0
    assert target.read_bytes()[:4] == b"\x89PNG"
