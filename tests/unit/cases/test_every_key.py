"""Any value of any key of a case file is read, or one line names the file and the key."""

import copy
import functools
import math
import re

import pytest

import fastcontact as fc
from fastcontact import cli
from fastcontact._tools.toml_text import dump
from fastcontact.cases import checks, keys
from fastcontact.cases.case import read_case
from fastcontact.cases.model_tables import LISTS, keys_of_list

CASE = {
    "kinematics": "plane_strain",
    "mesh": {"generator": "block-on-block", "divisions_lower": [2, 1], "divisions_upper": [2, 1]},
    "material": [{"E": 1000.0, "nu": 0.3, "conductivity": 5.0, "expansion": 1e-5, "density": 1e-9}],
    "support": [{"group": "LOWER_BOTTOM", "x": 0.0, "y": 0.0}, {"group": "UPPER_TOP", "x": 0.0, "y": -0.1}],
    "contact": {"pair": {"secondary": "CONT_UPPER", "primary": "CONT_LOWER"}},
    "probes": {"P": "UPPER_TOP_LEFT"},
}
SIDE, ENDS = {"group": "UPPER_RIGHT"}, {"first": "LOWER_LEFT", "second": "LOWER_RIGHT"}
# A right entry of every list of tables.
ENTRIES = {
    "material": {"E": 5.0, "nu": 0.3, "groups": ["UPPER"]},
    "support": {**SIDE, "x": 0.0},
    "pressure": {**SIDE, "value": 1.0},
    "traction": {**SIDE, "x": 1.0},
    "body_force": {"x": 1.0, "groups": ["UPPER"]},
    "gravity": {"y": -9.81},
    "centrifugal": {"speed": 1.0, "origin": [0, 0, 0], "direction": [0, 0, 1]},
    "temperature": {"value": 3.0},
    "fixed_temperature": {"group": "UPPER_TOP", "value": 3.0},
    "heat_flux": {**SIDE, "value": 1.0},
    "heat_source": {"value": 1.0},
    "nodal_heat": {**SIDE, "value": 1.0},
    "film": {"group": "LOWER_BOTTOM", "coefficient": 1.0, "ambient": 3.0},
    "initial_stress": {"xx": 1.0},
    "initial_strain": {"xx": 1e-3},
    "force": {**SIDE, "x": 1.0},
    "moment": {**SIDE, "z": 1.0},
    "hydrostatic_pressure": {**SIDE, "weight": 1.0, "level": 1.0},
    "coupling": {"reference": "R", "place": [5.0, 12.0], "group": "UPPER_RIGHT", "kind": "distributing"},
    "couple": {**SIDE, "component": "x"},
    "relation": {"terms": [["UPPER_TOP_RIGHT", "x", 1.0]], "value": 0.0},
    "group_relation": {**ENDS, "component": "y"},
    "periodicity": {**ENDS, "x": 0.0},
    "cyclic_symmetry": {**ENDS, "sectors": 4},
    "spring": {**SIDE, "x": 5.0},
    "pretension": {"name": "B", "section": "UPPER_LEFT", "force": 1.0},
    "fluid_pressure": {"contact": "pair", "pressure": 1.0, "source": "UPPER_LEFT"},
}
OBSTACLE = {"secondary": "UPPER_TOP", "shape": {"kind": "half_space", "point": [0.0, 10.0], "normal": [0.0, -1.0]}}
WRONG = [math.nan, "no such thing", [math.nan], {"no such key": 1}]
FURTHER = [math.inf, -1, 1e300, "", True, [], {}, [[0.0, math.nan], [1.0, 1.0]], ["a"], [{}]]


def places():
    """Yield every key of a case file, by the path to it: a table, a number of its list or None, and the key."""
    for key in [*keys.TOP_LEVEL, *LISTS, "unknown_key"]:
        yield key, lambda data, key=key: (data, key)
    tables = {"solve": keys.SOLVE, "units": keys.UNITS, "study": keys.STUDY, "modes": keys.MODES, "ramp": keys.RAMP}
    for name, known in tables.items():
        for key in [*known, "unknown_key"]:
            yield f"{name}.{key}", lambda data, name=name, key=key: (data.setdefault(name, {}), key)
    lists = {
        **{kind: (keys_of_list(kind)[0], ENTRIES[kind]) for kind in LISTS},
        "check": (checks.CHECK, {"quantity": "pair.force", "value": 3.0, "tolerance": 0.1}),
        "sensitivity": (keys.SENSITIVITY, {"quantity": ["force", "pair"], "by": [["E", "UPPER"]]}),
    }
    for kind, (known, entry) in lists.items():
        for key in [*known, "unknown_key"]:
            yield f"{kind}.{key}", lambda data, kind=kind, entry=entry, key=key: (appended(data, kind, entry), key)
    for key in ("motion", "force", "rotation", "ramp", "shape", "friction", "unknown_key"):
        yield f"obstacle.{key}", lambda data, key=key: (data.setdefault("obstacle", {"o": OBSTACLE})["o"], key)
    for key in ("friction", "cohesion", "adhesion", "conductance", "friction_ramp", "clearance_ramp", "unknown_key"):
        yield f"contact.{key}", lambda data, key=key: (data["contact"]["pair"], key)
        yield f"contacts.{key}", lambda data, key=key: (data.setdefault("contacts", {}), key)
    yield "probes.Q", lambda data: (data["probes"], "Q")


def appended(data: dict, kind: str, entry: dict) -> dict:
    data.setdefault(kind, []).append(copy.deepcopy(entry))
    return data[kind][-1]


def not_finite(value: object) -> bool:
    entries = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    return any(map(not_finite, entries)) or (isinstance(value, float) and math.isnan(value))


def wrong_of(label: str, place, value: object, folder) -> str | None:
    """Return what is wrong with what the reader makes of a value behind a key; None where nothing is."""
    data, path = copy.deepcopy(CASE), folder / "wrong.toml"
    holder, key = place(data)
    holder[key] = value
    path.write_text(dump(data), encoding="utf-8")
    try:
        read_case(path)
    except fc.FastcontactError as error:
        text = str(error)
        if "\n" in text or not text.startswith(f"{path}: "):
            return f"{label} = {value!r}: {text}"
        named = key in text or label.split(".")[0] in text
        return None if named and "of the wrong kind or size (" not in text else f"{label} = {value!r}: {text}"
    except Exception as error:
        return f"{label} = {value!r}: {error!r}"
    return f"{label} = {value!r} was taken" if not_finite(value) and not label.startswith("study") else None


@pytest.mark.parametrize("value", [*WRONG, *(pytest.param(v, marks=pytest.mark.slow) for v in FURTHER)], ids=repr)
def test_every_key(value, tmp_path, monkeypatch):
    monkeypatch.setitem(fc.generate.GENERATORS, "block-on-block", functools.cache(fc.generate.block_on_block))
    assert [told for label, place in places() if (told := wrong_of(label, place, value, tmp_path))] == []


def test_entries_are_right(tmp_path):
    """The sweep changes one key of what is right before."""
    for kind in ENTRIES.keys() - {"cyclic_symmetry", "pretension"}:  # whose facets are nowhere in this mesh
        entry = ENTRIES[kind]
        data, path = copy.deepcopy(CASE), tmp_path / f"{kind}.toml"
        appended(data, kind, entry)
        path.write_text(dump(data), encoding="utf-8")
        assert read_case(path).name == kind


BLOCKS = {"generator": "block-on-block"}


@pytest.mark.parametrize(
    ("study", "said"),
    [
        ({"triangles": {"no_size": 1.0}}, "unknown key 'study.triangles.no_size'"),
        ({"curves": [math.nan]}, r"study.curves\[0\] must be"),
        ({"combinations": [["quad8"]]}, "study.combinations"),
        ({"load_steps": 0}, "load steps must be a positive whole number, not 0"),
        ({**BLOCKS, "quadrangles": {"size_upper": [math.nan, 1.0]}}, r"study.quadrangles.size_upper\[0\] = nan must"),
        ({**BLOCKS, "quadrangles": {"size_upper": [-1.0, 1.0]}}, "quad4 mortar: .*size_upper"),
        ({"options": {"mortar": {"normals": "none"}}}, "contact.pair: unknown kind of normals 'none'"),
        ({"options": {"mortar": {"no_option": 1}}}, "contact.pair: unknown option of mortar 'no_option'"),
        ({"parameters": {"p": {"support[0].y": "value+1"}}}, "study.parameters.p.'support.0..y' = 'value.1' must be"),
        ({"parameters": {"p": {"support[7].y": "value"}}}, "refers to entry .7."),
        ({"quantities": ["P.nothing"]}, "unknown quantity 'P.nothing'"),
        ({"double": ["nothing"]}, "unknown argument of the generator block-on-block in .study. 'nothing'"),
        ({"curves": [{"centre": [0.0, math.inf], "radius": 1.0}]}, "centre = .* must be two finite numbers"),
    ],
)
def test_a_wrong_study_stops_a_run(study, said, tmp_path, capsys):
    data, path = copy.deepcopy(CASE), tmp_path / "study.toml"
    data["study"] = study
    path.write_text(dump(data), encoding="utf-8")
    assert cli.main(["run", str(path), "-o", str(tmp_path / "out.vtkhdf")]) == 1
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert re.search(said, told), told
    assert not (tmp_path / "out.vtkhdf").exists()
