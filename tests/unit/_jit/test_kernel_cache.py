"""Cached kernels: compiled again after changes, the same bits in every process, messages."""

import importlib
import io
import logging
import os
import pkgutil
import shutil
import sys
from importlib import import_module

import numba
import pytest
from new_process import printed
from pairwise import first_of

import fastcontact
from fastcontact._jit import cache, compiling, decorators

jitted = pytest.mark.skipif(not decorators.jit_enabled(), reason="kernels are not compiled")
CALLER = """
from callee import part
from fastcontact._jit.decorators import kernel

@kernel
def whole(x):
    return 10.0 * part(x)
"""
CALLEE = """
from fastcontact._jit.decorators import inlined_kernel, kernel

@{decorator}
def part(x):
    return x + {number}
"""
ASK = "import caller; print(caller.whole(1.0), sum(caller.whole.stats.cache_hits.values()))"
CALLED, CALLS = ("callee", "part"), ("caller", "whole")


def write(folder, decorator="kernel", number=1, caller=CALLER):
    (folder / "caller.py").write_text(caller)
    (folder / "callee.py").write_text(CALLEE.format(decorator=decorator, number=number))


OWN = """
import sys
import numpy as np
from fastcontact._jit.decorators import kernel

@kernel
def root(A):
    if A.shape[0] != A.shape[1]:
        raise ValueError("not square")
    return np.linalg.cholesky(A)

@kernel
def twice(A):
    return root(root(A))
"""
LOAD = """
from own import np, root, sys, twice
A = np.array([[2.0, 1.0], [1.0, 3.0]])
print(root(A).tolist(), sum(root.stats.cache_hits.values()), "numba.np.linalg" in sys.modules)
try:
    root(A[:1])
except ValueError as error:
    print(error)
print(np.allclose(twice(A), np.linalg.cholesky(np.linalg.cholesky(A))), sum(twice.stats.cache_hits.values()))
"""


def test_a_kernel_is_loaded_without_the_modules_of_numba_that_it_was_compiled_with(tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    variables = {"NUMBA_CACHE_DIR": tmp_path / "cache", "NUMBA_DISABLE_JIT": 0}
    programs = (
        LOAD.rpartition("print(np.allclose")[0],
        LOAD,
        LOAD,
    )  # a kernel that calls it is compiled once it is loaded
    said = [printed(program, folder=tmp_path, **variables).splitlines() for program in programs]
    values = said[0][0].rpartition("]]")[0]
    assert said[0] == [f"{values}]] 0 True", "not square"]
    assert said[1] == [f"{values}]] 1 False", "not square", "True 0"]
    assert said[2] == [f"{values}]] 1 False", "not square", "True 1"]


def forget():
    """Forget what a process remembers of modules and of the cache."""
    for name in ("caller", "callee", "constants"):
        sys.modules.pop(name, None)
    for remembered in (cache.cache_folder, cache.is_trusted, cache._log_once, cache._digest_of_file):
        remembered.cache_clear()
    decorators._cache_reported = False


def asked(folder, kernel=CALLS):
    """Return what a kernel of a folder gives for 1, and how often it was found on disk, as in a new process."""
    forget()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(numba.config, "CACHE_DIR", str(folder / "cache"))
        patch.setattr(cache, "files", {})
        patch.setattr(sys, "dont_write_bytecode", True)
        patch.syspath_prepend(folder)
        function = getattr(import_module(kernel[0]), kernel[1])
        found = function(1.0), sum(function.stats.cache_hits.values())
    forget()
    return found


@jitted
def test_a_new_process_finds_kernels_and_notices_changes_in_other_files(tmp_path):
    write(tmp_path)
    assert asked(tmp_path) == (20.0, 0)
    variables = {"NUMBA_CACHE_DIR": tmp_path / "cache", "NUMBA_DISABLE_JIT": 0}
    assert printed(ASK, folder=tmp_path, **variables) == "20.0 1\n"
    write(tmp_path, number=22)
    assert asked(tmp_path) == (230.0, 0)


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    folder = tmp_path_factory.mktemp("compiled")
    write(folder)
    assert asked(folder, CALLED) == (2.0, 0)
    return folder


@pytest.fixture
def written(compiled, tmp_path):
    """A folder with both files, and the called kernel on disk: it outlives an installation of the same sources."""
    shutil.copytree(compiled, tmp_path / "again", copy_function=shutil.copy)
    return tmp_path / "again"


@jitted
def test_the_cache_notices_changes_of_inlined_kernels(tmp_path):
    write(tmp_path, "inlined_kernel")
    assert asked(tmp_path) == (20.0, 0)
    assert asked(tmp_path) == (20.0, 1)
    write(tmp_path, "inlined_kernel", 2)
    assert asked(tmp_path) == (30.0, 0)


@jitted
def test_a_kernel_on_disk_can_be_called_by_one_that_is_compiled(written):
    assert asked(written, CALLED) == (2.0, 1)
    assert asked(written) == (20.0, 0)
    assert asked(written) == (20.0, 1)


@jitted
@pytest.mark.skipif(not hasattr(os, "getuid"), reason="needs owners and modes of files")
@pytest.mark.parametrize(
    ("inside", "mode", "used"), first_of(2, [(True, 0o777, False), (False, 0o777, False), (False, 0o1777, True)])
)
def test_a_cache_that_others_may_write_to_is_not_used(written, inside, mode, used, caplog):
    """What lies in a cache is run: somebody else could have put it there. A sticky folder keeps the names of each owner."""
    folder = written / "cache"
    for path in (path for path in folder.rglob("*") if path.is_dir()) if inside else [folder]:
        path.chmod(mode)
    with caplog.at_level(logging.INFO, "fastcontact"):
        assert asked(written, CALLED) == (2.0, int(used))
    assert ("other users may write to the folder of compiled kernels" in caplog.text) != used


@jitted
@pytest.mark.parametrize("option", ["OPT", "BOUNDSCHECK"])
def test_the_cache_notices_how_kernels_are_compiled(written, option, monkeypatch):
    monkeypatch.setattr(numba.config, option, 1)
    assert asked(written, CALLED) == (2.0, 0)
    assert asked(written, CALLED) == (2.0, 1)


@pytest.mark.slow
@jitted
def test_the_cache_notices_a_constant_of_another_file(tmp_path):
    write(tmp_path, caller="from constants import NUMBER\n" + CALLER.replace("10.0 *", "NUMBER *"))
    for number in (3.0, 5.0):
        (tmp_path / "constants.py").write_text(f"NUMBER = {number}\n")
        assert asked(tmp_path) == (2 * number, 0)


HARM = {
    "empty": lambda path: path.write_bytes(b""),
    "cut": lambda path: path.write_bytes(path.read_bytes()[:-7]),
    "zeroed": lambda path: path.write_bytes(bytes(path.stat().st_size)),
    "flipped": lambda path: path.write_bytes(path.read_bytes()[:-900] + b"\xff" + path.read_bytes()[-899:]),
    "writable": lambda path: path.chmod(0o666),
    "a folder": lambda path: (path.unlink(), path.mkdir()),
}


@jitted
@pytest.mark.skipif(not hasattr(os, "getuid"), reason="needs owners and modes of files")
@pytest.mark.parametrize("harm", first_of(2, list(HARM)))
def test_a_file_that_is_damaged_or_of_others_costs_a_compilation_and_a_line(written, harm, caplog):
    (path,) = (written / "cache").rglob("*.nbc")
    HARM[harm](path)
    with caplog.at_level(logging.INFO, "fastcontact"):
        assert asked(written, CALLED) == (2.0, 0)
    told = [line for line in caplog.messages if "compiling instead" in line]
    assert len(told) == 1 + (harm == "a folder"), told
    assert str(path.parent) in told[0]
    if harm != "a folder":
        assert asked(written, CALLED) == (2.0, 1)


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def told(monkeypatch):
    """What a process that has compiled nothing yet says when two kernels are compiled, given its error output."""
    monkeypatch.setattr(compiling, "_announced", False)
    monkeypatch.setattr(compiling, "listeners", [compiling.print_announcement])
    monkeypatch.setattr(compiling.log, "handlers", [])  # those of other tests may be closed
    monkeypatch.setattr(compiling.log, "propagate", False)
    level = compiling.log.level
    compiling.log.setLevel(logging.WARNING)

    def saying(stream):
        monkeypatch.setattr(sys, "stderr", stream)
        compiling.notify()
        compiling.notify()
        return stream.getvalue()

    yield saying
    compiling.log.setLevel(level)


def test_one_line_at_a_terminal(told):
    assert told(Terminal()) == f"fastcontact: {compiling.ANNOUNCEMENT}\n"


def test_one_line_in_a_notebook(told, monkeypatch):
    monkeypatch.setitem(sys.modules, "ipykernel", compiling)
    assert told(io.StringIO()) == f"fastcontact: {compiling.ANNOUNCEMENT}\n"


def test_nothing_where_nobody_waits(told, monkeypatch):
    monkeypatch.delitem(sys.modules, "ipykernel", raising=False)
    assert told(io.StringIO()) == ""


def test_nothing_without_error_output(told, monkeypatch):
    told(io.StringIO())
    monkeypatch.setattr(sys, "stderr", None)
    monkeypatch.setattr(compiling, "listeners", [compiling.print_announcement])
    compiling.notify()
    assert compiling.listeners == []


def test_nothing_in_a_process_that_works_for_another(told, monkeypatch):
    monkeypatch.setattr("multiprocessing.parent_process", object)
    assert told(Terminal()) == ""


def test_nothing_where_the_log_tells_it(told):
    compiling.log.setLevel(logging.INFO)
    assert told(Terminal()) == ""


def test_nothing_where_another_listener_tells_it(told):
    heard = []
    compiling.listeners.append(lambda: heard.append(1))
    assert told(Terminal()) == ""
    assert heard == [1, 1]


# Facets of a sphere.
QUESTION = """
import hashlib
import numpy as np
from fastcontact._jit import interpreting
from fastcontact.contact.formulations._cut_faces_kernels import planes

interpreting.MAX_SECONDS = -1.0  # not Python in the place of the kernel
a, b = np.meshgrid(np.linspace(0.0, 0.2, 22), np.linspace(0.0, 0.2, 22), indexing="ij")
points = np.stack([np.sin(a), 1.0 - np.cos(a) * np.cos(b), np.cos(a) * np.sin(b)], axis=-1)
corners = np.stack([points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]], axis=2).reshape(-1, 4, 3).copy()
origin, axes = np.zeros((len(corners), 3)), np.zeros((len(corners), 3, 3))
planes(corners, 4, origin, axes)
print(hashlib.sha256(axes.tobytes()).hexdigest(), sum(planes.compiled.stats.cache_hits.values()))
"""


def test_the_process_that_compiles_has_the_bits_of_another_of_fewer_threads(tmp_path):
    variables = {"NUMBA_CACHE_DIR": tmp_path, "NUMBA_DISABLE_JIT": 0}
    answers = [printed(QUESTION, NUMBA_NUM_THREADS=threads, **variables).split() for threads in (2, 1)]
    assert [hits for _, hits in answers] == ["0", "1"]
    assert answers[0][0] == answers[1][0]


def kernels():
    """Every kernel of the package by its name, with its module."""
    found = {}
    for module in pkgutil.walk_packages(fastcontact.__path__, "fastcontact."):
        if module.name.endswith("_kernels"):
            values = vars(importlib.import_module(module.name)).items()
            compiled = {f"{module.name}.{name}": getattr(one, "compiled", one) for name, one in values}
            found |= {name: one for name, one in compiled.items() if hasattr(one, "targetoptions")}
    return found


def test_kernels_round_every_operation_unless_there_is_one_copy_of_them():
    """Kernels that others call are compiled once by themselves and once within those."""
    found = kernels()
    free = {name: one for name, one in found.items() if one.targetoptions["fastmath"]}
    assert len(found) > 100
    assert 0 < len(free) < 10
    for name, one in free.items():
        called = [part for part in one.py_func.__globals__.values() if hasattr(part, "targetoptions")]
        assert not {part.py_func.__name__ for part in called} & set(one.py_func.__code__.co_names), name
        users = [
            other
            for other, kernel in found.items()
            if any(part is one for part in kernel.py_func.__globals__.values())
            and one.py_func.__name__ in kernel.py_func.__code__.co_names
        ]
        assert not users, (name, users)


WHOLE = """
import hashlib, sys
import fastcontact as fc

mesh = fc.generate.sphere_on_block("hex8", R=1.0, size=0.3, contact_size=0.1, contact_radius=0.2)
model = fc.Model(mesh, "3d")
model.add_material(fc.LinearElastic(E=20000.0, nu=0.3))
model.fix("BLOCK_BOTTOM", "xyz")
model.fix("SYMMETRY_X", "x")
model.fix("SYMMETRY_Z", "z")
model.prescribe("SPHERE_TOP", y=-0.01)
model.add_contact("pair", secondary="CONT_SPHERE", primary="CONT_BLOCK", friction=0.2)
digest = hashlib.sha256()
for solver in ("direct", "amg"):
    for step in fc.solve(model, fc.linear_ramp(2), linear_solver=solver):
        digest.update(step.displacement.tobytes())
        digest.update(step.stress.tobytes())
print(digest.hexdigest())
"""


@pytest.mark.slow
def test_a_run_that_compiles_has_the_bits_of_later_ones(tmp_path):
    answers = [printed(WHOLE, timeout=1500, NUMBA_CACHE_DIR=tmp_path, NUMBA_DISABLE_JIT=0) for _ in range(2)]
    assert answers[0] == answers[1]
