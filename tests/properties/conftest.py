"""Shared settings of property tests: helpers of verification tests; no warnings of coarse meshes and large strains."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "verification"))


def pytest_collection_modifyitems(items):
    """Random problems are coarse, distorted, far strained and may never touch; that is told elsewhere."""
    here = str(Path(__file__).parent)
    for item in items:
        if str(item.path).startswith(here):
            item.add_marker(pytest.mark.filterwarnings("ignore::fastcontact.errors.FastcontactWarning"))
