"""A few hundred damaged files of every format; `bench/fuzz.py` reads ten thousand."""

import sys
from collections import Counter

import fuzz_readers
import fuzz_run
import pytest

import fastcontact as fc

N_FILES = 250


@pytest.mark.skipif(sys.platform != "linux", reason="limits of memory and time as Linux knows them")
def test_damaged_files_are_read_or_refused_and_nothing_else(tmp_path):
    fuzz_run.prepare(tmp_path)
    found = fuzz_run.run(list(range(N_FILES)), 1, tmp_path)
    assert not found.failures, found.table()
    total = sum(found.counts.values(), Counter())
    assert total.total() == N_FILES
    assert total["refused"] > N_FILES // 2
    assert total["read"] > N_FILES // 20
    assert found.slowest[0] < 10


@pytest.mark.parametrize(
    ("error", "kind"),
    [
        (None, "read"),
        (fc.errors.FileError("'x' is damaged: write it anew"), "refused"),
        (fc.errors.FileError("x" * 3000), "many lines"),
        (fc.errors.FileError(""), "many lines"),
        (RuntimeError("what"), "other error"),
        (SystemExit(1), "other error"),
        (MemoryError(), "memory"),
        (OSError("Unable to allocate 3.5 TiB for an array"), "memory"),
    ],
)
def test_the_fuzzer_tells_what_it_finds(monkeypatch, tmp_path, error, kind):
    def read(path):
        if error is not None:
            raise error

    monkeypatch.setattr(fuzz_readers, "read", read)
    assert fuzz_readers.outcome(tmp_path)[0] == kind


def test_memory_that_is_wanted_behind_a_clear_error_is_seen(monkeypatch, tmp_path):
    def read(path):
        try:
            raise MemoryError
        except MemoryError as error:
            raise fc.errors.FileError("'x' is damaged") from error

    monkeypatch.setattr(fuzz_readers, "read", read)
    assert fuzz_readers.outcome(tmp_path)[0] == "memory"


@pytest.mark.skipif(sys.platform != "linux", reason="limits of memory and time as Linux knows them")
@pytest.mark.parametrize(
    ("code", "kind"),
    [("import os; os.abort()", "crash"), ("while True: pass", "hang"), ("bytearray(1 << 31)", "memory"),
     ("open('/etc/hostname').close()", "outside"), ("path.parent.joinpath('mine').touch()", "read")],
)  # fmt: skip
def test_the_fuzzer_survives_and_tells_what_a_reader_does(monkeypatch, tmp_path, code, kind):
    """A reader that does `code`, which a module in front of the true one brings into the worker."""
    fuzz_run.prepare(tmp_path)
    fake = tmp_path / "fake"
    fake.mkdir()
    (fake / "sitecustomize.py").write_text(
        "import sys\n"
        "if sys.argv[0:1] and 'seeds' in ''.join(getattr(sys, 'orig_argv', [])):\n"
        "    sys.path.insert(0, sys.orig_argv[1].rsplit('/', 1)[0])\n"
        "    import fuzz_readers\n"
        "    before = fuzz_readers.read\n"
        "    def read(path):\n"
        "        before(path) if 'seeds' in str(path) else act(path)\n"
        f"    def act(path):\n        {code}\n"
        "    fuzz_readers.read = read\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(fake))
    monkeypatch.setenv("FUZZ_SECONDS", "1")
    found = fuzz_run.run([0], 1, tmp_path)
    assert list(found.counts.values()) == [Counter({kind: 1})]
