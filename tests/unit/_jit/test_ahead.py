"""Kernels compiled ahead by helpers: the table describes the kernels correctly, and helpers cache them."""

import importlib
import inspect
import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numba
import numpy as np
import pytest
from new_process import printed

from fastcontact._jit import ahead, compiling, decorators
from fastcontact.contact.search.box_tree_kernels import Tree

jitted = pytest.mark.skipif(not decorators.jit_enabled(), reason="kernels are not compiled")


@pytest.mark.parametrize("run", ["2d", "3d", "3d amg"])
def test_the_table_tells_kernels_as_they_are(run):
    numbers = ahead.kernel_numbers([run])
    assert len(numbers) > 15
    for module, name, given in (ahead.table()["kernels"][number] for number in numbers):
        kernel = getattr(importlib.import_module(module), name)
        assert len(inspect.signature(getattr(kernel, "py_func", kernel)).parameters) == len(given), (module, name)
        for one in given:
            ahead.numba_type(one)


def test_all_kinds_of_runs_together_are_the_whole_table():
    assert sorted(ahead.kernel_numbers([])) == list(range(len(ahead.table()["kernels"])))
    assert ahead.kernel_numbers(["no such kind"]) == []


def test_types_are_those_of_arguments():
    fixed = np.zeros((2, 2), np.int32)
    fixed.flags.writeable = False
    low = np.zeros((2, 2))
    for entry, argument in (
        ("f8", 1.0), ("i8", 1), ("b1", True), (["f8", 1], np.zeros(2)), (["b1", 2], np.zeros((2, 2), bool)),
        (["i4", 2, "r"], fixed), ({"": ["i8", "i8"]}, (1, 2)), ({"": ["i8", "f8"]}, (1, 2.0)),
        ({"fastcontact.contact.search.box_tree_kernels.Tree": [["f8", 2], ["f8", 2]]}, Tree(low, low)),
    ):  # fmt: skip
        assert ahead.numba_type(entry) == numba.typeof(argument)


@jitted
def test_a_helper_leaves_kernels_on_disk_and_tells_each(tmp_path):
    number = next(number for number, (_, name, _) in enumerate(ahead.table()["kernels"]) if name == "work_sizes")
    code = (
        "import sys; from fastcontact._jit import ahead\n"
        f"ahead.kernel_numbers = lambda runs: [{number}]\n"
        "ahead.main(['1', '0'])"
    )
    assert printed(code, NUMBA_CACHE_DIR=tmp_path) == f"{number}\n"
    assert [path.name.split(".")[1] for path in tmp_path.rglob("*.nbc")] == ["work_sizes"]


@pytest.fixture
def started(monkeypatch):
    """What `request_helpers` starts, in a process that has two threads and has compiled nothing yet."""
    found = []
    monkeypatch.setattr(ahead, "start", lambda runs, helpers: found.append((runs, helpers)) or [])
    monkeypatch.setattr(ahead, "MAX_HELPERS", 3)
    monkeypatch.setattr(ahead.decorators, "threads", lambda: 2)
    monkeypatch.setattr(ahead.kernel_files, "files", {len: None})
    monkeypatch.setattr(compiling, "count", 0)
    monkeypatch.setattr(compiling, "helper_requests", [])
    monkeypatch.setattr(compiling, "waiters", [])
    monkeypatch.setattr(compiling, "listeners", [])
    monkeypatch.setattr(ahead, "_runs_with_helpers", set())
    return found


def test_help_comes_when_more_than_a_few_kernels_are_compiled(started):
    ahead.request_helpers(["2d"])
    for _ in range(ahead.MAX_WITHOUT_HELPERS):
        compiling.notify()
    assert started == []
    compiling.notify()
    compiling.notify()
    assert started == [(["2d"], 1)]


def test_help_comes_at_once_where_many_were_compiled_before(started, monkeypatch):
    monkeypatch.setattr(compiling, "count", ahead.MAX_WITHOUT_HELPERS + 1)
    ahead.request_helpers(["3d"])
    assert started == [(["3d"], 1)]


def test_help_comes_once_for_each_kind_of_runs(started, monkeypatch):
    monkeypatch.setattr(compiling, "count", 100)
    for _ in range(3):
        ahead.request_helpers(["2d"])
    ahead.request_helpers(["3d", "2d"])
    assert started == [(["2d"], 1), (["3d"], 1)]


def test_no_help_where_python_may_run_all_that_is_not_kept(started, monkeypatch):
    numbers = []
    monkeypatch.setattr(ahead, "_is_cached", lambda number: numbers.append(number) or True)
    monkeypatch.setattr(compiling, "count", 100)
    ahead.request_helpers(["2d"])
    assert started == []
    assert numbers == ahead.required_kernels(["2d"])


@pytest.mark.parametrize("spoilt", ["one thread", "works for another", "not kept", "part of a program"])
def test_no_help(started, monkeypatch, spoilt):
    if spoilt == "one thread":
        monkeypatch.setattr(ahead.decorators, "threads", lambda: 1)
    elif spoilt == "works for another":
        monkeypatch.setattr("multiprocessing.parent_process", object)
    elif spoilt == "not kept":
        monkeypatch.setattr(ahead.kernel_files, "files", {})
    else:
        monkeypatch.setattr(ahead.sys, "executable", "/opt/cad/cad")
    monkeypatch.setattr(compiling, "count", 100)
    ahead.request_helpers(["2d"])
    assert started == []
    assert compiling.helper_requests == []


class Process:
    """A helper whose lines the test writes."""

    def __init__(self):
        self.output, self.input = os.pipe(), os.pipe()
        self.stdout, self.stdin = os.fdopen(self.output[0]), os.fdopen(self.input[1], "w")
        self.told = os.fdopen(self.input[0])

    def say(self, *numbers):
        os.write(self.output[1], "".join(f"{number}\n" for number in numbers).encode())

    def end(self):
        os.close(self.output[1])


@pytest.fixture
def helped(monkeypatch):
    """A helper, its run, and what the run compiles itself; the file of kernel n is called "kernel n"."""
    process, compiled = Process(), []
    monkeypatch.setattr(ahead, "required_kernels", lambda runs: [1, 2])
    monkeypatch.setattr(ahead, "kernel_numbers", lambda runs: [1, 2, 3])
    monkeypatch.setattr(ahead, "_file_name", lambda number: f"kernel {number}")
    monkeypatch.setattr(ahead, "compile_kernel", compiled.append)
    monkeypatch.setattr(compiling, "listeners", [])
    return process, ahead.Helpers(["2d"], [process]), compiled


def begun(run, number):
    """Wait until the run has heard that a helper has begun a kernel."""
    with run._changed:
        assert run._changed.wait_for(lambda: number in run._current.values(), timeout=60)


def test_a_run_waits_for_the_kernel_that_a_helper_is_at_and_compiles_another_one(helped):
    process, run, compiled = helped
    process.say(1)
    begun(run, 1)
    waiting = ThreadPoolExecutor(1).submit(run.wait, "kernel 1")
    assert process.told.readline() == "2\n"
    process.say(3)
    assert waiting.result(timeout=60)
    assert compiled == [2]  # what Python may run in its place is none that it will need
    process.end()


def test_a_run_compiles_what_no_helper_has_begun_and_tells_them(helped):
    process, run, compiled = helped
    assert not run.wait("kernel 3")
    assert process.told.readline() == "3\n"
    assert not run.wait("another kernel")
    assert compiled == []
    process.end()


def test_a_helper_that_ends_keeps_nobody_waiting(helped):
    process, run, _ = helped
    process.say(2)
    begun(run, 2)
    process.end()
    run.wait("kernel 2")
    assert not run.wait("kernel 2")


@jitted
def test_a_helper_leaves_out_what_the_run_compiles(tmp_path):
    code = (
        "from fastcontact._jit import ahead\n"
        "ahead.kernel_numbers = lambda runs: [0, 1]\n"
        "ahead.compile_kernel = lambda number: (time.sleep(2.0), done.append(number))\n"
        "import time; done = []\n"
        "ahead.main(['1', '0']); print(done)"
    )
    assert printed(code, given="1\n") == "0\n1\n[0]\n"


@jitted
@pytest.mark.slow
def test_a_run_finds_all_its_kernels(tmp_path):
    """Both kinds of elements of the training cases: nothing is left to compile, so no type in the table is another one."""
    variables = {"NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_NUM_THREADS": "1"}
    helper = [sys.executable, "-m", "fastcontact._jit.ahead", "1", "0", "2d"]
    subprocess.run(helper, env=os.environ | variables, capture_output=True, check=True)
    code = (
        "import json; from fastcontact._jit import compiling; from fastcontact.cli import main\n"
        "codes = [main(['run', name, '-q', '-o', 'a.vtkhdf']) for name in ('forma04a', 'press-fit')]\n"
        "print(json.dumps([*codes, compiling.count]))"
    )
    assert json.loads(printed(code, folder=tmp_path, **variables)) == [0, 0, 0]
