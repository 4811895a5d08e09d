"""A loop of analyses shows a warning once for each line, as Python's default filter does."""

import warnings

from models import elastic_model

import fastcontact as fc


def test_a_loop_shows_the_same_warning_once():
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("default")
        for _ in range(3):
            model = elastic_model(fc.generate.block_on_block(), "plane_strain", LOWER_BOTTOM="xy", UPPER_TOP="x")
            model.prescribe("UPPER_TOP", y=-2.0)
            sides = {"secondary": "CONT_UPPER", "primary": "CONT_LOWER"}
            model.add_contact("joint", **sides, friction=0.3, formulation="node_to_segment")
            fc.solve(model, 1)
    assert [str(warning.message).partition(" is ")[0] for warning in seen] == ["the largest equivalent strain"]
