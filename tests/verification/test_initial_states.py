"""Initial stresses and strains: released, held, in equilibrium, as temperatures, in a shrink fit, with axes."""

import numpy as np
import pytest
from case_texts import of_block
from models import elastic_model, made_of
from test_temperature import ALPHA, RISE, E, free, plane, solved
from two_bodies import rings

import fastcontact as fc
from fastcontact.cases.case import read_case
from fastcontact.model.fingerprint import differing_parts, fingerprint

pytestmark = pytest.mark.each_value

PLANE = ("plane_strain", "plane_stress", "axisymmetric")
ELEMENTS = [(k, e) for k in PLANE for e in ("tri3", "tri6", "quad4", "quad8", "quad9")]
ELEMENTS += [("3d", e) for e in ("tet4", "tet10", "hex8", "hex20", "wedge6", "pyramid5")]
LAWS = {
    "plain": {"nu": 0.3},
    "mean dilatation": {"nu": 0.4999},
    "modes": {"nu": 0.3, "incompatible_modes": True},
    "graded": {"nu": 0.3, "E": lambda x: E * (1.0 + 0.3 * x[:, 0])},
}


def body(kinematics, element):
    return plane(element, kinematics) if kinematics != "3d" else fc.generate.box((2.0, 1.0, 1.0), (2, 1, 1), element)


def bent(points):
    """A temperature that is neither uniform nor linear along an axis, and linear in cells."""
    return RISE * (1.0 + points[:, 0] - 0.5 * points[:, 1])


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("kinematics", "element"), ELEMENTS)
def test_the_strain_of_a_temperature_is_the_temperature(kinematics, element, law):
    results = []
    for heat in (True, False):
        material = fc.LinearElastic(**{"E": E, "expansion": ALPHA, **LAWS[law]})
        model = free(body(kinematics, element), kinematics, material)
        if heat:
            model.add_temperature(bent)
        else:
            model.add_initial_strain(**dict.fromkeys(("xx", "yy", "zz"), lambda x: ALPHA * bent(x)))
        results.append(solved(model))
    hot, strained = results
    np.testing.assert_allclose(strained.displacement, hot.displacement, atol=1e-9 * np.abs(hot.displacement).max())
    np.testing.assert_allclose(strained.stress, hot.stress, atol=1e-9 * E * ALPHA * RISE)


@pytest.mark.parametrize("law", ["plain", "mean dilatation", "modes"])
@pytest.mark.parametrize(("kinematics", "element"), ELEMENTS)
def test_a_strain_is_the_stress_that_would_hold_it(kinematics, element, law):
    """Initial strain e, or initial stress -D e: the same displacements and stresses."""
    names = ("xx", "yy", "zz", "xy") if kinematics != "3d" else ("xx", "yy", "zz", "xy", "yz", "xz")
    strain = np.array([1e-3, -2e-3, 5e-4, 8e-4, -3e-4, 6e-4])[: len(names)]
    material = fc.LinearElastic(**{"E": E, **LAWS[law]})
    results = []
    for kind in ("strain", "stress"):
        model = free(body(kinematics, element), kinematics, material)
        if kind == "strain":
            model.add_initial_strain(**dict(zip(names, strain, strict=True)))
        else:
            model.add_initial_stress(**dict(zip(names, -material.moduli(kinematics) @ strain, strict=True)))
        results.append(solved(model))
    one, other = results
    np.testing.assert_allclose(one.displacement, other.displacement, atol=1e-9 * np.abs(other.displacement).max())
    np.testing.assert_allclose(one.stress, other.stress, atol=1e-9 * E * 1e-3)


@pytest.mark.parametrize("kinematics", ["plane_strain", "plane_stress", "3d"])
@pytest.mark.parametrize("given", ["number", "cells", "points", "function"])
def test_a_released_stress_strains_the_body_back(kinematics, given):
    mesh = body(kinematics, "quad4" if kinematics != "3d" else "hex8")
    count = {"cells": sum(map(len, mesh.solids.values())), "points": mesh.n_points}.get(given)
    value = 5.0 if given == "number" else np.full(count, 5.0) if count else lambda x: np.full(len(x), 5.0)
    model = free(mesh, kinematics, fc.LinearElastic(E, 0.3))
    model.add_initial_stress(xx=value)
    step = solved(model)
    exact = -5.0 / E * (1.0 - 0.09 if kinematics == "plane_strain" else 1.0)
    np.testing.assert_allclose(
        step.displacement[:, 0], exact * (mesh.points[:, 0] - mesh.points[:, 0].min()), atol=1e-12
    )
    zz = -0.3 * 5.0 if kinematics == "plane_strain" else 0.0  # held out of the plane
    np.testing.assert_allclose(step.stress[:, :3], np.broadcast_to([0.0, 0.0, zz], (mesh.n_points, 3)), atol=1e-10)
    assert fc.estimate_error(model, step).total < 1e-9


@pytest.mark.parametrize(("kinematics", "element"), ELEMENTS)
def test_a_stress_in_balance_leaves_the_body_as_it_is(kinematics, element):
    """Two halves pulled and pressed alike between ends that are held: no displacement, no resultant, the stress itself."""
    model = elastic_model(body(kinematics, element), kinematics, E=E)
    if kinematics == "axisymmetric":  # radial and hoop stress alike are in balance
        model.add_initial_stress(xx=7.0, zz=7.0, yy=3.0)
        model.add_traction("LEFT", x=-7.0)
        model.add_traction("RIGHT", x=7.0)
        model.add_traction("BOTTOM", y=-3.0)
        model.add_traction("TOP", y=3.0)
        model.fix("BOTTOM_LEFT", "y")
        expected = np.broadcast_to([7.0, 3.0, 7.0, 0.0], (model.mesh.n_points, 4))
    else:
        for side in ("LEFT", "RIGHT") if kinematics != "3d" else ("XMIN", "XMAX"):
            model.fix(side, "xyz"[: model.mesh.dim])
        model.add_initial_stress(xx=lambda x: 7.0 - 14.0 * x[:, 1])
        expected = np.zeros((model.mesh.n_points, 6 if kinematics == "3d" else 4))
        expected[:, 0] = 7.0 - 14.0 * model.mesh.points[:, 1]
    step = solved(model)
    assert np.abs(step.displacement).max() < 1e-12
    if element not in ("tri3", "tet4", "wedge6", "pyramid5"):  # these have the mean of their cells
        np.testing.assert_allclose(step.stress, expected, atol=1e-9)
    np.testing.assert_allclose(step.reaction.sum(axis=0), 0.0, atol=1e-9)


def test_a_shrunk_hub_presses_as_lame_says():
    """A hub that shrinks by a strain along radius and circumference: the interference is that strain times the radius."""
    mesh = rings("quad8", inner=(1.0, 2.0), divisions=((18, 6), (18, 6)))
    strain = -1.2e-3
    pressures = []
    for axes, names in ((None, ("xx", "yy")), (fc.CylindricalAxes(), ("xx", "yy"))):
        materials = {"SHAFT": fc.LinearElastic(1000.0, 0.3), "HUB": fc.LinearElastic(500.0, 0.25)}
        model = made_of(mesh, "plane_strain", materials, XAXIS="y", YAXIS="x")
        model.add_contact("fit", secondary="HUB_INNER", primary="SHAFT_OUTER", formulation="mortar")
        model.add_initial_strain("HUB", **dict.fromkeys(names, strain), axes=axes)
        pressures.append(solved(model).contact["fit"].pressure.mean())
    lame = fc.analytic.press_fit_cylinders(
        E_inner=1000.0, nu_inner=0.3, E_outer=500.0, nu_outer=0.25, inner_radius=1.0, interface_radius=2.0,
        outer_radius=3.0, interference=-strain * 2.0,
    )  # fmt: skip
    np.testing.assert_allclose(pressures, lame.pressure, rtol=1e-4)
    assert pressures[0] == pytest.approx(pressures[1], rel=1e-12)


@pytest.mark.parametrize("kind", ["stress", "strain"])
@pytest.mark.parametrize("kinematics", ["plane_strain", "3d"])
def test_components_along_axes_are_those_of_the_turned_tensor(kinematics, kind):
    axes = np.array([(0.6, 0.8, 0.0), (-0.8, 0.6, 0.0), (0.0, 0.0, 1.0)])
    own = np.array([(4.0, 1.0, 0.0), (1.0, -2.0, 0.0), (0.0, 0.0, 3.0)]) * (1e-3 if kind == "strain" else 1.0)
    shear = 2.0 if kind == "strain" else 1.0
    turned = axes.T @ own @ axes
    results = []
    for tensor, given in ((own, axes), (turned, None), (own, lambda x: np.broadcast_to(axes, (len(x), 3, 3)))):
        model = free(body(kinematics, "quad8" if kinematics != "3d" else "hex8"), kinematics, fc.LinearElastic(E, 0.3))
        add = getattr(model, f"add_initial_{kind}")
        add(xx=tensor[0, 0], yy=tensor[1, 1], zz=tensor[2, 2], xy=shear * tensor[0, 1], axes=given)
        results.append(solved(model))
    for other in results[1:]:
        np.testing.assert_allclose(results[0].displacement, other.displacement, atol=1e-13)
        np.testing.assert_allclose(results[0].stress, other.stress, atol=1e-10)


def test_it_is_there_from_the_first_step_on_or_has_a_history():
    for ramp, factors in ((None, [1.0, 1.0]), ([(0, 0), (1, 2)], [1.0, 2.0])):
        model = free(plane("quad4", "plane_stress"), "plane_stress", fc.LinearElastic(E, 0.3))
        model.add_initial_stress("BLOCK", xx=5.0, ramp=ramp)
        steps = fc.solve(model, fc.linear_ramp(2))
        assert [step.iterations["initial_factors"] for step in steps] == [[f] for f in factors]
        far = model.mesh.points_of("RIGHT")
        found = [step.displacement[far, 0].mean() for step in steps]
        np.testing.assert_allclose(found, -2.0 * 5.0 / E * np.array(factors), rtol=1e-9)


# ----------------------------------------------------------------------------- case files, words, mistakes
CASE = of_block("{}", "{}", LEFT="x", BOTTOM="y")


def case(tmp_path, text, kinematics="plane_stress"):
    fc.write_mesh(tmp_path / "block.med", fc.generate.block((2.0, 1.0), (4, 2)))
    (tmp_path / "case.toml").write_text(CASE.format(kinematics, text))
    return read_case(tmp_path / "case.toml").model


@pytest.mark.parametrize(
    ("text", "kinematics", "message"),
    [
        ("[[initial_stress]]", "plane_stress", r"initial_stress\[0\]: the initial stress of .* has no component"),
        ("[[initial_stress]]\nyz = 1.0", "plane_strain", "has the component yz, which plane_strain does not have"),
        ("[[initial_stress]]\nzz = 1.0", "plane_stress", "has out-of-plane components, which plane_stress does"),
        ("[[initial_stress]]\ngroups = 'TOP'\nxx = 1.0", "plane_stress", "'TOP' contains no solid cells"),
        ("[[initial_strain]]\nxx = 1.0\naxes = [[1, 0, 1], [0, 1, 0]]", "plane_strain", "which plane_strain does"),
        ("[[initial_strain]]\nxx = nan", "plane_strain", "xx of the initial strain of all solid cells is nan"),
        ("[[initial_strain]]\nrr = 1.0", "plane_strain", r"unknown key 'initial_strain\[0\].rr'"),
        (
            "[[initial_strain]]\nxx = 'a'",
            "plane_strain",
            r"'initial_strain\[0\].xx' must be a number or a list of numbers, not",
        ),
    ],
)
def test_mistakes_are_told(tmp_path, text, kinematics, message):
    with pytest.raises((fc.CaseError, fc.ModelError, fc.MeshError), match=message):
        case(tmp_path, text, kinematics)


def test_arrays_of_the_wrong_length_and_functions_of_the_wrong_shape_are_told():
    model = free(plane("quad4", "plane_stress"), "plane_stress", fc.LinearElastic(E, 0.3))
    with pytest.raises(fc.ModelError, match="component xy of the initial stress of all solid cells is an array"):
        model.add_initial_stress(xy=np.ones(5))
    with pytest.raises(fc.ModelError, match="component xx of the initial strain of 'BLOCK' is a function that"):
        model.add_initial_strain("BLOCK", xx=lambda x: x)
    model.add_initial_stress(xx=1.0, ramp=[(0, 0), (0.5, 1)])
    with pytest.raises(fc.ModelError, match=r"the ramp of the initial stress of all solid cells covers 0 to 0\.5"):
        fc.solve(model, fc.linear_ramp(1))


def test_it_counts_in_a_fingerprint():
    def model(value=None):
        found = free(plane("quad4", "plane_stress"), "plane_stress", fc.LinearElastic(E, 0.3))
        if value is not None:
            found.add_initial_stress(xx=value)
        return fingerprint(found)

    assert differing_parts(model(), model(1.0)) == differing_parts(model(1.0), model(2.0)) == ["the initial states"]
    assert model(1.0) == model(1.0)
