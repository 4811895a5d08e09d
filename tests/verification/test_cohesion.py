"""Cohesive layers: the exact law, mixed modes, a double cantilever beam, work, restarts, adhesion of a sphere."""

import numpy as np
import pytest
from models import elastic_model, made_of, supported, united, with_contact
from pairwise import first_of
from refusals import refused

import fastcontact as fc

pytestmark = pytest.mark.each_value

STANDARD = {"formulation": "mortar", "multipliers": "standard"}
FORMULATIONS = ({}, STANDARD, {"formulation": "continuous"}, {"formulation": "node_to_segment"})
STRENGTH, ENERGY, STIFFNESS, E = 10.0, 0.5, 1000.0, 1000.0
ONSET, END = STRENGTH / STIFFNESS, 2.0 * ENERGY / STRENGTH


def glued(element="quad4", motion=None, E=E, **options):
    """Return two blocks of 2 (by 2) by 1, glued; the top is moved, by 1 upwards, or by a motion over a wider lower block."""
    make = fc.generate.box if element == "hex8" else fc.generate.block
    bottom, top, axes = ("ZMIN", "ZMAX", "xyz") if element == "hex8" else ("BOTTOM", "TOP", "xy")
    size, divisions = ((2.0, 2.0, 1.0), (2, 2, 1)) if element == "hex8" else ((2.0, 1.0), (3, 1))
    origin = (0.0,) * (len(size) - 1)
    lower = make(size, divisions, element, (*origin, 0.0), name="A")
    if motion:
        lower = make((4.0, 1.0), (6, 1), element, (-1.0, 0.0), name="A")
    mesh = united(**{"A ": lower, "B ": make(size, divisions, element, (*origin, 1.0), name="B")})
    model = elastic_model(mesh, "3d" if element == "hex8" else "plane_strain", E=E, nu=0.0)
    supported(model, **{f"A {bottom}": axes, f"B {top}": {**dict.fromkeys(axes, 0.0), **(motion or {axes[-1]: 1.0})}})
    law = {"strength": STRENGTH, "energy": ENERGY, "stiffness": STIFFNESS, **options.pop("law", {})}
    return with_contact(model, "glue", f"B {bottom}", f"A {top}", cohesion=law, **options)


PATH = fc.Ramp(
    tuple(range(1, 8)), ((0, 0), (1, 0.02), (2, 0.04), (3, 0.08), (4, 0.04), (5, -0.02), (6, 0.09), (7, 0.14))
)


def exact(moved, damage):
    """Return traction, opening and damage of a layer between two blocks in series with it: stiffness E / 2."""
    K = 0.5 * E
    stiffness = STIFFNESS if moved < 0.0 else (1.0 - damage) * STIFFNESS
    opening = K * moved / (K + stiffness)
    reached = END * ONSET / (END - damage * (END - ONSET))  # the largest opening so far
    if opening > reached:
        slope = STRENGTH / (END - ONSET)
        opening = min((K * moved - slope * END) / (K - slope), moved)
        opening = moved if opening >= END else opening
        damage = min(END * (opening - ONSET) / (opening * (END - ONSET)), 1.0)
        stiffness = (1.0 - damage) * STIFFNESS
    return stiffness * opening, opening, damage


@pytest.mark.parametrize("element", ["quad4", "quad8", "hex8"])
@pytest.mark.parametrize("options", FORMULATIONS)
def test_the_law_is_traced_exactly(options, element):
    """Up, down along the secant, pressed, up again to the break: tractions, openings, damage and works to round-off."""
    damage, area = 0.0, 4.0 if element == "hex8" else 2.0
    for step, moved in zip(fc.solve(glued(element, **options), PATH), (0.02, 0.04, 0.08, 0.04, -0.02, 0.09, 0.14)):
        traction, opening, damage = exact(moved, damage)
        contact = step.contact["glue"]
        assert abs(contact.force[-1] + area * traction) < 1e-9 * area * STRENGTH
        assert np.abs(contact.gap - opening).max() < 1e-11
        assert np.abs(contact.damage - damage).max() < 1e-9
        assert np.abs(contact.pressure + traction).max() < 1e-8 * STRENGTH
        taken = 0.5 * STRENGTH * END * (1.0 if damage == 1.0 else damage * ONSET / (END - damage * (END - ONSET)))
        assert abs(step.work["energy_released"] - area * taken) < 1e-9
        assert abs(step.work["penalty_energy"] - 0.5 * area * abs(traction * opening)) < 1e-9
    assert damage == 1.0


@pytest.mark.parametrize("element", ["quad4", "quad8", "hex8"])
@pytest.mark.parametrize("options", FORMULATIONS)
def test_a_layer_below_a_frictional_obstacle_does_not_depend_on_the_order_of_pairs(options, element):
    """A plate presses the blocks by 0.02 and slides along them."""
    axis, top, area = ("z", "B ZMAX", 4.0) if element == "hex8" else ("y", "B TOP", 2.0)
    for first in ("glue", "plate"):
        model = glued(element, **options)
        model.supports.pop()  # of the top
        down = -np.eye(model.mesh.dim)[-1]
        plane, motion = fc.obstacles.HalfSpace(-2.0 * down, down), {"x": 0.05, axis: -0.02}
        model.add_obstacle("plate", secondary=top, obstacle=plane, motion=motion, friction=0.1)
        model.contact.sort(key=lambda pair: pair.name != first)
        force, pressing = fc.solve(model, 1)[-1].contact["plate"].force, -area * exact(-0.02, 0.0)[0]
        assert (force[0], force[-1]) == pytest.approx((0.1 * pressing, -pressing), rel=1e-9)


@pytest.mark.parametrize("options", FORMULATIONS)
def test_a_clearance_with_a_ramp_opens_a_layer_as_a_motion_does(options):
    """A constant clearance belongs to the initial gap, at which the layer is free of stress."""
    model = glued(clearance=1.0, clearance_ramp=PATH.table, **options)
    damage = 0.0
    for step, moved in zip(fc.solve(model, fc.Ramp(PATH.instants, ((0, 0), (7, 0)))), (0.02, 0.04, 0.08, 0.04, -0.02)):
        traction, opening, damage = exact(moved, damage)
        assert abs(step.contact["glue"].force[-1] + 2.0 * traction) < 2e-9 * STRENGTH
        assert np.abs(step.contact["glue"].gap - opening).max() < 1e-11
    unmoved = fc.solve(glued(clearance=-0.3, **options), fc.Ramp((1,), ((0, 0), (1, 0))))[-1]
    assert np.abs(unmoved.contact["glue"].pressure).max() < 1e-9
    assert not unmoved.warnings


@pytest.mark.parametrize("angle", [0.0, 30.0, 60.0, 90.0])
def test_mixed_modes_take_the_energy_of_benzeggagh_and_kenane(angle):
    """Between stiff blocks: the largest traction and the energy at break, by the ratio of opening and sliding."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    law = {"shear_strength": 16.0, "shear_energy": 1.2, "exponent": 1.5}
    model = glued(motion={"x": s, "y": c}, E=1e9, law=law)
    share = (s**2) ** 1.5
    energy = ENERGY + (1.2 - ENERGY) * share
    strength = np.sqrt(STRENGTH**2 + (16.0**2 - STRENGTH**2) * share)
    onset, end = strength / STIFFNESS, 2.0 * energy / strength
    at = np.array([0.5 * onset, onset, 0.5 * (onset + end), 0.99 * end, 1.1 * end])
    steps = fc.solve(model, fc.Ramp((1, 2, 3, 4, 5), ((0, 0), *zip(range(1, 6), at))))
    expected = np.where(at < onset, STIFFNESS * at, np.maximum(strength * (end - at) / (end - onset), 0.0))
    for step, traction in zip(steps, expected):
        force = step.contact["glue"].force
        assert np.abs(force + 2.0 * traction * np.array([s, c])).max() < 1e-5 * strength
    assert abs(steps[-1].work["energy_released"] / (2.0 * energy) - 1.0) < 1e-6  # the blocks give way by as much


@pytest.mark.filterwarnings("ignore:.*in steps of|.*bends")
@pytest.mark.parametrize(
    ("law", "deviation"), [({"strength": 10.0}, 0.01), ({"strength": 30.0, "stiffness": 1e6}, 0.03)]
)
@pytest.mark.parametrize("options", [{}, *(pytest.param(own, marks=pytest.mark.slow) for own in FORMULATIONS[1:])])
def test_a_double_cantilever_beam_follows_beam_theory(options, law, deviation):
    """P = sqrt(G E I) / l and d = 2 P l^3 / (3 E I), per width, once the crack runs (Williams, 1989); elastic before."""
    n, h, a, E, G = 70, 1.5, 30.0, 120e3, 0.26
    upper, lower = (fc.generate.block((70.0, h), (n, 1), "quad8", (0.0, y), name="BEAM") for y in (0.0, -h))
    mesh = united(**{"UP ": upper, "LOW ": lower})
    mesh = mesh.with_facet_group("GLUE", lambda x: (np.abs(x[:, 1]) < 1e-9) & (x[:, 0] > a - 1e-9), of="UP BEAM")
    model = elastic_model(mesh, "plane_stress", E=E, nu=0.0)
    supported(model, **{"UP TOP_LEFT": {"y": 2.0}, "LOW BOTTOM_LEFT": {"y": -2.0}})
    for corner in ("UP BOTTOM_RIGHT", "LOW TOP_RIGHT"):
        model.fix(corner, "xy")
    model.add_contact("glue", secondary="GLUE", primary="LOW TOP", cohesion={"energy": G, **law}, **options)
    steps = fc.solve(model, 5, criteria=fc.Criteria(max_geometry_updates=100))
    assert sum(step.iterations["geometry_updates"] for step in steps) < 200  # 353 if round-off of openings mattered
    pull = [step.reaction[mesh.points_of("UP TOP_LEFT"), 1].sum() for step in steps]
    inertia, opened = h**3 / 12.0, 4.0
    length = np.sqrt(1.5 * E * inertia * opened / np.sqrt(G * E * inertia))
    assert abs(pull[-1] / (np.sqrt(G * E * inertia) / length) - 1.0) < deviation
    released = steps[-1].work["energy_released"]
    contact = steps[-1].contact["glue"]
    broken = contact.coordinates[contact.damage >= 1.0, 0].max() - a
    assert G * broken < released < G * (broken + 12.0)  # the rest is in the zone of partial damage
    external = np.trapezoid([0.0, *pull], np.linspace(0.0, opened, 6))
    assert abs(steps[-1].work["external_work"] / external - 1.0) < 0.02


@pytest.mark.parametrize("formulation", first_of(1, ["node_to_segment", "continuous"]))
def test_a_ball_is_pulled_off_with_the_force_of_johnson_kendall_and_roberts(formulation):
    """3/2 pi w R to 3 % with Maugis's parameter 3, at an approach of -a^2 / (3 R); Proc. R. Soc. A 324, 1971, eq. 23."""
    R, a = 1.0, 0.05
    w = 8.0 * a**3 / (9.0 * np.pi)
    strength = 3.0 / (4.5 * R / (np.pi * w)) ** (1.0 / 3.0)
    mesh = fc.generate.graded_block("quad4", width=1.0, contact_radius=0.08, contact_size=1e-3)
    model = elastic_model(mesh, "axisymmetric", E=1.0, nu=0.0, BOTTOM="xy")
    model.add_obstacle(
        "ball", secondary="TOP", obstacle=fc.obstacles.Sphere((0.0, R), R), motion={"y": a**2},
        adhesion={"work": w, "strength": strength}, formulation=formulation,
    )  # fmt: skip
    ramp = fc.Ramp((1, 2, 3, 4, 5), ((0, 0), (1, -0.2), (2, 0.25), (3, 0.3), (4, 0.35), (5, 1.5)))
    steps = fc.solve(model, ramp, criteria=fc.Criteria(max_geometry_updates=400))
    pulls = [step.contact["ball"].force[1] for step in steps]
    assert abs(max(pulls) / (1.5 * np.pi * w * R) - 1.0) < 0.03
    assert pulls[-1] == 0.0


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous", "mortar"])
def test_adhering_blocks_are_as_stiff_in_compression_as_one(formulation):
    lower, upper = (
        fc.generate.block((1.0, 1.0), (2, 2), origin=(0.0, y), name=name) for name, y in (("A", 0.0), ("B", 1.0))
    )
    mesh = united(A=lower, B=upper)
    model = elastic_model(mesh, "plane_stress", E=210e3, nu=0.0, ABOTTOM="xy", BTOP={"x": 0.0, "y": -1e-4})
    law = {"work": 0.02, "strength": 1.0}
    model.add_contact("pair", secondary="BBOTTOM", primary="ATOP", adhesion=law, formulation=formulation)
    assert fc.solve(model, 1)[-1].contact["pair"].normal_force == pytest.approx(10.5, rel=0.01)


def test_adhesion_on_facets_longer_than_its_reach_tells_it():
    model = elastic_model(fc.generate.block((1.0, 1.0), (8, 8), origin=(0.0, -1.0)), "axisymmetric", E=1.0, nu=0.0)
    model.fix("BOTTOM", "xy")
    ball, law = fc.obstacles.Sphere((0.0, 1.0), 1.0), {"work": 3.5e-5, "strength": 0.1}
    model.add_obstacle("ball", secondary="TOP", obstacle=ball, motion={"y": -1e-3}, adhesion=law)
    criteria = fc.Criteria(max_geometry_updates=1)
    with pytest.raises(fc.ConvergenceError, match=r"facets no longer than the range of adhesion, 0\.0007, .* 'ball'"):
        fc.solve(model, 1, criteria=criteria)
    model.contact.clear()
    model.add_obstacle("ball", secondary="TOP", obstacle=ball, motion={"y": -1e-3}, adhesion={**law, "work": 1e-3})
    with pytest.warns(fc.FastcontactWarning, match="'ball' are 6.25 times as long as the range of adhesion, 0.02"):
        fc.solve(model, 1)


def test_what_is_refused():
    for options, culprit in (
        ({"law": {"strength": -1.0}}, "must be positive"),
        ({"law": {"stiffness": 50.0}}, "must be above 100"),
        ({"law": {"toughness": 1.0}}, "toughness"),
        ({"law": {"initiation": "none"}}, "unknown initiation in the cohesion of contact 'glue' 'none'"),
        ({"friction": 0.3}, "friction"),
        ({"kind": "tied"}, "kind"),
        ({"adhesion": {"work": 1.0, "strength": 1.0}}, "adhesion"),
    ):
        refused(fc.ContactError, culprit, glued, **options)
    model = glued()
    refused(fc.ContactError, "keep_pairing", fc.solve, model, 1, criteria=fc.Criteria(keep_pairing=True))
    model.materials.clear()
    model.add_material(fc.LinearElastic(E=1.0, nu=0.0, density=1.0))
    refused(fc.ModelError, "cohesion", fc.modes, model, n=1)


def sheared_strips(layer, pressed=0.0, element="quad4", swap=False, angle=0.0, divisions=12, solver="direct"):
    """Two strips of 60 by 3 (by 4) with a layer between them, drawn along it; all nodes are held along its normal."""
    places = ((12, 0), (divisions, -3))
    if element == "hex8":
        strips = [fc.generate.box((60.0, 4.0, 3.0), (n, 1, 1), element, (0.0, 0.0, z), name="BODY") for n, z in places]
    else:
        strips = [fc.generate.block((60.0, 3.0), (n, 1), element, (0.0, y), name="BODY") for n, y in places]
    mesh = united(UP_=strips[0], LO_=strips[1])
    left, right, bottom, top = ("LEFT", "RIGHT", "BOTTOM", "TOP") if mesh.dim == 2 else ("XMIN", "XMAX", "ZMIN", "ZMAX")
    axes, across = np.eye(3), "xyz"[mesh.dim - 1]
    if mesh.dim == 2:
        mesh, (c, s) = (
            fc.generate.transformed(mesh, rotate=angle),
            (np.cos(np.radians(angle)), np.sin(np.radians(angle))),
        )
        axes = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    model = elastic_model(mesh, "plane_stress" if mesh.dim == 2 else "3d", E=70e3, nu=0.0)
    model.prescribe("UP_BODY", axes=axes, **{across: -pressed})
    model.fix("LO_BODY", across, axes=axes)
    model.prescribe(f"UP_{left}", axes=axes, x=-0.02)
    model.fix(f"LO_{right}", "x", axes=axes)
    if mesh.dim == 3:
        supported(model, UP_BODY="y", LO_BODY="y")
    sides = (f"LO_{top}", f"UP_{bottom}") if swap else (f"UP_{bottom}", f"LO_{top}")
    model.add_contact("layer", secondary=sides[0], primary=sides[1], **layer)
    (step,) = fc.solve(model, 1, linear_solver=solver)
    contact, axes = step.contact["layer"], axes[: mesh.dim, : mesh.dim]
    drawn, up = (axes @ step.reaction[mesh.points_of(group)].sum(axis=0) for group in (f"UP_{left}", "UP_BODY"))
    force = (-1.0 if swap else 1.0) * axes @ contact.force
    place, shear, area = contact.coordinates @ axes[0], contact.shear @ axes[0], 5.0 if mesh.dim == 2 else 10.0
    integral = area * abs((shear * np.where(np.abs(place - 30.0) > 29.0, 0.5, 1.0)).sum())
    return step.warnings, drawn[0], up[-1], force, integral, contact


STRIPS = ({}, {"swap": True}, {"angle": 30.0}, {"element": "hex8"}, {"divisions": 17}, {"solver": "amg"})


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("case", [*STRIPS, {"pressed": -0.005}, {"pressed": 0.002}])
def test_a_layer_in_shear_whose_nodes_are_held_along_its_normal_has_tractions(formulation, case):
    law = {"strength": 20.0, "energy": 0.8, "stiffness": 25e3}
    told, drawn, up, force, integral, contact = sheared_strips({"cohesion": law, **formulation}, **case)
    assert not any("undetermined" in text for text in told)
    assert contact.active.all()
    assert force[0] == pytest.approx(-drawn, rel=1e-8)
    width, pressed = 4.0 if case.get("element") == "hex8" else 1.0, case.get("pressed", 0.0)
    assert force[0] > 100.0 * width  # of 140 for a rigid layer
    assert integral == pytest.approx(force[0], rel=0.03)
    assert up == pytest.approx(-force[-1], rel=1e-8, abs=1e-8)
    if pressed > 0.0:  # the sides slide a little past their ends
        assert up == pytest.approx(-25e3 * pressed * 60.0, rel=1e-4)
    elif pressed < 0.0:
        assert up > 1000.0


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("case", STRIPS)
def test_a_penalty_carries_pressure_and_friction_where_supports_prescribe_its_penetration(formulation, case):
    layer = {"penalty": [(0.0, 0.0), (1.0, 1e4)], "friction": 0.3, **formulation}
    told, drawn, up, force, integral, contact = sheared_strips(layer, pressed=0.005, **case)
    assert not any("undetermined" in text or "carries nothing" in text for text in told)
    width = 4.0 if case.get("element") == "hex8" else 1.0
    assert force[-1] == pytest.approx(50.0 * 60.0 * width, rel=1e-4)
    assert up == pytest.approx(-force[-1], rel=1e-8)
    assert contact.pressure == pytest.approx(50.0, rel=1e-3)
    assert force[0] == pytest.approx(-drawn, rel=1e-8)
    assert integral == pytest.approx(force[0], rel=0.03)
    assert 100.0 * width < force[0] < 140.0 * width


@pytest.mark.filterwarnings("ignore:.*coincide with|.*rotat|.*bends")
@pytest.mark.parametrize("options", FORMULATIONS)
@pytest.mark.parametrize("case", ["upper", "lower", "turned", "finite", "3d"])
def test_an_end_loaded_split_grows_as_linear_elastic_fracture_mechanics_predicts(options, case):
    """Delamination in mode II of a cantilever with deflected arms; both arms are clamped at the other end.

    Williams (1989) adds 0.42 chi h to the crack, with chi = 0.677 for these arms: J. Strain Analysis 24, 207-214.
    """
    E, h, a0, L, energy, deflection = 70e3, 3.0, 60.0, 100.0, 0.8, 12.0
    if case == "3d":
        arms = [fc.generate.box((L, 2.0, h), (50, 1, 2), "hex8", (0.0, 0.0, z), name="BODY") for z in (0.0, -h)]
        right = "XMAX"
    else:
        arms = [fc.generate.block((L, h), (50, 2), "quad8", (0.0, y), name="BODY") for y in (0.0, -h)]
        right = "RIGHT"
    mesh = united(UP_=arms[0], LO_=arms[1])
    x, across = mesh.points[:, 0], mesh.dim - 1
    ends = np.flatnonzero((x == 0.0) & (np.abs(mesh.points[:, across]) == h))
    mesh = mesh.with_groups(points={"ENDS": ends})

    def glued(X):
        return (np.abs(X[:, across]) < 1e-9) & (X[:, 0] > a0 - 1e-9)

    for body in ("UP", "LO"):
        mesh = mesh.with_facet_group(f"{body}_GLUE", glued, of=f"{body}_BODY")
    axes = np.eye(3)
    if case == "turned":
        mesh, (c, s) = fc.generate.transformed(mesh, rotate=30.0), (np.cos(np.pi / 6), np.sin(np.pi / 6))
        axes = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])
    strain = "finite" if case == "finite" else "small"
    elastic = fc.LinearElastic(E=E, nu=0.0, incompatible_modes=case == "3d")
    model = made_of(mesh, "3d" if case == "3d" else "plane_stress", elastic, strain)
    model.prescribe("ENDS", axes=axes, **{"xyz"[across]: -deflection})
    supported(model, **{f"{body}_{right}": "xyz"[: mesh.dim] for body in ("UP", "LO")})
    sides = ("LO_GLUE", "UP_GLUE") if case == "lower" else ("UP_GLUE", "LO_GLUE")
    law = {"strength": 15.0, "energy": 0.3, "shear_strength": 20.0, "shear_energy": energy}
    model.add_contact("glue", secondary=sides[0], primary=sides[1], cohesion=law, **options)
    before, after = fc.solve(model, [0.2, 0.6])
    width = 2.0 if case == "3d" else 1.0
    loads = [-(step.reaction[ends] @ axes[across, : mesh.dim]).sum() / width for step in (before, after)]
    a = np.linspace(a0, 0.9 * L, 301) + 0.42 * 0.677 * h
    assert loads[0] == pytest.approx(0.2 * deflection * 2.0 * E * h**3 / (3.0 * a[0] ** 3 + L**3), rel=0.04)
    growing = np.sqrt(4.0 * energy * E * h**3 / 9.0) / a  # load per width at each length of the crack
    deflections = growing * (3.0 * a**3 + L**3) / (2.0 * E * h**3)
    assert deflections[0] < 0.5 * deflection
    assert loads[1] == pytest.approx(np.interp(0.6 * deflection, deflections, growing), rel=0.02)
    damage = after.contact["glue"].damage
    assert 0.1 < (damage > 0.999).mean() < 0.6
