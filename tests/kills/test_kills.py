"""A run killed at any instant leaves a file that opens, is correct up to its last step, and can be resumed."""

import os

import kill_cases
import killing
import pytest

pytestmark = [
    pytest.mark.skipif(os.name != "posix", reason="needs SIGKILL"),
    pytest.mark.skipif(bool(int(os.environ.get("NUMBA_DISABLE_JIT") or 0)), reason="too slow without compiled kernels"),
]


def check(name, count, folder):
    known = killing.reference(kill_cases.prepared(name, folder), folder)
    assert len(known.steps) > 5
    found = killing.run(known, count, 1, folder)
    assert not found.failures
    assert found.kills == count
    assert found.opened + found.no_file == count
    assert found.right_ends == count
    assert found.opened >= count // 3, "some runs must have come to write something"
    return found


def test_a_kill(tmp_path):
    check("small", 1, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["small", "friction"])
def test_many_kills(name, tmp_path):
    found = check(name, 25, tmp_path)
    assert found.steps > 25
    assert found.of_resumed > 2
