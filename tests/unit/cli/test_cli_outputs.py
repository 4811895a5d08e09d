"""No command replaces its inputs, or one output by another; no output remains incomplete."""

import argparse
import io
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import matplotlib as mpl
import pytest
from commands import output_of

import fastcontact as fc
from fastcontact.cli import main
from fastcontact.cli._main import parser
from fastcontact.errors import printable

pytestmark = pytest.mark.pairwise

mpl.use("Agg")


@pytest.fixture
def files(solved_case: Path, tmp_path: Path) -> Path:
    shutil.copytree(solved_case, tmp_path / "files")
    return tmp_path / "files"


# Of each command that writes: its arguments with one source, and its options for files.
WRITERS = {
    "profile": (["profile", "old.vtkhdf"], ["--csv", "--agr", "--png"], ["old.vtkhdf"]),
    "plot": (["plot", "old.vtkhdf"], ["--png", "--animate"], ["old.vtkhdf"]),
    "export": (["export", "old.vtkhdf"], ["--med", "--xdmf"], ["old.vtkhdf"]),
    "run": (["run", "case.toml"], ["-o", "--json", "--plot", "--modes"], ["case.toml", "coarse.med"]),
    "info": (["info", "case.toml"], ["--png"], ["case.toml", "coarse.med"]),
    "converge": (["converge", "case.toml"], ["--json", "--csv", "--png", "--html", "-o"], ["case.toml", "coarse.med"]),
    "sweep": (
        ["sweep", "case.toml", "--set", "material[0].E=1,2"],
        ["--json", "--csv", "--png", "--html"],
        ["case.toml", "coarse.med"],
    ),
}


OVERWRITING = [
    (command, option, source)
    for command, options, sources in WRITERS.values()
    for option in options
    for source in sources
]


@pytest.mark.parametrize("by", ["name", "symbolic link", "hard link", "other spelling"])
@pytest.mark.parametrize(("command", "option", "source"), OVERWRITING)
def test_no_command_replaces_what_it_reads(command, option, source, by, files, monkeypatch, capsys):
    monkeypatch.chdir(files)
    target = {"name": source, "other spelling": f"../files/{source}"}.get(by, f"link{Path(source).suffix}")
    if by == "symbolic link":
        os.symlink(source, target)
    elif by == "hard link":
        os.link(source, target)
    before = {path: path.read_bytes() for path in files.iterdir()}
    assert f"'{target}' is an input of this command" in output_of(capsys, [*command, option, target], 1)
    assert {path: path.read_bytes() for path in files.iterdir()} == before


def test_an_unknown_linear_solver_leaves_earlier_results_as_they_are(files, monkeypatch, capsys):
    monkeypatch.chdir(files)
    Path("earlier.vtkhdf").write_bytes(b"earlier")
    assert main(["run", "case.toml", "-o", "earlier.vtkhdf", "--linear", "direkt"]) == 1
    assert "unknown linear solver 'direkt'" in capsys.readouterr().err
    assert Path("earlier.vtkhdf").read_bytes() == b"earlier"


@pytest.mark.parametrize("name", WRITERS)
def test_two_outputs_need_two_files(name, files, monkeypatch, capsys):
    monkeypatch.chdir(files)
    command, options, _ = WRITERS[name]
    if len(options) < 2:
        pytest.skip("one output")
    assert main([*command, options[0], "both.png", options[1], "both.png"]) == 1
    assert "two outputs are to be written to 'both.png'" in capsys.readouterr().err
    assert not Path("both.png").exists()


@pytest.mark.slow
def test_a_folder_that_is_mounted_twice_is_one(files):
    """No link and no other path tells a bind mount."""
    other, mounting = (
        files.parent / "other",
        ["unshare", "-rm", "sh", "-c", 'mount --bind files other && exec "$@"', "sh"],
    )
    other.mkdir()
    if (
        not shutil.which("unshare")
        or subprocess.run([*mounting, "true"], cwd=files.parent, capture_output=True).returncode
    ):
        pytest.skip("needs mounts of one's own")
    profile = [*mounting, sys.executable, "-m", "fastcontact", "profile", "files/old.vtkhdf", "--csv"]
    for outputs in (["files/a.csv", "--agr", "other/a.csv"], ["other/old.vtkhdf"]):
        done = subprocess.run([*profile, *outputs], cwd=files.parent, capture_output=True, text=True)
        assert (done.returncode, done.stderr.count("\n")) == (1, 1)
        assert "two outputs" in done.stderr or "is an input of this command" in done.stderr
    assert not (files / "a.csv").exists()


def test_every_option_that_names_a_file_is_tried_here() -> None:
    """A new output must come under the rule, too: this test names it until it does."""
    reads = {("bench", "--compare"), ("cases", "--output")}  # a copy replaces nothing
    known = {(name, option) for name, (_, options, _) in WRITERS.items() for option in options}
    others = {
        ("bench", "--json"),
        ("bench", "--png"),
        ("mesh", "--output"),
    }  # which read nothing that they could replace
    found = set()
    commands = next(action for action in parser()._actions if isinstance(action, argparse._SubParsersAction))
    for name, sub in commands.choices.items():
        for action in sub._actions:
            output = "--output" in action.option_strings
            if output or (action.option_strings and action.metavar in ("FILE", "PNG", "FOLDER")):
                found.add((name, "-o" if output and name in WRITERS else action.option_strings[-1]))
    assert found - reads - others <= known


def test_an_output_that_fails_leaves_nothing(files, monkeypatch, capsys):
    """Neither a part of a picture, nor a hidden file; the file that was there stays."""
    monkeypatch.chdir(files)
    Path("old.png").write_bytes(b"old")
    names = sorted(os.listdir())

    def fail(self, path, *_, **__):
        Path(path).write_bytes(b"half a pict")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", fail)
    assert "No space left on device" in output_of(capsys, ["profile", "old.vtkhdf", "--png", "old.png"], 1)
    assert Path("old.png").read_bytes() == b"old"
    assert sorted(os.listdir()) == names


def test_names_of_files_steer_no_terminal(files, monkeypatch, capsys):
    """A group may be called anything: what clears a screen or turns the direction of writing is shown as text."""
    assert printable("\x1b[2Jgone\u202e\n") == "\\x1b[2Jgone\\u202e\n"
    case = files / "case.toml"
    case.write_text(case.read_text().replace('title = "', 'title = "\\u001b[31m\\u202e', 1))
    out = output_of(capsys, ["run", str(case), "-o", str(files / "other.vtkhdf")])
    assert "\\x1b[31m\\u202e" in out
    assert "\x1b" not in out
    assert "\u202e" not in out


def test_a_title_that_the_terminal_cannot_show_ends_no_run(files, monkeypatch):
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", stream)
    case = files / "case.toml"
    text = case.read_text(encoding="utf-8")
    case.write_text(text.replace('title = "', 'title = "Kugel \u2300 \u00e4', 1), encoding="utf-8")
    assert main(["run", str(case), "-o", str(files / "other.vtkhdf")]) == 0
    stream.flush()
    assert b"Kugel \\u2300 \\xe4" in stream.buffer.getvalue()


@pytest.mark.parametrize("option", ["--json", "-o", "--plot"])
@pytest.mark.parametrize("text", ['"{}"', '["other.vtu", "{}"]', '["{}"]'])
def test_files_of_fields_are_what_a_command_reads(text, option, files, monkeypatch, capsys):
    """Also where a case names several in a list."""
    monkeypatch.chdir(files)
    Path("heat.vtu").write_text("<VTKFile>")
    table = f'\n[[temperature]]\nfile = {text.format("heat.vtu")}\nfield = "T"\n'
    Path("case.toml").write_text(Path("case.toml").read_text() + table)
    assert "'heat.vtu' is an input of this command" in output_of(capsys, ["run", "case.toml", option, "heat.vtu"], 1)
    assert Path("heat.vtu").read_text() == "<VTKFile>"


@pytest.mark.parametrize("option", ["--json", "-o"])
def test_the_data_file_of_an_xdmf_mesh_is_read_too(option, files, monkeypatch, capsys):
    monkeypatch.chdir(files)
    Path("mesh.xdmf").write_text('<Xdmf><DataItem Format="HDF">points.h5:/p</DataItem></Xdmf>')
    Path("points.h5").write_bytes(b"points")
    Path("case.toml").write_text(Path("case.toml").read_text().replace("coarse.med", "mesh.xdmf"))
    assert "'points.h5' is an input of this command" in output_of(capsys, ["run", "case.toml", option, "points.h5"], 1)
    assert Path("points.h5").read_bytes() == b"points"


@pytest.mark.skipif(not os.path.exists("/dev/stdout"), reason="needs names of open files")
@pytest.mark.parametrize("name", ["/dev/fd/1", pytest.param("link", marks=pytest.mark.slow)])
def test_what_a_shell_opened_to_append_to_is_appended_to(name, files):
    os.symlink("/dev/stdout", files / "link")
    (files / "log").write_text("kept\n")
    command = [sys.executable, "-m", "fastcontact", "profile", "old.vtkhdf", "--csv", name]
    with open(files / "log", "a") as log:
        subprocess.run(command, stdout=log, check=True, cwd=files)
    log = (files / "log").read_text()
    assert log.startswith("kept\n")
    assert "pressure" in log
    assert main(["run", str(files / "case.toml"), "-o", "/dev/stdout"]) == 1


@pytest.mark.slow
@pytest.mark.skipif(os.name == "nt", reason="files as POSIX numbers them")
@pytest.mark.parametrize("closed", [">&-", "<&- >&- 2>&-"])
def test_a_process_without_standard_files(closed, files):
    """As daemons are started: no file that is opened takes the place of what is printed."""
    command = f"'{sys.executable}' -m fastcontact run case.toml -o out.vtkhdf --json out.json {closed}"
    assert subprocess.run(command, shell=True, cwd=files, check=False).returncode == 0
    assert len(fc.open_results(files / "out.vtkhdf")) == len(fc.open_results(files / "old.vtkhdf"))
    assert json.loads((files / "out.json").read_text())["case"]


needs_full = pytest.mark.skipif(not Path("/dev/full").is_char_device(), reason="needs a device that is always full")


@needs_full
@pytest.mark.parametrize(
    "command", ["run case.toml --json", "sweep case.toml --set material[0].nu=0.3 --workers 1 --html"]
)
def test_a_device_that_is_full_is_told_in_one_line(command, files, monkeypatch, capsys):
    monkeypatch.chdir(files)
    said = output_of(capsys, [*command.split(), "/dev/full", "-q"], 1).splitlines()[-1]
    assert said == "error: '/dev/full' cannot be written (No space left on device): name another file"


# Commands, and whether each of their writes goes out at once; each in a child that has imported what they need.
PRINTING = """
import os, sys
import fastcontact
from fastcontact.cli import entry_point

[getattr(fastcontact, name) for name in fastcontact.__all__]
commands = ["info old.vtkhdf", True], ["profile old.vtkhdf", False], ["--help", False], ["--version", True]
for command, at_once in (*commands, ["--print-completion bash", False]):
    if os.fork() == 0:
        sys.stdout.reconfigure(write_through=at_once)
        sys.argv[1:] = command.split()
        entry_point()
    print(os.waitstatus_to_exitcode(os.wait()[1]), command, file=sys.stderr, flush=True)
"""


@needs_full
def test_standard_output_on_a_full_disk_is_told_in_one_line(files):
    """At once, or, as output waits for more, when the command ends."""
    with open("/dev/full", "w", encoding="ascii") as full:
        done = subprocess.run(
            [sys.executable, "-c", PRINTING], stdout=full, stderr=subprocess.PIPE, text=True, check=False, cwd=files
        )
    said = "error: cannot write to standard output (No space left on device): redirect it"
    commands = ["info old.vtkhdf", "profile old.vtkhdf", "--help", "--version", "--print-completion bash"]
    assert done.stderr.splitlines() == [line for command in commands for line in (said, f"1 {command}")]


@pytest.mark.parametrize("stream", ["stdout", "stderr"])
def test_nobody_who_listens_changes_no_exit_code_to_good(stream, files, monkeypatch):
    """A pipe whose reader has gone, and errors that nobody can read."""

    class Gone(io.StringIO):
        def write(self, text):
            raise BrokenPipeError if stream == "stdout" else OSError(28, "No space left on device")

    monkeypatch.chdir(files)
    monkeypatch.setattr(sys, stream, Gone())
    assert main(["info", "old.vtkhdf" if stream == "stdout" else "none.vtkhdf"]) == 1
