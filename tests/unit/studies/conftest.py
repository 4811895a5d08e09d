"""The case that studies begin with."""

import pytest


@pytest.fixture(scope="session")
def case(root):
    """The training case with quadratic cells."""
    return root / "data/cases/forma04c.toml"
