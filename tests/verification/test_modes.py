"""Modes: bars, beams, plates and rings of textbooks; bodies joined by contact as one body; closed forms with preload."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from models import elastic_model, made_of, supported, united, with_obstacle
from refusals import refused
from scipy.sparse import csr_array

import fastcontact as fc
from fastcontact.analysis.modal.held_contact import contact_stiffness
from fastcontact.cli import main
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.held_motions import HeldMotions
from fastcontact.contact.pairing import Candidates
from fastcontact.mesh import elements

pytestmark = pytest.mark.each_value

block, box, union = fc.generate.block, fc.generate.box, fc.generate.union
FLAT = ("tri3", "quad4", "tri6", "quad8", "quad9")
SOLID = ("tet4", "hex8", "wedge6", "pyramid5", "tet10", "hex20", "hex27", "wedge15", "pyramid13")
STEEL = fc.LinearElastic(E=210e3, nu=0.3, density=7.85e-9)


def model_of(mesh, kinematics, nu=0.0, E=1.0, **given):
    return made_of(mesh, kinematics, fc.LinearElastic(E=E, nu=nu, density=1.0), **given)


def bar(element, kinematics, n=(1, 16), name="BAR", bottom=0.0, height=1.0):
    """Return a bar of width 0.1 along y; its ends are called after it."""
    if kinematics == "3d":
        mesh = box((0.1, height, 0.1), (n[0], n[1], n[0]), element, (0.0, bottom, 0.0), name=name)
        return fc.generate.renamed(
            mesh, lambda own: {"YMIN": f"{name} BOTTOM", "YMAX": f"{name} TOP", name: name}.get(own)
        )
    mesh = block((0.1, height), n, element, (0.0, bottom), name=name)
    return fc.generate.renamed(mesh, lambda own: own if own == name else f"{name} {own}")


def two_bars(n, height):
    """Return a bar LOW with a bar UP on it, in the plane."""
    low, up = (bar("quad8", "plane_strain", n, name, z, height) for name, z in (("LOW", 0.0), ("UP", height)))
    return union(low, up)


@pytest.mark.parametrize(
    ("kinematics", "element"),
    [(k, e) for k in ("plane_strain", "plane_stress", "axisymmetric") for e in FLAT] + [("3d", e) for e in SOLID],
)
def test_a_bar_along_its_axis(kinematics, element):
    """Without Poisson's ratio ``f = (2 k + 1) / (4 L) sqrt(E / density)``; all of its mass is effective in the end."""
    model = model_of(bar(element, kinematics, (1, 16 if element in FLAT else 8)), kinematics)
    model.fix("BAR BOTTOM", "xyz"[: model.mesh.dim])
    model.prescribe("BAR", **dict.fromkeys("xyz"[: model.mesh.dim].replace("y", ""), 0.0))
    found = fc.modes(model, n=3)
    exact = np.array([0.25, 0.75, 1.25])
    quadratic = elements.get(element).order == 2
    assert found.frequencies == pytest.approx(exact, rel=1e-3 if quadratic else 5e-2)
    assert found.frequencies[0] == pytest.approx(0.25, rel=1e-4 if quadratic else 5e-3)
    assert (found.frequencies >= exact * (1 - 1e-12)).all()  # from above, with a consistent mass
    assert found.effective_mass[:, 1] / found.mass[1] == pytest.approx(8 / (np.pi * np.array([1, 3, 5])) ** 2, rel=0.03)
    volume = {"3d": 0.01, "axisymmetric": np.pi * 0.01}.get(kinematics, 0.1)
    assert found.mass[1] == pytest.approx(volume, rel=1e-12)
    for shape in found.shapes:  # sin((2 k + 1) pi y / 2)
        assert np.abs(shape[:, 0]).max() == 0.0


@pytest.mark.parametrize("element", ["quad8", "tri6", "hex20"])
def test_a_cantilever(element):
    """Euler and Bernoulli: ``f = 1.8751^2 / (2 pi L^2) sqrt(E I / (density A))``, slender enough for 1e-3 and 6e-3."""
    flat = element in FLAT
    mesh = block((1.0, 0.02), (40, 1), element) if flat else box((1.0, 0.02, 0.02), (25, 1, 1), element)
    model = model_of(mesh, "plane_stress" if flat else "3d", **{"LEFT" if flat else "XMIN": "xyz"[: mesh.dim]})
    exact = np.array([1.875104, 4.694091]) ** 2 / (2 * np.pi) * 0.02 / np.sqrt(12.0)
    found = fc.modes(model, n=2 if flat else 4).frequencies
    found = found if flat else found[::2]  # two directions
    assert found == pytest.approx(exact, rel=4e-3)
    assert found[0] == pytest.approx(exact[0], rel=6e-4)


@pytest.mark.parametrize(("kinematics", "rigid"), [("plane_strain", 3), ("axisymmetric", 1), ("3d", 6)])
@pytest.mark.parametrize("solver", ["direct", "amg"])
def test_a_free_body_moves_rigidly_and_vibrates(kinematics, rigid, solver):
    mesh = box((1.0, 0.8, 0.6), (4, 4, 4)) if kinematics == "3d" else block((1.0, 0.8), (6, 6), "quad8")
    found = fc.modes(model_of(mesh, kinematics, 0.3), n=rigid + 2, linear_solver=solver)
    assert np.abs(found.frequencies[:rigid]).max() < 1e-5 * found.frequencies[rigid]
    assert found.effective_mass.sum(axis=0) == pytest.approx(found.mass, rel=1e-6, abs=1e-12)


def test_a_clamped_disc_and_a_ring():
    """``10.2158 / (2 pi R^2) sqrt(D / (density h))`` of a thin plate; ``sqrt(E / density) / (2 pi R)`` of a thin ring."""
    plate = model_of(block((1.0, 0.02), (60, 2), "quad8"), "axisymmetric", 0.3, RIGHT="xy", LEFT="x")
    stiff = 0.02**3 / (12 * (1 - 0.09))
    assert fc.modes(plate, n=1).frequencies[0] == pytest.approx(10.2158 / (2 * np.pi) * np.sqrt(stiff / 0.02), rel=1e-3)
    ring = model_of(block((0.01, 0.01), (1, 1), "quad8", origin=(0.995, 0.0)), "axisymmetric", 0.3, BOTTOM="y")
    assert fc.modes(ring, n=1).frequencies[0] == pytest.approx(1 / (2 * np.pi), rel=1e-4)
    # The hoop stress due to a traction of fixed direction and size stiffens the ring: E + stress in place of E.
    ring.add_traction("LEFT", x=0.001 / 0.995)
    (step,) = fc.solve(ring, 1)
    assert fc.modes(ring, step, 1).frequencies[0] == pytest.approx(np.sqrt(1.1) / (2 * np.pi), rel=2e-3)
    # Fast rotation: E (s - 1) = 2 density Omega^2 R^2 for the squared stretch s; E (3 s - 1) / 2 is the tangent stiffness.
    spun = model_of(ring.mesh, "axisymmetric", strain="finite", BOTTOM="y")
    spun.add_centrifugal(np.sqrt(0.2))
    (step,) = fc.solve(spun, 1)
    assert 1.0 + step.displacement[:, 0].mean() == pytest.approx(np.sqrt(1.4), rel=1e-5)
    assert fc.modes(spun, step, 1).eigenvalues[0] == pytest.approx(1.6 - 0.2, rel=1e-4)


def test_a_rotating_beam_is_softer_in_the_plane_of_rotation():
    """Frequencies in and out of the plane of rotation differ by the speed: w_out^2 - w_in^2 = Omega^2 (Southwell)."""
    values = []
    for direction in ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)):
        beam = model_of(block((1.0, 0.02), (40, 2), "quad8"), "plane_stress", LEFT="xy")
        beam.add_centrifugal(0.01, direction=direction, origin=(0.0, 0.01, 0.0))
        values.append(fc.modes(beam, fc.solve(beam, 1)[-1], 1).eigenvalues[0])
    assert values[1] - values[0] == pytest.approx(0.01**2, rel=1e-3)
    free = (2 * np.pi * fc.modes(beam, n=1).frequencies[0]) ** 2
    assert values[1] - free == pytest.approx(1.193 * 0.01**2, rel=0.01)  # Southwell's coefficient of a cantilever


def test_pressure_follows_the_vibrating_surface():
    """Hydrostatic pressure does not change the frequencies of a cantilever (small and finite strain agree)."""
    free, loaded = {}, {}
    for strain in ("small", "finite"):
        beam = made_of(block((100.0, 8.0), (20, 2), "quad8"), "plane_stress", STEEL, strain=strain, LEFT="xy")
        free[strain] = fc.modes(beam, n=1).frequencies[0]
        for side in ("BOTTOM", "TOP"):
            beam.add_pressure(side, 50.0)
        axial = fc.modes(beam, fc.solve(beam, 1)[-1], 1).frequencies[0]
        beam.add_pressure("RIGHT", 50.0)
        loaded[strain] = axial, fc.modes(beam, fc.solve(beam, 1)[-1], 1).frequencies[0]
    assert loaded["small"] == pytest.approx(loaded["finite"], rel=5e-4)
    assert loaded["small"][1] == pytest.approx(free["small"], rel=5e-4)
    assert loaded["small"][0] < 0.99 * free["small"]


@pytest.mark.parametrize(
    ("element", "strain"), [("quad8", "small"), ("tri6", "small"), ("hex20", "small"), ("quad8", "finite")]
)
@pytest.mark.parametrize("stress", [0.01, -0.0002])
def test_tension_stiffens_a_beam_and_pressure_softens_it(element, strain, stress):
    """Simply supported: ``(2 pi f)^2 = (pi / L)^2 (T + E I (pi / L)^2) / (density A)``; finite strains of 0.01 beside."""
    height, flat = 0.02, element in FLAT
    origin = (0.0, -0.5 * height, 0.0)
    mesh = (
        block((1.0, height), (20, 2), element, origin[:2])
        if flat
        else box((1.0, height, height), (24, 2, 1), element, origin)
    )
    ends = ("LEFT", "RIGHT") if flat else ("XMIN", "XMAX")
    middle = np.abs(mesh.points[:, 1]) < 1e-9
    pins = {f"PIN {x:g}": np.flatnonzero(middle & (np.abs(mesh.points[:, 0] - x) < 1e-9)) for x in (0.0, 1.0)}
    model = model_of(mesh.with_groups(points=pins), "plane_strain" if flat else "3d", strain=strain)
    supported(model, **{"PIN 0": "xy", "PIN 1": "y"})
    if not flat:
        model.fix("BOX", "z")
    for end, sign in zip(ends, (-1.0, 1.0)):
        model.add_traction(end, x=sign * stress)
    (step,) = fc.solve(model, 1)
    bending, off = height**2 / 12 * np.pi**2, 0.6 * abs(stress) if strain == "finite" else 0.0
    at_rest, loaded = (fc.modes(model, own, 1).frequencies[0] for own in (None, step))
    assert loaded / at_rest == pytest.approx(np.sqrt(1.0 + stress / bending), rel=1e-3 + off)
    assert loaded == pytest.approx(0.5 * np.sqrt(stress + bending), rel=1.5e-3 + off)
    assert fc.modes(model, step, 1, stress_stiffening=False).frequencies[0] == pytest.approx(at_rest, rel=1e-12)


FORMULATIONS = [
    {"formulation": "mortar"}, {"formulation": "mortar", "multipliers": "standard"}, {"formulation": "continuous"},
    {"formulation": "node_to_segment", "normals": "averaged"},
]  # fmt: skip


@pytest.mark.parametrize("options", FORMULATIONS, ids=lambda own: "-".join(own.values()))
@pytest.mark.parametrize(
    ("kinematics", "element"), [("plane_strain", "quad8"), ("axisymmetric", "tri6"), ("3d", "hex8")]
)
def test_what_is_tied_or_sticks_vibrates_as_the_whole_body(kinematics, element, options):
    """To 1e-4 also on meshes that do not match; without friction the upper half is free along the joint."""
    n, linear = (4, 3) if kinematics == "3d" else (8, 6), element == "hex8"

    def halves(**more):
        low = bar(element, kinematics, (n[0 if linear else 1], 4 if linear else 8), "LOW", height=0.1)
        mesh = union(low, bar(element, kinematics, (n[0], 4 if linear else 8), "UP", 0.1, 0.1))
        model = model_of(mesh, kinematics, **{"LOW BOTTOM": "xyz"[: mesh.dim]})
        model.add_contact("joint", secondary="UP BOTTOM", primary="LOW TOP", **options, **more)
        model.add_pressure("UP TOP", 1e-3)
        return model

    whole = model_of(bar(element, kinematics, (n[0], 8 if linear else 16), height=0.2), kinematics)
    whole.fix("BAR BOTTOM", "xyz"[: whole.mesh.dim])
    exact = fc.modes(whole, n=3).frequencies
    tied = halves(kind="tied")
    close = {"rel": 1e-7 if linear else 2e-4}
    assert fc.modes(tied, n=3).frequencies == pytest.approx(exact, **close)
    rough = halves(friction=0.5)
    (step,) = fc.solve(rough, 1)
    assert fc.modes(rough, step, 3, stress_stiffening=False).frequencies == pytest.approx(exact, **close)
    smooth = halves()
    if kinematics != "axisymmetric":
        smooth.prescribe("UP TOP", **dict.fromkeys("xyz"[: smooth.mesh.dim].replace("y", ""), 0.0))
    (step,) = fc.solve(smooth, 1)
    found = fc.modes(smooth, step, 8, stress_stiffening=False)
    axial = int(np.argmax(found.effective_mass[:, 1]))
    assert found.frequencies[axial] == pytest.approx(1.25, rel=2e-3)
    up, low = (smooth.mesh.points_of(group) for group in ("UP BOTTOM", "LOW TOP"))
    slips = [np.ptp(shape[np.concatenate([up, low]), 0]) for shape in found.shapes]
    assert max(slips) > 0.1 * np.abs(found.shapes).max()


def test_what_slides_is_free_along_the_surface_unless_it_is_held():
    mesh, found = two_bars((4, 4), 0.1), {}
    for name, options in {"slides": {"friction": 0.05}, "tied": {"kind": "tied"}}.items():
        model = model_of(mesh, "plane_strain", **{"LOW BOTTOM": "xy", "UP TOP": {"x": 2e-4, "y": -2e-4}})
        model.add_contact("joint", secondary="UP BOTTOM", primary="LOW TOP", **options)
        step, held = fc.solve(model, fc.Ramp((1.0, 2.0), ((0.0, 0.0), (1.0, 1.0), (2.0, 1.0))))
        own = {"stress_stiffening": False, "n": 3}
        found[name] = fc.modes(model, step, hold_sliding=True, **own).frequencies
        if name == "slides":
            assert not (step.contact["joint"].active & step.contact["joint"].sticking).any()
            assert fc.modes(model, step, **own).frequencies[0] < 0.85 * found[name][0]
        # Under a constant load nothing slides, although the forces remain at the limit of friction.
        assert held.contact["joint"].sticking[held.contact["joint"].active].all()
        assert fc.modes(model, held, **own).frequencies == pytest.approx(found[name], rel=1e-9)
    assert found["slides"] == pytest.approx(found["tied"], rel=1e-3)


def test_a_warning_counts_modes_that_friction_would_hold():
    """A body that nothing but sliding friction holds along the joint; one that slides without friction has no remedy."""
    mesh = two_bars((4, 4), 0.1)

    def pressed(push: dict[str, float], **options: float) -> fc.Model:
        model = model_of(mesh, "plane_strain", **{"LOW BOTTOM": "xy"})
        model.add_contact("joint", secondary="UP BOTTOM", primary="LOW TOP", **options)
        if push:
            model.prescribe("UP TOP", **push)
        return model

    (step,) = fc.solve(pressed({"x": 2e-4, "y": -2e-4}, friction=0.05), 1)
    free, own = pressed({}, friction=0.05), {"stress_stiffening": False, "n": 3}
    with pytest.warns(fc.FastcontactWarning, match=r"1 of 3 modes .* close to zero .*hold_sliding=True holds"):
        loose = fc.modes(free, step, **own).frequencies
    held = fc.modes(free, step, hold_sliding=True, **own).frequencies
    assert abs(loose[0]) < 1e-3 * held[0]
    (step,) = fc.solve(pressed({"x": 0.0, "y": -2e-4}), 1)
    assert abs(fc.modes(pressed({}), step, **own).frequencies[0]) < 1e-3 * held[0]


@pytest.mark.parametrize("solver", ["direct", "amg"])
@pytest.mark.filterwarnings("ignore:contact .* has only")
def test_a_loaded_disc_between_plates_turns_freely(solver):
    """Its stresses make the turn a little unstable, since closed nodes stay in the planes of the plates."""
    quarter = fc.generate.quarter_disc("tri6", R=2.5, size=0.8, contact_size=0.4, contact_radius=1.0)
    quarter = fc.generate.transformed(quarter, translate=(0.0, 2.5))
    half = union(quarter, fc.generate.mirrored(quarter, "x"))
    mesh = fc.generate.merge_points(union(half, fc.generate.mirrored(half, "y")), 1e-6)
    middle = int(np.linalg.norm(mesh.points, axis=1).argmin())
    model = model_of(mesh.replace(point_groups={"MIDDLE": [middle]}), "plane_strain", nu=0.3, MIDDLE="x")
    for name, y, motion in (("floor", -2.5, None), ("lid", 2.5, {"y": -1e-3})):
        plate = fc.obstacles.HalfSpace((0.0, y), (0.0, -np.sign(y)))
        model.add_obstacle(name, secondary="CONT1", obstacle=plate, motion=motion)
    step = fc.solve(model, 1)[-1]
    modes = fc.modes(model, step, n=2, linear_solver=solver)
    turn, bounce = modes.frequencies
    assert abs(turn) < 0.02 * bounce
    assert not modes.unstable.any()
    assert ("1 of 2 modes with omega^2 < 0 are rotations of rigid bodies" in repr(modes)) == (turn < 0.0)


FACES = {"XMIN": "LEFT", "XMAX": "RIGHT", "YMIN": "BOTTOM", "YMAX": "TOP"}


def plates(turn=0.0, options=None, swapped=False, element="quad8", strain="small"):
    """Return two plates of 100 x 4, clamped at one end and turned in their plane, and the direction across them."""
    flat, c, s = element in FLAT, np.cos(turn), np.sin(turn)
    parts = {}
    for name, y, n in (("LOW ", 0.0, 30), ("UP ", 4.0, 24)):
        if flat:
            parts[name] = block((100.0, 4.0), (n, 2), element, (0.0, y))
        else:
            parts[name] = fc.generate.renamed(box((100.0, 4.0, 10.0), (n, 1, 2), element, (0.0, y, 0.0)), FACES)
    mesh = united(**parts)
    turned = mesh.points.copy()
    turned[:, :2] = mesh.points[:, :2] @ [[c, s], [-s, c]]
    model = made_of(mesh.replace(points=turned), "plane_stress" if flat else "3d", STEEL, strain=strain)
    supported(model, **{"LOW LEFT": "xyz"[: mesh.dim], "UP LEFT": "xyz"[: mesh.dim]})
    sides = ("LOW TOP", "UP BOTTOM")[:: 1 if swapped else -1]
    model.add_contact("joint", secondary=sides[0], primary=sides[1], **(options or {}))
    return model, {"x": -s, "y": c}


@pytest.mark.parametrize(
    "given",
    [
        *({"options": options} for options in FORMULATIONS),
        {"options": FORMULATIONS[-1], "swapped": True},
        {"turn": np.pi / 6.0, "swapped": True},
        {"strain": "finite", "turn": np.pi / 6.0},
        {"element": "hex20"},
        {"element": "hex8", "options": {"formulation": "node_to_segment"}},
    ],
    ids=str,
)
def test_plates_that_forces_of_constant_directions_press_together_vibrate_as_without_them(given):
    """The points of both faces keep their distance across the plates to second order, so that the forces do no work."""
    model, across = plates(**given)
    for side, pressure in (("UP TOP", -5.0), ("LOW BOTTOM", 5.0)):
        model.add_traction(side, **{axis: pressure * value for axis, value in across.items()})
    step = fc.solve(model, 1)[-1]
    free = fc.modes(model, step, 1, stress_stiffening=False).frequencies
    assert fc.modes(model, step, 1).frequencies == pytest.approx(free, rel=5e-4)  # without contact forces 3.6 % lower


def test_a_stack_of_plates_under_pressure_vibrates_as_each_plate_between_pressures():
    """The ends are guided. Docs: alone, the plates and the pressure have 334 Hz with a free end."""
    model, _ = plates()
    alone = made_of(block((100.0, 4.0), (30, 2), "quad8"), "plane_stress", STEEL)
    for loaded, prefix in ((model, ("LOW ", "UP ")), (alone, ("",))):
        loaded.add_pressure(f"{prefix[-1]}TOP", 50.0)
        loaded.add_pressure(f"{prefix[0]}BOTTOM", 50.0)
        for part in prefix:
            loaded.fix(f"{part}LEFT", "xy")
            loaded.fix(f"{part}RIGHT", "x")
    stack, single = (fc.modes(loaded, fc.solve(loaded, 1)[-1], 1).frequencies for loaded in (model, alone))
    assert stack == pytest.approx(single, rel=5e-4)
    assert single > 1.02 * fc.modes(alone, n=1).frequencies


@pytest.mark.parametrize("options", FORMULATIONS, ids=lambda own: "-".join(own.values()))
@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.filterwarnings("ignore:.*integration points of complete facets")
def test_rods_pressed_end_to_end_between_pins_slide_past_each_other(options, swapped):
    """Turning both by t lengthens the distance L of the pins to L / cos(t): ``w^2 = P L / inertia``, and no buckling."""
    one, two = (
        block((0.5, 0.1), (10, n), "quad8", (x, -0.05), name=name) for name, x, n in (("ONE", 0.0, 4), ("TWO", 0.5, 3))
    )
    mesh = united(**{"ONE ": one, "TWO ": two})
    pins = {
        name: [int(np.linalg.norm(mesh.points - [x, 0.0], axis=1).argmin())] for name, x in (("A", 0.0), ("B", 1.0))
    }
    loose, held = (model_of(mesh.replace(point_groups=pins), "plane_stress") for _ in range(2))
    supported(held, ONE={"y": 0.0}, TWO={"y": 0.0})  # without forces
    for model in (loose, held):
        supported(model, A="xy", B="y")
        sides = ("ONE RIGHT", "TWO LEFT")[:: -1 if swapped else 1]
        model.add_contact("joint", secondary=sides[0], primary=sides[1], **options)
        model.add_traction("TWO RIGHT", x=-1e-5)
    found = fc.modes(loose, fc.solve(held, 1)[-1], 1).eigenvalues[0]
    inertia = 2.0 * 0.05 * (0.25 / 3.0 + 0.01 / 12.0)
    assert found == pytest.approx(1e-5 * 0.1 / inertia, rel=0.02)


def test_a_pipe_in_a_trough_is_a_pendulum_that_turns_freely():
    """``w^2 = g / (R - r)`` without friction, and zero."""
    R, g = 2.0, 1e-3
    mesh = block((1.0, 1.0), (64, 6), "quad8", name="PIPE")
    angle, radius = -2.0 * np.pi * mesh.points[:, 0], 0.4 + 0.6 * mesh.points[:, 1]
    mesh = mesh.replace(points=np.column_stack([radius * np.sin(angle), -radius * np.cos(angle)]))
    mesh = fc.generate.merge_points(mesh, 1e-9)
    mesh = mesh.replace(point_groups={"PIN": [int(np.linalg.norm(mesh.points - [0.0, -0.4], axis=1).argmin())]})
    loose, held = (model_of(mesh, "plane_strain", 0.3) for _ in range(2))
    held.fix("PIN", "x")  # without a force, by symmetry
    floor = fc.obstacles.Sphere((0.0, R - 1.0), R, hollow=True)
    for model in (loose, held):
        model.add_gravity(y=-g)
        model.add_obstacle("floor", secondary="TOP", obstacle=floor)
    found = fc.modes(loose, fc.solve(held, 1)[-1], 2).eigenvalues
    assert found == pytest.approx([0.0, g / (R - 1.0)], abs=0.03 * g)


@pytest.mark.parametrize("sides", [("CONT_BLOCK", "CONT_SPHERE"), ("CONT_SPHERE", "CONT_BLOCK")])
@pytest.mark.parametrize("element", ["hex8", "hex20", "tet4"])
def test_contact_stiffness_in_space_is_minus_the_second_difference_of_gaps(element, sides):
    mesh = fc.generate.sphere_on_block("tet4" if element == "tet4" else "hex8", R=1.0, size=0.2, contact_size=0.1)
    mesh = fc.generate.to_quadratic(mesh) if element == "hex20" else mesh
    model = model_of(mesh, "3d")
    model.add_contact("c", secondary=sides[0], primary=sides[1], formulation="continuous", normals="facet")
    pair = model.bind(model.contact[0], HeldMotions.of(model.prescribed_by_ramp()[0], csr_array((0, model.n_dofs))))
    config = Configuration.undeformed(mesh.points)
    candidates = Candidates.in_facets(pair.secondary, [np.array([[0.2, 0.3]]) for _ in pair.secondary.blocks])
    near = np.linalg.norm(candidates.positions(mesh.points), axis=1) < 0.15  # products of gap and curvature are omitted
    rows = np.flatnonzero(near & pair.pair_candidates(candidates, config).paired)
    rng = np.random.default_rng(0)
    du, force = 1e-4 * rng.normal(size=mesh.points.shape), 1.0 + rng.random(len(rows))

    def faced_at(u):
        moved = replace(config, displacement=u)
        return pair.linearised_points(candidates, pair.pair_candidates(candidates, moved), rows, moved, "facet")

    points = [faced_at(factor * du) for factor in (-1.0, 0.0, 1.0)]
    before, at_rest, after = (force @ np.einsum("nd,nd->n", p.offset, p.normal) for p in points)
    second_difference = before - 2.0 * at_rest + after
    assert du.ravel() @ points[1].stiffness(force) @ du.ravel() == pytest.approx(-second_difference, rel=2e-4)


def test_contact_forces_on_a_driven_obstacle_move_with_both():
    """The contact stiffness does not resist a translation of body and obstacle."""
    model = model_of(block((2.0, 1.0), (20, 10), origin=(-1.0, -1.0)), "plane_strain", BOTTOM="xy")
    model.add_obstacle("ball", secondary="TOP", obstacle=fc.obstacles.Sphere((0.1, 3.0), 3.0), force={"y": -0.01})
    step = fc.solve(model, 1)[-1]
    K = contact_stiffness(model, step, HeldMotions.of(model.prescribed_by_ramp()[0], csr_array((0, model.n_dofs))))
    together, apart = np.tile([1.0, 0.0], K.shape[0] // 2), np.zeros(K.shape[0])
    apart[-2] = 1.0
    assert np.abs(K @ together).max() < 1e-12 * np.abs(K.data).max()
    assert apart @ K @ apart == pytest.approx(-0.01 / 3.0, rel=0.05)


def test_a_column_beyond_its_buckling_load_is_unstable():
    """With 102 % of the Euler load the lowest eigenvalue is negative, with 98 % it is positive."""
    stable, unstable = [], "1 of 2 modes are unstable: omega^2 < 0"
    for share in (0.98, 1.02):
        model = model_of(block((50.0, 1.0), (20, 2), "quad8"), "plane_stress", LEFT="xy")
        model.add_traction("RIGHT", x=-share * np.pi**2 / 12.0 / (4.0 * 50.0**2))
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            modes = fc.modes(model, fc.solve(model, 1)[-1], n=2)
        stable.append(not modes.unstable.any())
        assert (unstable in repr(modes)) == (unstable in modes._repr_html_().replace("&lt;", "<")) == (not stable[-1])
        assert any(unstable in str(warning.message) for warning in told) == (not stable[-1])
    assert stable == [True, False]


@pytest.mark.filterwarnings("ignore:contact 'joint' penetrates")
def test_what_is_open_is_free_and_penalties_are_springs():
    """Two bars of length 1 joined by a spring k: ``w cos w sin w = k (cos^2 w - sin^2 w)`` with w the angular frequency."""
    from scipy.optimize import brentq

    mesh = two_bars((1, 8), 1.0)
    for options in FORMULATIONS:
        model = model_of(mesh, "plane_strain", **{"LOW BOTTOM": "xy"}, LOW={"x": 0.0}, UP={"x": 0.0})
        model.add_contact("joint", secondary="UP BOTTOM", primary="LOW TOP", penalty=1.5, **options)
        model.add_pressure("UP TOP", 1e-3)
        (step,) = fc.solve(model, 1)
        w = brentq(lambda w: w * np.cos(w) * np.sin(w) - 1.5 * np.cos(2 * w), 0.01, 1.0)
        found = fc.modes(model, step, 1, stress_stiffening=False)
        assert found.frequencies[0] == pytest.approx(w / (2 * np.pi), rel=1e-5)
        open_now = fc.modes(model, n=2).frequencies  # at rest nothing is closed: one bar is free, the other alone
        assert abs(open_now[0]) < 1e-6
        assert open_now[1] == pytest.approx(0.25, rel=1e-5)


def test_an_obstacle_holds_what_is_closed_and_moves_without_mass():
    for force in (None, {"y": -0.01}):
        model = model_of(bar("quad8", "plane_strain"), "plane_strain", **{"BAR BOTTOM": "xy"}, BAR={"x": 0.0})
        plate = fc.obstacles.HalfSpace((0.0, 1.0), (0.0, -1.0))
        with_obstacle(model, "plate", "BAR TOP", plate, motion=None if force else {"y": -0.01}, force=force)
        (step,) = fc.solve(model, 1)
        found = fc.modes(model, step, 2, stress_stiffening=False).frequencies
        assert found == pytest.approx([0.25, 0.75] if force else [0.5, 1.0], rel=1e-4)


def test_a_plate_that_a_force_moves_presses_on_a_bar_of_two_tied_halves():
    model = model_of(two_bars((1, 8), 0.5), "plane_strain", **{"LOW BOTTOM": "xy"}, LOW={"x": 0.0}, UP={"x": 0.0})
    model.add_contact("joint", secondary="UP BOTTOM", primary="LOW TOP", kind="tied")
    plate = fc.obstacles.HalfSpace((0.0, 1.0), (0.0, -1.0))
    model.add_obstacle("plate", secondary="UP TOP", obstacle=plate, force={"y": -0.01})
    (step,) = fc.solve(model, 1)
    assert fc.modes(model, step, 2, stress_stiffening=False).frequencies == pytest.approx([0.25, 0.75], rel=1e-4)


def test_a_tightened_bolt_is_one_piece():
    """The sides of a pretension section keep their distance, as if the bar was whole."""
    mesh = bar("quad8", "plane_strain").with_facet_group("CUT", lambda x: np.abs(x[:, 1] - 0.5) < 1e-9, between=True)
    model = model_of(fc.generate.cut(mesh, "CUT"), "plane_strain")
    supported(model, **{"BAR BOTTOM": "xy", "BAR TOP": "xy"}, BAR={"x": 0.0})
    model.add_pretension("bolt", "CUT", force=0.001)
    (step,) = fc.solve(model, 1)
    assert fc.modes(model, step, 2, stress_stiffening=False).frequencies == pytest.approx([0.5, 1.0], rel=1e-4)


def test_sides_that_repeat_each_other_at_a_corner_hold_once():
    """A block tied to both walls of a corner, whose node is in both pairs."""
    walls = [block((1.0, 1.0), (3, 3), origin=o, name=n) for n, o in (("FLOOR", (1.0, -1.0)), ("WALL", (0.0, 0.0)))]
    parts = [*walls, block((1.0, 1.0), (3, 3), origin=(1.0, 0.0), name="BODY")]
    mesh = united(**dict(zip(("FLOOR ", "WALL ", "BODY "), parts)))
    model = model_of(mesh, "plane_strain", FLOOR="xy", WALL="xy")
    assert len(model.add_contacts(kind="tied")) >= 2
    alone = model_of(parts[2], "plane_strain", BOTTOM="xy", LEFT="xy")
    assert fc.modes(model, n=3).frequencies == pytest.approx(fc.modes(alone, n=3).frequencies, rel=1e-9)


def test_modes_are_steps_for_pictures_and_files(tmp_path):
    model = model_of(block((1.0, 0.1), (10, 1), "quad8"), "plane_stress", LEFT="xy")
    found = fc.modes(model, n=3)
    assert len(found) == 3
    assert "0.016" in repr(found)
    with fc.ResultWriter(tmp_path / "modes.vtkhdf", model) as out:
        for mode in found:
            out.write(mode)
    with fc.open_results(tmp_path / "modes.vtkhdf") as results:
        assert [step.load_factor for step in results] == pytest.approx(found.frequencies)
        np.testing.assert_array_equal(results[1].displacement, found.shapes[1])
        title = fc.plot.deformed_shape(results.mesh, results[1], field="displacement").get_title()
    assert f"frequency {found.frequencies[1]:.6g} per unit of time" in title
    assert "phase 0.5" in repr(found.phases(1, 2)[1])


def test_a_case_file_asks_for_modes(tmp_path, capsys):
    path, out = tmp_path / "bar.toml", tmp_path / "bar.vtkhdf"
    path.write_text(
        'kinematics = "plane_strain"\n[mesh]\ngenerator = "block"\n[[material]]\nE = 1.0\nnu = 0.0\ndensity = 1.0\n'
        '[[support]]\ngroup = "BOTTOM"\ny = 0.0\n[[support]]\ngroup = "BLOCK"\nx = 0.0\n[ramp]\nsteps = 1\n[modes]\nn = 2\n'
    )
    assert main(["run", str(path), "-o", str(out), "--modes", str(tmp_path / "modes.vtkhdf")]) == 0
    assert "natural frequencies [cycles per unit of time] at the last step: 0.25" in capsys.readouterr().out
    with fc.open_results(tmp_path / "modes.vtkhdf") as results:
        assert len(results) == 2
    path.write_text(path.read_text().replace("n = 2", "m = 2"))
    assert main(["run", str(path), "-o", str(out)]) == 1
    assert "modes.m" in capsys.readouterr().err


def pressed_column(divisions):
    """A column under more than Euler's load, and its step."""
    model = model_of(block((1.0, 0.1), divisions), "plane_stress", LEFT="xy")
    model.add_traction("RIGHT", x=-0.01)
    return model, fc.solve(model, 1)[0]


def yielded_bar(load, law, strain="small"):
    """A bar under tension, whose material yields at 5, and its step."""
    model = made_of(block((4.0, 1.0), (8, 2), "quad8"), "plane_stress", law, strain=strain)
    supported(model, LEFT="x", BOTTOM="y")
    model.add_traction("RIGHT", x=load)
    return model, fc.solve(model, 1)[0]


PLASTIC = fc.ElasticPlastic(1000.0, 0.3, yield_stress=5.0, hardening=[(0.0, 5.0), (0.1, 15.0)], density=1.0)


def test_before_yield_the_modes_are_elastic_ones():
    plastic, elastic = (
        fc.modes(*yielded_bar(4.9, law), 3) for law in (PLASTIC, fc.LinearElastic(1000.0, 0.3, density=1.0))
    )
    assert plastic.frequencies == pytest.approx(elastic.frequencies, rel=1e-10)


def test_what_is_refused():
    model = model_of(block((1.0, 0.1), (10, 1)), "plane_stress")
    column, other = pressed_column((41, 2))
    for call, said in (
        (lambda: fc.modes(model, n=0), "request one or more"),
        (lambda: fc.modes(model, n=44), "modes of 44 free displacements"),
        (lambda: fc.modes(model, other), "displacements of shape .126, 2., but the mesh points of shape .22, 2."),
        (lambda: fc.modes(model, n=2, linear_solver="nothing"), "nothing"),
    ):
        refused(fc.ModelError, said, call)
    bare = elastic_model(model.mesh, "plane_stress", E=1.0, nu=0.0)
    refused(fc.ModelError, "10 solid cells have none: give them density", fc.modes, bare)
    for model, step in (pressed_column((10, 1)), (column, other)):  # all modes at once, and by iterations
        refused(fc.ModelError, "the equilibrium of the step is unstable", fc.modes, model, step)
        assert fc.modes(model, step, 1, stress_stiffening=False).frequencies[0] > 0.0
    for strain in ("small", "finite"):
        yielded = yielded_bar(5.5, PLASTIC, strain)
        refused(fc.ModelError, "bodies have yielded in this step", fc.modes, *yielded)
        elastic = fc.modes(*yielded, 1, stress_stiffening=False).frequencies[0]
        assert elastic == pytest.approx(np.sqrt(1000.0) / 16.0, rel=5e-3)  # the bar also contracts
        refused(
            fc.ModelError, "plastic bodies depend on their history", yielded[0].internal_forces, yielded[1].displacement
        )
