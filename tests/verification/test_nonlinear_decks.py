"""Decks of nonlinear bodies without and with contact against CalculiX 2.20: displacements, forces, stresses at points."""

import json

import nonlinear_decks
import numpy as np
import pytest

pytestmark = pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")
CALCULIX = json.loads(nonlinear_decks.FILE.read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", nonlinear_decks.CASES)
def test_a_deck_agrees_with_calculix(name: str) -> None:
    """Reactions of loaded nodes contain the load in CalculiX; its plane stress is that of a thin solid."""
    steps, theirs = nonlinear_decks.here(name), CALCULIX[name]
    assert len(steps) == len(theirs)
    fields = ["displacement"] if name.startswith("strip") else ["displacement", "force"]
    for step, other in zip(steps, theirs, strict=True):
        for field in fields:
            wanted = np.array(other[field])
            assert np.abs(step[field] - wanted).max() <= 0.01 * np.abs(wanted).max()
    wanted = np.array(theirs[-1]["stress"])
    if wanted.size and "CPS8" not in name and " on " not in name:
        assert np.abs(steps[-1]["stress"] - wanted).max() <= 0.01 * np.abs(wanted).max()
