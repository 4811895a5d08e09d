"""Random models end in correct results or errors of the package; `bench/random_models.py` solves two thousand."""

from dataclasses import replace
from types import SimpleNamespace

import mechanics
import nonlinear
import numpy as np
import pytest
from drawing import drawn
from models import elastic_model
from outcome import BOUNDS, SAME, figures, outcome, told, unfit
from stepping import watching
from wording import WORDS, SpokenModel

import fastcontact as fc

# The least part of models that must end in results: errors are for models that deserve them.
SOLVED = 0.85


def check(seeds):
    rows = [outcome(seed) for seed in seeds]
    assert not [row for row in rows if row["outcome"] not in ("result", "told", "own error")]
    assert sum(row["outcome"] == "result" for row in rows) >= SOLVED * len(rows)
    return rows


def test_random_models_end_right():
    rows = check(range(2, 12))
    assert {row["kinematics"] for row in rows if "kinematics" in row} >= {"plane_strain", "axisymmetric", "3d"}
    assert sum(row.get("closed", 0) > 0 for row in rows) >= 0.8 * len(rows)


def test_once_wrong_models_end_right():
    """A soft body on a stiff one, by multigrid; constraints that penetrate from the start; dual functions of a numbering;
    pairs of which one is open and has a compliance."""
    check([100358, 101460, 101521, 101568, 102727, 102979, 790048])


@pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")
def test_layers_without_force_have_no_determined_position():
    """Between them and what pushes them are gaps; contact forces are less than what multigrid leaves out of balance."""
    given = drawn(310377)
    last = fc.solve(given.model, given.ramp, **given.options)[-1]
    assert any("nothing determines the position of bodies in load step 1" in text for text in last.warnings)
    check([310377])


# Adhesion whose stiffness in compression depended on the directions of facets, and without loads; laws of every kind; a layer
# with nodes that are held at both ends of a sector.
@pytest.mark.parametrize(
    ("law", "seeds"),
    [
        ("adhesion", [620012, 620022, 630048]),
        ("cohesion", [640036]),
        *((law, [610000, 610003]) for law in ("cohesion", "penalty", "tangential penalty", "wear", "friction ramp")),
    ],
)
def test_random_models_with_interface_laws_end_right(law, seeds):
    assert all(outcome(seed, law)["outcome"] == "result" for seed in seeds)


@pytest.mark.slow
@pytest.mark.parametrize("first", range(1000, 1300, 50))
def test_more_random_models_end_right(first):
    check(range(first, first + 50))


@pytest.mark.parametrize(
    "seeds",
    [
        [*range(4), 71],
        *(pytest.param(k, marks=pytest.mark.slow) for k in (range(4, 24), range(24, 44), range(44, 64), [70238])),
    ],
)
def test_random_models_of_bodies_that_yield_or_stretch_end_right(seeds):
    rows = [nonlinear.outcome(seed) for seed in seeds]
    assert not [row for row in rows if row["wrong"]]
    assert sum("error" not in row for row in rows) >= SOLVED * len(rows)


@pytest.mark.parametrize("words", WORDS)
def test_a_model_in_other_words_has_the_same_answer(words):
    given = drawn(47)
    again = WORDS[words](given.model, np.random.default_rng(1))
    step, other = fc.solve(given.model, 1)[-1], fc.solve(again.model, 1)[-1]
    largest = np.abs(step.displacement).max()
    assert np.abs(again.back(other.displacement) - step.displacement).max() < SAME * largest
    assert any(found.active.any() for found in step.contact.values())
    spoilt = replace(again, Q=again.Q @ [[0, -1], [1, 0]])
    assert np.abs(spoilt.back(other.displacement) - step.displacement).max() > 0.1 * largest


# With friction where both sides are held, turned: a plate on a ball that moves along no axis, a ball between planes of
# symmetry, a sector. A smoothed strip of single triangles, integrated from other corners on; a facet whose curvature is a
# rounding error, or cannot be told from three facets. Held nodes where nothing is driven; points of tiny areas; tied sides
# with an offset. A node, and the middle of a facet, opposite the node where two facets of a line meet. Points beyond the
# edge of triangles, along averaged normals. A body that rolls on a corner, whose position alternated. Dependent equations of
# a tie; two pairs on one facet, with friction; increments of friction on a geometry that had not converged; forces on a stiff
# secondary side that scatter. Points beyond the edge of a side of triangles, which alternated between two of them.
@pytest.mark.parametrize(
    "seed",
    [
        *(1107, 1514, 30224, 1474, 30004, 40215, 43177, 43777, 50153, 42089, 44132, 90019, 90330, 90792, 103260),
        *(102414, 103109, 320048, 320459),
        pytest.param(102525, marks=pytest.mark.slow),
    ],
)
def test_models_that_had_another_answer_in_other_words(seed):
    assert outcome(seed)["outcome"] == "result"


# Nodes at both ends of a sector that flip between two facets; a weighted gap magnified where half a quadratic facet is
# covered; facets at the edge of a punch, beyond which gaps are infinite; facets that meet a plane of symmetry at an angle;
# positions of two floating layers that alternated; a linearised geometry of facets of which strips are covered;
# points beyond the end of a side that alternated between two facets of its edge; centres of segments as the only points of
# partly covered facets (two models); contact states that alternate; nearly dependent constraints with friction; layers that
# float above a gap a hundred times as wide as a spring's elongation; nodes of which a small part faces the other side in
# every other pairing (three models); a pressure field beside pairs whose points are all open.
@pytest.mark.parametrize(
    "seed",
    [
        *(40068, 90675, 50073, 300026, 300028, 300063, 101378, 103058, 320200, 320293, 320421, 310180, 103449, 780047),
        pytest.param(100162, marks=pytest.mark.slow),
    ],
)
def test_models_that_had_no_result(seed):
    assert outcome(seed)["outcome"] == "result"


def test_bilateral_pairs_that_close_wide_gaps_are_told():
    """A block bound to a cylinder far from their point of contact; the message names what helps."""
    given = drawn(300443)
    with pytest.raises(fc.ConvergenceError, match=r'kind="bilateral_once_closed" for contact .* gaps of up to'):
        fc.solve(given.model, given.ramp)
    (pair,) = given.model.contact
    given.model.contact[0] = replace(pair, options=pair.options | {"kind": "bilateral_once_closed"})
    assert fc.solve(given.model, given.ramp)[-1].contact[pair.name].active.any()


@pytest.mark.parametrize(
    ("seed", "remedy"),
    [
        (320432, lambda given: {"secondary": given["primary"], "primary": given["secondary"]}),
        (101032, lambda _: {"integration": "simpson"}),
    ],
)
def test_remedies_that_messages_about_quadratic_triangles_name_work(seed, remedy, monkeypatch):
    refused, add = [], SpokenModel.add_contact

    def added(model, name, **given):
        try:
            add(model, name, **given)
        except fc.ContactError as error:
            refused.append(str(error))
            add(model, name, **given | remedy(given))

    monkeypatch.setattr(SpokenModel, "add_contact", added)
    assert outcome(seed)["outcome"] == "result"
    assert all("tri6" in text for text in refused)
    assert refused


def test_cells_begin_at_other_corners():
    given = drawn(1514).model
    again = WORDS["renumbered"](given, np.random.default_rng(1))
    place, other = given.mesh.points, again.model.mesh.points
    for name, cells in given.mesh.cells.items():
        firsts = {tuple(place[cell[0]]) + tuple(place[cell].mean(axis=0).round(9)) for cell in cells}
        others = {
            tuple(other[cell[0]]) + tuple(other[cell].mean(axis=0).round(9)) for cell in again.model.mesh.cells[name]
        }
        assert not firsts & others


def test_a_seed_is_a_model():
    one, other = drawn(3), drawn(3)
    assert one.model.describe() == other.model.describe()
    np.testing.assert_array_equal(one.model.mesh.points, other.model.mesh.points)
    assert one.ramp == other.ramp
    assert one.labels == other.labels


def moved(by, lower, upper, **options):
    mesh = fc.generate.block_on_block(divisions_lower=lower, divisions_upper=upper)
    model = elastic_model(mesh, LOWER_BOTTOM="xy", UPPER_TOP=by)
    model.add_contact("pair", secondary="CONT_UPPER", primary="CONT_LOWER", **options)
    with watching() as watched:
        step = fc.solve(model, 1)[-1]
    return model, step, watched


@pytest.fixture(scope="module")
def rubbing():
    """Two blocks that do not match, one drawn over the other."""
    return moved({"x": 0.05, "y": -0.05}, (6, 3), (5, 3), friction=0.2)


def spoilt(found, **changes):
    """A contact result, a step or a solution with other values."""
    return replace(found, **changes)


def test_what_is_right_vanishes(rubbing):
    found = figures(*rubbing, 1.0)
    assert all(found[name] <= bound for name, bound in BOUNDS.items())
    assert not unfit(rubbing[1])


WRONG = {
    "balance": lambda step: spoilt(step, reaction=step.reaction * (1 + 1e-5)),
    "given back": lambda step: pair(step, primary_force_vectors=lambda own: own * (1 + 1e-8)),
    "moment": lambda step: pair(step, force_vectors=lambda own: own[::-1] * np.linspace(0.5, 1.5, len(own))[:, None]),
    "carried": lambda step: pair(step, pressure=lambda own: own * 1.001),
}


def pair(step, **changes):
    """The step with the contact result changed."""
    own = step.contact["pair"]
    return replace(
        step, contact={"pair": replace(own, **{name: by(getattr(own, name)) for name, by in changes.items()})}
    )


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_shows(rubbing, name):
    model, step, watched = rubbing
    assert figures(model, WRONG[name](step), watched, 1.0)[name] > BOUNDS[name]


def test_gaps_that_displacements_do_not_have_show(rubbing):
    model, step, watched = rubbing
    wrong = SimpleNamespace(settled=watched.settled, u=1.01 * watched.u)
    assert figures(model, step, wrong, 1.0)["displaced"] > BOUNDS["displaced"]


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("penetration", {"gap": -1e-6}),
        ("tension", {"multiplier": -1e-6}),
        ("product", {"gap": 1e-6}),
        ("cone", {"tangential": 1e-5}),
        ("driving", {"slip": 1.0}),
    ],
)
def test_what_breaks_an_inequality_shows(rubbing, name, change):
    model, step, watched = rubbing
    ((what, by),) = change.items()
    state = watched.settled.solution
    values = getattr(state, what).copy()
    if what == "slip":
        values = by * state.tangential / np.abs(state.tangential).max()
    elif what == "tangential":
        values = values + by * np.sign(values) * state.multiplier.max()
    else:
        values[np.argmax(state.multiplier)] = by * (1.0 if what == "gap" else state.multiplier.max())
    wrong = replace(watched.settled, solution=replace(state, **{what: values}))
    assert figures(model, step, SimpleNamespace(settled=wrong, u=watched.u), 1.0)[name] > BOUNDS[name]


def test_only_the_moment_of_a_contact_that_is_called_too_coarse_is_told(rubbing):
    _, step, _ = rubbing
    coarse = replace(step, warnings=("contact 'a' has only 1 element across its radius: its pressure needs 4 or more",))
    assert told(["moment"], coarse)
    assert not told(["moment"], replace(step, warnings=("another",)))
    assert not told(["moment", "cone"], coarse)


def test_results_that_are_not_finite_show(rubbing):
    _, step, _ = rubbing
    assert unfit(spoilt(step, displacement=step.displacement * np.nan)) == ["displacement not finite"]
    assert "pressure on open nodes" in unfit(pair(step, active=lambda own: ~own))
    assert unfit(pair(step, dissipation=lambda own: -own)) == ["negative dissipation"]


def test_forces_that_are_round_off_are_none():
    """A body moved freely: what is left of its internal forces is compared with what they are the sum of."""
    model, step, watched = moved_freely()
    _, sizes = mechanics.out_of_balance(model, step, 1.0)
    assert sizes.force == np.inf
    assert figures(model, step, watched, 1.0)["balance"] == 0.0


def moved_freely():
    with pytest.warns(fc.FastcontactWarning):
        return moved({"x": 0.1, "y": 0.3}, (3, 2), (2, 2))
