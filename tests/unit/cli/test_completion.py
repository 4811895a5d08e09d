"""Completion in shells: candidates in bash, and the message without the library."""

import shutil
import subprocess
import sys

import pytest

from fastcontact.cli import main


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
    assert main(["--print-completion", "bash"]) == 1
    assert "pip install 'fastcontact[completion]'" in capsys.readouterr().err


def test_a_shell_that_is_not_known_is_told(capsys):
    assert main(["--print-completion", "fis"]) == 1
    assert "fis" in capsys.readouterr().err
