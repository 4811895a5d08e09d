"""The file that tests of result files write."""

from pathlib import Path

import pytest


@pytest.fixture
def path(tmp_path: Path) -> Path:
    """A result file that is not there yet."""
    return tmp_path / "run.vtkhdf"
