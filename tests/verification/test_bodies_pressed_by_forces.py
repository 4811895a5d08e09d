"""Nonlinear bodies that contact and a force alone hold: the way that prescribed displacements take, back, and their limit."""

import numpy as np
import pytest
from models import joined, last_step, made_of

import fastcontact as fc

pytestmark = pytest.mark.pairwise

STEEL = fc.LinearElastic(E=1000.0, nu=0.3)
SOFT = fc.ElasticPlastic(E=1000.0, nu=0.3, yield_stress=2.0, hardening=[(0.0, 2.0), (0.1, 4.0)])
PERFECT = fc.ElasticPlastic(E=1000.0, nu=0.3, yield_stress=2.0)
RUBBERS = fc.NeoHookean(E=10.0, nu=0.45), fc.NeoHookean(E=4.0, nu=0.499)


def round_body_on_block(kinematics: str, element: str, laws, contact) -> tuple[fc.Model, str]:
    """Return a body with a round underside on a block, held sideways, and the axis along which it is pressed."""
    if kinematics == "3d":
        body = fc.generate.box((1.0, 1.0, 1.0), (2, 2, 2), element=element)
        block = fc.generate.box((1.6, 1.6, 1.0), (3, 3, 2), element=element, origin=(0.0, 0.0, -1.0))
        sides, top, bottom = ("XMIN", "YMIN"), "ZMAX", "ZMIN"
    else:
        body = fc.generate.block((1.0, 1.0), (6, 6), element=element)
        block = fc.generate.block((1.6, 1.0), (11, 7), element=element, origin=(0.0, -1.0))
        sides, top, bottom = ("LEFT",), "TOP", "BOTTOM"
    points = body.points.copy()
    points[:, -1] += 0.15 * (1.0 - points[:, -1]) * (points[:, :-1] ** 2).sum(axis=1)
    mesh = joined({"0": body.replace(points=points), "1": block})
    model = fc.Model(mesh, kinematics, strain="finite" if isinstance(laws[0], fc.NeoHookean) else "small")
    for i, law in enumerate(laws):
        model.add_material(law, groups=[name for name in (f"BLOCK{i}", f"BOX{i}") if name in model.mesh.group_names])
        for axis, side in zip("xy", sides, strict=False):
            model.fix(f"{side}{i}", axis)
    model.fix(f"{bottom}1", "xyz"[: model.mesh.dim])
    model.add_contact("pair", secondary=f"{top}1", primary=f"{bottom}0", **contact)
    return model, "xyz"[model.mesh.dim - 1]


@pytest.mark.filterwarnings("ignore:nothing determines the position of bodies")  # the last step has no force
@pytest.mark.filterwarnings(
    "ignore:.*element.* across its radius", "ignore:.*plastic strain", "ignore:.*nodal pressure"
)
@pytest.mark.parametrize("contact", [{}, {"formulation": "continuous"}, {"formulation": "node_to_segment"}], ids=str)
@pytest.mark.parametrize(
    ("kinematics", "element", "laws", "depth"),
    [
        ("axisymmetric", "quad8", (STEEL, SOFT), 0.03),
        ("axisymmetric", "quad4", RUBBERS, 0.25),
        ("plane_strain", "tri6", (STEEL, SOFT), 0.03),
        ("3d", "hex8", (STEEL, SOFT), 0.03),
    ],
)
def test_a_force_takes_the_way_of_the_displacement(kinematics: str, element: str, laws, depth: float, contact) -> None:
    """And no more iterations but a few; at the end it goes back to nothing, and the bodies part."""
    driven, axis = round_body_on_block(kinematics, element, laws, contact)
    top, up = ("ZMAX0" if kinematics == "3d" else "TOP0"), "xyz".index(axis)
    driven.prescribe(top, **{axis: -depth})
    at = driven.mesh.points_of(top)
    wanted = fc.solve(driven, 2)
    force = [float(-step.reaction[at, up].sum()) for step in wanted]

    pressed, _ = round_body_on_block(kinematics, element, laws, contact)
    pressed.couple(top, axis)
    pressed.add_force(top, **{axis: -1.0}, ramp=[(0.0, 0.0), (0.5, force[0]), (1.0, force[1]), (2.0, 0.0)])
    *steps, free = fc.solve(pressed, [0.5, 1.0, 2.0])
    for step, same in zip(steps, wanted, strict=True):
        assert step.displacement[at, up] == pytest.approx(same.displacement[at, up], abs=1e-6 * depth)
        assert len(step.iterations["history"]) <= len(same.iterations["history"]) + 4
        *_, before, last = [entry["displacement_change"] for entry in step.iterations["history"]]
        assert last < max(1e-2 * before, 1e-8)
    assert not free.iterations.get("substeps")
    assert free.contact["pair"].normal_force < 1e-6 * force[1]


@pytest.mark.parametrize("strain", ["small", "finite"])
def test_a_force_beyond_the_limit_load_is_told_as_such(strain: str) -> None:
    """A strip without hardening bears 2 / sqrt(3) of its yield stress."""
    model = made_of(fc.generate.block((1.0, 1.0), (2, 2)), "plane_strain", PERFECT, strain=strain, BOTTOM="y", LEFT="x")
    model.add_traction("TOP", y=2.0 * PERFECT.yield_stress)
    with pytest.raises(
        fc.ConvergenceError, match=r"largest plastic strain is .* may not carry larger forces: prescribe"
    ):
        fc.solve(model, [0.5, 1.0])


@pytest.mark.parametrize("distance", [-0.05, 0.05])
def test_sides_that_overlap_at_the_start_are_told_where_the_motion_is_along_them(distance: float) -> None:
    """As those of a snap fit that is pushed on."""
    stub = fc.generate.block((1.0, 2.0), (2, 4), name="STUB")
    cap = fc.generate.block((1.0, 2.0), (2, 4), origin=(1.0 + distance, 0.5), name="CAP")
    model = made_of(joined({"0": stub, "1": cap}), "plane_strain", STEEL, LEFT0="xy", RIGHT1={"x": 0.0, "y": -0.5})
    model.add_contact("bead", secondary="LEFT1", primary="RIGHT0")
    assert len(last_step(model, about="begins with a penetration of 0.05 at")[1]) == (distance < 0.0)


def quadrilateral(divisions, corners, group):
    """A quad8 mesh of a quadrilateral with the corners (4, 2); the names of its sides begin with that of the cell group."""
    mesh = fc.generate.block((1.0, 1.0), divisions, "quad8", name=group)
    x, y = mesh.points.T[:, :, None]
    a, b, c, d = np.array(corners, float)
    mesh = mesh.replace(points=(1 - x) * (1 - y) * a + x * (1 - y) * b + x * y * c + (1 - x) * y * d)
    return fc.generate.renamed(mesh, lambda name: name if len(name) == 1 else f"{group} {name}")


@pytest.mark.parametrize("turn", [0.0, 18.0])
def test_a_blade_at_both_ends_of_a_sector_is_held_by_friction(turn):
    """Its halves slide in the dovetail until both flanks close; sliding that overshoots must not grow."""
    t, join = np.tan(np.pi / 20), fc.generate.merge_points
    inner = [(0, 100), (14 / 1.42, 100), (14, 142), (0, 140)]
    outer = [inner[1], (100 * t, 100), (142 * t, 142), inner[2]]
    disc = [
        ("A", (16, 12), inner),
        ("B", (8, 12), outer),
        ("C", (8, 10), [(14, 142), (142 * t, 142), (150 * t, 150), (6, 150)]),
    ]
    blade = [("D", (12, 16), [(0, 142), (14, 142), (6, 150), (0, 150)])]
    blade.append(("E", (12, 24), [(0, 150), (6, 150), (5, 180), (0, 180)]))
    right = [fc.generate.union(*[quadrilateral(n, x, g) for g, n, x in parts]) for parts in (disc, blade)]
    halves = [[join(mesh, 1e-7) for mesh in right], []]
    halves[1] = [fc.generate.transformed(fc.generate.mirrored(mesh, "x"), rotate=-18.0) for mesh in halves[0]]
    mesh = fc.generate.union(join(fc.generate.union(halves[0][0], halves[1][0]), 1e-7), halves[0][1], halves[1][1])

    def at(angle):
        return lambda x: np.abs(np.arctan2(x[:, 0], x[:, 1]) - angle) < 1e-7

    polar = np.arctan2(mesh.points[:, 0], mesh.points[:, 1])
    mesh = mesh.with_facet_group("FIRST", at(0.0)).with_facet_group("LAST", at(np.pi / 10))
    pin = int(np.argmin(np.hypot(mesh.points[:, 0], mesh.points[:, 1] - 100)))
    mesh = fc.generate.transformed(mesh.with_groups(points={"PIN": [pin]}), rotate=turn)
    materials = {("A", "B", "C"): (210e3, 7.85e-9), ("D", "E"): (115e3, 4.5e-9)}
    model = fc.Model(mesh, "plane_strain")
    for groups, (E, density) in materials.items():
        model.add_material(fc.LinearElastic(E=E, nu=0.3, density=density), groups)
    model.add_cyclic_symmetry("FIRST", "LAST", sectors=20)
    model.fix("PIN", "y", axes=fc.CylindricalAxes())
    model.add_contact("flank", secondary="D RIGHT", primary="C LEFT", friction=0.2)
    model.add_centrifugal(1000.0)
    contact = fc.solve(model, 2)[-1].contact["flank"]
    axes = np.radians(np.where(polar[contact.points] < np.pi / 20, turn, turn - 18.0))
    held = -(contact.force_vectors * np.column_stack([-np.sin(axes), np.cos(axes)])).sum()
    assert held == pytest.approx(2.0 * 4.5e-9 * 1000.0**2 * 38787.3333, rel=1e-6)
