"""Surfaces that slide past each other at the ends of a cyclic sector."""

import warnings

import numpy as np
import pytest

import fastcontact as fc


@pytest.mark.parametrize("turn", [0.4, 0.02])
def test_pressures_at_ends_that_slide_past_each_other_are_told(turn):
    """A shaft slips in its hub. Nodes at the ends of the sector leave the opposite side, which does not continue there."""
    mesh, axes = fc.generate.rings("quad4", divisions_inner=(2, 8), divisions_outer=(2, 8)), fc.CylindricalAxes()
    model = fc.Model(mesh, "plane_stress")
    model.add_material(fc.LinearElastic(E=1e5, nu=0.3))
    model.fix("BORE", "y", axes=axes)
    model.prescribe("RIM", y=turn, axes=axes, ramp=[(0.0, 0.0), (1.0, 0.0), (2.0, 1.0)])
    model.add_cyclic_symmetry("SYMMETRY_X", "SYMMETRY_Y", sectors=4)
    model.add_contact("fit", secondary="CONT_OUTER", primary="CONT_INNER", friction=0.05, clearance=-0.1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        last = fc.solve(model, [1.0, 2.0])[-1]
    contact = last.contact["fit"]
    slid = np.abs(contact.slip_total).max() > 0.01 * np.ptp(contact.abscissa) / 8
    assert slid == (turn == 0.4)
    assert any("past each other at the periodic ends" in text for text in last.warnings) == slid
