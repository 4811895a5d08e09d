"""Locking warning: its number compared with two solutions, and no warning without locking."""

import re

import numpy as np
import pytest
from models import elastic_model, last_step, made_of, supported, united

import fastcontact as fc
from fastcontact.analysis.load_step import load_step
from fastcontact.analysis.locking import SUSPICIOUS, ExcessStiffness, locking_warning
from fastcontact.analysis.problem import prepare
from fastcontact.elasticity.stiffness import stiffness
from fastcontact.mesh import elements


def clamped(name, nu, volumetric="auto", kinematics="plane_strain", n=6):
    """A block clamped below and drawn sideways above, by the same forces in every model."""
    if elements.get(name).dim == 2:
        mesh = fc.generate.block((1.0, 2.0), (n, 2 * n), name, origin=(1.0, 0.0))
        below, above = "BOTTOM", "TOP"
    else:
        mesh, kinematics = fc.generate.box((1.0, 1.0, 2.0), (n, n, 2 * n), name), "3d"
        below, above = "ZMIN", "ZMAX"
    model = made_of(mesh, kinematics, fc.LinearElastic(E=1.0, nu=nu, volumetric=volumetric))
    model.fix(below, "xyz"[: mesh.dim])
    model.add_traction(above, x=0.001)
    return model


def solved(model, **options):
    """The energy of the loads and the excess of stiffness that a warning names, nan without one."""
    step, texts = last_step(model, about=" lock: ", **options)
    found = [float(re.search(r"about (\d+)% too stiff", text)[1]) / 100 for text in texts]
    return float((sum(model.forces_by_ramp().values()) * step.displacement).sum()), (found or [np.nan])[0]


@pytest.mark.each_value
@pytest.mark.parametrize("linear_solver", ["direct", "amg"])
@pytest.mark.parametrize(("name", "n"), [("quad4", 6), ("quad8", 1), ("hex8", 3)])
def test_the_excess_is_that_of_two_solutions(name, n, linear_solver):
    plain, excess = solved(clamped(name, 0.499, "plain", n=n), linear_solver=linear_solver)
    averaged, none = solved(clamped(name, 0.499, "mean_dilatation", n=n))
    actual = averaged / plain - 1
    assert 0.85 * actual < excess <= actual + 0.005 + 1e-9  # rounded to per cent
    assert np.isnan(none)


def squeezed(name, n):
    """A quarter disc pressed near its pole, or a block between walls that a pressure from one side to the other bends."""
    if elements.get(name).dim == 2:
        model = fc.Model(fc.generate.quarter_disc(name, R=1.0, size=1.0 / n), "axisymmetric")
        supported(model, A1B1="xy", A1A2="x")
        model.add_traction("CONT1", y=lambda x: -0.001 * np.exp(-((x[:, 0] / 0.2) ** 2)))
    else:
        model = fc.Model(fc.generate.box((1.0, 1.0, 0.5), (2 * n, 2 * n, n), name), "3d")
        model.fix("ZMIN", "xyz")
        for group in ("XMIN", "XMAX", "YMIN", "YMAX"):
            model.fix(group, group[0].lower())
        model.add_traction("ZMAX", z=lambda x: -0.001 * np.cos(np.pi * x[:, 0]))
    model.add_material(fc.LinearElastic(E=1.0, nu=0.4999))
    return model


@pytest.mark.parametrize(("name", "n", "better"), [("tri3", 8, "tri6"), ("tet4", 2, "tet10"), ("wedge6", 2, "wedge15")])
def test_elements_without_remedy_are_told_with_a_figure_of_the_right_size(name, n, better):
    own, excess = solved(squeezed(name, n))
    quadratic, none = solved(squeezed(better, n))
    assert np.isnan(none)
    assert 0.45 * (quadratic / own - 1) < excess < quadratic / own - 1


@pytest.mark.parametrize("name", ["tri3", "quad4", "tri6", "quad8"])
def test_no_word_where_nothing_locks(name):
    assert np.isnan(solved(clamped(name, 0.3, "plain"))[1])
    assert np.isnan(solved(clamped(name, 0.499, "plain", "plane_stress"))[1])
    assert ExcessStiffness(clamped(name, SUSPICIOUS - 0.01)).elements == []


@pytest.mark.parametrize(
    ("name", "n", "modes", "told"),
    [
        ("tet4", (40, 4, 1), False, True), ("wedge6", (40, 4, 2), False, True), ("hex8", (20, 2, 1), False, True),
        ("hex8", (20, 2, 2), True, False), ("tet10", (20, 2, 1), False, False),
    ],
)  # fmt: skip
def test_thin_parts_bend_right_or_it_is_told(name, n, modes, told):
    """Deflection of a cantilever by its end load, of Bernoulli's theory F L^3 / 3 E I."""
    law = fc.LinearElastic(E=1e6, nu=0.3, incompatible_modes=modes)
    model = made_of(fc.generate.box((1.0, 0.1, 0.02), n, name), "3d", law, XMIN="xyz")
    model.add_traction("XMAX", z=0.1)
    step, texts = last_step(model, about="thin parts that bend")
    deflection = step.displacement[model.mesh.points_of("XMAX"), 2].mean() / 1e-3
    assert bool(texts) is told
    assert (deflection < 0.7) if told else (0.97 < deflection < 1.0)


@pytest.mark.parametrize(
    ("name", "n", "told"), [("tet4", 2, True), ("tet4", 4, False), ("wedge6", 2, True), ("hex8", 3, False)]
)
def test_a_coarse_mesh_is_told_with_a_figure_of_the_right_size(name, n, told):
    """The force on a pad that is pressed between bonded plates, for which quadratic elements are nearly exact."""
    forces = []
    for element, k in ((name, n), ("tet10", 3)):
        mesh = fc.generate.box((2.0, 2.0, 1.0), (2 * k, 2 * k, k), element)
        model = made_of(mesh, "3d", fc.LinearElastic(E=1.0, nu=0.35), ZMIN="xyz", ZMAX="xy")
        model.prescribe("ZMAX", z=-0.01)
        step, texts = last_step(model, about="too stiff: the error")
        figures = [float(re.search(r"displacements about (\d+)%", text)[1]) / 100 for text in texts]
        forces.append((abs(step.reaction[mesh.points_of("ZMAX"), 2].sum()), figures))
    (force, figures), (exact, none) = forces
    assert not none
    assert len(figures) == told
    assert not told or 0.4 * (force / exact - 1.0) < figures[0] < force / exact - 1.0


@pytest.mark.parametrize(("element", "told"), [("quad4", 1), ("quad8", 0)])
def test_a_thin_part_that_bends_on_a_soft_body_is_told(element, told):
    strip, base = (
        fc.generate.block((20.0, 1.0), (24, 2), element),
        fc.generate.block((20.0, 8.0), (16, 6), element, (0.0, -8.0)),
    )
    materials = {"STRIPBLOCK": fc.LinearElastic(E=1e5, nu=0.3), "BASEBLOCK": fc.LinearElastic(E=100.0, nu=0.3)}
    model = made_of(united(STRIP=strip, BASE=base), "plane_strain", materials)
    supported(model, STRIPRIGHT="xy", STRIPLEFT="x", BASEBOTTOM="xy")
    model.add_pressure("STRIPTOP", lambda x: 5.0 * (x[:, 0] < 2.5))
    model.add_contact("pair", secondary="BASETOP", primary="STRIPBOTTOM")
    assert sum("too stiff" in text for text in fc.solve(model, 1)[-1].warnings) == told


def cantilever(element, n, law, kinematics="plane_stress", strain="finite"):
    """A cantilever 20 times as long as it is thick, with n square cells across its thickness."""
    if kinematics == "3d":
        mesh = fc.generate.box((20.0, 1.0, 1.0), (20 * n, n, n), element)
        mesh = fc.generate.renamed(mesh, {"XMIN": "LEFT", "XMAX": "RIGHT"})
    else:
        mesh = fc.generate.block((20.0, 1.0), (20 * n, n), element)
    return made_of(mesh, kinematics, law, strain=strain, LEFT="xyz"[: mesh.dim])


def of_bending(step):
    return [text for text in step.warnings if "thin parts that bend" in text]


STEEL, ALLOY = fc.LinearElastic(E=12e3, nu=0.3), fc.NeoHookean(E=12e3, nu=0.3)


@pytest.mark.parametrize(
    ("element", "n", "law", "kinematics", "error"),
    [
        ("quad4", 1, STEEL, "plane_stress", 0.49), ("quad4", 2, ALLOY, "plane_strain", 0.13),
        ("tri3", 2, STEEL, "plane_stress", 0.61), ("hex8", 1, ALLOY, "3d", 0.55),
        ("quad4", 1, fc.NeoHookean(E=12e3, nu=0.4995), "plane_strain", -0.42),
        ("quad4", 1, fc.ElasticPlastic(E=12e3, nu=0.3, yield_stress=1e6), "plane_stress", 0.49),
        ("quad4", 8, STEEL, "plane_stress", None), ("quad4", 8, ALLOY, "plane_strain", None),
        ("quad8", 1, STEEL, "plane_stress", None), ("hex20", 1, ALLOY, "3d", None),
    ],
)  # fmt: skip
def test_thin_nonlinear_parts_bend_right_or_it_is_told(element, n, law, kinematics, error):
    """Force at the end of a cantilever, of Bernoulli's theory 3 E I w / L^3."""
    model = cantilever(element, n, law, kinematics)
    model.prescribe("RIGHT", y=0.2)
    step = fc.solve(model, 1)[-1]
    modulus = law.E / (1.0 - law.nu**2) if kinematics == "plane_strain" else law.E
    force = step.reaction[model.mesh.points_of("RIGHT"), 1].sum() / (3.0 * modulus / 12.0 * 0.2 / 20.0**3)
    told = of_bending(step)
    assert bool(told) is (error is not None)
    assert force - 1.0 == pytest.approx(error or 0.0, abs=0.02)
    assert all(("too soft" in text) is (error < 0.0) for text in told)


@pytest.mark.parametrize("n", [1, 8])
def test_a_released_part_is_not_judged_by_its_residual_stress(n):
    """The stress that plastic flow leaves in a beam that bends right scatters, too, and so does round-off."""
    model = cantilever("quad4", n, fc.ElasticPlastic(E=12e3, nu=0.3, yield_stress=12.0), strain="small")
    model.add_traction("RIGHT", y=1.25 * 12.0 / 6.0 / 20.0, ramp=[(0.0, 0.0), (1.0, 1.0), (2.0, 0.0)])
    bent, released = (fc.solve(model, [0.5, 0.75, 1.0, 2.0][:count])[-1] for count in (3, 4))
    assert bool(of_bending(bent)) is (n == 1)
    assert of_bending(released) == []
    assert bool(released.cell_fields["plastic_strain"].any()) is (n == 8)


@pytest.mark.parametrize("kinematics", ["plane_strain", "axisymmetric"])
@pytest.mark.parametrize("name", ["quad4", "tri3", "tri6"])
def test_the_surplus_is_a_stiffness(name, kinematics):
    model = clamped(name, 0.499, "plain", kinematics, n=2)
    excess, shape = ExcessStiffness(model), model.mesh.points.shape
    S = np.column_stack([excess.force(unit.reshape(shape)).ravel() for unit in np.eye(model.n_dofs)])
    assert np.abs(S - S.T).max() < 1e-12 * np.abs(S).max()
    assert np.linalg.eigvalsh(S).min() > -1e-12 * np.abs(S).max()
    if name == "quad4":  # what the averaged element does not have
        moduli, material = model.material_numbers()
        K = stiffness(model.mesh, kinematics, moduli, material)
        averaged = stiffness(model.mesh, kinematics, moduli, material, averaged=np.array([True]))
        assert np.abs(S - (K - averaged).toarray()).max() < 1e-10 * np.abs(S).max()


@pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")
def test_an_alternating_mean_stress_is_reported_where_the_excess_of_stiffness_is_small():
    model = elastic_model(fc.generate.half_spheres(size=6.0), "plane_strain", E=20_000.0, nu=0.46, A1A2="x")
    supported(model, A2B2={"y": -2.0}, A1B1={"y": 2.0})
    model.add_contact("hertz", secondary="CONT1", primary="CONT2")
    texts = [text for text in fc.solve(model, 1)[-1].warnings if "cells lock" in text]
    assert len(texts) == 1
    assert texts[0].startswith(
        "tri3 cells lock: at nu = 0.46 their mean stress scatters by 49% about its averages at the nodes"
    )


@pytest.mark.parametrize("linear_solver", ["direct", "amg"])
def test_the_comparison_leaves_nothing_behind_in_the_solver(linear_solver):
    problem = prepare(clamped("quad4", 0.499, "plain"), fc.linear_ramp(1), fc.Criteria(), linear_solver=linear_solver)
    state, _ = load_step(problem, problem.initial_state(), 1, 1.0)
    before = repr(problem.solver.snapshot())
    assert locking_warning(problem, state.u)
    assert repr(problem.solver.snapshot()) == before


def test_a_material_without_cells_of_the_element_with_incompatible_modes():
    """The recovery of stresses raised a ValueError."""
    lower, upper = fc.generate.block((4.0, 0.5), (8, 2)), fc.generate.block((1.0, 1.0), (2, 2), "quad8", (1.5, 0.5))
    model = fc.Model(united(L_=lower, U_=upper), "plane_strain")
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.2, incompatible_modes=True), "L_BLOCK")
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.25), "U_BLOCK")
    supported(model, L_BOTTOM="xy", U_LEFT="x")
    model.add_pressure("U_TOP", 1.0)
    model.add_contact("c", secondary="U_BOTTOM", primary="L_TOP")
    assert fc.solve(model, 1)[-1].contact["c"].force == pytest.approx([0.0, 1.0], abs=1e-3)
