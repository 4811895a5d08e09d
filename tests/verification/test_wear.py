"""Wear that later load steps start from: volume, the worn shape, refusals."""

from dataclasses import replace

import numpy as np
import pytest
from models import elastic_model, united

import fastcontact as fc
from fastcontact.cases.case import read_case
from fastcontact.mesh.generate import block, block_on_block, box

pytestmark = pytest.mark.each_value

COEFFICIENT, FORCE = 2e-5, 40.0
PRESS, SLIDE = [(0.0, 0.0), (1.0, 1.0), (100.0, 1.0)], [(0.0, 0.0), (1.0, 0.0), (100.0, 99.0)]


def shoe(formulation="continuous", wear=COEFFICIENT, stroke=2.0, crown=0.004, element="quad4", **options):
    """A crowned block of width 2 pressed on a plane that slides `stroke` along it in every unit of time."""
    mesh = block((2.0, 1.0), (20, 8), element, (-1.0, 0.0))
    mesh = mesh.replace(points=mesh.points + np.column_stack([0.0 * mesh.points[:, 0], crown * mesh.points[:, 0] ** 2]))
    model = elastic_model(mesh, "plane_strain", TOP="x")
    model.couple("TOP", "y")
    model.add_force("TOP", y=-FORCE, distribute=True, ramp=PRESS)
    plane = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0))
    options = {**options, **({} if wear is None else {"wear": wear})}
    model.add_obstacle(
        "sole", secondary="BOTTOM", obstacle=plane, motion={"x": stroke}, ramp=SLIDE, formulation=formulation, **options
    )
    return model


def volume(contact):
    order = np.argsort(contact.coordinates[:, 0])
    return np.trapezoid(contact.wear[order], contact.coordinates[order, 0])


@pytest.mark.parametrize(
    ("formulation", "options"), [("node_to_segment", {}), ("continuous", {}), ("continuous", {"friction": 0.2})]
)
def test_the_worn_volume_is_archards(formulation, options):
    """Coefficient times force times path, whatever the pressures are: at all instants."""
    model = shoe(formulation, crown=0.05, **options)
    steps = fc.solve(model, [float(k) for k in range(1, 12)])
    assert steps[0].contact["sole"].wear.max() < 2e-6  # the sole widens a little as it is pressed
    for step in steps[2:]:  # in the second step the sole is dragged along a little before it slides, with friction
        worn = volume(step.contact["sole"]) - volume(steps[1].contact["sole"])
        assert worn == pytest.approx(COEFFICIENT * FORCE * 2.0 * (step.load_factor - 2.0), rel=2e-3)
    assert np.ptp(steps[-1].contact["sole"].coordinates[steps[-1].contact["sole"].active, 0]) > np.ptp(
        steps[0].contact["sole"].coordinates[steps[0].contact["sole"].active, 0]
    )


@pytest.mark.filterwarnings("ignore:contact 'ball' has only")
@pytest.mark.parametrize("formulation", [None, "mortar"])
@pytest.mark.parametrize("stroke", [0.0, 0.2])
def test_the_worn_volume_does_not_depend_on_the_number_of_steps(formulation, stroke):
    """A roller that is pressed and drawn in the same steps: k times force over slip, which is k times work over friction."""
    volumes = []
    for count in (80, 20, 5):
        mesh = block((8.0, 4.0), (64, 16), "quad4", (-4.0, -4.0))
        x, y = mesh.points.T
        points = np.column_stack([4.0 * np.sign(x) * np.abs(x / 4.0) ** 1.5, -4.0 * np.abs(y / 4.0) ** 1.5])
        model = elastic_model(mesh.replace(points=points), "plane_strain", E=1e5, BOTTOM="xy")
        roller = fc.obstacles.Sphere(centre=(0.0, 10.0), R=10.0)
        options = {"motion": {"x": stroke, "y": -0.05}, "friction": 0.1, "formulation": formulation}
        model.add_obstacle("ball", secondary="TOP", obstacle=roller, **options)
        steps = fc.solve(model, count)
        contact = steps[-1].contact["ball"]
        worn = volume(replace(contact, wear=fc.wear(model, steps, "ball", COEFFICIENT)[-1]))
        assert worn == pytest.approx(COEFFICIENT * steps[-1].work["friction_work"] / 0.1, rel=0.02)
        volumes.append(worn)
    assert volumes[1:] == [pytest.approx(volumes[0], rel=0.01)] * 2


def test_a_flat_block_wears_evenly():
    """Under a uniform pressure: k p s to the last digit, and no change of the pressure."""
    model = shoe("node_to_segment", crown=0.0, wear=5e-6)
    model.materials.clear()
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.0))
    steps = fc.solve(model, [1.0, 2.0, 4.0])
    contact = steps[-1].contact["sole"]
    assert contact.wear == pytest.approx(np.full(len(contact.points), 5e-6 * FORCE / 2.0 * 6.0), rel=1e-9)
    assert contact.pressure == pytest.approx(np.full(len(contact.points), FORCE / 2.0), rel=1e-9)
    sunk = (
        steps[-1].displacement[model.mesh.points_of("TOP_LEFT")[0], 1]
        - steps[0].displacement[model.mesh.points_of("TOP_LEFT")[0], 1]
    )
    # The block follows what was worn off before the last step, which began at 2.
    assert sunk == pytest.approx(-5e-6 * FORCE / 2.0 * 2.0, rel=1e-9)


@pytest.mark.parametrize("formulation", ["node_to_segment", pytest.param("continuous", marks=pytest.mark.slow)])
def test_a_shoe_wears_in_until_it_presses_evenly(formulation):
    """A guided shoe that wears everywhere alike presses everywhere alike: its force over its area."""
    model = shoe(formulation, wear=4e-5)
    last = fc.solve(model, np.linspace(1.0, 91.0, 138))[-1].contact["sole"]
    inside = np.abs(last.coordinates[:, 0]) < 0.95
    assert last.active.all()
    assert last.pressure[inside] == pytest.approx(np.full(inside.sum(), FORCE / 2.0), rel=0.02)


def test_wear_told_afterwards_is_what_the_analysis_wore_off():
    model = shoe()
    steps = fc.solve(model, [1.0, 2.0, 3.0, 4.0])
    told = fc.wear(model, steps, "sole", COEFFICIENT)
    assert told[-1] == pytest.approx(steps[-1].contact["sole"].wear, rel=1e-12)
    without = fc.solve(shoe(wear=None), [1.0, 2.0, 3.0, 4.0])
    assert without[-1].contact["sole"].wear is None
    assert without[-1].contact["sole"].pressure_max > 1.01 * steps[-1].contact["sole"].pressure_max


@pytest.mark.parametrize("multipliers", ["dual", "standard"])
def test_bodies_wear_on_the_secondary_side(multipliers):
    """To and fro: coefficient times force times the whole way."""
    mesh = block_on_block(divisions_lower=(16, 6), divisions_upper=(12, 6))
    upper = mesh.points_of("UPPER")
    points = mesh.points.copy()
    points[upper, 1] += 0.002 * (points[upper, 0] - 5.0) ** 2
    model = elastic_model(mesh.replace(points=points), "plane_strain", LOWER_BOTTOM="xy")
    model.couple("UPPER_TOP", "y")
    model.add_force("UPPER_TOP", y=-FORCE, distribute=True, ramp=PRESS)
    there = [(0.0, 0.0), (1.0, 0.0), (2.0, 1.0), (3.0, -1.0), (4.0, 1.0), (5.0, -1.0)]
    model.prescribe("UPPER_TOP", x=0.3, ramp=there)
    model.add_contact(
        "sole", secondary="CONT_UPPER", primary="CONT_LOWER", formulation="mortar", wear=5e-4, multipliers=multipliers
    )
    steps = fc.solve(model, [1.0, 2.0, 3.0, 4.0, 5.0])
    before, last = steps[0].contact["sole"], steps[-1].contact["sole"]
    assert volume(last) - volume(before) == pytest.approx(5e-4 * FORCE * 0.3 * 7.0, rel=0.01)
    assert last.active.sum() >= before.active.sum()
    assert last.pressure_max < 0.98 * before.pressure_max


@pytest.mark.filterwarnings("ignore:the energy of these load steps")
def test_steps_that_wear_too_much_are_told():
    with pytest.warns(
        fc.FastcontactWarning, match=r"contact 'sole' wears so much in a load step .* use 3 times as many"
    ):
        rough = fc.solve(shoe(wear=4e-5), np.linspace(1.0, 91.0, 46))[-1].contact["sole"]
    assert np.abs(np.diff(rough.pressure)).max() > 0.2 * FORCE / 2.0


def test_an_analysis_goes_on_with_what_was_worn_off(tmp_path):
    model = shoe()
    whole = fc.solve(model, [1.0, 2.0, 3.0, 4.0])
    with fc.ResultWriter(tmp_path / "worn.vtkhdf", model) as out:
        fc.solve(model, [1.0, 2.0, 3.0], on_step=out.write)
    stored = list(fc.open_results(tmp_path / "worn.vtkhdf"))
    assert (stored[-1].contact["sole"].wear == whole[2].contact["sole"].wear).all()
    again = list(fc.solve_steps(model, [1.0, 2.0, 3.0, 4.0], resume=stored))
    assert again[-1].contact["sole"].wear == pytest.approx(whole[-1].contact["sole"].wear, rel=1e-9)
    assert again[-1].displacement == pytest.approx(whole[-1].displacement, abs=1e-12)


def test_what_cannot_wear_is_refused():
    with pytest.raises(fc.ContactError, match="is bilateral, which does not wear"):
        shoe(kind="bilateral")
    with pytest.raises(fc.ContactError, match=r"wear = -1\.0 of contact 'sole' must be positive"):
        shoe(wear=-1.0)


def test_a_case_file_wears(tmp_path):
    fc.write_mesh(tmp_path / "shoe.med", shoe().mesh)
    text = """
title = "A shoe"
kinematics = "plane_strain"
mesh = { file = "shoe.med" }
material = [{ E = 1000.0, nu = 0.3 }]
support = [{ group = "TOP", x = 0.0, y = -0.03, ramp = [[0.0, 0.0], [1.0, 1.0], [5.0, 1.0]] }]
ramp = { instants = [1.0, 2.0, 3.0], table = [[0.0, 0.0], [5.0, 5.0]] }
[obstacle.sole]
secondary = "BOTTOM"
shape = { kind = "half_space", point = [0.0, 0.0], normal = [0.0, 1.0] }
motion = { x = 2.0 }
ramp = [[0.0, 0.0], [1.0, 0.0], [5.0, 4.0]]
wear = 2e-5
"""
    path = tmp_path / "shoe.toml"
    path.write_text(text, encoding="utf-8")
    case = read_case(path)
    steps = fc.solve(case.model, case.ramp, criteria=case.criteria)
    first, last = steps[0].contact["sole"], steps[-1].contact["sole"]
    assert last.force[1] < 0.99 * first.force[1]  # held in place, the block loses its pressure as it wears
    assert last.wear.max() > 0.0


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
def test_a_block_in_space_wears_along_any_way(formulation):
    mesh = box((2.0, 2.0, 1.0), (6, 6, 2), origin=(-1.0, -1.0, 0.0))
    points = mesh.points.copy()
    points[:, 2] += 0.03 * (1.0 - points[:, 2]) * (points[:, 0] ** 2 + 0.5 * points[:, 1] ** 2)
    model = elastic_model(mesh.replace(points=points), "3d", ZMAX="xy")
    model.couple("ZMAX", "z")
    model.add_force("ZMAX", z=-FORCE, distribute=True, ramp=PRESS)
    plane = fc.obstacles.HalfSpace((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    model.add_obstacle(
        "sole",
        secondary="ZMIN",
        obstacle=plane,
        motion={"x": 0.6, "y": -0.8},
        ramp=SLIDE,
        formulation=formulation,
        wear=1e-4,
    )
    steps = fc.solve(model, [1.0, 2.0, 3.0, 4.0])
    contact = steps[-1].contact["sole"]
    order = np.lexsort((contact.coordinates[:, 1], contact.coordinates[:, 0]))
    depth = contact.wear[order].reshape(7, 7)
    ends = np.array([0.5, *np.ones(5), 0.5]) / 3.0
    assert ends @ depth @ ends == pytest.approx(1e-4 * FORCE * 3.0, rel=0.01)
    assert contact.active.sum() > steps[0].contact["sole"].active.sum()


def test_bodies_in_space_that_slide_over_their_edges():
    """To and fro by mortar: also nodes that stand out beyond the other body wear while parts of their facets are pressed.

    Strains along the surfaces shorten the way by 1.1 %.
    """
    low = box((2.0, 2.0, 1.0), (6, 6, 2), "hex8", (-1.0, -1.0, -1.0))
    mesh = united(L_=low, U_=box((2.0, 2.0, 1.0), (4, 4, 2), "hex8", (-1.0, -1.0, 0.0)))
    points, upper = mesh.points.copy(), mesh.points_of("U_BOX")
    points[upper, 2] += 0.02 * (1.0 - points[upper, 2]) * (points[upper, 0] ** 2 + points[upper, 1] ** 2)
    model = elastic_model(mesh.replace(points=points), "3d", L_ZMIN="xyz")
    model.couple("U_ZMAX", "z")
    model.add_force("U_ZMAX", z=-FORCE, distribute=True, ramp=PRESS)
    model.prescribe("U_ZMAX", x=0.1, y=0.05, ramp=[(0.0, 0.0), (1.0, 0.0), (2.0, 1.0), (3.0, -1.0), (4.0, 1.0)])
    model.add_contact("sole", secondary="U_ZMIN", primary="L_ZMAX", wear=1e-4)
    contact = fc.solve(model, [1.0, 2.0, 3.0, 4.0])[-1].contact["sole"]
    order = np.lexsort((contact.coordinates[:, 1], contact.coordinates[:, 0]))
    ends = np.array([0.5, 1.0, 1.0, 1.0, 0.5]) / 2.0
    worn = ends @ contact.wear[order].reshape(5, 5) @ ends
    assert worn == pytest.approx(1e-4 * FORCE * 5.0 * np.hypot(0.1, 0.05), rel=0.015)
