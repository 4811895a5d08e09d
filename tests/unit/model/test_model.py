"""A model is checked completely before any computation, with one clear line for each mistake."""

import dataclasses
import inspect
import warnings

import numpy as np
import pytest
from models import elastic_model, made_of, supported
from refusals import refused
from test_result_files import MESH, step_result

import fastcontact as fc
from fastcontact.contact.formulations import FORMULATIONS
from fastcontact.mesh.generate import block, box, merge_points, renamed, union
from fastcontact.model.pair_options import SHARED_OPTIONS, ContactOptions


def test_dir_shows_what_a_user_calls():
    """No more than the page of reference needs: what serves the analysis is not offered."""
    model = fc.Model(fc.generate.block(), "plane_strain")
    shown = [name for name in dir(model) if not name.startswith("__")]
    assert all(hasattr(model, name) for name in shown)
    assert {*dir(fc.Model)} <= {*dir(model)}
    assert {"add_contact", "add_material", "fix", "prescribe", "check", "describe", "mesh", "contact"} <= {*shown}
    assert not {"bind", "forces_by_ramp", "material_field", "constraint_rows", "conducts"} & {*shown}


@pytest.mark.parametrize("add", [fc.Model.add_contact, fc.Model.add_contacts, fc.Model.add_obstacle])
def test_options_of_contact_are_named_arguments(add):
    """For `help` and editors: those of all formulations and no others, None by default."""
    given = {"secondary", "primary", "points", "axisymmetric", "modulus", "options", "held_motions"}
    kinds = [
        kind.variant(dim, {"multipliers": m})
        for kind in FORMULATIONS.values()
        for dim in (2, 3)
        for m in ("standard", "dual")
    ]
    own = {field.name for kind in kinds for field in dataclasses.fields(kind) if field.init} - given
    shown = inspect.signature(add).parameters
    assert own | {*SHARED_OPTIONS} == {*ContactOptions.__annotations__}
    assert all(shown[name].default is None for name in ContactOptions.__annotations__)
    assert not any(parameter.kind is parameter.VAR_KEYWORD for parameter in shown.values())


def bolt(**options):
    """Return a bar of length 10 that is held at both ends and cut across in its middle."""
    bar = fc.generate.box((1.0, 1.0, 10.0), (1, 1, 4), "hex8")
    bar = bar.with_facet_group("CUT", lambda x: abs(x[:, 2] - 5.0) < 1e-9, between=True)
    model = elastic_model(fc.generate.cut(bar, "CUT"), "3d", E=210e3, nu=0.0, ZMIN="xyz", ZMAX="xyz")
    model.add_pretension("bolt", "CUT", force=1000.0, **options)
    return model


def plate(kinematics="plane_stress"):
    return made_of(fc.generate.block((1.0, 1.0), (2, 2)), kinematics, fc.LinearElastic(E=1e3, nu=0.3, expansion=1e-5))


@pytest.mark.parametrize("normal", [None, (0.0, 0.0, 2.0), (0.0, 0.0, -1.0), (0.0, 0.3, -1.0)])
def test_tension_is_tension_whichever_way_the_normal_points(normal):
    step = fc.solve(bolt(normal=normal), 1)[-1]
    assert step.pretension["bolt"]["force"] == pytest.approx(1000.0, rel=1e-9)
    assert step.stress[:, 2].mean() > 900.0


def test_a_section_cut_towards_the_other_side_is_in_tension_too():
    bar = fc.generate.box((1.0, 1.0, 2.0), (1, 1, 2), "hex8")
    bar = bar.with_facet_group("CUT", lambda x: abs(x[:, 2] - 1.0) < 1e-9, between=True)
    model = elastic_model(fc.generate.cut(bar, "CUT", normal=(0.0, 0.0, -1.0)), "3d", E=1.0, nu=0.0, ZMIN="xyz")
    model.fix("ZMAX", "xyz")
    model.add_pretension("bolt", "CUT", force=0.1)
    assert fc.solve(model, 1)[-1].stress[:, 2] == pytest.approx(0.1)


def test_a_force_on_solid_cells_is_refused():
    refused(fc.ModelError, "'BLOCK' is a group of solid cells", plate().add_force, "BLOCK", y=-1.0)
    model = plate()
    model.add_force("BLOCK", y=-1.0, distribute=False)
    assert model.load_vector(model.loads[0])[:, 1] == pytest.approx(-1.0)


@pytest.mark.parametrize("state", ["strain", "stress", "temperature"])
def test_large_strains_without_stress_are_told(state):
    model = plate()
    supported(model, LEFT="x", BOTTOM="y")
    if state == "strain":
        model.add_initial_strain(xx=-0.5)
    elif state == "stress":
        model.add_initial_stress(xx=500.0)
    else:
        model.add_temperature(5e4)
    with pytest.warns(fc.FastcontactWarning, match=r"temperatures and initial states cause strains of 0.5, beyond"):
        fc.solve(model, 1)


def test_small_ones_are_not():
    model = plate()
    supported(model, LEFT="x", BOTTOM="y")
    model.add_temperature(100.0)
    assert fc.solve(model, 1)[-1].warnings == ()


def test_numbers_of_other_kinds_are_numbers():
    for number in (np.float32(1000.0), np.array(1000.0), np.int64(1000)):
        assert fc.LinearElastic(E=number, nu=0.3).E == 1000.0
    refused(fc.ModelError, "E = True must be a positive number", fc.LinearElastic, E=True, nu=0.3)
    refused(fc.ModelError, "must be a sequence of sequences of numbers", fc.Tabulated, "x", [(0.0, "1.0")])


@pytest.mark.parametrize("name", ["hex8", "quad4", "tet10"])
def test_a_cell_with_a_node_twice_is_refused(name):
    mesh = fc.generate.block(element=name) if name == "quad4" else fc.generate.box(element=name)
    nodes = mesh.cells[name].copy()
    nodes[1, 2] = nodes[1, 1]
    with pytest.raises(fc.MeshError, match=rf"cell \d+ \({name} at .*has point {nodes[1, 1]} twice"):
        fc.Model(mesh.replace(cells={**mesh.cells, name: nodes}), "3d" if mesh.dim == 3 else "plane_strain")


SIZES = [1e61, 1e160, 1e308, 10**400, -1e300]


def half_spheres(y=-0.1, E=20_000.0):
    model = elastic_model(fc.generate.half_spheres("tri3", size=12.0), "axisymmetric", E=E, A1A2="x", A1B1="y")
    return supported(model, A2B2={"y": y})


def pair(**options):
    half_spheres().add_contact("pair", secondary="CONT1", primary="CONT2", **options)


def everywhere(value):
    return lambda x: np.full(len(x), float(value))


WAYS = {
    "displacement": lambda v: half_spheres(y=v),
    "displacement as a function": lambda v: fc.solve(half_spheres(y=everywhere(v)), 1),
    "pressure": lambda v: half_spheres().add_pressure("D1B1", v),
    "force": lambda v: half_spheres().add_force("A2B2", y=v),
    "clearance": lambda v: pair(clearance=v),
    "penalty": lambda v: pair(penalty=v),
    "ramp": lambda v: fc.solve(half_spheres(), [[0.0, 0.0], [1.0, v]]),
    "load factors": lambda v: fc.solve(half_spheres(), [abs(v)]),
}


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("way", WAYS)
def test_a_number_out_of_range_is_refused_by_its_name(way, size):
    if size == 10**400 and way == "displacement as a function":
        pytest.skip("no function of arrays returns it")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(fc.FastcontactError, match=r"out of range|must be|must hold") as caught:
            WAYS[way](size)
    assert len(str(caught.value)) < 400
    assert "not finite" not in str(caught.value)


@pytest.mark.parametrize(("y", "E"), [(-1e-60, 1.0), (-1e50, 1e-40), (-0.1, 1e50), (-1e55, 1e55)])
@pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")
def test_within_the_range_results_are_those_of_other_units(y, E):
    found, expected = (fc.solve(half_spheres(*given), 1)[-1] for given in ((y, E), (-1.0, 1.0)))
    np.testing.assert_allclose(found.displacement / -y, expected.displacement, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.stress / (-y * E), expected.stress, rtol=1e-9, atol=1e-12)


WALL = fc.obstacles.HalfSpace(point=(0.0, 1.0), normal=(0.0, -1.0))


def cube():
    """A cube with a reference point, and a group of points by their numbers."""
    mesh = box((1.0, 1.0, 1.0), (1, 1, 1), "hex8")
    corners = np.flatnonzero((mesh.points[:, 0] == 0.0) & (mesh.points[:, 1] == 0.0))
    mesh = mesh.with_groups(points={"line": corners, "none": []})
    return elastic_model(fc.generate.with_reference_points(mesh, {"HANDLE": (0.5, 0.5, 3.0)}), "3d", E=1.0)


def ring():
    """An axisymmetric block."""
    return made_of(block((1.0, 1.0), (2, 2), "quad4"), "axisymmetric", fc.LinearElastic(E=1.0, nu=0.3, density=1.0))


def thin_plate():
    return fc.Model(block(), "plane_strain")


def turned_by_a_line():
    model = cube()
    model.add_moment("line", z=1.0)
    model.check(fc.linear_ramp(1))


def at(place):
    return lambda: fc.generate.with_reference_points(block(), {"HANDLE": place})


def spread(group, radius):
    return lambda: cube().add_force(group, z=-1.0, at=(0.5, 0.5, 1.0), radius=radius)


def turned_about(centre):
    rotation = {"centre": centre, "angle": 0.1}
    return lambda: thin_plate().add_obstacle("wall", secondary="TOP", obstacle=WALL, rotation=rotation)


def isotropic_across(nu):
    given = {"E_along": 1.0, "E_across": 1.0, "nu_along": 0.3, "G_along": 1.0, "axes": np.eye(3)}
    return lambda: fc.Orthotropic.transversely_isotropic(**given, nu_across=nu)


ALONG_Z = fc.LinearElastic(E=fc.Tabulated("z", [(0.0, 1.0), (1.0, 2.0)]), nu=0.3)
NO_PLACE, NO_CENTRE = (
    "the place .* of reference point 'HANDLE' must be 2 numbers",
    "centre .* must be 2 finite numbers, not",
)
NO_RAMP, NO_TURN = "the ramp must be a number of steps, load factors", ".* mean rotation is undetermined"


def touching_corners():
    """Two squares that share a corner, with an obstacle for all of their sides."""
    squares = [block((1.0, 1.0), (1, 1), origin=(at, at)) for at in (0.0, 1.0)]
    sides = dict.fromkeys(("LEFT", "RIGHT", "BOTTOM", "TOP"), "SIDES")
    mesh = merge_points(union(*(renamed(square, sides) for square in squares)), 1e-6)
    elastic_model(mesh).add_obstacle("wall", secondary="SIDES", obstacle=WALL)


REFUSED = [
    (lambda: pair(formulation="continuous", integration="gaus"), fc.ContactError, "did you mean 'gauss'"),
    (
        lambda: fc.solve(bolt(normal=(1.0, 0.0, 0.0)), 1),
        fc.ModelError,
        "'bolt' deviates by 90 degrees from that of 'CUT'",
    ),
    (lambda: fc.solve(bolt(locked_from=0.0), 1), fc.ModelError, "its force never acts"),
    (lambda: fc.solve(bolt(locked_from=-1.0), 1), fc.ModelError, "its force never acts"),
    (lambda: bolt().add_pretension("other", "CUT", shortening=0.1), fc.ModelError, "act on the same section"),
    (lambda: plate().add_spring(1.5, y=1.0), fc.ModelError, "point 1.5 is not in the mesh"),
    (lambda: plate().add_spring(12.7, y=1.0), fc.ModelError, "point 12.7 is not in the mesh"),
    (
        lambda: plate("plane_strain").add_cyclic_symmetry("LEFT", "BOTTOM", sectors=2.5),
        fc.ModelError,
        r"at least two sectors \(a whole number\)",
    ),
    (lambda: fc.linear_ramp(10**400), fc.ModelError, "the argument steps of linear_ramp must be a whole number"),
    (lambda: fc.linear_ramp(2, 10**400), fc.ModelError, "must be a number"),
    (touching_corners, fc.ContactError, "meet back to back at point 3"),
    (isotropic_across(-1.0), fc.ModelError, "nu_across = -1.0 must be above -1"),
    *((at(place), fc.MeshError, NO_PLACE) for place in [(0.5,), (0.5, 0.5, 0.5), (np.nan, 0.0)]),
    (lambda: fc.generate.with_reference_points(block(), {"TOP": (0.5, 3.0)}), fc.MeshError, "already a group 'TOP'"),
    (lambda: fc.solve(cube(), np.zeros((3, 3))), fc.ModelError, NO_RAMP),
    (lambda: fc.solve(cube(), np.zeros((1, 1))), fc.ModelError, NO_RAMP),
    (lambda: block((1.0,), (2, 2)), fc.MeshError, "argument size of block must be two numbers, not the tuple"),
    (lambda: block((1.0, 1.0), "ab"), fc.MeshError, "divisions of block must be two"),
    (lambda: cube().add_coupling("HANDLE", "line", kind="distributing"), fc.ModelError, f"with 'line': {NO_TURN}"),
    (turned_by_a_line, fc.ModelError, f"the moment on 'line': {NO_TURN}"),
    (lambda: cube().add_moment("none", z=1.0), fc.ModelError, "'none' is empty: the moment"),
    (lambda: ring().add_gravity(x=9.81), fc.ModelError, "radial component x: in axisymmetry it can act only along the"),
    (lambda: ring().add_centrifugal(3.0, direction=(0.0, 0.0, 1.0)), fc.ModelError, r"its direction is \(0, 1, 0\)"),
    *((spread("ZMAX", r), fc.ModelError, f"of the force on 'ZMAX' = {r:g} must be positive") for r in (0.0, -1.0)),
    (spread("none", 0.1), fc.ModelError, "'none' is empty: the force"),
    *((turned_about(c), fc.ModelError, NO_CENTRE) for c in [(0.0, 0.0, 0.0), (np.inf, 0.0), ("left", 0.0)]),
    (lambda: thin_plate().add_material(ALONG_Z), fc.ModelError, "a table is along z, but the mesh is plane: use x, y"),
]


@pytest.mark.parametrize(("make", "kind", "message"), REFUSED, ids=[message for _, _, message in REFUSED])
def test_it_is_refused(make, kind, message):
    refused(kind, message, make)


def test_forces_on_the_primary_side_have_a_row_for_each_point(tmp_path):
    step = step_result(2)
    name, contact = next(iter(step.contact.items()))
    wrong = dataclasses.replace(
        contact, primary_points=np.array([1, 2], np.int32), primary_force_vectors=np.zeros((3, 2))
    )
    with (
        fc.ResultWriter(tmp_path / "run.vtkhdf", MESH) as out,
        pytest.raises(fc.FileError, match=r"primary_force_vectors has shape \(3, 2\), but \(2, 2\) is needed"),
    ):
        out.write(dataclasses.replace(step, contact={**step.contact, name: wrong}))
