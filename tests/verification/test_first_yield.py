"""First yield under a ball: at a pressure of 1.6 Y, 0.48 contact radii below the surface (Johnson, 1985, section 6.1)."""

import numpy as np
import pytest
from models import made_of

import fastcontact as fc

E, NU, Y, R = 1000.0, 0.3, 1.0, 10.0


def test_first_yield_under_a_ball() -> None:
    modulus = E / (1.0 - NU**2)
    unit = np.pi * R * Y / (2.0 * modulus)  # contact radius where the largest pressure is Y
    mesh = fc.generate.graded_block(element="quad8", width=20.0 * unit, contact_radius=2.0 * unit)
    model = made_of(mesh, "axisymmetric", fc.ElasticPlastic(E=E, nu=NU, yield_stress=Y), SYMMETRY_X="x", BOTTOM="y")
    force = 4.0 / 3.0 * modulus / R * unit**3  # p0 = Y; it grows with the third power
    model.add_obstacle("ball", secondary="TOP", obstacle=fc.obstacles.Sphere((0.0, R), R), force={"y": -force})
    pressures = np.array([1.5, 1.55, 1.6, 1.65, 1.7])
    steps = fc.solve(model, pressures**3)
    strain = [step.cell_fields["plastic_strain"].max() for step in steps]
    first = int(np.argmax(np.array(strain) > 0.0))
    assert strain[first] > 0.0
    assert 1.55 <= pressures[first] <= 1.65
    yielded = steps[first].cell_fields["plastic_strain"].argmax()
    place = np.concatenate([mesh.points[block].mean(axis=1) for block in mesh.solids.values()])[yielded]
    radius = pressures[first] * unit
    assert place[0] < 0.2 * radius
    assert place[1] == pytest.approx(-0.48 * radius, abs=0.1 * radius)
