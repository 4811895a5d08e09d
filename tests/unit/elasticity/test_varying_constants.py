"""Material constants that vary over cells, points or by a function: exact solutions, equivalences, mistakes."""

import dataclasses

import mechanics
import numpy as np
import pytest
from models import elastic_model, made_of, pressed_spheres, supported
from pairwise import first_of
from refusals import refused

import fastcontact as fc
from fastcontact.model.fingerprint import differing_parts, fingerprint

pytestmark = pytest.mark.each_value

STEEL = {"E": 200_000.0, "nu": 0.3}
KINDS = (("tri3", 4e-3), ("tri6", 3e-5), ("quad4", 3e-3), ("quad8", 1e-5), ("quad9", 1e-5))


def curved(mesh, kinematics):
    """A strip of a block from radius 1 to 2, or a quarter of a ring bent from it."""
    if kinematics == "axisymmetric":
        return mesh
    radius, angle = mesh.points[:, 0], mesh.points[:, 1]
    return dataclasses.replace(mesh, points=np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]))


# ----------------------------------------------------------------------------- exact solutions
@pytest.mark.parametrize(("element", "tolerance"), KINDS)
def test_a_bar_whose_modulus_grows_extends_by_the_integral_of_stress_over_modulus(element, tolerance):
    mesh = fc.generate.block((2.0, 0.25), (16, 2), element)
    model = elastic_model(mesh, "plane_stress", E=lambda x: 1000.0 * np.exp(0.7 * x[:, 0]), nu=0.0, LEFT="x")
    model.fix("BOTTOM", "y")
    model.add_traction("RIGHT", x=3.0)
    exact = 3.0 / 1000.0 / 0.7 * (1.0 - np.exp(-1.4))
    assert abs(fc.solve(model, 1)[-1].displacement[mesh.points_of("RIGHT"), 0].mean() / exact - 1.0) < tolerance


def ring(element, kinematics, n, power=2.0, nu=0.3):
    """A ring of E = 1000 r^power under an inner pressure of 1: the model, and u and the hoop stress at given radii.

    u = A r^m1 + B r^m2 with m^2 + power m + power nu* - 1 = 0, where nu* = nu in plane stress and nu / (1 - nu) in plane
    strain (Horgan and Chan, Journal of Elasticity 55, 1999).
    """
    plane = kinematics == "plane_stress"
    height = 0.5 if kinematics == "axisymmetric" else np.pi / 2
    mesh = curved(fc.generate.block((1.0, height), (n, 2 if height == 0.5 else n), element, (1.0, 0.0)), kinematics)
    model = fc.Model(mesh, kinematics)
    axisymmetric = kinematics == "axisymmetric"
    model.add_material(
        fc.LinearElastic(E=lambda x: 1000.0 * (x[:, 0] if axisymmetric else np.hypot(*x.T)) ** power, nu=nu)
    )
    supported(model, BOTTOM="y", TOP="y" if axisymmetric else "x")
    model.add_pressure("LEFT", 1.0)
    ratio, factor = (nu, 1 / (1 - nu**2)) if plane else (nu / (1 - nu), (1 - nu) / ((1 + nu) * (1 - 2 * nu)))
    root = np.sqrt(power**2 / 4 + 1 - power * ratio)
    m = np.array([-power / 2 + root, -power / 2 - root])

    def radial(r):
        return 1000.0 * factor * r**power * (m + ratio) * r ** (m - 1)

    amounts = np.linalg.solve([radial(1.0), radial(2.0)], [-1.0, 0.0])

    def exact(r):
        powers = r[:, None] ** m
        hoop = 1000.0 * factor * r**power * ((powers / r[:, None]) @ (amounts * (1 + ratio * m)))
        return powers @ amounts, hoop

    return model, exact


@pytest.mark.parametrize("kinematics", ["axisymmetric", "plane_strain", "plane_stress"])
@pytest.mark.parametrize(
    ("element", "u_off", "hoop_off"), [("quad4", 2e-3, 6e-2), ("quad8", 2e-6, 3e-3), ("tri6", 1e-4, 3e-3)]
)
def test_a_graded_ring_under_pressure_is_that_of_horgan_and_chan(kinematics, element, u_off, hoop_off):
    model, exact = ring(element, kinematics, 16)
    step, bottom = fc.solve(model, 1)[-1], model.mesh.points_of("BOTTOM")
    radius = model.mesh.points[bottom, 0]
    u, hoop = exact(radius)
    np.testing.assert_allclose(step.displacement[bottom, 0], u, rtol=u_off)
    found = step.stress[bottom, 2 if kinematics == "axisymmetric" else 1]
    np.testing.assert_allclose(found, hoop, atol=hoop_off * np.abs(hoop).max())


def test_the_error_of_a_graded_ring_falls_as_that_of_a_uniform_one():
    """Displacements of quadratic cells converge with the fourth power, which moduli of the middle would not allow."""
    errors = []
    for n in (4, 8, 16):
        model, exact = ring("quad8", "axisymmetric", n)
        inner = model.mesh.points_of("LEFT")
        errors.append(abs(fc.solve(model, 1)[-1].displacement[inner, 0].mean() / exact(np.ones(1))[0][0] - 1.0))
    assert np.log2(errors[1] / errors[2]) > 3.5, errors


# ----------------------------------------------------------------------------- equivalences
def space(element):
    """A block with the groups of the plane ones."""
    names = {"XMIN": "LEFT", "XMAX": "RIGHT", "YMIN": "BOTTOM", "ZMIN": "BACK"}
    return fc.generate.renamed(fc.generate.box((2.0, 1.0, 1.0), (4, 2, 2), element, name="BLOCK"), names)


def meshes():
    yield "plane_strain", fc.generate.block((2.0, 1.0), (6, 3), "quad4")
    yield "plane_stress", fc.generate.block((2.0, 1.0), (6, 3), "tri6")
    yield "axisymmetric", fc.generate.block((2.0, 1.0), (6, 3), "quad8", (1.0, 0.0))
    for element in ("hex8", "tet4", "wedge6", "hex20"):
        yield "3d", space(element)


CASES = [pytest.param(*case, id=f"{case[0]}-{next(iter(case[1].solids))}") for case in meshes()]


def far(mesh):
    """Which solid cells lie beyond the middle."""
    middle = np.concatenate([mesh.points[block].mean(axis=1)[:, 0] for block in mesh.solids.values()])
    return middle > mesh.points[:, 0].min() + 1.0


def held(mesh, kinematics):
    """Two halves along x, held on the left and pulled obliquely on the right."""
    number = np.concatenate([mesh.offsets[name] + np.arange(len(block)) for name, block in mesh.solids.items()])
    model = fc.Model(mesh.with_groups(cells={"FAR": number[far(mesh)]}), kinematics)
    model.fix("LEFT", "xyz"[: mesh.dim])
    model.add_traction("RIGHT", x=2.0, y=1.0)
    return model


@pytest.mark.parametrize(("kinematics", "mesh"), CASES)
@pytest.mark.parametrize("given", ["cells", "all cells", "function"])
def test_two_values_over_the_cells_are_two_groups(kinematics, mesh, given):
    if given == "function" and "wedge6" in mesh.solids:
        pytest.skip("it has quadrature points on its sides, where the function jumps")
    two, one = held(mesh, kinematics), held(mesh, kinematics)
    two.add_material(fc.LinearElastic(1000.0, 0.2, density=2.0, expansion=1e-5))
    two.add_material(fc.LinearElastic(3000.0, 0.35, density=5.0, expansion=3e-5), "FAR")
    edge = mesh.points[:, 0].min() + 1.0

    def values(near, other):
        if given == "function":
            return lambda x: np.where(x[:, 0] > edge, other, near)
        return np.where(far(mesh), other, near)

    groups = "BLOCK" if given == "cells" else None
    one.add_material(
        fc.LinearElastic(
            values(1000.0, 3000.0), values(0.2, 0.35), density=values(2.0, 5.0), expansion=values(1e-5, 3e-5)
        ),
        groups,
    )
    for model in (one, two):
        model.add_temperature(40.0)
        model.add_gravity(y=-1.0)
    a, b = fc.solve(one, 1, linear_solver="direct")[-1], fc.solve(two, 1, linear_solver="direct")[-1]
    np.testing.assert_allclose(a.displacement, b.displacement, atol=1e-12 * np.abs(b.displacement).max())
    np.testing.assert_allclose(a.reaction, b.reaction, atol=1e-11 * np.abs(b.reaction).max())
    inside = np.ones(mesh.n_points, bool)
    inside[b.material_stress.points] = False  # where the two groups have a stress each, the one material has a mean
    np.testing.assert_allclose(a.stress[inside], b.stress[inside], atol=1e-11 * np.abs(b.stress).max())


@pytest.mark.parametrize(("kinematics", "mesh"), CASES)
def test_numbers_at_points_are_a_function_that_is_linear_and_constants_one_that_is_constant(kinematics, mesh):
    results = []
    for E, nu in (
        (lambda x: 1000.0 + 200.0 * x[:, 0], 0.3),
        (1000.0 + 200.0 * mesh.points[:, 0], np.full(mesh.n_points, 0.3)),
        (lambda x: np.full(len(x), 1000.0), np.full(mesh.n_points, 0.3)),
        (1000.0, 0.3),
    ):
        model = held(mesh, kinematics)
        model.add_material(fc.LinearElastic(E, nu))
        results.append(fc.solve(model, 1, linear_solver="direct")[-1])
    for a, b in (results[:2], results[2:]):
        np.testing.assert_allclose(a.displacement, b.displacement, atol=1e-12 * np.abs(b.displacement).max())
        np.testing.assert_allclose(a.stress, b.stress, atol=1e-11 * np.abs(b.stress).max())


@pytest.mark.parametrize("kinematics", ["plane_strain", "plane_stress", "axisymmetric", "3d"])
def test_orthotropic_constants_vary_likewise(kinematics):
    """With those of an isotropic material at each place, also turned, they are that material."""
    mesh = next(m for k, m in meshes() if k == kinematics)
    results = []

    def E(x):
        return 1000.0 + 200.0 * x[:, 0]

    turned = [(0.6, 0.8, 0.0), (-0.8, 0.6, 0.0)]
    for material in (
        fc.LinearElastic(E, 0.3, expansion=lambda x: 1e-5 * (1 + x[:, 0])),
        fc.Orthotropic(
            (E,) * 3, (0.3,) * 3, (lambda x: E(x) / 2.6,) * 3, turned, expansion=lambda x: 1e-5 * (1 + x[:, 0])
        ),
    ):
        model = held(mesh, kinematics)
        model.add_material(material)
        model.add_temperature(30.0)
        results.append(fc.solve(model, 1, linear_solver="direct")[-1])
    a, b = results
    np.testing.assert_allclose(a.displacement, b.displacement, atol=1e-11 * np.abs(b.displacement).max())
    np.testing.assert_allclose(a.stress, b.stress, atol=1e-10 * np.abs(b.stress).max())


@pytest.mark.parametrize("options", [{"volumetric": "mean_dilatation"}, {"incompatible_modes": True}, {}])
def test_nodal_forces_of_a_graded_body_balance_its_stress(options):
    """With every treatment of the strain: reactions and internal forces sum up to the load."""
    model = held(fc.generate.block((2.0, 1.0), (6, 3), "quad4", distortion=0.1), "plane_strain")
    model.add_material(fc.LinearElastic(E=fc.Tabulated("x", [(0.0, 500.0), (2.0, 5000.0)]), nu=0.3, **options))
    step = fc.solve(model, 1)[-1]
    assert mechanics.out_of_balance(model, step, 1.0)[0] < 1e-10
    assert np.allclose(step.reaction.sum(axis=0), [-2.0, -1.0], atol=1e-10)


@pytest.mark.parametrize("kinematics", ["plane_strain", "axisymmetric", "3d"])
def test_heat_that_expands_alike_leaves_a_graded_body_without_stress(kinematics):
    """Expansion that varies against the temperature: their product, the strain, is the same everywhere."""
    mesh = space("hex8") if kinematics == "3d" else fc.generate.block((2.0, 1.0), (6, 3), "quad8")
    law = fc.LinearElastic(E=lambda x: 1000.0 * (1.0 + x[:, 0]), nu=0.3, expansion=lambda x: 1e-5 + 0 * x[:, 0])
    model = made_of(mesh, kinematics, law, BOTTOM="y")
    if kinematics != "axisymmetric":
        model.fix("LEFT", "x")
    if kinematics == "3d":
        model.fix("BACK", "z")
    model.add_temperature(100.0)
    step = fc.solve(model, 1)[-1]
    assert np.abs(step.stress[:, :2]).max() < 1e-9
    np.testing.assert_allclose(
        step.displacement[:, 1], 1e-3 * mesh.points[:, 1] * (1.3 if kinematics == "plane_strain" else 1), atol=1e-12
    )


# ----------------------------------------------------------------------------- contact, solvers
@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous", "mortar"])
def test_graded_bodies_in_contact_shorten_by_the_integral(formulation):
    """Two columns without lateral strain, one upon the other: the stress is the pressure, the way the integral of p / E."""
    mesh = fc.generate.block_on_block("quad8", divisions_lower=(4, 8), divisions_upper=(4, 8))
    model = fc.Model(mesh, "plane_strain")
    height = np.ptp(mesh.points[:, 1]) / 2
    base = mesh.points[:, 1].min()

    def E(x):
        return 1000.0 * np.exp((x[:, 1] - base) / height)

    model.add_material(fc.LinearElastic(E=E, nu=0.0))
    supported(model, LOWER_BOTTOM="y", LOWER_LEFT="x", UPPER_LEFT="x")
    model.add_pressure("UPPER_TOP", 5.0)
    model.add_contact("pair", secondary="CONT_UPPER", primary="CONT_LOWER", formulation=formulation)
    step = fc.solve(model, 1)[-1]
    exact = -5.0 * height / 1000.0 * (1.0 - np.exp(-2.0))
    np.testing.assert_allclose(step.displacement[mesh.points_of("UPPER_TOP"), 1], exact, rtol=1e-4)
    assert abs(step.contact["pair"].force[1]) == pytest.approx(50.0, rel=1e-9)
    assert mechanics.out_of_balance(model, step, 1.0)[0] < 1e-8


@pytest.mark.parametrize("solver", first_of(2, ["direct", "amg", "pyamg"]))
def test_all_solvers_agree_on_a_graded_hertz_contact(solver):
    mesh = fc.generate.half_spheres(size=6.0)
    forces = []
    for linear in ("cholmod" if solver == "direct" else "direct", solver):
        E = fc.Tabulated("y", [(-20.0, 10_000.0), (20.0, 40_000.0)])
        model = pressed_spheres(mesh, 1.0, material=fc.LinearElastic(E=E, nu=0.3))
        try:
            step = fc.solve(model, fc.linear_ramp(1), linear_solver=linear)[-1]
        except fc.ModelError as error:
            pytest.skip(str(error))
        forces.append(abs(step.contact["hertz"].force[1]))
        assert mechanics.out_of_balance(model, step, 1.0, 1e-10)[0] < 1e-7
    assert forces[0] == pytest.approx(forces[1], rel=1e-7)


# ----------------------------------------------------------------------------- words and mistakes
def block_model(**constants):
    return made_of(
        fc.generate.block((2.0, 1.0), (4, 2), "quad4"), "plane_strain", fc.LinearElastic(**{**STEEL, **constants})
    )


@pytest.mark.parametrize(
    ("constants", "words"),
    [
        ({"E": lambda x: 1.5 - x[:, 0]}, r"in cell 3 of quad4 near \[1.75 0.5 *\]|in cell \d of .* modulus E = -"),
        ({"nu": lambda x: 0.2 + 0.2 * x[:, 0]}, r"in cell \d of quad4 near .*: Poisson's ratio nu = 0\.[5]"),
        ({"density": lambda x: x[:, 0] - 1.0}, r"in cell 0 of quad4 near .*: the density = -"),
        ({"E": np.ones(7)}, r"constant E of .* is an array .* shape \(7,\).* \(8 cells, 8 solid cells .*, 15 points"),
        ({"E": np.array([1.0] * 7 + [np.nan])}, "constant E of the material is not finite at row 7"),
        ({"nu": lambda x: x}, "constant nu of the material is a function that returned .* shape"),
        ({"expansion": lambda x: x[:, 0] / 0.0}, "constant expansion of the material is .* finite everywhere"),
        ({"E": lambda x: np.full(len(x), 1e80)}, "out of range"),
        ({"E": np.ones((8, 2))}, r"shape \(8, 2\)"),
        ({"E": np.ones((15, 1))}, r"shape \(15,\): it must have a number for each cell"),
    ],
)
@pytest.mark.filterwarnings("ignore:divide by zero")
def test_constants_that_cannot_be_are_told_with_their_place(constants, words):
    refused(fc.ModelError, words, block_model, **constants)


def test_orthotropic_constants_that_cannot_be_are_told_with_their_place():
    model = fc.Model(fc.generate.block((2.0, 1.0), (4, 2), "quad4"), "plane_strain")
    for change, words in (
        ({"nu": (lambda x: x[:, 0], 0.3, 0.3)}, r"in cell \d of quad4 near .*: Poisson's ratio nu12 = 1"),
        ({"nu": (lambda x: 0.5 * x[:, 0], 0.5, 0.5)}, r"in cell \d of quad4 .*: Poisson's ratios .* too large"),
        ({"G": (np.linspace(-1, 1, 8), 1.0, 1.0)}, r"in cell 0 of quad4 near .*: the shear modulus G12 = -1"),
    ):
        constants = {"E": (1000.0,) * 3, "nu": (0.3,) * 3, "G": (400.0,) * 3, **change}
        refused(fc.ModelError, words, model.add_material, fc.Orthotropic(**constants))


def test_as_many_cells_as_points_is_no_array():
    """Eight triangles around a node in a ring of eight: an array of nine is for the points, of eight for the cells."""
    angle = np.arange(8) * np.pi / 4
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    cells = [[8, i, (i + 1) % 8] for i in range(8)]
    wheel = fc.Mesh([*ring, [0, 0]], {"tri3": cells}, {"A": [0, 1]})
    for n in (2, 8, 9):
        model = made_of(wheel, "plane_strain", {"A": fc.LinearElastic(np.ones(n), 0.3)})
        assert model.materials[0][0].E.varies_within_cells == (n == 9)
    lone = fc.Mesh([*ring, [0, 0], [5.0, 0.0]], {"tri3": [*cells, [0, 9, 1], [0, 7, 9]]})
    model = fc.Model(lone, "plane_strain")
    with pytest.raises(fc.ModelError, match="10 numbers, but there are as many cells as points: give values of cells"):
        model.add_material(fc.LinearElastic(np.ones(10), 0.3))
    model.add_material(fc.LinearElastic(np.ones((10, 1)), 0.3))
    assert not model.materials[0][0].E.varies_within_cells


def test_a_model_in_words_tells_the_range():
    model = block_model(E=lambda x: 1000.0 * (1.0 + np.floor(x[:, 0])))
    assert "Material: E = 1000 to 2000, nu = 0.3 in all solid cells." in model.describe()
    assert "a function of the position" in repr(fc.LinearElastic(lambda x: x[:, 0], 0.3))
    refused(fc.ModelError, "depend on the position", fc.LinearElastic(lambda x: x[:, 0], 0.3).moduli, "3d")


def test_values_of_constants_count_in_a_fingerprint():
    given = [lambda x: 1.0 + x[:, 0], lambda x: x[:, 0] + 1.0, lambda x: 2.0 + x[:, 0], np.ones(8), np.full(8, 2.0)]
    one, same, other, cells, further = (fingerprint(block_model(E=E)) for E in given)
    assert one == same
    assert differing_parts(one, other) == differing_parts(cells, further) == ["the materials"]


def test_a_table_is_straight_between_its_places_and_constant_beyond():
    table = fc.Tabulated("radius", [(1.0, 10.0), (3.0, 30.0)])
    np.testing.assert_allclose(table(np.array([[0.0, 0.5], [1.2, 1.6], [3.0, 4.0]])), [10.0, 20.0, 30.0])
    assert fc.Tabulated("z", [(0, 1), (1, 2)])(np.array([[9.0, 9.0, 0.5]])) == 1.5
    refused(fc.ModelError, "the mesh is plane", fc.Tabulated("z", [(0, 1)]), np.zeros((1, 2)))
    radial = fc.Tabulated("radius", [(1.0, 10.0), (3.0, 30.0)])
    for number in range(3):
        model = elastic_model(fc.generate.block(), "axisymmetric", E=radial if number == 0 else 1000.0, BOTTOM="y")
        if number == 1:
            model.add_temperature(radial)
        if number == 2:
            model.add_pressure("TOP", radial)
        refused(fc.ModelError, "in axisymmetry the radius is x", model.check)
    for arguments, words in (
        (("r", [(0, 1)]), "along x, y, z or radius, not along 'r'"),
        (("x", [(0, 1), (0, 2)]), "must have ascending coordinates"),
        (("x", []), "ascending coordinates, at least one"),
        (("x", [(0, 1, 2)]), "pairs"),
        (("x", [(0, np.inf)]), "not a finite number"),
    ):
        refused(fc.ModelError, words, fc.Tabulated, *arguments)


@pytest.mark.parametrize("kinematics", ["plane_strain", "3d"])
def test_the_error_of_a_graded_body_is_estimated_like_that_of_others(kinematics):
    """With a function that is constant the estimate, which looks at other points of the cells, is that of the constant."""
    mesh = space("hex8") if kinematics == "3d" else fc.generate.block((2.0, 1.0), (6, 3), "quad8")
    found = []
    for E, expansion in ((1000.0, 1e-5), (lambda x: np.full(len(x), 1000.0), lambda x: np.full(len(x), 1e-5))):
        model = held(mesh, kinematics)
        model.add_material(fc.LinearElastic(E, 0.3, expansion=expansion))
        model.add_temperature(lambda x: 30.0 * x[:, 0] ** 2)
        found.append(fc.estimate_error(model, fc.solve(model, 1)[-1]))
    np.testing.assert_allclose(found[0].cells, found[1].cells, rtol=1e-8, atol=1e-12)
    assert found[0].relative > 1e-3


def test_density_and_expansion_of_any_material_may_vary():
    """Weight and free expansion of anisotropic bodies, with functions that are constant and with numbers."""
    D = fc.LinearElastic(1000.0, 0.3).moduli("3d")
    results = []
    for density, expansion in (
        (2.0, 1e-5),
        (np.full(16, 2.0), (lambda x: np.full(len(x), 1e-5), 1e-5, np.full(16, 1e-5))),
    ):
        model = made_of(space("hex8"), "3d", fc.Anisotropic(D, density=density, expansion=expansion), BOTTOM="xyz")
        model.add_gravity(y=-1.0)
        model.add_temperature(50.0)
        results.append(fc.solve(model, 1, linear_solver="direct")[-1])
        assert results[-1].reaction[:, 1].sum() == pytest.approx(4.0, rel=1e-9)
    np.testing.assert_allclose(results[0].displacement, results[1].displacement, atol=1e-14)


def test_the_contrast_of_materials_that_vary_is_that_of_their_cells():
    """Nearly incompressible, or soft in one direction: linear solvers are told, whether the constants vary or not."""
    found = {}
    for nu in (0.499, lambda points: np.full(len(points), 0.499)):
        model = elastic_model(fc.generate.block(), "plane_strain", nu=nu)
        found[callable(nu)] = model.material_field().contrast
    assert found[False] == pytest.approx(0.499 / 0.002)
    assert found[True] == pytest.approx(found[False])
    soft = {"E": (1e5, 5e4, 2e4), "nu": (0.0, 0.0, 0.0), "G": (1e4, 1e4, 1e4)}
    for axes in (None, fc.CylindricalAxes((-5.0, 0.5, 0.0), (0.0, 0.0, 1.0))):
        model = made_of(fc.generate.box(divisions=(2, 2, 2)), "3d", fc.Orthotropic(**soft, axes=axes))
        assert model.material_field().contrast == pytest.approx((5.0 - 1.0) / 3.0, rel=0.01)


def test_contact_and_warnings_know_the_range_of_moduli():
    """The softest place scales contact; moduli that differ much are told; without cells nothing is known of them."""
    mesh = fc.generate.block_on_block("quad4", divisions_lower=(4, 2), divisions_upper=(4, 2))
    model = fc.Model(mesh, "plane_strain")
    low = mesh.points[:, 1].min()
    E = fc.Tabulated("y", [(low, 1000.0), (low + 10.0, 3000.0)])
    model.add_material(fc.Orthotropic((E,) * 3, (0.3,) * 3, (400.0,) * 3))
    material = model.materials[0][0]
    assert 1000.0 < material.young[0] < material.young[1] < 3000.0
    assert material.contact_modulus == pytest.approx(material.young[0] / (1 - 0.3**2), rel=0.05)
    loose = fc.Orthotropic((E,) * 3, (0.3,) * 3, (400.0,) * 3)
    for name in ("young", "contact_modulus"):
        refused(fc.ModelError, "constants of the material depend on the position", getattr, loose, name)
