"""If a disk fails at any call of a command: one line, exit code 1, no data lost, no files left behind."""

import shutil
from pathlib import Path

import disk_faults
import feature_cases
import pytest

COMMANDS = [
    ["run", "case.toml", "-o", "case.vtkhdf", "-q", "--json", "case.json"],
    ["run", "case.toml", "-o", "case.vtkhdf", "-q", "--resume"],
    ["export", "old.vtkhdf", "--med", "old.med", "-q"],
    ["export", "old.vtkhdf", "--xdmf", "old.xdmf", "-q"],
    ["profile", "old.vtkhdf", "--csv", "old.csv", "--agr", "old.agr", "-q"],
    ["profile", "old.vtkhdf", "--png", "old.png", "-q"],
    ["mesh", "half-spheres", "--size", "10", "-o", "old.med", "-q"],
    ["mesh", "half-spheres", "--size", "10", "-o", "new.msh", "-q"],
    ["cases", "--copy", "forma04a", "-o", "copy.toml", "-q"],
]
HISTORIES = ("plastic with friction", "rubber", "heat of friction", "cohesive layer", "fluid", "modes")


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    built = disk_faults.build(tmp_path_factory.mktemp("library"))
    if built is None:
        pytest.skip("needs Linux and a C compiler")
    return built


@pytest.fixture(scope="module")
def source(solved_case: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A case with its mesh, results of a run, and files that commands replace."""
    folder = tmp_path_factory.mktemp("faults") / "source"
    shutil.copytree(solved_case, folder)
    shutil.copy(folder / "coarse.med", folder / "old.med")
    for name in ("old.csv", "old.agr", "old.xdmf", "old.png"):
        (folder / name).write_text("old\n")
    return folder


def of_histories(folder: Path) -> list[list[str]]:
    """Write the cases of bodies and interfaces with a history, and return the commands that run them."""
    cases = [feature_cases.written(name, folder).name for name in HISTORIES]
    return [["run", case, "-o", "new.vtkhdf", "-q", "--json", "new.json"] for case in cases]


def check(library: Path, source: Path, folder: Path, commands: list[list[str]], count: int) -> None:
    faults = disk_faults.found(library, folder, source, commands, count)
    assert len(faults) > 2 * len(commands)
    assert [text for fault in faults for text in disk_faults.complaints(fault)] == []


def test_a_disk_that_fails_ends_a_command_with_one_line(library, source, tmp_path):
    """The first and the last call of every third command, in children of one process."""
    check(library, source, tmp_path, COMMANDS[::3], 2)


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: "-".join(command[:1] + command[-2:]))
def test_every_call_that_fails_ends_a_command_with_one_line(command, library, source, tmp_path):
    check(library, source, tmp_path, [command], 0)


@pytest.mark.slow
@pytest.mark.parametrize("count", [2, 30])
def test_a_disk_that_fails_under_a_history(count, library, tmp_path):
    """The first and the last call while a plastic body is solved; at thirty calls the six cases."""
    (folder := tmp_path / "source").mkdir()
    commands = of_histories(folder)
    check(library, folder, tmp_path / "work", commands if count > 2 else commands[:1], count)
