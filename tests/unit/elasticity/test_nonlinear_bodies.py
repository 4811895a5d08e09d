"""Nonlinear bodies: tangents compared with differences, energies, the linear limit, refusals."""

import numpy as np
import pytest
from models import CELLS, made_of, supported

import fastcontact as fc
from fastcontact.elasticity.nonlinear_bodies import NonlinearBodies
from fastcontact.elasticity.stiffness import stiffness
from fastcontact.mesh import elements

pytestmark = pytest.mark.pairwise

PLASTIC = fc.ElasticPlastic(
    E=100.0, nu=0.3, yield_stress=0.3, hardening=[(0.0, 0.3), (0.01, 0.5), (0.1, 2.0)], kinematic=4.0
)
LAWS = {
    "plastic, finite": (fc.ElasticPlastic(E=100.0, nu=0.3, yield_stress=0.3, hardening=PLASTIC.hardening), "finite"),
    "Hooke": (fc.LinearElastic(E=100.0, nu=0.3), "small"),
    "nearly incompressible": (fc.LinearElastic(E=100.0, nu=0.499), "small"),
    "plastic": (PLASTIC, "small"),
    "Saint Venant-Kirchhoff": (fc.LinearElastic(E=100.0, nu=0.3), "finite"),
    "neo-Hookean": (fc.NeoHookean(E=100.0, nu=0.3), "finite"),
    "neo-Hookean, nearly incompressible": (fc.NeoHookean(E=100.0, nu=0.499), "finite"),
    "Mooney-Rivlin": (fc.MooneyRivlin(20.0, 10.0, bulk=100.0), "finite"),
    "Yeoh": (fc.Yeoh(20.0, 3.0, 1.0, bulk=100.0), "finite"),
    "Ogden": (fc.Ogden([20.0, 5.0], [1.7, -2.3], bulk=100.0), "finite"),
}


def single(element: str, kinematics: str, law, strain: str):
    """Return a distorted cell as a model, and as nonlinear bodies."""
    nodes, rng = elements.get(element).nodes, np.random.default_rng(0)
    points = 1.3 * nodes + 0.04 * rng.normal(size=nodes.shape) + (3.0 if kinematics == "axisymmetric" else 0.0)
    mesh = fc.Mesh(points, {element: np.arange(len(points), dtype=np.int32)[None]})
    model = made_of(mesh, kinematics, law, strain=strain)
    return model, NonlinearBodies(mesh, kinematics, strain, model.material_field())


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("kinematics", "element"), CELLS)
def test_tangent_and_forces_are_derivatives(kinematics: str, element: str, law: str) -> None:
    material, strain = LAWS[law]
    model, bodies = single(element, kinematics, material, strain)
    shape, rng = model.mesh.points.shape, np.random.default_rng(1)
    size = 0.01 if strain == "small" else 0.05
    u, along, before, step = size * rng.normal(size=shape), rng.normal(size=shape), bodies.initial_history, 1e-6
    if law.startswith("plastic"):  # which depends on the history
        before = bodies.at(size * rng.normal(size=shape), before).history
    here = bodies.at(u, before)
    ahead, behind = (bodies.at(u + sign * step * along, before) for sign in (1.0, -1.0))
    K = here.K.toarray()
    change = (ahead.force - behind.force).ravel() / (2 * step)
    assert np.abs(K @ along.ravel() - change).max() <= 1e-7 * np.abs(change).max()
    assert np.abs(K - K.T).max() <= 1e-12 * np.abs(K).max()
    work = (ahead.energy + ahead.plastic_work - behind.energy - behind.plastic_work) / (2 * step)
    assert work == pytest.approx((here.force * along).sum(), rel=1e-6)
    if law.startswith("plastic"):
        assert max((here.history[name][..., 6] - values[..., 6]).max() for name, values in before.items()) > 1e-3


@pytest.mark.parametrize("law", [name for name, (_, strain) in LAWS.items() if strain == "small"])
@pytest.mark.parametrize(("kinematics", "element"), CELLS)
def test_tiny_forces_have_as_many_digits(kinematics: str, element: str, law: str) -> None:
    model, bodies = single(element, kinematics, *LAWS[law])
    u = 1e-5 * np.random.default_rng(1).normal(size=model.mesh.points.shape)
    large, tiny = (bodies.at(scale * u, bodies.initial_history).force for scale in (1.0, 1e-6))
    assert np.abs(1e6 * tiny - large).max() <= 1e-12 * np.abs(large).max()


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("element", ["tri3", "quad4", "quad8", "tet4", "hex8", "hex20", "hex27", "wedge6", "pyramid5"])
def test_the_tangent_begins_as_linear_stiffness(element: str, law: str) -> None:
    material, strain = LAWS[law]
    flat = elements.get(element).dim == 2
    for kinematics in ("plane_strain", "plane_stress", "axisymmetric") if flat else ("3d",):
        model, bodies = single(element, kinematics, material, strain)
        field = model.material_field()
        K = stiffness(model.mesh, kinematics, field.moduli, field.moduli_rows, None, field.treatment).toarray()
        found = bodies.at(np.zeros_like(model.mesh.points), bodies.initial_history).K.toarray()
        assert np.abs(found - K).max() <= 1e-11 * np.abs(K).max()


@pytest.mark.parametrize("law", [name for name, (_, strain) in LAWS.items() if strain == "finite"])
@pytest.mark.parametrize("element", ["quad4", "tri6", "hex8", "tet10"])
def test_forces_turn_with_the_body(element: str, law: str) -> None:
    material, strain = LAWS[law]
    model, bodies = single(element, "plane_strain" if elements.get(element).dim == 2 else "3d", material, strain)
    points = model.mesh.points
    dim, rng = points.shape[1], np.random.default_rng(2)
    turn = np.linalg.qr(rng.normal(size=(dim, dim)))[0]
    turn[:, 0] *= np.sign(np.linalg.det(turn))
    u = 0.05 * rng.normal(size=points.shape)
    turned = (points + u) @ turn.T - points
    plain, there = bodies.at(u, bodies.initial_history), bodies.at(turned, bodies.initial_history)
    assert np.abs(there.force - plain.force @ turn.T).max() <= 1e-11 * np.abs(plain.force).max()
    rigid = bodies.at(points @ turn.T - points, bodies.initial_history)
    assert max(np.abs(values).max() for values in rigid.stress.values()) <= 1e-10 * 100.0


@pytest.mark.parametrize("law", ["Mooney-Rivlin", "plastic, finite", "plastic"])
def test_threads_do_not_change_bits(law: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from fastcontact._jit import parallel

    mesh = fc.generate.box((1.0, 1.0, 1.0), (5, 4, 3))
    material, strain = LAWS[law]
    model = made_of(mesh, "3d", material, strain=strain)
    u = 0.02 * np.random.default_rng(0).normal(size=mesh.points.shape)
    found = []
    for count in (1, 2, 3):
        monkeypatch.setattr(parallel, "SINGLE_THREAD_WORK", 1)
        monkeypatch.setattr(parallel.decorators, "threads", lambda count=count: count)
        bodies = NonlinearBodies(mesh, "3d", strain, model.material_field())
        here = bodies.at(u, bodies.initial_history)
        found.append((here.K.data, here.force, here.stress["hex8"], here.history["hex8"], here.energy))
    for other in found[1:]:
        assert all(np.array_equal(one, two) for one, two in zip(found[0], other, strict=True))


def test_initial_states_are_refused() -> None:
    model = made_of(fc.generate.block(), "plane_strain", PLASTIC, BOTTOM="xy")
    model.add_initial_stress(xx=20.0)
    with pytest.raises(fc.ModelError, match="initial stresses and strains are available for linear elasticity only"):
        fc.solve(model, 1)


def test_a_body_pressed_to_nothing_says_where() -> None:
    model = fc.Model(fc.generate.block((4.0, 1.0), (4, 1)), "plane_strain", strain="finite")
    model.add_material(fc.NeoHookean(E=100.0, nu=0.3))
    supported(model, BOTTOM="xy", TOP={"x": 0.0, "y": -1.2})
    with pytest.raises(fc.ConvergenceError, match=r"cell \d of quad4 near \[.*\] is inverted .J = -"):
        fc.solve(model, 1, criteria=fc.Criteria(max_halvings=0))


@pytest.mark.parametrize("law", [name for name, (_, strain) in LAWS.items() if strain == "finite"])
@pytest.mark.parametrize(
    ("kinematics", "element"), [("plane_strain", "quad4"), ("axisymmetric", "tri6"), ("3d", "hex8")]
)
def test_the_tangent_without_initial_stress_is_positive_semidefinite(kinematics: str, element: str, law: str) -> None:
    model, bodies = single(element, kinematics, *LAWS[law])
    points = model.mesh.points
    for squeeze in (-0.15, 0.15):
        u = squeeze * points + 0.02 * np.random.default_rng(1).normal(size=points.shape)
        definite = bodies.at(u, bodies.initial_history, geometric=0)
        whole = bodies.at(u, bodies.initial_history)
        values = np.linalg.eigvalsh(definite.K.toarray())
        assert values[0] >= -1e-12 * values[-1]
        assert np.abs(definite.K.toarray() - whole.K.toarray()).max() >= 1e-3 * values[-1] * abs(squeeze)
        assert np.array_equal(definite.force, whole.force)


def test_no_hardening_is_perfect_plasticity():
    materials = [fc.ElasticPlastic(E=100.0, nu=0.3, yield_stress=0.3, **given) for given in ({}, {"hardening": None})]
    assert materials[0] == materials[1]
