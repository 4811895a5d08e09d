"""Pictures of fields, sections and contact surfaces: their numbers and positions."""

import base64
import dataclasses
import io
import os
import re
import shutil
import subprocess

import numpy as np
import pytest
from commands import output_of
from matplotlib_pictures import contact_of, polygons_of, step_of
from models import elastic_model, pressed_spheres
from pairwise import first_of
from refusals import refused

import fastcontact as fc
from fastcontact.cli import main
from fastcontact.errors import FastcontactError
from fastcontact.mesh import elements
from fastcontact.mesh.generate import block, box, union
from fastcontact.results.plot._shape import _cut_tetrahedra
from fastcontact.results.plot.fields import field_names, field_of
from fastcontact.results.plot.patches import fill, outlines
from fastcontact.results.plot.solid import Screen

pytestmark = pytest.mark.each_value

pytest.importorskip("matplotlib", reason="pictures need matplotlib")
SOLIDS = sorted(name for name, kind in elements.ELEMENTS.items() if kind.dim == 3)
PLANE = sorted(name for name, kind in elements.ELEMENTS.items() if kind.dim == 2)


def label(ax):
    return ax.get_legend().get_texts()[0].get_text()


def test_every_field_is_what_its_name_says():
    mesh, random = box((1.0, 1.0, 1.0), (2, 2, 2), "hex8"), np.random.default_rng(3)
    n = mesh.n_points
    stress, u = random.normal(size=(n, 6)), random.normal(size=(n, 3))
    step = step_of(mesh, stress=stress, displacement=u)
    for name in ("contact_pressure", "contact_slip", "contact_slip_total"):
        assert not field_of(mesh, step, name).values.any(), "without contact"
    tensor = stress[:, [0, 3, 5, 3, 1, 4, 5, 4, 2]].reshape(n, 3, 3)
    principal = np.linalg.eigvalsh(tensor)
    expected = {
        **{f"stress.{c}": stress[:, i] for i, c in enumerate(("xx", "yy", "zz", "xy", "yz", "xz"))},
        "stress.principal_max": principal[:, 2],
        "stress.principal_mid": principal[:, 1],
        "stress.principal_min": principal[:, 0],
        "tresca": principal[:, 2] - principal[:, 0],
        "displacement": np.sqrt((u**2).sum(axis=1)),
        **{f"displacement.{axis}": u[:, i] for i, axis in enumerate("xyz")},
    }
    for name, values in expected.items():
        np.testing.assert_allclose(field_of(mesh, step, name).values, values, atol=1e-12)
    np.testing.assert_allclose(step.tresca, expected["tresca"], atol=1e-12)
    np.testing.assert_allclose(step.principal_stress, principal, atol=1e-12)
    assert {*expected, "von_mises", "von_mises_signed"} == set(field_names(mesh))
    deviator = tensor - np.trace(tensor, axis1=1, axis2=2)[:, None, None] / 3 * np.eye(3)
    equivalent = np.sqrt(1.5 * (deviator**2).sum(axis=(1, 2)))
    signs = np.where(np.trace(tensor, axis1=1, axis2=2) < 0, -1, 1)
    np.testing.assert_allclose(field_of(mesh, step, "von_mises_signed").values, signs * equivalent)


def test_a_field_of_the_plane_has_no_components_of_space():
    mesh = block((1.0, 1.0), (2, 2), "quad4")
    assert "stress.xy" in field_names(mesh)
    for name in ("stress.yz", "displacement.z", "stres.xx"):
        refused(FastcontactError, "unknown field", fc.plot.deformed_shape, mesh, step_of(mesh), field=name)


@pytest.mark.parametrize("magnitude", [1e-9, 1.0, 1e9])
def test_the_legend_says_where_the_mark_stands_and_in_which_unit(magnitude):
    mesh = block((4.0, 3.0), (4, 3), "quad4")
    values = magnitude * mesh.points.sum(axis=1)
    step = step_of(mesh, values=values, displacement=np.tile([0.05, 0.0], (mesh.n_points, 1)))
    ax = fc.plot.deformed_shape(mesh, step, scale=20.0, units=fc.plot.UNITS)
    (mark,) = ax.lines
    assert (mark.get_xdata()[0], mark.get_ydata()[0]) == (5.0, 3.0)
    assert label(ax) == f"maximum {7 * magnitude:.5g} MPa at (5, 3)\nundeformed at (4, 3)"
    assert [ax.get_xlabel(), ax.get_ylabel()] == ["x [mm]", "y [mm]"]
    plain = fc.plot.deformed_shape(mesh, step_of(mesh, values=values))
    assert label(plain) == f"maximum {7 * magnitude:.5g} at (4, 3)"
    assert plain.get_xlabel() == "x"


def test_colours_of_both_signs_are_as_far_on_both_sides_of_zero():
    mesh = block((1.0, 1.0), (4, 4), "quad4")
    stress = np.zeros((mesh.n_points, 4))
    stress[:, 0] = np.linspace(-3.0, 2.0, mesh.n_points)
    ax = fc.plot.deformed_shape(mesh, step_of(mesh, stress=stress), field="stress.xx")
    assert ax.collections[0].get_clim() == (-3.0, 3.0)
    assert label(ax).startswith("minimum -3 at")
    stress[:, 0] -= 3.0
    ax = fc.plot.deformed_shape(mesh, step_of(mesh, stress=stress), field="stress.xx")
    assert ax.collections[0].get_clim() == (-6.0, -1.0)


def test_zoom_shows_the_surroundings_of_the_mark_and_nothing_beyond_the_body():
    mesh = block((10.0, 10.0), (10, 10), "quad8")
    ax = fc.plot.deformed_shape(mesh, step_of(mesh, values=mesh.points[:, 0] - abs(mesh.points[:, 1] - 5.0)), zoom=2.0)
    assert ax.get_xlim() == pytest.approx((8.0, 10.1))
    assert ax.get_ylim() == pytest.approx((3.0, 7.0))
    for wrong in (0.0, -1.0):
        refused(FastcontactError, "zoom", fc.plot.deformed_shape, mesh, step_of(mesh), zoom=wrong)
    solid = box((1.0, 1.0, 1.0), (1, 1, 1), "hex8")
    refused(FastcontactError, "draw a section", fc.plot.deformed_shape, solid, step_of(solid), zoom=1.0)


@pytest.mark.parametrize("element", PLANE)
def test_cells_are_filled_as_far_as_their_outlines_and_by_their_shape_functions(element):
    """On an arc: the area that is filled, that within the outlines, and a quadratic field of the reference cell."""
    from matplotlib.figure import Figure

    kind = elements.get(element)
    corner = kind.nodes - kind.nodes.min(axis=0)
    corner = corner / corner.max()
    angle, radius = 0.6 * corner[:, 0], 1.0 + corner[:, 1]
    place = np.column_stack([radius * np.sin(angle), radius * np.cos(angle)])
    cells = {element: np.arange(len(place))[None]}
    drawn = fill(Figure().add_subplot(), cells, place, place[:, 0], "viridis", (0.0, 1.0))
    (polygon,) = outlines(element, place[None])
    a, b = polygon, np.roll(polygon, -1, axis=0)
    within = 0.5 * abs((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())
    assert areas(drawn).sum() == pytest.approx(within, rel=1e-12)
    np.testing.assert_allclose(drawn.get_array(), drawn._triangulation.x, atol=1e-12)  # the field is x itself


def in_front(triangles, eye, places, nearest):
    """Whether a triangle is met on the way from places to the eye, farther than `nearest`; triangle by triangle."""
    found = np.zeros(len(places), bool)
    for a, b, c in triangles:
        system = np.column_stack([b - a, c - a, -eye])
        if abs(np.linalg.det(system)) > 1e-12:
            s, t, far = np.linalg.solve(system, (places - a).T)
            found |= (s > 0) & (t > 0) & (s + t < 1) & (far > nearest)
    return found


@pytest.mark.parametrize("seed", range(4))
def test_what_is_hidden_is_found_as_by_hand(seed):
    random = np.random.default_rng(seed)
    triangles, places = random.uniform(size=(40, 3, 3)), random.uniform(-0.2, 1.2, size=(60, 3))
    eye = random.normal(size=3)
    eye /= np.linalg.norm(eye)
    screen = Screen(triangles, eye)
    found, expected = screen.hidden(places), in_front(triangles, eye, places, screen.tolerance)
    assert 5 < expected.sum() < 55
    np.testing.assert_array_equal(found, expected)


def test_lines_behind_a_body_are_not_drawn(monkeypatch):
    """A fine block stands on a coarse one: no stroke nor piece of the coarse one is drawn where the fine one hides it."""
    given = polygons_of(monkeypatch)
    mesh = union(box((4.0, 4.0, 1.0), (1, 1, 1), "hex8"), box((1.0, 1.0, 1.0), (5, 5, 5), "hex8", (1.5, 1.5, 1.0)))
    fc.plot.deformed_shape(mesh, step_of(mesh, values=mesh.points[:, 2]), view=(60.0, -60.0))
    pieces = [p for p in given if len(p) == 3]
    middles = np.array([p.mean(axis=0) for p in pieces])
    top = middles[np.isclose(middles[:, 2], 1.0)]
    under = (np.abs(top[:, :2] - 2.0) < 0.45).all(axis=1)
    assert len(top) > 20
    assert not under.any()  # the coarse block below the fine one
    shadow = in_front(
        [t for t in np.array(pieces) if t[:, 2].min() > 0.999 and t[:, 2].max() > 1.001],
        np.array([np.cos(np.pi / 3) * 0.5, -np.cos(np.pi / 3) * np.sqrt(0.75), np.sin(np.pi / 3)]), top, 1e-3,
    )  # fmt: skip
    assert shadow.mean() < 0.03


def test_the_mark_says_that_it_is_hidden():
    mesh = box((1.0, 1.0, 1.0), (2, 2, 2), "hex8")
    ax = fc.plot.deformed_shape(mesh, step_of(mesh, values=(np.abs(mesh.points - 0.5).sum(axis=1) == 0.0) * 1.0))
    assert label(ax) == "maximum 1 at (0.5, 0.5, 0.5), hidden"


def test_a_solid_is_seen_from_where_its_extreme_is():
    mesh = box((1.0, 1.0, 1.0), (2, 2, 2), "hex8")
    behind = (np.abs(mesh.points - [0.0, 1.0, 0.0]).sum(axis=1) == 0.0) * 1.0
    ax = fc.plot.deformed_shape(mesh, step_of(mesh, values=behind))
    assert (ax.elev, ax.azim) == (25.0, 30.0)
    assert "hidden" not in label(ax)


def test_tetrahedra_are_cut_where_the_level_is():
    data = np.random.default_rng(1).normal(size=(200, 4, 3))
    normal = np.array([0.3, -0.5, 0.8])
    height = data @ normal - 0.2
    triangles, strokes = _cut_tetrahedra(data, height)
    np.testing.assert_allclose(triangles @ normal, 0.2, atol=1e-12)
    np.testing.assert_allclose(strokes @ normal, 0.2, atol=1e-12)
    above = (height >= 0).sum(axis=1)
    assert len(triangles) == (above == 1).sum() + 2 * (above == 2).sum() + (above == 3).sum()
    first = (height[:, :3] >= 0).sum(axis=1)
    assert len(strokes) == ((first == 1) | (first == 2)).sum()


def areas(drawn):
    """Return the areas of the triangles that are filled."""
    mesh = drawn._triangulation
    x, y = mesh.x[mesh.triangles], mesh.y[mesh.triangles]
    return 0.5 * np.abs((x[:, 1] - x[:, 0]) * (y[:, 2] - y[:, 0]) - (x[:, 2] - x[:, 0]) * (y[:, 1] - y[:, 0]))


@pytest.mark.parametrize("element", SOLIDS)
@pytest.mark.parametrize(
    ("point", "normal", "area"),
    [
        ((0.0, 0.0, 0.7), (0.0, 0.0, 1.0), 2.0),
        ((0.0, 0.0, 0.0), (0.0, 0.0, 5.0), 2.0),  # along the surface below
        ((0.0, 0.0, 3.0), (0.0, 0.0, -1.0), 2.0),  # and above
        ((0.5, 0.5, 0.0), (1.0, 0.0, 0.0), 6.0),  # through nodes
        ((0.5, 1.0, 1.5), (1.0, 1.0, 0.0), 3.0 * 2**0.5),
    ],
)
def test_a_section_has_the_area_and_the_field_of_the_body(element, point, normal, area):
    mesh = box((1.0, 2.0, 3.0), (2, 2, 2), element)
    stress = np.zeros((mesh.n_points, 6))
    stress[:, 0] = mesh.points @ [2.0, 3.0, 5.0]
    ax = fc.plot.section(mesh, step_of(mesh, stress=stress), point, normal, field="stress.xx")
    assert areas(ax.collections[0]).sum() == pytest.approx(area, rel=1e-5)
    bare = fc.plot.section(mesh, step_of(mesh, stress=stress), point, normal, edges=False)
    assert len(ax.collections) == len(bare.collections) + 1
    values = ax.collections[0].get_array()
    if normal[2]:
        drawn = ax.collections[0]._triangulation
        np.testing.assert_allclose(values, 2.0 * drawn.x + 3.0 * drawn.y + 5.0 * point[2], atol=1e-4)
        assert [ax.get_xlabel(), ax.get_ylabel()] == ["x", "y"]
    assert label(ax).startswith(f"maximum on the section {values.max():.5g}")


def test_a_section_is_refused_where_there_is_none():
    mesh = box((1.0, 1.0, 1.0), (1, 1, 1), "hex8")
    with pytest.raises(
        FastcontactError, match=r"not intersect the mesh, which lies between \(0, 0, 0\) and \(1, 1, 1\)"
    ):
        fc.plot.section(mesh, step_of(mesh), (0, 0, 2), (0, 0, 1))
    for point, normal in (((0, 0), (0, 0, 1)), ((0, 0, 0), (0, 0, 0)), ((0, 0, float("nan")), (0, 0, 1))):
        with pytest.raises(FastcontactError, match="a point and a normal of 3 numbers"):
            fc.plot.section(mesh, step_of(mesh), point, normal)
    flat = block((1.0, 1.0), (1, 1), "quad4")
    refused(FastcontactError, "three-dimensional", fc.plot.section, flat, step_of(flat), (0, 0, 0), (0, 0, 1))


def pressed(element="hex8", friction=0.0, turned=False, steps=1):
    mesh = box((2.0, 2.0, 1.0), (8, 8, 3), element, (-1.0, -1.0, -1.0))
    up, along = ("y", "z") if turned else ("z", "y")
    if turned:
        mesh = mesh.replace(points=mesh.points[:, [0, 2, 1]] * [1.0, 1.0, -1.0])
    model = elastic_model(mesh, "3d", ZMIN="xyz")
    ball = fc.obstacles.Sphere((0.0, 5.0, 0.0) if turned else (0.0, 0.0, 5.0), 5.0)
    motion = {up: -0.04, **({along: 0.02} if friction else {})}
    model.add_obstacle("ball", secondary="ZMAX", obstacle=ball, motion=motion, friction=friction)
    return mesh, fc.solve(model, steps)


@pytest.mark.filterwarnings("ignore::fastcontact.errors.FastcontactWarning")
@pytest.mark.parametrize(("element", "turned"), first_of(1, [("hex20", False), ("tet10", True)]))
def test_a_contact_map_shows_the_pressure_at_the_nodes(element, turned):
    mesh, steps = pressed(element, turned=turned)
    contact = steps[-1].contact["ball"]
    axes = fc.plot.contact_map(mesh, contact, units=fc.plot.UNITS)
    assert len(axes) == 1
    (ax,) = axes
    assert [ax.get_xlabel(), ax.get_ylabel()] == (["x [mm]", "z [mm]"] if turned else ["x [mm]", "y [mm]"])
    drawn = ax.collections[0]
    across = contact.coordinates[:, [0, 2] if turned else [0, 1]]
    places = np.column_stack([drawn._triangulation.x, drawn._triangulation.y])
    for place, pressure in zip(across, contact.pressure, strict=True):
        near = np.abs(places - place).max(axis=1) < 1e-9
        assert near.any()
        np.testing.assert_allclose(drawn.get_array()[near], pressure, atol=1e-9)
    assert areas(ax.collections[0]).sum() == pytest.approx(4.0)
    assert f"{contact.pressure_max:.4g} MPa" in ax.get_title()
    (closed,) = (line for line in ax.lines if line.get_label() == "closed")
    assert len(closed.get_xdata()) == contact.active.sum()
    reach = np.abs(contact.coordinates[contact.active][:, 0]).max()
    assert reach < ax.get_xlim()[1] < 1.0
    ends = across[contact.pressure == 0.0, 0]  # pressure falls to zero within the picture
    assert ends[ends > reach + 1e-9].min() < ax.get_xlim()[1]
    assert axes._repr_png_().startswith(b"\x89PNG")


@pytest.mark.filterwarnings("ignore::fastcontact.errors.FastcontactWarning")
def test_a_contact_map_with_friction_has_shear_beside_the_pressure():
    mesh, steps = pressed(friction=0.2, steps=2)
    contact = steps[-1].contact["ball"]
    pressure, shear = fc.plot.contact_map(mesh, contact)
    size = np.linalg.norm(contact.shear, axis=1)
    assert shear.collections[0].get_array().max() == pytest.approx(size.max())
    assert pressure.collections[0].get_array().max() == pytest.approx(contact.pressure_max)
    counts = {line.get_label(): len(line.get_xdata()) for line in shear.lines}
    sliding = int((contact.active & ~contact.sticking).sum())
    expected = {"sticking": int(contact.active.sum()) - sliding, "sliding": sliding}
    assert counts == {name: count for name, count in expected.items() if count}
    assert sliding > 0
    (arrows,) = (c for c in shear.collections if hasattr(c, "U"))
    np.testing.assert_allclose(np.column_stack([arrows.U, arrows.V]), contact.shear[size > 0.1 * size.max()][:, :2])
    for name in ("slip", "slip_total"):
        drawn = fc.plot.contact_map(mesh, contact, beside=name)[1].collections[0].get_array()
        size = np.linalg.norm(getattr(contact, name), axis=1)
        assert drawn.max() == pytest.approx(size.max())
        assert field_of(mesh, steps[-1], f"contact_{name}").values[contact.points] == pytest.approx(size)
    with pytest.raises(FastcontactError, match="unknown field beside the pressure 'gap': expected one of shear, slip"):
        fc.plot.contact_map(mesh, contact, beside="gap")
    from matplotlib.figure import Figure

    own = Figure().subplots(1, 2)
    assert fc.plot.contact_map(mesh, contact, axes=own)[1] is own[1]
    refused(FastcontactError, "two axes", fc.plot.contact_map, mesh, contact, axes=own[:1])


@pytest.mark.filterwarnings("ignore::fastcontact.errors.FastcontactWarning")
def test_a_contact_map_is_refused_where_there_is_none():
    _, steps = pressed()
    contact = steps[-1].contact["ball"]
    refused(FastcontactError, "pressure profile", fc.plot.contact_map, block((1.0, 1.0), (1, 1), "quad4"), contact)
    with pytest.raises(FastcontactError, match="not on the surface of this mesh"):
        fc.plot.contact_map(box((1.0, 1.0, 1.0), (1, 1, 1), "hex8"), contact)


def frames(path):
    from PIL import Image

    with Image.open(path) as found:
        for number in range(found.n_frames):
            found.seek(number)
            yield np.asarray(found.convert("RGB")).astype(int)


@pytest.mark.parametrize("dim", first_of(1, [3, 2]))
def test_an_animation_has_a_picture_a_step_on_axes_that_stand_still(dim, tmp_path):
    mesh = block((1.0, 1.0), (3, 3), "quad4") if dim == 2 else box((1.0, 1.0, 1.0), (2, 2, 2), "hex8")
    steps = [step_of(mesh, values=k * (1.0 + mesh.points[:, 0]), displacement=0.2 * k * mesh.points) for k in (1, 2, 3)]
    path = tmp_path / "a.gif"
    shown = fc.plot.animate(mesh, steps, path, title="three")
    assert shown.path == path
    inside = re.search(r"data:image/gif;base64,([^']+)'", shown._repr_html_())
    assert base64.b64decode(inside[1]) == path.read_bytes()  # what a notebook shows
    pictures = list(frames(path))
    assert len(pictures) == 3
    assert len({picture.shape for picture in pictures}) == 1
    # The body grows, and what is its own colour at the largest value is yellow in the last picture alone.
    yellow = [(np.abs(picture - [253, 231, 36]).sum(axis=2) < 90) for picture in pictures]
    first, second, last = (int(found.sum()) for found in yellow)  # the scale of colours has some, too
    assert last > 3 * max(first, second)
    assert not [p for p in tmp_path.iterdir() if p != path]


def test_an_animation_that_cannot_be_written_says_why(tmp_path, monkeypatch):
    mesh = block((1.0, 1.0), (1, 1), "quad4")
    refused(FastcontactError, "no steps", fc.plot.animate, mesh, [], tmp_path / "a.gif")
    refused(FastcontactError, "suffix", fc.plot.animate, mesh, [step_of(mesh)], tmp_path / "a.png")
    with pytest.raises(FastcontactError, match="pictures_per_second"):
        fc.plot.animate(mesh, [step_of(mesh)], tmp_path / "a.gif", pictures_per_second=0)
    monkeypatch.setenv("PATH", "")
    refused(FastcontactError, "ffmpeg", fc.plot.animate, mesh, [step_of(mesh)], tmp_path / "a.mp4")
    assert not list(tmp_path.iterdir())


class Law:
    """A made-up theory: force d^3, radius d^(1/2)."""

    def __init__(self, d):
        self.force, self.radius = d**3, d**0.5

    @staticmethod
    def at_approach(d):
        return Law(d)


def test_a_history_begins_at_zero_and_names_its_theory(steps_of_disc):
    steps, pair = steps_of_disc
    upper, lower = fc.plot.history(steps, pair, law=Law, approach=4.0, share=0.25, units=fc.plot.UNITS)
    (force,) = (line for line in upper.lines if line.get_label() == "theory, equal approach")
    (radius,) = (line for line in lower.lines if line.get_label() == "theory, equal approach")
    assert (force.get_xdata()[0], force.get_ydata()[0], radius.get_ydata()[0]) == (0.0, 0.0, 0.0)
    np.testing.assert_allclose(force.get_ydata(), 0.25 * np.asarray(force.get_xdata()) ** 3, atol=1e-12)
    assert radius.get_ydata()[1] < 0.02 * radius.get_ydata()[-1]  # steep at zero, and drawn so
    assert lower.get_xlim()[0] == 0.0
    assert lower.get_ylabel() == "contact radius [mm]"
    bars = lower.collections[0].get_segments()
    known = [s.contact[pair].radius for s in steps if np.isfinite(s.contact[pair].radius).all()]
    np.testing.assert_allclose([[bar[0][1], bar[1][1]] for bar in bars], known)


@pytest.fixture(scope="module")
def steps_of_disc():
    return fc.solve(pressed_spheres(fc.generate.half_spheres(size=10.0), formulation="node_to_segment"), 4), "hertz"


CASE = """
title = "A ball on a block"
kinematics = "3d"
units = { length = "mm", force = "N", pressure = "MPa" }
mesh = { generator = "sphere-octant", element = "hex8", R = 50.0, size = 25.0, contact_size = 5.0, contact_radius = 6.0 }
material = [{ E = 20000.0, nu = 0.3 }]
support = [{ group = "SYMMETRY_X", x = 0.0 }, { group = "SYMMETRY_Z", z = 0.0 }, { group = "SPHERE_TOP", y = -0.5 }]
ramp = { steps = 2 }
[obstacle.plane]
secondary = "CONT_SPHERE"
shape = { kind = "half_space", point = [0.0, 0.0, 0.0], normal = [0.0, 1.0, 0.0] }
[theory.plane]
kind = "finite_half_spheres"
approach = 1.0
share = 0.25
"""


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    folder = tmp_path_factory.mktemp("solid")
    (folder / "ball.toml").write_text(CASE)
    assert main(["run", str(folder / "ball.toml"), "-o", str(folder / "ball.vtkhdf"), "-q"]) == 0
    return folder / "ball.vtkhdf"


SECTION = "--section z=0 --field stress.yy --zoom 8"
DRAWINGS = [text.split() for text in ("--map", SECTION, "--field displacement.y --scale 10", "--history")]


@pytest.mark.parametrize("options", first_of(1, DRAWINGS))
def test_the_command_draws_solids(result, tmp_path, options):
    from matplotlib.image import imread

    assert main(["plot", str(result), *options, "--png", str(tmp_path / "p.png"), "-q"]) == 0
    pixels = imread(io.BytesIO((tmp_path / "p.png").read_bytes()))
    assert len(np.unique(pixels[..., :3].reshape(-1, 3), axis=0)) > 50


@pytest.mark.slow
def test_the_command_writes_an_animation(result, tmp_path, capsys):
    target = tmp_path / "a.gif"
    assert f"wrote {target}" in output_of(capsys, ["plot", str(result), "--animate", str(target)])
    assert len(list(frames(target))) == 2


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--section", "w=0"], "'w=0' is not a plane: write for example y=0"),
        (["--section", "z"], "'z' is not a plane"),
        (["--zoom", "3"], "draw a section"),
    ],
)
def test_the_command_says_what_is_wrong(result, tmp_path, capsys, options, words):
    assert words in output_of(capsys, ["plot", str(result), *options, "--png", str(tmp_path / "p.png")], 1)
    assert not list(tmp_path.iterdir())


def test_an_animation_is_not_a_picture_too(result, tmp_path, capsys):
    both = ["--animate", str(tmp_path / "a.gif"), "--png", str(tmp_path / "a.png")]
    assert "leave out --png" in output_of(capsys, ["plot", str(result), *both], 1)


def test_an_animation_hands_every_picture_to_ffmpeg(tmp_path, monkeypatch):
    """A program of that name that keeps what it is given: as many raw pictures as there are steps."""
    folder = tmp_path / "bin"
    folder.mkdir()
    (folder / "ffmpeg").write_text('#!/bin/sh\nfor last; do :; done\necho "$@" > "$0.asked"\ncat > "$last"\n')
    (folder / "ffmpeg").chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")
    mesh = block((1.0, 1.0), (2, 2), "quad4")
    steps = [step_of(mesh, values=k * mesh.points[:, 0], displacement=0.1 * k * mesh.points) for k in (1, 2, 3)]
    shown = fc.plot.animate(mesh, steps, tmp_path / "a.mp4", mirrored=True)
    assert "<video controls loop src='data:video/mp4;base64," in shown._repr_html_()
    width, height = re.search(r"-s (\d+)x(\d+)", (folder / "ffmpeg.asked").read_text()).groups()
    assert (tmp_path / "a.mp4").stat().st_size == 3 * 4 * int(width) * int(height)


@pytest.mark.parametrize("reads", first_of(1, [True, False]))
def test_what_ffmpeg_says_when_it_fails_is_told_in_one_line(reads, tmp_path, monkeypatch):
    folder, target = tmp_path / "bin", tmp_path / "a.mp4"
    folder.mkdir()
    (folder / "ffmpeg").write_text(
        f"#!/bin/sh\n{'cat > /dev/null' * reads}\necho begin >&2\necho 'no encoder' >&2\nexit 3\n"
    )
    (folder / "ffmpeg").chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}{os.pathsep}{os.environ['PATH']}")
    mesh = block((1.0, 1.0), (2, 2), "quad4")
    with pytest.raises(
        FastcontactError, match=r"a.mp4' was not written, because ffmpeg ended with code 3 \(no encoder\)"
    ):
        fc.plot.animate(mesh, [step_of(mesh)] * 3, target)
    assert [path.name for path in tmp_path.iterdir()] == ["bin"]


def test_an_interruption_before_the_first_frame_is_told_as_such(tmp_path, monkeypatch):
    def interrupted(*given, **named):
        raise KeyboardInterrupt

    monkeypatch.setattr("fastcontact.results.plot._shape.deformed_shape", interrupted)
    mesh = block((1.0, 1.0), (2, 2), "quad4")
    with pytest.raises(KeyboardInterrupt):
        fc.plot.animate(mesh, [step_of(mesh)], tmp_path / "a.gif")
    assert os.listdir(tmp_path) == []


@pytest.mark.skipif(not shutil.which("ffmpeg"), reason="needs the program ffmpeg")
@pytest.mark.parametrize("suffix", ["mp4", "mkv", "webm"])
def test_ffmpeg_reads_as_many_pictures_as_there_are_steps(suffix, tmp_path):
    mesh, path = block((1.0, 1.0), (2, 2), "quad4"), tmp_path / f"a.{suffix}"
    fc.plot.animate(mesh, [step_of(mesh, displacement=0.1 * k * mesh.points) for k in (1, 2, 3)], path, mirrored=True)
    read = subprocess.run(["ffmpeg", "-i", path, "-f", "framemd5", "-"], capture_output=True, text=True, check=True)
    pictures = [line for line in read.stdout.splitlines() if not line.startswith("#")]
    assert len(pictures) == 3
    assert len({line.split()[-1] for line in pictures}) == 3  # none is like another


def made_contact(mesh, group, pressure):
    """A contact result on the nodes of a group, with a given pressure (m,)."""
    points = mesh.points_of(group)
    values = pressure(mesh.points[points])
    return contact_of(points, mesh.points[points], name="made", pressure=values, active=values > 0, radius=(1.0, 2.0))


def test_a_contact_map_is_seen_along_what_carries():
    """An oblique surface is drawn across its own normal, and true to scale; one that carries all around is refused."""
    mesh = box((1.0, 1.0, 1.0), (3, 3, 3), "hex8")
    turn, _ = np.linalg.qr(np.array([[1.0, 2.0, 0.5], [0.3, 1.0, 2.0], [2.0, -1.0, 1.0]]))
    turned = mesh.replace(points=mesh.points @ (turn * np.sign(np.linalg.det(turn))))
    (ax,) = fc.plot.contact_map(turned, made_contact(turned, "ZMAX", lambda x: np.ones(len(x))))
    assert areas(ax.collections[0]).sum() == pytest.approx(1.0)
    assert ax.get_xlabel() == "across the contact"
    long = mesh.replace(points=mesh.points * [0.05, 1.0, 1.0])
    (ax,) = fc.plot.contact_map(long, made_contact(long, "ZMAX", lambda x: np.ones(len(x))))
    ax.figure.draw_without_rendering()
    assert ax.bbox.width > 0.3 * ax.bbox.height
    assert "scales of the axes differ" in ax.get_title()
    assert not ax.bbox.overlaps(ax.figure.legends[0].get_window_extent())
    around = mesh.with_groups(points={"ALL": np.flatnonzero((np.abs(mesh.points - 0.5) > 0.49).any(axis=1))})
    with pytest.raises(FastcontactError, match="surrounds its body"):
        fc.plot.contact_map(around, made_contact(around, "ALL", lambda x: np.ones(len(x))))


def test_a_history_of_a_contact_that_is_closed_everywhere():
    model = elastic_model(block((1.0, 1.0), (2, 2), "quad4"), "plane_strain", nu=0.0, BOTTOM="xy")
    floor = fc.obstacles.HalfSpace((0.0, 1.0), (0.0, -1.0))
    model.add_obstacle("floor", secondary="TOP", obstacle=floor, motion={"y": -0.01})
    steps = fc.solve(model, 2)
    assert not np.isfinite(steps[0].contact["floor"].radius[1])
    _, lower = fc.plot.history(steps, "floor")
    (line,) = (line for line in lower.lines if line.get_label() == "computed: all nodes closed")
    assert list(line.get_ydata()) == [step.contact["floor"].radius[0] for step in steps]


def test_a_contact_that_stays_open_is_drawn_without_closed_nodes():
    mesh = box((1.0, 1.0, 1.0), (2, 2, 2), "hex8")
    contact = made_contact(mesh, "ZMAX", lambda x: np.zeros(len(x)))
    (ax,) = fc.plot.contact_map(mesh, contact)
    assert not ax.lines
    assert ax.get_legend() is None
    assert ax.get_xlim()[1] >= 1.0
    contact = dataclasses.replace(contact, radius=(np.nan, np.nan))
    step = dataclasses.replace(
        step_of(mesh), contact={"made": contact}, iterations={"coarse_contacts": {"made": 1, "b": 2}}
    )
    upper, lower = fc.plot.history([step], "made")
    assert lower.get_legend() is None
    assert lower.get_title() == "fewer than 4 elements across the radius in 1 of 1 steps"
    assert list(upper.lines[0].get_ydata()) == [0.0]
