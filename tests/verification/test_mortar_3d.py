"""Mortar contact between faces: the patch test on non-matching meshes, and friction in the plane of contact."""

import numpy as np
import pytest
from models import elastic_model
from two_bodies import boxes, held, touching

import fastcontact as fc

KINDS = [(e, e) for e in ("hex8", "tet4", "hex20", "tet10", "hex27", "wedge6", "wedge15")]
KINDS += [("hex8", "tet4"), ("hex20", "tet10"), ("tet10", "hex8")]


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("kinds", KINDS, ids="-".join)
def test_a_uniform_pressure_passes_exactly(kinds, swap):
    mesh = boxes(kinds[0], (2, 3, 2), (3, 2, 2), upper_element=kinds[1])
    last = fc.solve(touching(held(mesh, "3d", 0.1), "mortar", swap), fc.linear_ramp(1))[-1]
    assert np.abs(last.stress[:, 2] + 10.0).max() < 1e-10 * 10.0
    assert np.abs(last.stress[:, [0, 1, 3, 4, 5]]).max() < 1e-10 * 10.0
    assert last.contact["pair"].pressure == pytest.approx(10.0, rel=1e-10)


def test_friction_holds_or_slides_along_the_push():
    """A box on another, pushed by its rigid top at 30 degrees in the plane of contact."""
    forces = {}
    for push in (1e-6, 1e-3):
        mesh = boxes(upper=(3, 2, 2))
        mesh = mesh.replace(points=mesh.points / 10.0)
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
