"""The oldest tested releases of dependencies are the lower bounds of the package."""

import re
import tomllib

from starting import ROOT


def test_oldest_releases_tested_are_the_lower_bounds():
    with (ROOT / "pyproject.toml").open("rb") as file:
        needed = tomllib.load(file)["project"]["dependencies"]
    bounds = dict(re.fullmatch(r"([\w-]+)>=([\d.]+)", need).groups() for need in needed)
    lines = (ROOT / ".ci" / "oldest.txt").read_text(encoding="utf-8").splitlines()
    tested = dict(line.split("==") for line in lines if not line.startswith("#"))
    assert tested.keys() == bounds.keys()
    for name, release in tested.items():
        bound = bounds[name].split(".")
        assert release.split(".")[: len(bound)] == bound, name
        assert not any(int(part) for part in release.split(".")[len(bound) :]), f"{name}: name the whole release"
