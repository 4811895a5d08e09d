"""Keyword blocks: parameters, quoted names, continuation lines, included files."""

import pytest

from fastcontact.cases.decks import blocks
from fastcontact.errors import CaseError, FileError


def read(folder, text, name="a.inp"):
    (folder / name).write_text(text, encoding="utf-8")
    return list(blocks.read_blocks(folder / name))


def test_a_block_has_keyword_parameters_and_lines(tmp_path):
    (found,) = read(tmp_path, '** comment\n*contact\tpair , Type = "a, b",\n  small sliding\n1,\t2,\n** no\n 3\n\n')
    assert found.keyword == "CONTACT PAIR"
    assert found.parameters == {"TYPE": "a, b", "SMALL SLIDING": None}
    assert [row.entries for row in found.rows] == [("1", "2"), ("3",)]
    assert [row.location.line for row in found.rows] == [4, 6]
    assert found.rows[0].goes_on
    assert str(found.location) == "a.inp, line 2, *CONTACT PAIR"


def test_names_in_quotation_marks_keep_commas(tmp_path):
    (found,) = read(tmp_path, '*Cload\n"Upper, Plate-1".1, 1, 0.\n')
    assert found.rows[0].entries == ('"Upper, Plate-1".1', "1", "0.")


@pytest.mark.parametrize(("text", "value"), [("1.D5", 1e5), ("-2", -2.0), (".5E-3", 5e-4), ("1d0", 1.0)])
def test_numbers_as_fortran_writes_them(tmp_path, text, value):
    (found,) = read(tmp_path, f"*Elastic\n{text}\n")
    assert found.rows[0].number(0) == value


@pytest.mark.parametrize("text", ["O.3", "nan", "inf", "1e999", "1_0", "0x1", "--1"])
def test_what_is_no_number_is_told_with_its_line(tmp_path, text):
    (found,) = read(tmp_path, f"*Elastic\n1.\n{text}\n")
    with pytest.raises(CaseError, match=r"a\.inp, line 3, \*ELASTIC: .* is not a (usable )?number"):
        found.rows[1].number(0)


def test_included_files_stand_in_place_with_their_own_lines(tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "mesh.inc").write_text("*Node\n1, 0.\n", encoding="utf-8")
    found = read(tmp_path, "*Heading\n*Include, input=sub/mesh.inc\n*Step\n")
    places = ["a.inp, line 1, *HEADING", "sub/mesh.inc, line 1, *NODE", "a.inp, line 3, *STEP"]
    assert [str(block.location) for block in found] == places


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("/etc/os-release", "outside the folder"), ("../x.inc", "outside the folder"), ("none.inc", "not found"),
        ("a.inp", "includes itself"), ("link.inc", "outside the folder"), ("x\0y", "not a file name"),
    ],
)  # fmt: skip
def test_files_elsewhere_are_not_read(tmp_path, given, said):
    folder = tmp_path / "deck"
    folder.mkdir()
    (tmp_path / "secret.inc").write_text("secret", encoding="utf-8")
    (folder / "link.inc").symlink_to(tmp_path / "secret.inc")
    with pytest.raises(CaseError, match=rf"a\.inp, line 2, \*INCLUDE: .*{said}") as caught:
        read(folder, f"*Heading\n*Include, input={given}\n")
    assert "secret," not in str(caught.value)


def test_files_that_include_each_other_are_refused(tmp_path):
    (tmp_path / "b.inc").write_text("*Include, input=a.inp\n", encoding="utf-8")
    with pytest.raises(CaseError, match=r"b\.inc, line 1, \*INCLUDE: the deck includes itself"):
        read(tmp_path, "*Include, input=b.inc\n")


def test_a_tree_of_included_files_does_not_grow_for_ever(tmp_path):
    for level in range(12):
        (tmp_path / f"{level}.inc").write_text(f"*Include, input={level + 1}.inc\n" * 8, encoding="utf-8")
    (tmp_path / "12.inc").write_text("*Heading\n", encoding="utf-8")
    with pytest.raises(FileError, match="MiB or 200 files"):
        read(tmp_path, "*Include, input=0.inc\n")


def test_data_before_any_keyword_is_refused(tmp_path):
    with pytest.raises(CaseError, match=r"line 1, .*before any keyword"):
        read(tmp_path, "1, 2, 3\n*Node\n")


def test_a_parameter_that_stands_there_twice_is_refused(tmp_path):
    with pytest.raises(CaseError, match="NSET is given twice"):
        read(tmp_path, "*Node, nset=a, NSET=b\n")
