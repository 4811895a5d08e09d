"""A step that fails where friction is nearly used up says so; one whose iterations diverge is halved."""

import pytest

import fastcontact as fc
from fastcontact.analysis import newton, step_halving


@pytest.mark.parametrize(
    ("push", "told"), [(0.58, "before it 97% of the friction that contact can bear is used"), (0.3, "")]
)
def test_the_message_states_how_much_friction_is_used(monkeypatch, push, told):
    """A block under the pressure 0.3 on a plane with the friction 0.3 slides at a push of 0.18 on its side."""
    model = fc.Model(fc.generate.block((2.0, 1.0), (8, 4)), kinematics="plane_strain", strain="finite")
    model.add_material(fc.NeoHookean(E=1e4, nu=0.45))
    model.add_pressure("TOP", 0.3, ramp=[(0.0, 0.0), (1.0, 1.0), (3.0, 1.0)])
    model.add_traction("LEFT", x=0.3, ramp=[(0.0, 0.0), (1.0, 0.0), (2.0, push), (3.0, push)])
    floor = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0))
    model.add_obstacle("floor", secondary="BOTTOM", obstacle=floor, friction=0.3)
    load_step = step_halving.load_step

    def failing(problem, state, index, end):
        if end == 3.0:
            raise fc.ConvergenceError("no equilibrium", [], smaller_steps_help=False)
        return load_step(problem, state, index, end)

    monkeypatch.setattr(step_halving, "load_step", failing)
    with pytest.raises(fc.ConvergenceError, match="no equilibrium") as failed:
        fc.solve(model, [1.0, 2.0, 3.0])
    assert told in str(failed.value)
    assert bool(told) == ("friction that contact can bear" in str(failed.value))


def test_a_verdict_about_a_diverged_iterate_does_not_end_the_analysis(monkeypatch):
    """An iterate far from equilibrium may seem to lie beyond the friction cone; a smaller step is tried."""
    model = fc.Model(fc.generate.block((2.0, 1.0), (8, 4)), kinematics="plane_strain", strain="finite")
    model.add_material(fc.NeoHookean(E=1e4, nu=0.45))
    model.fix("BOTTOM", "xy")
    model.add_pressure("TOP", 500.0)
    solved, calls = newton._Newton._solve, []

    def diverging(self, u, changes):
        calls.append(len(changes))
        if len(calls) == 2:
            raise fc.ConvergenceError("friction cannot hold it", smaller_steps_help=False)
        return solved(self, u, changes)

    monkeypatch.setattr(newton._Newton, "_solve", diverging)
    step = fc.solve(model, 1)[-1]
    assert calls[:3] == [1, 2, 1]
    assert step.iterations["substeps"][-1] == 1.0
