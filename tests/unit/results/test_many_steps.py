"""Many small steps in one file: what one more of them costs does not grow with those that are there."""

from __future__ import annotations

from pathlib import Path

import pytest
from test_result_files import MESH, assert_same, nth_step

from fastcontact import ResultWriter, open_results
from fastcontact.results import contents, writer
from fastcontact.results.committed_file import CommittedFile


@pytest.mark.parametrize("synchronise", [False, True])
def test_a_step_writes_what_it_adds_and_little_more(
    synchronise: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A part of a table or an index that changes is not written as a whole."""
    written: list[int] = []
    ends: list[int] = []
    put = CommittedFile._put

    def counted(self: CommittedFile, place: int, data: bytes) -> None:
        written[-1] += len(data)
        put(self, place, data)

    monkeypatch.setattr(CommittedFile, "_put", counted)
    with ResultWriter(tmp_path / "run.vtkhdf", MESH, synchronise=synchronise) as out:
        for number in range(240):
            written.append(0)
            out.write(nth_step(number))
            ends.append(out._committed.end)
        written.append(0)
    added = (ends[239] - ends[79]) / 160
    early, late = sum(written[80:160]) / 80, sum(written[160:240]) / 80
    assert late < (4.0 if synchronise else 2.5) * added  # synchronised, changes go to the journal, too
    assert late < 1.1 * early


@pytest.mark.parametrize("shared", [contents.SHARED, 0])
def test_indices_do_not_gather_in_memory(shared: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """However little HDF5 may keep, the file holds every step."""
    monkeypatch.setattr(contents, "SHARED", shared)
    monkeypatch.setattr(writer, "INDICES", 1 << 13)
    path, kept = tmp_path / "run.vtkhdf", []
    with ResultWriter(path, MESH) as out:
        for number in range(150):
            out.write(nth_step(number))
            kept.append(out._file.id.get_mdc_size()[2])
    assert max(kept[100:]) <= max(kept[:50])
    with open_results(path) as results:
        assert len(results) == 150
        for number, step in enumerate(results):
            assert_same(step, nth_step(number), f"step {number}")
