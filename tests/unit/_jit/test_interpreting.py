"""Kernels that Python runs before they are compiled have the bits of compiled ones."""

import copy
import dis
import importlib
import json
import pkgutil
import shutil
import sys

import numpy as np
import pytest
from models import supported, with_contact
from new_process import printed

import fastcontact as fc
from fastcontact._jit import cache, decorators, interpreting

pytestmark = pytest.mark.skipif(not decorators.jit_enabled(), reason="kernels are not compiled")

# Operations whose results IEEE 754 tells, and what makes and tells arrays. No powers, angles or sums of arrays.
KNOWN = {
    "abs", "min", "max", "len", "range", "np", "int64", "int32", "bool_", "inf", "nan", "sqrt", "isfinite", "shape", "empty",
    "zeros", "full", "arange", "copy", "astype", "reshape",
}  # fmt: skip


def interpretable():
    """Every kernel that Python may run, with its module and name."""
    for module in pkgutil.walk_packages(fc.__path__, "fastcontact."):
        if module.name.endswith("_kernels"):
            for name, kernel in vars(importlib.import_module(module.name)).items():
                if isinstance(kernel, interpreting.InterpretableKernel) and kernel.__module__ == module.name:
                    yield module.name, name, kernel


def functions(kernel, seen):
    """The Python of a kernel and of all that it calls, each with the names that it reads."""
    function = getattr(kernel, "py_func", kernel)
    if function not in seen:
        seen.append(function)
        for name in function.__code__.co_names:
            if hasattr(function.__globals__.get(name), "py_func"):
                functions(function.__globals__[name], seen)
    return seen


@pytest.mark.parametrize(("module", "name", "kernel"), list(interpretable()))
def test_only_operations_with_one_result(module, name, kernel):
    for function in functions(kernel, []):
        for found in {found for found in function.__code__.co_names if found not in KNOWN}:
            value = function.__globals__.get(found)
            field = value is None  # of a named tuple
            assert field or hasattr(value, "py_func") or isinstance(value, int | float | type), (module, name, found)
        powers = [
            step for step in dis.get_instructions(function) if step.opname == "BINARY_OP" and "**" in step.argrepr
        ]
        integers = function.__name__ == "work_sizes"
        assert integers or not powers, (module, name, function.__name__)


def test_no_kernel_calls_one_that_python_may_run():
    """To Numba it would be no kernel."""
    for module in pkgutil.walk_packages(fc.__path__, "fastcontact."):
        place = importlib.import_module(module.name) if module.name.endswith("_kernels") else None
        for kernel in [kernel for kernel in vars(place).values() if hasattr(kernel, "py_func")] if place else []:
            known = kernel.py_func.__globals__
            called = [name for name in kernel.py_func.__code__.co_names if name in known]
            assert not [name for name in called if isinstance(known[name], interpreting.InterpretableKernel)], (
                kernel.__name__
            )


def same(one, other):
    """Whether arrays, numbers and tuples of these have the same bits."""
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    return type(one) is type(other) and np.asarray(one).tobytes() == np.asarray(other).tobytes()


def both(kernel, compared):
    """What computes a kernel twice and compares."""

    def call(*arguments):
        before = copy.deepcopy(arguments)
        if interpreting.n_entries(arguments) == np.inf:
            return kernel(*arguments)
        result, again = kernel(*arguments), interpreting.interpret(kernel, before)
        assert same(result, again), kernel.__name__
        assert all(map(same, arguments, before)), kernel.__name__
        compared.add(kernel.__name__)
        return result

    return call


def axisymmetric(element, formulation):
    model = fc.Model(fc.generate.half_spheres(element, size=12.0), "axisymmetric")
    supported(model, A1A2="x", A2B2={"y": -0.1}, A1B1={"y": 0.1})
    return with_contact(model, "pair", "CONT1", "CONT2", formulation=formulation)


def ball(element, formulation):
    model = fc.Model(fc.generate.sphere_on_block(element, R=1.0, size=0.5, contact_size=0.3, contact_radius=0.2), "3d")
    supported(model, SYMMETRY_X="x", SYMMETRY_Z="z", BLOCK_BOTTOM="y", SPHERE_TOP={"y": -0.02})
    return with_contact(model, "pair", "CONT_SPHERE", "CONT_BLOCK", formulation=formulation)


@pytest.mark.parametrize(
    ("make", "element", "formulation", "least"),
    [
        (axisymmetric, "tri3", "node_to_segment", 14),
        (axisymmetric, "tri6", "continuous", 15),
        (ball, "hex8", "node_to_segment", 18),
        (ball, "tet4", "mortar", 17),
    ],
)
def test_runs_have_the_same_bits(make, element, formulation, least, monkeypatch):
    model, compared = make(element, formulation), set()
    model.add_material(fc.LinearElastic(E=1.0, nu=0.3))
    fc.solve(model, 1, linear_solver="direct")  # compiles what a replaced kernel could not be compiled into
    for module in [module for name, module in sys.modules.items() if name.startswith("fastcontact.")]:
        for name, value in list(vars(module).items()):
            if isinstance(value, interpreting.InterpretableKernel):
                monkeypatch.setattr(module, name, both(value, compared))
    fc.solve(model, 1, linear_solver="direct")
    assert len(compared) >= least, sorted(compared)


ASK = """
import numpy as np
from fastcontact._jit import compiling, interpreting
from fastcontact.linear.cholesky.factorisation_kernels import work_sizes as kernel

front = np.array([-1], np.int32), np.array([0, 3]), np.array([0, 0])  # one supernode of three columns
answers = [*kernel(*front), len(kernel.compiled.signatures), compiling.count]
interpreting.MAX_SECONDS = -1.0
answers += [*kernel(*front), len(kernel.compiled.signatures), type(answers[0]).__name__]
print(*answers)
"""


def test_python_runs_a_kernel_until_it_has_taken_its_time_and_never_one_that_is_kept(tmp_path):
    answers = [printed(ASK, NUMBA_CACHE_DIR=tmp_path, NUMBA_DISABLE_JIT=0) for _ in range(2)]
    assert answers == ["9 0 0 1 9 0 1 int\n", "9 0 1 0 9 0 1 int\n"]


def test_the_time_of_earlier_runs_counts(tmp_path):
    """In the first run Python has spent nothing yet; in the second one more than it may."""
    short = ASK.partition("interpreting.MAX_SECONDS = ")[0] + "print(answers[2])"
    short = short.replace("answers = [", "interpreting.MAX_SECONDS_OF_RUNS = 1e-9\nanswers = [", 1)

    def ask():
        return printed(short, NUMBA_CACHE_DIR=tmp_path, NUMBA_DISABLE_JIT=0)

    assert ask() == "0\n"
    (path,) = tmp_path.rglob(interpreting.TIMES_FILE)
    ((version, seconds),) = json.loads(path.read_text()).items()
    assert version.startswith("factorisation_kernels.work_sizes.")
    assert 0.0 < seconds < 1.0
    assert ask() == "1\n"
    for kept in tmp_path.rglob("*.nbc"):
        kept.unlink()
    path.write_text("damaged")
    assert ask() == "0\n"


def test_only_files_of_the_kernel_as_it_is_now_count(tmp_path):
    files, others = (cache.KernelFiles(tmp_path, "kernel", same, options) for options in ("one", "another"))
    assert not files.exist()
    others.save("float64", b"machine code")
    assert others.exist()
    assert not files.exist()
    shutil.rmtree(tmp_path)
    assert not others.exist()


def test_entries_of_small_types_are_none_that_python_may_compute():
    assert interpreting.n_entries((np.zeros((2, 3)), 1.0, (np.zeros(4, np.int32), True))) == 12
    assert interpreting.n_entries((np.zeros(2, np.float32),)) == np.inf


def test_a_division_by_zero_is_as_in_compiled_code():
    def inverse(x):
        return 1.0 / x

    assert interpreting.interpret(inverse, (0.0,)) == np.inf
