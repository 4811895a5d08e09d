"""Every code block, command and notebook of README and docs runs, and the page on a load step names its modules."""

import json
import re
import sys
import warnings
from pathlib import Path

import pages
import pytest

import fastcontact as fc
from fastcontact.analysis import load_step as page

PAGES = pages.pages()
RUN = [page for page in PAGES if any(map(pages.runnable, pages.blocks(page)))]
# Processes of all kinds, each of which `test_executors` and `test_execute` start by default, too.
RUN = [pytest.param(page, marks=pytest.mark.slow) if page.name == "cluster.md" else page for page in RUN]
LINK = re.compile(r"\]\((?P<target>[^)#\s]+)(#[^)\s]*)?\)")


def name(page):
    return str(page.relative_to(pages.ROOT))


@pytest.mark.filterwarnings("default::pytest.PytestWarning")
@pytest.mark.parametrize("page", RUN, ids=name)
def test_all_blocks_of_a_page_run(page, tmp_path, monkeypatch):
    monkeypatch.setattr(
        "fastcontact.studies.execute._processors", lambda: 1
    )  # processes are what `cluster.md` asks for
    for block in pages.run_page(page, tmp_path):
        text = f"{name(page)}:{block.line} was not run: it needs {', '.join(block.missing)}"
        warnings.warn(pytest.PytestWarning(text), stacklevel=1)
    for picture in pages.pictures(page):
        assert picture.is_file(), f"{name(page)} shows {picture.name}, which is not there"
        if page.parts[-2:] != (pages.ROOT.name, "README.md"):
            assert (tmp_path / picture.name).is_file(), f"no command of {name(page)} made {picture.name}"


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_links_between_pages_lead_somewhere(page):
    for match in LINK.finditer(page.read_text(encoding="utf-8")):
        target = match["target"]
        if "://" not in target:
            assert (page.parent / target).exists(), f"{name(page)} links to {target}"


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_a_block_that_needs_something_is_told_so_in_the_text(page):
    """The comment that keeps a block from running is invisible: the sentences around it must say the same."""
    text = page.read_text(encoding="utf-8").casefold()
    for block in pages.blocks(page):
        for word in block.needs:
            assert text.count(word.casefold()) > text.count(f"needs: {word}".casefold()), f"{name(page)}: {word}"


def test_the_gallery_asserts_a_number_for_every_picture():
    page = pages.DOCS / "gallery.md"
    sections = page.read_text(encoding="utf-8").split("\n## ")[1:]
    assert 8 <= len(sections) == len(pages.pictures(page))
    for section in sections:
        programs = section.count("```python") - section.count("<!-- needs:")
        assert section.count("![") == programs == 1, section.splitlines()[0]
        assert "\nassert " in section, section.splitlines()[0]


def test_every_machine_part_makes_its_picture_and_asserts_a_number():
    page = pages.DOCS / "machine-parts.md"
    sections = page.read_text(encoding="utf-8").split("\n## ")[1:]
    assert 6 <= len(sections) == len(pages.pictures(page))
    for section in sections:
        programs, asserted = section.count("```python"), section.count("\nassert ")
        assert section.count("![") == 1 <= programs == asserted, section.splitlines()[0]


def test_pictures_are_small():
    """A page of them is read on a telephone, and the repository keeps every version."""
    for path in (pages.DOCS / "images").glob("*.png"):
        assert path.stat().st_size <= pages.LARGEST, path.name


def test_blocks_are_found_with_their_files_and_needs(tmp_path):
    """The finder itself."""
    page = tmp_path / "page.md"
    page.write_text(
        "<!-- needs: network -->\n<!-- remark -->\n```sh\nmake\n```\n\n```python\nx = 1\n```\n"
        "1. nested\n\n   ```text\n   out\n   ```\n\n```{code-block} toml\n:caption: case.toml\n\na = 1\n```\n"
        "<!-- needs: no-such-program -->\nwords end what is needed\n```sh\nfastcontact a \\\n  b\nfastcontact c\n```\n"
    )
    found = pages.blocks(page)
    assert [(b.language, b.needs, b.file) for b in found] == [
        ("sh", ("network",), ""), ("python", (), ""), ("text", (), ""), ("toml", (), "case.toml"), ("sh", (), ""),
    ]  # fmt: skip
    assert found[0].missing == ["network"]
    assert found[3].text == "a = 1\n"
    assert [command.split() for command in pages.commands(found[4])] == [
        ["fastcontact", "a", "b"],
        ["fastcontact", "c"],
    ]
    assert [pages.runnable(block) for block in found] == [True, True, False, True, True]


@pytest.mark.filterwarnings("ignore::fastcontact.errors.FastcontactWarning")
def test_the_page_names_every_module_that_its_example_runs(root, monkeypatch):
    text = (root / "docs" / "contribute" / "load-step.md").read_text(encoding="utf-8")
    example = re.search(r"```python\n(.*?)```", text, re.DOTALL).group(1)
    package, modules, load_step = Path(fc.__file__).parent, set(), page.load_step

    def called(frame, event, _):
        path = Path(frame.f_code.co_filename)
        if event == "call" and path.is_relative_to(package):
            modules.add(f"fastcontact/{path.relative_to(package).as_posix()}")

    def traced(*arguments):
        modules.clear()  # the last step counts: kernels are loaded and tables are made by then
        sys.setprofile(called)
        try:
            return load_step(*arguments)
        finally:
            sys.setprofile(None)

    monkeypatch.setattr(page, "load_step", traced)
    exec(compile(example, "load-step.md", "exec"), {})
    named = set(re.findall(r"fastcontact/[\w/]+\.py", text))
    assert sorted(modules - named) == []
    assert all((package.parent / name).is_file() for name in named)
    assert len(modules) > 40


NOTEBOOKS = sorted((pages.DOCS / "notebooks").glob("*.ipynb"))


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(notebook, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    found, names = json.loads(notebook.read_text(encoding="utf-8")), {}
    assert (found["nbformat"], found["nbformat_minor"]) == (4, 5)
    code = [cell for cell in found["cells"] if cell["cell_type"] == "code"]
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)
    assert "".join(code[0]["source"]).startswith("%pip install")
    for number, cell in enumerate(code[1:], start=1):
        exec(compile("".join(cell["source"]), f"{notebook.name}, code cell {number}", "exec"), names)


def test_there_are_notebooks_and_a_page_leads_to_each():
    text = "".join(page.read_text(encoding="utf-8") for page in pages.pages())
    assert len(NOTEBOOKS) >= 3
    assert all(f"notebooks/{notebook.name}" in text for notebook in NOTEBOOKS)
