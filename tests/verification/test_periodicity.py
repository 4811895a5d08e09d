"""One period or sector compared with the whole structure, with Lame, and with Westergaard's wavy surface."""

import numpy as np
import pytest
from images import Image, image_of
from models import elastic_model, made_of, supported, with_obstacle
from pairwise import first_of
from refusals import refused
from two_bodies import arcs

import fastcontact as fc
from fastcontact.mesh.generate import block, box, merge_points, renamed, union

pytestmark = pytest.mark.each_value

INNER, OUTER, E, NU = 1.0, 2.0, 1000.0, 0.3


def turn(angle):
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def sector(sectors, divisions=(8, 6), element="quad8"):
    """A sector of a ring with ends that are no rays: they wind by 0.4 radian from the inside to the outside.

    Groups BOTTOM (inside), TOP (outside), LEFT and RIGHT (ends).
    """
    mesh = block((1.0, 1.0), divisions, element)
    s, t = mesh.points.T
    radius, angle = INNER + (OUTER - INNER) * t, -2.0 * np.pi / sectors * s + 0.4 * t
    return mesh.replace(points=np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]))


def moved(mesh, Q, shift=0.0):
    return mesh.replace(points=mesh.points @ Q.T + shift)


def whole(part, sectors):
    """All sectors in one mesh, with the groups of the sides of all."""
    parts = []
    for k in range(sectors):
        Q = np.eye(part.dim)
        Q[:2, :2] = turn(2.0 * np.pi * k / sectors)
        parts.append(renamed(moved(part, Q), {name: f"{name} {k}" for name in part.group_names}))
    return merge_points(union(*parts), 1e-9)


def loaded(model, names):
    """Pressure and shear inside, both of them not uniform over a sector; the outside is held."""
    for k, (inside, outside) in enumerate(names):
        back = turn(2.0 * np.pi * k / len(names))

        def along(component, back=back):
            def traction(x):
                local = x @ back
                normal = local / np.linalg.norm(local, axis=1)[:, None]
                own = 5.0 * normal * (1.0 + local[:, [1]]) + 3.0 * normal[:, ::-1] * [-1.0, 1.0]
                return (own @ back.T)[:, component]

            return traction

        model.add_traction(inside, x=along(0), y=along(1))
        model.fix(outside, "xy")


def ring(mesh, kinematics="plane_strain"):
    return made_of(mesh, kinematics, fc.LinearElastic(E=E, nu=NU, density=2.0))


@pytest.mark.parametrize(("sectors", "swapped"), [(2, False), (5, False), (5, True), (12, False)])
def test_a_sector_is_a_part_of_the_whole_ring(sectors, swapped):
    part = sector(sectors)
    one = ring(part)
    loaded(one, [("BOTTOM", "TOP")])
    one.add_cyclic_symmetry(*(("RIGHT", "LEFT") if swapped else ("LEFT", "RIGHT")), sectors=sectors)
    all_of_it = ring(whole(part, sectors))
    loaded(all_of_it, [(f"BOTTOM {k}", f"TOP {k}") for k in range(sectors)])
    alone, together = (fc.solve(model, 1)[-1] for model in (one, all_of_it))
    first = all_of_it.mesh.points_of("BLOCK 0")
    place = np.linalg.norm(all_of_it.mesh.points[first][:, None] - part.points[None], axis=2).argmin(axis=1)
    scale = np.abs(together.displacement).max()
    assert alone.displacement[place] == pytest.approx(together.displacement[first], abs=1e-9 * scale)
    assert np.abs(alone.displacement).max() > 1e-3


def test_sectors_of_a_press_fit_press_as_lame_says():
    """Contact across the ends of the sectors, which wind, and meshes that do not match; shaft and hub of one material."""
    parts = []
    for name, inside, outside, cells in (("SHAFT", 0.5, 1.0, (8, 6)), ("HUB", 1.0, 2.0, (6, 8))):
        mesh = block((1.0, 1.0), cells, "quad8")
        s, t = mesh.points.T
        radius = inside + (outside - inside) * t
        angle = -2.0 * np.pi / 6.0 * s + 0.3 * (radius - 1.0)
        mesh = mesh.replace(points=np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]))
        parts.append(renamed(mesh, {group: f"{name}_{group}" for group in mesh.group_names}))
    model = ring(union(*parts))
    model.add_contact(
        "fit", secondary="HUB_BOTTOM", primary="SHAFT_TOP", formulation="mortar", multipliers="standard", clearance=-0.01,
        normals="averaged",
    )  # fmt: skip
    for name in ("SHAFT", "HUB"):
        model.add_cyclic_symmetry(f"{name}_LEFT", f"{name}_RIGHT", sectors=6)
        node = int(model.mesh.points_of(f"{name}_TOP")[0])
        x, y = model.mesh.points[node].tolist()
        model.relate([(node, "x", -y), (node, "y", x)])
    contact = fc.solve(model, 1)[-1].contact["fit"]
    lame = 0.01 * E / (1.0 - NU**2) / (1.25 / 0.75 + 5.0 / 3.0)
    assert contact.pressure == pytest.approx(np.full(len(contact.points), lame), rel=0.01)


def test_a_spinning_sector_in_space_reaches_the_axis():
    """A quarter of a square bar about an axis that the ends share; centrifugal forces, a slanting axis, and the whole bar."""
    part = box((1.0, 1.0, 2.0), (2, 2, 3), "hex8")
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    Q = np.column_stack([[1.0, 2.0, 0.0] / np.sqrt(5.0), np.cross(axis, [1.0, 2.0, 0.0] / np.sqrt(5.0)), axis])
    shift = np.array([3.0, 1.0, -2.0])
    one = ring(moved(part, Q, shift), "3d")
    one.add_cyclic_symmetry("YMIN", "XMIN", sectors=4, origin=shift.tolist(), direction=(4.0, -2.0, 4.0))
    all_of_it = ring(moved(whole(part, 4), Q, shift), "3d")
    for model, bottoms in ((one, ["ZMIN"]), (all_of_it, [f"ZMIN {k}" for k in range(4)])):
        model.add_centrifugal(3.0, origin=shift.tolist(), direction=axis.tolist())
        for bottom in bottoms:
            model.fix(bottom, "xyz")
    alone, together = (fc.solve(model, 1)[-1] for model in (one, all_of_it))
    first = all_of_it.mesh.points_of("BOX 0")
    place = np.linalg.norm(all_of_it.mesh.points[first][:, None] - one.mesh.points[None], axis=2).argmin(axis=1)
    scale = np.abs(together.displacement).max()
    assert scale > 1e-3
    assert alone.displacement[place] == pytest.approx(together.displacement[first], abs=1e-9 * scale)


def test_a_sector_that_nothing_stops_from_turning_is_refused():
    model = ring(sector(6))
    model.add_cyclic_symmetry("LEFT", "RIGHT", sectors=6)
    model.add_pressure("BOTTOM", 1.0)
    refused(fc.ModelError, r"1 rigid-body motion is not restrained: body 'BLOCK': .*rotation", fc.solve, model, 1)


def wavy(begin, form, periodic=True, divisions=(96, 32)):
    """One wave of a rigid floor below a block one period wide that is pushed down; the period begins at `begin`."""
    model = ring(block((1.0, 1.0), divisions, origin=(begin, 0.0)))
    height = 0.002

    def floor(x):
        waves = 2.0 * np.pi * x
        return height * (np.cos(waves[:, 0]) - 1.0), -2.0 * np.pi * height * np.sin(waves)

    model.add_obstacle("floor", secondary="BOTTOM", obstacle=fc.obstacles.Height(floor), formulation=form)
    model.add_pressure("TOP", 1.0)
    if periodic:
        model.add_periodicity("LEFT", "RIGHT")
        model.fix("TOP_LEFT", "x")
    else:
        supported(model, LEFT="x", RIGHT="x")
    return model


@pytest.mark.parametrize("form", first_of(1, ["node_to_segment", "continuous"]))
def test_a_wavy_floor_is_westergaards(form):
    """Half-width a of the contact: mean pressure = p* sin^2(pi a), p* = pi E* height (Westergaard, J. Appl. Mech. 6, 1939).

    The largest pressure is 2 sqrt(p* mean): 1.5, 0.3 and 0.002 % off with 48, 96 and 192 cells along a wave. A period that
    begins elsewhere, and a wave between planes of symmetry, have the same pressures.
    """
    full = np.pi * E / (1.0 - NU**2) * 0.002
    centred, mirrored, elsewhere = (
        fc.solve(wavy(begin, form, periodic), 1)[-1].contact["floor"]
        for begin, periodic in ((-0.5, True), (-0.5, False), (-0.375, True))
    )
    assert centred.pressure_max == pytest.approx(2.0 * np.sqrt(full), rel=0.006)
    half = sum(centred.radius) / 2.0
    assert half == pytest.approx(np.arcsin(np.sqrt(1.0 / full)) / np.pi, abs=0.5 / 96.0)
    assert centred.pressure == pytest.approx(mirrored.pressure, abs=1e-7 * centred.pressure_max)
    assert elsewhere.force == pytest.approx(centred.force, abs=1e-6)
    assert elsewhere.pressure_max == pytest.approx(centred.pressure_max, rel=1e-6)


def test_a_period_stretched_by_a_mean_strain():
    """Ends moved apart: uniform strain and stress; across, the period gets as thin as it likes."""
    model = ring(box((2.0, 1.0, 1.0), (3, 2, 2)), "3d")
    model.add_periodicity("XMIN", "XMAX", x=0.02)
    model.add_periodicity("YMIN", "YMAX", free="y")
    model.add_periodicity("ZMIN", "ZMAX", free="z")
    corner = int(np.linalg.norm(model.mesh.points, axis=1).argmin())
    for axis in "xyz":
        model.relate([(corner, axis, 1.0)])
    step = fc.solve(model, 1)[-1]
    assert step.displacement == pytest.approx(model.mesh.points * [0.01, -0.003, -0.003], abs=1e-12)
    assert step.stress[:, 0] == pytest.approx(np.full(model.mesh.n_points, 10.0))


@pytest.mark.parametrize("divisions", [(48, 16), (96, 32)])
def test_the_two_nodes_of_one_place_have_one_pressure(divisions):
    """A period that begins in the middle of the contact: how a node's force is split is round-off, its pressure is not."""
    middle, end = (
        fc.solve(wavy(begin, "node_to_segment", divisions=divisions), 1)[-1].contact["floor"] for begin in (-0.5, 0.0)
    )
    order, shifted = np.argsort(middle.coordinates[:, 0]), np.argsort(end.coordinates[:, 0])
    half = divisions[0] // 2
    assert end.force[1] == pytest.approx(1.0)
    assert end.pressure[shifted][: half + 1] == pytest.approx(middle.pressure[order][half:], rel=1e-6, abs=1e-6)
    assert end.pressure[shifted][half:] == pytest.approx(middle.pressure[order][: half + 1], rel=1e-6, abs=1e-6)
    assert end.active[shifted][[0, -1]].all()
    assert end.radius == pytest.approx(middle.radius)
    places = [np.unique(np.abs(contact.place).round(9)) for contact in (end, middle)]
    assert places[0] == pytest.approx(places[1])


@pytest.mark.parametrize("begin", [(0.0, -0.5), (-0.9, -0.5), (0.0, 0.0)], ids=["edges", "beside", "corners"])
def test_a_contact_across_the_ends_of_a_period_in_space_is_joined(begin):
    def contact(begin):
        mesh = fc.generate.box((1.0, 1.0, 0.5), (10, 10, 3), "hex8", (*begin, 0.0))
        model, k = ring(mesh, "3d"), 2.0 * np.pi
        waves = fc.obstacles.Height(lambda x: (0.002 * (np.cos(k * x).sum(axis=1) - 2.0), -0.002 * k * np.sin(k * x)))
        model.add_obstacle("floor", secondary="ZMIN", obstacle=waves)
        model.add_pressure("ZMAX", 0.5)
        model.add_periodicity("XMIN", "XMAX")
        model.add_periodicity("YMIN", "YMAX")
        corner = int(np.linalg.norm(mesh.points - (*begin, 0.5), axis=1).argmin())
        for axis in "xy":
            model.relate([(corner, axis, 1.0)])
        return fc.solve(model, 1)[-1].contact["floor"]

    whole, cut = contact((-0.5, -0.5)), contact(begin)
    assert cut.force == pytest.approx(whole.force, abs=1e-6)
    assert cut.radius == pytest.approx(whole.radius, rel=1e-3)
    assert cut.middle == pytest.approx(np.round(cut.middle), abs=1e-3)


@pytest.mark.filterwarnings("ignore:.*past each other at the periodic ends", "ignore:a displacement of")
@pytest.mark.parametrize("formulation", [None, "node_to_segment"])
def test_a_closed_node_that_slides_past_the_end_has_the_gap_of_its_twin(formulation):
    mesh = fc.generate.block_on_block(
        "quad4", size_lower=(6.0, 2.0), size_upper=(6.0, 2.0), divisions_lower=(6, 2), divisions_upper=(6, 2)
    )
    model = elastic_model(mesh, "plane_strain", LOWER_BOTTOM="xy")
    for side in ("LOWER", "UPPER"):
        model.add_periodicity(f"{side}_LEFT", f"{side}_RIGHT")
    model.add_pressure("UPPER_TOP", 5.0)
    model.prescribe("UPPER_TOP", x=0.2)
    model.add_contact("pair", secondary="CONT_UPPER", primary="CONT_LOWER", formulation=formulation)
    contact = fc.solve(model, 1)[-1].contact["pair"]
    assert contact.active.all()
    assert np.abs(contact.gap).max() < 1e-4


def fitted(sectors, cells, element, **options):
    """A sector of two rings with an interference."""
    model = ring(arcs(element, [(4, count) for count in cells], 2.0 * np.pi / sectors))
    for name in "AB":
        model.fix(f"{name}BOTTOM", "y")
        model.add_cyclic_symmetry(f"{name}BOTTOM", f"{name}TOP", sectors=sectors)
    model.add_contact("fit", secondary="ARIGHT", primary="BLEFT", clearance=-1e-3, **options)
    return fc.solve(model, 1)[-1].contact["fit"]


LAYER = {"cohesion": {"strength": 1e3, "energy": 1e3, "stiffness": 1e6}, "clearance_ramp": ((0.0, 0.0), (1.0, 1.0))}
FITS = [
    (10, (5, 3), "quad8", {}),
    (10, (5, 3), "quad8", LAYER),
    (10, (12, 12), "quad4", {}),
    (10, (12, 12), "quad4", {"penalty": 1e5}),
    (10, (3, 5), "quad8", {"formulation": "node_to_segment"}),
    (8, (4, 4), "quad8", {"formulation": "continuous"}),
]


@pytest.mark.filterwarnings("ignore:.*across its radius", "ignore:.*facets", "ignore:.*sag")
@pytest.mark.parametrize(("sectors", "cells", "element", "options"), first_of(3, FITS))
def test_a_closed_contact_at_the_ends_of_a_sector_is_that_inside_of_a_larger_one(sectors, cells, element, options):
    """Both nodes of a place have one condition: the split of their forces was round-off, and the geometry did not converge.

    Normals there are means over the facets of both ends, as those of the nodes in the midst of two sectors are.
    """
    one = fitted(sectors, cells, element, **options)
    two = fitted(sectors // 2, tuple(2 * count for count in cells), element, **options)
    # Nodes opposite the ends of facets fall on one or the other by rounding, where they choose one.
    close = 1e-5 if options.get("formulation") == "node_to_segment" else 2e-7
    assert one.pressure == pytest.approx(two.pressure[: len(one.pressure)], rel=close)
    assert one.pressure == pytest.approx(two.pressure[-len(one.pressure) :], rel=close)


@pytest.mark.filterwarnings("ignore:.*across its radius")
@pytest.mark.parametrize("slides", [0.5, 1.5])
@pytest.mark.parametrize(
    ("element", "mu"), [("hex8", 0.3), ("tet4", 0.3), ("hex20", 0.3), ("tet10", 0.3), ("tet10", 0.5), ("tet10", 2.0)]
)
def test_a_period_pushed_along_a_plane_has_uniform_pressure_and_shear(element, mu, slides):
    """Pressed and pushed to the fraction `slides` of the limit of friction."""
    depth = 1e-3
    model = ring(box((1.0, 1.0, 0.5), (2, 2, 1), element), "3d")
    model.add_periodicity("XMIN", "XMAX")
    model.add_periodicity("YMIN", "YMAX")
    pressure = E * (1.0 - NU) / ((1.0 + NU) * (1.0 - 2.0 * NU)) * depth / 0.5
    push = slides * mu * pressure * 0.5 * 2.0 * (1.0 + NU) / E
    model.prescribe("ZMAX", x=0.8 * push, y=0.6 * push, z=-depth)
    with_obstacle(model, "c", "ZMIN", fc.obstacles.HalfSpace((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), friction=mu)
    contact = fc.solve(model, 1)[-1].contact["c"]
    assert contact.pressure == pytest.approx(np.full(len(contact.points), pressure), rel=1e-9)
    shear = -min(slides, 1.0) * mu * pressure * np.array([0.8, 0.6, 0.0])
    assert contact.shear == pytest.approx(np.tile(shear, (len(contact.points), 1)), abs=1e-9 * pressure)


def shrunk_on_a_shaft(element, turned, **options):
    """The contact of a sector of a ring that is pressed on a rigid shaft and turned."""
    mesh = block((1.0, 1.0), (4, 4), element)
    angle = -0.25 * np.pi * mesh.points[:, 0]
    mesh = mesh.replace(points=(1.0 + mesh.points[:, [1]]) * np.column_stack([np.cos(angle), np.sin(angle)]))
    model = ring(mesh)
    model.add_cyclic_symmetry("LEFT", "RIGHT", sectors=8)
    model.prescribe("TOP", x=-0.002, y=turned, axes=fc.CylindricalAxes())
    shaft = fc.obstacles.Sphere((0.0, 0.0), 1.0)
    model.add_obstacle("shaft", secondary="BOTTOM", obstacle=shaft, friction=0.3, **options)
    return fc.solve(model, 2)[-1].contact["shaft"]


@pytest.mark.filterwarnings(
    "ignore:.*deviate from their arcs",
    "ignore:the energy of these load steps is out of balance",
    "ignore:moments of friction on body",
)
@pytest.mark.parametrize("turned", [0.0005, 0.01])
@pytest.mark.parametrize(("element", "scatter"), [("quad4", 1e-9), ("quad8", 0.025), ("quad9", 0.02)])
@pytest.mark.parametrize("formulation", ["mortar", "continuous"])
def test_a_sector_on_a_shaft_has_uniform_pressure_and_shear(formulation, element, scatter, turned):
    """A field of tractions has cylindrical components, which are the same at both ends."""
    contact = shrunk_on_a_shaft(element, turned, formulation=formulation)
    x, y = contact.coordinates.T
    shear = (contact.shear[:, 1] * x - contact.shear[:, 0] * y) / contact.pressure
    assert np.ptp(contact.pressure) < scatter * contact.pressure.mean()
    assert np.ptp(shear) < 1.5 * scatter * np.abs(shear).mean()
    assert (turned < 0.001) or shear == pytest.approx(np.full(len(x), -0.3), abs=2e-4)


@pytest.mark.filterwarnings("ignore:.*across its radius", "ignore:a displacement of", "ignore:.*rotat")
@pytest.mark.parametrize(
    ("element", "solver", "formulation"),
    first_of(1, [
        ("hex8", "direct", "mortar"), ("hex20", "amg", "mortar"), ("hex8", "amg", "mortar"),
        ("hex20", "direct", "mortar"), ("hex8", "direct", "continuous"), ("hex20", "direct", "continuous"),
    ]),
)  # fmt: skip
def test_friction_of_a_sector_that_turns_on_a_plane_follows_it_round(element, solver, formulation):
    mesh = box((1.0, 1.0, 0.5), (3, 4, 2), element, (1.0, 0.0, 0.0))
    r, t = mesh.points[:, 0], 2.0 * np.pi / 5.0 * mesh.points[:, 1]
    model = fc.Model(mesh.replace(points=np.column_stack([r * np.cos(t), r * np.sin(t), mesh.points[:, 2]])), "3d")
    model.add_material(fc.LinearElastic(E=E, nu=0.0))
    model.add_cyclic_symmetry("YMIN", "YMAX", sectors=5)
    model.prescribe("ZMAX", x=0.0, y=0.05, z=-0.01, axes=fc.CylindricalAxes())
    model.add_obstacle(
        "c", secondary="ZMIN", obstacle=fc.obstacles.HalfSpace((0.0, 0.0, 0.0), (0.0, 0.0, 1.0)), friction=0.3,
        formulation=formulation,
    )  # fmt: skip
    contact = fc.solve(model, 2, linear_solver=solver)[-1].contact["c"]
    assert contact.pressure == pytest.approx(np.full(len(contact.points), 20.0))
    x, y, _ = contact.coordinates.T
    assert np.linalg.norm(contact.shear, axis=1) == pytest.approx(np.full(len(x), 6.0))
    assert (contact.shear[:, 1] * x - contact.shear[:, 0] * y) / np.hypot(x, y) == pytest.approx(
        np.full(len(x), -6.0), rel=0.01
    )


def test_ends_that_do_not_match_are_refused():
    model = ring(sector(5))
    with pytest.raises(fc.ModelError, match=r"turned by 1/6 of a turn, lies 0\.\d+ from the nearest node of 'RIGHT'"):
        model.add_cyclic_symmetry("LEFT", "RIGHT", sectors=6)
    with pytest.raises(fc.ModelError, match=r"from the nearest node of .TOP., and the groups do not consist of facets"):
        model.add_cyclic_symmetry("LEFT", "TOP", sectors=5)
    refused(fc.ModelError, "needs at least two sectors", model.add_cyclic_symmetry, "LEFT", "RIGHT", sectors=1)
    refused(fc.ModelError, r"lies .* from the nearest node of 'RIGHT'", model.add_periodicity, "LEFT", "RIGHT")
    refused(fc.ModelError, "a period has two ends", model.add_periodicity, "LEFT", "LEFT")
    refused(fc.ModelError, "'x' is free, so no displacement", model.add_periodicity, "LEFT", "RIGHT", x=0.1, free="x")
    axisymmetric = fc.Model(block(), "axisymmetric")
    with pytest.raises(fc.ModelError, match="already represents the entire ring"):
        axisymmetric.add_cyclic_symmetry("LEFT", "RIGHT", sectors=4)


def two_bodies(dim, elements, ends, wind, seed=None):
    """A sector of two rings that touch with coincident nodes, which are renumbered; `ends` grades one end radially."""
    parts = []
    for name, inside, element in (("IN", 1.0, elements[0]), ("OUT", 2.0, elements[1])):
        mesh = block((1.0, 1.0), (4, 4), element) if dim == 2 else box((1.0, 1.0, 1.0), (3, 3, 2), element)
        s, t = mesh.points[:, :2].T
        radius = inside + s + ends * t * np.sin(2.0 * np.pi * s) / (2.0 * np.pi)
        angle = 2.0 * np.pi / 12.0 * t + wind * (radius - 2.0)
        points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), mesh.points[:, 2:]])
        names = dict(zip(("LEFT", "RIGHT", "BOTTOM", "TOP") if dim == 2 else ("XMIN", "XMAX", "YMIN", "YMAX"), "IOFS"))
        mesh = mesh.replace(points=points)
        parts.append(renamed(mesh, {group: f"{name}_{names.get(group, group)}" for group in mesh.group_names}))
    mesh = union(*parts).merged_groups("F", ["IN_F", "OUT_F"]).merged_groups("S", ["IN_S", "OUT_S"])
    return mesh if seed is None else image_of(mesh, Image(seed=seed))[0]


@pytest.mark.filterwarnings("ignore:.*across its radius", "ignore:.*facets", "ignore:.*stiff", "ignore:.*oscillate")
@pytest.mark.parametrize(
    ("dim", "elements", "wind", "seed", "ends", "swapped", "options"),
    first_of(4, [
        (2, ("quad4", "quad4"), 0.0, None, 0.5, False, {}),
        (2, ("quad8", "quad8"), 0.0, None, 0.0, False, {}),
        (3, ("hex8", "tet4"), 0.0, 2, 0.0, True, {"friction": 0.1}),
        (3, ("hex8", "hex8"), 0.0, 2, 0.5, False, {}),
        (2, ("quad4", "tri6"), 0.3, 1, 0.0, True, {"friction": 0.1}),
        (2, ("quad8", "quad8"), 0.0, 4, 0.5, True, {"formulation": "continuous"}),
        (2, ("tri3", "quad4"), 0.3, 3, 0.0, False, {"formulation": "node_to_segment"}),
    ]),
)  # fmt: skip
def test_one_symmetry_of_two_bodies_is_one_of_each(dim, elements, wind, seed, ends, swapped, options):
    """The nodes of two bodies at one place were mixed up; `ends` are meshes that do not match at the ends."""
    mesh, pressures = two_bodies(dim, elements, ends, wind, seed), []
    for groups in ([("F", "S")], [("IN_F", "IN_S"), ("OUT_F", "OUT_S")]):
        model = ring(mesh, "plane_stress" if dim == 2 else "3d")
        for pair in groups:
            model.add_cyclic_symmetry(*(pair[::-1] if swapped else pair), sectors=12)
        for group in ("IN_I", "OUT_O"):
            model.fix(group, "y", axes=fc.CylindricalAxes())
        for group in ("IN_ZMIN", "OUT_ZMIN") if dim == 3 else ():
            model.fix(group, "z")
        sides = ("IN_O", "OUT_I")[:: -1 if swapped else 1]
        model.add_contact("fit", secondary=sides[0], primary=sides[1], clearance=-0.05, **options)
        pressures.append(fc.solve(model, 1)[-1].contact["fit"].pressure)
    assert pressures[0] == pytest.approx(pressures[1], rel=1e-6, abs=1e-6 * pressures[1].max())
    assert pressures[0] == pytest.approx(
        np.full(len(pressures[0]), 0.05 * E / (2.0 * (5.0 / 3.0 + 13.0 / 5.0))), rel=0.15
    )


def test_contact_nodes_at_one_end_alone_are_told():
    """Their pressures are 40 % wrong in this model."""
    mesh = two_bodies(3, ("hex8", "hex8"), 0.0, 0.0)
    x, y, z = mesh.points.T
    mesh = mesh.replace(points=np.column_stack([x, y, z + 0.1 * np.arctan2(y, x) * np.sin(np.pi * z)]))
    model = ring(mesh, "3d")
    model.add_cyclic_symmetry("F", "S", sectors=12)
    for group, axis in (("IN_I", "y"), ("OUT_O", "y"), ("IN_ZMIN", "z"), ("OUT_ZMIN", "z")):
        model.fix(group, axis, **({"axes": fc.CylindricalAxes()} if axis == "y" else {}))
    model.add_contact("fit", secondary="IN_O", primary="OUT_I", clearance=-0.05)
    with pytest.warns(fc.FastcontactWarning, match="of 'F' and 'S', contact 'fit' has 2 nodes without"):
        fc.solve(model, 1)


def layers(seed=None):
    """Two layers with coincident nodes at the interface, which reaches the ends L and R."""
    mesh = fc.generate.block_on_block("quad4", divisions_lower=(8, 4), divisions_upper=(8, 4))
    for side in ("L", "R"):
        name = {"L": "LEFT", "R": "RIGHT"}[side]
        mesh = mesh.merged_groups(side, [f"LOWER_{name}", f"UPPER_{name}"])
    return mesh if seed is None else image_of(mesh, Image(seed=seed))[0]


@pytest.mark.parametrize("joined", ["periodic", "related", "nodes"])
def test_one_period_of_two_layers_in_contact(joined):
    mesh = layers(None if joined == "related" else 5)
    if joined == "nodes":  # without facets, nodes at one place belong to different bodies
        mesh = mesh.with_groups(points={side: mesh.points_of(side) for side in "LR"})
    model = ring(mesh)
    if joined == "related":
        model.relate_groups("L", "R", "xy")
    else:
        model.add_periodicity("L", "R")
    supported(model, LOWER_BOTTOM="xy", UPPER_TOP={"x": 0.0, "y": -0.02})
    model.add_contact("c", secondary="CONT_UPPER", primary="CONT_LOWER")
    step = fc.solve(model, 1)[-1]
    exact = 0.002 * E * (1.0 - NU) / ((1.0 + NU) * (1.0 - 2.0 * NU))
    assert step.contact["c"].pressure == pytest.approx(np.full(9, exact), rel=1e-6)
    assert step.displacement[:, 0] == pytest.approx(np.zeros(mesh.n_points), abs=1e-9)


def test_a_crack_that_reaches_both_ends():
    """Its sides belong to one body. The facets of the ends tell them apart, and single nodes are refused."""
    mesh = layers()
    middle = np.flatnonzero((np.abs(mesh.points[:, 1]) < 1e-9) & (np.abs(mesh.points[:, 0] - 5.0) < 2.0))
    joined = np.arange(mesh.n_points)
    joined[middle] = [middle[(mesh.points[middle] == mesh.points[node]).all(axis=1)][0] for node in middle]
    mesh = mesh.replace(cells={name: joined[block] for name, block in mesh.cells.items()})
    assert fc.mesh.topology.bodies(mesh)[0] == 1
    model = ring(mesh)
    model.add_periodicity("L", "R")
    first, second = model.periodic_interfaces[0][:2]
    for side in ("CONT_LOWER", "CONT_UPPER"):
        crack = mesh.points_of(side)
        assert np.isin(first, crack).sum() == 1
        assert np.isin(second, crack).tolist() == np.isin(first, crack).tolist()
    row = np.abs(mesh.points[:, 1]) < 1e-9
    ends = {name: np.flatnonzero(row & (mesh.points[:, 0] == x)) for name, x in (("A", 0.0), ("B", 10.0))}
    model = ring(mesh.with_groups(points=ends))
    with pytest.raises(fc.ModelError, match=r"of 'B' coincide, and neither .* join groups of one body at a time"):
        model.add_periodicity("A", "B")


def test_pretension_of_two_bodies_cut_in_one_plane():
    parts = [box((1.0, 1.0, 2.0), (1, 1, 2), origin=(x, 0.0, 0.0)) for x in (0.0, 1.0)]
    parts = [renamed(part, {end: f"{name}_{end}" for end in ("ZMIN", "ZMAX")}) for name, part in zip("AB", parts)]
    mesh = image_of(union(*parts), Image(seed=3))[0]
    mesh = mesh.with_facet_group("CUT", lambda x: abs(x[:, 2] - 1.0) < 1e-9, between=True)
    model = ring(fc.generate.cut(mesh, "CUT"), "3d")
    for name in "AB":
        supported(model, **{f"{name}_ZMIN": "xyz", f"{name}_ZMAX": "xyz"})
    model.add_pretension("both", "CUT", shortening=0.01)
    section = model.pretensions[0]
    body = fc.mesh.topology.bodies(model.mesh)[1]
    ends = [body[model.mesh.points_of(f"{name}_{end}")[0]] for name in "AB" for end in ("ZMIN", "ZMAX")]
    partner = dict([ends[:2], ends[2:]])
    partner.update({upper: lower for lower, upper in partner.items()})
    assert [partner[b] for b in body[section.nodes]] == body[section.opposite].tolist()
