"""Many small steps in one file: the cost of a step does not grow with their number."""

from __future__ import annotations

from pathlib import Path

import pytest
from test_result_files import MESH, assert_same, nth_step

from fastcontact import ResultWriter, open_results
from fastcontact.results import reader, write_arrays, writer
from fastcontact.results.committed_file import CommittedFile


@pytest.mark.parametrize("synchronise", [pytest.param(False, marks=pytest.mark.slow), True])
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
        for number in range(150):
            written.append(0)
            out.write(nth_step(number))
            ends.append(out._committed.end)
        written.append(0)
    added = (ends[149] - ends[49]) / 100
    early, late = sum(written[50:100]) / 50, sum(written[100:150]) / 50
    assert late < (4.0 if synchronise else 2.5) * added  # synchronised, changes go to the journal, too
    assert late < 1.1 * early


@pytest.mark.slow
@pytest.mark.parametrize("shared", [pytest.param(write_arrays.SHARED, marks=pytest.mark.slow), 0])
def test_indices_do_not_gather_in_memory(shared: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """However little HDF5 may keep, the file holds every step."""
    monkeypatch.setattr(write_arrays, "SHARED", shared)
    monkeypatch.setattr(writer, "INDICES", 1 << 13)
    path, kept = tmp_path / "run.vtkhdf", []
    with ResultWriter(path, MESH) as out:
        for number in range(60):
            out.write(nth_step(number))
            kept.append(out._file.id.get_mdc_size()[2])
    assert max(kept[36:]) <= max(kept[:24])
    with open_results(path) as results:
        assert len(results) == 60
        for number in range(0, 60, 7):
            assert_same(results[number], nth_step(number), f"step {number}")


def test_a_resumed_file_is_step_by_step(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A long run of a large model is resumed in the memory of its last step; the others are there when they are asked for."""
    path, read = tmp_path / "run.vtkhdf", []
    with ResultWriter(path, MESH) as out:
        for number in range(6):
            out.write(nth_step(number))
    ordinary = reader.Results._step

    def noting(self: reader.Results, number: int) -> object:
        read.append(number)
        return ordinary(self, number)

    monkeypatch.setattr(reader.Results, "_step", noting)
    with ResultWriter(path, MESH, resume=True) as out:
        assert (len(out.done), read) == (6, [5])
        assert repr(out.done).endswith("6 steps)")
        assert_same(out.done[-1], nth_step(5), "last")
        assert_same(out.done[-6], nth_step(0), "first")
        assert [step.index for step in out.done] == [1, 2, 3, 4, 5, 6]
        for number in range(6, 80):  # the file changes, the index of its fields gets another level
            out.write(nth_step(number))
        for number, step in enumerate(out.done):
            assert_same(step, nth_step(number), f"step {number}")
        assert [step.index for step in out.done[1:3]] == [2, 3]
        with pytest.raises(IndexError):
            out.done[6]
    with open_results(path) as results:
        assert len(results) == 80
