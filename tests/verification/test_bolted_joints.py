"""Pretension sections: a bar, and a bolted joint as two springs, force first, then locked; exact up to round-off."""

import contextlib

import numpy as np
import pytest
from models import elastic_model, supported, united

import fastcontact as fc

pytestmark = pytest.mark.each_value

E, LENGTH, FORCE = 1000.0, 2.0, 3.0


def bar(kinematics="plane_stress", element="quad4"):
    """Return a bar along y, cut in the middle; its width is 1, in axisymmetry its radius, in space its depth too."""
    if kinematics == "3d":
        mesh = fc.generate.box((1.0, LENGTH, 1.0), (2, 4, 2), element)
        mesh = fc.generate.renamed(mesh, {"YMIN": "BOTTOM", "YMAX": "TOP"})
    else:
        mesh = fc.generate.block((1.0, LENGTH), (2, 4), element)
    mesh = mesh.with_facet_group("CUT", lambda x: np.abs(x[:, 1] - LENGTH / 2) < 1e-9, between=True)
    model = elastic_model(fc.generate.cut(mesh, "CUT"), kinematics, E=E, nu=0.0)
    return supported(model, BOTTOM="xyz"[: mesh.dim], TOP="xyz"[: mesh.dim])


AREAS = {"plane_stress": 1.0, "plane_strain": 1.0, "axisymmetric": np.pi, "3d": 1.0}
ELEMENTS = {
    **dict.fromkeys(("plane_stress", "plane_strain", "axisymmetric"), ("tri3", "quad4", "tri6", "quad8")),
    "3d": ("hex8", "tet4", "tet10", "hex20", "wedge15"),
}


@pytest.mark.parametrize(("kinematics", "element"), [(k, e) for k, names in ELEMENTS.items() for e in names])
def test_a_bar_between_walls_is_stretched_by_the_force(kinematics, element):
    """``shortening = F L / (E A)``."""
    model = bar(kinematics, element)
    model.add_pretension("bolt", "CUT", force=FORCE)
    (step,) = fc.solve(model, 1)
    exact = FORCE * LENGTH / (E * AREAS[kinematics])
    assert step.pretension["bolt"] == pytest.approx({"force": FORCE, "shortening": exact}, rel=1e-9)
    assert step.stress[:, 1] == pytest.approx(np.full(model.mesh.n_points, FORCE / AREAS[kinematics]), rel=1e-8)


def test_a_shortening_makes_the_force():
    model = bar()
    model.add_pretension("bolt", "CUT", shortening=0.01)
    steps = fc.solve(model, 2)
    assert [s.pretension["bolt"]["force"] for s in steps] == pytest.approx([E * 0.005 / LENGTH, E * 0.01 / LENGTH])


def test_a_locked_bar_keeps_its_length_and_cools():
    """Locked at ``F L / (E A)``, then cooled by T: the force grows by ``E A alpha T``."""
    model = bar()
    model.materials.clear()
    model.add_material(fc.LinearElastic(E=E, nu=0.0, expansion=1e-4))
    model.add_pretension("bolt", "CUT", force=FORCE, locked_from=1.0, ramp=[(0.0, 0.0), (1.0, 1.0), (2.0, 0.0)])
    model.add_temperature(-20.0, ramp=[(0.0, 0.0), (1.0, 0.0), (2.0, 1.0)])
    before, after = fc.solve(model, [1.0, 2.0])
    assert after.pretension["bolt"]["shortening"] == pytest.approx(before.pretension["bolt"]["shortening"], rel=1e-12)
    assert after.pretension["bolt"]["force"] == pytest.approx(FORCE + E * 1e-4 * 20.0, rel=1e-9)
    table = fc.pretension_history([before, after])
    assert table.dtype.names == ("step", "load_factor", "bolt_force", "bolt_shortening")
    for row, step in zip(table, (before, after), strict=True):
        force = step.pretension["bolt"]["force"]
        assert row.tolist() == (step.index, step.load_factor, force, step.pretension["bolt"]["shortening"])
        held = fc.support_forces(model, step)  # neither the sides of the cut nor the lock are among them
        assert (held["TOP"][1], held["BOTTOM"][1]) == pytest.approx((force, -force), rel=1e-9)


SOLVERS = ("direct", "amg")


def joint(pull, formulation="mortar", locked_from=1.0, first=1.0, tight=1.0):
    """Return a bolt (1 wide) beside clamped plates (2 wide), all of height L, their tops moving as one.

    The plates' lower half stands on the ground and touches the upper one at the middle; the bolt stands on the ground.
    """
    half = LENGTH / 2
    bolt = fc.generate.block((1.0, LENGTH), (2, 4), name="BOLT")
    low = fc.generate.block((2.0, half), (3, 2), origin=(2.0, 0.0), name="LOW")
    across = 4 if formulation == "mortar" else 3  # only mortar passes a uniform pressure on meshes that do not match
    up = fc.generate.block((2.0, half), (across, 2), origin=(2.0, half), name="UP")
    mesh = united(**{"BOLT ": bolt, "LOW ": low, "UP ": up})
    mesh = mesh.with_facet_group("CUT", lambda x: (np.abs(x[:, 1] - half) < 1e-9) & (x[:, 0] < 1.5), between=True)
    mesh = mesh.with_facet_group("HEAD", lambda x: np.abs(x[:, 1] - LENGTH) < 1e-9)
    model = elastic_model(
        fc.generate.cut(mesh, "CUT"), "plane_stress", E=E, nu=0.0, **{"BOLT BOTTOM": "xy", "LOW BOTTOM": "xy"}, UP="x"
    )
    model.couple("HEAD", "y")
    model.add_contact("joint", secondary="UP BOTTOM", primary="LOW TOP", formulation=formulation)
    model.add_pretension(
        "bolt", "CUT", force=FORCE, locked_from=locked_from, ramp=[(0.0, 0.0), (first, tight), (2.0, 1.0)]
    )
    model.add_traction("HEAD", y=pull / 3.0, ramp=[(0.0, 0.0), (first, 0.0), (2.0, 1.0)])
    return model


@pytest.mark.filterwarnings("ignore:contact 'joint' has opened again at the end")
@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("formulation", ["mortar", "node_to_segment", "continuous"])
@pytest.mark.parametrize("pull", [-2.0, 1.5, 4.4, 6.0])
def test_a_bolted_joint_is_two_springs(pull, formulation, solver):
    """Bolt ``F + P kb / (kb + kp)`` and clamped plates ``F - P kp / (kb + kp)`` until they part, then the bolt has P alone.

    kb = E A / L of the bolt, kp that of the plates, twice as wide: shares of 1/3 and 2/3 (textbook joint diagram, as in
    VDI 2230).
    """
    tight, pulled = fc.solve(joint(pull, formulation), [1.0, 2.0], linear_solver=solver, linear_tolerance=1e-12)
    assert tight.pretension["bolt"]["force"] == pytest.approx(FORCE, rel=1e-8)
    assert tight.contact["joint"].force[1] == pytest.approx(FORCE, rel=1e-8)
    assert tight.pretension["bolt"]["shortening"] == pytest.approx(FORCE * LENGTH / E * (1.0 + 0.5), rel=1e-8)
    clamped = max(FORCE - pull * 2.0 / 3.0, 0.0)
    assert pulled.pretension["bolt"]["force"] == pytest.approx(clamped + pull, rel=1e-8)
    assert pulled.contact["joint"].force[1] == pytest.approx(clamped, rel=1e-8, abs=1e-12)


def test_a_bolt_without_a_force_is_loose_and_finger_tight_it_holds():
    """A bolt that is tightened after others, as in a flange, holds nothing before."""
    history = [(0.0, 0.0), (1.0, 1.0), (2.0, 1.0)]
    loose, held = (joint(0.0, locked_from=2.0, tight=tight) for tight in (0.0, 0.02))
    for model in (loose, held):
        model.add_force("HEAD", y=0.01 * FORCE, ramp=history)
    with pytest.raises(fc.ConvergenceError, match=r"pull bodies away.*pretension 'bolt' is 0: .* 0\.001 of the full"):
        fc.solve(loose, [1.0, 2.0])
    finger_tight, tight = fc.solve(held, [1.0, 2.0])
    assert finger_tight.contact["joint"].force[1] == pytest.approx(0.01 * FORCE, rel=1e-8)
    assert tight.contact["joint"].force[1] == pytest.approx(0.99 * FORCE, rel=1e-8)


def test_without_a_lock_the_force_stays():
    _, pulled = fc.solve(joint(1.5, locked_from=None), [1.0, 2.0])
    assert pulled.pretension["bolt"]["force"] == pytest.approx(FORCE, rel=1e-9)
    assert pulled.contact["joint"].force[1] == pytest.approx(FORCE - 1.5, rel=1e-9)


@pytest.mark.parametrize("solver", [SOLVERS[0], pytest.param(SOLVERS[1], marks=pytest.mark.slow)])
def test_the_number_of_steps_does_not_matter_and_a_run_goes_on_from_any(solver, tmp_path):
    model, options = joint(4.4), {"linear_solver": solver, "linear_tolerance": 1e-12}
    once = fc.solve(model, [1.0, 2.0], **options)
    paths = {done: tmp_path / f"{done}.vtkhdf" for done in (1, 2, 3, 4)}
    with contextlib.ExitStack() as opened:
        writers = {done: opened.enter_context(fc.ResultWriter(path, model)) for done, path in paths.items()}

        def write(step):
            for done, out in writers.items():
                if step.index <= done:
                    out.write(step)

        steps = fc.solve(model, [0.5, 1.0, 1.5, 1.75, 2.0], on_step=write, **options)
    assert steps[-1].displacement == pytest.approx(once[-1].displacement, rel=1e-9, abs=1e-14)
    for path in paths.values():
        whole = fc.solve(model, [0.5, 1.0, 1.5, 1.75, 2.0], resume=fc.open_results(path), **options)
        # The bolt keeps the shortening at which it was locked: read from displacements, that would be off by their round-off.
        np.testing.assert_array_equal(whole[-1].displacement, steps[-1].displacement)
        assert whole[-1].pretension == steps[-1].pretension
