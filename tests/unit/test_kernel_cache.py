"""Kernels on disk are compiled anew when a kernel of another file that they call has changed."""

import os
import subprocess
import sys

import pytest

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


@pytest.mark.parametrize("decorator", ["kernel", "inlined_kernel"])
def test_the_cache_notices_changes_in_other_files(tmp_path, decorator):
    def answer():
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "NUMBA_DISABLE_JIT": "0"}
        done = subprocess.run(
            [sys.executable, "-c", ASK], capture_output=True, text=True, check=True, env=environment, cwd=tmp_path
        )
        return done.stdout.split()

    (tmp_path / "caller.py").write_text(CALLER)
    (tmp_path / "callee.py").write_text(CALLEE.format(decorator=decorator, number=1))
    assert answer() == ["20.0", "0"]
    assert answer() == ["20.0", "1"]
    (tmp_path / "callee.py").write_text(CALLEE.format(decorator=decorator, number=22))
    assert answer() == ["230.0", "0"]
