"""The sag of facets against circles and spheres, and what is said where it is not small beside the play of two sides."""

import numpy as np
import pytest

import fastcontact as fc
from fastcontact.contact.surface import surface
from fastcontact.model.facet_sag import facet_sag, sag_warnings


def fit(element, clearance, divisions=(16, 12), radii=(50.0, 50.0), **options):
    """Two rings, the inner one with another interface radius than the outer one where `radii` differ."""
    mesh = fc.generate.rings(element, divisions_inner=(2, divisions[0]), divisions_outer=(2, divisions[1]))
    inner = np.unique(np.concatenate([block.ravel() for block in mesh.cells_of("INNER").values()]))
    points = mesh.points.copy()
    points[inner] *= radii[0] / radii[1]
    model = fc.Model(mesh.replace(points=points), "plane_strain")
    model.add_material(fc.LinearElastic(E=1.0, nu=0.3))
    if clearance is not None:
        options["clearance"] = clearance
    model.add_contact("fit", secondary="CONT_INNER", primary="CONT_OUTER", **options)
    return model


@pytest.mark.parametrize("n", [8, 32])
def test_sag_of_a_circle(n):
    half = np.pi / 4 / n
    for element, exact in (("quad4", 1 - np.cos(half)), ("quad8", (1 - np.cos(half)) ** 2 / 8)):
        mesh = fc.generate.rings(element, divisions_inner=(1, n), divisions_outer=(1, n))
        inner, outer = (facet_sag(surface(mesh, name), mesh.points) for name in ("CONT_INNER", "CONT_OUTER"))
        assert inner.largest == pytest.approx(50 * exact, rel=0.02)
        assert outer.largest == pytest.approx(inner.largest)
        assert (inner.hollow, outer.hollow) == (False, True)


def test_sag_of_a_sphere_and_of_flat_faces():
    mesh = fc.generate.box((1.0, 1.0, 1.0), (6, 6, 3), "hex8")
    assert facet_sag(surface(mesh, "ZMAX"), mesh.points).largest == 0.0
    x, y, z = mesh.points.T
    mesh = mesh.replace(points=np.column_stack([x, y, z * np.sqrt(100.0 - (x - 0.5) ** 2 - (y - 0.5) ** 2)]))
    sag = facet_sag(surface(mesh, "ZMAX"), mesh.points)
    assert sag.largest == pytest.approx((1 / 6) ** 2 / 80, rel=0.05)
    assert not sag.hollow


@pytest.mark.parametrize("clearance", [0.1, -0.1])
@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous", "mortar"])
def test_a_play_as_small_as_the_sag_is_told(clearance, formulation):
    (text,) = sag_warnings(fit("quad4", clearance, formulation=formulation))
    sag = 50 * (1 - np.cos(np.pi / 48))
    kind = "clearance" if clearance > 0 else "interference"
    assert f"the {kind} of 0.1 between its sides" in text
    assert f"{sag:.3g} between chord and arc" in text
    # With facets of the length that is named there is no warning.
    length = float(text.split("facets of length ")[1].split()[0])
    n = int(np.ceil(np.pi / 2 * 50 / length)) + 1
    assert not sag_warnings(fit("quad4", clearance, (n + 1, n), formulation=formulation))


def test_a_clearance_of_the_geometry_counts():
    (text,) = sag_warnings(fit("quad4", 0.0, (16, 12), (49.8, 50.0)))
    assert "clearance of 0.2 between" in text


@pytest.mark.parametrize(
    "model",
    [
        lambda: fit("quad4", 5.0),
        lambda: fit("quad8", 0.1),
        lambda: fit("quad4", 0.01, (16, 16)),
        lambda: fit("quad4", 0.0),
        lambda: fit("quad4", None, radii=(49.8, 50.0), kind="tied"),
    ],
    ids=["large play", "quadratic facets", "node opposite node", "no play", "tied"],
)
def test_no_word_where_sag_does_not_matter(model):
    assert sag_warnings(model()) == []


def against(formulation, depth=0.05):
    """A ring's bore around a rigid cylinder that is smaller by `depth`."""
    mesh = fc.generate.rings("quad4", divisions_inner=(2, 12), divisions_outer=(2, 12))
    model = fc.Model(mesh, "plane_strain")
    model.add_material(fc.LinearElastic(E=1.0, nu=0.3))
    model.add_obstacle(
        "rod",
        secondary="BORE",
        obstacle=fc.obstacles.Sphere(centre=(0.0, 0.0), R=20.0 - depth),
        formulation=formulation,
    )
    return model


def test_exact_shapes_do_not_sag():
    assert sag_warnings(against("node_to_segment")) == []
    (text,) = sag_warnings(against("continuous"))
    assert "facets of 'BORE'" in text
    assert "clearance of 0.05" in text


def test_bodies_that_do_not_fit_have_no_play():
    model = fc.Model(fc.generate.half_spheres("tri3", size=10.0), "axisymmetric")
    model.add_material(fc.LinearElastic(E=1.0, nu=0.3))
    model.add_contact("hertz", secondary="CONT1", primary="CONT2", clearance=1e-3)
    assert sag_warnings(model) == []
