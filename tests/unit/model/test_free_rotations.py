"""Messages name rotations that nothing stops by their centre or axis."""

import numpy as np
import pytest

import fastcontact as fc


def polar(name, inner, outer, divisions, centre):
    """Return a ring of quadrangles."""
    mesh = fc.generate.block((1.0, 1.0), divisions, "quad8", name=name)
    radius, angle = inner + (outer - inner) * mesh.points[:, 1], -2.0 * np.pi * mesh.points[:, 0]
    around = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    closed = fc.generate.merge_points(mesh.replace(points=around + centre), 1e-9)
    return fc.generate.renamed(closed, {g: f"{name}_{g}" for g in closed.group_names if g != name})


def test_the_rotation_of_a_round_pin_in_its_hole_is_named():
    """Contact without friction hardly resists it, and loads of round-off turn the pin."""
    mesh = fc.generate.union(
        polar("PIN", 3.0, 9.98, (72, 3), [0.0, -0.02]), polar("PLATE", 10.0, 40.0, (60, 5), [0.0, 0.0])
    )
    bore = mesh.points_of("PIN_BOTTOM")
    beside = bore[np.argmin(np.hypot(*(mesh.points[bore] - [3.0, -0.02]).T))]
    model = fc.Model(mesh.with_groups(points={"BESIDE": [beside]}), kinematics="plane_stress")
    model.add_material(fc.LinearElastic(E=210e3, nu=0.3))
    model.fix("PLATE_TOP", "xy")
    model.fix("BESIDE", "x")
    model.add_body_force("PIN", y=-3.0)
    model.add_contact("pin", secondary="PIN_TOP", primary="PLATE_BOTTOM")
    match = (
        r"contact hardly resists one motion, body 'PIN': rotation about \(0, -0\.02\), which changes the gaps 0\.00\d "
    )
    with pytest.raises(fc.ConvergenceError, match=match):
        fc.solve(model, 1, criteria=fc.Criteria(max_halvings=0))


def test_the_rotation_of_a_ring_of_sectors_is_about_its_centre():
    part = fc.generate.block((1.0, 1.0), (4, 2), "quad8")
    radius, angle = 50.0 + 50.0 * part.points[:, 1], -2.0 * np.pi / 6.0 * part.points[:, 0]
    model = fc.Model(
        part.replace(points=np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])), "plane_stress"
    )
    model.add_material(fc.LinearElastic(E=210e3, nu=0.3))
    model.add_cyclic_symmetry("LEFT", "RIGHT", sectors=6)
    model.add_pressure("BOTTOM", 1.0)
    with pytest.raises(fc.ModelError, match=r"1 rigid-body motion is not .*'BLOCK': rotation about \(0, 0\)\. "):
        fc.solve(model, 1)


def test_the_rotation_about_a_hinge_is_about_its_line():
    box = fc.generate.box()
    edge = np.flatnonzero((box.points[:, 0] == 0.0) & (box.points[:, 1] == 1.0))
    model = fc.Model(box.with_groups(points={"EDGE": edge}), kinematics="3d")
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
    model.fix("EDGE", "xyz")
    with pytest.raises(fc.ModelError, match=r"rotation about the line through \(0, 1, 0\.5\) along \(0, 0, 1\)\."):
        fc.solve(model, 1)
