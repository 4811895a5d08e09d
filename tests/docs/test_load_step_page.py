"""The page on a load step names every module that its example runs in a step."""

import re
import sys
from pathlib import Path

import pytest

import fastcontact as fc
from fastcontact.analysis import load_step as page


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
