"""Forged, truncated or dismantled result files: one line, before anything large is read."""

from __future__ import annotations

import hashlib
import os
import shutil

import h5py
import pytest
from test_resume import spheres

import fastcontact as fc
from fastcontact.results import journal, layout

RAMP = fc.Ramp((0.1, 0.2, 0.3), ((0.0, 0.0), (1.0, 1.0)))


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    path = tmp_path_factory.mktemp("forged") / "sound.vtkhdf"
    model = spheres()
    with fc.ResultWriter(path, model) as out:
        fc.solve(model, fc.Ramp((0.1, 0.2), RAMP.table), on_step=out.write)
    return path


def with_journal(sound, folder, body):
    """A copy with a journal of these bytes at its end, whose checksum is right."""
    path = folder / "forged.vtkhdf"
    shutil.copy(sound, path)
    with path.open("ab") as file:
        file.write(body + journal.FOOTER.pack(len(body), hashlib.sha256(body).digest(), journal.MAGIC))
    return path


def record(place, count, is_new=True, data=b"\0" * 32):
    return journal.HEADER.pack(place, count, is_new) + data


@pytest.mark.parametrize(
    ("body", "said"),
    [
        (record(0, 1 << 62), "counts data twice"),
        (record(1 << 62, 8), "leads beyond the contents"),
        (record(1 << 62, 8, False, b"\0" * 8), "leads beyond the contents"),
        (record(0, 1 << 40, False, b"\0" * 8), "is cut off"),
        (record(0, 8)[:20], "is cut off"),
        (b"\1" * 7, "is cut off"),
    ],
)
def test_forged_journals(body, said, sound, tmp_path):
    path = with_journal(sound, tmp_path, body)
    with pytest.raises(fc.FileError, match=rf"the journal at the end of '.*' {said}"):
        fc.open_results(path)
    with pytest.raises(fc.FileError, match=said):
        fc.ResultWriter(path, spheres(), resume=True)


def test_the_same_data_hashed_for_ever(sound, tmp_path):
    size = sound.stat().st_size
    digest = hashlib.sha256(sound.read_bytes()).digest()
    path = with_journal(sound, tmp_path, record(0, size, True, digest) * 1000)
    with pytest.raises(fc.FileError, match="counts data twice"):
        fc.open_results(path)
    assert len(fc.open_results(with_journal(sound, tmp_path, record(0, size, True, digest)))) == 2


def test_a_journal_of_gigabytes(sound, tmp_path):
    """A sparse file: nothing of it is read."""
    path = tmp_path / "large.vtkhdf"
    shutil.copy(sound, path)
    with path.open("r+b") as file:
        file.truncate(1 << 36)
        file.seek(0, os.SEEK_END)
        file.write(journal.FOOTER.pack((1 << 36) - 1000, b"\0" * 32, journal.MAGIC))
    with pytest.raises(fc.FileError, match=r"declares 6.87e\+10 bytes"):
        fc.open_results(path)


@pytest.mark.parametrize("name", layout.CONTINUED)
def test_files_that_lack_what_is_written_on(name, sound, tmp_path):
    path = tmp_path / "parts.vtkhdf"
    shutil.copy(sound, path)
    with h5py.File(path, "r+") as file:
        del file[name]
    with pytest.raises(fc.FileError, match=r"^(?!.*\n).*(damaged|lacks)"):
        fc.ResultWriter(path, spheres(), resume=True)


def test_tables_of_another_kind(sound, tmp_path):
    """What shows only as a step is written says that the file is damaged, and not that the disk is full."""
    path = tmp_path / "kind.vtkhdf"
    shutil.copy(sound, path)
    with h5py.File(path, "r+") as file:
        del file["VTKHDF/Steps/Values"]
        file["VTKHDF/Steps/Values"] = 1.0
    model = spheres()
    out = fc.ResultWriter(path, model, resume=True)
    (step,) = fc.solve(model, RAMP, resume=out.done)[2:]
    with pytest.raises(fc.FileError, match="its tables are damaged: name another file"):
        out.write(step)


@pytest.mark.parametrize("lost", ["case", "pairs", "numbers", "solver", "active", "obstacles"])
def test_restart_data_that_lack_a_part(lost, sound):
    last = fc.open_results(sound)[-1]
    del last.restart[lost]
    with pytest.raises(fc.ModelError, match=r"the restart data of step 2 are damaged"):
        fc.solve(spheres(), RAMP, resume=[last])
