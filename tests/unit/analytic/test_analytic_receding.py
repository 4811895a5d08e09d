"""Receding contact of a layer: table, balance, convergence, limits."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pairwise import first_of

from fastcontact.analytic import receding, receding_layer

REFERENCE = json.loads((Path(__file__).parents[3] / "data/reference/receding_layer.json").read_text())


def layer(ratio, load, **more):
    """Layer of modulus `ratio` times that of the half-plane, plane stress for plain moduli."""
    half_plane = {"E2": 1.0 / ratio} if ratio else {}
    unit = {"E1": 1.0, "nu1": 0.0, "thickness": 1.0, "force": 1.0, **half_plane, **more}
    return receding_layer(**unit, load_half_width=load)


@pytest.mark.parametrize("row", REFERENCE["rows"])
def test_matches_table(row):
    ratio, load, half_width, pressure = row
    contact = layer(ratio, load)
    error = 2e-7 if ratio == 10.0 else 5e-9
    assert contact.half_width == pytest.approx(half_width, abs=error)
    assert contact.pressure_max == pytest.approx(pressure, abs=error)


@pytest.mark.parametrize(("ratio", "load"), [(0.0, 0.0), (1.0, 0.5), (10.0, 3.0), (100.0, 0.0)])
def test_pressure_carries_the_force_and_vanishes_at_the_edge(ratio, load):
    contact = layer(ratio, load)
    theta = (np.arange(500) + 0.5) * math.pi / 500
    x = contact.half_width * np.cos(theta)
    integral = (contact.pressure(x) * contact.half_width * np.sin(theta)).mean() * math.pi
    assert integral == pytest.approx(1.0, rel=1e-5)
    assert (contact.pressure(x) > 0.0).all()
    assert contact.pressure(contact.half_width) == pytest.approx(0.0, abs=1e-10)
    assert contact.pressure(1.1 * contact.half_width) == 0.0
    edge = contact.pressure(contact.half_width * (1.0 - np.array([1e-4, 4e-4])))
    assert edge[1] / edge[0] == pytest.approx(2.0, rel=1e-2)  # grows with the root of the distance


@pytest.mark.parametrize(("ratio", "load"), first_of(1, [(0.0, 10.0), (100.0, 1.0)]))
def test_series_is_long_enough(ratio, load, monkeypatch):
    found = layer(ratio, load)
    monkeypatch.setattr(receding, "_TERMS", 160)
    longer = layer(ratio, load)
    assert found.series != longer.series
    assert found.half_width == pytest.approx(longer.half_width, rel=2e-6)
    assert found.pressure_max == pytest.approx(longer.pressure_max, rel=2e-6)


def test_rigid_half_plane_is_the_limit_of_a_hard_one():
    assert layer(0.0, 0.5).half_width == pytest.approx(layer(1e-12, 0.5).half_width, rel=1e-10)


def test_wide_load_goes_straight_through():
    contact = layer(0.5, 8.0)
    np.testing.assert_allclose(contact.pressure([0.0, 2.0, 4.0]), 1.0 / 16.0, rtol=2e-3)


def test_plane_strain_counts_with_plane_strain_moduli():
    strain = layer(2.0, 0.0, nu1=0.3, nu2=0.2, kinematics="plane_strain")
    stress = layer(2.0 * 0.96 / 0.91, 0.0)
    assert strain.half_width == pytest.approx(stress.half_width, rel=1e-12)


@settings(max_examples=25)
@given(force=st.floats(1e-3, 1e6), h=st.floats(1e-3, 1e3))
def test_width_does_not_depend_on_force_and_scales_with_thickness(force, h):
    one = layer(1.0, 0.5)
    other = layer(1.0, 0.5 * h, thickness=h, force=force)
    assert other.half_width == pytest.approx(one.half_width * h, rel=1e-10)
    assert other.pressure_max == pytest.approx(one.pressure_max * force / h, rel=1e-9)
