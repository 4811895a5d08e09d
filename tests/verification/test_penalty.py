"""Penalties: pressure and elastic slip, clearance, and exact contact as the limit."""

import numpy as np
import pytest
from models import elastic_model, supported
from pairwise import first_of
from two_bodies import YOUNG, blocks, boxes, each, held, touching

import fastcontact as fc

pytestmark = pytest.mark.each_value

FORMULATIONS = ("node_to_segment", "continuous", "mortar")
MODULUS = {"plane_strain": 1000.0 / 0.91, "axisymmetric": 1000.0, "3d": 1000.0}


@pytest.mark.parametrize("kinematics", ["plane_strain", "axisymmetric", "3d"])
@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_a_penalty_is_an_elastic_layer(formulation, kinematics):
    """Two blocks of stiffness E / h in series with the penalty."""
    mesh = boxes() if kinematics == "3d" else blocks()
    stiffness, penalty = MODULUS[kinematics] / 10.0, 5e4
    last = fc.solve(touching(held(mesh, kinematics), formulation, penalty=penalty), fc.linear_ramp(1))[-1]
    pressure = 0.02 / (1 / stiffness + 1 / penalty)
    contact, axis = last.contact["pair"], mesh.dim - 1
    assert contact.pressure == pytest.approx(pressure, rel=1e-10)
    assert np.abs(last.stress[:, axis] + pressure).max() < 1e-10 * pressure
    assert contact.gap == pytest.approx(-pressure / penalty, rel=1e-9)
    assert contact.penetration == pytest.approx(pressure / penalty, rel=1e-9)


@pytest.mark.parametrize("element", ["quad4", "quad8", "tri6"])
@pytest.mark.parametrize("formulation", ["continuous", "mortar"])
def test_quadratic_facets_and_meshes_that_do_not_match(formulation, element):
    upper = (4, 3) if formulation == "mortar" else (3, 2)
    model = touching(held(blocks(element, upper=upper)), formulation, penalty=1e5)
    contact = fc.solve(model, fc.linear_ramp(1))[-1].contact["pair"]
    assert contact.pressure == pytest.approx(0.02 / (0.01 * 0.91 + 1e-5), rel=1e-10)
    assert contact.penetration == pytest.approx(contact.pressure[0] / 1e5, rel=1e-8)


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_penetration_falls_as_the_penalty_grows(formulation, forma04):
    mesh = fc.generate.half_spheres("quad4")
    exact = fc.solve(forma04(mesh, formulation), fc.linear_ramp(2))[-1].contact["hertz"]
    depths, errors = [], []
    for penalty in (1e6, 1e7, 1e8):
        contact = fc.solve(forma04(mesh, formulation, penalty=penalty), fc.linear_ramp(2))[-1].contact["hertz"]
        depths.append(contact.penetration)
        errors.append(abs(contact.force[1] / exact.force[1] - 1))
    if formulation == "node_to_segment":
        assert np.array(depths) * [1e6, 1e7, 1e8] == pytest.approx(exact.pressure_max, rel=0.02)
    # Proportional to the compliance of the layer, to first order.
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.05)
    assert errors[1] / errors[2] == pytest.approx(10.0, rel=0.05)
    assert errors[2] < 1e-4


def test_a_soft_penalty_is_told_with_a_number():
    model = touching(held(blocks()), "node_to_segment", penalty=1e3)
    with pytest.warns(fc.FastcontactWarning, match=r"pair' penetrates by 0.00198.*, which is 9.9%.*from 1000 to about"):
        last = fc.solve(model, fc.linear_ramp(1))[-1]
    assert "raise its penalty" in last.warnings[0]
    assert last.warnings[0].endswith("give it as a table: penalty=[(0, 0), (1, 1000)]")
    advised = float(last.warnings[0].split("to about ")[1].split(",")[0])
    assert not fc.solve(touching(held(blocks()), "node_to_segment", penalty=advised), 1)[-1].warnings
    layer = fc.solve(touching(held(blocks()), "node_to_segment", penalty=[(0, 0), (1, 1e3)]), 1)[-1]
    assert not layer.warnings
    assert layer.displacement == pytest.approx(last.displacement, abs=1e-9)


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_friction_is_not_softened_by_a_penalty(formulation):
    """What sticks stays where it stuck, step after step: a penalty acts along the normal alone."""
    found = {}
    for penalty in (1e5, None):
        model = elastic_model(blocks(), "plane_strain", nu=0.0, LOWER_BOTTOM="xy", UPPER_TOP={"x": 1e-4, "y": -0.02})
        touching(model, formulation, friction=0.5, penalty=penalty, normals="averaged")
        found[penalty] = fc.solve(model, fc.Ramp((1.0, 2.0, 3.0, 4.0), ((0.0, 0.0), (1.0, 1.0), (4.0, 1.0))))
    steps = found[1e5]
    first, last = steps[0].contact["pair"], steps[-1].contact["pair"]
    assert first.sticking.any()
    assert np.abs(steps[-1].displacement - steps[0].displacement).max() < 1e-12
    assert last.force == pytest.approx(first.force, rel=1e-9)
    assert last.force == pytest.approx(found[None][-1].contact["pair"].force, rel=0.01)


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
def test_a_penalty_against_an_obstacle(formulation):
    model = elastic_model(fc.generate.block((10.0, 5.0), (4, 2), "quad4"), "plane_strain", LEFT="x", TOP={"y": -0.01})
    floor = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0))
    model.add_obstacle("floor", secondary="BOTTOM", obstacle=floor, formulation=formulation, penalty=1e5)
    contact = fc.solve(model, fc.linear_ramp(1))[-1].contact["floor"]
    assert contact.pressure == pytest.approx(0.01 / (5 * 0.91e-3 + 1e-5), rel=1e-10)


@pytest.mark.parametrize("penalty", [float("nan")])
def test_a_penalty_is_a_positive_number(penalty):
    with pytest.raises(fc.FastcontactError, match=r"penalty.* of contact 'pair'|the penalty of contact 'pair'"):
        touching(held(blocks()), "mortar", penalty=penalty)


TABLE = [(-0.002, 0.0), (0.0, 1.0), (0.002, 4.0), (0.004, 12.0)]
EXPONENTIAL = {"clearance": 0.002, "pressure": 2.0}


def layered(formulation, element, approach, matching=True, penalty=TABLE, tilt=0.0):
    """Press two blocks, the upper one tilted, with a soft layer between them; return the last step."""
    low = fc.generate.block((1.0, 1.0), (4, 4), element=element)
    up = fc.generate.block((1.0, 1.0), (4 if matching else 3, 3), element=element, origin=(0.0, 1.0), name="UP")
    up = fc.generate.renamed(up, {name: "U" + name for name in ("BOTTOM", "TOP", "LEFT", "RIGHT")})
    model = elastic_model(fc.generate.union(low, up), "plane_strain", nu=0.0, BOTTOM="xy", UTOP="x")
    model.prescribe("UTOP", y=lambda x: -approach - tilt * x[:, 0])
    model.add_contact("pair", secondary="UBOTTOM", primary="TOP", formulation=formulation, penalty=penalty)
    return fc.solve(model, 3)[-1]


@pytest.mark.filterwarnings("ignore:contact 'pair' penetrates", "ignore:the energy of these load steps")
@pytest.mark.parametrize(("element", "matching"), [("quad4", True), ("quad4", False), ("quad8", False)])
@pytest.mark.parametrize("approach", [0.001, 0.006, 0.02, 0.03])
def test_a_table_of_pressures(element, matching, approach):
    """Of a pressure p the blocks take p (1 + 1) / E, the layer the rest of the approach, by its table."""
    step = layered("mortar", element, approach, matching)
    overclosures, pressures = np.transpose([*TABLE, (0.014, 52.0)])
    shortenings = overclosures + pressures * 2.0 / 1000.0
    assert step.contact["pair"].pressure == pytest.approx(np.interp(approach, shortenings, pressures), rel=1e-9)
    p = step.contact["pair"].pressure[0]
    parts = np.append(overclosures[pressures < p], np.interp(p, pressures, overclosures))
    layer = np.trapezoid(np.interp(parts, overclosures, pressures), parts)
    assert step.work["penalty_energy"] == pytest.approx(layer, rel=1e-9)


@pytest.mark.filterwarnings("ignore:contact 'pair' penetrates", "ignore:the energy of these load steps")
@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
def test_a_table_of_pressures_in_every_formulation(formulation):
    found, mortar = (layered(name, "quad4", 0.02).contact["pair"].pressure for name in (formulation, "mortar"))
    assert found == pytest.approx(mortar, rel=1e-6)


@pytest.mark.filterwarnings("ignore:contact 'pair' penetrates", "ignore:the energy of these load steps")
@pytest.mark.parametrize(
    ("formulation", "penalty"),
    [("continuous", [(0, 0), (0.002, 2), (0.01, 40)]), *((name, EXPONENTIAL) for name in ("continuous", "mortar"))],
)
def test_laws_under_pressures_that_vary_take_few_pairings(formulation, penalty):
    """Of a table, the interval must not alternate at points whose pressures the field does not represent."""
    step, dual = (layered(name, "quad4", 0.01, False, penalty, 0.02) for name in (formulation, None))
    assert step.iterations["geometry_updates"] <= 5
    assert step.contact["pair"].force[1] == pytest.approx(dual.contact["pair"].force[1], rel=2e-3)


@pytest.mark.parametrize(
    "table", [[(0, 1), (1, 2)], [(0, 0)], [(0, 0), (1, 0)], [(0, 0), (0, 1)], [1.0, 2.0], [(0, 0), (10**400, 1)]]
)
def test_a_wrong_table_is_refused(table):
    model = elastic_model(fc.generate.block(), "plane_strain", E=1.0)
    wall = fc.obstacles.HalfSpace((0.0, 1.0), (0.0, -1.0))
    with pytest.raises(fc.ContactError, match="a number, or a table of overclosures and pressures that both ascend"):
        model.add_obstacle("wall", secondary="TOP", obstacle=wall, penalty=table)


@pytest.mark.filterwarnings("ignore:contact 'pair' penetrates", "ignore:the energy of these load steps")
@pytest.mark.parametrize(("clearance", "p0", "at"), [(0.002, 1.0, 0.5), (0.002, 1.0, -0.5), (0.0005, 1e-5, 3.2)])
def test_an_exponential_law(clearance, p0, at):
    """Pressure p0 exp(h ln(100) / c0) at the overclosure h up to 3 c0, straight on from there."""
    rate, h = np.log(100.0) / clearance, at * clearance
    end = min(h, 3.0 * clearance)
    there = p0 * np.exp(rate * end)
    pressure = there * (1.0 + rate * (h - end))
    step = layered("mortar", "quad4", h + 2.0 * pressure / 1000.0, penalty={"clearance": clearance, "pressure": p0})
    assert step.contact["pair"].pressure == pytest.approx(pressure, rel=1e-8)
    assert step.contact["pair"].gap == pytest.approx(-h, rel=1e-6)
    # A straight line up to a hundredth of the pressure, the exponential, and a straight line again.
    energy = (there - 0.005 * p0) / rate + 0.5 * (h - end) * (pressure + there)
    assert step.work["penalty_energy"] == pytest.approx(energy, rel=1e-8)


@pytest.mark.parametrize(
    ("penalty", "message"),
    [
        ({"clearance": 0.1}, "an exponential penalty of contact 'pair' needs two positive numbers"),
        ({"clearance": 0.1, "pressure": -1.0}, "an exponential penalty of contact 'pair' needs two positive numbers"),
        ({"clearance": 0.1, "pressure": np.nan}, "the pressure in the penalty of contact 'pair'"),
    ],
)
def test_a_wrong_exponential_law_is_refused(penalty, message):
    with pytest.raises(fc.FastcontactError, match=message):
        layered("mortar", "quad4", 0.004, penalty=penalty)


LAST = fc.linear_ramp(1)


def difference(one, other):
    """How much two results differ, in their largest displacement and stress."""
    moved = np.abs(one.displacement - other.displacement).max() / np.abs(other.displacement).max()
    return max(moved, np.abs(one.stress - other.stress).max() / np.abs(other.stress).max())


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("kinematics", ["plane_strain", "axisymmetric", "3d"])
@each
def test_a_clearance_is_a_body_moved_away(formulation, options, kinematics, swap):
    make, upper = (boxes, (3, 2, 2)) if kinematics == "3d" else (blocks, (4, 3))
    sizes = {"upper": upper} if formulation == "mortar" else {}  # of meshes that do not match
    moved = touching(held(make(apart=0.005, **sizes), kinematics, 0.025), formulation, swap, **options)
    clear = touching(held(make(**sizes), kinematics, 0.025), formulation, swap, clearance=0.005, **options)
    one, other = (fc.solve(model, LAST)[-1] for model in (clear, moved))
    assert difference(one, other) < 1e-12
    assert one.contact["pair"].pressure == pytest.approx(other.contact["pair"].pressure, rel=1e-12)
    assert np.abs(one.contact["pair"].gap).max() < 1e-12


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_an_interference_presses_bodies_that_nothing_moves(formulation):
    model = touching(held(blocks(), approach=0.0), formulation, clearance=-0.02)
    pushed = touching(held(blocks(), approach=0.02), formulation)
    one, other = (fc.solve(m, LAST)[-1] for m in (model, pushed))
    assert np.abs(one.stress - other.stress).max() < 1e-12 * np.abs(other.stress).max()
    assert one.contact["pair"].pressure == pytest.approx(1000.0 / 0.91 * 0.02 / 10.0, rel=1e-12)


@pytest.mark.parametrize("kinematics", ["plane_strain", "3d"])
@each
def test_clearances_of_both_sides_add_up(formulation, options, kinematics):
    mesh, both = boxes() if kinematics == "3d" else blocks(), {"clearance": lambda x: 0.01 + 0 * x[:, 0]}
    both["clearance_primary"] = -0.004
    models = [touching(held(mesh, kinematics), formulation, **own, **options) for own in (both, {"clearance": 0.006})]
    assert difference(*(fc.solve(model, LAST)[-1] for model in models)) < 1e-12


@pytest.mark.parametrize("formulation", first_of(1, FORMULATIONS))
def test_a_function_of_position_is_a_profile(formulation):
    """A wedge-shaped clearance is a tilted body, and the primary side's profile counts where it is faced."""

    def wedge(x):
        return 0.001 * x[:, 0]

    lower = blocks(lower=(6, 3), upper=(6, 3))
    tilted = lower.points.copy()
    upper = lower.points_of("UPPER")
    tilted[upper, 1] += 0.001 * tilted[upper, 0]
    options = {"projection_tolerance": 0.5}
    moved = touching(held(lower.replace(points=tilted)), formulation, **options)
    one = fc.solve(touching(held(lower), formulation, clearance=wedge, **options), LAST)[-1]
    two = fc.solve(touching(held(lower), formulation, clearance_primary=wedge, **options), LAST)[-1]
    exact = fc.solve(moved, LAST)[-1]
    assert 0 < np.abs(exact.contact["pair"].pressure).min() < 0.9 * exact.contact["pair"].pressure.max()
    # The tilt itself turns normals by 1e-3 and stretches the body by as much.
    assert difference(one, exact) < 5e-3
    assert difference(one, two) < 2e-3


@pytest.mark.parametrize("clearance", ["clearance", "clearance_primary"])
def test_an_interference_may_grow_over_the_load_steps(clearance):
    ramp = [(0.0, 0.0), (1.0, 1.0), (2.0, 0.0)]
    model = touching(held(blocks(), approach=0.0), "mortar", **{clearance: -0.02}, clearance_ramp=ramp)
    steps = fc.solve(model, fc.Ramp((0.5, 1.0, 1.5, 2.0), ((0.0, 0.0), (2.0, 0.0))))
    largest = [step.contact["pair"].pressure_max for step in steps]
    assert largest[:3] == pytest.approx(np.array([0.5, 1.0, 0.5]) * 1000.0 / 0.91 * 0.02 / 10.0, rel=1e-12)
    assert largest[3] == pytest.approx(0.0, abs=1e-12 * largest[1])
    assert steps[1].work["external_work"] == pytest.approx(steps[1].work["strain_energy"], rel=1e-3)


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
def test_an_obstacle_may_stand_off(formulation):
    forces = []
    for height, options in ((0.004, {}), (0.0, {"clearance": 0.004})):
        model = elastic_model(fc.generate.block((10.0, 5.0), (4, 2), "quad4"), "plane_strain", LEFT="x")
        model.prescribe("TOP", y=-0.02)
        floor = fc.obstacles.HalfSpace((0.0, -height), (0.0, 1.0))
        model.add_obstacle("floor", secondary="BOTTOM", obstacle=floor, formulation=formulation, **options)
        contact = fc.solve(model, LAST)[-1].contact["floor"]
        forces.append(contact.force[1])
        assert np.abs(contact.gap).max() < 1e-12
    assert forces[1] == pytest.approx(forces[0], rel=1e-12)
    assert forces[1] == pytest.approx(1000.0 / 0.91 * 0.016 / 5.0 * 10.0, rel=1e-12)


PRESS, STIFFNESS, MU = 0.05, 300.0, 0.3
# Pressed in the first step, then pushed sideways: 1 at the instant 3, back to 0 at 5.
SIDEWAYS = [(0.0, 0.0), (1.0, 0.0), (3.0, 1.0), (5.0, 0.0)]


def sheared(formulation, sideways, dim=2, penalty=STIFFNESS, **options):
    """The upper block is pressed on the lower one and moved along x; both have nu = 0."""
    mesh = boxes() if dim == 3 else blocks()
    model = elastic_model(mesh, "3d" if dim == 3 else "plane_strain", E=YOUNG, nu=0.0)
    top, bottom, up = ("U_ZMAX", "L_ZMIN", "z") if dim == 3 else ("UPPER_TOP", "LOWER_BOTTOM", "y")
    for axis in "xyz"[:dim]:
        model.fix(bottom, axis)
    if dim == 3:
        model.fix(top, "y")
    model.prescribe(top, ramp=[(0, 0), (1, 1), (5, 1)], **{up: -PRESS})
    model.prescribe(top, ramp=SIDEWAYS, x=sideways)
    groups = ("U_ZMIN", "L_ZMAX") if dim == 3 else ("CONT_UPPER", "CONT_LOWER")
    model.add_contact(
        "pair", secondary=groups[0], primary=groups[1], formulation=formulation, friction=MU,
        **({} if penalty is None else {"tangential_penalty": penalty}), **options,
    )  # fmt: skip
    return model


def solved(model, ramp=(1.0, 2.0, 3.0, 4.0, 5.0), **options):
    criteria = fc.Criteria(keep_pairing=True)  # the sides stay flat and opposite to each other
    return fc.solve(model, fc.Ramp(ramp, ((0.0, 0.0), (5.0, 1.0))), criteria=criteria, **options)


def slip_of(model, step):
    """Relative displacement along x of the nodes that lie opposite to each other on matching meshes (m,)."""
    contact, points = step.contact["pair"], model.mesh.points
    opposite = [
        next(p for p in contact.primary_points if np.allclose(points[p], points[node])) for node in contact.points
    ]
    return step.displacement[contact.points, 0] - step.displacement[opposite, 0]


def areas_of(model):
    """Areas of the secondary nodes (m,), of a uniform pressure on another model."""
    probe = solved(sheared("node_to_segment", 0.0, model.mesh.dim), (1.0,))[-1].contact["pair"]
    return probe.points, probe.force_vectors[:, -1] / (YOUNG * PRESS / 10.0)


@each
@pytest.mark.parametrize("dim", [2, 3])
def test_the_shear_of_what_sticks_is_the_penalty_times_its_slip(formulation, options, dim):
    model = sheared(formulation, 0.004, dim, **options)
    points, areas = areas_of(model)
    for step in solved(model)[1:4]:
        contact = step.contact["pair"]
        assert contact.sticking.all()
        assert abs(contact.dissipation) < 1e-12
        slip = slip_of(model, step)
        assert np.abs(slip).min() > 1e-4
        order = np.argsort(contact.points)
        np.testing.assert_array_equal(contact.points[order], np.sort(points))
        total = -STIFFNESS * (areas[np.argsort(points)] * slip[order]).sum()
        assert contact.force[0] == pytest.approx(total, rel=1e-9 if formulation != "mortar" else 2e-3)
        if formulation == "node_to_segment":
            shear = contact.force_vectors[order, 0] / areas[np.argsort(points)]
            np.testing.assert_allclose(shear, -STIFFNESS * slip[order], rtol=1e-9)


@each
def test_it_lets_go_of_what_it_took_up(formulation, options):
    """Back where it was pushed from, nothing is left: slip within stick is elastic."""
    pressed, *_, back = solved(sheared(formulation, 0.004, **options))
    np.testing.assert_allclose(back.displacement, pressed.displacement, atol=1e-12)
    assert abs(back.contact["pair"].force[0]) < 1e-9 * back.contact["pair"].force[1]


@each
def test_many_steps_end_as_one(formulation, options):
    model = sheared(formulation, 0.004, **options)
    one, many = solved(model, (1.0, 3.0))[-1], solved(model, (1.0, 1.3, 1.5, 2.2, 2.9, 3.0))[-1]
    np.testing.assert_allclose(one.displacement, many.displacement, atol=1e-12)


@each
def test_beyond_the_limit_it_slides_at_the_limit(formulation, options):
    contact = solved(sheared(formulation, 0.2, **options))[2].contact["pair"]
    assert not contact.sticking.any()
    assert contact.force[0] == pytest.approx(-MU * contact.force[1], rel=1e-9)
    assert contact.dissipation > 0


@each
def test_a_stiff_one_is_none(formulation, options):
    exact = solved(sheared(formulation, 0.004, penalty=None, **options))[2]
    errors = [
        np.abs(
            solved(sheared(formulation, 0.004, penalty=penalty, **options))[2].displacement - exact.displacement
        ).max()
        for penalty in (1e5, 1e6)
    ]
    assert errors[1] < 2e-6
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.05)


def test_it_may_vary_along_the_surface():
    def penalty(positions):
        return STIFFNESS * (1.0 + positions[:, 0] / 10.0)

    model = sheared("node_to_segment", 0.004, penalty=penalty)
    step = solved(model)[2]
    contact, (points, areas) = step.contact["pair"], areas_of(model)
    np.testing.assert_array_equal(contact.points, points)
    shear = contact.force_vectors[:, 0] / areas
    np.testing.assert_allclose(shear, -penalty(contact.coordinates) * slip_of(model, step), rtol=1e-9)


def test_supported_nodes_shear_it_too():
    """Where supports move the contact nodes themselves, their slip is known and the shear follows from it."""
    model = sheared("node_to_segment", 0.0)
    model.supports = [
        support for support in model.supports if support.component != 0 or support.group == "LOWER_BOTTOM"
    ]
    supported(model, UPPER={"ramp": SIDEWAYS, "x": 0.004}, LOWER="x")
    np.testing.assert_allclose(solved(model)[2].contact["pair"].shear[:, 0], -STIFFNESS * 0.004, rtol=1e-9)


def test_tractions_of_earlier_files_continue_as_slips():
    """Restart data of earlier versions hold the tangential tractions in place of the elastic slips."""
    model = sheared("node_to_segment", 0.02)
    whole = solved(model)
    begun = solved(model, (1.0, 2.0))
    pair = begun[-1].restart["pairs"]["pair"]
    positions, slips = pair.pop("elastic_slip")
    pair["traction"] = [positions, slips * STIFFNESS]
    assert abs(solved(model, resume=begun)[-1].displacement - whole[-1].displacement).max() < 1e-12
