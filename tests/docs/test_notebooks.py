"""Notebooks of the documentation run from top to bottom and contain no outputs."""

import json

import pages
import pytest

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
