"""A warning tells where the rotations of a thin body matter, and only there."""

import re
import warnings

import numpy as np
import pytest
from models import elastic_model
from pairwise import first_of

import fastcontact as fc

RADIUS, THICKNESS, FRICTION, SLACK = 40.0, 0.8, 0.25, 8.0


def belt(strain):
    """Return the tension at the end of a belt that is drawn over a quarter of a pulley by a twentieth of its radius."""
    strip = fc.generate.block((1.0, THICKNESS), (60, 1), "quad8")
    angle, radius = (1.0 - strip.points[:, 0]) * np.pi / 2, RADIUS + strip.points[:, 1]
    mesh = strip.replace(points=np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]))
    model = elastic_model(mesh, "plane_strain", E=3000.0, nu=0.4, strain=strain)
    model.add_traction("LEFT", x=-SLACK / THICKNESS)
    model.prescribe("RIGHT", y=-2.0)
    pulley = fc.obstacles.Sphere((0.0, 0.0), RADIUS)
    model.add_obstacle("pulley", secondary="BOTTOM", obstacle=pulley, friction=FRICTION, formulation="node_to_segment")
    return -fc.solve(model, 6)[-1].reaction[mesh.points_of("RIGHT"), 1].sum()


def test_a_belt_drawn_far_needs_finite_strains():
    """With small strains the tension is too small (Euler and Eytelwein)."""
    theory = SLACK * np.exp(FRICTION * np.pi / 2)
    with pytest.warns(fc.FastcontactWarning, match=r"of up to 0\.049 rad matter in body 'BLOCK': .* up to 8\d%"):
        linear = belt("small")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert belt("finite") == pytest.approx(theory, rel=0.02)  # bending lifts the ends
    assert linear < 0.95 * theory


@pytest.mark.parametrize("kinematics", ["plane_stress", "axisymmetric"])
def test_bending_stresses_do_no_work_on_neglected_strains(kinematics):
    """A slender bar or thin ring bends by twice its thickness, which linear kinematics describe well."""
    mesh = fc.generate.block((20.0, 0.5), (40, 2), "quad8", origin=(1000.0, 0.0))
    model = elastic_model(mesh, kinematics, LEFT="xy", RIGHT={"y": -1.0})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fc.solve(model, 1)


def rings(dim):
    """A quarter of two rings in 2D, or a twelfth in 3D; groups BORE, RIM, CONT_INNER, CONT_OUTER, FIRST and SECOND."""
    parts = []
    for name, inside, outside, sides in (
        ("A", 10.0, 25.0, ("BORE", "CONT_INNER")),
        ("B", 25.0, 50.0, ("CONT_OUTER", "RIM")),
    ):
        block = (
            fc.generate.block((1.0, 1.0), (6, 16), "quad8")
            if dim == 2
            else fc.generate.box((1.0,) * 3, (4, 4, 1), "hex20")
        )
        x = block.points
        radius, angle = inside + (outside - inside) * x[:, 0], (np.pi / 2 if dim == 2 else np.pi / 6) * x[:, 1]
        block = block.replace(points=np.column_stack([radius * np.cos(angle), radius * np.sin(angle), 4.0 * x[:, 2:]]))
        old = ("LEFT", "RIGHT", "BOTTOM", "TOP") if dim == 2 else ("XMIN", "XMAX", "YMIN", "YMAX")
        new = dict(zip(old, (*sides, f"{name}_FIRST", f"{name}_SECOND"), strict=True))
        parts.append(
            fc.generate.renamed(block, {group: new.get(group, f"{name}_{group}") for group in block.group_names})
        )
    mesh = fc.generate.union(*parts)
    for end in ("FIRST", "SECOND"):
        mesh = mesh.merged_groups(end, [f"A_{end}", f"B_{end}"])
    return mesh


def torque(dim, turned, angle, strain="small", **options):
    """Return the torque that turns the rim or bore of a press fit until it slips all around, and the warnings."""
    mesh = rings(dim)
    model = elastic_model(mesh, "plane_stress" if dim == 2 else "3d", E=210e3, strain=strain)
    model.add_cyclic_symmetry("FIRST", "SECOND", sectors=4 if dim == 2 else 12)
    for group, radius in (("RIM", 50.0), ("BORE", 10.0)):
        turn = angle * radius * (group == turned)
        model.prescribe(group, y=turn, axes=fc.CylindricalAxes(), ramp=[(0.0, 0.0), (1.0, 0.0), (2.0, 1.0)])
    for group in ("A_ZMIN", "B_ZMIN") if dim == 3 else ():
        model.fix(group, "z")
    model.add_contact("fit", secondary="CONT_OUTER", primary="CONT_INNER", clearance=-0.03, friction=0.15, **options)
    last = fc.solve(model, [1.0, 1.5, 2.0])[-1]
    held = mesh.points_of(turned)
    x, force = mesh.points[held] + (strain == "finite") * last.displacement[held], last.reaction[held]
    return abs(float((x[:, 0] * force[:, 1] - x[:, 1] * force[:, 0]).sum())), last.warnings


@pytest.mark.filterwarnings(
    "ignore:moments of friction", "ignore:.*across its radius", "ignore:.*past each other at the periodic ends"
)
@pytest.mark.parametrize(
    ("dim", "turned", "angle", "options", "error"),
    first_of(4, [
        (2, "RIM", 0.001, {}, 0.008),
        (2, "RIM", 0.0025, {}, 0.019),
        (2, "RIM", 0.006, {}, 0.055),
        (3, "RIM", 0.006, {}, 0.055),
        (2, "RIM", 0.012, {"formulation": "continuous"}, 0.136),
        (2, "BORE", 0.006, {}, 0.055),
    ]),
)  # fmt: skip
def test_the_torque_of_a_press_fit_that_turns(dim, turned, angle, options, error):
    """The torque of Coulomb's law does not depend on the angle. Small strains deviate by about angle / friction and a warning
    says so from about 3 % on."""
    exact = torque(dim, turned, angle, "finite", **options)[0]
    small, warned = torque(dim, turned, angle, **options)
    assert abs(small / exact - 1.0) == pytest.approx(error, abs=0.01)
    assert len(warned) == (error > 0.03)
    if warned:
        stated = float(warned[0].split("up to ")[1].split("%")[0]) / 100.0
        assert 0.75 * error < stated < 1.5 * error


@pytest.mark.filterwarnings("ignore:the energy of these load steps")
def test_a_block_that_slides_far_needs_no_finite_strains():
    model = elastic_model(fc.generate.block_on_block(shift=-1.0), "plane_strain", LOWER_BOTTOM="xy")
    model.add_pressure("UPPER_TOP", 1.0, ramp=[(0.0, 0.0), (1.0, 1.0), (2.0, 1.0)])
    model.prescribe("UPPER_TOP", x=1.0, ramp=[(0.0, 0.0), (1.0, 0.0), (2.0, 1.0)])
    model.add_contact("c", secondary="CONT_UPPER", primary="CONT_LOWER", friction=0.1)
    last = fc.solve(model, [1.0, 1.5, 2.0])[-1]
    assert last.contact["c"].shear.any()
    assert not [text for text in last.warnings if "moments of friction" in text]


@pytest.mark.filterwarnings("ignore:rotations of up to")
def test_leaves_that_are_pressed_together_before_they_bend():
    """Small strains count the geometric stiffness of the pressure nearly twice, also at rotations of 0.01."""

    def bend(strain):
        mesh = fc.generate.union(
            *(
                fc.generate.renamed(fc.generate.block((100.0, 2.0), (20, 1), "quad8", (0.0, y)), f"{name}_{{}}".format)
                for name, y in (("LOWER", 0.0), ("UPPER", 2.0))
            )
        )
        model = elastic_model(mesh, "plane_stress", E=200e3, strain=strain)
        for name, side in (("LOWER", "BOTTOM"), ("UPPER", "TOP")):
            model.fix(f"{name}_LEFT", "xy")
            model.add_traction(f"{name}_RIGHT", y=-0.17, ramp=[(0.0, 0.0), (1.0, 0.0), (2.0, 1.0)])
            model.add_pressure(f"{name}_{side}", 10.0, ramp=[(0.0, 0.0), (1.0, 1.0), (2.0, 1.0)])
        model.add_contact("c", secondary="UPPER_BOTTOM", primary="LOWER_TOP")
        last = fc.solve(model, [1.0, 2.0])[-1]
        return float(np.abs(last.displacement).max()), last.warnings

    (small, warned), (exact, silent) = bend("small"), bend("finite")
    assert not silent
    assert small < 0.85 * exact
    assert len(warned) == 1
    assert 0.5 * (exact / small - 1.0) < stated_error(warned[0]) < 1.5 * (exact / small - 1.0)


def stated_error(text):
    return float(re.search(r"wrong by (?:about|up to) (\d+)%", text)[1]) / 100.0


@pytest.mark.filterwarnings("ignore:rotations of up to", "ignore:.*across its radius")
def test_a_disc_spring_that_is_flattened():
    """Membrane stresses grow as rotations do: the force is smaller than that of linear kinematics (Almen and Laszlo)."""

    def force(strain):
        strip, slope = fc.generate.block((12.3, 1.5), (20, 2), "quad8", (12.7, 0.0)), 1.2 / 12.3
        x, y = strip.points.T
        mesh = strip.replace(points=np.column_stack([x + slope * y, y + slope * (25.0 - x)]))
        model = elastic_model(mesh, "axisymmetric", E=206e3, strain=strain)
        top, bottom = mesh.points[:, 1].max(), mesh.points[:, 1].min()
        below, above = (fc.obstacles.HalfSpace((0.0, y), (0.0, side)) for y, side in ((bottom, 1.0), (top, -1.0)))
        model.add_obstacle("below", secondary="BOTTOM", obstacle=below)
        model.add_obstacle("above", secondary="TOP", obstacle=above, motion={"y": -0.6})
        last = fc.solve(model, 2)[-1]
        return last.contact["below"].force[1], [text for text in last.warnings if text.startswith("rotations")]

    (small, warned), (exact, silent) = force("small"), force("finite")
    assert not silent
    assert 0.2 < small / exact - 1.0 < 0.4
    assert 0.5 < stated_error(warned[0]) / (small / exact - 1.0) < 1.5


@pytest.mark.filterwarnings("ignore:rotations of up to", "ignore:.*across its radius")
@pytest.mark.parametrize(("force", "error"), [(100.0, 0.041), (300.0, 0.164)])
def test_a_strip_bent_by_rollers_that_forces_drive(force, error):
    """The thrust of the inclined rollers bends the deflected strip further; the warning states the error."""

    def deflection(strain):
        mesh = fc.generate.block((50.0, 4.0), (60, 2), "quad8")
        model = elastic_model(mesh, "plane_stress", E=70e3, strain=strain, LEFT="x")
        support, punch = fc.obstacles.Sphere((40.0, -3.0), 3.0), fc.obstacles.Sphere((28.0, 7.0), 3.0)
        model.add_obstacle("support", secondary="BOTTOM", obstacle=support)
        model.add_obstacle("punch", secondary="TOP", obstacle=punch, force={"y": -force})
        last = fc.solve(model, 3)[-1]
        warned = [text for text in last.warnings if text.startswith("rotations")]
        return float(last.displacement[mesh.points_of("LEFT"), 1].min()), warned

    (small, warned), (exact, silent) = deflection("small"), deflection("finite")
    assert not silent
    assert 1.0 - small / exact == pytest.approx(error, abs=0.01)
    assert len(warned) == (error > 0.1)
    if warned:
        assert stated_error(warned[0]) == pytest.approx(error, abs=0.02)
