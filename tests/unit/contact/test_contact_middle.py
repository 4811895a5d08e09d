"""Distances from the middle of a contact, at any position and orientation; their pictures."""

import csv
import dataclasses

import numpy as np
import pytest
from matplotlib_pictures import contact_of, step_of
from models import elastic_model, supported, united

import fastcontact as fc
from fastcontact.analytic.pressure_curve import pressure_curve
from fastcontact.cli import main
from fastcontact.cli._results import pressure_curves
from fastcontact.contact.contact_middle import unrolled_line
from fastcontact.contact.surface import surface
from fastcontact.results.step import half_width

R, E, SIZE = 10.0, 1000.0, 0.2
SIDES = {"up": ("y", 1.0, 0.0), "left": ("x", -1.0, 90.0), "down": ("y", -1.0, 180.0), "right": ("x", 1.0, 270.0)}


def whole(half):
    """Return a half model x >= 0 with its mirror image, as one body."""
    other = fc.generate.renamed(fc.generate.mirrored(half, "x"), {name: f"M_{name}" for name in half.group_names})
    mesh = fc.generate.merge_points(fc.generate.union(half, other), 1e-9)
    for name in half.cell_groups:
        mesh = mesh.merged_groups(f"ALL_{name}", [name, f"M_{name}"])
    return mesh


def placed(x0, angle, half):
    """Return a block, or the right half of it, turned and shifted."""
    mesh = fc.generate.graded_block("quad8", width=8.0, contact_radius=1.2, contact_size=SIZE)
    return fc.generate.transformed(mesh if half else whole(mesh), rotate=angle, translate=(x0, -2 * x0))


def pressed(x0, facing, half):
    """Return contact and step of a block whose top, turned to one side and shifted, a cylinder is pressed upon."""
    axis, sign, angle = SIDES[facing]
    prefix, mesh = "" if half else "ALL_", placed(x0, angle, half)
    centre = np.array([x0, -2 * x0])
    centre["xy".index(axis)] += sign * R
    model = elastic_model(mesh, E=E)
    if half:
        model.fix("SYMMETRY_X", "x" if axis == "y" else "y")
    model.fix(f"{prefix}BOTTOM", "xy" if not half else axis)
    ball = fc.obstacles.Sphere(centre=tuple(centre), R=R)
    model.add_obstacle("c", secondary=f"{prefix}CONTACT", obstacle=ball, motion={axis: -sign * 0.05})
    step = fc.solve(model, 1)[-1]
    return step.contact["c"], step


@pytest.mark.each_value
@pytest.mark.parametrize("half", [True, False], ids=["half", "whole"])
@pytest.mark.parametrize(("x0", "facing"), [(0.0, "up"), (20.0, "up"), (-7.0, "left"), (3.0, "down"), (20.0, "right")])
def test_the_half_width_is_that_of_hertz_wherever_the_contact_lies(x0, facing, half):
    contact, step = pressed(x0, facing, half)
    force = np.linalg.norm(contact.force) * (2 if half else 1)
    hertz = fc.analytic.hertz_line(E1=E, nu1=0.3, R1=R, force=force)
    np.testing.assert_allclose(contact.middle, [x0, -2 * x0], atol=1e-3 * SIZE)
    assert contact.radius[0] - SIZE < hertz.radius < contact.radius[1] + SIZE
    closed = contact.active
    assert np.abs(contact.place[closed]).max() == pytest.approx(hertz.radius, abs=1.5 * SIZE)
    assert (contact.place.min() < -1.0) != half
    # the stress across the surface is the pressure, in any direction
    normal = fc.normal_stress(contact, step)
    inside = np.abs(contact.place) < 0.6 * hertz.radius
    assert -normal[inside].mean() == pytest.approx(contact.pressure[inside].mean(), rel=0.03)
    table = fc.contact_table(contact, step)
    np.testing.assert_array_equal(table["radius"], np.abs(contact.place))
    np.testing.assert_array_equal(table["normal_stress"], normal)
    line = max(fc.plot.pressure_profile(contact, hertz).lines, key=lambda line: len(line.get_xdata()))
    exact = hertz.pressure(np.abs(line.get_xdata()))
    np.testing.assert_allclose(line.get_ydata(), exact)  # theory is drawn where the contact is


@pytest.mark.parametrize("component", ["normal", "x"])
def test_a_face_that_is_driven_is_not_a_plane_of_symmetry(component):
    model = elastic_model(fc.generate.block((4.0, 1.0), (8, 2)), E=E, TOP={"y": -0.01})
    model.prescribe("RIGHT", **{component: 0.1}, ramp=[(0.0, 0.0), (1.0, 0.0), (2.0, 1.0)])
    model.add_obstacle("c", secondary="BOTTOM", obstacle=fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0)))
    for step in fc.solve(model, fc.linear_ramp(2, end=2.0)):
        pressure = step.contact["c"].pressure
        centre = step.contact["c"].force_vectors[:, 1] @ step.contact["c"].coordinates / step.contact["c"].force[1]
        assert pressure.min() > 0.0
        np.testing.assert_allclose(step.contact["c"].middle, centre, atol=1e-9)


def test_an_end_beyond_which_the_other_body_extends_is_not_a_plane_of_symmetry():
    upper, lower = fc.generate.block((2.0, 1.0), (4, 2)), fc.generate.block((6.0, 1.0), (9, 2), origin=(-3.0, -1.0))
    model = elastic_model(united(U_=upper, L_=lower), E=E, L_BOTTOM="xy", U_LEFT="x", U_TOP={"y": -0.01})
    model.add_contact("c", secondary="U_BOTTOM", primary="L_TOP")
    assert 0.8 < fc.solve(model, 1)[-1].contact["c"].middle[0] < 1.2


@pytest.mark.parametrize("swapped", [False, True], ids=["cylinder", "block"])
def test_the_middle_of_two_bodies_is_the_same_from_either_side(swapped):
    mesh = fc.generate.transformed(
        fc.generate.cylinder_on_block("quad4", size=8.0, contact_size=0.5), translate=(20.0, 0)
    )
    model = elastic_model(mesh, E=1e5, AXIS="x", BLOCK_BOTTOM="y", CYLINDER_TOP={"y": -0.5})
    sides = ["CONT_CYLINDER", "CONT_BLOCK"]
    secondary, primary = reversed(sides) if swapped else sides
    model.add_contact("c", secondary=secondary, primary=primary)
    contact = fc.solve(model, 1)[-1].contact["c"]
    both = fc.analytic.hertz_line(E1=1e5, nu1=0.3, R1=50.0, E2=1e5, nu2=0.3, force=2 * np.linalg.norm(contact.force))
    assert contact.middle[0] == pytest.approx(20.0, abs=1e-9)
    assert contact.radius[0] - 0.5 < both.radius < contact.radius[1] + 0.5


def rings():
    """Return contact and step of a press fit: a quarter of two rings."""
    mesh = fc.generate.rings("quad8", divisions_inner=(2, 6), divisions_outer=(2, 6))
    model = elastic_model(mesh, E=210e3, SYMMETRY_X="x", SYMMETRY_Y="y")
    model.add_contact("c", secondary="CONT_INNER", primary="CONT_OUTER", clearance=-0.05)
    step = fc.solve(model, 1)[-1]
    return step.contact["c"], step


def test_a_ring_unrolls_and_its_stress_is_radial():
    contact, step = rings()
    quarter = 0.5 * np.pi * 50.0
    assert np.ptp(contact.place) == pytest.approx(quarter, rel=1e-3)
    assert (np.diff(contact.place) > 0).all() or (np.diff(contact.place) < 0).all()
    np.testing.assert_allclose(-fc.normal_stress(contact, step), contact.pressure, rtol=0.03)


def test_a_closed_line_is_cut_open_opposite_to_the_contact():
    turns = np.linspace(0.0, 2 * np.pi, 24, endpoint=False)
    ring = np.concatenate([r * np.column_stack([np.cos(turns), np.sin(turns)]) for r in (1.0, 2.0)])
    quads = np.array([[i, (i + 1) % 24, 24 + (i + 1) % 24, 24 + i] for i in range(24)])[:, [0, 3, 2, 1]]
    lines = np.array([[24 + i, 24 + (i + 1) % 24] for i in range(24)])
    mesh = fc.Mesh(ring, {"quad4": quads, "line2": lines}, {"OUT": 24 + np.arange(24)}, {})
    side = surface(mesh, "OUT")
    line = unrolled_line(side, mesh.points, np.array([2.0, 0.0]))
    assert line is not None
    assert line.period == line.abscissa[-1]
    np.testing.assert_allclose(line.nodes[0], [-2.0, 0.0], atol=1e-12)
    lengths = line.lengths(mesh.points[side.points])
    assert len(np.unique(np.round(lengths, 9))) == 24
    np.testing.assert_allclose(line.nodes[12], [2.0, 0.0], atol=1e-9)
    assert line.abscissa[12] == pytest.approx(0.5 * line.period)


@pytest.mark.parametrize("degrees", [0.001, 30.0, 90.0])
def test_planes_of_symmetry_may_be_inclined(degrees):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    straight, turned = [], []
    for angle, (x, y), results in ((0.0, (1.0, 0.0), straight), (degrees, (c, s), turned)):
        mesh = fc.generate.transformed(fc.generate.cylinder_on_block("quad4", contact_size=1.0), rotate=angle)
        model = elastic_model(mesh, BLOCK_BOTTOM="xy", CYLINDER_TOP={"x": 0.1 * y, "y": -0.1 * x})
        model.fix("AXIS", "x", axes=(x, y))
        model.add_contact("c", secondary="CONT_CYLINDER", primary="CONT_BLOCK")
        contact = fc.solve(model, 1)[-1].contact["c"]
        results += [*contact.radius, *contact.middle, contact.tangent @ (x, y)]
    assert turned == pytest.approx(straight, abs=1e-6)
    assert straight[2:] == pytest.approx([0.0, 0.0, 1.0])


@pytest.mark.parametrize("quarter", [True, False, "turned"], ids=["quarter", "whole", "turned"])
def test_in_space_distances_are_from_the_centre_of_pressure_or_the_planes_of_symmetry(quarter):
    low, size = (0.0, 1.0) if quarter else (-1.0, 2.0)
    n = 8 if quarter else 16
    at = np.array([20.0, -5.0, 3.0])
    mesh = fc.generate.box((size, size, 1.0), (n, n, 4), "hex8", (at[0] + low, at[1] + low, at[2] - 1.0))
    if quarter == "turned":
        x, y = mesh.points[:, 0] - at[0], mesh.points[:, 1] - at[1]
        points = np.column_stack([at[0] + 0.8 * x - 0.6 * y, at[1] + 0.6 * x + 0.8 * y, mesh.points[:, 2]])
        mesh = mesh.replace(points=points)
    model = elastic_model(mesh, E=E)
    if quarter:
        supported(model, XMIN="normal", YMIN="normal", ZMIN="z")
    else:
        model.fix("ZMIN", "xyz")
    ball = fc.obstacles.Sphere(centre=(at[0], at[1], at[2] + 3.0), R=3.0)
    model.add_obstacle("c", secondary="ZMAX", obstacle=ball, motion={"z": -0.05})
    contact = fc.solve(model, 1)[-1].contact["c"]
    np.testing.assert_allclose(contact.middle, at, atol=1e-6)
    flat = np.hypot(*(contact.coordinates - at)[:, :2].T)
    np.testing.assert_allclose(contact.place, flat, atol=1e-6)
    assert contact.radius[0] == pytest.approx(flat[contact.active].max(), abs=0.13)


def test_in_axisymmetry_places_are_radii_unless_the_surface_runs_along_the_axis():
    shaft = fc.generate.block((1.0, 2.0), (4, 8), "quad4", (1.0, 5.0), name="SHAFT")
    model = elastic_model(shaft, "axisymmetric", E=E, LEFT="x", BOTTOM="y")
    hub = fc.obstacles.HalfSpace(point=(2.0, 0.0), normal=(-1.0, 0.0))
    model.add_obstacle("c", secondary="RIGHT", obstacle=hub, motion={"x": -0.01})
    contact = fc.solve(model, 1)[-1].contact["c"]
    assert np.ptp(contact.place) == pytest.approx(2.0)
    ends = elastic_model(shaft, "axisymmetric", E=E, BOTTOM="y")
    plate = fc.obstacles.HalfSpace(point=(0.0, 7.0), normal=(0.0, -1.0))
    ends.add_obstacle("c", secondary="TOP", obstacle=plate, motion={"y": -0.01})
    contact = fc.solve(ends, 1)[-1].contact["c"]
    np.testing.assert_array_equal(contact.place, contact.coordinates[:, 0])
    assert contact.measured_from_axis


@pytest.mark.parametrize(
    ("place", "closed", "bracket"),
    [
        ([0, 1, 2, 3], [1, 1, 0, 0], (1, 2)),
        ([-2, -1, 0, 1, 2], [0, 1, 1, 1, 0], (1, 2)),
        ([-2, -1, 0, 1, 2], [1, 1, 1, 1, 1], (2, np.inf)),
        ([-2, -1, 0, 1, 2], [1, 1, 1, 0, 0], (1, 1.5)),  # it ends with the surface on one side
        ([0, 1, 2], [0, 0, 0], (np.nan, np.nan)),
    ],
)
def test_the_half_width_lies_between_the_closed_and_the_open_places(place, closed, bracket):
    assert half_width(np.array(place, float), np.array(closed, bool)) == pytest.approx(bracket, nan_ok=True)


@pytest.mark.parametrize("half", [True, False], ids=["half", "whole"])
def test_of_an_arc_the_half_width_is_half_the_chord(half):
    angle = np.radians(np.arange(0.0 if half else -90.0, 91.0, 5.0))
    bracket = half_width(R * angle, np.abs(angle) < np.radians(62.0), R * np.sin(angle))
    assert bracket == pytest.approx((R * np.sin(np.radians(60.0)), R * np.sin(np.radians(65.0))))


@pytest.mark.parametrize(("x0", "facing"), [(0.0, "up"), (-7.0, "left"), (20.0, "right")])
def test_a_file_keeps_the_direction_of_half_widths(x0, facing, tmp_path):
    contact, step = pressed(x0, facing, half=False)
    assert abs(contact.tangent["xy".index(SIDES[facing][0])]) < 1e-3
    np.testing.assert_allclose(np.abs(contact.across), np.abs(contact.place), atol=1e-6)  # the block is flat
    with fc.ResultWriter(tmp_path / "a.vtkhdf", placed(x0, SIDES[facing][2], half=False)) as out:
        out.write(step)
    with fc.open_results(tmp_path / "a.vtkhdf") as results:
        read = results[0].contact["c"]
    np.testing.assert_array_equal(read.tangent, contact.tangent)
    assert read.stick_radius == contact.stick_radius


def test_a_theory_is_named_after_what_was_given():
    contact, _ = pressed(0.0, "up", True)
    line = fc.analytic.hertz_line(E1=E, nu1=0.3, R1=R, force=7.0)
    (legend,) = pressure_curves({"theory": line, "share": 0.5}, contact)
    assert legend == "Hertz, equal force"
    point = fc.analytic.hertz_point(E1=E, nu1=0.3, R1=R, approach=0.2)
    curves = pressure_curves({"theory": point, "share": 1.0}, contact, approach=0.2, load=0.5)
    assert list(curves) == ["Hertz, equal approach", "Hertz, equal force"]
    assert curves["Hertz, equal approach"].approach == pytest.approx(0.1)
    fit = fc.analytic.press_fit_cylinders(
        E_inner=E, nu_inner=0.3, E_outer=E, nu_outer=0.3, interface_radius=1.0, outer_radius=2.0, interference=0.01
    )
    assert list(pressure_curves({"theory": fit, "share": 1.0}, contact)) == ["Lamé"]
    assert pressure_curve(fit).pressure(np.arange(3.0)).tolist() == [fit.pressure] * 3
    assert pressure_curve(fc.analytic.flat_punch(E=E, nu=0.3, radius=1.0, force=1.0)) is None


def test_the_command_writes_places_from_the_middle(tmp_path):
    contact, step = rings()
    mesh = fc.generate.rings("quad8", divisions_inner=(2, 6), divisions_outer=(2, 6))
    path = tmp_path / "r.vtkhdf"
    with fc.ResultWriter(path, mesh, kinematics="plane_strain") as out:
        out.write(step)
    read = fc.open_results(path)[-1].contact["c"]
    np.testing.assert_array_equal(read.place, contact.place)
    np.testing.assert_array_equal(read.middle, contact.middle)
    files = {kind: tmp_path / f"p.{kind}" for kind in ("csv", "agr", "png")}
    assert main(["profile", str(path), *(w for kind, f in files.items() for w in (f"--{kind}", str(f))), "-q"]) == 0
    rows = list(csv.DictReader(files["csv"].open()))
    np.testing.assert_allclose([float(row["place"]) for row in rows], contact.place)
    assert "middle of the contact" in files["agr"].read_text()
    assert files["png"].read_bytes()[:4] == b"\x89PNG"


# Stored with a result: a theory whose larger semi-axis is that along y.
ELLIPTICAL = """[contact]
c = {{ secondary = "A", primary = "B" }}
[theory]
c = {{ kind = "hertz_elliptical", E1 = 1000.0, nu1 = 0.3, R1x = 2.0, R1y = 20.0, force = 1.0, share = {} }}
"""


@pytest.mark.parametrize(
    ("share", "sector", "known"),
    [(1.0, 360.0, True), (0.5, 180.0, True), (0.25, 90.0, True), (0.25, 180.0, False), (1.0, 180.0, False),
     (0.2, 72.0, False)],
)  # fmt: skip
def test_the_theory_at_a_node_is_that_of_its_place_in_the_ellipse(tmp_path, capsys, share, sector, known):
    """The ellipse has any orientation in space, and its middle is not the origin."""
    hertz = fc.analytic.hertz_elliptical(E1=1000.0, nu1=0.3, R1x=2.0, R1y=20.0, force=1.0)
    angle = np.radians(np.arange(0.0, min(sector + 1.0, 359.0), 9.0))
    radius = np.arange(0.1, 1.5, 0.1)[:, None]
    x, y = np.cos(angle) * radius, np.sin(angle) * radius
    x, y = x.ravel() * hertz.radius_y, y.ravel() * hertz.radius_y
    pressure, weight = hertz.pressure(x, y), np.repeat(radius[:, 0], len(angle))
    axes = np.linalg.qr(np.array([[1.0, 2.0, -1.0], [0.3, -1.0, 2.0], [2.0, 0.4, 1.0]]))[0]
    normal = np.tile(axes[2], (len(x), 1))
    forces = (pressure * weight)[:, None] * normal
    forces *= hertz.force * share / np.linalg.norm(forces.sum(axis=0))
    contact = contact_of(
        np.arange(len(x)), [1.0, 2.0, 3.0] + np.column_stack([x, y]) @ axes[:2], pressure=pressure, normal=normal,
        active=pressure > 0.0, force_vectors=forces, force=forces.sum(axis=0), middle=np.array([1.0, 2.0, 3.0]),
        direction=axes[2], place=np.hypot(x, y),
    )  # fmt: skip
    mesh = fc.generate.box((1.0, 1.0, 1.0), (20, 10, 3), "hex8")
    path, table = tmp_path / "e.vtkhdf", tmp_path / "e.csv"
    with fc.ResultWriter(path, mesh, case_text=ELLIPTICAL.format(share)) as out:
        out.write(dataclasses.replace(step_of(mesh), contact={"c": contact}))
    assert main(["profile", str(path), "--csv", str(table)]) == 0
    column = "pressure_theory_equal_force"
    rows = list(csv.DictReader(table.open()))
    assert (column in rows[0]) == known
    assert ("no column 'pressure_theory_equal_force'" in capsys.readouterr().err) != known
    if known:
        np.testing.assert_allclose([float(row[column]) for row in rows], pressure, atol=1e-6 * hertz.pressure_max)


def test_the_theory_of_an_ellipse_is_drawn_along_both_axes():
    contact, step = pressed(0.0, "up", True)
    hertz = fc.analytic.hertz_elliptical(E1=E, nu1=0.3, R1x=R, R1y=3 * R, force=7.0)
    major, minor = fc.plot.pressure_profile(contact, hertz).lines[:2]
    r = np.asarray(major.get_xdata())
    np.testing.assert_allclose(major.get_ydata(), hertz.pressure(0.0, r), atol=1e-12)
    np.testing.assert_allclose(minor.get_ydata(), hertz.pressure(minor.get_xdata()), atol=1e-12)
    for line, radius in ((major, hertz.radius_y), (minor, hertz.radius_x)):
        assert radius in line.get_xdata()  # not drawn straight across the edge
        assert line.get_label().startswith(f"theory, {'major' if line is major else 'minor'} axis:")
    history = fc.plot.history([step], "c", law=hertz, approach=1.0)[1].lines
    ends = {float(line.get_ydata()[-1]) for line in history if len(line.get_xdata()) > 2}
    assert ends == {hertz.at_approach(1.0).radius_x, hertz.at_approach(1.0).radius_y}


def test_the_contact_of_an_o_ring_is_measured_along_its_surface():
    """Two points of its cross-section have the same radius, which places neither."""
    half = fc.generate.renamed(fc.generate.quarter_disc("tri6", R=2.5, size=0.5), {"CONT1": "SKIN", "D1B1": "SKIN"})
    half = fc.generate.transformed(half, translate=(0.0, 2.5))
    whole_half = fc.generate.union(half, fc.generate.mirrored(half, "x"))
    mesh = fc.generate.merge_points(fc.generate.union(whole_half, fc.generate.mirrored(whole_half, "y")), 1e-6)
    mesh = fc.generate.transformed(mesh, translate=(25.0, 0.0))
    model = elastic_model(mesh, "axisymmetric", E=1000.0, A1B1="y")
    lid = fc.obstacles.HalfSpace((0.0, float(mesh.points[:, 1].max())), (0.0, -1.0))
    model.add_obstacle("lid", secondary="SKIN", obstacle=lid, motion={"y": -0.1})
    contact = fc.solve(model, 1)[-1].contact["lid"]
    place, angle = contact.place, np.arctan2(*(contact.coordinates - mesh.points.mean(axis=0)).T)
    assert not contact.measured_from_axis
    assert contact.middle == pytest.approx([25.0, mesh.points[:, 1].max()], abs=0.05)
    np.testing.assert_allclose(np.abs(place), 2.5 * np.abs(angle), atol=0.05)
    assert np.abs(place[contact.active]).max() < contact.radius[1] < 1.0
