"""The convergence study of the training case separates model error from mesh error."""

import json

import pytest

from fastcontact.cli import main

FORCE, PRESSURE = 659_773.142, 2910.4071


def test_three_levels_tell_model_error_from_mesh_error(root, tmp_path, capsys):
    files = {name: tmp_path / f"study.{name}" for name in ("json", "csv", "png", "html")}
    options = [text for name, path in files.items() for text in (f"--{name}", str(path))]
    case = str(root / "data/cases/forma04c.toml")
    arguments = ["converge", case, "--levels", "3", "--elements", "quad8", "--formulations", "continuous"]
    assert main([*arguments, "--workers", "1", "--store", str(tmp_path / "store"), *options]) == 0
    study = json.loads(files["json"].read_text())
    assert len(study["levels"]) == 3
    assert all(level["n_dofs"] > 0 and level["force"] > 0 for level in study["levels"])
    for name, exact, near in (("force", FORCE, 2e-3), ("pressure_max", PRESSURE, 2e-3)):
        found = study["quantities"][name]
        assert found["limit"] == pytest.approx(exact, rel=near)
        assert abs(found["limit"] - exact) <= found["uncertainty"]
        assert found["order"] > 0
    assert study["quantities"]["force"]["model_error"] == pytest.approx(0.12574, abs=2e-3)
    assert study["quantities"]["pressure_max"]["model_error"] == pytest.approx(0.04005, abs=2e-3)
    assert study["equal_force"]["pressure_max"]["model_error"] == pytest.approx(-2e-4, abs=2e-3)
    assert files["png"].read_bytes()[:4] == b"\x89PNG"
    assert "data:image/png;base64" in files["html"].read_text()
    assert "model error" in capsys.readouterr().out
    # Started again, the study takes its runs from the store.
    assert main([*arguments, "--workers", "1", "--store", str(tmp_path / "store"), "-q"]) == 0
