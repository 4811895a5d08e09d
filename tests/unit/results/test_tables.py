"""Tables: correct numbers in the right rows, and lossless CSV files."""

from __future__ import annotations

import csv
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from fastcontact.errors import CaseError, FileError, MeshError
from fastcontact.mesh.mesh import Mesh
from fastcontact.results.step import ContactResult, StepResult
from fastcontact.results.tables import (
    contact_table,
    line_table,
    with_column,
    write_csv,
)

# A quadratic triangle whose numbers run wild, with its inclined edge of length 5 as a line of two pieces.
POINTS = [[-3.0, 0.0], [0.0, 4.0], [0.0, 0.0], [-1.5, 0.0], [-1.5, 2.0], [0.0, 2.0]]
MESH = Mesh(
    POINTS,
    {"tri6": [[0, 2, 1, 3, 5, 4]], "line3": [[0, 1, 4]]},
    {"SOLID": [0], "EDGE": [1]},
    {"A": [0], "B": [1], "BOTH": [1, 0]},
)
RANDOM = np.random.default_rng(3)


def step_result(number: int, names: tuple[str, ...] = ("c",), mesh: Mesh = MESH) -> StepResult:
    n, dim = mesh.n_points, mesh.dim
    stress = RANDOM.normal(size=(n, 4 if dim == 2 else 6))
    return StepResult(
        index=number + 1,
        load_factor=(number + 1) / 4,
        displacement=RANDOM.normal(size=(n, dim)),
        stress=stress,
        von_mises=np.abs(stress[:, 0]),
        von_mises_signed=stress[:, 0],
        reaction=np.zeros((n, dim)),
        contact={name: contact_result(name, number + 1, mesh) for name in names},
    )


def contact_result(name: str, m: int, mesh: Mesh = MESH) -> ContactResult:
    points = np.array([0, 4, 1, 2], np.int32)[:m]
    return ContactResult(
        name=name,
        formulation="node_to_segment",
        points=points,
        coordinates=mesh.points[points],
        abscissa=2.5 * np.arange(m),
        gap=RANDOM.normal(size=m),
        pressure=np.arange(m) * 100.0,
        multiplier=RANDOM.normal(size=m),
        force_vectors=RANDOM.normal(size=(m, mesh.dim)),
        normal=np.zeros((m, mesh.dim)),
        active=np.arange(m) % 2 == 0,
        force=np.arange(mesh.dim) + 10.0 * m,
        radius=(float(m), m + 0.5),
    )


def test_contact_table() -> None:
    step = step_result(2)
    contact = step.contact["c"]
    table = contact_table(contact)
    assert table.dtype.names == (
        "point", "x", "y", "abscissa", "radius", "place", "gap", "pressure", "multiplier", "force_x", "force_y",
        "shear_x", "shear_y", "slip_x", "slip_y", "slip_total_x", "slip_total_y", "active", "sticking",
    )  # fmt: skip
    assert table["point"].tolist() == [0, 4, 1]
    assert table["x"].tolist() == [-3.0, -1.5, 0.0]
    assert table["y"].tolist() == [0.0, 2.0, 4.0]
    assert table["radius"].tolist() == [3.0, 1.5, 0.0]
    assert table["active"].tolist() == [True, False, True]
    for name in ("gap", "pressure", "multiplier", "abscissa"):
        np.testing.assert_array_equal(table[name], getattr(contact, name))
    np.testing.assert_array_equal(table["force_y"], contact.force_vectors[:, 1])


def test_contact_table_with_the_fields_of_its_step() -> None:
    step = step_result(2)
    table = contact_table(step.contact["c"], step)
    np.testing.assert_array_equal(table["displacement_y"], step.displacement[[0, 4, 1], 1])
    for column, component in enumerate(("xx", "yy", "zz", "xy")):
        np.testing.assert_array_equal(table[f"stress_{component}"], step.stress[[0, 4, 1], column])
    np.testing.assert_array_equal(table["von_mises"], step.von_mises[[0, 4, 1]])
    np.testing.assert_array_equal(table["von_mises_signed"], step.von_mises_signed[[0, 4, 1]])


def test_contact_table_without_rows() -> None:
    step = step_result(-1)
    assert len(contact_table(step.contact["c"], step)) == 0


def test_tables_in_space_measure_the_radius_from_the_y_axis() -> None:
    points, cells = [[3, 7, 4], [0, 1, 0], [-6, 0, 8.0]], {"tri3": [[0, 1, 2]], "line2": [[0, 1], [1, 2]]}
    mesh = Mesh(points, cells, {"P": [1, 2]})
    step = step_result(0, (), mesh)
    table = line_table(mesh, step, "P", 0)
    np.testing.assert_allclose(table["radius"], [5.0, 0.0, 10.0], rtol=1e-15)
    assert {"z", "displacement_z", "stress_yz", "stress_xz"} <= set(table.dtype.names)
    np.testing.assert_array_equal(table["stress_xz"], step.stress[:, 5])


def test_line_table_follows_the_line() -> None:
    step = step_result(0)
    table = line_table(MESH, step, "EDGE")
    assert table["point"].tolist() == [1, 4, 0], "it starts at the end next to x = 0"
    np.testing.assert_allclose(table["abscissa"], [0.0, 2.5, 5.0], rtol=1e-15)
    np.testing.assert_array_equal(table["displacement_x"], step.displacement[[1, 4, 0], 0])
    np.testing.assert_array_equal(table["stress_zz"], step.stress[[1, 4, 0], 2])
    for start in ("A", 0):
        assert line_table(MESH, step, "EDGE", start)["point"].tolist() == [0, 4, 1]
    with pytest.raises(MeshError, match="did you mean 'EDGE'"):
        line_table(MESH, step, "EGDE")


def test_a_table_with_one_column_more() -> None:
    table = contact_table(contact_result("c", 3))
    more = with_column(table, "twice", 2 * table["abscissa"])
    assert more["twice"].tolist() == [0, 5, 10]
    assert more.dtype.names == (*table.dtype.names, "twice")
    assert more["point"].tolist() == [0, 4, 1]


# --------------------------------------------------------------------------------------------------- CSV


def assert_same_table(found: np.ndarray, expected: np.ndarray) -> None:
    assert found.dtype.names == expected.dtype.names
    for name in expected.dtype.names:
        assert found[name].dtype.kind == expected[name].dtype.kind, name
        np.testing.assert_array_equal(found[name], expected[name], err_msg=name)
        if expected[name].dtype.kind == "f":
            number = ~np.isnan(expected[name])  # the sign of NaN says nothing and is not written
            assert np.signbit(found[name])[number].tolist() == np.signbit(expected[name])[number].tolist(), name


def read_csv(path: Path, kinds: np.dtype[Any]) -> tuple[np.ndarray, dict[str, str]]:
    """Return the table in a file, its columns of these kinds, and the units in its header."""
    with open(path, encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    titles = [title.removesuffix("]").partition(" [") for title in header]
    assert tuple(name for name, _, _ in titles) == kinds.names
    table = np.empty(len(rows), kinds)
    for name, column in zip(kinds.names, zip(*rows)):
        table[name] = [text == "true" for text in column] if kinds[name].kind == "b" else column
    return table, {name: unit for name, _, unit in titles if unit}


def test_tables_come_back_from_csv(tmp_path: Path) -> None:
    step, path = step_result(2), tmp_path / "table.csv"
    units = {"x": "mm", "pressure": "MPa", "force_x": "N, full circle"}
    for table in (
        contact_table(step.contact["c"], step),
        line_table(MESH, step, "EDGE"),
        np.array([('1, "quoted"', 1.5), ("two", math.inf)], [("name", "U12"), ("pressure", float)]),
    ):
        of_table = {name: unit for name, unit in units.items() if name in table.dtype.names}
        write_csv(path, table, of_table)
        found, found_units = read_csv(path, table.dtype)
        assert_same_table(found, table)
        assert found_units == of_table


@settings(max_examples=60, deadline=None)
@given(values=hnp.arrays(np.float64, st.integers(1, 6), elements=st.floats(width=64)))
def test_csv_loses_no_bit(values: np.ndarray, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.getbasetemp() / "bits.csv"
    table = np.array(list(zip(values, range(len(values)))), dtype=[("a", float), ("b", np.int64)])
    write_csv(path, table)
    assert_same_table(read_csv(path, table.dtype)[0], table)


def test_csv_is_what_the_standard_says(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    table = np.array([(1, 0.1, True, 'a "b", c')], [("n", int), ("x", float), ("active", bool), ("group", "U9")])
    write_csv(path, table, {"x": "mm"})
    text = path.read_bytes().decode("utf-8")
    assert text == 'n,x [mm],active,group\r\n1,0.10000000000000001,true,"a ""b"", c"\r\n'
    with open(path, newline="") as file:
        assert next(csv.DictReader(file))["group"] == 'a "b", c'
    numbers = np.genfromtxt(path, delimiter=",", skip_header=1, usecols=(0, 1))
    assert numbers.tolist() == [1.0, 0.1]


def test_csv_messages(tmp_path: Path) -> None:
    table, path = contact_table(contact_result("c", 1)), tmp_path / "t.csv"
    with pytest.raises(CaseError, match="unknown column 'presure': did you mean 'pressure'"):
        write_csv(path, table, {"presure": "MPa"})
    assert not path.exists()
    with pytest.raises(FileError, match="does not exist: create it"):
        write_csv(tmp_path / "nowhere" / "t.csv", table)
