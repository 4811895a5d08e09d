"""Result files of all features with a history, forged data set by data set: read, or refused with one line."""

import json
import shutil
from pathlib import Path

import feature_cases
import h5py
import killing
import numpy as np
import pytest

import fastcontact as fc
from fastcontact.cases.case import read_case

pytestmark = pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")
ROWS = 1 << 40  # of an array that declares more than any file holds


def forged(values, how):
    """Return what stands in the place of the values of a data set, as arguments of `create_dataset`; None for nothing."""
    shape, kind = values.shape, values.dtype
    if how == "deleted":
        return None
    if how == "none":
        return {"data": np.zeros((0, *shape[1:]), kind)}
    if how == "scalar":
        return {"data": np.zeros((), kind if kind.names is None else np.float64)}
    if how == "texts":
        return {"data": np.full(shape or 1, b"x")}
    if how == "huge":
        tail = shape[1:]
        return {"shape": (ROWS, *tail), "maxshape": (None, *tail), "chunks": (64, *tail), "dtype": kind}
    if how == "not finite":
        spoilt = np.array(values)
        for name in kind.names or [None]:
            column = spoilt if name is None else spoilt[name]
            column[...] = np.nan if column.dtype.kind == "f" else -1 if column.dtype.kind == "i" else 255
        return {"data": spoilt}
    raise AssertionError(how)


WAYS = ("deleted", "none", "scalar", "texts", "huge", "not finite")


def data_sets(path):
    found = []
    with h5py.File(path, "r") as file:
        file.visititems(lambda name, item: found.append(name) if isinstance(item, h5py.Dataset) else None)
    return found


def told(case, path):
    """Read all of a file and go on with it; return what is wrong with what is said, None for one line or none."""
    try:
        with fc.open_results(path) as results:
            for step in results:
                assert np.shape(step.displacement) == case.mesh.points.shape
        with fc.ResultWriter(path, case.model, resume=True) as out:
            for step in fc.solve_steps(case.model, case.ramp, criteria=case.criteria, resume=out.done):
                out.write(step)
    except fc.FastcontactError as error:
        return None if "\n" not in str(error) else f"several lines: {error}"
    except Exception as error:
        return repr(error)[:300]
    return None


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    """Files of runs that stopped after two steps, by the name of the case."""
    folder, found = tmp_path_factory.mktemp("features"), {}
    for name in ("heat of friction", "cohesive layer", "plastic", "fluid"):
        case = read_case(feature_cases.written(name, folder))
        path = folder / f"{name}.vtkhdf"
        with fc.ResultWriter(path, case.model) as out:
            for step in fc.solve_steps(case.model, case.ramp, criteria=case.criteria):
                out.write(step)
                if step.index == 2:
                    break
        found[name] = case, path
    return found


OF_FEATURES = {
    "heat of friction": ("VTKHDF/PointData/temperature", "VTKHDF/PointData/heat_reaction", "contact/0/rows"),
    "cohesive layer": ("contact/0/rows", "contact/0/steps", "contact/0/primary", "restart0", "restart1"),
    "plastic": ("CellData/plastic_strain", "CellData/yield_ratio", "CellDataOffsets/plastic_strain", "restart1"),
    "fluid": ("contact/0/rows", "restart1"),
}


@pytest.mark.parametrize("every", [False, pytest.param(True, marks=pytest.mark.slow)], ids=["own", "every"])
@pytest.mark.parametrize("name", OF_FEATURES)
def test_forged_data_sets(name, every, stopped, tmp_path: Path):
    case, sound = stopped[name]
    wrong, tried = [], 0
    for place in data_sets(sound):
        if not every and not place.endswith(OF_FEATURES[name]):
            continue
        for how in WAYS:
            path = tmp_path / "forged.vtkhdf"
            shutil.copy(sound, path)
            with h5py.File(path, "r+") as file:
                made = forged(file[place][()], how)
                del file[place]
                if made is not None:
                    file.create_dataset(place, **made)
            tried += 1
            if (complaint := told(case, path)) is not None:
                wrong.append(f"{place} {how}: {complaint}")
    assert wrong == []
    assert tried >= 6 * len(OF_FEATURES[name])


# After a kill, every feature with a history resumes with the bits of an uninterrupted run, in every array.


def write(case, path, parts=None, stop=None):
    """Solve a case into a file, and its first `stop` steps into the file `parts` as well, abandoned there as by a kill."""
    out = fc.ResultWriter(path, case.model, resume=stop is None)
    killed = fc.ResultWriter(parts, case.model) if stop else None
    steps = fc.solve_steps(
        case.model, case.ramp, criteria=case.criteria, linear_solver=case.linear_solver, resume=out.done
    )
    for step in steps:
        out.write(case.finished(step))
        if stop is not None and step.index <= stop:
            killed.write(case.finished(step))
        if step.index == stop:
            killed._committed.exclusive = False  # nothing more reaches the file
            killed._file.close()
            killed._committed.close()
            killed._lock.release()
    out.close()


def plain(value):
    """Return what JSON makes of a value."""
    return json.loads(json.dumps(value, default=lambda array: np.asarray(array).tolist()))


@pytest.mark.parametrize("stop", [3, *(pytest.param(stop, marks=pytest.mark.slow) for stop in (1, 5))])
@pytest.mark.parametrize("name", feature_cases.CASES)
def test_a_killed_run_goes_on_with_the_same_bits(name: str, stop: int, tmp_path: Path):
    case = read_case(feature_cases.written(name, tmp_path))
    whole, parts = tmp_path / "whole.vtkhdf", tmp_path / "parts.vtkhdf"
    write(case, whole, parts, stop)
    write(read_case(feature_cases.written(name, tmp_path)), parts)
    assert killing.differing(whole, parts) == []
    with fc.open_results(whole) as one, fc.open_results(parts) as other:
        assert len(one) == len(other) == 6
        for step, again in zip(one, other, strict=True):
            assert (step.index, step.load_factor, step.warnings) == (again.index, again.load_factor, again.warnings)
            assert plain(step.iterations) == plain(again.iterations)
