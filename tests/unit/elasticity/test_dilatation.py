"""Mean dilatation: element loops compared with NumPy twins, patch tests, no spurious modes, no locking."""

from dataclasses import replace

import numpy as np
import pytest
from models import made_of
from test_assembly import one_material, operators

import fastcontact as fc
from fastcontact._jit import parallel
from fastcontact._jit.decorators import set_threads, threads
from fastcontact.elasticity import dilatation
from fastcontact.elasticity.stiffness import rigid_modes, stiffness
from fastcontact.mesh import elements
from fastcontact.model.fingerprint import fingerprint

pytestmark = pytest.mark.pairwise

SOLIDS = [e.name for e in elements.ELEMENTS.values() if e.dim > 1]
CASES = [
    (name, kinematics)
    for name in SOLIDS
    for kinematics in (("plane_strain", "axisymmetric") if elements.get(name).dim == 2 else ("3d",))
]
RUBBER = fc.LinearElastic(E=6.0, nu=0.4999)
AVERAGED = np.array([True])


def patch(name, divisions=2):
    """Cells with curved edges, away from the axis."""
    if elements.get(name).dim == 2:
        mesh = fc.generate.block((2.0, 1.5), (divisions, divisions), name, origin=(2.0, -0.3))
    else:
        mesh = fc.generate.box((2.0, 1.5, 1.2), (divisions,) * 3, name)
    return mesh.replace(points=mesh.points + 0.03 * np.sin(4.0 * mesh.points[:, ::-1] + 0.3))


def assembled(mesh, kinematics, averaged=AVERAGED, material=RUBBER):
    return stiffness(mesh, kinematics, material.moduli(kinematics)[None], one_material(mesh), averaged=averaged)


def stress_at_points(mesh, kinematics, u):
    moduli = RUBBER.moduli(kinematics)[None]
    return fc.recovery.stress_at_points(mesh, kinematics, moduli, one_material(mesh), u, AVERAGED)


def parts(element, B, measures):
    """Operators (n_q, n_strains, n) of the deviatoric strain, of the mean dilatation and of its remainder, and moduli."""
    G, bulk = RUBBER.shear_modulus, RUBBER.E / 3 / (1 - 2 * RUBBER.nu)
    third = np.array([1.0, 1.0, 1.0, *np.zeros(B.shape[1] - 3)]) / 3
    trace = B[:, :3].sum(axis=1)
    mean = np.broadcast_to(measures @ trace / measures.sum(), trace.shape)
    remainder, modulus = np.zeros_like(trace), bulk
    if element.dilatation is None:
        remainder = trace - mean
    elif element.order == 2:
        P = np.column_stack([np.ones(len(measures)), element.quadrature[0]])
        best = P @ np.linalg.solve(P.T @ (measures[:, None] * P), P.T @ (measures[:, None] * trace))
        remainder = best - mean
        if element.dilatation == 0:  # the bulk modulus of nu = 0.3
            modulus = 2 * G * 1.3 / (3 * 0.4)
    B = B - np.einsum("i,qa->qia", third, trace)
    return B, np.einsum("i,qa->qia", 3 * third, mean), np.einsum("i,qa->qia", 3 * third, remainder), bulk, modulus


def twin(mesh, kinematics):
    """Stiffness assembled densely, cell by cell."""
    K, D, dim = np.zeros((mesh.points.size,) * 2), RUBBER.moduli(kinematics), mesh.dim
    for name, block in mesh.solids.items():
        element = elements.get(name)
        for cell in block:
            dofs = (dim * cell[:, None] + np.arange(dim)).ravel()
            B, measures = operators(element, mesh.points[cell], kinematics == "axisymmetric")
            B, mean, rest, bulk, modulus = parts(element, B, measures)
            K[np.ix_(dofs, dofs)] += np.einsum("qia,ij,qjb,q->ab", B, D, B, measures)
            for trace, own in ((mean[:, 0], bulk), (rest[:, 0], modulus)):
                K[np.ix_(dofs, dofs)] += own * np.einsum("qa,qb,q->ab", trace, trace, measures)
    return K


@pytest.mark.parametrize(("name", "kinematics"), CASES)
def test_stiffness_equals_its_numpy_twin(name, kinematics):
    mesh = patch(name, 1)
    K, expected = assembled(mesh, kinematics).toarray(), twin(mesh, kinematics)
    assert np.abs(K - expected).max() < 1e-11 * np.abs(expected).max()
    assert np.array_equal(K, K.T)


@pytest.mark.parametrize(("name", "kinematics"), CASES)
def test_stress_equals_its_numpy_twin_and_balances_the_stiffness(name, kinematics):
    mesh = patch(name)
    u = np.random.default_rng(2).normal(size=mesh.points.shape)
    at_points, element = stress_at_points(mesh, kinematics, u), elements.get(name)
    for number in (0, len(mesh.cells[name]) - 1):
        cell = mesh.cells[name][number]
        B, measures = operators(element, mesh.points[cell], kinematics == "axisymmetric")
        B, mean, rest, bulk, modulus = parts(element, B, measures)
        expected = B @ u[cell].ravel() @ RUBBER.moduli(kinematics) + (bulk * mean + modulus * rest) @ u[cell].ravel()
        assert np.abs(at_points[name][number] - expected).max() < 1e-10 * np.abs(expected).max()
    force = fc.recovery.internal_force(mesh, kinematics, at_points)
    assert np.abs(force.ravel() - assembled(mesh, kinematics) @ u.ravel()).max() < 1e-11 * np.abs(force).max()


@pytest.mark.parametrize("divisions", [1, 2])
@pytest.mark.parametrize(("name", "kinematics"), CASES)
def test_nothing_but_rigid_motion_is_free(name, kinematics, divisions):
    mesh = patch(name, divisions)
    K = assembled(mesh, kinematics)
    modes = rigid_modes(mesh.points, kinematics)
    assert np.abs(K @ modes).max() < 1e-10 * np.abs(K.data).max()
    values = np.linalg.eigvalsh(K.toarray())
    n = modes.shape[1]
    assert np.abs(values[:n]).max() < 1e-12 * values[-1]
    plain = np.linalg.eigvalsh(assembled(mesh, kinematics, None, fc.LinearElastic(6.0, 0.0)).toarray())
    assert values[n] > 0.2 * plain[n]  # as stiff as an element that cannot lock, but for the deviatoric part of nu


@pytest.mark.each_value
@pytest.mark.parametrize("linear_solver", ["direct", "amg"])
@pytest.mark.parametrize("name", SOLIDS)
def test_patch_test_through_the_solver(name, linear_solver):
    mesh = patch(name, 3)
    kinematics = "plane_strain" if mesh.dim == 2 else "3d"
    slope = np.array([[1.0, 0.4, -0.3], [-0.2, -2.0, 0.7], [0.5, 0.1, 1.2]])[: mesh.dim, : mesh.dim] * 1e-3
    outer = np.unique(np.concatenate([f.ravel() for f in fc.topology.outer_facets(mesh).values()]))
    model = made_of(mesh.with_groups(points={"OUTER": outer}), kinematics, RUBBER)
    model.prescribe("OUTER", **{axis: lambda x, row=row: x @ row for axis, row in zip("xyz", slope)})
    (step,) = fc.solve(model, fc.linear_ramp(1), linear_solver=linear_solver, linear_tolerance=1e-13)
    assert np.abs(step.displacement - mesh.points @ slope.T).max() < 1e-8 * 1e-3
    strain = np.zeros((3, 3))
    strain[: mesh.dim, : mesh.dim] = (slope + slope.T) / 2
    G = RUBBER.shear_modulus
    stress = 2 * G * strain + 2 * G * RUBBER.nu / (1 - 2 * RUBBER.nu) * np.trace(strain) * np.eye(3)
    expected = [stress[i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))][: step.stress.shape[1]]
    assert np.abs(step.stress - expected).max() < 1e-6 * np.abs(expected).max()


@pytest.mark.parametrize(("name", "kinematics"), [("quad4", "axisymmetric"), ("hex8", "3d"), ("tet10", "3d")])
def test_any_number_of_threads_gives_the_same_bits(name, kinematics, monkeypatch):
    monkeypatch.setattr(parallel, "SINGLE_THREAD_WORK", 1)
    mesh, before, found = patch(name, 4), threads(), []
    u = np.random.default_rng(2).normal(size=mesh.points.shape)
    for count in (1, 2):
        set_threads(count)
        found.append((assembled(mesh, kinematics).data, stress_at_points(mesh, kinematics, u)[name]))
    set_threads(before)
    for one, two in zip(*found):
        np.testing.assert_array_equal(one, two)


# The choice -------------------------------------------------------------------------------------------------------------


def block(element="quad4", kinematics="plane_strain", **material):
    model = fc.Model(fc.generate.block((1.0, 1.0), (3, 3), element, (1.0, 0.0)), kinematics)
    model.add_material(fc.LinearElastic(E=6.0, **material))
    return model


@pytest.mark.parametrize(
    ("material", "averaged"),
    [
        ({"nu": 0.3}, False),
        ({"nu": 0.4899}, False),
        ({"nu": 0.49}, True),
        ({"nu": 0.4999}, True),
        ({"nu": 0.4999, "volumetric": "plain"}, False),
        ({"nu": 0.3, "volumetric": "mean_dilatation"}, True),
    ],
)
def test_who_has_a_mean_dilatation(material, averaged):
    assert block(**material).material_field().averaged.tolist() == [averaged]
    assert block(kinematics="plane_stress", **material).material_field().averaged.tolist() == [False]


def test_only_what_the_choice_comes_to_changes_the_fingerprint():
    plain, chosen = block(nu=0.3, incompatible_modes=False), block(nu=0.3, volumetric="plain")
    assert fingerprint(plain) == fingerprint(chosen)
    averaged = block(nu=0.3, volumetric="mean_dilatation")
    assert fingerprint(plain)["the materials"] != fingerprint(averaged)["the materials"]
    own = block(nu=0.499, incompatible_modes=False)
    assert fingerprint(own) == fingerprint(block(nu=0.499, volumetric="mean_dilatation"))


def test_two_materials_of_one_mesh_are_each_as_alone():
    mesh = patch("quad4")
    steel = fc.LinearElastic(E=210.0, nu=0.3)
    moduli = np.stack([steel.moduli("plane_strain"), RUBBER.moduli("plane_strain")])
    numbers = np.array([0, 0, 1, 1], np.int32)
    K = stiffness(mesh, "plane_strain", moduli, {"quad4": numbers}, averaged=np.array([False, True])).toarray()
    expected = np.zeros_like(K)
    for number, (material, averaged) in enumerate([(steel, None), (RUBBER, AVERAGED)]):
        part = mesh.replace(cells={"quad4": mesh.cells["quad4"][numbers == number]}, cell_groups={})
        expected += assembled(part, "plane_strain", averaged, material).toarray()
    assert np.abs(K - expected).max() < 1e-13 * np.abs(expected).max()


def test_incompatible_modes_come_before_a_mean_dilatation():
    """In the elements that have them, which are not those of axisymmetry."""
    rubber = fc.LinearElastic(E=1.0, nu=0.4999, incompatible_modes=True)
    field = made_of(fc.generate.block(), "plane_strain", rubber).material_field()
    assert rubber.averaged
    assert rubber.incompatible_modes
    assert dilatation.split("quad4", field.moduli, field.treatment) is None
    assert dilatation.split("quad8", field.moduli, field.treatment) is not None
    assert replace(field, kinematics="axisymmetric").treatment.tolist() == [1]


def test_modes_count_in_the_fingerprint_and_their_absence_does_not():
    prints = []
    for options in ({}, {"incompatible_modes": False}, {"incompatible_modes": True}):
        model = made_of(fc.generate.block(), "plane_strain", fc.LinearElastic(E=1.0, nu=0.3, **options))
        prints.append(fingerprint(model))
    assert prints[0] == prints[1] != prints[2]
    assert "the incompatible modes" not in prints[1]
