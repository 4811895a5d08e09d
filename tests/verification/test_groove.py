"""A ring compressed in a groove of three rigid walls with friction, with corner nodes held by two walls."""

import numpy as np
import pytest
from models import elastic_model

import fastcontact as fc


def squeezed(element, nu, mu, **options):
    """Return the last step of a ring that the upper wall squeezes before pressure pushes it to the inner wall."""
    mesh = fc.generate.block((4.0, 4.0), (4, 4), element, origin=(20.0, 0.0))
    model = elastic_model(mesh, "axisymmetric", E=10.0, nu=nu)
    plane = fc.obstacles.HalfSpace
    down = {"motion": {"y": -0.1}, "ramp": [(0, 0), (1, 1), (2, 1)]}
    walls = {
        "top": ("TOP", plane((0.0, 4.0), (0.0, -1.0)), down),
        "bottom": ("BOTTOM", plane((0.0, 0.0), (0.0, 1.0)), {}),
        "wall": ("LEFT", plane((20.0, 0.0), (1.0, 0.0)), {}),
    }
    for name, (group, obstacle, motion) in walls.items():
        model.add_obstacle(name, secondary=group, obstacle=obstacle, friction=mu, **motion, **options)
    model.add_pressure("RIGHT", 0.2, ramp=[(0, 0), (1, 0), (2, 1)])
    return fc.solve(model, [1.0, 2.0])[-1]


@pytest.mark.each_value
@pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")  # five nodes a side
@pytest.mark.parametrize("nu", [0.3, 0.4995])
@pytest.mark.parametrize(("element", "mu", "formulation"), [
    ("quad8", 0.1, "continuous"), ("quad8", 0.3, "continuous"), ("quad4", 0.1, "node_to_segment"),
    ("quad8", 0.1, "node_to_segment"), ("quad8", 0.3, "mortar"),
])  # fmt: skip
def test_corner_nodes_of_walls_with_friction_settle(element, mu, formulation, nu):
    """The walls balance each other along the axis, and friction is in its cone."""
    step = squeezed(element, nu, mu, formulation=formulation)
    top, bottom, wall = (step.contact[name] for name in ("top", "bottom", "wall"))
    size = abs(top.force[1])
    # What the walls above and below do not share is the friction of the inner wall.
    assert top.force[1] + bottom.force[1] + wall.force[1] == pytest.approx(0.0, abs=1e-6 * size)
    for contact, normal in ((top, 1), (bottom, 1), (wall, 0)):
        along, across = (
            np.abs(contact.force_vectors[:, 1 - normal]).sum(),
            np.abs(contact.force_vectors[:, normal]).sum(),
        )
        assert along <= mu * across * (1 + 1e-3)
