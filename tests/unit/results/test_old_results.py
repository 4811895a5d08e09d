"""Result files of every schema version, the current one included, remain readable (resources/make.py)."""

import gzip
import json
import math
import re
import sys
from pathlib import Path

import numpy as np
import pytest

import fastcontact as fc
from fastcontact import FileError, ResultWriter, open_results
from fastcontact.results import layout

RESOURCES = Path(__file__).parent / "resources"
FILES = sorted(path.name.removesuffix(".vtkhdf.gz") for path in RESOURCES.glob("*.vtkhdf.gz"))
FIELDS = ("displacement", "stress", "von_mises", "von_mises_signed", "reaction")


def version(name: str) -> int:
    found = re.match(r"schema(\d+)-", name)
    assert found, name
    return int(found.group(1))


def missing(names: list[str], last: int) -> set[int]:
    """Schema versions up to the last one of which no file is kept."""
    return set(range(1, last + 1)) - set(map(version, names))


@pytest.fixture(params=FILES)
def old(request: pytest.FixtureRequest, path: Path) -> tuple[Path, dict, int]:
    """A file, what its version had in memory when it wrote it, and the number of that version."""
    path.write_bytes(gzip.decompress((RESOURCES / f"{request.param}.vtkhdf.gz").read_bytes()))
    told = json.loads((RESOURCES / f"{request.param}.json").read_text(encoding="utf-8"))
    return path, told, version(request.param)


def test_a_file_of_every_version_is_kept() -> None:
    """When this fails: run resources/make.py with the version that is missing, and keep what it writes."""
    assert not missing(FILES, layout.SCHEMA)
    assert missing(FILES, layout.SCHEMA + 1) == {layout.SCHEMA + 1}, "a file from the future"
    assert missing([name for name in FILES if version(name) != 1], layout.SCHEMA) == {1}
    assert {f"{name}.json" for name in FILES} == {path.name for path in RESOURCES.glob("*.json")}


def test_old_files_are_read(old: tuple[Path, dict, int]) -> None:
    path, told, schema = old
    with open_results(path) as results:
        assert (results.schema, results.complete, results.case_text) == (schema, True, 'title = "old"\n')
        assert results.mesh.n_points == told["n_points"]
        assert list(results.mesh.group_names) == told["groups"]
        assert len(results) == len(told["steps"]) == 2
        for step, expected in zip(results, told["steps"], strict=True):
            check_step(step, expected)
            # What a writer put into its last step comes back; whether this version can go on from it is another matter.
            assert (step.restart is not None) == (schema >= 2 and step.index == 2)


def check_step(step: fc.StepResult, expected: dict) -> None:
    assert (step.index, step.load_factor) == (expected["index"], expected["load_factor"])
    assert step.iterations == expected["iterations"]
    for name in FIELDS:
        values, (total, largest) = getattr(step, name), expected[name]
        assert math.fsum(values.ravel()) == pytest.approx(total, rel=0, abs=1e-13 * np.abs(values).sum()), name
        assert np.abs(values).max() == largest, name
    (contact,) = step.contact.values()
    for name, values in expected["contact"].items():
        np.testing.assert_array_equal(getattr(contact, name), values, err_msg=name)
    if "warnings" in expected:
        assert list(step.warnings) == expected["warnings"]
    fields = expected.get("cell_fields", {})
    assert set(step.cell_fields) == set(fields)
    for name, values in fields.items():
        np.testing.assert_array_equal(step.cell_fields[name], values)


def test_viewers_are_shown_the_same_steps(old: tuple[Path, dict, int]) -> None:
    reader = pytest.importorskip("vtkmodules.vtkIOHDF", reason="VTK is not installed").vtkHDFReader()
    reader.SetFileName(str(old[0]))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == 2
    for number, expected in enumerate(old[1]["steps"]):
        reader.SetStep(number)
        reader.Update()
        grid = reader.GetOutputDataObject(0)
        assert grid.GetNumberOfPoints() == old[1]["n_points"]
        low, high = grid.GetPointData().GetArray("von_mises").GetRange()
        assert max(abs(low), abs(high)) == expected["von_mises"][1]


@pytest.mark.parametrize("old", [name for name in FILES if version(name) == 1], indirect=True)
def test_files_without_a_restart_state_cannot_be_resumed_and_stay_as_they_are(old: tuple[Path, dict, int]) -> None:
    path, before = old[0], old[0].read_bytes()
    message = "was written by an earlier fastcontact, which stored no data to resume from: name"
    with pytest.raises(FileError, match=message):
        ResultWriter(path, open_results(path).mesh, resume=True)
    assert path.read_bytes() == before


def test_the_maker_writes_what_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files for the next version come from a maker that still works, with the same arrays as those kept now."""
    monkeypatch.syspath_prepend(str(RESOURCES))
    monkeypatch.delitem(sys.modules, "make", raising=False)
    import make

    monkeypatch.setattr(make, "HERE", tmp_path)
    make.make("obstacle-3d", make.obstacle(3))
    name = f"schema{layout.SCHEMA}-obstacle-3d"
    path = tmp_path / "made.vtkhdf"
    path.write_bytes(gzip.decompress((tmp_path / f"{name}.vtkhdf.gz").read_bytes()))
    made, kept = (json.loads((folder / f"{name}.json").read_text()) for folder in (tmp_path, RESOURCES))
    assert made["groups"] == kept["groups"]
    assert made["steps"][-1].keys() == kept["steps"][-1].keys()
    for step, expected in zip(open_results(path), made["steps"], strict=True):
        check_step(step, expected)
    make.make("obstacle-3d", make.obstacle(3))  # keeps what is there
    assert path.read_bytes() == gzip.decompress((tmp_path / f"{name}.vtkhdf.gz").read_bytes())
