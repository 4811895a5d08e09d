"""Damaged files of every format, the first of those that `bench/fuzz.py` reads by the ten thousand."""

import json
import shutil
import sys
from collections import Counter

import fuzz_readers
import fuzz_run
import pytest

import fastcontact as fc


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fuzz")
    fuzz_run.prepare(folder)
    return folder


@pytest.fixture
def one_seed(prepared, tmp_path):
    """A folder with one seed alone: workers, which read one of each format first, start soon."""
    folder = tmp_path / "one"
    (folder / "seeds").mkdir(parents=True)
    (folder / "outside").mkdir()
    names = json.loads((prepared / "seeds" / "seeds.json").read_text(encoding="utf-8"))
    name = next(name for name, file in names.items() if file.endswith(".med"))
    shutil.copy(prepared / "seeds" / names[name], folder / "seeds")
    (folder / "seeds" / "seeds.json").write_text(json.dumps({name: names[name]}), encoding="utf-8")
    return folder


@pytest.mark.skipif(sys.platform != "linux", reason="limits of memory and time as Linux knows them")
@pytest.mark.parametrize("count", [39, pytest.param(1000, marks=pytest.mark.slow)])
def test_damaged_files_are_read_or_refused_and_nothing_else(prepared, count):
    """Within the limits of memory and time, beyond which the worker ends: that is a failure, too."""
    found = fuzz_run.run(list(range(count)), 1, prepared)
    assert not found.failures, found.table()
    total = sum(found.counts.values(), Counter())
    assert total.total() == count
    assert total["refused"] > count // 2
    assert total["read"] > count // 20


@pytest.mark.parametrize(
    ("error", "kind"),
    [
        (None, "read"),
        (fc.errors.FileError("'x' is damaged: write it again"), "refused"),
        (fc.errors.FileError("x" * 3000), "refused"),  # cut
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


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="limits of memory and time as Linux knows them")
@pytest.mark.parametrize(
    ("code", "kind"),
    [
        ("import os; os.abort()", "crash"), ("while True: pass", "hang"), ("bytearray(1 << 31)", "memory"),
        ("open('/etc/hostname').close()", "outside"), ("path.parent.joinpath('mine').touch()", "read"),
    ],
)  # fmt: skip
def test_the_fuzzer_survives_and_tells_what_a_reader_does(monkeypatch, tmp_path, one_seed, code, kind):
    """A reader that does `code`, which a module in front of the true one brings into the worker."""
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
    found = fuzz_run.run([0], 1, one_seed)
    assert list(found.counts.values()) == [Counter({kind: 1})]
