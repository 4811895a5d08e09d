"""Environments in which libraries would raise a traceback: one line, exit code 1."""

import os
import subprocess
import sys

import pytest
from case_texts import of_block

import fastcontact as fc


def run(arguments, folder, options=(), **environment):
    """Run a command in a process of its own; return its exit code and standard error."""
    done = subprocess.run(
        [sys.executable, *(options or ["-m", "fastcontact"]), *arguments], cwd=folder, capture_output=True, text=True,
        env={**os.environ, **environment}, check=False,
    )  # fmt: skip
    return done.returncode, done.stderr


def test_no_threads(tmp_path):
    code, told = run(["cases"], tmp_path, NUMBA_NUM_THREADS="0")
    assert code == 1
    assert told == (
        "error: the environment variable NUMBA_NUM_THREADS is 0: set it to a number of threads, 1 or more, or unset it\n"
    )


@pytest.mark.skipif(sys.platform == "win32", reason="Windows keeps folders that a process works in")
def test_a_working_folder_that_is_gone(tmp_path):
    gone = tmp_path / "gone"
    gone.mkdir()
    script = "import os, sys; os.rmdir(os.getcwd()); os.execv(sys.executable, [sys.executable, '-m', 'fastcontact', 'cases'])"
    done = subprocess.run([sys.executable, "-c", script], cwd=gone, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith("error: the working directory no longer exists")
    assert done.stderr.count("\n") == 1


@pytest.mark.slow
def test_the_package_without_assertions_and_docstrings_solves_and_draws(tmp_path):
    model = fc.Model(fc.generate.block((1.0, 1.0), (1, 1), "quad4"), "plane_strain")
    fc.write_mesh(tmp_path / "block.med", model.mesh)
    (tmp_path / "case.toml").write_text(CASE, encoding="utf-8")
    (tmp_path / "stripped.py").write_text(STRIPPED, encoding="utf-8")
    assert run([], tmp_path, ["stripped.py"]) == (0, "")


def test_a_backend_of_matplotlib_that_nobody_knows_is_told(solved_case, tmp_path):
    result = str(solved_case / "old.vtkhdf")
    code, told = run(["plot", result, "--png", "a.png"], tmp_path, MPLBACKEND="nonsense")
    assert code == 1
    assert told == (
        "error: matplotlib does not know the backend 'nonsense' of the environment variable MPLBACKEND: unset it, or set it "
        "to Agg\n"
    )


# As with -OO, for which Python would compile every library anew.
STRIPPED = """
import sys
from importlib.machinery import SourceFileLoader

def stripped(self, name, ordinary=SourceFileLoader.get_code):
    if name.partition(".")[0] != "fastcontact":
        return ordinary(self, name)
    path = self.get_filename(name)
    return compile(self.get_data(path), path, "exec", dont_inherit=True, optimize=2)

SourceFileLoader.get_code = stripped
import fastcontact
from fastcontact.cli import main
assert fastcontact.__doc__ is main.__doc__ is None
sys.exit(main(["run", "case.toml", "-q"]) or main(["plot", "case.vtkhdf", "--png", "b.png", "-q"]))
"""
PRESSED = '[[pressure]]\ngroup = "RIGHT"\nvalue = 0.01'
CASE = of_block(PRESSED, "plane_strain", "E = 1.0\nnu = 0.3", LEFT="xy")
