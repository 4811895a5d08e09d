"""Sensitivities compared with differences of solutions, in every formulation, dimension and kind of parameter."""

import functools
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
from models import elastic_model, made_of, supported, united, with_contact, with_obstacle
from refusals import refused

import fastcontact as fc

TIGHT = fc.Criteria(relative=1e-10)
Make = Callable[..., fc.Model]
# By name of a change: the parameter, where it stands, and how far solutions lie apart.
Changes = Mapping[str, tuple[tuple, float, float]]
STEEL: Changes = {"E": (("E", 0), 1000.0, 0.1), "nu": (("nu", 0), 0.3, 3e-5)}


def measured(model: fc.Model, step: fc.StepResult, quantity: tuple, node: int) -> float:
    """Return the quantity from the results as users read them."""
    kind, place = quantity[0], quantity[1]
    axis = "xyz".find(str(quantity[-1]))
    if kind == "displacement":
        return float(step.displacement[place, axis])
    if kind == "reaction":
        return float(step.reaction[model.mesh.points_of(place), axis].sum())
    if kind == "contact_force":
        return float(step.contact[place].force[axis])
    return float(step.contact[place].pressure[node])


class Comparison(NamedTuple):
    """The largest difference between sensitivities and finite differences over the largest share, and the last of them."""

    error: float
    found: fc.Sensitivities


def compare(make: Make, quantities: list[tuple], changes: Changes, **options) -> Comparison:
    """Compare sensitivities of quantities with finite differences of fourth order.

    All parameters move at once, so that four solutions serve all of them; each has its share of the sum, which none hides.
    """
    model, solve, errors = make(), {"criteria": TIGHT, **options}, []
    step = fc.solve(model, 1, **solve)[-1]
    others = [make(**{name: at + place * by for name, (_, at, by) in changes.items()}) for place in (-2, -1, 1, 2)]
    moved = [(other, fc.solve(other, 1, **solve)[-1]) for other in others]
    parameters, steps = [change[0] for change in changes.values()], [change[2] for change in changes.values()]
    for quantity in quantities:
        found = fc.sensitivities(model, step, quantity, parameters, ramp=1, **solve)
        node = step.contact[quantity[1]].pressure.argmax() if quantity[0] == "pressure_max" else 0
        assert found.value == pytest.approx(measured(model, step, quantity, node), rel=1e-9)
        values = [measured(other, last, quantity, node) for other, last in moved]
        difference = (8.0 * (values[2] - values[1]) - (values[3] - values[0])) / 12.0
        shares = np.array([found.derivatives[parameter] for parameter in parameters]) * steps
        sizes = np.abs(shares)
        assert ((sizes > 1e-3 * sizes.max()) | (sizes < 1e-9 * sizes.max())).all(), (quantity, shares)
        errors.append(abs(shares.sum() - difference) / max(sizes.max(), abs(difference)))
    return Comparison(max(errors), found)


def two_blocks(element: str = "quad4", kinematics: str = "plane_strain", press: bool = False, **options) -> Make:
    """A block on a wider one, their nodes in different places."""
    lower, upper = (
        {"size_lower": (4.0, 2.0), "divisions_lower": (8, 4)},
        {"size_upper": (2.2, 1.5), "divisions_upper": (5, 3)},
    )
    mesh = fc.generate.block_on_block(element, shift=0.83, **lower, **upper)

    def make(E=1000.0, nu=0.3, load=1.0, moved=1.0, clearance=0.0):
        model = fc.Model(mesh, kinematics=kinematics)
        model.add_material(fc.LinearElastic(E=E, nu=nu), "LOWER")
        model.add_material(fc.LinearElastic(E=2500.0, nu=0.22), "UPPER")
        model.fix("LOWER_BOTTOM", "xy")
        if press:
            model.fix("UPPER_TOP_LEFT", "x")  # it may turn: contact alone holds it
            model.add_pressure("UPPER_TOP", lambda x: load * (10.0 + 3.0 * x[:, 0]))
        else:
            model.prescribe("UPPER_TOP", x=0.01, y=-0.05 * moved)
        own = dict(options) if options.get("kind") == "tied" else {"clearance": clearance, **options}
        return with_contact(model, "c", "CONT_UPPER", "CONT_LOWER", **own)

    return make


# Poisson's ratio enters as Young's modulus does: it is tried where bodies are held otherwise, below.
MOVED: Changes = {"E": STEEL["E"], "moved": (("prescribed", "UPPER_TOP", "y"), 1.0, 1e-4)}
CLEAR = (("clearance", "c"), 0.0, 1e-5)


@pytest.mark.each_value
@pytest.mark.parametrize("element", ["quad4", "tri6"])
@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous", "mortar"])
def test_every_formulation_between_bodies(formulation, element):
    make = two_blocks(element, formulation=formulation, **({"multipliers": "dual"} if formulation == "mortar" else {}))
    error, found = compare(make, [("contact_force", "c", "y"), ("pressure_max", "c")], {**MOVED, "clearance": CLEAR})
    assert error < 1e-6
    assert 1 < found.solutions < 20  # the geometry moves


def spheres(mesh, E=20_000.0, nu=0.3, moved=1.0, **options):
    model = made_of(
        mesh, "axisymmetric", {"SPHHAU": fc.LinearElastic(E=E, nu=nu), "SPHBAS": fc.LinearElastic(E=30_000.0, nu=0.2)}
    )
    supported(model, A1A2="x", A2B2={"y": [(0.5, -0.7 * moved), (1.0, -moved)]}, A1B1={"y": 1.0})
    return with_contact(model, "hertz", "CONT1", "CONT2", **options)


def test_axisymmetric_spheres():
    make = functools.partial(spheres, fc.generate.half_spheres(size=10.0))
    changes = {
        "E": (("E", "SPHHAU"), 20_000.0, 2.0),
        "nu": (("nu", "SPHHAU"), 0.3, 3e-5),
        "moved": (("prescribed", "A2B2"), 1.0, 1e-4),
    }
    assert compare(make, [("reaction", "A2B2", "y"), ("pressure_max", "hertz")], changes).error < 1e-6


SOLVERS = [pytest.param("direct", 0.72, "mortar", marks=pytest.mark.slow), ("amg", 0.72, "mortar")]


@pytest.mark.parametrize(("solver", "y", "formulation"), [*SOLVERS, ("auto", 2.0, "continuous")])  # the last overhangs
def test_in_space_with_factors_and_with_a_hierarchy(solver, y, formulation):
    lower = fc.generate.box((4.0, 4.0, 2.0), (4, 4, 1))
    mesh = united(L=lower, U=fc.generate.box((2.2, 2.4, 1.5), (2, 3, 1), "hex8", (0.83, y, 2.0)))

    def make(E=1000.0, nu=0.3, moved=1.0, clearance=0.0):
        model = made_of(mesh, "3d", {"LBOX": fc.LinearElastic(E=E, nu=nu), "UBOX": fc.LinearElastic(E=2500.0, nu=0.22)})
        supported(model, LZMIN="xyz", UZMAX={"x": 0.01, "y": 0.004, "z": -0.05 * moved})
        sides = {"secondary": "UZMIN", "primary": "LZMAX"}
        return with_contact(model, "c", **sides, clearance=clearance, formulation=formulation)

    changes = {"nu": STEEL["nu"], "moved": (("prescribed", "UZMAX", "z"), 1.0, 1e-4)}
    if solver == "direct":
        changes["clearance"] = CLEAR
    assert (
        compare(make, [("contact_force", "c", "z"), ("pressure_max", "c")], changes, linear_solver=solver).error < 1e-6
    )


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous", "mortar"])
def test_derivatives_of_newtons_method_and_differences_of_each_point_give_the_same(monkeypatch, formulation):
    from fastcontact.analysis.sensitivity import moving_contact

    model, pairings, pair_surfaces = two_blocks("tri6", formulation=formulation)(), [], moving_contact.pair_surfaces
    step = fc.solve(model, 1, criteria=TIGHT)[-1]
    monkeypatch.setattr(moving_contact, "pair_surfaces", lambda *given: pairings.append(1) or pair_surfaces(*given))

    def found():
        return fc.sensitivities(model, step, ("pressure_max", "c"), [("E", 0), ("nu", 1)], ramp=1, criteria=TIGHT)

    together = found()
    assert (len(pairings) < 10) == (formulation != "mortar")  # or one pairing for each side of each group of points
    for name, alone, within in (("_is_consistent", lambda *_: False, 1e-9), ("_linearised", [], 1e-8)):
        monkeypatch.setattr(moving_contact.MovingContact, name, alone)
        for parameter, value in found().derivatives.items():
            assert together.derivatives[parameter] == pytest.approx(value, rel=within)


def test_bodies_held_by_contact_alone():
    loaded = {**STEEL, "load": (("load", "UPPER_TOP"), 1.0, 1e-5), "clearance": (("clearance", "c"), 0.0, 1e-4)}
    make = two_blocks(press=True)
    corner = int(make().mesh.points_of("UPPER_TOP_RIGHT")[0])
    assert compare(make, [("pressure_max", "c"), ("displacement", corner, "y")], loaded).error < 1e-6


LAWS = [[(0.0, 0.0), (0.005, 10.0), (0.02, 200.0)], {"clearance": 0.02, "pressure": 5.0}]
CONTINUOUS = [{"penalty": law, "formulation": "continuous"} for law in LAWS]


@pytest.mark.filterwarnings("ignore:contact 'c' penetrates by")
@pytest.mark.each_value
@pytest.mark.parametrize("options", [{"kind": "tied"}, {"kind": "bilateral"}, {"penalty": 1e5}, *CONTINUOUS], ids=str)
@pytest.mark.parametrize(("element", "kinematics"), [("quad4", "plane_strain"), ("tri6", "plane_stress")])
def test_other_kinds_of_contact(element, kinematics, options):
    assert compare(two_blocks(element, kinematics, **options), [("reaction", "UPPER_TOP", "y")], MOVED).error < 1e-6


def test_pairing_that_is_kept_takes_one_solution():
    criteria = fc.Criteria(relative=1e-10, keep_pairing=True)
    error, found = compare(two_blocks(), [("pressure_max", "c")], MOVED, criteria=criteria)
    assert error < 1e-6
    assert found.solutions == 1
    by = ("prescribed", "UPPER_TOP", "y")
    moving = asked(two_blocks()(), parameters=[by])
    assert abs(found.derivatives[by] / moving.derivatives[by] - 1.0) > 1e-3  # what the moving geometry makes


@pytest.mark.filterwarnings("ignore:contact 'ball'. facets of 'TOP' and of the other side deviate")
@pytest.mark.each_value
@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous", "mortar"])
@pytest.mark.parametrize("kinematics", ["plane_strain", "axisymmetric", "3d"])
def test_rigid_obstacles_that_are_moved_and_pushed(kinematics, formulation):
    dim = 3 if kinematics == "3d" else 2
    up, top, bottom = ("z", "ZMAX", "ZMIN") if dim == 3 else ("y", "TOP", "BOTTOM")
    mesh = fc.generate.box((10.0, 10.0, 5.0), (5, 5, 2)) if dim == 3 else fc.generate.block((10.0, 5.0), (10, 5))
    centre = {"plane_strain": (4.3, 13.0), "axisymmetric": (0.0, 13.0), "3d": (3.3, 4.1, 13.0)}[kinematics]

    def make(pushed=False, E=1000.0, nu=0.3, motion=1.0, force=1.0):
        model = elastic_model(mesh, kinematics, E=E, nu=nu, **{bottom: "xyz"[:dim]})
        across = {} if kinematics == "axisymmetric" else {"motion": {"x": 0.1 * motion}}
        driving = {"force": {up: -60.0 * force}, **across} if pushed else {"motion": {up: -0.3 * motion}}
        ball = fc.obstacles.Sphere(centre=centre, R=8.0)
        return with_obstacle(model, "ball", top, ball, formulation=formulation, **driving)

    moved = {"nu": STEEL["nu"], "motion": (("motion", "ball"), 1.0, 1e-6)}
    assert compare(make, [("contact_force", "ball", up)], moved).error < 1e-6

    def pushed(**changes):
        return make(True, **changes)

    changes = {"E": (("E", 0), 1000.0, 1.0), "force": (("load", "ball"), 1.0, 1e-5)}
    if kinematics != "axisymmetric":
        changes["motion"] = ("motion", "ball"), 1.0, 2e-3 if dim == 3 else 1e-4
    assert compare(pushed, [("pressure_max", "ball")], changes).error < 2e-6


@pytest.mark.each_value
@pytest.mark.parametrize("secondary", ["INNER", "OUTER"])
@pytest.mark.parametrize("multipliers", ["dual", "standard"])
@pytest.mark.parametrize("angle", [0.0, 30.0])
def test_sides_that_end_in_planes_of_symmetry(angle, multipliers, secondary):
    rings = fc.generate.rings("quad8", divisions_inner=(3, 8), divisions_outer=(4, 11))
    mesh, other = fc.generate.transformed(rings, rotate=angle), {"INNER": "OUTER", "OUTER": "INNER"}[secondary]

    def make(E=210e3, load=1.0, clearance=-0.02):
        model = fc.Model(mesh, kinematics="plane_strain")
        model.add_material(fc.LinearElastic(E=E, nu=0.3), "INNER")
        model.add_material(fc.LinearElastic(E=70e3, nu=0.33), "OUTER")
        supported(model, SYMMETRY_X={"normal" if angle else "x": 0.0}, SYMMETRY_Y={"normal" if angle else "y": 0.0})
        model.add_pressure("BORE", 20.0 * load)
        sides = {"secondary": f"CONT_{secondary}", "primary": f"CONT_{other}"}
        options = {"clearance": clearance, "formulation": "mortar", "multipliers": multipliers}
        return with_contact(model, "c", **sides, **options)

    changes = {
        "E": (("E", "INNER"), 210e3, 210.0),
        "load": (("load", "BORE"), 1.0, 1e-3),
        "clearance": (("clearance", "c"), -0.02, 2e-5),
    }
    assert compare(make, [("pressure_max", "c")], changes).error < 1e-6


@pytest.mark.filterwarnings("ignore:.*integration points of complete facets")
def test_heat_normals_and_loads_by_volume():
    mesh = fc.generate.rings("quad8", divisions_inner=(2, 5), divisions_outer=(2, 6))

    def make(E=2e5, nu=0.3, moved=1.0, expansion=1e-5, warm=1.0, speed=300.0, weight=1.0, pulled=1.0):
        model = fc.Model(mesh, kinematics="plane_strain")
        model.add_material(fc.LinearElastic(E=E, nu=nu, expansion=expansion, density=8e-9), "INNER")
        model.add_material(fc.LinearElastic(E=1.5e5, nu=0.25, expansion=1.2e-5, density=3e-9), "OUTER")
        supported(model, SYMMETRY_X="x", SYMMETRY_Y="y")
        model.add_temperature(100.0 * warm, groups="INNER")
        model.add_centrifugal(speed, groups=["INNER", "OUTER"])
        model.add_gravity(y=-9810.0 * weight)
        model.add_body_force("OUTER", x=1e-3 * pulled)
        model.prescribe("BORE", normal=-0.01 * moved)
        return with_contact(model, "c", "CONT_INNER", "CONT_OUTER", clearance=-0.02, formulation="continuous")

    changes = {
        "E": (("E", "INNER"), 2e5, 200.0),
        "nu": (("nu", "INNER"), 0.3, 3e-4),
        "moved": (("prescribed", "BORE"), 1.0, 1e-2),
        "expansion": (("expansion", "INNER"), 1e-5, 1e-7),
        "warm": (("temperature", "INNER"), 1.0, 1e-2),
        "weight": (("load", "all solid cells"), 1.0, 1.0),
        "pulled": (("load", "OUTER"), 1.0, 1e-1),
    }
    whole = ("load", "INNER"), ("load", "OUTER")
    model = make(pulled=0.0)
    found = asked(model, parameters=[("speed", "INNER"), ("speed", "OUTER"), *whole]).derivatives
    for group, load in zip(("INNER", "OUTER"), whole, strict=True):  # force goes with the square of the speed
        assert 300.0 * found["speed", group] == pytest.approx(2.0 * found[load], rel=1e-9)
    del changes["pulled"]
    assert compare(make, [("pressure_max", "c")], changes).error < 1e-6

    def turned(speed=300.0, pulled=1.0):
        made = make(speed=speed, pulled=pulled)
        made.loads = [load if "centrifugal" not in load.name else replace(load, groups=None) for load in made.loads]
        return made

    by_factor = {"speed": (("speed", "all solid cells"), 300.0, 3.0), "pulled": (("load", "OUTER"), 1.0, 1.0)}
    assert compare(turned, [("pressure_max", "c")], by_factor).error < 1e-6


@pytest.mark.parametrize("dim", [2, 3])
def test_constants_along_the_axes_of_a_material(dim):
    if dim == 3:
        mesh, side, end = fc.generate.box((3.0, 2.0, 2.0), (3, 2, 2)), "ZMIN", "ZMAX"
    else:
        mesh, side, end = fc.generate.block((3.0, 2.0), (4, 3)), "BOTTOM", "TOP"
    turned = np.array([[0.8, 0.6, 0.0], [-0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])

    def make(E2=700.0, nu12=0.3, nu23=0.35, G12=600.0, G13=500.0, expansion=2e-4):
        model = fc.Model(mesh, kinematics="3d" if dim == 3 else "plane_strain")
        axes = {"axes": turned, "expansion": (1e-4, expansion, 3e-4)}
        model.add_material(fc.Orthotropic((2000.0, E2, 430.0), (nu12, 0.2, nu23), (G12, G13, 300.0), **axes))
        model.prescribe(end, **dict.fromkeys("xyz"[:dim], -0.02))
        model.add_temperature(10.0)
        plane = fc.obstacles.HalfSpace(point=(0.0,) * dim, normal=(0.0,) * (dim - 1) + (1.0,))
        return with_obstacle(model, "c", side, plane)

    changes = {
        "E2": (("E", 0, "2"), 700.0, 0.7),
        "nu12": (("nu", 0, "12"), 0.3, 3e-4),
        "nu23": (("nu", 0, "23"), 0.35, 3e-4),
        "G12": (("G", 0, "12"), 600.0, 6.0),
        "expansion": (("expansion", 0, "2"), 2e-4, 1e-6),
    } | ({"G13": (("G", 0, "13"), 500.0, 5.0)} if dim == 3 else {})
    assert compare(make, [("contact_force", "c", "xyz"[dim - 1])], changes).error < 1e-6


def bolt(**constants):
    """Return a bar between walls that is cut in its middle."""
    bar = fc.generate.block((1.0, 2.0), (2, 4))
    bar = bar.with_facet_group("CUT", lambda x: np.abs(x[:, 1] - 1.0) < 1e-9, between=True)
    return elastic_model(fc.generate.cut(bar, "CUT"), "plane_stress", BOTTOM="xy", TOP="xy", **constants)


@pytest.mark.parametrize("given", ["force", "shortening"])
def test_pretension(given):

    def make(E=1000.0, pulled=1.0, pushed=1.0):
        model = bolt(E=E)
        model.add_pretension("bolt", "CUT", **{given: {"force": 3.0, "shortening": 0.01}[given] * pulled})
        model.add_pressure("RIGHT", pushed)
        return model

    changes = {"E": (("E", 0), 1000.0, 1.0), "pulled": (("pretension", "bolt"), 1.0, 0.1)}
    assert compare(make, [("reaction", "TOP", "y")], changes | {"pushed": (("load", "RIGHT"), 1.0, 0.1)}).error < 1e-6


def asked(model: fc.Model, quantity=("pressure_max", "c"), parameters=(("E", 0),), criteria=TIGHT, **options):
    step = fc.solve(model, 1, criteria=criteria)[-1]
    return fc.sensitivities(model, step, quantity, parameters, ramp=1, criteria=criteria, **options)


NO_QUANTITIES = [
    (("presure", "c"), "unknown quantity 'presure': did you mean 'pressure'"),
    (("pressure_max", "d"), "unknown contact pair 'd'"),
    (("pressure_max",), r"must have the form \(\"pressure_max\", pair\)"),
    (("pressure", "c", 0), "point 0 is not a node of the secondary side of contact 'c'"),
    (("displacement", 10**6, "y"), "point 1000000 is not in the mesh of"),
    (("displacement", 0, "w"), "unknown component"),
    (("reaction", "CONT_UPPER", "x"), "no support acts along x on group 'CONT_UPPER'"),
]
NO_PARAMETERS = [
    (("g", 0), "unknown parameter 'g'"),
    (("G", 0, "12"), "the material 0 has no constant G: its sensitivity is not available"),
    (("E", 0, "1"), "unknown component of E '1': none is defined"),
    (("friction", "c"), "no sensitivity to friction: if all nodes stick"),
    (("speed", "UPPER"), "unknown group with a centrifugal force 'UPPER': none is defined"),
    (("temperature", "UPPER"), "unknown group with a temperature 'UPPER'"),
    (("pretension", "bolt"), "unknown pretension 'bolt'"),
    (("E",), r"must have the form \(\"E\", material\)"),
    (("E", "STEEL"), "unknown material 'STEEL'"),
    (("load", "UPPER_TOP"), "unknown group with a load, or obstacle with a force, 'UPPER_TOP'"),
    (("prescribed", "UPPER_LEFT"), "unknown group whose displacement is prescribed 'UPPER_LEFT'"),
    (("motion", "c"), "unknown rigid obstacle with a motion 'c'"),
    (("clearance", "d"), "unknown contact pair 'd'"),
]
# What depends on the path, or keeps its gaps.
NO_SUCH_CONTACT = [
    ({"friction": 0.2}, "contact 'c' has friction: its results depend on all load steps"),
    ({"kind": "bilateral_once_closed"}, "keeps nodes closed that closed in earlier load steps"),
]


def test_what_has_no_sensitivity_is_named():
    model = two_blocks()()
    step = fc.solve(model, 1, criteria=TIGHT)[-1]
    tried = [(quantity, [("E", 0)], text) for quantity, text in NO_QUANTITIES]
    for quantity, by, text in [*tried, *((("pressure_max", "c"), [name], text) for name, text in NO_PARAMETERS)]:
        refused(fc.ModelError, text, fc.sensitivities, model, step, quantity, by, ramp=1, criteria=TIGHT)
    for options, text in NO_SUCH_CONTACT:
        refused(fc.ModelError, text, asked, two_blocks(**options)())


def test_a_material_of_all_cells_is_named_by_a_group():
    model = elastic_model(fc.generate.block(), "plane_strain", E=1000.0, BOTTOM="xy", TOP={"y": -0.01})
    step = fc.solve(model, 1)[-1]
    quantity, by = ("reaction", "TOP", "y"), [("E", "BLOCK"), ("E", 0)]
    named, numbered = fc.sensitivities(model, step, quantity, by, ramp=1).derivatives.values()
    assert named == numbered == pytest.approx(step.reaction[model.mesh.points_of("TOP"), 1].sum() / 1000.0)


def test_other_refusals():
    with pytest.raises(fc.ModelError, match="is tied: its gaps are fixed"):
        asked(two_blocks(kind="tied")(), ("contact_force", "c", "y"), [("clearance", "c")])
    fixed = fc.Criteria(geometry_updates=2)
    refused(fc.ModelError, "after a fixed number of geometry updates", asked, two_blocks()(), criteria=fixed)
    varying = two_blocks()()
    varying.materials.clear()
    varying.add_material(fc.LinearElastic(E=lambda x: 1000.0 + x[:, 0], nu=0.3))
    refused(fc.ModelError, "the material 0 has no constant E", asked, varying)
    model = two_blocks()()
    step = fc.solve(model, 1, criteria=TIGHT)[-1]
    model.fix("UPPER_LEFT", "x")
    with pytest.raises(fc.ModelError, match="the steps so far belong to another case"):
        fc.sensitivities(model, step, ("pressure_max", "c"), [("E", 0)], ramp=1, criteria=TIGHT)


def test_a_constraint_about_to_change_is_named():
    mesh = fc.generate.block((4.0, 1.0), (4, 1))

    def model(depth):
        made = elastic_model(mesh, "plane_strain", nu=0.0)
        made.prescribe("TOP", x=0.0, y=lambda x: np.where(x[:, 0] < 3.5, -0.01, depth))
        plane = fc.obstacles.HalfSpace(point=(0.0, 0.0), normal=(0.0, 1.0))
        return with_obstacle(made, "plane", "BOTTOM", plane, formulation="node_to_segment")

    assert fc.solve(model(-0.01), 1)[-1].contact["plane"].active.all()
    low, high = 0.0, 0.1  # where the last node lifts off
    for _ in range(36):
        middle = 0.5 * (low + high)
        closed = fc.solve(model(middle), 1)[-1].contact["plane"].active.all()
        low, high = (middle, high) if closed else (low, middle)
    with pytest.raises(fc.ModelError, match=r"is about to (open|close), at points 8 \[4\. 0\.\] of contact 'plane'"):
        asked(model(low), ("pressure_max", "plane"))
    assert asked(model(low - 1e-3), ("pressure_max", "plane")).margin > 1e-6


def test_nodes_between_two_facets_are_named():
    rings = fc.generate.rings("quad8", divisions_inner=(3, 8), divisions_outer=(4, 11))
    pressed = elastic_model(rings, "plane_strain", SYMMETRY_X="x", SYMMETRY_Y="y")
    pressed.add_pressure("BORE", 20.0)
    sides = {"secondary": "CONT_OUTER", "primary": "CONT_INNER"}
    pressed.add_contact("hertz", **sides, clearance=-0.02, formulation="node_to_segment", normals="averaged")
    for model in (pressed, spheres(fc.generate.half_spheres(size=6.0), formulation="mortar")):
        with pytest.raises(fc.ModelError, match=r"lie opposite nodes of the other side|if nodes move"):
            asked(model, ("pressure_max", "hertz"))


def test_the_value_of_a_result_file_is_enough(tmp_path):
    model = two_blocks()()
    with fc.ResultWriter(tmp_path / "c.vtkhdf", model) as out:
        step = fc.solve(model, 1, criteria=TIGHT, on_step=out.write)[-1]
    read = fc.open_results(tmp_path / "c.vtkhdf")[-1]
    found = [
        fc.sensitivities(model, own, ("pressure_max", "c"), [("E", 0)], ramp=1, criteria=TIGHT).derivatives["E", 0]
        for own in (step, read)
    ]
    assert found[0] == pytest.approx(found[1], rel=1e-9)


def test_bolts_before_and_after_their_lock():
    model = bolt(nu=0.0)
    model.add_pretension("bolt", "CUT", force=3.0, locked_from=1.0, ramp=[(0.0, 0.0), (1.0, 1.0), (2.0, 1.0)])
    height = model.mesh.points[:, 1]
    point = int(np.argmax(height * (height < 0.6)))  # half a length from the bottom
    first = fc.solve(model, [1.0])[-1]
    found = fc.sensitivities(model, first, ("displacement", point, "y"), [("E", 0)], ramp=[1.0, 2.0])
    assert found.derivatives["E", 0] == pytest.approx(-3.0 * 0.5 / 1000.0**2, rel=1e-9)
    second = fc.solve(model, [1.0, 2.0])[-1]
    with pytest.raises(fc.ModelError, match="pretension sections or temporary supports hold"):
        fc.sensitivities(model, second, ("displacement", point, "y"), [("E", 0)], ramp=[1.0, 2.0])


def test_quantities_that_cannot_be_told():
    springy = two_blocks()()
    springy.add_spring("UPPER_LEFT", x=1.0)
    refused(fc.ModelError, "reactions of a model with springs", asked, springy, ("reaction", "UPPER_TOP", "y"))
    mesh = fc.generate.block((10.0, 5.0), (8, 4))
    model = elastic_model(mesh, "axisymmetric", BOTTOM="xy")
    ball = fc.obstacles.Sphere(centre=(0.0, 13.0), R=8.0)
    model.add_obstacle("ball", secondary="TOP", obstacle=ball, motion={"y": -0.3}, formulation="node_to_segment")
    rim = int(mesh.points_of("TOP_RIGHT")[0])
    with pytest.raises(fc.ModelError, match=f"point {rim} of contact 'ball' is open: its pressure is zero"):
        asked(model, ("pressure", "ball", rim))
    pole = int(mesh.points_of("TOP_LEFT")[0])
    step = fc.solve(model, 1, criteria=TIGHT)[-1]
    at = int(np.flatnonzero(step.contact["ball"].points == pole)[0])
    assert asked(model, ("pressure", "ball", pole)).value == pytest.approx(step.contact["ball"].pressure[at], rel=1e-9)
    assert not asked(model, parameters=[], quantity=("pressure", "ball", pole)).derivatives


def test_nodes_of_two_pairs_are_named():
    mesh = fc.generate.block((10.0, 5.0), (8, 4))
    model = elastic_model(mesh, "plane_strain", RIGHT={"x": -0.05, "y": 0.0})
    for name, side, normal in (("floor", "BOTTOM", (0.0, 1.0)), ("wall", "LEFT", (1.0, 0.0))):
        plane = fc.obstacles.HalfSpace(point=(0.0, 0.0), normal=normal)
        model.add_obstacle(name, secondary=side, obstacle=plane, formulation="node_to_segment")
    corner = int(mesh.points_of("BOTTOM_LEFT")[0])
    with pytest.raises(fc.ModelError, match=f"point {corner} carries forces of both contact 'wall' and contact 'floo"):
        asked(model, ("contact_force", "wall", "x"), margin=0.0)


def test_equations_that_are_not_solved_are_told(monkeypatch):
    from fastcontact.analysis.sensitivity import adjoint

    monkeypatch.setattr(adjoint, "SOLUTIONS", 2)
    with pytest.raises(fc.ConvergenceError, match="adjoint equations of the moving contact geometry do not converge"):
        asked(two_blocks()())
