"""Couplings, moments and hydrostatic pressure: beam theory, statics, and rigid-body motions."""

import numpy as np
import pytest
from models import elastic_model

import fastcontact as fc
from fastcontact.cases.case import build_case

pytestmark = pytest.mark.pairwise

E, LENGTH, HEIGHT = 1000.0, 10.0, 1.0
INERTIA = HEIGHT**3 / 12
MOMENT, FORCE = 0.02, 0.003
KINDS = ("rigid", "distributing")


def beam(kind, place=(LENGTH + 2.0, 0.5), element="quad8"):
    """Return a beam held at its left end, coupled with a reference point at its right one; nu = 0."""
    mesh = fc.generate.block((LENGTH, HEIGHT), (10, 2), element)
    model = elastic_model(fc.generate.with_reference_points(mesh, {"REF": place}), "plane_stress", E=E, nu=0.0)
    model.fix("LEFT", "x")
    model.mesh = model.mesh.with_facet_group("END", lambda x: abs(x[:, 0]) < 1e-9)
    held = int(np.flatnonzero((np.abs(mesh.points - [0.0, 0.5]) < 1e-9).all(axis=1))[0])
    model.mesh = model.mesh.with_groups(points={"HELD": [held]})
    model.fix("HELD", "y")
    model.add_coupling("REF", "RIGHT", kind=kind)
    return model


def at_reference(model, step):
    return step.displacement[model.mesh.point("REF")], step.displacement[model.mesh.point("REF rotation"), 0]


@pytest.mark.parametrize("kind", KINDS)
def test_a_pure_moment_bends_a_beam_to_a_circle(kind):
    """Rotation M L / (E I) at the end, deflection M L^2 / (2 E I), and 2 [length] further on the arm adds its part."""
    model = beam(kind)
    model.add_moment("REF", z=MOMENT)
    (step,) = fc.solve(model, 1)
    moved, angle = at_reference(model, step)
    assert angle == pytest.approx(MOMENT * LENGTH / (E * INERTIA), rel=1e-9)
    assert moved[1] == pytest.approx(MOMENT * LENGTH**2 / (2 * E * INERTIA) + 2.0 * angle, rel=1e-9)
    assert step.stress[:, 0] == pytest.approx(
        -MOMENT
        / INERTIA
        * (model.mesh.points[:, 1] - 0.5)
        * (np.arange(model.mesh.n_points) < model.mesh.n_points - 2),
        abs=1e-9,
    )


@pytest.mark.parametrize("kind", KINDS)
def test_a_force_at_an_arm_is_a_force_and_a_moment(kind):
    """A pull of F at a height h over the middle: strain F / (E A), curvature F h / (E I)."""
    model = beam(kind, (LENGTH, 0.5 + 3.0))
    model.add_force("REF", x=FORCE)
    (step,) = fc.solve(model, 1)
    moved, angle = at_reference(model, step)
    assert angle == pytest.approx(-FORCE * 3.0 * LENGTH / (E * INERTIA), rel=1e-9)
    assert moved[0] == pytest.approx(FORCE * LENGTH / (E * HEIGHT) - 3.0 * angle, rel=1e-9)
    assert step.reaction[model.mesh.points_of("LEFT")].sum(axis=0) == pytest.approx([-FORCE, 0.0], abs=1e-12)


def test_a_moment_on_facets_is_that_on_a_distributing_coupling():
    model, other = beam("distributing"), beam("distributing")
    model.add_moment("REF", z=MOMENT)
    other.add_moment("RIGHT", z=MOMENT)
    steps = [fc.solve(own, 1)[0] for own in (model, other)]
    assert steps[0].displacement == pytest.approx(steps[1].displacement, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("element", ["hex8", "tet4", "tet10", "hex20", "wedge6"])
def test_in_space_a_body_follows_the_reference_point(kind, element):
    """Prescribed motions and rotations of the reference point move a free body as a rigid one, without stress."""
    place, angles, shift = np.array([0.3, -1.0, 4.0]), np.array([1e-3, -2e-3, 3e-3]), np.array([0.1, 0.2, -0.3])
    mesh = fc.generate.with_reference_points(fc.generate.box((1.0, 2.0, 1.5), (2, 2, 2), element), {"REF": place})
    model = elastic_model(mesh, "3d", E=E)
    model.add_coupling("REF", "ZMAX", kind=kind)
    model.prescribe("REF", **dict(zip("xyz", shift, strict=True)))
    model.prescribe("REF rotation", **dict(zip("xyz", angles, strict=True)))
    (step,) = fc.solve(model, 1)
    body = mesh.points_of("BOX")
    exact = shift + np.cross(angles, mesh.points[body] - place)
    assert step.displacement[body] == pytest.approx(exact, abs=1e-10)
    assert np.abs(step.stress).max() < 1e-8


@pytest.mark.parametrize("kind", KINDS)
def test_forces_and_moments_in_space_are_balanced_by_the_supports(kind):
    mesh = fc.generate.with_reference_points(fc.generate.box((1.0, 1.0, 2.0), (2, 2, 4)), {"REF": (0.2, 0.9, 2.5)})
    model = elastic_model(mesh, "3d", E=E, ZMIN="xyz")
    model.add_coupling("REF", "ZMAX", kind=kind)
    force, moment = np.array([0.1, -0.2, 0.3]), np.array([0.05, 0.02, -0.07])
    model.add_force("REF", **dict(zip("xyz", force, strict=True)))
    model.add_moment("REF", **dict(zip("xyz", moment, strict=True)))
    (step,) = fc.solve(model, 1)
    held = mesh.points_of("ZMIN")
    assert step.reaction[held].sum(axis=0) == pytest.approx(-force, rel=1e-9)
    turned = np.cross(mesh.points[held], step.reaction[held]).sum(axis=0)
    assert turned == pytest.approx(-moment - np.cross([0.2, 0.9, 2.5], force), rel=1e-8)


def test_components_of_a_rigid_coupling():
    model = beam("rigid")
    model.relations.clear()
    model.add_coupling("REF", "RIGHT", components="x")
    assert model.relations[0].rows.shape[0] == len(model.mesh.points_of("RIGHT"))


@pytest.mark.parametrize("level", [0.4, 1.0, 3.0])
def test_a_liquid_presses_by_its_depth(level):
    """The force on a wall of height 1 is weight * depth^2 / 2, less the part above the wall."""
    model = elastic_model(fc.generate.block((1.0, 1.0), (4, 20), "quad8"), "plane_strain", E=E, nu=0.0, RIGHT="xy")
    model.add_hydrostatic_pressure("LEFT", weight=2.0, level=level)
    (step,) = fc.solve(model, 1)
    exact = level**2 - max(level - 1.0, 0.0) ** 2
    assert step.reaction[:, 0].sum() == pytest.approx(-exact, rel=1e-9)


CASE = {
    "kinematics": "plane_stress",
    "mesh": {"generator": "box"},
    "material": [{"E": E, "nu": 0.0}],
    "support": [{"group": "LEFT", "x": 0.0, "y": 0.0}],
    "coupling": [{"reference": "REF", "group": "RIGHT", "place": [12.0, 0.5], "kind": "distributing"}],
    "moment": [{"group": "REF", "z": MOMENT}],
    "hydrostatic_pressure": [{"group": "TOP", "weight": 0.001, "level": 2.0, "axis": "y"}],
}


def test_a_case_file_has_couplings_moments_and_liquids():
    mesh = fc.generate.block((LENGTH, HEIGHT), (10, 2), "quad8")
    case = build_case(CASE, name="beam", mesh=mesh)
    same = elastic_model(fc.generate.with_reference_points(mesh, {"REF": (12.0, 0.5)}), "plane_stress", E=E, nu=0.0)
    same.fix("LEFT", "xy")
    same.add_coupling("REF", "RIGHT", kind="distributing")
    same.add_moment("REF", z=MOMENT)
    same.add_pressure("TOP", lambda x: 0.001 * (2.0 - x[:, 1]))
    steps = [fc.solve(model, 1)[0] for model in (case.model, same)]
    assert steps[0].displacement == pytest.approx(steps[1].displacement, rel=1e-12, abs=1e-15)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (
            lambda m: m.add_coupling("RIGHT", "LEFT"),
            "'RIGHT' is not a reference point: build the model on fc.generate.with_ref",
        ),
        (lambda m: m.add_coupling("REF", "LEFT", kind="stiff"), "unknown kind of coupling 'stiff'"),
        (lambda m: m.add_coupling("REF", "REF"), "the group needs points, without the reference point itself"),
        (lambda m: m.add_coupling("REF", "LEFT", components="z"), "unknown component 'z'"),
        (lambda m: m.add_coupling("REF", "LEFT", kind="distributing", components="x"), "has all components"),
        (lambda m: m.add_moment("REF", x=1.0), "in two dimensions a moment has the component z only"),
        (lambda m: m.add_moment("REF", z=np.nan), "the moment on 'REF' is nan"),
        (
            lambda m: m.add_hydrostatic_pressure("LEFT", weight=np.inf, level=1.0),
            "the weight of the hydrostatic pressure",
        ),
        (lambda m: m.add_hydrostatic_pressure("LEFT", weight=1.0, level=1.0, axis="z"), "unknown component 'z'"),
    ],
)
def test_what_is_refused(call, said):
    model = beam("rigid")

    def run():
        call(model)
        fc.solve(model, 1)

    with pytest.raises(fc.FastcontactError, match=said):
        run()


def test_nothing_turns_in_axisymmetry():
    mesh = fc.generate.with_reference_points(fc.generate.block(), {"REF": (0.0, 2.0)})
    model = fc.Model(mesh, "axisymmetric")
    with pytest.raises(fc.ModelError, match=r"in axisymmetry there are no rotations; use couple\('TOP', 'y'\)"):
        model.add_coupling("REF", "TOP")
    with pytest.raises(fc.ModelError, match="no moment can act on an axisymmetric model"):
        model.add_moment("TOP", z=1.0)


@pytest.mark.parametrize("said", ["component", "normal", "axes"])
def test_forces_of_supports_hold_neither_springs_nor_couplings(said):
    """A block on a support and a spring, its top coupled: the support carries what the spring does not."""
    model = elastic_model(fc.generate.block((2.0, 1.0), (4, 2)), "plane_stress")
    if said == "normal":
        model.fix("BOTTOM", "normal")
    elif said == "axes":
        model.prescribe("BOTTOM", y=0.0, axes=(1.0, 0.0))
    else:
        model.fix("BOTTOM", "y")
    model.fix("LEFT", "x")
    model.add_spring("RIGHT", y=5.0, x=2.0)
    model.couple("TOP", "y")
    model.add_traction("TOP", x=1.0, y=-3.0)
    (step,) = fc.solve(model, 1)
    found, springs = fc.support_forces(model, step), fc.spring_forces(model, step)
    assert found.keys() == {"BOTTOM", "LEFT"}
    right = step.displacement[model.mesh.points_of("RIGHT")]
    assert springs["spring on 'RIGHT'"].sum() == pytest.approx((right @ [2.0, 5.0]).sum(), rel=1e-12)
    pulled = right.sum(axis=0) * [2.0, 5.0]
    assert found["BOTTOM"] + found["LEFT"] == pytest.approx(np.array([-2.0, 6.0]) + pulled, rel=1e-9)
    assert found["BOTTOM"][0] == pytest.approx(0.0, abs=1e-9)
    assert found["LEFT"][1] == 0.0
    other = fc.Model(fc.generate.block((2.0, 1.0), (3, 2)), "plane_stress")
    for asked in (fc.support_forces, fc.spring_forces):
        with pytest.raises(fc.ModelError, match="pass the model of this step"):
            asked(other, step)
