"""Mortar in the plane with partly covered facets: no singular field, and a balanced result."""

import numpy as np
import pytest
from models import elastic_model, supported, united, with_contact

import fastcontact as fc
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.formulations.mortar import SMALLEST_EIGENVALUE, CompleteFacets, independent_values
from fastcontact.mesh.generate import block

pytestmark = pytest.mark.each_value


def named(lower, upper):
    return united(L_=lower, U_=upper)


@pytest.mark.parametrize("element", ["quad4", "quad8"])
@pytest.mark.parametrize("kinematics", ["plane_strain", "axisymmetric"])
@pytest.mark.parametrize("covered", [0.002, 0.02, 0.1, 0.2, 0.4, 0.6, 0.9])
def test_a_uniform_pressure_passes_up_to_the_end_of_the_primary_side(element, kinematics, covered):
    """The primary side ends inside a secondary facet after any part of it."""
    width = 0.5 + covered * 0.25
    lower, upper = block((1.0, 0.5), (4, 2), element), block((width, 0.5), (3, 2), element, (0.0, 0.5))
    model = elastic_model(named(lower, upper), kinematics, nu=0.0, U_LEFT="x", L_LEFT="x")
    # The lower block is held by its surface: it does not bend beside the upper one.
    supported(model, L_TOP="y", L_BOTTOM="y", U_TOP={"y": -0.005})
    model.add_contact("pair", secondary="L_TOP", primary="U_BOTTOM", formulation="mortar")
    last = fc.solve(model, fc.linear_ramp(1), criteria=fc.Criteria(geometry=1e-12))[-1]
    upper_nodes = model.mesh.points_of("U_TOP")
    assert last.stress[upper_nodes, 1] == pytest.approx(-10.0, rel=1e-9)
    whole = last.contact["pair"].coordinates[:, 0] < 0.25 - 1e-9
    assert last.contact["pair"].pressure[whole] == pytest.approx(10.0, rel=1e-9)


@pytest.mark.parametrize("element", ["quad4", "quad8"])
def test_swapped_sides_agree_where_one_curves_away(element):
    force = []
    for sides in (("U_BOTTOM", "L_TOP"), ("L_TOP", "U_BOTTOM")):
        low, up = block((1.0, 0.5), (16, 8), element), block((1.3, 0.5), (16, 8), element, (0.0, 0.5))
        points = low.points.copy()
        points[:, 1] -= 0.6 * points[:, 0] ** 2 * points[:, 1]
        model = elastic_model(named(low.replace(points=points), up), "plane_strain", L_LEFT="x", U_LEFT="x")
        supported(model, L_BOTTOM="y", U_TOP={"y": -0.04})
        model.add_contact("pair", secondary=sides[0], primary=sides[1], formulation="mortar")
        force.append(abs(fc.solve(model, fc.linear_ramp(1))[-1].contact["pair"].force[1]))
    assert force[0] == pytest.approx(force[1], rel=0.01)


@pytest.mark.parametrize("element", ["quad4", "quad8"])
@pytest.mark.parametrize("axisymmetric", [False, True])
def test_fields_are_as_rich_as_what_takes_part_determines(element, axisymmetric):
    """Against eigenvalues of the field that is left: none is next to zero, and constants remain."""
    mesh = block((1.0, 0.5), (4, 2), element)
    model = fc.Model(
        named(mesh, block((1.0, 0.5), (4, 2), element, (0.0, 0.5))), "axisymmetric" if axisymmetric else "plane_strain"
    )
    model.add_material(fc.LinearElastic(1.0, 0.0))
    model.add_contact("pair", secondary="L_TOP", primary="U_BOTTOM", formulation="mortar")
    side = model.bind(model.contact[0]).secondary
    whole = CompleteFacets.of(side.blocks[0], model.mesh.points, axisymmetric)
    k, rng = side.only_block.local.shape[1], np.random.default_rng(3)
    for _ in range(50):
        s, w = np.polynomial.legendre.leggauss(6)
        a, b = np.sort(rng.uniform(0.0, 1.0, 2))
        mass = np.zeros((len(side.only_block.local), k, k))
        for f, facet in enumerate(side.only_block.facets):
            x = model.mesh.points[facet, 0]
            low, high = (np.clip(end, x[:2].min(), x[:2].max()) for end in (a, b))
            at = 0.5 * (low + high) + 0.5 * (high - low) * s
            xi = 2.0 * (at - x[0]) / (x[1] - x[0]) - 1.0
            N = fc.mesh.elements.get(side.only_block.element).shape(xi[:, None])
            dA = 0.5 * (high - low) * w * (2.0 * np.pi * at if axisymmetric else 1.0)
            mass[f] = (dA[:, None, None] * N[:, :, None] * N[:, None, :]).sum(axis=0)
        nodes, independent = independent_values(side, whole, mass, np.zeros(len(side.points), bool))
        total, reference = np.zeros((2, len(side.points), len(side.points)))
        for one, full, local in zip(mass, whole.mass, side.only_block.local, strict=True):
            total[np.ix_(local, local)] += one
            reference[np.ix_(local, local)] += full if one.any() else 0.0
        Z = nodes.toarray()
        values = np.linalg.eigvals(np.linalg.solve(Z.T @ reference @ Z, Z.T @ total @ Z)).real
        assert values.min() > 0.01 * SMALLEST_EIGENVALUE
        seen = np.unique(side.only_block.local[mass.any(axis=(1, 2))])
        assert Z[seen].sum(axis=1) == pytest.approx(1.0)
        assert np.array_equal(Z[independent], np.eye(len(independent)))


@pytest.mark.filterwarnings("ignore:contact .pair.. the integration points of complete facets")
@pytest.mark.parametrize("kind", ["unilateral", "bilateral", "tied", "friction"])
@pytest.mark.parametrize("element", ["quad4", "quad8", "tri3", "tri6"])
def test_contact_at_the_nodes_holds_the_node_on_the_axis(element, kind):
    mesh = fc.generate.block_on_block(element, divisions_lower=(6, 3), divisions_upper=(5, 3))
    model = elastic_model(mesh, "axisymmetric")
    supported(model, LOWER_LEFT="x", UPPER_LEFT="x", LOWER_BOTTOM="xy", UPPER_TOP={"y": -0.2})
    options = {"friction": 0.3} if kind == "friction" else {"kind": kind}
    with_contact(model, "pair", "CONT_UPPER", "CONT_LOWER", formulation="continuous", integration="node", **options)
    contact = fc.solve(model, fc.linear_ramp(1))[-1].contact["pair"]
    axis = contact.coordinates[:, 0].argmin()
    assert contact.active[axis]
    assert abs(contact.gap[axis]) < (1e-6 if kind == "friction" else 1e-10)  # friction settles as the geometry does
    assert contact.pressure[axis] > 0.0


def test_fewer_points_than_a_parabola_has_nodes_leave_a_line():
    mesh = fc.generate.block_on_block("quad8", divisions_lower=(3, 2), divisions_upper=(3, 2))
    model = elastic_model(mesh, "plane_strain", nu=0.0, LOWER_BOTTOM="xy", UPPER_TOP={"x": 0.0, "y": -0.02})
    model.add_contact("pair", secondary="CONT_UPPER", primary="CONT_LOWER", formulation="mortar", n_gauss=2)
    assert len(model.bind(model.contact[0]).unilateral(Configuration.undeformed(mesh.points)).nodal.independent) == 4
    assert fc.solve(model, fc.linear_ramp(1))[-1].contact["pair"].pressure == pytest.approx(2.0, rel=1e-9)
