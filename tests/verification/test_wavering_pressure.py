"""Oscillating nodal pressures give a warning with their size, and its remedy helps."""

import warnings

import numpy as np
import pytest

import fastcontact as fc

LAME = 31.63190504403362


def fitted(element, inner, outer):
    """Return the contact of a bush in a hub (Lame), and what was warned of wavering pressures."""
    mesh = fc.generate.rings(
        element,
        inner_radius=20.0,
        interface_radius=50.0,
        outer_radius=100.0,
        divisions_inner=inner,
        divisions_outer=outer,
    )
    model = fc.Model(mesh, "plane_strain")
    model.add_material(fc.LinearElastic(210_000.0, 0.3), groups=["INNER"])
    model.add_material(fc.LinearElastic(70_000.0, 0.33), groups=["OUTER"])
    model.fix("SYMMETRY_X", "x")
    model.fix("SYMMETRY_Y", "y")
    model.add_contact("fit", secondary="CONT_INNER", primary="CONT_OUTER", clearance=-0.05)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        contact = fc.solve(model, 1)[-1].contact["fit"]
    return contact, [str(warning.message) for warning in told if "waver" in str(warning.message)]


def test_thin_triangles_are_told_and_means_of_neighbours_are_right():
    contact, told = fitted("tri3", (4, 48), (4, 36))
    pressure = contact.pressure[np.argsort(np.arctan2(*contact.coordinates.T))]
    assert np.abs(pressure / LAME - 1).max() > 0.15
    (text,) = told
    assert "'fit': nodal pressures waver from node to node, by" in text
    smooth = 0.25 * (pressure[:-2] + 2 * pressure[1:-1] + pressure[2:])
    assert np.abs(smooth / LAME - 1).max() < 0.55 * np.abs(pressure / LAME - 1).max()


@pytest.mark.parametrize(("element", "inner", "outer"), [("tri3", (14, 36), (16, 28)), ("quad4", (4, 48), (4, 36))])
def test_cells_as_deep_as_wide_and_quadrangles_waver_less(element, inner, outer):
    contact, told = fitted(element, inner, outer)
    assert not told
    assert np.abs(contact.pressure / LAME - 1).max() < 0.13
