"""Floating bodies, with and without friction, cost multigrid at most ten linear solutions."""

import numpy as np
import pytest
from models import elastic_model, joined, made_of, plates, supported, with_contact, with_obstacle

import fastcontact as fc


def wedge():
    """A wedge pressed into the notch between two blocks."""

    def leaning(mesh, of):
        points = mesh.points.copy()
        points[:, 0] = of(points[:, 0], 0.6 + 0.25 * points[:, 1])
        return mesh.replace(points=points)

    left, right, middle = (
        fc.generate.block((width, 3.0), divisions, "quad4", (start, 0.0))
        for start, width, divisions in ((-4.0, 4.0, (8, 6)), (0.0, 4.0, (8, 6)), (-1.0, 2.0, (5, 7)))
    )
    left = leaning(left, lambda x, half: -4.0 + (x + 4.0) * (4.0 - half) / 4.0)
    right = leaning(right, lambda x, half: 4.0 - (4.0 - x) * (4.0 - half) / 4.0)
    mesh = joined({"0": left, "1": right, "2": leaning(middle, lambda x, half: x * half)})
    model = elastic_model(mesh, "plane_strain", E=2e5, LEFT0="xy", RIGHT1="xy")
    model.add_pressure("TOP2", 10.0)
    model.add_contact("l", secondary="LEFT2", primary="RIGHT0", friction=0.3)
    return with_contact(model, "r", "RIGHT2", "LEFT1", friction=0.3)


def ring(radii, heights, divisions):
    """Return a quarter of a ring."""
    size = (radii[1] - radii[0], np.pi / 2, heights[1] - heights[0])
    mesh = fc.generate.box(size, divisions, origin=(radii[0], 0.0, heights[0]))
    r, angle, z = mesh.points.T
    return mesh.replace(points=np.column_stack([r * np.cos(angle), r * np.sin(angle), z]))


def gasket():
    """A quarter of a soft ring between two flanges that pressure clamps."""
    rings = {
        "0": ring((4, 10), (0.0, 2.0), (6, 10, 2)),
        "1": ring((5, 7), (2.0, 2.3), (3, 13, 1)),
        "2": ring((4, 10), (2.3, 4.3), (5, 9, 2)),
    }
    model = fc.Model(joined(rings), "3d")
    for i, E in enumerate((2e5, 2e3, 2e5)):
        model.add_material(fc.LinearElastic(E, 0.3), groups=[f"BOX{i}"])
        supported(model, **{f"YMIN{i}": "y", f"YMAX{i}": "x"})
    model.fix("ZMIN0", "z")
    model.add_pressure("ZMAX2", 10.0)
    model.add_contact("lower", secondary="ZMIN1", primary="ZMAX0", friction=0.3)
    return with_contact(model, "upper", "ZMAX1", "ZMIN2", friction=0.3)


def bolt():
    """A quarter of a bolt that clamps two plates, of which the rim of the lower one is held."""
    parts = {
        "SHANK": ring((0.5, 3.0), (-3.0, 11.0), (2, 6, 14)),
        "NUT": ring((3.0, 6.0), (-3.0, 0.0), (3, 6, 3)),
        "HEAD": ring((3.0, 6.0), (8.0, 11.0), (3, 6, 3)),
    }
    shape = fc.generate.merge_points(joined(parts), 1e-6)
    shape = shape.with_facet_group("CUT", lambda x: abs(x[:, 2] - 4.0) < 1e-6, between=True)
    plates = {"0": ring((3.5, 12.0), (0.0, 4.0), (5, 7, 2)), "1": ring((3.5, 12.0), (4.0, 8.0), (5, 8, 2))}
    mesh = fc.generate.union(fc.generate.cut(shape, "CUT"), joined(plates))
    model = elastic_model(mesh, "3d", E=2e5, XMAX0="z")
    for part in (*parts, *plates):
        supported(model, **{f"YMIN{part}": "y", f"YMAX{part}": "x"})
    model.add_pretension("bolt", "CUT", force=1000.0)
    model.add_contact("head", secondary="ZMINHEAD", primary="ZMAX1", friction=0.3)
    model.add_contact("nut", secondary="ZMAXNUT", primary="ZMIN0", friction=0.3)
    return with_contact(model, "plates", "ZMIN1", "ZMAX0", friction=0.3)


@pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")
@pytest.mark.parametrize(
    ("model", "of_linear", "held", "force"),
    # Iterations of a linear solution of the same bodies on the springs; the load that the first pair carries along an axis.
    # Stiff springs, whose positions Newton's method sought, took 681 and 255 for plates and wedge.
    [
        (lambda: plates(0.3), 15, 2, 490.0),
        (wedge, 11, 1, 13.5),
        (gasket, 19, 2, 378.0 * 10.0 * np.sin(np.pi / 18)),
        (bolt, 31, 2, 1000.0),
    ],
)
def test_ten_linear_solutions_hold_loose_bodies(model, of_linear, held, force):
    (step,), (exact,) = (fc.solve(model(), 1, linear_solver=solver) for solver in ("amg", "direct"))
    assert step.iterations["linear_iterations"] <= 10 * of_linear
    assert not any("factorises the matrix" in text for text in step.warnings)  # multigrid was not replaced
    assert abs(next(iter(step.contact.values())).force[held]) == pytest.approx(force, rel=1e-6)
    np.testing.assert_allclose(step.displacement, exact.displacement, atol=1e-9 * np.abs(exact.displacement).max())
    for name, contact in exact.contact.items():
        np.testing.assert_allclose(step.contact[name].force, contact.force, atol=1e-8 * np.abs(contact.force).max())


def layer(contrast):
    """A soft layer between two plates, the upper one pressed by a disc."""
    parts = {str(i): fc.generate.block((4.0, 1.0), (n, 2), "quad4", (0.0, i)) for i, n in enumerate((6, 5, 7))}
    laws = {f"BLOCK{i}": fc.LinearElastic(E, 0.0) for i, E in enumerate((contrast, 1.0, contrast))}
    model = made_of(joined(parts), "plane_strain", laws, BOTTOM0="xy")
    for i in (1, 2):
        model.fix(f"LEFT{i}", "x")
        model.add_contact(f"c{i}", secondary=f"BOTTOM{i}", primary=f"TOP{i - 1}")
    disc = fc.obstacles.Sphere((1.0, 5.0), R=2.0)
    return with_obstacle(model, "disc", "TOP2", disc, motion={"y": -0.1}, friction=0.5, formulation="continuous")


@pytest.mark.filterwarnings("ignore:.*element across", "ignore:Young.s moduli differ")
def test_a_layer_between_stiff_bodies_costs_as_much_at_any_contrast():
    steps = [fc.solve(layer(contrast), 1)[-1] for contrast in (1e6, 1e7)]
    assert [step.iterations["active_set_iterations"] for step in steps] == [25, 25]
    one, other = (step.contact["disc"].force for step in steps)
    np.testing.assert_allclose(one, other, rtol=1e-3)
