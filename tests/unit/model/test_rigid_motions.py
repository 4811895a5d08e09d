"""Motions that contact does not stop, and positions at which contact stops rigid bodies."""

import numpy as np
import pytest
import scipy.optimize

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
