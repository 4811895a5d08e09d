"""Public names: loaded on first use, known to type checkers, included in the package."""

import ast
import copy
import dataclasses
import importlib
import json
import pickle
import re
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest
from new_process import printed

import fastcontact as fc
from fastcontact._tools.records import field, record, replace
from fastcontact.cases.case import Case
from fastcontact.errors import NameSuggestions
from fastcontact.results.step import Steps
from fastcontact.studies.adaptive import AdaptiveStudy
from fastcontact.studies.convergence_report import Study
from fastcontact.studies.sweep_report import Sweep

FOLDER = Path(fc.__file__).parent


def imports_of_the_stub(package=fc):
    """The module and the name there that the stub of a package gives for each public name."""
    tree = ast.parse(Path(package.__file__).with_suffix(".pyi").read_text(encoding="utf-8"))
    lines = [node for node in tree.body if isinstance(node, ast.ImportFrom)]
    return {alias.asname: (node.module, alias.name) for node in lines for alias in node.names}


@pytest.mark.parametrize(
    ("package", "name"), [(package, name) for package in (fc, fc.analytic, fc.obstacles) for name in package.__all__]
)
def test_a_name_is_what_the_stub_says(package, name):
    module, there = imports_of_the_stub(package)[name]
    home = importlib.import_module(module)
    found = getattr(home, there) if hasattr(home, there) else importlib.import_module(f"{module}.{there}")
    assert getattr(package, name) is found


def test_the_package_has_all_names_of_the_stub_even_in_an_archive(tmp_path):
    with zipfile.ZipFile(tmp_path / "fastcontact.zip", "w") as archive:
        for path in (*FOLDER.glob("*.py*"), *FOLDER.glob("_tools/*.py")):
            archive.write(path, f"fastcontact/{path.relative_to(FOLDER)}")
    code = "import sys; sys.path.insert(0, sys.argv[1]); import fastcontact as fc; print(fc.__file__, *fc.__all__)"
    file, *names = printed(code, tmp_path / "fastcontact.zip").split()
    assert file.startswith(str(tmp_path))
    assert {*names, "__version__"} == set(imports_of_the_stub())


@pytest.mark.parametrize(
    "owner", [fc, fc.generate, fc.generate.block(), Steps([])], ids=["fc", "module", "mesh", "steps"]
)
@pytest.mark.parametrize("name", ["strp", "zfil", "group_nams", "displacement"])
def test_python_adds_no_suggestion(owner, name, capsys):
    """Python would suggest methods of strings if the error had one in place of the object."""
    with pytest.raises(AttributeError) as caught:
        getattr(owner, name)
    sys.excepthook(caught.type, caught.value, None)
    assert "Did you mean" not in capsys.readouterr().err


def test_the_package_declares_its_types():
    assert (FOLDER / "py.typed").exists()


def test_an_unknown_name_is_no_attribute():
    with pytest.raises(AttributeError, match="no attribute 'solver'"):
        fc.solver  # noqa: B018


@pytest.mark.parametrize(
    ("owner", "name", "told"),
    [
        (fc.generate.block(), "nodes", "did you mean 'points'?"),
        (fc.generate.block(), "transformed", "use fastcontact.generate.transformed"),
        (fc.generate.block(), "group_nams", "did you mean 'group_names'?"),
        (fc.Model(fc.generate.block(), "plane_strain"), "add_bolt", "did you mean 'add_pretension'?"),
        (fc.Model(fc.generate.block(), "plane_strain"), "solve", "use fastcontact.solve"),
        (fc.Model(fc.generate.block(), "plane_strain"), "plot", "use fastcontact.plot"),
        (fc.Model(fc.generate.block(), "plane_strain"), "nodes", "no attribute 'nodes'"),  # not 'loads'
        (fc.obstacles, "Plane", "did you mean 'HalfSpace'?"),
        (fc.generate, "rotated", "did you mean 'transformed'?"),
        (fc.analytic, "hertz_sphere", "did you mean 'hertz_point'?"),
        (fc.analytic, "lame", "or 'thick_cylinder' or 'thick_sphere'?"),  # not a module
        (fc.analytic, "persson", "did you mean 'persson_pin' or 'PerssonPin'?"),
        (fc.plot, "shape", "did you mean 'deformed_shape'?"),
        (fc.generate, "refine", "did you mean 'refined'?"),
        (Steps(), "contact", "each step has one, such as [-1].contact"),
        (Steps(), "indx", "did you mean 'index'?"),
        (fc, "sweep", "did you mean 'parameter_sweep'?"),
        (fc, "qqq", "no attribute 'qqq'"),
    ],
    ids=str,
)
def test_an_unknown_name_suggests_the_nearest_one(owner, name, told):
    with pytest.raises(AttributeError) as caught:
        getattr(owner, name)
    assert str(caught.value).endswith(told)


@pytest.mark.parametrize(
    ("call", "told"),
    [
        (lambda: fc.LinearElastic(E=1.0, nu=0.3, alpha=1e-5), "'alpha': did you mean 'expansion'?"),
        (lambda: fc.solve(None, steps=4), "'steps': did you mean 'ramp'?"),
        (lambda: fc.linear_ramp(4, q=1), "'q': expected one of steps, end"),
        (lambda: fc.linear_ramp(step=4), "'step': did you mean 'steps'?"),
    ],
)
def test_an_unknown_argument_suggests_the_nearest_one(call, told):
    with pytest.raises(TypeError) as caught:
        call()
    assert str(caught.value).endswith(told)
    assert str(caught.value).lower().count("did you mean") <= 1  # Python 3.13 suggests names, too


def test_objects_are_copied_and_pickled_with_their_suggestions():
    mesh = fc.generate.block()
    for again in (copy.deepcopy(mesh), pickle.loads(pickle.dumps(mesh))):
        assert again.group_names == mesh.group_names
        assert not hasattr(again, "_nothing")


class Broken(NameSuggestions):
    @property
    def total(self):
        return self._parts.sum


def test_the_error_inside_a_property_is_not_hidden():
    with pytest.raises(AttributeError, match="'Broken' object has no attribute '_parts'"):
        Broken().total  # noqa: B018


# The package: contents of distributions, and consistent metadata.


@pytest.fixture
def project(root):
    return tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))


def test_patterns_of_the_source_archive_hold_at_the_root_alone(project, root):
    """Without the first stroke a virtual environment in the tree has folders of these names, too."""
    for pattern in project["tool"]["hatch"]["build"]["targets"]["sdist"]["include"]:
        assert pattern.startswith("/"), pattern
        assert (root / pattern[1:]).exists(), pattern


def test_the_pythons_that_are_named_are_allowed(project):
    least = tuple(map(int, re.findall(r"\d+", project["project"]["requires-python"])))
    named = re.findall(r"Python :: (\d+)\.(\d+)", "\n".join(project["project"]["classifiers"]))
    assert named
    assert min((int(a), int(b)) for a, b in named) == least


def test_the_version_is_the_same_everywhere(project, root):
    version = project["project"]["version"]
    assert f"\nversion: {version}\n" in (root / "CITATION.cff").read_text(encoding="utf-8")
    deposit = json.loads((root / ".zenodo.json").read_text(encoding="utf-8"))
    assert deposit["version"] == version
    assert deposit["license"] == project["project"]["license"]
    assert deposit["keywords"] == project["project"]["keywords"]
    assert [author["name"] for author in project["project"]["authors"]] == [who["name"] for who in deposit["creators"]]
    assert f"## {version}" in (root / "CHANGELOG.md").read_text(encoding="utf-8")


def test_figures_beside_others_are_those_of_the_benchmarks(root):
    """Each number of seconds that README gives for another program stands on the page of the benchmarks."""
    table = (root / "README.md").read_text(encoding="utf-8").split("## Other programs")[1].split("## ")[0]
    measured = (root / "bench" / "README.md").read_text(encoding="utf-8")
    figures = re.findall(r"\b(\d+(?:\.\d+)?) s\b", table)
    assert len(figures) >= 6
    for figure in figures:
        assert re.search(rf"(?<![\d.]){re.escape(figure)}(?![\d.])", measured), figure


def test_a_record_is_compared_by_identity_and_changed_by_replace():
    @record
    class Pair:
        gap: float
        forces: list[float] = field(default_factory=list)

    pair = Pair(1.0)
    assert (pair.gap, pair.forces, replace(pair, gap=2.0).gap) == (1.0, [], 2.0)
    assert pair != Pair(1.0)
    assert len({pair, pair}) == 1


def test_public_data_classes_reject_assignments():
    public = [value for name in dir(fc) if dataclasses.is_dataclass(value := getattr(fc, name))]
    assert {fc.StepResult, fc.ContactResult, fc.FoundContacts, fc.Mesh} <= set(public)
    for kind in (*public, fc.obstacles.MeshedSurface, Study, Sweep, AdaptiveStudy, Case):
        assert kind.__dataclass_params__.frozen, kind
