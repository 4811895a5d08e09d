"""Result files survive any end of their writer, can be continued, and hold many steps."""

import contextlib
import dataclasses
import os
import shutil
from pathlib import Path

import numpy as np
import pytest
from models import supported, with_contact
from refusals import refused
from test_result_files import MESH, assert_holds, assert_same, nth_step, step_result

import fastcontact as fc
from fastcontact import ConvergenceError, FileError, ModelError, ResultWriter, open_results
from fastcontact._tools.packing import pack, unpack
from fastcontact.results import committed_file, reader, write_arrays, writer
from fastcontact.results.committed_file import CommittedFile


def spheres(E: float = 20_000.0, friction: float = 0.0, arc: float = 3.0) -> fc.Model:
    mesh = fc.generate.half_spheres("quad4", arc_sizes=(arc, 6.0), segments=3)
    model = fc.Model(mesh, "axisymmetric", case_text="first")
    model.add_material(fc.LinearElastic(E=E, nu=0.3))
    supported(model, A1A2="x", A2B2={"y": -2.0}, A1B1={"y": +2.0})
    return with_contact(model, "hertz", "CONT1", "CONT2", formulation="node_to_segment", friction=friction)


def begun(path: Path, instants: tuple[float, ...], model: fc.Model | None = None) -> list[fc.StepResult]:
    """A file with some steps, complete for a short ramp."""
    model = model or spheres()
    with ResultWriter(path, model) as out:
        return fc.solve(model, fc.Ramp(instants), on_step=out.write)


def resumed(path: Path, ramp: fc.Ramp, model: fc.Model | None = None, **options) -> list[fc.StepResult]:
    model = model or spheres()
    with ResultWriter(path, model, resume=True) as out:
        return fc.solve(model, ramp, on_step=out.write, resume=out.done, **options)


# ------------------------------------------------------------------------------------- any write may be last


def recorded(path: Path, n_steps: int, monkeypatch: pytest.MonkeyPatch) -> tuple[list[tuple[int, bytes]], list[int]]:
    """All writes after the file was begun, and how many of them each step took; the begun file is left in `crashed`."""
    writes: list[tuple[int, bytes]] = []
    put = committed_file.CommittedFile._put

    def record(self: committed_file.CommittedFile, place: int, data: bytes) -> None:
        writes.append((place, bytes(data)))
        put(self, place, data)

    monkeypatch.setattr(committed_file.CommittedFile, "_put", record)
    ends = []
    with ResultWriter(path, MESH, synchronise=False) as out:  # as runs begin, whatever this machine takes
        shutil.copy(path, path.with_name("crashed.vtkhdf"))
        for number in range(n_steps):
            out.write(nth_step(number))
            ends.append(len(writes))
    return writes, ends


@pytest.mark.parametrize("apart", [12, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize(("n_steps", "from_step"), [(2, 0), (65, 64)])
def test_every_write_may_be_the_last_one(
    n_steps: int, from_step: int, apart: int, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With step 65 the nodes of HDF5's indices are full and fall in two."""
    writes, ends = recorded(path, n_steps, monkeypatch)
    begin = ends[from_step - 1] if from_step else 0
    assert len(writes) > begin + 50
    crashed = path.with_name("crashed.vtkhdf")
    with open(crashed, "r+b", buffering=0) as file:
        file.truncate(path.stat().st_size + 100_000)  # the file may be longer than its contents
        for number, (place, data) in enumerate(writes, start=1):
            file.seek(place)
            file.write(data)
            if number < begin or number % apart:
                continue
            finished = sum(end <= number for end in ends)
            with open_results(crashed) as results:
                assert finished <= len(results) <= finished + 1
                count = len(results)
                for which in {0, count // 2, *range(max(count - 8, 0), count, 2)} if count else ():
                    assert_same(results[which], nth_step(which), f"write {number}, step {which}")
                expected = [nth_step(which).load_factor for which in range(len(results))]
                assert list(results.load_factors) == expected
                assert list(results._file["VTKHDF/Steps/Values"][: len(results)]) == expected


def test_a_committed_file_is_a_file(tmp_path: Path) -> None:
    """Random reads and writes against bytes in memory."""
    random = np.random.default_rng(5)
    path = tmp_path / "bytes"
    image = bytearray(random.bytes(300))
    path.write_bytes(image)
    file = committed_file.CommittedFile(path)
    for _ in range(2000):
        place, size = int(random.integers(0, 400)), int(random.integers(1, 60))
        file.seek(place)
        action = random.random()
        if action < 0.5:
            data = random.bytes(size)
            image.extend(bytes(max(place + size - len(image), 0)))
            image[place : place + size] = data
            file.write(data)
        elif action < 0.95:
            assert file.read(size) == bytes(image[place : place + size]).ljust(size, b"\0")
            assert file.tell() == place + size
        else:
            file.flush()
            assert path.read_bytes() == image
    assert file.seek(0, os.SEEK_END) == len(image)
    file.truncate(len(image))
    file.flush()
    file.close()
    file.close()
    assert path.read_bytes() == image


# ------------------------------------------------------------------------------------------- writing on


def test_without_a_file_or_without_a_step_a_run_begins(path: Path) -> None:
    with ResultWriter(path, spheres(arc=2.0), resume=True) as out:
        assert (out.done, out.n_steps) == ([], 0)
    assert len(resumed(path, fc.linear_ramp(1))) == 1
    assert len(open_results(path)) == 1


def test_a_finished_file_stays_as_it_is(path: Path) -> None:
    begun(path, (0.5, 1.0))
    before = path.read_bytes(), path.stat().st_mtime_ns
    assert [step.load_factor for step in resumed(path, fc.linear_ramp(2))] == [0.5, 1.0]
    assert (path.read_bytes(), path.stat().st_mtime_ns) == before
    assert os.listdir(path.parent) == [path.name]


def test_a_file_whose_writer_died_before_it_could_say_so_is_finished(path: Path) -> None:
    model = spheres()
    out = ResultWriter(path, model)
    fc.solve(model, fc.linear_ramp(2), on_step=out.write)
    del out
    assert not open_results(path).complete
    resumed(path, fc.linear_ramp(2))
    assert open_results(path).complete


def test_what_a_dead_writer_left_of_a_step_is_written_over(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with ResultWriter(path, MESH, cell_fields=("error",)) as out:
        steps = [_with_error(step_result(number)) for number in range(3)]
        out.write(steps[0])
        with monkeypatch.context() as patch:
            patch.setattr(write_arrays, "append_offsets", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
            with pytest.raises(KeyboardInterrupt):
                out.write(steps[2])
    with ResultWriter(path, MESH, cell_fields=("error",), resume=True) as out:
        assert out.n_steps == len(out.done) == 1
        out.write(steps[1])
    for number, found in enumerate(open_results(path)):
        np.testing.assert_array_equal(found.cell_fields["error"], steps[number].cell_fields["error"])
        assert_same(dataclasses.replace(found, cell_fields={}), step_result(number))


def _with_error(step: fc.StepResult) -> fc.StepResult:
    count = sum(map(len, MESH.solids.values()))
    return dataclasses.replace(step, cell_fields={"error": np.full(count, float(step.index))})


def test_a_failed_run_is_tried_again_from_its_last_step(path: Path) -> None:
    few = fc.Criteria(max_geometry_updates=3, max_halvings=0)
    ramp = fc.Ramp((0.05, 0.1, 1.0))
    with pytest.raises(ConvergenceError):
        resumed(path, ramp, spheres(friction=0.1), criteria=few)
    results = open_results(path)
    assert not results.complete
    assert 0 < len(results) < 3
    assert "did not converge in 3 updates" in results.error
    with pytest.raises(ConvergenceError):
        resumed(path, ramp, spheres(friction=0.1), criteria=few)
    assert "did not converge in 3 updates" in open_results(path).error
    resumed(path, ramp, spheres(friction=0.1))
    results = open_results(path)
    assert results.complete
    assert results.error == ""
    assert len(results) == 3
    (whole,) = fc.solve(spheres(friction=0.1), ramp)[2:]
    assert np.abs(results[2].displacement - whole.displacement).max() <= 1e-10 * np.abs(whole.displacement).max()


def test_the_case_text_of_the_last_steps_counts(path: Path) -> None:
    begun(path, (0.5,))
    model = spheres()
    model.case_text = "second"
    resumed(path, fc.linear_ramp(2), model)
    assert open_results(path).case_text == "second"


# --------------------------------------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"formulation": "node_to_segment"}, "formulation='node_to_segment'"),
        ({"formulation": "continuous"}, "formulation='continuous'"),
        ({"formulation": "mortar"}, "formulation='mortar'"),
        ({"formulation": "mortar", "multipliers": "standard"}, "formulation='mortar', multipliers='standard'"),
    ],
)
def test_a_pair_that_named_no_formulation_is_told_which_one_it_had(options: dict, message: str, path: Path) -> None:
    """Defaults change from version to version; the steps so far are those of another one."""
    begun(path, (0.5,), formulated(**options))
    told = rf"changed since: contact 'hertz'\. .* \(contact 'hertz' had {message}: specify this formulation\)"
    refused(ModelError, told, resumed, path, fc.linear_ramp(2), formulated())
    assert len(resumed(path, fc.linear_ramp(2), formulated(**options))) == 2


def formulated(**options: str) -> fc.Model:
    model = spheres()
    model.contact.clear()
    return with_contact(model, "hertz", "CONT1", "CONT2", friction=0.0, **options)


def test_other_options_that_change_the_answer_are_refused(path: Path) -> None:
    begun(path, (0.5,))
    with pytest.raises(ModelError, match="changed since: the option geometry_updates, the option keep_pairing"):
        resumed(path, fc.linear_ramp(2), criteria=fc.Criteria(keep_pairing=True, geometry_updates=0))


def test_another_mesh_is_refused(path: Path) -> None:
    begun(path, (0.5,))
    before = path.read_bytes()
    with pytest.raises(FileError, match="belongs to another mesh: resume the case of the file, or start anew"):
        ResultWriter(path, spheres(arc=2.0), resume=True)
    with pytest.raises(FileError, match="belongs to another kinematics"):
        ResultWriter(path, spheres().mesh, kinematics="plane_strain", resume=True)
    with pytest.raises(FileError, match=r"contain the cell fields none, not \['error'\]: ask for the same ones"):
        ResultWriter(path, spheres(), cell_fields=("error",), resume=True)
    assert path.read_bytes() == before
    assert os.listdir(path.parent) == [path.name]


# ------------------------------------------------------------------------------------------- accidents


def test_a_folder_that_vanishes_is_told_at_the_next_step(tmp_path: Path) -> None:
    folder = tmp_path / "here"
    folder.mkdir()
    model = spheres()

    def on_step(step: fc.StepResult) -> None:
        out.write(step)
        folder.rename(tmp_path / "there")

    message = r"is no longer there: .*, moved or replaced after 1 steps\. Put it back and resume"
    told = pytest.raises(FileError, match=message)
    with told, ResultWriter(folder / "run.vtkhdf", model) as out:
        fc.solve(model, fc.linear_ramp(3), on_step=on_step)
    moved = tmp_path / "there" / "run.vtkhdf"
    results = open_results(moved)
    assert len(results) == 1
    assert "no longer there" in results.error
    assert len(resumed(moved, fc.linear_ramp(3))) == 3


# ---------------------------------------------------------------------------------------------- packing


def test_packed_data_come_back() -> None:
    arrays = [np.arange(6.0).reshape(2, 3), np.array([True, False]), np.empty((0, 2)), np.arange(3, dtype=np.int32).T]
    data = {"a": [1, 2.5, None, True, "é", float("inf")], "b": {"c": arrays, "": {}}, "n": np.float64(0.1)}
    found = unpack(np.concatenate([pack(data), np.zeros(9, np.uint8)]))
    assert found["a"] == data["a"]
    assert found["n"] == 0.1
    for one, other in zip(found["b"]["c"], arrays, strict=True):
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other)


def test_damaged_packed_data_are_noticed() -> None:
    raw, harmless = pack({"a": np.arange(20.0)}), 0
    random = np.random.default_rng(1)
    for _ in range(200):
        changed = raw.copy()
        changed[random.integers(0, len(raw))] ^= np.uint8(1 << random.integers(0, 8))
        with contextlib.suppress(ValueError, LookupError, TypeError):
            found = unpack(changed)  # blanks, or the number of a name that nobody asks for
            np.testing.assert_array_equal(found["a"], np.arange(20.0))
            harmless += 1
    assert harmless < 20
    for size in (0, 10, len(raw) - 1):
        with pytest.raises((ValueError, LookupError, TypeError)):
            unpack(raw[:size])
    refused(ValueError, "is not a packed array", unpack, pack({"a": np.array(["text"])}))


def test_a_damaged_state_is_no_state(path: Path) -> None:
    import h5py

    begun(path, (0.5,))
    with h5py.File(path, "r+") as file:
        file["fastcontact/restart0"][50] ^= 255
    assert open_results(path)[-1].restart is None
    refused(ModelError, "does not contain restart data", resumed, path, fc.linear_ramp(2))


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
@pytest.mark.parametrize("shared", [pytest.param(write_arrays.MAX_SHARED, marks=pytest.mark.slow), 0])
def test_indices_do_not_gather_in_memory(shared: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """However little HDF5 may keep, the file holds every step."""
    monkeypatch.setattr(write_arrays, "MAX_SHARED", shared)
    monkeypatch.setattr(writer, "METADATA_CACHE", 1 << 13)
    path, kept = tmp_path / "run.vtkhdf", []
    with ResultWriter(path, MESH) as out:
        for number in range(60):
            out.write(nth_step(number))
            kept.append(out._file.id.get_mdc_size()[2])
    assert max(kept[36:]) <= max(kept[:24])
    assert_holds(path, 60, nth_step)


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
    assert_holds(path, 80, nth_step)
