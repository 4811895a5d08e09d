"""Surfaces that slide past each other at the ends of a period."""

import numpy as np
import pytest
from models import elastic_model

import fastcontact as fc


@pytest.mark.parametrize(("slide", "multipliers", "told"), [
    (0.005, "standard", False), (0.2, "standard", True), (0.2, "dual", False), (1.0, "dual", True),
])  # fmt: skip
@pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")
def test_pressures_at_ends_that_slide_past_each_other_are_told(slide, multipliers, told):
    """A strip under a uniform pressure slides. At the ends of the period, nodes leave the opposite side."""
    mesh = fc.generate.block_on_block(
        size_lower=(10.0, 5.0), size_upper=(10.0, 5.0), divisions_lower=(10, 5), divisions_upper=(10, 5)
    )
    model = elastic_model(mesh, "plane_strain", LOWER_BOTTOM="xy")
    model.add_periodicity("LOWER_LEFT", "LOWER_RIGHT")
    model.add_periodicity("UPPER_LEFT", "UPPER_RIGHT")
    model.add_pressure("UPPER_TOP", 5.0, ramp=[(0.0, 0.0), (1.0, 1.0), (2.0, 1.0)])
    model.prescribe("UPPER_TOP", x=slide, ramp=[(0.0, 0.0), (1.0, 0.0), (2.0, 1.0)])
    model.add_contact(
        "pair", secondary="CONT_UPPER", primary="CONT_LOWER", friction=0.3, formulation="mortar", multipliers=multipliers,
    )  # fmt: skip
    last = fc.solve(model, [1.0, 2.0])[-1]
    assert told == (np.abs(last.contact["pair"].pressure - 5.0).max() > 0.05)
    assert told == any("past each other at the periodic ends" in text for text in last.warnings)
