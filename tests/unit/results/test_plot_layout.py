"""Layout of pictures of any proportions: nothing is cut off, and no texts overlap."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib_pictures import contact_of, frames_of, overlaps, step_of, texts
from models import elastic_model
from pairwise import first_of

import fastcontact as fc

pytest.importorskip("matplotlib", reason="pictures need matplotlib")
# Of boxes: a cube, a beam along each axis, a plate, a tile.
SIZES = [(1, 1, 1), (60, 15, 20), (5, 60, 8), (4, 6, 70), (50, 40, 3), (0.03, 0.02, 0.001)]
VIEWS = [(25.0, -60.0), (25.0, -120.0), (20.0, 120.0), (60.0, 10.0)]


def thousands(mesh, displacement=None, load_factor=1.0):
    """Return a step of long numbers."""
    return step_of(mesh, 1000.0 + mesh.points[:, 0], displacement, load_factor=load_factor)


@pytest.mark.parametrize(("size", "view"), first_of(3, [(size, VIEWS[i % 4]) for i, size in enumerate(SIZES)]))
def test_texts_of_a_solid_are_whole_and_apart(size, view):
    mesh = fc.generate.box(size, (2, 2, 2), "hex8")
    ax = fc.plot.deformed_shape(mesh, thousands(mesh, 0.01 * mesh.points), view=view, units=fc.plot.UNITS)
    ax.figure.canvas.draw()
    assert overlaps(texts(ax), solid=True) == []


@pytest.mark.each_value
@pytest.mark.parametrize("zoom", first_of(1, [None, 0.3]))
@pytest.mark.parametrize("size", [(1.0, 1.0), (60.0, 15.0), (15.0, 60.0), (40.0, 2.0)], ids=str)
def test_texts_of_sections_and_plane_bodies_are_whole_and_apart(size, zoom):
    plane, solid = fc.generate.block(size, (4, 4)), fc.generate.box((size[0], 2.0, size[1]), (4, 2, 4), "hex8")
    zoom, far = zoom and zoom * min(size), fc.generate.with_reference_points(plane, {"FAR": (-9.0 * size[0], 0.0)})
    for ax in (
        fc.plot.deformed_shape(plane, thousands(plane), zoom=zoom, units=fc.plot.UNITS),
        fc.plot.section(solid, thousands(solid), (0.0, 1.0, 0.0), (0.0, 1.0, 0.0), zoom=zoom, units=fc.plot.UNITS),
    ):
        ax.figure.canvas.draw()
        assert overlaps(texts(ax)) == []
    sizes = [
        fc.plot.deformed_shape(mesh, thousands(mesh, 0.01 * mesh.points)).figure.get_size_inches()
        for mesh in (plane, far)
    ]
    assert sizes[0] == pytest.approx(sizes[1])  # space is for bodies only


def test_a_section_says_how_displacements_are_scaled():
    mesh = fc.generate.box((1.0, 1.0, 1.0), (2, 2, 2), "hex8")
    ax = fc.plot.section(mesh, thousands(mesh), (0.5, 0.5, 0.5), (0.0, 1.0, 0.0), scale=20.0)
    assert ax.get_title().endswith("load factor 1, displacements x 20")


@pytest.mark.parametrize("size", SIZES[:1], ids=str)
def test_pictures_of_an_animation_are_whole_and_in_proportion(size, tmp_path, monkeypatch):
    mesh = fc.generate.box(size, (2, 2, 2), "hex8")
    steps = [thousands(mesh, 0.3 * k * mesh.points * [1.0, 0.2, 0.0], float(k)) for k in (1, 2)]
    seen = frames_of(monkeypatch, lambda: fc.plot.animate(mesh, steps, tmp_path / "a.gif", units=fc.plot.UNITS))
    assert len(seen) == 2
    for found in seen:
        assert found["overlaps"] == []
        # As long along all axes: only then edges, which are moved towards the eye, lie on the faces that they belong to.
        assert np.ptp(found["scales"]) < 1e-9 * max(found["scales"])
    assert seen[0]["limits"] == seen[1]["limits"]


def pressed(friction):
    model = elastic_model(fc.generate.block((4.0, 1.0), (8, 2)), "plane_strain", TOP={"y": -0.01})
    model.prescribe("TOP", x=0.001)
    floor = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0))
    model.add_obstacle("floor", secondary="BOTTOM", obstacle=floor, friction=friction)
    return fc.solve(model, 2)


@pytest.mark.parametrize(("friction", "word"), [(0.0, "closed"), (0.5, "sticking")])
def test_zones_say_what_closed_nodes_do(friction, word):
    ax = fc.plot.contact_zones(pressed(friction), "floor")
    named = {text.get_text() for text in ax.get_legend().get_texts()}
    assert word in named
    assert not {"closed", "sticking"} - {word} & named
    assert ax.get_title() == "States of the nodes of contact 'floor' in each load step"


@pytest.mark.parametrize("given", ["N", "N/mm"])
def test_forces_of_plane_models_are_per_thickness_in_a_history(given):
    upper, _ = fc.plot.history(pressed(0.0), "floor", units={**fc.plot.UNITS, "force": given})
    assert upper.get_ylabel() == "contact force [N/mm]"


def test_forces_of_other_models_are_whole_in_a_history():
    solid = fc.Model(fc.generate.box((1.0, 1.0, 1.0), (1, 1, 1), "hex8"), "3d")
    solid.fix("ZMIN", "xyz")
    disc = fc.Model(fc.generate.block((1.0, 1.0), (2, 2)), "axisymmetric")
    disc.fix("BOTTOM", "xy")
    for model, side, way in ((solid, "ZMAX", "z"), (disc, "TOP", "y"), (disc, "RIGHT", "")):
        model.contact.clear()
        if not model.materials:
            model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
        lid = {"point": (0.0,) * (model.mesh.dim - 1) + (1.0,), "normal": (0.0,) * (model.mesh.dim - 1) + (-1.0,)}
        ring = fc.obstacles.HalfSpace(**lid) if way else fc.obstacles.HalfSpace((0.99, 0.0), (-1.0, 0.0))
        model.add_obstacle("lid", secondary=side, obstacle=ring, motion={way: -0.01} if way else None)
        upper, _ = fc.plot.history(fc.solve(model, 1), "lid", units=fc.plot.UNITS)
        assert upper.get_ylabel().endswith("[N]")


def test_large_numbers_have_no_power_of_ten():
    contact = pressed(0.0)[-1].contact["floor"]
    contact.pressure[:] *= 10541.9 / contact.pressure_max
    ax = fc.plot.pressure_profile(contact, units=fc.plot.UNITS)
    assert "= 10542 MPa" in ax.get_legend().get_texts()[0].get_text()


@pytest.mark.parametrize("formulation", ["continuous", "node_to_segment"])
def test_the_edge_in_a_profile_is_the_contact_radius(formulation):
    """The points of continuous contact lie between nodes, and so do the bounds of its radius."""
    mesh = fc.generate.graded_block("quad8", width=20.0, contact_radius=1.2)
    model = elastic_model(mesh, "axisymmetric", SYMMETRY_X="x", BOTTOM="y")
    ball = fc.obstacles.Sphere(centre=(0.0, 10.0), R=10.0)
    model.add_obstacle("ball", secondary="CONTACT", obstacle=ball, motion={"y": -0.1}, formulation=formulation)
    contact = fc.solve(model, 1)[-1].contact["ball"]
    told = [text.get_text() for text in fc.plot.pressure_profile(contact).get_legend().get_texts()]
    (edge,) = (text for text in told if text.startswith("edge"))
    ends = [float(word) for word in edge.split(": ")[1].split(" to ")]
    assert np.allclose(ends, contact.radius, rtol=1e-3)


def conforming(closed_to):
    """Return a contact along a half circle of radius 10 that is closed up to an angle [radian] from its middle."""
    angle = np.linspace(0.0, np.pi, 51)
    place, closed = 10.0 * angle, angle <= closed_to
    normal = np.column_stack([np.sin(angle), np.cos(angle)])
    across = 10.0 * np.sin(angle)
    ends = float(across[closed].max()), float(across[closed.sum()])
    return contact_of(
        np.arange(51), 10.0 * normal, abscissa=place, pressure=1.0 * closed, normal=normal, active=closed, radius=ends,
        middle=np.array([0.0, 10.0]), place=place, tangent=np.array([1.0, 0.0]), name="pin",
    )  # fmt: skip


@pytest.mark.parametrize("closed_to", [0.3, 0.9])
def test_the_edge_on_a_circle_lies_between_the_last_closed_node_and_the_first_open_one(closed_to):
    """Nodes on the far side of the circle, as near to the middle along the tangent, do not count."""
    pin = conforming(closed_to)
    (label,) = [line for line in fc.plot.pressure_profile(pin).get_legend_handles_labels()[1] if "edge" in line]
    nodes = pin.place[pin.active.sum() - 1 :][:2]
    assert label == f"edge: {nodes[0]:.4g} to {nodes[1]:.4g} (arc length)"


def test_both_edges_of_a_ring_of_contact_are_marked():
    """As under an O-ring: nodes nearer to the axis than the contact are open."""
    pin = conforming(0.9)
    ring = replace(pin, active=pin.active & (pin.place > 3.0))
    (label,) = [line for line in fc.plot.pressure_profile(ring).get_legend_handles_labels()[1] if "edge" in line]
    first, last = np.flatnonzero(ring.active)[[0, -1]]
    bounds = [f"{pin.place[k]:.4g}" for k in (first - 1, first, last, last + 1)]
    assert label == f"edges: {bounds[0]} to {bounds[1]}, and {bounds[2]} to {bounds[3]} (arc length)"


def test_profiles_on_the_same_axes_differ_in_colour_and_are_whole():
    ax = fc.plot.pressure_profile(conforming(0.9), title="both")
    wide = ax.get_xlim()
    fc.plot.pressure_profile(conforming(0.3), ax=ax)
    assert len({line.get_color() for line in ax.lines}) == 2
    assert (ax.get_xlim(), ax.get_title()) == (wide, "both")


@pytest.mark.parametrize(("dim", "bodies"), [(2, 2), (2, 25), (3, 2), (3, 10), (3, 25)])
def test_the_legend_of_contacts_is_whole_and_hides_nothing(dim, bodies):
    def body(x):
        if dim == 2:
            return fc.generate.block((15.0, 56.0), (2, 8), origin=(x, 0.0), name=f"BODY {x:g}")
        return fc.generate.renamed(
            fc.generate.box((15.0, 56.0, 9.0), (2, 2, 2), origin=(x, 0.0, 0.0)), f"BODY {x:g} {{}}".format
        )

    ax = fc.plot.contacts(fc.find_contacts(fc.generate.union(*(body(15.0 * i) for i in range(bodies)))))
    ax.figure.canvas.draw()
    renderer = ax.figure.canvas.get_renderer()
    (legend,) = ax.figure.legends
    for drawn in (legend, ax.yaxis):
        box = drawn.get_tightbbox(renderer)
        assert all(map(ax.figure.bbox.fully_containsx, (box.x0, box.x1)))
        assert all(map(ax.figure.bbox.fully_containsy, (box.y0, box.y1)))
    assert legend.get_tightbbox(renderer).x0 > ax.get_window_extent(renderer).x1
    assert len(legend.get_texts()) == 2 * min(bodies - 1, 10)
    assert legend.get_title().get_text() == ("the first 10, and 14 more" if bodies == 25 else "")


def test_pictures_of_contacts_and_modes_show_the_units_of_the_model():
    model = fc.Model(fc.generate.block_on_block(), kinematics="plane_strain", units="mm, N, MPa")
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.3, density=1e-9))
    assert fc.plot.contacts(model.add_contacts()).get_xlabel() == "x [mm]"
    mode = fc.modes(model, n=1)[0]
    ax = fc.plot.deformed_shape(model.mesh, mode, field="displacement")
    assert [ax.get_xlabel(), ax.figure.axes[1].get_ylabel()] == ["x [mm]", "displacement"]  # a mode has no scale
    assert "mm" not in repr(mode)


def test_nodes_of_contact_zones_stay_in_place_when_the_contact_moves():
    model = elastic_model(fc.generate.block((4.0, 2.0), (32, 8), origin=(-2.0, -2.0)), "plane_strain", BOTTOM="y")
    model.prescribe("BOTTOM", x=-0.3, ramp=[(0.0, 0.0), (1.0, 0.0), (2.0, 1.0)])
    down = {"motion": {"y": -0.04}, "ramp": [(0.0, 0.0), (1.0, 1.0), (2.0, 1.0)]}
    model.add_obstacle("ball", secondary="TOP", obstacle=fc.obstacles.Sphere((0.0, 5.0), 5.0), **down)
    steps = fc.solve(model, [1.0, 2.0])
    assert abs(steps[1].contact["ball"].middle[0]) > 0.1
    ax = fc.plot.contact_zones(steps, "ball")
    x, y = np.concatenate([line.get_xydata() for line in ax.lines]).T
    assert np.sort(y[x == 1.0]) == pytest.approx(np.sort(y[x == 2.0]), abs=1e-12)
