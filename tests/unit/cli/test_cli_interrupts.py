"""Ctrl-C at any time ends a command with one line, without a traceback."""

import contextlib
import ctypes
import importlib
import json
import os
import pathlib
import signal
import subprocess
import sys
import time
import weakref

import pytest

from fastcontact.cli import main
from fastcontact.cli._interrupts import interruptible
from fastcontact.errors import FastcontactError, FileError

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals as POSIX knows them")


def interrupted_within(seconds):
    with pytest.raises(KeyboardInterrupt):
        time.sleep(seconds)


IMPORTED = """
import sys
def act(inner):
    class Importing:
        def find_spec(self, name, *rest):
            if name == "no_such_module":
                inner()
    sys.meta_path.insert(0, Importing())
    try:
        import no_such_module
    except ImportError:
        pass
    finally:
        del sys.meta_path[0]
"""


def in_an_import(act):
    exec(IMPORTED, space := {})
    space["act"](act)


def in_a_finaliser(act):
    class Gone:
        def __del__(self):
            act()

    Gone()


def in_a_call_back(act):
    ctypes.CFUNCTYPE(None)(act)()


def in_a_weak_reference(act):
    class Gone:
        pass

    gone = Gone()
    reference = weakref.ref(gone, lambda _: act())
    del gone
    assert reference() is None


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("where", [in_an_import, in_a_finaliser, in_a_call_back, in_a_weak_reference])
def test_an_interruption_that_would_be_lost_comes_later(where, number, capsys):
    received = []
    with interruptible(received):
        where(lambda: signal.raise_signal(number))
        interrupted_within(60)
    assert signal.SIGTERM in received or number == signal.SIGINT
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    assert capsys.readouterr().err == ""


def act_and_fail():
    with interruptible():
        with contextlib.suppress(BaseException):
            signal.raise_signal(signal.SIGINT)
        raise FileError("it is damaged")


def act_and_tell():
    with interruptible():
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            raise FastcontactError("stopped") from None


def test_another_error_that_is_made_of_it_is_an_interruption():
    with pytest.raises(KeyboardInterrupt):
        act_and_fail()
    with pytest.raises(FastcontactError, match="stopped"):
        act_and_tell()
    with pytest.raises(FileError), interruptible():
        raise FileError("without any")


def test_other_errors_that_are_lost_are_told_as_before(monkeypatch):
    told = []
    monkeypatch.setattr(sys, "unraisablehook", lambda found: told.append(found.exc_type))
    with interruptible():
        in_a_finaliser(lambda: 1 / 0)
    assert told == [ZeroDivisionError]


def test_elsewhere_it_comes_at_once():
    with interruptible(), pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)


@pytest.mark.parametrize("number", [signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)])
def test_sigterm_is_told_in_its_own_words(number, monkeypatch, capsys):
    """Exit code 143 or 129, also of a study, which says how to go on; afterwards it ends the process as before."""
    from fastcontact.cli import env

    def terminated(options):
        signal.raise_signal(number)

    def stopped(options):
        try:
            signal.raise_signal(number)
        except KeyboardInterrupt:
            raise FastcontactError("stopped; go on so") from None

    for act, said in ((terminated, "terminated\n"), (stopped, "error: stopped; go on so\n")):
        monkeypatch.setattr(env, "run", act)
        assert main(["env"]) == 128 + number
        assert capsys.readouterr().err == said
        assert signal.getsignal(number) == signal.SIG_DFL


@pytest.mark.parametrize("second", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_that_follows_at_once_changes_nothing(second, monkeypatch, capsys):
    """While files are closed, and while it is told why the command ends."""
    from fastcontact.cli import _main, env

    def terminated(options):
        try:
            signal.raise_signal(signal.SIGTERM)
        finally:
            signal.raise_signal(second)
            closed.append(True)

    def say(text, error=False):
        signal.raise_signal(second)
        said.append(text)

    closed, said = [], []
    monkeypatch.setattr(env, "run", terminated)
    monkeypatch.setattr(_main, "say", say)
    assert main(["env"]) == 143
    assert (closed, said) == ([True], ["terminated"])


def test_the_handler_of_another_program_stays():
    heard = []
    before = signal.signal(signal.SIGINT, lambda *_: heard.append(1))
    try:
        with interruptible():
            signal.raise_signal(signal.SIGINT)
        assert heard == [1]
    finally:
        signal.signal(signal.SIGINT, before)


def test_while_the_command_line_is_imported(monkeypatch, capsys):
    class Interrupted:
        def find_spec(self, name, *_):
            if name == "fastcontact.cli._main":
                raise KeyboardInterrupt

    import fastcontact.cli

    importlib.import_module("fastcontact.cli._main")
    monkeypatch.delitem(sys.modules, "fastcontact.cli._main")
    monkeypatch.delattr(fastcontact.cli, "_main")
    monkeypatch.setattr(sys, "meta_path", [Interrupted(), *sys.meta_path])
    assert main(["env"]) == 130
    assert capsys.readouterr().err == "interrupted\n"


def test_half_made_objects_have_nothing_to_say(capsys, monkeypatch):
    """An object that was interrupted while it was made may fail when it is thrown away."""

    class Half:
        def __del__(self):
            raise AttributeError("no attribute 'handle'")

    def interrupted(options):
        half = Half()
        raise KeyboardInterrupt(id(half))

    from fastcontact.cli import env

    monkeypatch.setattr(env, "run", interrupted)
    heard = []
    monkeypatch.setattr(sys, "unraisablehook", heard.append)
    assert main(["env"]) == 130
    assert capsys.readouterr().err == "interrupted\n"
    assert heard == []
    Half()  # the hook is there again
    assert len(heard) == 1


COMMANDS = {
    "run": ["run", "forma04c", "-q", "-o", "out.vtkhdf"],
    "sweep": ["sweep", "forma04c", "--set", "approach=1:4:200", "--workers", "2", "-q"],
    "converge": ["converge", "forma04c", "--levels", "4", "--workers", "2", "-q"],
}


def loaded(library):
    """Tell whether a process has a library in its memory."""

    def seen(process, kernels):
        with contextlib.suppress(OSError):  # it may have ended
            return library in pathlib.Path(f"/proc/{process.pid}/maps").read_text(encoding="utf-8")
        return False

    return seen


def compiled(count):
    """Tell whether so many kernels have been compiled."""
    return lambda process, kernels: sum(1 for _ in kernels.rglob("*.nbc")) >= count


WHEN = {
    "NumPy is imported": loaded("_multiarray_umath"),
    "the compiler is loaded": loaded("llvmlite"),
    "a kernel is compiled": compiled(1),
    "more kernels are compiled": compiled(8),
}


# By default a run when NumPy is imported, where commands are not told apart yet, and a study, which starts workers, later on.
BY_DEFAULT = [("run", "NumPy is imported"), ("sweep", "the compiler is loaded")]
INTERRUPTED = [
    pytest.param(command, when, marks=() if (command, when) in BY_DEFAULT else pytest.mark.slow)
    for command in COMMANDS
    for when in WHEN
]


@pytest.mark.parametrize(("command", "when"), INTERRUPTED)
def test_no_traceback_is_printed(command, when, tmp_path):
    """A terminal sends the signal to all processes of a command; here as soon as something is seen to happen."""
    if "compiled" not in when and not os.path.exists("/proc/self/maps"):
        pytest.skip("needs the list of a process's libraries, as Linux has it")
    # Kernels are compiled anew, so that compiling is interrupted, too.
    kernels = tmp_path / "kernels"
    process = subprocess.Popen(
        [sys.executable, "-m", "fastcontact", *COMMANDS[command]], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True, cwd=tmp_path, env={**os.environ, "NUMBA_CACHE_DIR": str(kernels)},
    )  # fmt: skip
    while not WHEN[when](process, kernels):
        assert process.poll() is None, process.communicate()[1]
        time.sleep(0.005)
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode in (130, 1, -signal.SIGINT), said
    assert "Traceback" not in said
    assert "Exception ignored" not in said
    assert said.startswith(
        ("interrupted\n", "error: stopped; with --store DIR the same command would continue where it stopped")
    )


@pytest.mark.parametrize("number", [pytest.param(signal.SIGINT, marks=pytest.mark.slow), signal.SIGTERM])
def test_no_half_written_file_stays(number, solved_case, tmp_path):
    """Two signals come while a picture is written to a file that is to take the place of another."""
    (tmp_path / "out.png").write_bytes(b"before")
    process = subprocess.Popen(
        [sys.executable, "-m", "fastcontact", "profile", str(solved_case / "old.vtkhdf"), "-q", "--png", "out.png"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True, cwd=tmp_path,
    )  # fmt: skip
    while sorted(os.listdir(tmp_path)) in (["out.png"], []):
        assert process.poll() is None, process.communicate()[1]
        time.sleep(0.001)
    process.send_signal(number)
    time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == {signal.SIGINT: 130, signal.SIGTERM: 143}[number], said
    assert said == {signal.SIGINT: "interrupted\n", signal.SIGTERM: "terminated\n"}[number]
    assert os.listdir(tmp_path) == ["out.png"]
    assert (tmp_path / "out.png").read_bytes() == b"before"


def of_session(leader):
    """Return the processes of a session that run; what has ended may keep its entry."""
    found = []
    for entry in pathlib.Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            state, _, _, session = (entry / "stat").read_text(encoding="utf-8").rpartition(")")[2].split()[:4]
            found += [int(entry.name)] * (int(session) == leader and state != "Z")
    return found


def test_the_end_of_a_study_by_sigterm(solved_case, tmp_path):
    """As a scheduler does it: no process stays, nothing but one line is said, what was finished is kept."""
    process = subprocess.Popen(
        [
            sys.executable, "-m", "fastcontact", "sweep", str(solved_case / "case.toml"), "--set", "approach=1:4:40",
            "--workers", "2", "-q", "--store", "store",
        ],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True, cwd=tmp_path,
    )  # fmt: skip
    while len(list(tmp_path.glob("store/*.json"))) < 1:
        assert process.poll() is None, process.communicate()[1]
        time.sleep(0.005)
    process.terminate()
    _, said = process.communicate(timeout=60)
    assert process.returncode == 143, said
    assert said == "error: stopped; the same command continues where it stopped, with the runs in store\n"
    deadline = time.monotonic() + 20
    while left := of_session(process.pid):
        assert time.monotonic() < deadline, f"{left} still run"
        time.sleep(0.05)
    assert all(json.loads(path.read_text(encoding="utf-8"))["result"] for path in tmp_path.glob("store/*"))
