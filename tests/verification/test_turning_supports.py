"""Supports and obstacles that rotate bodies by any angle: no stress; contact and friction follow."""

import numpy as np
import pytest
from models import made_of, with_obstacle
from refusals import refused

import fastcontact as fc
from fastcontact.contact.obstacles.rigid_side import Rotation

CENTRE, AXIS = (0.3, -1.0, 2.0), (1.0, 2.0, -0.5)
NEO_HOOKEAN, KIRCHHOFF = fc.NeoHookean(E=1.0, nu=0.3), fc.LinearElastic(E=1.0, nu=0.3)
PRESS, TURN = [(0.0, 0.0), (1.0, 1.0), (2.0, 1.0)], [(0.0, 0.0), (1.0, 0.0), (2.0, 1.0)]


def turned(places: np.ndarray, angle: float) -> np.ndarray:
    """Return places (n, dim) [length] turned about the centre."""
    dim = places.shape[1]
    rotation = Rotation(CENTRE[:dim], AXIS if dim == 3 else (0.0, 0.0, 1.0), angle)
    return (places - CENTRE[:dim]) @ rotation.matrix(angle).T + CENTRE[:dim]


def bar(
    kinematics: str, element: str, angle: float, law=NEO_HOOKEAN, ends: int = 1, strain: str = "finite"
) -> fc.Model:
    """Return a bar of which one end turns, or both."""
    solid = kinematics == "3d"
    size, divisions = ((2.0, 1.0, 1.0), (3, 2, 2)) if solid else ((2.0, 1.0), (4, 2))
    mesh = (fc.generate.box if solid else fc.generate.block)(size, divisions, element=element)
    model = made_of(mesh, kinematics, law, strain=strain)
    rotation = {"angle": angle, "centre": CENTRE[: mesh.dim], **({"axis": AXIS} if solid else {})}
    for group in (("XMIN", "XMAX") if solid else ("LEFT", "RIGHT"))[:ends]:
        model.prescribe(group, rotation=rotation)
    return model


@pytest.mark.pairwise
@pytest.mark.parametrize("law", [NEO_HOOKEAN, KIRCHHOFF])
@pytest.mark.parametrize("ends", [1, 2])
@pytest.mark.parametrize(("angle", "steps"), [(0.5 * np.pi, 1), (0.5 * np.pi, 3), (2.0 * np.pi, 12)])
@pytest.mark.parametrize(
    ("kinematics", "element"),
    [("plane_strain", "quad4"), ("plane_strain", "quad8"), ("plane_stress", "tri6"), ("3d", "hex8"), ("3d", "tet10")],
)
def test_a_turned_end_takes_the_body_along_without_stress(kinematics, element, angle, steps, ends, law) -> None:
    model = bar(kinematics, element, angle, law, ends)
    last = fc.solve(model, steps)[-1]
    assert last.displacement == pytest.approx(turned(model.mesh.points, angle) - model.mesh.points, abs=1e-10)
    assert np.abs(last.stress).max() <= 1e-10
    assert not last.warnings


def test_the_axis_may_move_and_the_angle_have_a_history_of_its_own() -> None:
    model = bar("plane_strain", "quad8", 0.0)
    model.supports.clear()
    model.prescribe("LEFT", rotation={"angle": 2.0, "centre": CENTRE[:2], "ramp": TURN}, x=1.5, ramp=PRESS)
    for step, (moved, angle) in zip(
        fc.solve(model, [1.0, 1.25, 1.5]), [(1.5, 0.0), (1.5, 0.5), (1.5, 1.0)], strict=True
    ):
        exact = turned(model.mesh.points, angle) - model.mesh.points + [moved, 0.0]
        assert step.displacement == pytest.approx(exact, abs=1e-10)


def test_a_bent_bar_is_turned_with_its_stress() -> None:
    """A bar bent first, then turned as a whole: the same stress in axes that turn, and no work."""
    model = bar("plane_strain", "quad8", 0.0)
    model.supports.clear()
    for group, bend in (("LEFT", 0.0), ("RIGHT", 0.4)):
        rotation = {"angle": 2.0 * np.pi, "centre": (1.0, 0.5), "ramp": TURN}
        # Bent by a rotation about a point of its own that turns likewise: R(a) R(b) is a rotation by a + b.
        if bend:
            ramp = [(0.0, 0.0), (1.0, bend), (2.0, bend + 2.0 * np.pi)]
            rotation = {"angle": 1.0, "centre": (1.0, 0.5), "ramp": ramp}
        model.prescribe(group, rotation=rotation)
    steps = fc.solve(model, [1.0, *np.linspace(1.0, 2.0, 9)[1:]])
    bent, quarter, whole = steps[0], steps[2], steps[-1]
    assert np.abs(bent.stress).max() > 0.1
    assert quarter.von_mises == pytest.approx(bent.von_mises, abs=1e-9)
    assert quarter.stress[:, 1] == pytest.approx(bent.stress[:, 0], abs=1e-9)
    assert whole.stress == pytest.approx(bent.stress, abs=1e-9)
    assert whole.work["strain_energy"] == pytest.approx(bent.work["strain_energy"], rel=1e-9)


@pytest.mark.parametrize(("element", "formulation"), [("quad8", None), ("quad4", "node_to_segment")])
def test_a_block_is_carried_round_between_two_turning_plates(element: str, formulation: str | None) -> None:
    """Nothing but friction holds it; after a whole turn it is where it was, and forces have turned all the way."""
    mesh = fc.generate.block((2.0, 1.0), (6, 3), element=element, origin=(-1.0, -0.5))
    model = made_of(mesh, "plane_strain", NEO_HOOKEAN, strain="finite")
    rotation = {"angle": 2.0 * np.pi, "centre": (0.5, 0.2), "ramp": TURN}
    for group, side in (("TOP", 1.0), ("BOTTOM", -1.0)):
        plate = fc.obstacles.HalfSpace((0.0, 0.45 * side), (0.0, -side))
        with_obstacle(model, group, group, plate, rotation=rotation, friction=0.5, formulation=formulation)
    steps = fc.solve(model, [1.0, *np.linspace(1.0, 2.0, 9)[1:]])
    first, last = steps[0], steps[-1]
    for number, step in enumerate(steps):
        angle = np.pi / 4.0 * number
        expected = Rotation((0.0, 0.0), (0.0, 0.0, 1.0), 1.0).matrix(angle) @ first.contact["TOP"].force
        assert step.contact["TOP"].force == pytest.approx(expected, abs=1e-7)
        assert step.contact["TOP"].sticking.all()
    assert last.displacement == pytest.approx(first.displacement, abs=1e-9)
    assert last.stress == pytest.approx(first.stress, abs=1e-9)


@pytest.mark.parametrize("element", ["quad8", "hex8"])
def test_two_blocks_pressed_together_with_friction_turn_as_one(element: str) -> None:
    solid = element == "hex8"
    make, bottom, top = (fc.generate.box, "ZMIN", "ZMAX") if solid else (fc.generate.block, "BOTTOM", "TOP")
    size, fine, coarse = ((1.0, 1.0, 0.5), (3, 3, 1), (2, 2, 1)) if solid else ((1.0, 0.5), (4, 2), (3, 2))
    lower = fc.generate.renamed(make(size, fine, element=element), {bottom: "BASE", top: "JOINT"})
    upper = make(size, coarse, element=element, origin=(*[0.0] * (lower.dim - 1), 0.5))
    mesh = fc.generate.union(lower, fc.generate.renamed(upper, {bottom: "SOLE", top: "HEAD"}))
    model = made_of(mesh, "3d" if solid else "plane_strain", NEO_HOOKEAN, strain="finite")
    down = np.eye(mesh.dim)[-1]
    rotation = {"angle": 2.0 * np.pi, "ramp": TURN, **({"axis": AXIS} if solid else {})}
    model.prescribe("BASE", rotation={**rotation, "centre": CENTRE[: mesh.dim]})
    # Pressed by 0.1 along an axis that turns: R (X - p - c) + c is a turn about c + p, moved by -p.
    pressed = {"yz"[solid]: -0.1}
    model.prescribe(
        "HEAD", rotation={**rotation, "centre": tuple(CENTRE[: mesh.dim] + 0.1 * down)}, ramp=PRESS, **pressed
    )
    model.add_contact("joint", secondary="SOLE", primary="JOINT", friction=0.5)
    first, *_, last = fc.solve(model, [1.0, *np.linspace(1.0, 2.0, 7)[1:]])
    assert np.linalg.norm(first.contact["joint"].force) > 0.1
    assert last.contact["joint"].sticking.all()
    assert last.contact["joint"].force == pytest.approx(first.contact["joint"].force, abs=1e-7)
    assert last.displacement == pytest.approx(first.displacement, abs=1e-6)


@pytest.mark.filterwarnings("ignore:the largest")
def test_small_strain_models_tell_that_the_rotation_is_too_large() -> None:
    small = fc.solve(bar("plane_strain", "quad8", 1e-3, KIRCHHOFF, 2, "small"), 1)[-1]
    assert np.abs(small.stress).max() <= 1e-6
    last = fc.solve(bar("plane_strain", "quad8", 0.5, KIRCHHOFF, 2, "small"), 1)[-1]
    assert any("beyond" in text for text in last.warnings)


def test_groups_that_share_nodes_turn_together_or_are_refused() -> None:
    model = bar("plane_strain", "quad8", 1.0)
    model.prescribe("TOP", rotation={"angle": 1.0, "centre": CENTRE[:2]})
    last = fc.solve(model, 2)[-1]
    assert last.displacement == pytest.approx(turned(model.mesh.points, 1.0) - model.mesh.points, abs=1e-10)
    model.prescribe("BOTTOM", rotation={"angle": 1.1, "centre": CENTRE[:2]})
    refused(fc.ModelError, "remove one of the two", fc.solve, model, 2)


def test_supports_are_described_with_their_rotation() -> None:
    assert "rotated by 1.5 rad about (0.3, -1.0)" in bar("plane_strain", "quad8", 1.5).describe()


REFUSED = {
    "needs 'centre'": {"rotation": {"angle": 1.0}},
    "in 2D rotations are about z": {"rotation": {"angle": 1.0, "centre": (0.0, 0.0), "axis": (0, 0, 1)}},
    "did you mean 'centre'": {"rotation": {"angle": 1.0, "center": (0.0, 0.0)}},
    "give the displacement of its axis": {"rotation": {"angle": 1.0, "centre": (0.0, 0.0)}, "normal": 1.0},
}


@pytest.mark.parametrize("message", REFUSED)
def test_a_rotation_that_makes_no_sense_is_refused(message: str) -> None:
    refused(fc.ModelError, message, bar("plane_strain", "quad8", 1.0).prescribe, "RIGHT", **REFUSED[message])
