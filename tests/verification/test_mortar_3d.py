"""Mortar contact between faces: the patch test on non-matching meshes, and friction in the plane of contact."""

import numpy as np
import pytest
from models import elastic_model

import fastcontact as fc
from fastcontact.mesh.generate import box, renamed, union

KINDS = [(e, e) for e in ("hex8", "tet4", "hex20", "tet10", "hex27", "wedge6", "wedge15")]
KINDS += [("hex8", "tet4"), ("hex20", "tet10"), ("tet10", "hex8")]


def two_boxes(lower_element, upper_element, tilt=None):
    parts = []
    for prefix, element, divisions, z in (("L", lower_element, (2, 3, 2), -0.5), ("U", upper_element, (3, 2, 2), 0.0)):
        part = box((1.0, 1.0, 0.5), divisions, element, (0.0, 0.0, z))
        parts.append(renamed(part, {name: f"{prefix}_{name}" for name in part.group_names}))
    mesh = union(*parts)
    return mesh if tilt is None else mesh.replace(points=mesh.points @ tilt.T)


def pressed(mesh, swap=False, **options):
    model = elastic_model(mesh, "3d")
    for side in "LU":
        model.fix(f"{side}_XMIN", "x")
        model.fix(f"{side}_YMIN", "y")
    model.fix("L_ZMIN", "z")
    model.prescribe("U_ZMAX", z=-0.01)
    sides = ("L_ZMAX", "U_ZMIN") if swap else ("U_ZMIN", "L_ZMAX")
    model.add_contact("pair", secondary=sides[0], primary=sides[1], formulation="mortar", **options)
    return model


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("kinds", KINDS, ids="-".join)
def test_a_uniform_pressure_passes_exactly(kinds, swap):
    last = fc.solve(pressed(two_boxes(*kinds), swap), fc.linear_ramp(1))[-1]
    assert np.abs(last.stress[:, 2] + 10.0).max() < 1e-10 * 10.0
    assert np.abs(last.stress[:, [0, 1, 3, 4, 5]]).max() < 1e-10 * 10.0
    assert last.contact["pair"].pressure == pytest.approx(10.0, rel=1e-10)


def test_friction_holds_or_slides_along_the_push():
    """A box on another, pushed by its rigid top at 30 degrees in the plane of contact."""
    forces = {}
    for push in (1e-6, 1e-3):
        mesh = two_boxes("hex8", "hex8")
        model = elastic_model(mesh, "3d", nu=0.0, L_ZMIN="xyz")
        model.prescribe("U_ZMAX", x=push * np.cos(np.pi / 6), y=push * np.sin(np.pi / 6), z=-1e-4)
        model.add_contact("pair", secondary="U_ZMIN", primary="L_ZMAX", formulation="mortar", friction=0.3)
        contact = fc.solve(model, fc.linear_ramp(3))[-1].contact["pair"]
        forces[push] = contact
    sticks, slides = forces[1e-6], forces[1e-3]
    assert sticks.sticking[sticks.active].all()
    assert sticks.dissipation == pytest.approx(0.0, abs=1e-16)
    assert not slides.sticking.any()
    tangential = np.hypot(slides.force[0], slides.force[1])
    assert tangential == pytest.approx(0.3 * slides.force[2], rel=5e-3)  # the upper edge of the box overhangs a little
    assert slides.force[1] / slides.force[0] == pytest.approx(np.tan(np.pi / 6), rel=1e-2)
    assert slides.dissipation > 0
