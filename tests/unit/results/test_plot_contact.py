"""Pictures of contacts: their numbers, and the commands that make them."""

import numpy as np
import pytest
from models import elastic_model
from pairwise import first_of

import fastcontact as fc
from fastcontact.cli import main
from fastcontact.errors import FastcontactError
from fastcontact.results.plot.axis import stresses_on_axis


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
    model.add_obstacle(
        "floor", secondary="TOP", obstacle=fc.obstacles.HalfSpace((0.0, 1.0), (0.0, -1.0)), motion={"y": -0.01}
    )
    step = fc.solve(model, fc.linear_ramp(1))[-1]
    with pytest.raises(FastcontactError, match="no nodes on the axis of contact 'floor'"):
        fc.plot.axis_stress(mesh, step, "floor")


def test_the_view_writes_a_screenshot(result, tmp_path):
    pytest.importorskip("pyvista", reason="needs PyVista: pip install 'fastcontact[view]'")
    target = tmp_path / "v.png"
    assert main(["plot", str(result), "--view", "--png", str(target)]) == 0
    assert target.read_bytes()[:4] == b"\x89PNG"
