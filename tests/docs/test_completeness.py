"""The documentation names everything that exists, and nothing else."""

import inspect
import re
import tomllib

import pages
import pytest

import fastcontact as fc
from fastcontact.cases import checks, keys
from fastcontact.cli._main import parser
from fastcontact.contact.formulations import FORMULATIONS
from fastcontact.linear import choice as linear
from fastcontact.model import pair_options

PATH = re.compile(r"`((?:fastcontact|tests|bench|data|docs)/[\w./-]+)`")
MADE = ("docs/_build",)


def text(*names):
    return "\n".join((pages.DOCS / name).read_text(encoding="utf-8") for name in names)


def quoted(name, where):
    """Whether a name stands in back or double quotes, or as a word of code."""
    return re.search(rf"[`\"\[.( ]{re.escape(name)}[`\"\]=(,: ]", where) is not None


@pytest.mark.parametrize("page", pages.pages(), ids=lambda page: str(page.relative_to(pages.ROOT)))
def test_files_that_a_page_names_are_there(page):
    for path in PATH.findall(page.read_text(encoding="utf-8")):
        assert "NAME" in path or path in MADE or (pages.ROOT / path).exists(), path


def test_every_public_name_is_in_the_reference():
    reference = "\n".join(path.read_text(encoding="utf-8") for path in (pages.DOCS / "reference").glob("*.md"))
    for name in set(fc.__all__) - {name for name, value in vars(fc.errors).items() if inspect.isclass(value)}:
        assert re.search(
            rf"auto(class|function|module|data):: (fastcontact\.[\w.]*)?{name}$", reference, re.MULTILINE
        ), name
    for module in (fc.analytic, fc.generate, fc.obstacles, fc.plot, fc.errors):
        assert f"automodule:: {module.__name__}\n" in reference


def test_every_word_of_the_glossary_is_in_the_code_and_has_one_meaning():
    rows = re.findall(r"^\| (?!word|---)(.+?) \|", text("words.md"), re.MULTILINE)
    words = [word for row in rows for word in re.findall(r"`(\w+)`", row)]
    paths = list((pages.ROOT / "fastcontact").rglob("*.py"))
    code = "\n".join([path.stem for path in paths] + [path.read_text(encoding="utf-8") for path in paths])
    assert [word for word in words if not re.search(rf"\b{word}\b", code)] == []
    assert len(words) == len(set(words)) > 20


def test_every_command_is_listed():
    for name in next(action.choices for action in parser()._actions if action.dest == "command"):
        assert f"| `{name}" in text("reference/commands.md"), name


def test_every_key_of_case_files_is_listed():
    page = text("reference/case-files.md")
    for key in {**keys.TOP_LEVEL, **keys.STUDY}:
        assert re.search(rf"[`\[]{key}[`\].]", page), key


def test_every_mesh_maker_is_listed_with_its_keys():
    for name, make in fc.generate.GENERATORS.items():
        (row,) = re.findall(rf"^\| `{name}` \| .* \| (.*) \| (.*) \|$", text("reference/generate.md"), re.MULTILINE)
        assert re.findall(r"`(\w+)`", row[0]) == list(inspect.signature(make).parameters), name
        assert row[1].split(", ") == make().group_names, name


def test_every_quantity_of_checks_is_listed():
    page = text("reference/case-files.md")
    for name in (*checks.PROBE_QUANTITIES, *checks.PAIR_QUANTITIES):
        kind = name.split(".")[0]
        assert re.search(rf"`{kind}(\.\w+)?`", page), name


def test_every_option_of_contact_pairs_is_listed():
    page = text("howto/contact-options.md")
    for option in (*pair_options.SHARED_OPTIONS, "formulation", "friction", "normals", "projection_tolerance"):
        assert f"| `{option}` |" in page, option


def test_every_formulation_solver_shape_and_theory_is_named():
    for name in FORMULATIONS:
        assert f"`{name}`" in text("howto/formulation.md"), name
    for name in linear.SOLVER_NAMES:
        assert f'(`"{name}"`)' in text("theory/linear-algebra.md"), name
    for name in fc.obstacles.SHAPES:
        assert f"| `{name}`" in text("howto/rigid-indenter.md"), name
    for name in fc.analytic.THEORIES:
        assert f"`{name}`" in text("theory/analytic.md"), name


def test_every_extra_is_named_in_the_installation():
    extras = tomllib.loads((pages.ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"][
        "optional-dependencies"
    ]
    assert "gmsh" in extras
    for name in {*extras} - {"all"}:
        assert f"| `{name}` |" in text("install.md"), name


def test_every_method_that_builds_a_model_is_named_in_a_how_to_page():
    how_to = "\n".join(path.read_text(encoding="utf-8") for path in (pages.DOCS / "howto").glob("*.md"))
    for name, method in inspect.getmembers(fc.Model):
        if inspect.isfunction(method) and (name.startswith("add_") or name in ("fix", "prescribe", "couple", "relate")):
            assert quoted(name, how_to), name
