"""Quantities between nodes: maxima of fields, edges of pressures."""

from types import SimpleNamespace

import numpy as np
import pytest

from fastcontact.mesh.generate import block
from fastcontact.studies.quantities import contact_radius, peak


def test_a_maximum_on_the_axis_is_that_of_a_quartic_along_it():
    mesh = block((1.0, 2.0), (4, 60))
    x, y = mesh.points.T
    value, where = peak(mesh, 3.0 - 2.0 * (y - 0.917) ** 2 + (y - 0.917) ** 4 - x**2, axisymmetric=True)
    assert value == pytest.approx(3.0, rel=1e-12)
    assert where == pytest.approx([0.0, 0.917], abs=1e-9)


@pytest.mark.parametrize("axisymmetric", [True, False])
def test_with_few_nodes_a_parabola_through_the_neighbours_does(axisymmetric):
    mesh = block((1.0, 2.0), (4, 8))
    x, y = mesh.points.T
    x0 = 0.0 if axisymmetric else 0.55
    value, where = peak(mesh, 3.0 - (y - 0.9) ** 2 - (x - x0) ** 2, axisymmetric)
    assert value == pytest.approx(3.0, rel=1e-12)
    assert where == pytest.approx([x0, 0.9], abs=1e-12)


def test_where_no_vertex_is_near_the_node_itself_is_taken():
    mesh = block((1.0, 2.0), (4, 8))
    values = mesh.points @ [1.0, 2.0]  # largest in a corner
    value, where = peak(mesh, values, axisymmetric=False)
    assert value == 5.0
    assert where.tolist() == [1.0, 2.0]


def contact(pressure, radius, r=None):
    r = np.linspace(0.0, 1.0, len(pressure)) if r is None else r
    pressure = np.asarray(pressure, float)
    return SimpleNamespace(radius=radius, across=r, active=pressure > 0, pressure=pressure)


def test_the_radius_is_where_the_pressure_of_hertz_ends():
    r = np.linspace(0.0, 1.0, 41)
    pressure = np.sqrt(np.maximum(1.0 - (r / 0.718) ** 2, 0.0))
    assert contact_radius(contact(pressure, (0.7, 0.725), r)) == pytest.approx(0.718, rel=1e-12)


@pytest.mark.parametrize(
    ("pressure", "bracket", "radius"),
    [
        ([0.0] * 5, (np.nan, np.nan), np.nan),  # open
        ([1.0, 0.5, 0.0, 0.0, 0.0], (0.25, 0.5), 0.375),  # too few nodes for a line
        ([1.0, 1.0, 1.1, 1.1, 1.2, 1.4, 1.8, 3.0, 0.0], (0.875, 1.0), 1.0),  # a punch
    ],
)
def test_where_there_is_no_edge_to_fit_the_bracket_answers(pressure, bracket, radius):
    assert contact_radius(contact(pressure, bracket)) == pytest.approx(radius, nan_ok=True)
