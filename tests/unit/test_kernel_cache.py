"""Kernels on disk: compiled anew when a kernel of another file that they call has changed, loaded without a compiler."""

import os
import subprocess
import sys

import numba
import pytest

from fastcontact import _kernel_cache

CALLER = """
from callee import part
from fastcontact._jit import kernel

@kernel
def whole(x):
    return 10.0 * part(x)
"""
CALLEE = """
from fastcontact._jit import inlined_kernel, kernel

@{decorator}
def part(x):
    return x + {number}
"""
ASK = "import caller; print(caller.whole(1.0), sum(caller.whole.stats.cache_hits.values()))"


COMPILER = "numba.np.linalg"  # which Numba imports to compile


def answers(folder, question):
    """Return the words that Python prints in a new process, kernels on disk in `folder`."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(folder / "cache"), "NUMBA_DISABLE_JIT": "0"}
    done = subprocess.run(
        [sys.executable, "-c", question], capture_output=True, text=True, check=True, env=environment, cwd=folder
    )
    return done.stdout.split()


@pytest.mark.parametrize("decorator", ["kernel", "inlined_kernel"])
def test_the_cache_notices_changes_in_other_files(tmp_path, decorator):
    (tmp_path / "caller.py").write_text(CALLER)
    (tmp_path / "callee.py").write_text(CALLEE.format(decorator=decorator, number=1))
    assert answers(tmp_path, ASK) == ["20.0", "0"]
    assert answers(tmp_path, ASK) == ["20.0", "1"]
    (tmp_path / "callee.py").write_text(CALLEE.format(decorator=decorator, number=22))
    assert answers(tmp_path, ASK) == ["230.0", "0"]


@pytest.fixture
def written(tmp_path):
    """A folder with both files, and the called kernel on disk."""
    (tmp_path / "caller.py").write_text(CALLER)
    (tmp_path / "callee.py").write_text(CALLEE.format(decorator="kernel", number=1))
    assert answers(tmp_path, "import callee; print(callee.part(1.0))") == ["2.0"]
    return tmp_path


@pytest.mark.skipif(
    not _kernel_cache.TRIED[0] <= numba.version_info.short < _kernel_cache.TRIED[1],
    reason=f"Numba {numba.__version__} loads kernels its own way: try ours with it, and raise _kernel_cache.TRIED",
)
def test_a_kernel_on_disk_is_loaded_without_the_compiler(written):
    compiler = f"{COMPILER!r} in sys.modules"
    said = f"import sys, callee; print(callee.part(1.0), {compiler}, callee.part(1), {compiler})"
    # For integers it is not there, and compiled.
    assert answers(written, said) == ["2.0", "False", "2", "True"]


def test_a_kernel_on_disk_can_be_called_by_one_that_is_compiled(written):
    assert answers(written, f"import callee; callee.part(1.0); {ASK}") == ["20.0", "0"]


@pytest.mark.parametrize(
    "change",
    ["_kernel_cache.TRIED = (0, 1), (0, 2)", "_kernel_loading._Kernels.rebuild = lambda *given: 1 / 0"],
    ids=["another release", "an error"],
)
def test_numba_loads_the_kernel_where_ours_does_not(written, change):
    said = f"print(callee.part(1.0), sum(callee.part.stats.cache_hits.values()), {COMPILER!r} in sys.modules)"
    question = f"import sys; from fastcontact import _kernel_cache, _kernel_loading; {change}; import callee; {said}"
    assert answers(written, question) == ["2.0", "1", "True"]


def test_functions_seldom_called_from_outside_are_found_too(written):
    # The wrapper for C is one, which Numba asks for where kernels are arguments.
    result = "callee.part.overloads[callee.part.signatures[0]]"
    address = f"{result}.library.get_pointer_to_function({result}.fndesc.llvm_cfunc_wrapper_name)"
    assert answers(written, f"import callee; callee.part(1.0); print({address} != 0)") == ["True"]
