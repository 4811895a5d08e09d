"""Force, moment, area, centre, mean gap, work of friction and wear of contacts with exact solutions."""

import json
from dataclasses import replace

import numpy as np
import pytest
from models import elastic_model, made_of, pressed_spheres, supported, united, with_contact, with_obstacle
from refusals import refused

import fastcontact as fc
from fastcontact.cli._main import main
from fastcontact.mesh.generate import block, block_on_block, box

pytestmark = pytest.mark.each_value

E, HEIGHT = 1000.0, 2.0
ELEMENTS = ("tri3", "quad4", "tri6", "quad8")


def column(element="quad4", divisions=(4, 2), tilt=0.0, kinematics="plane_stress", **options):
    """Return a block of width 2 on a rigid plane; nu = 0, so that each column of it is a spring."""
    model = elastic_model(fc.generate.block((2.0, HEIGHT), divisions, element), kinematics, E=E, nu=0.0)
    model.add_obstacle(
        "plane", secondary="BOTTOM", obstacle=fc.obstacles.HalfSpace(point=(0.0, 0.0), normal=(0.0, 1.0)),
        formulation="continuous", **options,
    )  # fmt: skip
    return model


def pressed(model, push, **ramps):
    model.prescribe("TOP", y=-push, **ramps)


@pytest.mark.parametrize("kinematics", ["plane_stress", "plane_strain", "axisymmetric"])
@pytest.mark.parametrize("element", ELEMENTS)
def test_a_uniform_pressure(element, kinematics):
    model = column(element, kinematics=kinematics)
    pressed(model, 0.01)
    model.fix("TOP", "x")
    first, last = fc.contact_resultants(model, fc.solve(model, 2), "plane")
    area = 4.0 * np.pi if kinematics == "axisymmetric" else 2.0
    assert last.area == pytest.approx(area, rel=1e-12)
    assert last.force == pytest.approx([0.0, E * 0.01 / HEIGHT * area], rel=1e-9, abs=1e-9)
    assert last.pressure_mean == pytest.approx(5.0, rel=1e-9)
    assert last.pressure_mean == pytest.approx(2.0 * first.pressure_mean, rel=1e-9)
    assert last.moment == pytest.approx(0.0, abs=1e-9)
    assert last.mean_gap == pytest.approx(0.0, abs=1e-12)
    if kinematics != "axisymmetric":
        assert last.centre == pytest.approx([1.0, 0.0], abs=1e-9)


@pytest.mark.parametrize("element", ["quad4", "quad8"])
def test_what_a_press_fit_holds(element, tmp_path):
    """The force on the seat of a bush cancels all round; the normal forces are Lame's pressure times the area."""
    inner, seat, outer, length = 15.0, 40.0, 60.0, 20.0
    shaft = fc.generate.block((seat - inner, length), (24, 4), element, origin=(inner, 0.0), name="SHAFT")
    hub = fc.generate.block((outer - seat, length), (24, 4), element, origin=(seat, 0.0), name="HUB")
    laws = {"SHAFT": fc.LinearElastic(E=210e3, nu=0.3), "HUB": fc.LinearElastic(E=105e3, nu=0.34)}
    model = made_of(united(**{"SHAFT ": shaft, "HUB ": hub}), "axisymmetric", laws)
    for name in ("SHAFT", "HUB"):
        model.fix(f"{name} BOTTOM", "y")
        model.couple(f"{name} TOP", "y")
    ramp = [(0.0, 0.0), (1.0, 1.0)]
    model.add_contact("fit", secondary="HUB LEFT", primary="SHAFT RIGHT", clearance=-0.03, clearance_ramp=ramp)
    steps = fc.solve(model, 2)
    moduli = {"E_inner": 210e3, "nu_inner": 0.3, "E_outer": 105e3, "nu_outer": 0.34}
    radii = {"inner_radius": inner, "interface_radius": seat, "outer_radius": outer}
    lame = fc.analytic.press_fit_cylinders(**moduli, **radii, interference=0.03, kinematics="plane_stress")
    exact = lame.pressure * 2.0 * np.pi * seat * length
    table = fc.contact_history(model, steps, "fit")
    assert table["normal_force"] == pytest.approx([0.5 * exact, exact], rel=2e-3)
    contact = steps[-1].contact["fit"]
    assert contact.normal_force == table["normal_force"][-1]
    pytest.importorskip("matplotlib", reason="pictures need matplotlib")
    assert f"sum of normal forces {contact.normal_force:.6g}" in repr(contact)
    upper, _ = fc.plot.history(steps, "fit", units=fc.plot.UNITS)
    assert upper.get_ylabel() == "sum of the normal forces [N]"
    assert list(upper.lines[0].get_ydata()) == list(table["normal_force"])


def test_a_punch_off_the_middle_has_a_moment():
    """A rigid plane pressed by a force at a distance of 0.2 from the middle: centre and moment by statics."""
    model = column("quad8", (8, 4))
    model.fix("BOTTOM_LEFT", "x")
    model.add_traction("TOP", y=lambda x: -(1.0 + 0.6 * (x[:, 0] - 1.0)))  # moment about the middle 0.6 * 2 / 3
    (step,) = fc.solve(model, 1)
    (found,) = fc.contact_resultants(model, [step], "plane")
    assert found.force[1] == pytest.approx(2.0, rel=1e-9)
    assert fc.contact_moment(step.contact["plane"], (1.0, 0.0)) == pytest.approx([0.4], rel=1e-8)
    assert found.centre[0] == pytest.approx(1.2, rel=1e-9)
    assert found.moment == pytest.approx([2.0 * (1.2 - step.contact["plane"].middle[0])], rel=1e-8)


def test_in_space_the_moment_has_three_components():
    mesh = fc.generate.box((2.0, 2.0, 1.0), (4, 4, 2))
    model = elastic_model(mesh, "3d", E=E, nu=0.0)
    model.add_obstacle("plane", secondary="ZMIN", obstacle=fc.obstacles.HalfSpace((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
    corners = [int(np.flatnonzero((mesh.points == place).all(axis=1))[0]) for place in ([0, 0, 0], [2, 0, 0])]
    model.mesh = mesh.with_groups(points={"ONE": corners[:1], "BOTH": corners})
    supported(model, ONE="x", BOTH="y")
    model.add_traction("ZMAX", z=lambda x: -(1.0 + 0.3 * (x[:, 0] - 1.0) - 0.6 * (x[:, 1] - 1.0)))
    (step,) = fc.solve(model, 1)
    (found,) = fc.contact_resultants(model, [step], "plane")
    assert found.area == pytest.approx(4.0, rel=1e-9)
    assert found.force == pytest.approx([0.0, 0.0, 4.0], abs=1e-9)
    assert fc.contact_moment(step.contact["plane"], (1.0, 1.0, 0.0)) == pytest.approx([-0.8, -0.4, 0.0], abs=1e-9)
    assert found.centre[:2] == pytest.approx([1.1, 0.8], rel=1e-9)


def test_the_area_of_hertz_lies_between_the_brackets_of_the_radius():
    case = pressed_spheres(fc.generate.half_spheres(size=2.0))
    steps = fc.solve(case, 4)
    for step, found in zip(steps, fc.contact_resultants(case, steps, "hertz"), strict=True):
        low, high = step.contact["hertz"].radius
        assert np.pi * low**2 < found.area < np.pi * high**2 * 1.02
        assert found.moment == pytest.approx(0.0)


@pytest.mark.parametrize("wide_is_secondary", [False, True])
@pytest.mark.parametrize("dim", [2, 3])
def test_the_area_of_mortar_contact_is_that_of_the_narrow_body(dim, wide_is_secondary):
    if dim == 2:
        wide, narrow = block((6.0, 2.0), (9, 3), origin=(-3.0, -2.0)), block((2.0, 1.0), (4, 2), origin=(-1.07, 0.0))
        kinematics, top, bottom, up, area = "plane_strain", "TOP", "BOTTOM", "y", 2.0
    else:
        wide, narrow = (
            box((6.0, 6.0, 2.0), (6, 6, 1), origin=(-3.0, -3.0, -2.0)),
            box((2.0, 2.0, 1.0), (3, 3, 1), origin=(-1.07, -1.13, 0.0)),
        )
        kinematics, top, bottom, up, area = "3d", "ZMAX", "ZMIN", "z", 4.0
    model = elastic_model(united(WIDE_=wide, NARROW_=narrow), kinematics, E=E, nu=0.0)
    model.fix(f"WIDE_{bottom}", "xyz"[: model.mesh.dim])
    model.prescribe(f"NARROW_{top}", **dict.fromkeys("xyz"[: model.mesh.dim], 0.0) | {up: -1e-8})
    sides = f"WIDE_{top}", f"NARROW_{bottom}"
    secondary, primary = sides if wide_is_secondary else sides[::-1]
    model.add_contact("c", secondary=secondary, primary=primary)
    (resultants,) = fc.contact_resultants(model, fc.solve(model, 1), "c")
    assert resultants.area == pytest.approx(area, rel=1e-7)
    assert resultants.pressure_mean == pytest.approx(resultants.normal_force / area, rel=1e-7)


WEAR = 1e-6
RAMP_DOWN, RAMP_ALONG = [(0.0, 0.0), (1.0, 1.0), (9.0, 1.0)], [(0.0, 0.0), (1.0, 0.0), (9.0, 1.0)]


@pytest.mark.parametrize("element", ELEMENTS)
@pytest.mark.parametrize("steps", [1, 5])
def test_a_block_that_slides_wears_by_pressure_times_way(element, steps):
    """Without friction the whole block moves by 0.3 under 5 [pressure]: k p s at every node."""
    model = column(element)
    pressed(model, 0.01, ramp=RAMP_DOWN)
    model.prescribe("TOP", x=0.3, ramp=RAMP_ALONG)
    depth = fc.wear(model, fc.solve(model, [1.0, *np.linspace(1.0, 9.0, steps + 1)[1:]]), "plane", WEAR)
    assert depth.shape == (steps + 1, len(model.mesh.points_of("BOTTOM")))
    assert depth[0] == pytest.approx(0.0, abs=1e-18)
    assert depth[-1] == pytest.approx(WEAR * 5.0 * 0.3, rel=1e-8)
    assert (np.diff(depth, axis=0) >= 0.0).all()


def test_wear_of_two_bodies_and_of_an_obstacle_that_moves():
    """The same way, whichever of the two moves."""
    low = fc.generate.block((4.0, HEIGHT), (8, 2), origin=(-1.0, -HEIGHT), name="LOW")
    mesh = fc.generate.union(united(**{"LOW ": low}), fc.generate.block((2.0, HEIGHT), (4, 2)))
    laws = {"BLOCK": fc.LinearElastic(E=E, nu=0.0), "LOW": fc.LinearElastic(E=1e4 * E, nu=0.0)}
    model = made_of(mesh, "plane_stress", laws, **{"LOW BOTTOM": "y"})
    model.prescribe("LOW BOTTOM", x=-0.3, ramp=RAMP_ALONG)
    pressed(model, 0.01, ramp=RAMP_DOWN)
    model.fix("TOP", "x")
    model.add_contact("plane", secondary="BOTTOM", primary="LOW TOP")
    found = fc.solve(model, [1.0, 5.0, 9.0])
    assert fc.wear(model, found, "plane", WEAR)[-1] == pytest.approx(WEAR * 5.0 * 0.3, rel=1e-3)
    moved = column()
    moved.contact.clear()
    moved.add_obstacle(
        "plane", secondary="BOTTOM", obstacle=fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0)), motion={"x": -0.3},
        ramp=RAMP_ALONG,
    )  # fmt: skip
    pressed(moved, 0.01, ramp=RAMP_DOWN)
    moved.fix("TOP", "x")
    steps = fc.solve(moved, [1.0, 5.0, 9.0])
    assert fc.wear(moved, steps, "plane", WEAR)[-1] == pytest.approx(WEAR * 5.0 * 0.3, rel=1e-8)
    for own, tolerance in ((found, 1e-3), (steps, 1e-8)):  # slip: the way of the step, and all of it
        slips = [step.contact["plane"] for step in own]
        for name, ways in (("slip", (0.0, 0.15, 0.15)), ("slip_total", (0.0, 0.15, 0.3))):
            for contact, way in zip(slips, ways, strict=True):
                assert getattr(contact, name)[:, 0] == pytest.approx(way, rel=tolerance, abs=1e-3 * tolerance)
                assert getattr(contact, name)[:, 1] == pytest.approx(0.0, abs=1e-3 * tolerance)


@pytest.mark.parametrize("element", ["quad4", "quad8"])
def test_with_friction_the_volume_of_wear_is_the_work_over_the_coefficient(element):
    """``sum of areas times depth = k W / mu``: pressure times slip is all that both know of."""
    mu = 0.2
    model = column(element, (8, 4), friction=mu, wear=WEAR)
    pressed(model, 0.01, ramp=RAMP_DOWN)
    model.prescribe("TOP", x=0.05, ramp=RAMP_ALONG)
    steps = fc.solve(model, [1.0, 3.0, 5.0, 7.0, 9.0])
    depth = fc.wear(model, steps, "plane", WEAR)
    answers = fc.contact_resultants(model, steps, "plane")
    assert answers[-1].friction_work == pytest.approx(sum(a.dissipation for a in answers))
    contact = steps[-1].contact["plane"]
    assert contact.active.sum() > 6
    assert not contact.sticking.any()
    mean = np.trapezoid(depth[-1][np.argsort(contact.coordinates[:, 0])], np.sort(contact.coordinates[:, 0]))
    assert mean == pytest.approx(WEAR * answers[-1].friction_work / mu, rel=0.05)
    assert [a.worn_volume for a in answers] == pytest.approx([WEAR * a.friction_work / mu for a in answers], rel=0.05)


def test_history_is_a_table_and_the_summary_tells(tmp_path, root):
    model = column()
    pressed(model, 0.01)
    model.fix("TOP", "x")
    table = fc.contact_history(model, fc.solve(model, 3), "plane")
    assert table.dtype.names[:5] == ("step", "load_factor", "force_x", "force_y", "moment_z")
    assert table["force_y"] == pytest.approx(np.array([1, 2, 3]) / 3 * 10.0)
    fc.write_csv(tmp_path / "history.csv", table)
    case, out, summary = (
        str(path) for path in (root / "data/cases/forma04c.toml", tmp_path / "a.vtkhdf", tmp_path / "a.json")
    )
    assert main(["run", case, "-o", out, "--json", summary, "-q"]) == 0
    contact = json.loads((tmp_path / "a.json").read_text())["contact"]["hertz"]
    low, high = contact["radius"]
    assert np.pi * low**2 < contact["area"] < 1.1 * np.pi * high**2
    assert contact["friction_work"] == 0.0


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda m, s: fc.contact_resultants(m, s, "plan"), "unknown contact pair 'plan': did you mean 'plane'"),
        (lambda m, s: fc.wear(m, s, "plane", -1.0), "coefficient of wear -1.0 must be"),
        (lambda m, s: fc.contact_moment(s[0].contact["plane"], (0.0, 0.0, 0.0)), "needs one number per dimension"),
    ],
)
def test_what_is_refused(call, said):
    model = column(divisions=(1, 1))
    pressed(model, 0.01)
    model.fix("TOP", "x")
    refused(fc.ContactError, said, call, model, fc.solve(model, 1))


def sliding(cells):
    """Return the model of a block that a rigid floor presses while it slides."""
    model = elastic_model(fc.generate.block((2.0, 1.0), (cells, 2)), "plane_strain", nu=0.0)
    model.add_obstacle("floor", secondary="BOTTOM", obstacle=fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0)))
    return supported(model, TOP={"x": 1.0, "y": -0.01})


def test_steps_of_another_model_or_order_are_refused():
    model = sliding(4)
    steps = fc.solve(model, 2)
    for answer in (lambda m: fc.wear(m, steps, "floor", 1e-3), lambda m: fc.contact_history(m, steps, "floor")):
        assert len(answer(model)) == 2
        refused(fc.errors.ContactError, "load step 1 belongs to another model", answer, sliding(6))
    for wrong in (steps[::-1], steps[1:]):
        refused(fc.errors.ContactError, "step 1 was expected, but got step 2", fc.wear, model, wrong, "floor", 1e-3)


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
    with_obstacle(model, "sole", "BOTTOM", plane, motion={"x": stroke}, ramp=SLIDE, formulation=formulation, **options)
    return model


def volume(contact):
    order = np.argsort(contact.coordinates[:, 0])
    return np.trapezoid(contact.wear[order], contact.coordinates[order, 0])


@pytest.mark.parametrize(
    ("formulation", "options"), [("node_to_segment", {}), ("continuous", {}), ("continuous", {"friction": 0.2})]
)
def test_the_worn_volume_is_archards(formulation, options):
    """Coefficient times force times path, whatever the pressures are: at all instants."""
    steps = fc.solve(shoe(formulation, crown=0.05, **options), [float(k) for k in range(1, 12)])
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
    for count in (40, 10, 5):
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


@pytest.mark.parametrize("formulation", ["continuous", "mortar"])
def test_wear_of_quadratic_facets_does_not_follow_the_scatter_of_pressures(formulation):
    """Pressures are uneven near the edges; the depth is linear in facets, with the volume k times work over friction."""
    model = elastic_model(block((2.0, 1.0), (8, 4), "quad8"), "plane_strain")
    model.prescribe("TOP", y=-0.01, ramp=[(0, 0), (1, 1), (3, 1)])
    model.prescribe("TOP", x=0.5, ramp=[(0, 0), (1, 0), (3, 1)])
    plane = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0))
    model.add_obstacle("sole", secondary="BOTTOM", obstacle=plane, friction=0.2, wear=1e-5, formulation=formulation)
    last = fc.solve(model, [1.0, 2.0, 3.0])[-1]
    contact = last.contact["sole"]
    depth = contact.wear[np.argsort(contact.coordinates[:, 0])]
    assert depth[1::2] == pytest.approx(0.5 * (depth[:-1:2] + depth[2::2]), rel=1e-12)
    assert volume(contact) == pytest.approx(1e-5 * last.work["friction_work"] / 0.2, rel=1e-6)


def test_a_flat_block_wears_evenly():
    """Under a uniform pressure: k p s to the last digit, and no change of the pressure."""
    model = shoe("node_to_segment", crown=0.0, wear=5e-6)
    model.materials.clear()
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.0))
    steps = fc.solve(model, [1.0, 2.0, 4.0])
    contact = steps[-1].contact["sole"]
    assert contact.wear == pytest.approx(np.full(len(contact.points), 5e-6 * FORCE / 2.0 * 6.0), rel=1e-9)
    assert contact.pressure == pytest.approx(np.full(len(contact.points), FORCE / 2.0), rel=1e-9)
    top = model.mesh.points_of("TOP_LEFT")[0], 1
    sunk = steps[0].displacement[top] - steps[-1].displacement[top]
    assert sunk == pytest.approx(5e-6 * FORCE / 2.0 * 6.0, rel=1e-9)
    assert steps[-1].work["wear_work"] == pytest.approx(FORCE * sunk, rel=1e-9)


@pytest.mark.parametrize(
    "options", [{}, {"formulation": "mortar"}, {"formulation": "node_to_segment"}, {"friction": 1e-9}]
)
@pytest.mark.parametrize("dim", [2, 3])
def test_a_held_punch_loses_its_pressure_exponentially(dim, options):
    """Its shortening wears off: the pressure is p0 exp(-k E s / H); five steps are in error by 0.34 %."""
    size, plane = (2.0, 2.0, 1.0)[-dim:], fc.obstacles.HalfSpace((0.0,) * dim, np.eye(dim)[-1])
    model = elastic_model(
        (block if dim == 2 else box)(size, (4, 4, 2)[-dim:]), "plane_stress" if dim == 2 else "3d", nu=0.0
    )
    top, bottom = ("TOP", "BOTTOM") if dim == 2 else ("ZMAX", "ZMIN")
    model.fix(top, "xy"[: dim - 1])
    model.prescribe(top, **{"xyz"[dim - 1]: -0.01}, ramp=[(0, 0), (1, 1), (6, 1)])
    slide = [(0, 0), (1, 0), (6, 1)]
    model.add_obstacle("sole", secondary=bottom, obstacle=plane, motion={"x": 2.0}, ramp=slide, wear=0.5e-3, **options)
    first, *steps = fc.solve(model, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    ratio = [step.contact["sole"].pressure / first.contact["sole"].pressure for step in steps]
    assert ratio[-1] == pytest.approx(np.exp(-1.0), rel=4e-3)
    for n, found in enumerate(ratio, 1):
        assert found == pytest.approx((0.9 / 1.1) ** n, rel=1e-6)
    assert steps[-1].contact["sole"].wear == pytest.approx(0.01 * (1.0 - ratio[-1]), rel=1e-6)
    work = steps[-1].work
    assert work["external_work"] == pytest.approx(first.work["strain_energy"], rel=1e-6)  # the support stands still
    assert work["wear_work"] == pytest.approx(work["external_work"] - work["strain_energy"], rel=1e-6)


@pytest.mark.parametrize("friction", [None, 0.2])
def test_the_work_of_the_load_on_a_worn_block_is_balanced(friction):
    """Force times sinking is elastic energy and work of wear; friction adds its own work, which the plane supplies."""
    model = shoe("mortar", friction=friction)
    steps = fc.solve(model, [1.0, 2.0, 3.0, 5.0])
    top, work = model.mesh.points_of("TOP"), [step.work for step in steps]
    sunk = [-FORCE * step.displacement[top, 1].mean() for step in steps]
    supplied = sunk[-1] - sunk[1] + (FORCE * friction * 2.0 * 3.0 if friction else 0.0)
    assert work[-1]["external_work"] - work[1]["external_work"] == pytest.approx(supplied, rel=1e-4)
    assert abs(work[-1]["imbalance"]) < 1e-5 * work[-1]["wear_work"]


@pytest.mark.parametrize("formulation", ["node_to_segment", pytest.param("continuous", marks=pytest.mark.slow)])
def test_a_shoe_wears_in_until_it_presses_evenly(formulation):
    """A guided shoe that wears everywhere alike presses everywhere alike: its force over its area."""
    last = fc.solve(shoe(formulation, wear=4e-5), np.linspace(1.0, 91.0, 138))[-1].contact["sole"]
    inside = np.abs(last.coordinates[:, 0]) < 0.95
    assert last.active.all()
    assert last.pressure[inside] == pytest.approx(np.full(inside.sum(), FORCE / 2.0), rel=0.02)


def test_wear_told_afterwards_is_what_the_analysis_wore_off():
    model = shoe()
    steps = fc.solve(model, [1.0, 2.0, 3.0, 4.0])
    assert fc.wear(model, steps, "sole", COEFFICIENT)[-1] == pytest.approx(steps[-1].contact["sole"].wear, rel=1e-12)
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
    with_contact(model, "sole", "CONT_UPPER", "CONT_LOWER", formulation="mortar", wear=5e-4, multipliers=multipliers)
    steps = fc.solve(model, [1.0, 2.0, 3.0, 4.0, 5.0])
    before, last = steps[0].contact["sole"], steps[-1].contact["sole"]
    assert volume(last) - volume(before) == pytest.approx(5e-4 * FORCE * 0.3 * 7.0, rel=0.01)
    assert last.active.sum() >= before.active.sum()
    assert last.pressure_max < 0.98 * before.pressure_max


@pytest.mark.parametrize("formulation", ["continuous", "mortar"])
def test_the_wear_of_a_node_that_opens_under_friction_ends_a_step(formulation, caplog):
    """The left end of the side that wears faster opens in a step, which changes its wear by a jump: no depth fits exactly."""
    mesh = block((2.0, 1.0), (8, 4), origin=(-1.0, 0.0))
    for name, sign in (("SLOW", -1.0), ("FAST", 1.0)):
        mesh = mesh.with_facet_group(name, lambda x, s=sign: (x[:, 1] < 1e-9) & (s * x[:, 0] > -1e-9))
    model = elastic_model(mesh, "plane_stress", TOP={"x": 0.0, "y": -0.01, "ramp": PRESS})
    floor, coefficients = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0)), {"SLOW": 1e-3 / 3.0, "FAST": 1e-3}
    for name, k in coefficients.items():
        options = {"motion": {"x": 0.6}, "ramp": SLIDE, "friction": 0.1, "formulation": formulation, "wear": k}
        model.add_obstacle(name, secondary=name, obstacle=floor, **options)
    with caplog.at_level("INFO", logger="fastcontact"):
        steps = fc.solve(model, [1.0, 2.0, 3.0, 4.0])
    assert "wear depths do not converge" in caplog.text
    for name, k in coefficients.items():
        work = sum(step.contact[name].dissipation for step in steps)
        assert volume(steps[-1].contact[name]) == pytest.approx(k * work / 0.1, rel=1e-6)


@pytest.mark.parametrize("formulation", ["continuous", "mortar"])
def test_pressures_do_not_oscillate_in_large_steps(formulation):
    """With the wear of a step added at its end, pressures would alternate from node to node by 20 % of their mean."""
    smooth = fc.solve(shoe(formulation, wear=4e-5), np.linspace(1.0, 91.0, 46))[-1].contact["sole"]
    assert smooth.pressure == pytest.approx(np.full(21, FORCE / 2.0), rel=1e-4)


def test_what_cannot_wear_is_refused():
    refused(fc.ContactError, "is bilateral, which does not wear", shoe, kind="bilateral")
    refused(fc.ContactError, r"wear = -1\.0 of contact 'sole' must be positive", shoe, wear=-1.0)


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
def test_a_block_in_space_wears_along_any_way(formulation):
    mesh = box((2.0, 2.0, 1.0), (6, 6, 2), origin=(-1.0, -1.0, 0.0))
    points = mesh.points.copy()
    points[:, 2] += 0.03 * (1.0 - points[:, 2]) * (points[:, 0] ** 2 + 0.5 * points[:, 1] ** 2)
    model = elastic_model(mesh.replace(points=points), "3d", ZMAX="xy")
    model.couple("ZMAX", "z")
    model.add_force("ZMAX", z=-FORCE, distribute=True, ramp=PRESS)
    plane = fc.obstacles.HalfSpace((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    with_obstacle(
        model, "sole", "ZMIN", plane, motion={"x": 0.6, "y": -0.8}, ramp=SLIDE, formulation=formulation, wear=1e-4
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


def test_the_moment_in_finite_strain_balances_the_reactions_at_their_deformed_positions(tmp_path):
    mesh = fc.generate.block((4.0, 2.0), (4, 3), "quad8")
    model = made_of(mesh, "plane_strain", fc.NeoHookean(E=2.5, nu=0.4), strain="finite")
    floor = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0))
    model.add_obstacle("floor", secondary="BOTTOM", obstacle=floor, friction=0.5, formulation="mortar")
    model.prescribe("TOP", x=0.8, y=-0.3)
    with fc.ResultWriter(tmp_path / "sheared.vtkhdf", model) as writer:
        for step in fc.solve_steps(model, 2):
            writer.write(step)
    stored = fc.open_results(tmp_path / "sheared.vtkhdf")[-1]
    held = mesh.points_of("TOP")
    x, force = (mesh.points + step.displacement)[held] - (1.0, 0.5), step.reaction[held]
    expected = -float((x[:, 0] * force[:, 1] - x[:, 1] * force[:, 0]).sum())
    assert fc.contact_moment(step.contact["floor"], about=(1.0, 0.5)) == pytest.approx(expected, rel=1e-9)
    for last in (step, stored):
        resultant = fc.contact_resultants(model, [last], "floor")[-1]
        assert resultant.moment == fc.contact_moment(step.contact["floor"])
        arm = resultant.centre[0] - 1.0  # the floor remains at y = 0
        assert arm * resultant.force[1] + 0.5 * resultant.force[0] == pytest.approx(expected, rel=1e-9)
