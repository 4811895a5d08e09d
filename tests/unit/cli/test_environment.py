"""One line and exit code 1: incomplete environments, numbers and texts that cannot be drawn; completion in shells."""

import os
import shutil
import subprocess
import sys

import matplotlib as mpl
import pytest
from case_texts import of_block, spheres
from commands import output_of

import fastcontact as fc
from fastcontact.cli import main


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


@pytest.fixture(scope="module")
def script(tmp_path_factory):
    pytest.importorskip("shtab", reason="needs shtab: pip install 'fastcontact[completion]'")
    if shutil.which("bash") is None:
        pytest.skip("needs bash")
    path = tmp_path_factory.mktemp("completion") / "script.bash"
    command = [sys.executable, "-m", "fastcontact", "--print-completion", "bash"]
    path.write_bytes(subprocess.run(command, capture_output=True, check=True, timeout=120).stdout)
    return path


def offered(script, folder, *words):
    """What bash offers for the last of these words."""
    line = " ".join(f"'{word}'" for word in words)
    text = (
        f"source {script}; COMP_WORDS=({line}); COMP_CWORD={len(words) - 1}; "
        "$(complete -p fastcontact | sed 's/.*-F //; s/ .*//') fastcontact "
        f"'{words[-1]}'; printf '%s\\n' \"${{COMPREPLY[@]}}\""
    )
    run = subprocess.run(["bash", "-c", text], cwd=folder, capture_output=True, text=True, check=True, timeout=60)
    return set(run.stdout.split())


def test_bash_completes_commands_options_and_files(script, tmp_path):
    (tmp_path / "mine.toml").write_text("")
    assert offered(script, tmp_path, "fastcontact", "pro") == {"profile"}
    assert {"plot", "run", "sweep"} <= offered(script, tmp_path, "fastcontact", "")
    assert offered(script, tmp_path, "fastcontact", "plot", "--ani") == {"--animate"}
    assert "--strict" in offered(script, tmp_path, "fastcontact", "run", "--")
    assert "mine.toml" in offered(script, tmp_path, "fastcontact", "run", "mi")
    assert "mine.toml" in offered(script, tmp_path, "fastcontact", "run", "x.toml", "-o", "mi")


@pytest.mark.parametrize("shell", ["zsh", "tcsh"])
def test_other_shells_have_scripts(shell, capsys):
    pytest.importorskip("shtab", reason="needs shtab: pip install 'fastcontact[completion]'")
    with pytest.raises(SystemExit) as done:
        main(["--print-completion", shell])
    assert not done.value.code
    text = capsys.readouterr().out
    assert "fastcontact" in text
    assert "sweep" in text


def test_without_the_library_it_says_what_to_install(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "shtab", None)
    assert "pip install 'fastcontact[completion]'" in output_of(capsys, ["--print-completion", "bash"], 1)


def test_a_shell_that_is_not_known_is_told(capsys):
    assert "fis" in output_of(capsys, ["--print-completion", "fis"], 1)


mpl.use("Agg")


@pytest.fixture
def results(solved_case, tmp_path):
    shutil.copy(solved_case / "old.vtkhdf", tmp_path / "old.vtkhdf")
    return tmp_path / "old.vtkhdf"


@pytest.mark.parametrize("scale", ["nan", "-inf", "1e308", "-1e40"])
def test_a_scale_that_cannot_be_drawn(results, scale, capsys):
    picture = results.with_name("a.png")
    assert output_of(capsys, ["plot", str(results), f"--scale={scale}", "--png", str(picture)], 1) == (
        f"error: scale = {float(scale):g} must be a finite number, and not so large that coordinates overflow\n"
    )
    assert not picture.exists()


@pytest.mark.parametrize("scale", ["0", "-1", "1e6"])
def test_a_scale_that_can(results, scale):
    assert main(["plot", str(results), f"--scale={scale}", "--png", str(results.with_name("a.png")), "-q"]) == 0


def test_characters_that_the_font_of_a_picture_lacks_are_told_in_a_line(solved_case, tmp_path, capsys):
    shutil.copytree(solved_case, tmp_path / "case")
    case = tmp_path / "case" / "case.toml"
    case.write_text(case.read_text(encoding="utf-8").replace('title = "', 'title = "\u65e5\u672c '), encoding="utf-8")
    picture = tmp_path / "a.png"
    assert main(["run", str(case), "-o", str(tmp_path / "a.vtkhdf"), "--plot", str(picture), "-q"]) == 0
    lines = [line for line in capsys.readouterr().err.splitlines() if "Glyph" in line]
    assert [line.partition(": ")[0] for line in lines] == ["warning", "warning"]
    assert sys.modules["matplotlib"] is mpl
    assert picture.exists()


CASE_TEXT = spheres(10.0, 1)


def test_a_case_file_is_told(tmp_path, capsys):
    path = tmp_path / "a.toml"
    path.write_text(CASE_TEXT)
    said = output_of(capsys, ["info", str(path)])
    assert "hertz" in said
    assert "CONT1" in said


def test_what_is_written_otherwise_is_told(tmp_path, capsys):
    path = tmp_path / "a.toml"
    path.write_text(CASE_TEXT.replace("[[material]]", "[material]"))
    assert main(["run", str(path), "-o", str(tmp_path / "a.vtkhdf")]) == 1
    assert "write [[material]] in place of [material]" in capsys.readouterr().err
    path.write_text(CASE_TEXT)
    assert main(["sweep", str(path), "--set", "friction=0.1,0.2", "--json", str(tmp_path / "a.json")]) == 1
    assert capsys.readouterr().err == "error: 'friction' belongs to a pair: write contact.hertz.friction\n"
    assert main(["sweep", str(path), "--set", "material.E=1,2", "--json", str(tmp_path / "a.json")]) == 1
    assert capsys.readouterr().err == "error: 'material.E' needs the number of a table before 'E', such as [0]\n"
    assert main(["mesh", "block", "--size", "2,1", "-o", str(tmp_path / "a.med")]) == 1
    assert "--size: expected 2 arguments, separated by blanks;" in capsys.readouterr().err


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_case_from_a_pipe_is_told(tmp_path, capsys):
    os.mkfifo(tmp_path / "a.toml")
    for case in (str(tmp_path / "a.toml"), "-"):
        assert main(["run", case, "-o", str(tmp_path / "a.vtkhdf")]) == 1
        assert "is a pipe or a terminal, and a case is read more than once" in capsys.readouterr().err


def test_warnings_take_one_line(tmp_path, capsys):
    warned, refused = output_of(capsys, ["mesh", "box", "-o", str(tmp_path / "a.stl")], 1).splitlines()
    assert warned.startswith("warning: stl files have no named groups")
    assert refused.startswith("error: ")
