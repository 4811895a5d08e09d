"""Positions at which contact stops rigid bodies."""

import numpy as np
import pytest

from fastcontact.model.rigid_motions import stopped_at


def test_a_body_without_loads_stays_where_it_is() -> None:
    """One body is pressed through a gap of 0.1; another one moves and turns between two walls, at no cost."""
    gaps = np.array(
        [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.5], [0.0, -1.0, -0.5], [0.0, 1.0, -0.5], [0.0, -1.0, 0.5], [-1.0, 1.0, 0.0]]
    )
    gap = np.array([0.1, 0.2, 0.2, 0.2, 0.2, 0.3])
    assert stopped_at(gaps, gap, np.array([2.0, 0.0, 0.0]), 1.0) == pytest.approx([0.1, 0.0, 0.0], abs=1e-9)
