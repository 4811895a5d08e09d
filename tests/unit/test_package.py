"""The package: contents of distributions, and consistent metadata."""

import dataclasses
import json
import re
import tomllib

import pytest

import fastcontact as fc
from fastcontact._tools.records import field, record, replace
from fastcontact.cases.case import Case
from fastcontact.studies.adaptive import AdaptiveStudy
from fastcontact.studies.convergence_report import Study
from fastcontact.studies.sweep_report import Sweep


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
    readme = (root / "README.md").read_text(encoding="utf-8")
    table = readme.split("## Other programs")[1].split("## ")[0]
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
