"""Children of multiprocessing give the results of their parent, or an error that states why they cannot."""

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


@pytest.mark.slow
def test_a_child_forked_before_the_threads_start_runs():
    assert "sizes" in found("fork", "small", before="nothing")["child"]


def test_a_child_forked_after_threads_started_is_refused_in_words_and_does_not_hang():
    child = found("fork", "small")["child"]
    assert child["error"] == "FastcontactError"
    assert "forked after its parent had started the threads" in child["text"]
    assert "'spawn' or 'forkserver'" in child["text"]


@pytest.mark.slow
def test_the_remedy_named_in_that_message_works():
    answer = found("fork", "small", NUMBA_THREADING_LAYER="workqueue")
    assert answer["child"] == answer["parent"]


@pytest.mark.slow
def test_a_forked_child_that_needs_no_parallel_kernel_runs():
    answer = found("fork", "plane")
    assert answer["child"] == answer["parent"]
