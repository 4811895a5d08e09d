"""Kernels on disk: compiled anew when a kernel of another file that they call has changed."""

import os
import subprocess
import sys

import pytest

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


def test_a_kernel_on_disk_can_be_called_by_one_that_is_compiled(written):
    assert answers(written, f"import callee; callee.part(1.0); {ASK}") == ["20.0", "0"]


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="needs owners and modes of files")
@pytest.mark.parametrize(
    ("inside", "mode", "used"), [(True, 0o777, False), (False, 0o777, False), (False, 0o1777, True)]
)
def test_a_cache_that_others_may_write_to_is_not_used(written, inside, mode, used):
    """What lies in a cache is run: somebody else could have put it there. A sticky folder keeps the names of each owner."""
    cache = written / "cache"
    for folder in (path for path in cache.rglob("*") if path.is_dir()) if inside else [cache]:
        folder.chmod(mode)
    question = (
        f"import logging; logging.basicConfig(level=20); {ASK.replace('caller', 'callee').replace('whole', 'part')}"
    )
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(cache), "NUMBA_DISABLE_JIT": "0"}
    done = subprocess.run(
        [sys.executable, "-c", question], capture_output=True, text=True, check=True, env=environment, cwd=written
    )
    assert done.stdout.split() == ["2.0", "1" if used else "0"]
    assert ("others may write to the folder of compiled kernels" in done.stderr) != used


@pytest.mark.parametrize("option", ["NUMBA_OPT", "NUMBA_BOUNDSCHECK"])
def test_the_cache_notices_how_kernels_are_compiled(written, option, monkeypatch):
    monkeypatch.setenv(option, "1")
    ask = ASK.replace("caller", "callee").replace("whole", "part")
    assert answers(written, ask) == ["2.0", "0"]
    assert answers(written, ask) == ["2.0", "1"]


def test_the_cache_notices_a_constant_of_another_file(tmp_path):
    (tmp_path / "caller.py").write_text("from constants import NUMBER\n" + CALLER.replace("10.0 *", "NUMBER *"))
    (tmp_path / "callee.py").write_text(CALLEE.format(decorator="kernel", number=1))
    for number in (3.0, 5.0):
        (tmp_path / "constants.py").write_text(f"NUMBER = {number}\n")
        assert answers(tmp_path, ASK) == [str(2 * number), "0"]


def test_kernels_outlive_an_installation(written):
    """Of the same sources in another folder, written at another time."""
    again = written / "again"
    again.mkdir()
    for name in ("caller.py", "callee.py"):
        (again / name).write_text((written / name).read_text())
    os.replace(written / "cache", again / "cache")
    assert answers(again, "import callee; print(callee.part(1.0), sum(callee.part.stats.cache_hits.values()))") == [
        "2.0",
        "1",
    ]


HARM = {
    "empty": lambda path: path.write_bytes(b""),
    "cut": lambda path: path.write_bytes(path.read_bytes()[:-7]),
    "zeroed": lambda path: path.write_bytes(bytes(path.stat().st_size)),
    "flipped": lambda path: path.write_bytes(path.read_bytes()[:-900] + b"\xff" + path.read_bytes()[-899:]),
    "writable": lambda path: path.chmod(0o666),
    "a folder": lambda path: (path.unlink(), path.mkdir()),
}


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="needs owners and modes of files")
@pytest.mark.parametrize("harm", HARM)
def test_a_file_that_is_damaged_or_of_others_costs_a_compilation_and_a_line(written, harm):
    (path,) = (written / "cache").rglob("*.nbc")
    HARM[harm](path)
    question = (
        "import logging, sys; logging.basicConfig(level=20, stream=sys.stderr); import callee; print(callee.part(1.0))"
    )
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(written / "cache"), "NUMBA_DISABLE_JIT": "0"}
    done = subprocess.run(
        [sys.executable, "-c", question], capture_output=True, text=True, check=True, env=environment, cwd=written
    )
    assert done.stdout == "2.0\n"
    assert sum("compiling instead" in line for line in done.stderr.splitlines()) == 1 + (harm == "a folder"), (
        done.stderr
    )
    assert str(path.parent) in done.stderr
    if harm != "a folder":
        ask = ASK.replace("caller", "callee").replace("whole", "part")
        assert answers(written, ask) == ["2.0", "1"]
