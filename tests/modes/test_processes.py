"""Children of multiprocessing give the results of their parent."""

import json
import sys

import pytest
from starting import finished, start

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="forking after threads is safe or absent elsewhere")


def found(method, run, before="run", **environment):
    output, errors = finished(start("children.py", method, run, before, **environment))
    answer = json.loads(output)
    assert answer["code"] == 0, errors
    return answer


@pytest.mark.slow
@pytest.mark.parametrize("method", ["spawn", "forkserver"])
def test_started_children_find_the_same_bits(method):
    answer = found(method, "small")
    assert answer["child"] == answer["parent"]


def test_a_child_forked_after_threads_started_starts_its_own():
    answer = found("fork", "small", NUMBA_NUM_THREADS="2")
    assert answer["child"] == answer["parent"]
