"""Tied sides with an offset: free rotations, moments of shear, with every formulation and solver."""

import numpy as np
import pytest
from models import elastic_model

import fastcontact as fc

pytestmark = pytest.mark.pairwise

TURN = np.array([[0.0, -3e-4, 2e-4], [3e-4, 0.0, -5e-4], [-2e-4, 5e-4, 0.0]])
FORMULATIONS = [("node_to_segment", {}), ("continuous", {}), ("mortar", {}), ("mortar", {"multipliers": "dual"})]
NAMES = {"XMIN": "LEFT", "XMAX": "RIGHT", "YMIN": "FRONT", "YMAX": "BACK", "ZMIN": "BOTTOM", "ZMAX": "TOP"}


def apart(element, gap):
    """Two blocks, one above the other at a distance, with meshes that do not match."""
    if element.startswith(("hex", "tet", "wedge")):
        lower = fc.generate.renamed(fc.generate.box((2.0, 1.0, 1.0), (4, 3, 2), element, name="LOWER"), NAMES)
        upper = fc.generate.box((2.0, 1.0, 1.0), (3, 2, 2), element, (0.0, 0.0, 1.0 + gap), name="UPPER")
        return fc.generate.union(lower, fc.generate.renamed(upper, {k: f"{v}2" for k, v in NAMES.items()}))
    lower = fc.generate.block((2.0, 1.0), (6, 3), element, name="LOWER")
    upper = fc.generate.block((2.0, 1.0), (4, 2), element, (0.0, 1.0 + gap), name="UPPER")
    sides = ("BOTTOM", "TOP", "LEFT", "RIGHT")
    names = [*sides, *(f"{a}_{b}" for a in sides[:2] for b in sides[2:])]
    return fc.generate.union(lower, fc.generate.renamed(upper, {name: f"{name}2" for name in names}))


def tied(mesh, kinematics, formulation, options, sides=("BOTTOM2", "TOP")):
    model = elastic_model(mesh, kinematics)
    model.add_contact("tie", secondary=sides[0], primary=sides[1], kind="tied", formulation=formulation, **options)
    return model


def cases(elements):
    for element in elements:
        for formulation, options in FORMULATIONS:
            if formulation != "node_to_segment" or element not in ("hex20", "quad8", "tri6"):
                yield pytest.param(
                    element, formulation, options, id="-".join([element, formulation, *options.values()])
                )


# Across gaps longer than facets multigrid may hand over to factors, which a warning tells.
@pytest.mark.parametrize(
    ("solver", "gap"), [("direct", 0.0), ("direct", 0.01), ("direct", 0.5), ("amg", 0.01), ("amg", 0.2)]
)
@pytest.mark.parametrize("sides", [("BOTTOM2", "TOP"), ("TOP", "BOTTOM2")])
@pytest.mark.parametrize(
    ("element", "formulation", "options"), [*cases(["quad4", "quad8", "tri6", "hex8", "tet4", "wedge6"])]
)
def test_the_tied_body_follows_a_rotation_without_stress(element, formulation, options, gap, sides, solver):
    mesh = apart(element, gap)
    model = tied(mesh, "plane_stress" if mesh.dim == 2 else "3d", formulation, options, sides)
    turn = TURN[: mesh.dim, : mesh.dim]
    for k, axis in enumerate("xyz"[: mesh.dim]):
        model.prescribe("BOTTOM", **{axis: lambda points, k=k: points @ turn[k]})
    step = fc.solve(model, fc.linear_ramp(1), linear_solver=solver)[-1]
    accuracy = 1e-12 if solver == "direct" else 3e-12  # the linear tolerance is 1e-10, of displacements of 1e-3
    np.testing.assert_allclose(step.displacement, mesh.points @ turn.T, atol=accuracy)
    assert np.abs(step.stress).max() < 1e-8


@pytest.mark.parametrize(("element", "formulation", "options"), [*cases(["quad4", "quad8", "hex8"])])
@pytest.mark.parametrize("gap", [0.0, 0.5])
def test_shear_across_the_gap_keeps_its_moment(element, formulation, options, gap):
    """Reactions balance force and moment of a load on the upper block about any place; contact forces balance it as well."""
    mesh = apart(element, gap)
    model = tied(mesh, "plane_stress" if mesh.dim == 2 else "3d", formulation, options)
    model.fix("BOTTOM", "xyz"[: mesh.dim])
    model.add_traction("TOP2", x=2.0, **({} if mesh.dim == 2 else {"y": -1.0}))
    step = fc.solve(model, fc.linear_ramp(1))[-1]
    arms, load, reaction, contact = np.zeros((4, mesh.n_points, 3))
    arms[:, : mesh.dim] = mesh.points
    load[:, : mesh.dim], reaction[:, : mesh.dim] = model.load_vector(model.loads[0]), step.reaction
    found = step.contact["tie"]
    np.add.at(contact[:, : mesh.dim], found.points, found.force_vectors)
    both = contact.copy()
    np.add.at(both[:, : mesh.dim], found.primary_points, found.primary_force_vectors)
    moment = np.cross(arms, load).sum(axis=0)
    np.testing.assert_allclose(np.cross(arms, reaction).sum(axis=0), -moment, atol=1e-9)
    np.testing.assert_allclose(np.cross(arms, contact).sum(axis=0), -moment, atol=1e-9)  # on the upper block
    np.testing.assert_allclose(np.cross(arms, both).sum(axis=0), 0.0, atol=1e-9)


@pytest.mark.parametrize("formulation", ["continuous", "mortar"])
def test_rings_with_a_seam_turn_as_one(formulation):
    """Two rings on their circles, a seam of glue between them, turned about their middle."""
    mesh = fc.generate.rings("quad8", divisions_inner=(3, 12), divisions_outer=(3, 9))
    inner = np.zeros(mesh.n_points, bool)
    inner[mesh.points_of("INNER")] = True
    points = mesh.points * np.where(inner, 0.99, 1.0)[:, None]
    mesh = fc.Mesh(points, mesh.cells, mesh.cell_groups, mesh.point_groups)
    model = tied(mesh, "plane_strain", formulation, {}, ("CONT_INNER", "CONT_OUTER"))
    model.prescribe("RIM", x=lambda x: -1e-4 * x[:, 1], y=lambda x: 1e-4 * x[:, 0])
    step = fc.solve(model, fc.linear_ramp(1))[-1]
    np.testing.assert_allclose(step.displacement, 1e-4 * mesh.points[:, ::-1] * [-1.0, 1.0], atol=1e-11)
    assert np.abs(step.stress).max() < 1e-8


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous", "mortar"])
def test_in_axisymmetry_the_tied_body_follows_along_the_axis(formulation):
    model = tied(apart("quad4", 0.2), "axisymmetric", formulation, {})
    model.prescribe("BOTTOM", y=1e-3)
    step = fc.solve(model, fc.linear_ramp(1))[-1]
    np.testing.assert_allclose(step.displacement[:, 1], 1e-3, rtol=1e-9)
    assert np.abs(step.stress).max() < 1e-9
