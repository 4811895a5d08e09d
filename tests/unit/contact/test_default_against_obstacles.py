"""The default formulation against rigid obstacles: chosen by facet type, and accurate on each."""

import pytest
from models import elastic_model

import fastcontact as fc
from fastcontact.contact import multiplier_field
from fastcontact.mesh import elements

CHOICES = {
    "tri3": "node_to_segment", "tri6": "continuous", "quad4": "continuous", "quad8": "continuous", "tet4": "node_to_segment",
    "hex8": "node_to_segment", "wedge6": "node_to_segment", "tet10": "continuous", "hex20": "continuous",
    "hex27": "node_to_segment",
}  # fmt: skip


def pressed(element, **options):
    """Return the model of a block under a ball."""
    mesh = fc.generate.graded_block(element, width=10.0, contact_radius=2.5, contact_size=0.5, size=2.5)
    up = "xyz"[mesh.dim - 1]
    model = elastic_model(mesh, "axisymmetric" if mesh.dim == 2 else "3d", E=2e5, BOTTOM=up, SYMMETRY_X="x")
    if mesh.dim == 3:
        model.fix("SYMMETRY_Y", "y")
    ball = fc.obstacles.Sphere((0.0,) * (mesh.dim - 1) + (50.0,), 50.0)
    model.add_obstacle("ball", secondary="CONTACT", obstacle=ball, motion={up: -0.1}, **options)
    return model


@pytest.mark.parametrize(("element", "expected"), CHOICES.items())
def test_the_choice_follows_the_cells(element, expected):
    mesh = (fc.generate.block if elements.get(element).dim == 2 else fc.generate.box)(
        (1.0,) * elements.get(element).dim, (1,) * elements.get(element).dim, element
    ).with_facet_group("SIDE", lambda x: x[:, -1] == x[:, -1].max())
    model = fc.Model(mesh, "plane_strain" if mesh.dim == 2 else "3d")
    wall = fc.obstacles.HalfSpace((0.0,) * mesh.dim, (0.0,) * (mesh.dim - 1) + (-1.0,))
    model.add_obstacle("wall", secondary="SIDE", obstacle=wall)
    other = fc.obstacles.HalfSpace((0.0,) * (mesh.dim - 1) + (5.0,), (0.0,) * (mesh.dim - 1) + (-1.0,))
    model.add_obstacle("field", secondary="SIDE", obstacle=other, integration="simpson")
    another = fc.obstacles.HalfSpace((0.0,) * (mesh.dim - 1) + (6.0,), (0.0,) * (mesh.dim - 1) + (-1.0,))
    model.add_obstacle("rubbing", secondary="SIDE", obstacle=another, friction=0.2)
    rubbing = "mortar" if mesh.dim == 3 and expected == "continuous" else expected
    assert [pair.formulation for pair in model.contact] == [expected, "continuous", rubbing]


def test_triangles_under_a_ball_have_no_oscillating_pressure():
    """The mesh-converged largest pressure is 6957 to 0.1 %; that of the continuous formulation is 43 % above it here."""
    (step,) = fc.solve(pressed("tri3"), fc.linear_ramp(1))
    assert step.contact["ball"].pressure_max == pytest.approx(6957.0, rel=0.08)
    (step,) = fc.solve(pressed("tri3", formulation="continuous"), fc.linear_ramp(1))
    assert step.contact["ball"].pressure_max > 1.3 * 6957.0


def test_a_dense_matrix_too_large_to_be_of_use_is_refused(monkeypatch):
    monkeypatch.setattr(multiplier_field, "MOST_ROWS", 20)
    with pytest.raises(
        fc.ContactError,
        match=r"closes \d+ integration points at once.*use formulation='mortar' with multipliers='dual'",
    ):
        fc.solve(pressed("hex20"), fc.linear_ramp(1), linear_solver="direct")
