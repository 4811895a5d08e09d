"""Motions that contact does not stop, and positions at which contact stops rigid bodies."""

import numpy as np
import pytest
import scipy.optimize
from models import elastic_model
from refusals import refused

import fastcontact as fc
from fastcontact.model.rigid_motions import mechanisms, stopped_at


def test_a_body_without_loads_stays_where_it_is() -> None:
    """One body is pressed through a gap of 0.1; another one moves and turns between two walls, at no cost."""
    gaps = np.array(
        [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.5], [0.0, -1.0, -0.5], [0.0, 1.0, -0.5], [0.0, -1.0, 0.5], [-1.0, 1.0, 0.0]]
    )
    gap = np.array([0.1, 0.2, 0.2, 0.2, 0.2, 0.3])
    assert stopped_at(gaps, gap, np.array([2.0, 0.0, 0.0]), 1.0) == pytest.approx([0.1, 0.0, 0.0], abs=1e-9)


@pytest.mark.parametrize("opens", [False, True])
def test_one_linear_programme_shows_that_contact_stops_all_motions(opens, monkeypatch) -> None:
    """Gaps of random signs; if one opens, a motion closes none, and no load acts on it."""
    random, count, solve = np.random.default_rng(5), [], scipy.optimize.linprog
    monkeypatch.setattr(scipy.optimize, "linprog", lambda *args, **options: count.append(1) or solve(*args, **options))
    gaps, motion = random.standard_normal((60, 12)), random.standard_normal(12)
    if opens:
        gaps *= np.sign(gaps @ motion)[:, None]
    found = mechanisms(gaps, np.cross(motion[:3], [1.0, 2.0, 3.0])[None] @ np.eye(3, 12), np.eye(12))
    assert found.shape == (12, int(opens))
    assert (gaps @ found >= -1e-6).all()
    assert opens or len(count) == 1


@pytest.mark.parametrize("together", [False, True])
@pytest.mark.parametrize(
    ("dim", "formulation", "axis"),
    [
        (2, "node_to_segment", r"\(1, 0\)"),
        (2, "mortar", r"\(\S+, 0\)"),
        (3, "mortar", r"the line through .* along \(0, 1, 0\)"),
    ],
)
def test_a_tall_block_that_loads_tip_over_is_told(dim, formulation, axis, together) -> None:
    """The moment of the push about the edge is four times that of the weight."""
    if dim == 2:
        parts = fc.generate.block((1.0, 4.0), (2, 4)), fc.generate.block((3.0, 1.0), (6, 2), origin=(-1.0, -1.0))
        up, bottom, top = "y", "BOTTOM", "TOP"
    else:
        parts = (
            fc.generate.box((1.0, 1.0, 4.0), (2, 2, 4)),
            fc.generate.box((3.0, 1.0, 1.0), (6, 2, 1), origin=(-1.0, 0.0, -1.0)),
        )
        up, bottom, top = "z", "ZMIN", "ZMAX"
    named = (
        fc.generate.renamed(part, f"{name}_{{}}".format) for name, part in zip(("BLOCK", "BASE"), parts, strict=True)
    )
    model = elastic_model(fc.generate.union(*named), **{f"BASE_{bottom}": "xyz"[:dim]})
    model.add_contact("c", secondary=f"BLOCK_{bottom}", primary=f"BASE_{top}", formulation=formulation, friction=0.9)
    model.add_force(f"BLOCK_{top}", **{up: -1.0}, ramp=None if together else [(0, 0), (0.5, 1), (1, 1)])
    model.add_force(f"BLOCK_{top}", x=0.5, ramp=None if together else [(0, 0), (0.5, 0), (1, 1)])
    text = (
        rf"^the loads tip bodies over.*\(body 'BLOCK_\w+': rotation about {axis}, which opens the contact\): lower the"
    )
    refused(fc.ModelError if together else fc.ConvergenceError, text, fc.solve, model, 2)
