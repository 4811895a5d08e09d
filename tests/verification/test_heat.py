"""Steady heat: exact solutions, rates of convergence, conductance of contacts, coupling with contact and friction."""

import itertools

import numpy as np
import pytest
from case_texts import case_of, contact_pair
from models import made_of, supported, with_contact
from pairwise import first_of
from refusals import refused
from scipy.optimize import brentq

import fastcontact as fc
from fastcontact.elasticity.loads import quadrature_points

pytestmark = pytest.mark.each_value

BARS = {"size_lower": (0.05, 0.1), "size_upper": (0.05, 0.1), "divisions_lower": (3, 4), "divisions_upper": (4, 3)}
REST = "ignore:contact 'c' never closed"


@pytest.mark.parametrize("yields", [False, True])
def test_a_hub_loosened_by_conducted_heat_is_told(yields):
    model = fc.Model(fc.generate.rings(), kinematics="plane_stress", reference_temperature=0.0)
    law = fc.ElasticPlastic if yields else fc.LinearElastic
    options = {"yield_stress": 1e4} if yields else {}
    for group, E, expansion in (("INNER", 210e3, 12e-6), ("OUTER", 70e3, 23e-6)):
        model.add_material(law(E=E, nu=0.3, expansion=expansion, conductivity=50.0, **options), group)
    supported(model, SYMMETRY_X="x", SYMMETRY_Y="y")
    model.fix_temperature("BORE", 20.0)
    model.fix_temperature("RIM", 80.0)
    model.add_contact("fit", secondary="CONT_OUTER", primary="CONT_INNER", clearance=-0.05, conductance=1.0)
    with pytest.warns(fc.FastcontactWarning, match="'fit' has opened again at the end: the smallest gap"):
        steps = fc.solve(model, fc.linear_ramp(2))
    assert [step.contact["fit"].active.any() for step in steps] == [True, False]


def two_bars(kinematics, element, **contact):
    """Two bars of conductivities 50 and 20, 100 at one end and 0 at the other, whose meshes do not match."""
    if kinematics == "3d":
        parts = []
        for name, divisions, base in (("LOWER", (2, 2, 2), -0.1), ("UPPER", (3, 3, 2), 0.0)):
            part = fc.generate.box((0.05, 0.05, 0.1), divisions, element, name=name)
            part = fc.generate.transformed(part, translate=(0.0, 0.0, base))
            sides = {"ZMIN": "CONT_UPPER", "ZMAX": "UPPER_TOP"} if base == 0.0 else {}
            sides = sides or {"ZMIN": "LOWER_BOTTOM", "ZMAX": "CONT_LOWER"}
            new = {group: sides.get(group, f"{name}_{group}") for group in part.group_names if group != name}
            parts.append(fc.generate.renamed(part, lambda group, new=new: new.get(group, group)))
        mesh = fc.generate.union(*parts)
    else:
        mesh = fc.generate.block_on_block(element, **BARS)
    model = fc.Model(mesh, kinematics)
    model.add_material(fc.LinearElastic(E=1e9, nu=0.3, conductivity=50.0), "UPPER")
    model.add_material(fc.LinearElastic(E=1e9, nu=0.3, conductivity=20.0), "LOWER")
    for end, temperature in (("LOWER_BOTTOM", 0.0), ("UPPER_TOP", 100.0)):
        model.fix(end, "xyz"[: mesh.dim])
        model.fix_temperature(end, temperature)
    return with_contact(model, "c", "CONT_UPPER", "CONT_LOWER", conductance=1000.0, **contact)


def check_bars(model, tolerance):
    step, mesh = fc.solve(model, 1)[-1], model.mesh
    flux = np.zeros(mesh.dim)
    flux[-1] = -12_500.0
    assert step.heat_flux == pytest.approx(np.tile(flux, (len(step.heat_flux), 1)), abs=tolerance * 12_500.0)
    assert step.contact["c"].heat_flux == pytest.approx(12_500.0, rel=tolerance)
    assert step.temperature[mesh.points_of("CONT_UPPER")] == pytest.approx(75.0, rel=tolerance)
    assert step.temperature[mesh.points_of("CONT_LOWER")] == pytest.approx(62.5, rel=tolerance)
    power = step.heat["contacts"]["c"]
    assert step.heat_reaction[mesh.points_of("UPPER_TOP")].sum() == pytest.approx(power, rel=tolerance)
    assert step.heat_reaction.sum() == pytest.approx(0.0, abs=1e-10 * power)


@pytest.mark.filterwarnings(REST)
@pytest.mark.parametrize(
    ("kinematics", "element", "contact"),
    [(kinematics, element, {}) for kinematics in ("plane_strain", "axisymmetric")
     for element in ("tri3", "tri6", "quad4", "quad8", "quad9")]
    + [("plane_stress", element, {"formulation": "mortar", "multipliers": "standard"}) for element in ("tri3", "quad8")]
    + [("axisymmetric", "quad8", {"formulation": "mortar", "multipliers": "standard"}),
       ("plane_stress", "quad4", {"kind": "tied"}), ("axisymmetric", "tri6", {"kind": "gap_only"})],
    ids=str,
)  # fmt: skip
def test_uniform_flux_passes_between_meshes_that_do_not_match(kinematics, element, contact):
    check_bars(two_bars(kinematics, element, **contact), 1e-9)


@pytest.mark.filterwarnings(REST)
@pytest.mark.parametrize("element", ["tet4", "tet10", "hex8", "hex20", "hex27", "wedge6"])
def test_uniform_flux_passes_between_faces_that_do_not_match(element):
    check_bars(two_bars("3d", element), 1e-9)


@pytest.mark.filterwarnings(REST)
def test_uniform_flux_of_other_formulations_and_by_multigrid():
    for formulation, off in (("continuous", 0.05), ("node_to_segment", 0.15)):  # quadrature; a row a node
        step = fc.solve(two_bars("plane_strain", "quad4", formulation=formulation), 1)[-1]
        assert step.contact["c"].heat_flux == pytest.approx(12_500.0, rel=off)
        assert step.heat_reaction.sum() == pytest.approx(0.0, abs=1e-8)
    step = fc.solve(two_bars("3d", "hex8"), 1, linear_solver="amg")[-1]
    assert step.contact["c"].heat_flux == pytest.approx(12_500.0, rel=1e-7)


def cylinder_wall(element, count, k=15.0):
    mesh = fc.generate.block((1.0, 0.2), (count, 1), element, (1.0, 0.0))
    return mesh, made_of(mesh, "axisymmetric", fc.LinearElastic(E=1.0, nu=0.3, conductivity=k), BOTTOM="y")


def test_cylinder_wall_has_the_logarithmic_profile():
    mesh, model = cylinder_wall("quad8", 16)
    model.fix_temperature("LEFT", 200.0)
    model.fix_temperature("RIGHT", 20.0)
    step = fc.solve(model, 1)[-1]
    exact = 200.0 - 180.0 * np.log(mesh.points[:, 0]) / np.log(2.0)
    assert step.temperature == pytest.approx(exact, abs=1e-4)
    power = 2.0 * np.pi * 15.0 * 0.2 * 180.0 / np.log(2.0)
    assert step.heat_reaction[mesh.points_of("LEFT")].sum() == pytest.approx(power, rel=1e-6)


def test_wall_between_films_with_a_flux_and_a_source():
    mesh = fc.generate.block((1.0, 0.5), (4, 2), "quad8")
    model = made_of(mesh, "plane_strain", fc.LinearElastic(E=1.0, nu=0.3, conductivity=2.0), reference_temperature=20.0)
    model.fix("LEFT", "xy")
    model.add_film("LEFT", 10.0, 80.0)
    model.add_heat_flux("RIGHT", 30.0)
    model.add_heat_source(16.0)
    step = fc.solve(model, 1)[-1]
    x = mesh.points[:, 0]  # all heat leaves on the left: 30 + 16 = 10 (T(0) - 80)
    assert step.temperature == pytest.approx(84.6 + (46.0 * x - 8.0 * x**2) / 2.0, rel=1e-12)
    assert step.heat["loads"] == pytest.approx(0.5 * 46.0)
    assert step.heat["films"] == pytest.approx(-0.5 * 46.0)


def test_conductivity_by_axes_and_by_position():
    turned = fc.Model(fc.generate.block((1.0, 1.0), (3, 3), "quad4"), "plane_strain")
    axes = [[1, 1, 0], [-1, 1, 0]]
    wood = {"E": (1.0, 1.0, 1.0), "nu": (0.3, 0.3, 0.3), "G": (0.4, 0.4, 0.4)}
    turned.add_material(fc.Orthotropic(**wood, conductivity=(4.0, 2.0, 1.0), axes=axes))
    turned.fix("LEFT", "xy")
    for side in ("LEFT", "RIGHT", "TOP", "BOTTOM"):
        turned.fix_temperature(side, lambda p: 10.0 * p[:, 0])
    flux = fc.solve(turned, 1)[-1].heat_flux
    assert flux == pytest.approx(np.tile([-30.0, -10.0], (9, 1)), rel=1e-12)  # k_xx = (4 + 2) / 2, k_xy = (4 - 2) / 2
    law = fc.LinearElastic(E=1.0, nu=0.3, conductivity=lambda p: 1.0 + p[:, 0])
    graded = made_of(fc.generate.block((1.0, 1.0), (64, 1), "quad8"), "plane_strain", law, LEFT="xy")
    graded.fix_temperature("LEFT", 0.0)
    graded.fix_temperature("RIGHT", 1.0)
    step, x = fc.solve(graded, 1)[-1], graded.mesh.points[:, 0]
    assert step.temperature == pytest.approx(np.log(1.0 + x) / np.log(2.0), abs=1e-8)


MADE_UP = {
    "plane_strain": (
        lambda p: np.sin(2.0 * p[:, 0]) * np.exp(p[:, 1]),
        lambda p: 3.0 * np.sin(2.0 * p[:, 0]) * np.exp(p[:, 1]),
    ),
    "axisymmetric": (  # T'' + T' / r + T_yy of cos(2 r) exp(y)
        lambda p: np.cos(2.0 * p[:, 0]) * np.exp(p[:, 1]),
        lambda p: np.exp(p[:, 1]) * (3.0 * np.cos(2.0 * p[:, 0]) + 2.0 * np.sin(2.0 * p[:, 0]) / p[:, 0]),
    ),
    "3d": (
        lambda p: np.sin(2.0 * p[:, 0]) * np.exp(p[:, 1]) * np.cos(p[:, 2]),
        lambda p: 4.0 * np.sin(2.0 * p[:, 0]) * np.exp(p[:, 1]) * np.cos(p[:, 2]),
    ),
}


def error_of_manufactured(kinematics, element, count):
    """The error in the mean square over the volume, relative."""
    exact, source = MADE_UP[kinematics]
    if kinematics == "3d":
        mesh = fc.generate.box((1.0, 1.0, 1.0), (count,) * 3, element)
        sides = ["XMIN", "XMAX", "YMIN", "YMAX", "ZMIN", "ZMAX"]
    else:
        mesh = fc.generate.block((1.0, 1.0), (count,) * 2, element, (0.5, 0.0), distortion=0.1)
        sides = ["LEFT", "RIGHT", "TOP", "BOTTOM"]
    model = made_of(mesh, kinematics, fc.LinearElastic(E=1.0, nu=0.3, conductivity=7.0))
    model.fix(sides[0], "xyz"[: mesh.dim])
    for side in sides:
        model.fix_temperature(side, exact)
    model.add_heat_source(lambda p: 7.0 * source(p))
    step, square, whole = fc.solve(model, 1)[-1], 0.0, 0.0
    for name, cells in mesh.solids.items():
        x, N, volume = quadrature_points(mesh, name, cells, kinematics)
        wanted = exact(x.reshape(-1, mesh.dim)).reshape(volume.shape)
        square += float((volume * (step.temperature[cells] @ N.T - wanted) ** 2).sum())
        whole += float((volume * wanted**2).sum())
    return np.sqrt(square / whole)


@pytest.mark.parametrize(
    ("kinematics", "element", "rate"),
    first_of(3, [("plane_strain", "tri6", 2.7), ("axisymmetric", "quad4", 1.8), ("3d", "hex8", 1.8),
     ("plane_strain", "tri3", 1.8), ("plane_strain", "quad4", 1.8), ("plane_strain", "quad8", 2.7),
     ("axisymmetric", "tri6", 2.7), ("3d", "tet4", 1.6)]),
)  # fmt: skip
def test_rates_on_manufactured_solutions(kinematics, element, rate):
    counts = (4, 8) if kinematics == "3d" else (8, 16)
    coarse, fine = (error_of_manufactured(kinematics, element, count) for count in counts)
    assert np.log2(coarse / fine) > rate
    assert fine < 0.02


def column(conductance, gap, alpha=1e-5, k=(50.0, 20.0), E=2e11):
    """Two bars that expand along y alone, with a gap between them, held at their outer ends."""
    model = fc.Model(fc.generate.block_on_block("quad4", **BARS), "plane_strain")
    for body, own in zip(("UPPER", "LOWER"), k, strict=True):
        model.add_material(fc.LinearElastic(E=E, nu=0.0, expansion=alpha, conductivity=own), body)
    supported(model, LOWER_BOTTOM="y", UPPER_TOP="y", LOWER="x", UPPER="x")
    model.fix_temperature("UPPER_TOP", 100.0)
    model.fix_temperature("LOWER_BOTTOM", 0.0)
    return with_contact(model, "c", "CONT_UPPER", "CONT_LOWER", clearance=gap, conductance=conductance)


def column_exact(h, gap, alpha=1e-5, k=(50.0, 20.0), E=2e11, L=0.1):
    """The flux and the pressure of `column`."""

    def pressure_and_gap(q):
        grown = alpha * L * (100.0 - 0.5 * q * L / k[0] + 0.5 * q * L / k[1]) - gap
        return max(grown, 0.0) * E / (2.0 * L), max(-grown, 0.0)

    q = brentq(
        lambda q: q - h(*pressure_and_gap(q)) * (100.0 - q * L * (1 / k[0] + 1 / k[1])), 0.0, 14_285.0, xtol=1e-10
    )
    return q, pressure_and_gap(q)


@pytest.mark.parametrize(
    ("law", "gap"),
    [(lambda p, g: 100.0 + 2e-5 * p, 5e-5), (lambda p, g: 3.0 / (0.003 + g / 1e-3) + 1e-5 * p, 1.2e-4)],
    ids=["pressure", "gap"],
)
@pytest.mark.filterwarnings(REST)
def test_conductance_by_pressure_and_gap_settles_with_the_expansion(law, gap):
    step = fc.solve(column(law, gap), 1)[-1]
    q, (pressure, open_by) = column_exact(law, gap)
    contact = step.contact["c"]
    assert contact.heat_flux == pytest.approx(q, rel=1e-7)
    assert contact.pressure == pytest.approx(pressure, rel=1e-6)
    assert contact.gap == pytest.approx(open_by, abs=1e-10)
    assert (pressure == 0.0) == (open_by > 0.0)
    assert step.heat["exchanges"] > 2


def test_tables_are_their_functions_and_steps_begin_where_others_ended():
    table = column({"pressure": [(0.0, 100.0), (1e9, 20_100.0)], "gap": [(0.0, 100.0), (1.0, 100.0)]}, 5e-5)
    one, other = fc.solve(table, 1)[-1], fc.solve(column(lambda p, g: 100.0 + 2e-5 * p, 5e-5), 3)[-1]
    assert one.temperature == pytest.approx(other.temperature, rel=1e-8)
    assert one.displacement == pytest.approx(other.displacement, abs=1e-8 * np.abs(other.displacement).max())


def test_heat_of_friction_leaves_through_films():
    mesh = fc.generate.block_on_block("quad4", size_lower=(20.0, 5.0), shift=2.0)
    model = made_of(mesh, "plane_strain", fc.LinearElastic(E=1000.0, nu=0.0, conductivity=3.0), LOWER_BOTTOM="xy")
    model.prescribe("UPPER_TOP", y=-0.05, ramp=[(0.0, 0.0), (1.0, 1.0), (2.0, 1.0), (4.0, 1.0)])
    model.prescribe("UPPER_TOP", x=1.0, ramp=[(0.0, 0.0), (1.0, 0.0), (2.0, 1.0), (4.0, 2.0)])
    with_contact(model, "c", "CONT_UPPER", "CONT_LOWER", friction=0.3, friction_heat=0.9, conductance=1e3)
    model.add_film("UPPER_TOP", 1.0, 0.0)
    model.add_film("LOWER_BOTTOM", 1.0, 0.0)
    for step in fc.solve(model, fc.Ramp((1.0, 2.0, 4.0), ((0.0, 0.0), (4.0, 4.0))))[1:]:
        contact = step.contact["c"]
        shear = float(np.abs(contact.force[0]))
        assert shear == pytest.approx(0.3 * np.abs(contact.force[1]), rel=0.01)
        # What blocks shear at first is no slip.
        speed, elastic = (1.0, 0.05) if step.load_factor == 2.0 else (0.5, 2e-3)
        assert step.heat["friction"] == pytest.approx(0.9 * shear * speed, rel=elastic)
        assert step.heat["films"] == pytest.approx(-step.heat["friction"], rel=1e-10)
        assert step.temperature.min() > 0.0


@pytest.mark.filterwarnings("ignore")
def test_hot_hertz_contact_passes_conductance_times_force():
    # Where bodies conduct much better than the contact each has one temperature, and by h = c p all heat is c F dT.
    mesh = fc.generate.half_spheres(size=4.0)
    model = made_of(mesh, "axisymmetric", fc.LinearElastic(E=20_000.0, nu=0.3, expansion=1e-5, conductivity=1e7))
    supported(model, A1A2="x", A2B2={"y": -1.0}, A1B1={"y": 1.0})
    model.fix_temperature("A2B2", 20.0)
    model.fix_temperature("A1B1", 320.0)
    model.add_contact("hertz", secondary="CONT1", primary="CONT2", conductance=lambda p, g: 0.02 * p)
    step = fc.solve(model, 2)[-1]
    heat = step.heat["contacts"]["hertz"]
    side = 1.0 if step.temperature[mesh.points_of("CONT1")].mean() > 170.0 else -1.0
    assert side * heat == pytest.approx(0.02 * step.contact["hertz"].normal_force * 300.0, rel=2e-4)
    assert step.heat["exchanges"] >= 2


@pytest.mark.parametrize(
    ("kinematics", "element", "options", "size", "mean_error", "largest_error"),
    [
        ("plane_strain", "quad4", {"formulation": "node_to_segment"}, 0.125, 0.015, 0.03),
        ("plane_strain", "tri3", {"formulation": "mortar", "multipliers": "dual"}, 0.125, 0.015, 0.03),
        ("axisymmetric", "quad8", {"formulation": "mortar", "multipliers": "dual"}, 0.125, 0.02, 0.055),
        ("axisymmetric", "tri6", {"formulation": "node_to_segment"}, 0.125, 0.02, 0.03),
        ("3d", "hex8", {"formulation": "node_to_segment"}, 0.25, 0.02, 0.04),
    ],
)
@pytest.mark.filterwarnings("ignore")
def test_a_constant_conductance_acts_on_the_closed_area(kinematics, element, options, size, mean_error, largest_error):
    """Below a ball of 0, a block of 1 with a rim in several places within facets; area of Hertz at equal force."""
    E, R, dim = 1000.0 * (1 - 0.3**2), 40.0, 3 if kinematics == "3d" else 2
    mesh = fc.generate.graded_block(element, width=8.0, contact_radius=1.25, contact_size=size)
    model = made_of(mesh, kinematics, fc.LinearElastic(E=E, nu=0.3, conductivity=1e9))
    supported(model, SYMMETRY_X="x", **({"SYMMETRY_Y": "y"} if dim == 3 else {}), BOTTOM="xy"[: dim - 1])
    height = np.array([0.9, 1.2]) / R if kinematics == "plane_strain" else np.array([0.64, 1.2]) / R
    model.prescribe("BOTTOM", **{"xyz"[dim - 1]: 1.0}, ramp=[(0.0, 0.0), (1.0, height[0]), (2.0, height[1])])
    model.fix_temperature("BOTTOM", 1.0, ramp=[(0.0, 1.0), (2.0, 1.0)])
    ball = fc.obstacles.Sphere((0.0,) * (dim - 1) + (R,), R)
    model.add_obstacle("ball", secondary="CONTACT", obstacle=ball, conductance=2.0, obstacle_temperature=0.0, **options)
    errors = []
    for step in fc.solve(model, np.linspace(1.0, 2.0, 6 if dim == 2 else 3).tolist()):
        force, closed = step.contact["ball"].normal_force, step.heat["contacts"]["ball"] / 2.0
        if kinematics == "plane_strain":
            area = np.sqrt(8.0 * force * R / (np.pi * 1000.0))
        else:
            share = 0.25 if dim == 3 else 1.0
            area = share * np.pi * (0.75 * force / share * R / 1000.0) ** (2 / 3)
        errors.append(closed / area - 1.0)
    assert abs(np.mean(errors)) < mean_error
    assert np.abs(errors).max() < largest_error


def test_free_expansion_by_conduction_is_without_stress():
    mesh = fc.generate.block((2.0, 1.0), (4, 2), "quad8")
    law = fc.LinearElastic(E=2e5, nu=0.3, expansion=1e-5, conductivity=40.0)
    model = made_of(mesh, "plane_stress", law, reference_temperature=20.0, LEFT="x", BOTTOM_LEFT="y")
    model.fix_temperature("BLOCK", 120.0)
    step = fc.solve(model, 2)[-1]
    assert step.displacement[:, 0] == pytest.approx(1e-3 * mesh.points[:, 0], abs=1e-14)
    assert np.abs(step.stress).max() < 1e-9
    assert fc.solve(model, 2)[0].temperature == pytest.approx(70.0)


def test_temperatures_and_films_come_and_go():
    mesh = fc.generate.block((1.0, 0.5), (4, 2))
    law = fc.LinearElastic(E=1.0, nu=0.3, conductivity=2.0)
    model = made_of(mesh, "plane_strain", law, reference_temperature=20.0, LEFT="xy")
    model.fix_temperature("LEFT", 100.0, ramp=[(0.0, 1.0), (4.0, 1.0)])
    model.add_film("RIGHT", 2.0, 20.0, ends=2.0)
    model.fix_temperature("RIGHT", 220.0, ramp=[(0.0, 0.0), (1.0, 0.0), (2.0, 1.0), (4.0, 1.0)], begins=1.0, ends=3.0)
    steps = fc.solve(model, [1.0, 1.5, 2.0, 3.0, 4.0])
    ends = [step.temperature[mesh.points_of("RIGHT")] for step in steps]
    assert ends == [pytest.approx(value, rel=1e-12) for value in (60.0, 140.0, 220.0, 220.0, 100.0)]
    films = [step.heat["films"] for step in steps]
    assert films == pytest.approx([-40.0, -120.0, -200.0, 0.0, 0.0], rel=1e-12)
    text = model.describe()
    assert "from 0 to 2" in text
    assert "from 1 to 3" in text


def test_spans_that_cannot_be_are_refused():
    model = fc.Model(fc.generate.block(), "plane_strain")
    with pytest.raises(fc.errors.ModelError, match="begins at 1 without a ramp: give it a ramp"):
        model.fix_temperature("RIGHT", 220.0, begins=1.0)
    with pytest.raises(fc.errors.ModelError, match="the film on 'RIGHT' begins at 2 and ends at 1: it must begin"):
        model.add_film("RIGHT", 2.0, 20.0, begins=2.0, ends=1.0)


def test_ends_of_a_period_have_one_temperature():
    mesh = fc.generate.block((1.0, 4.0), (2, 8), "quad4")
    model = made_of(mesh, "plane_stress", fc.LinearElastic(E=2e5, nu=0.3, conductivity=40.0), BOTTOM="xy")
    model.add_periodicity("LEFT", "RIGHT", x=0.0, y=0.0)
    model.fix_temperature("BOTTOM", 0.0)
    model.fix_temperature("TOP_LEFT", 10.0)
    step = fc.solve(model, 1)[-1]
    left, right = mesh.points_of("LEFT"), mesh.points_of("RIGHT")
    ends = [side[np.argsort(mesh.points[side, 1])] for side in (left, right)]
    assert step.temperature[ends[0]] == pytest.approx(step.temperature[ends[1]], rel=1e-12)
    assert step.temperature[ends[0]][-1] == 10.0


def test_result_files_and_restarts_hold_the_heat(tmp_path):
    model = column(lambda p, g: 100.0 + 2e-5 * p, 5e-5)
    steps = fc.solve(model, 4)
    with fc.ResultWriter(tmp_path / "h.vtkhdf", model) as out:
        fc.solve(model, fc.Ramp((0.25, 0.5)), on_step=out.write)
    with fc.open_results(tmp_path / "h.vtkhdf") as half:
        going_on = fc.solve(model, fc.linear_ramp(4), resume=half)
        stored = half[-1]
    assert np.array_equal(going_on[-1].temperature, steps[-1].temperature)
    assert np.array_equal(stored.heat_flux, steps[1].heat_flux)
    assert np.array_equal(stored.heat_reaction, steps[1].heat_reaction)
    assert np.array_equal(stored.contact["c"].heat_flux, steps[1].contact["c"].heat_flux)
    assert stored.heat == steps[1].heat
    assert "heat_flux" in fc.contact_table(stored.contact["c"]).dtype.names
    other = column(lambda p, g: 100.0 + 3e-5 * p, 5e-5)
    with pytest.raises(fc.errors.ModelError, match="the conductance of contact 'c'"):
        fc.solve(other, fc.Ramp((2.0,), ((0.0, 0.0), (2.0, 2.0))), resume=steps)


def bar(**constants):
    model = made_of(fc.generate.block_on_block("quad4"), "plane_strain", fc.LinearElastic(E=1.0, nu=0.3, **constants))
    return supported(model, LOWER_BOTTOM="xy", UPPER_TOP="xy")


def joined(model, **options):
    return with_contact(model, "c", "CONT_UPPER", "CONT_LOWER", **options)


def test_what_cannot_be_is_refused_by_its_name():
    model = bar()
    model.fix_temperature("UPPER_TOP", 1.0)
    refused(fc.errors.ModelError, "material without conductivity: define it", model.check)
    model = joined(bar(conductivity=1.0))
    model.fix_temperature("UPPER_TOP", 1.0)
    refused(fc.errors.ModelError, "nothing determines the temperature of body 'LOWER'", model.check)
    model = joined(bar(conductivity=1.0), conductance=2.0)
    model.fix_temperature("UPPER_TOP", 1.0)
    model.fix_temperature("UPPER_TOP_RIGHT", 1.0 + 1e-15)
    model.check()
    model.fix_temperature("UPPER_TOP_LEFT", 2.0)
    refused(fc.errors.ModelError, "prescribe different temperatures at point", model.check)
    model = joined(bar(conductivity=1.0, expansion=1.0), conductance=2.0)
    model.fix_temperature("UPPER_TOP", 1.0)
    model.add_temperature(3.0)
    refused(fc.errors.ModelError, "both given by add_temperature and computed", model.check)
    model = fc.Model(model.mesh, "plane_strain")
    for group, expansion in (("UPPER", 1.0), ("LOWER", None)):
        model.add_material(fc.LinearElastic(E=1.0, nu=0.3, conductivity=1.0, expansion=expansion), group)
    model.fix_temperature("UPPER_TOP", 1.0)
    message = "some materials have a coefficient of thermal expansion, but that with"
    refused(fc.errors.ModelError, message, joined(model, conductance=2.0).check)
    model = bar(conductivity=1.0)
    for wrong in ("much", [(1.0, 2.0), (0.0, 3.0)], {"force": [(0.0, 1.0)]}, [(0.0, -1.0)]):
        message = "conductance of contact 'c' must be a number, a function"
        refused(fc.errors.ContactError, message, joined, model, conductance=wrong)
    refused(fc.errors.ContactError, "zero or more", joined, model, conductance=-1.0)
    refused(fc.errors.ContactError, "no friction that could generate it", joined, model, friction_heat=0.5)
    obstacle = {"secondary": "UPPER_TOP", "obstacle": fc.obstacles.HalfSpace((0, 9), (0, -1)), "conductance": 1.0}
    refused(fc.errors.ContactError, "needs the temperature of its obstacle", model.add_obstacle, "o", **obstacle)
    refused(fc.errors.ModelError, "the conductivity", fc.LinearElastic, E=1.0, nu=0.3, conductivity=0.0)
    film = joined(bar(conductivity=1.0), conductance=1.0)
    film.add_film("UPPER_TOP", -1.0, 0.0)
    film.check()
    refused(fc.errors.ModelError, "must not be negative", fc.solve, film, 1)


@pytest.mark.parametrize(
    ("told", "upper", "lower", "options"),
    [
        (True, 100.0, 0.0, {}),
        (True, 100.0, 0.0, {"kind": "tied"}),
        (False, 100.0, 0.0, {"conductance": 0.0}),
        (False, 100.0, 100.0, {}),
    ],
)
@pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")
def test_contact_without_conductance_between_different_temperatures_is_told(told, upper, lower, options):
    model = joined(bar(conductivity=1.0), **options)
    model.fix_temperature("UPPER_TOP", upper)
    model.add_film("LOWER_BOTTOM", 1.0, lower)
    step = fc.solve(model, 1)[-1]
    assert told == any(text.startswith("no heat flows across contact 'c'") for text in step.warnings)
    assert step.heat["contacts"].get("c", 0.0) == 0.0


@pytest.mark.filterwarnings(REST)
def test_functions_that_are_no_conductance_and_bodies_that_no_heat_reaches():
    model = joined(bar(conductivity=1.0), conductance=lambda p, g: p - 1.0)
    model.fix_temperature("UPPER_TOP", 1.0)
    refused(fc.errors.ContactError, "must return a nonnegative number", fc.solve, model, 1)
    model = joined(bar(conductivity=1.0), conductance=lambda p, g: p["force"])
    model.fix_temperature("UPPER_TOP", 1.0)
    refused(fc.errors.ContactError, "the conductance of contact 'c' fails: IndexError", fc.solve, model, 1)
    numbers = itertools.cycle((0.1, 10.0))
    model = joined(bar(conductivity=1.0, expansion=1e-3), conductance=lambda p, g: next(numbers))
    model.fix_temperature("UPPER_TOP", 1.0)
    model.fix_temperature("LOWER_BOTTOM", 0.0)
    with pytest.raises(fc.errors.ConvergenceError, match="heat and contact do not converge: after 60 exchanges"):
        fc.solve(model, 1, criteria=fc.Criteria(max_halvings=0))
    model = joined(bar(conductivity=1.0), conductance=5.0, clearance=0.1)
    model.fix_temperature("UPPER_TOP", 1.0)
    refused(fc.errors.ConvergenceError, "no heat reaches body 'LOWER'", fc.solve, model, 1)


LOWER = """[[material]]
groups = ["LOWER"]
E = 1e9
nu = 0.3
conductivity = {along = "y", table = [[-1.0, 20.0], [1.0, 20.0]]}
"""
JOINT = contact_pair(options="conductance = {pressure = [[0.0, 1000.0], [1e9, 1000.0]]}", name="joint")
HEATED = """[[fixed_temperature]]
group = "LOWER_BOTTOM"
value = 0.0
[[film]]
group = "UPPER_TOP"
coefficient = 1e9
ambient = 100.0
[probes]
corner = "UPPER_TOP_LEFT"
[[check]]
quantity = "joint.heat"
value = 625.0
source = "R = 0.1 / 50 + 1 / 1000 + 0.1 / 20"
tolerance = 1e-6
[[check]]
quantity = "corner.temperature"
value = 100.0
source = "the ambient"
tolerance = 1e-4
"""
CASE = "reference_temperature = 20.0\n" + case_of(
    'generator = "block-on-block"\nsize_lower = [0.05, 0.1]\nsize_upper = [0.05, 0.1]', LOWER + JOINT + HEATED,
    material='groups = ["UPPER"]\nE = 1e9\nnu = 0.3\nconductivity = 50',
    LOWER_BOTTOM="xy", UPPER_TOP={"x": 0.0, "y": -1e-5},
)  # fmt: skip


def test_case_files_have_heat(tmp_path, capsys):
    from fastcontact.cli import main

    (tmp_path / "bars.toml").write_text(CASE, encoding="utf-8")
    assert main(["run", str(tmp_path / "bars.toml"), "-o", str(tmp_path / "b.vtkhdf"), "--strict"]) == 0
    assert "heat into the bodies by prescribed temperatures" in capsys.readouterr().out
    with fc.open_results(tmp_path / "b.vtkhdf") as steps:
        assert steps[-1].heat["contacts"]["joint"] == pytest.approx(625.0, rel=1e-6)


@pytest.mark.parametrize("formulation", ["node_to_segment", "mortar", "continuous"])
@pytest.mark.parametrize("kinematics", ["plane_strain", "axisymmetric", "3d"])
def test_heat_crosses_to_a_rigid_obstacle(formulation, kinematics):
    """A bar between 100 and a plate of 20: q = h(p) (T - 20) = k (100 - T) / L, with h = 3 p and p = 10."""
    if kinematics == "3d":
        mesh, bottom, top = fc.generate.box((2.0, 2.0, 4.0), (2, 2, 3)), "ZMIN", "ZMAX"
    else:
        mesh, bottom, top = fc.generate.block((2.0, 4.0), (3, 3)), "BOTTOM", "TOP"
    model = made_of(mesh, kinematics, fc.LinearElastic(E=1000.0, nu=0.0, conductivity=50.0), reference_temperature=20.0)
    model.add_pressure(top, 10.0)
    model.fix(top, "xyz"[: mesh.dim - 1])
    model.fix_temperature(top, 100.0)
    normal = (0.0,) * (mesh.dim - 1) + (1.0,)
    options = {"formulation": formulation, "conductance": lambda pressure, gap: 3.0 * pressure * (gap == 0.0)}
    plate = fc.obstacles.HalfSpace((0.0,) * mesh.dim, normal)
    model.add_obstacle("plate", secondary=bottom, obstacle=plate, obstacle_temperature=20.0, **options)
    (step,) = fc.solve(model, 1)
    flux = 80.0 / (1.0 / 30.0 + 4.0 / 50.0)
    area = {"3d": 4.0, "plane_strain": 2.0, "axisymmetric": np.pi * 4.0}[kinematics]
    assert step.temperature[mesh.points_of(bottom)] == pytest.approx(20.0 + flux / 30.0, rel=1e-9)
    assert step.heat["contacts"]["plate"] == pytest.approx(flux * area, rel=1e-9)
    assert step.heat["films"] == pytest.approx(-flux * area, rel=1e-9)
    assert step.contact["plate"].heat_flux == pytest.approx(np.full(len(mesh.points_of(bottom)), flux), rel=1e-8)
    with pytest.raises(fc.ContactError, match="needs the temperature of its obstacle"):
        model.add_obstacle("other", secondary=bottom, obstacle=plate, **options)


LAWS = {
    "cohesion": {"cohesion": {"strength": 2.0, "energy": 0.02}},
    "adhesion": {"adhesion": {"strength": 2.0, "work": 0.02}},
    "fluid": {},
}


@pytest.mark.filterwarnings("ignore:contact .joint. is blown open")
@pytest.mark.parametrize("formulation", ["mortar", "continuous", "node_to_segment"])
@pytest.mark.parametrize("law", LAWS)
def test_a_layer_conducts_until_it_breaks_and_a_seal_until_a_fluid_opens_it(law, formulation):
    mesh = fc.generate.block_on_block(divisions_lower=(4, 2), divisions_upper=(4, 2))
    model = made_of(mesh, "plane_strain", fc.LinearElastic(E=1000.0, nu=0.0, conductivity=10.0))
    supported(model, LOWER_BOTTOM="xy", UPPER_TOP={"x": 0.0})
    pulled = [(0, 0), (1, 1e-4), (2, 0.1)] if law != "fluid" else [(0, 0), (1, -0.01), (2, -0.01)]
    model.prescribe("UPPER_TOP", y=1.0, ramp=pulled)
    model.fix_temperature("UPPER_TOP", 100.0, ramp=[(0, 1), (2, 1)])
    model.fix_temperature("LOWER_BOTTOM", 0.0)
    options = {**LAWS[law], "formulation": formulation, "conductance": 5.0}
    model.add_contact("joint", secondary="CONT_UPPER", primary="CONT_LOWER", **options)
    if law == "fluid":  # against a pressure of 1
        model.add_fluid_pressure("joint", 2.0, source="UPPER_BOTTOM_LEFT", ramp=[(0, 0), (1, 0.25), (2, 1)])
    closed, opened = fc.solve(model, [1.0, 2.0])
    flux = 100.0 / (5.0 / 10.0 + 1.0 / 5.0 + 5.0 / 10.0)
    assert closed.contact["joint"].heat_flux == pytest.approx(flux, rel=1e-9)
    assert closed.heat["contacts"]["joint"] == pytest.approx(10.0 * flux, rel=1e-9)
    assert not opened.contact["joint"].active.any()
    assert abs(opened.heat["contacts"]["joint"]) < 1e-12
