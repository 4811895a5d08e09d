"""The command line: files, output and exit codes."""

import io
import json
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from case_texts import HERTZ, UNITS, spheres
from commands import output_of
from models import pressed_spheres, supported
from new_process import printed

import fastcontact as fc
from fastcontact._jit import ahead
from fastcontact.cli import main
from fastcontact.cli._main import history_lines
from fastcontact.results import write_arrays

CONVERGED = '[theory.hertz.mesh_converged]\nkind = "finite_half_spheres"\napproach = 4.0\n'
CHECK = '[[check]]\nname = "pole"\nquantity = "C1.stress.yy"\ntheory = "hertz"\ntolerance = 0.2\n'
CASE = spheres(6.0, 3, UNITS) + HERTZ + CONVERGED + CHECK


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cli")
    (folder / "small.toml").write_text(CASE)
    out, summary, picture = folder / "small.vtkhdf", folder / "small.json", folder / "small.png"
    code = main(["run", str(folder / "small.toml"), "-o", str(out), "--json", str(summary), "--plot", str(picture)])
    assert code == 0
    return folder


def test_the_summary_holds_what_it_promises(solved):
    summary = json.loads((solved / "small.json").read_text())
    last = fc.open_results(solved / "small.vtkhdf")[-1]
    contact = summary["contact"]["hertz"]
    assert summary["case"] == "small"
    assert summary["n_dofs"] == 2 * summary["mesh"]["n_points"]
    assert [step["load_factor"] for step in summary["steps"]] == pytest.approx([1 / 3, 2 / 3, 1.0])
    assert all(step["active_set_iterations"] >= 1 and step["linear_iterations"] >= 1 for step in summary["steps"])
    assert contact["force"] == pytest.approx(np.linalg.norm(last.contact["hertz"].force))
    assert contact["radius"] == pytest.approx(list(last.contact["hertz"].radius))
    assert contact["pressure_max"] == last.contact["hertz"].pressure.max()
    assert summary["probes"]["C1"]["stress"][1] < -2000
    assert len(summary["probes"]["C1"]["displacement"]) == 2
    assert summary["von_mises_max"]["value"] == last.von_mises.max()
    theory = summary["theory"]["hertz"]
    assert theory["equal_approach"]["pressure_max"] == pytest.approx(2798.3286697)
    assert theory["equal_approach"]["deviation"]["force"] == pytest.approx(contact["force"] / 586_080.586 - 1)
    assert theory["equal_force"]["deviation"]["force"] == pytest.approx(0.0, abs=1e-12)
    assert theory["mesh_converged"]["force"] == pytest.approx(659_773.142, rel=1e-6)
    assert summary["checks"][0]["target"] == pytest.approx(-2798.3286697)
    assert summary["checks"][0]["distance_to_mesh_converged"] is not None
    assert set(summary) >= {"timings", "versions", "warnings"}


def test_pictures_tables_and_exports(solved, tmp_path, capsys):
    result = str(solved / "small.vtkhdf")
    for name in ("p.csv", "p.agr", "p.png"):
        assert main(["profile", result, f"--{name[2:]}", str(tmp_path / name)]) == 0
    assert main(["plot", result, "--png", str(tmp_path / "d.png")]) == 0
    assert main(["plot", result, "--history", "--png", str(tmp_path / "h.png")]) == 0
    assert main(["export", result, "--med", str(tmp_path / "r.med"), "--xdmf", str(tmp_path / "r.xdmf")]) == 0
    for name in ("p.png", "d.png", "h.png"):
        assert (tmp_path / name).read_bytes()[:4] == b"\x89PNG"
    times, values = fc.read_med_field(tmp_path / "r.med", "DEPL")
    assert len(times) == 3
    assert np.array_equal(values[-1], fc.open_results(result)[-1].displacement)
    assert "pressure_Hertz_equal_approach" in (tmp_path / "p.csv").read_text().splitlines()[0]
    capsys.readouterr()
    assert "pressure" in output_of(capsys, ["profile", result])
    assert "3 steps" in output_of(capsys, ["info", result])


def test_a_mesh_is_made_and_described(tmp_path, capsys):
    path = str(tmp_path / "c.med")
    assert main(["mesh", "half-spheres", "--element", "quad4", "--arc-sizes", "2.0", "8.0", "-o", path]) == 0
    assert "smallest angle" in capsys.readouterr().out
    printed = output_of(capsys, ["info", path])
    assert all(group in printed for group in ("SPHHAU", "CONT1", "C1", "quad4"))


def test_no_convergence_is_exit_code_two_and_keeps_finished_steps(solved, tmp_path, capsys):
    text = CASE.replace("[probes]", "[solve]\nmax_halvings = 1\nmax_geometry_updates = 2\ngeometry = 1e-9\n[probes]")
    case = tmp_path / "hard.toml"
    text = text.replace('primary = "CONT2"', 'primary = "CONT2"\nformulation = "node_to_segment"')
    case.write_text(text.replace("steps = 3", "instants = [0.001, 1.0]"))
    summary = tmp_path / "hard.json"
    summary.write_text('{"of": "an earlier run"}')
    assert main(["run", str(case), "-o", str(tmp_path / "hard.vtkhdf"), "--json", str(summary)]) == 2
    cut, told, *history, kept = capsys.readouterr().err.splitlines()
    assert cut.startswith("step 2 from 0.001 to 1 does not converge, halved: the contact geometry did not converge")
    assert told.startswith("no convergence: ")
    assert "step 2 was halved once, the part from " in told
    assert [line.split()[0] for line in history] == ["iterations", "1", "2", "3"]
    path = tmp_path / "hard.vtkhdf"
    assert kept == f"  '{path}' keeps one complete step: 'fastcontact run --resume' continues from there"
    results = fc.open_results(path)
    assert len(results) == 1
    assert not results.complete
    assert results.error.split(": ", 1) == ["ConvergenceError", told.removeprefix("no convergence: ").strip()]
    assert [entry["displacement_change"] > 0 for entry in results.log["failed_step"]] == [True] * 3
    ((name, nodes),) = results.log["failed_step"][-1]["nodes"].items()
    assert (name, len(nodes)) == ("hertz", 3)
    assert f"most at points {nodes[0]} [" in told
    assert json.loads(summary.read_text()) == {"failed": results.error.split(": ", 1)[1], "complete_steps": 1}
    assert f"  stopped: {results.error}" in output_of(capsys, ["info", str(path)]).splitlines()


def test_steps_that_went_in_parts_are_told(solved, tmp_path, capsys):
    case, path, summary = (tmp_path / f"cut{suffix}" for suffix in (".toml", ".vtkhdf", ".json"))
    limits = "[solve]\nmax_active_set_iterations = 2\ngeometry_updates = 0\n[probes]"
    case.write_text(
        CASE.replace("steps = 3", "steps = 1").replace("size = 6.0", "size = 3.0").replace("[probes]", limits)
    )
    assert main(["run", str(case), "-o", str(path), "--json", str(summary)]) == 0
    captured = capsys.readouterr()
    assert "step 1 from 0 to 1 does not converge, halved: " in captured.err
    (step,) = json.loads(summary.read_text())["steps"]
    ends = step["substeps"]
    assert len(ends) > 1
    line = f"  1 load step did not converge as a whole, and took {len(ends)} substeps instead"
    assert line in captured.out.splitlines()
    assert f"was divided at the load factors {ends[0]:.6g}, " in output_of(capsys, ["info", str(path)])


def test_a_run_that_was_killed_is_incomplete(solved, tmp_path, capsys):
    with fc.open_results(solved / "small.vtkhdf") as results:
        out = fc.ResultWriter(tmp_path / "killed.vtkhdf", results.mesh)
        out.write(results[0])
        assert main(["info", str(out.path)]) == 0
    assert "  incomplete: the run was killed, or is still running" in capsys.readouterr().out.splitlines()


def interrupt_before_step_3(patch):
    write = fc.ResultWriter.write

    def stop(self, step):
        if step.index == 3:
            raise KeyboardInterrupt
        write(self, step)

    patch.setattr(fc.ResultWriter, "write", stop)


def fill_the_disk_at_step_2(patch):
    real = write_arrays.append_fields

    def full(file, mesh, number, *given):
        if number == 1:
            raise OSError(28, "No space left on device")
        real(file, mesh, number, *given)

    patch.setattr(write_arrays, "append_fields", full)


@pytest.mark.parametrize("background", [False, True])
def test_a_run_interrupted_from_the_keyboard_says_what_it_keeps(solved, tmp_path, capsys, monkeypatch, background):
    path = tmp_path / "stopped.vtkhdf"
    monkeypatch.setattr("fastcontact.cli.run.LARGE_MESH", 0 if background else np.inf)
    with monkeypatch.context() as patch:
        interrupt_before_step_3(patch)
        assert main(["run", str(solved / "small.toml"), "-o", str(path)]) == 130
    told = capsys.readouterr().err.splitlines()
    assert told[-2:] == [
        "interrupted",
        f"  '{path}' keeps all 2 complete steps: 'fastcontact run --resume' continues from there",
    ]
    assert main(["run", str(solved / "small.toml"), "-o", str(path), "--resume", "-q"]) == 0
    expected = fc.open_results(solved / "small.vtkhdf")[-1]
    np.testing.assert_array_equal(fc.open_results(path)[-1].displacement, expected.displacement)


def test_steps_of_large_meshes_are_written_in_the_background(solved, tmp_path, capsys, monkeypatch):
    """The results are the same, and what goes wrong with the disk ends the run with one line."""
    monkeypatch.setattr("fastcontact.cli.run.LARGE_MESH", 0)
    path = tmp_path / "large.vtkhdf"
    assert main(["run", str(solved / "small.toml"), "-q", "-o", str(path)]) == 0
    for one, other in zip(fc.open_results(path), fc.open_results(solved / "small.vtkhdf"), strict=True):
        np.testing.assert_array_equal(one.stress, other.stress)
    fill_the_disk_at_step_2(monkeypatch)
    told = output_of(capsys, ["run", str(solved / "small.toml"), "-q", "-o", str(path)], 1).splitlines()[-1]
    assert "cannot be written at step 2 (No space left on device); 1 steps are complete" in told
    assert len(fc.open_results(path)) == 1


def test_a_disk_that_fails_before_an_interruption_is_told(solved, tmp_path, capsys, monkeypatch):
    path = tmp_path / "stopped.vtkhdf"
    monkeypatch.setattr("fastcontact.cli.run.LARGE_MESH", 0)
    interrupt_before_step_3(monkeypatch)
    fill_the_disk_at_step_2(monkeypatch)
    told = output_of(capsys, ["run", str(solved / "small.toml"), "-q", "-o", str(path)], 130).splitlines()[-3:]
    assert told[0] == "interrupted"
    assert "cannot be written at step 2 (No space left on device)" in told[1]
    assert "keeps one complete step" in told[2]
    assert len(fc.open_results(path)) == 1


def test_a_run_that_fails_at_once_keeps_nothing_and_says_so(solved, tmp_path, capsys):
    text = CASE.replace("[probes]", "[solve]\nmax_halvings = 0\nmax_geometry_updates = 1\n[probes]")
    case = tmp_path / "hard.toml"
    case.write_text(text)
    assert main(["run", str(case), "-o", str(tmp_path / "hard.vtkhdf")]) == 2
    assert capsys.readouterr().err.splitlines()[-1] == f"  '{tmp_path / 'hard.vtkhdf'}' contains no complete step"


def test_errors_of_cells_are_estimated_on_request(solved, tmp_path):
    path = tmp_path / "estimated.vtkhdf"
    assert main(["run", str(solved / "small.toml"), "-q", "--estimate-error", "-o", str(path)]) == 0
    with fc.open_results(path) as results:
        errors = results[-1].cell_fields["error"]
        assert len(errors) == sum(map(len, results.mesh.solids.values()))
        assert errors.min() > 0.0


def test_a_step_is_chosen_by_its_number(solved, capsys):
    told = []
    for number in ("1", "3", "-1"):
        told.append(output_of(capsys, ["profile", str(solved / "small.vtkhdf"), "--step", number]))
        assert told[-1].count("\n") > 5
    assert told[0] != told[1] == told[2]


def test_a_file_whose_case_is_no_toml_is_shown_without_theory(solved, tmp_path, capsys):
    path = tmp_path / "odd.vtkhdf"
    with (
        fc.open_results(solved / "small.vtkhdf") as results,
        fc.ResultWriter(path, results.mesh, case_text="[contact") as out,
    ):
        out.write(results[0])
    assert "theory" not in output_of(capsys, ["profile", str(path)])


def test_steps_and_pairs_that_do_not_exist(solved, capsys):
    assert "steps 1 to 3" in output_of(capsys, ["profile", str(solved / "small.vtkhdf"), "--step", "9"], 1)
    assert "'hertz'" in output_of(capsys, ["profile", str(solved / "small.vtkhdf"), "--contact", "herz"], 1)


def test_nothing_but_warnings_is_printed_when_quiet(solved, tmp_path, capsys):
    assert main(["run", str(solved / "small.toml"), "-q", "-o", str(tmp_path / "q.vtkhdf")]) == 0
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("warning: contact 'hertz' has only 3 elements across its radius")
    assert captured.err.count("\n") == 1


TIP = """
title = "a tip"
kinematics = "axisymmetric"
mesh = {generator = "block", divisions = [8, 8]}
material = [{E = 1.0, nu = 0.3}]
support = [{group = "BOTTOM", y = 0.0}]
[obstacle.tip]
secondary = "TOP"
shape = {kind = "cone", slope = 0.1, tip = 1.0}
motion = {y = -0.02}
[theory.tip]
kind = "cone_punch"
E = 1.0
nu = 0.3
slope = 0.1
approach = 0.02
[ramp]
steps = 1
"""


def test_a_theory_without_bound_is_not_compared(tmp_path, capsys):
    (tmp_path / "tip.toml").write_text(TIP)
    assert (
        main(["run", str(tmp_path / "tip.toml"), "-o", str(tmp_path / "tip.vtkhdf"), "--json", str(tmp_path / "t")])
        == 0
    )
    (line,) = [line for line in capsys.readouterr().out.splitlines() if "equal force" in line]
    assert line.startswith("  contact 'tip' against theory at equal force: force +0.000%, radius ")
    summary = json.loads((tmp_path / "t").read_text())
    found = summary["theory"]["tip"]["equal_force"]
    low, high = (bound / found["radius"] - 1.0 for bound in summary["contact"]["tip"]["radius"])
    assert line.endswith(f"radius {low:+.2%} to {high:+.2%}")  # of the last closed and of the first open node
    assert found["pressure_max"] is found["deviation"]["pressure_max"] is None


def test_environment_is_shown(capsys):
    assert "numba" in output_of(capsys, ["env"])


@pytest.mark.slow
def test_kernels_are_compiled_on_request(capsys):
    assert output_of(capsys, ["env", "--warmup"]).splitlines()[-1].startswith("warm-up")


@pytest.mark.parametrize(
    ("helper", "end"),
    [
        ("print(0); raise SystemExit('no memory')", "with exit code 1 after starting 1 of {} kernels: no memory"),
        ("import os; os.kill(os.getpid(), 9)", "on SIGKILL after starting 0 of {} kernels: perhaps out of memory"),
    ],
)
def test_a_warm_up_tells_what_failed(helper, end, monkeypatch, capsys):
    def start(runs, helpers, output, errors):
        return [subprocess.Popen([sys.executable, "-S", "-c", helper], stdout=output, stderr=errors)]

    monkeypatch.setattr(ahead, "start", start)
    assert main(["env", "--warmup"]) == 1
    total = len(ahead.kernel_numbers(()))
    assert capsys.readouterr().err == f"error: a process that compiles kernels ended {end.format(total)}\n"


def test_a_kernel_that_cannot_be_compiled_is_told_by_the_helper(monkeypatch, capsys):
    monkeypatch.setattr(sys, "stdin", io.StringIO())
    monkeypatch.setattr(ahead, "kernel_numbers", lambda runs: [0])
    monkeypatch.setattr(ahead, "compile_kernel", lambda number: {}[number])
    assert ahead.main(["1", "0"]) == 1
    module, name, _ = ahead.table()["kernels"][0]
    assert capsys.readouterr().err == f"{module.rpartition('.')[2]}.{name}: KeyError: 0\n"


def test_all_names_are_offered():
    assert set(fc.__all__) <= set(dir(fc))


def test_import_is_light():
    heavy = ("matplotlib", "meshio", "pyamg", "h5py", "numba")
    code = f"import sys, fastcontact; print([m for m in {heavy} if m in sys.modules])"
    assert printed(code) == "[]\n"


def test_an_analysis_loads_what_it_needs_only():
    code = """
import sys, numpy as np, fastcontact as fc
cells = {"quad4": [[0, 1, 2, 3]], "line2": [[0, 1]]}
mesh = fc.Mesh(np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]]), cells, {"B": [0], "C": [1]}, {"T": [2, 3]})
model = fc.Model(mesh, "plane_strain")
model.add_material(fc.LinearElastic(1.0, 0.3))
model.prescribe("T", x=0.0, y=-0.01)
model.add_obstacle("c", secondary="C", obstacle=fc.obstacles.HalfSpace(point=(0.0, 0.0), normal=(0.0, 1.0)))
fc.solve(model)
unused = ("mesh.generate", "mesh.files.meshio_files", "mesh.files.mesh_fields", "analysis.friction", "cases", "studies",
          "analytic", "contact.found_contacts", "elasticity.dilatation_kernels")
print([name for name in unused if f"fastcontact.{name}" in sys.modules])
"""
    assert printed(code) == "[]\n"


def test_a_failure_without_history_shows_none():
    assert history_lines([]) == []


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (["profil", "x.vtkhdf"], "unknown command 'profil': did you mean 'profile'?"),
        (["run", "case.toml", "--resme"], "unknown option '--resme': did you mean '--resume'"),
        (["mesh", "box", "-o", "a.med", "--elment", "hex8"], "unknown option '--elment': did you mean '--element'"),
        (["plot", "a.vtkhdf", "--histroy"], "unknown option '--histroy': did you mean '--history'"),
        (["study", "forma04a"], "unknown command 'study': did you mean 'converge' or 'sweep'?"),
        (["forma04a.toml"], "to solve a file, write 'fastcontact run forma04a.toml'"),
        (["run", "case.toml", "--html", "a"], "unknown option '--html': expected one of --estimate-error, --help"),
        (["export", "a.vtkhdf", "a.rmed"], "unexpected argument 'a.rmed': write --med a.rmed; see"),
        (["run", "a.toml", "b.toml"], "unexpected argument 'b.toml'; see 'fastcontact run --help'"),
    ],
)
def test_commands_and_flags_that_are_misspelt(given, told, capsys):
    error = output_of(capsys, given, 1)
    assert told in error
    assert len(error.splitlines()) == 1
    assert "--help'" in error


def test_info_of_a_ready_made_case(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert "3168 tri3" in output_of(capsys, ["info", "forma04a"])
    assert "SPHBAS on SPHHAU" in output_of(capsys, ["info", "forma04a", "--contacts"])
    assert "did you mean 'forma04a'" in output_of(capsys, ["info", "forma4a"], 1)


def test_results_are_not_written_under_the_name_of_another_format(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert "name it a.vtkhdf" in output_of(capsys, ["run", "forma04-no-contact", "-o", "a.vtu"], 1)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("place", [["-q", "box"], ["box", "-q"], ["box", "--quiet"]])
def test_quiet_before_and_behind_the_name_of_a_generator(place, tmp_path, capsys):
    assert main(["mesh", *place, "-o", str(tmp_path / "a.vtu")]) == 0
    assert capsys.readouterr() == ("", "")
    assert (tmp_path / "a.vtu").exists()


def test_a_strict_run_tells_the_checks_that_fail(tmp_path, capsys):
    wrong = CASE.replace("tolerance = 0.2", "tolerance = 1e-9").replace("steps = 3", "steps = 1")
    (tmp_path / "case.toml").write_text(wrong)
    command = ["run", str(tmp_path / "case.toml"), "-o", str(tmp_path / "a.vtkhdf")]
    assert "NOT within 1e-09" in output_of(capsys, command)
    assert "1 of 1 checks of the case failed: pole" in output_of(capsys, [*command, "--strict", "-q"], 3)
    (tmp_path / "case.toml").write_text(CASE.replace("steps = 3", "steps = 1"))
    assert main([*command, "--strict", "-q"]) == 0


@pytest.mark.filterwarnings("ignore:contact 'ceiling' never closed")
def test_the_contact_that_was_taken_is_told_where_there_are_two(tmp_path, capsys):
    case = pressed_spheres(fc.generate.half_spheres(size=25.0))
    case.add_obstacle("ceiling", secondary="A2B2", obstacle=fc.obstacles.HalfSpace((0.0, 500.0), (0.0, -1.0)))
    path = tmp_path / "two.vtkhdf"
    with fc.ResultWriter(path, case) as out:
        fc.solve(case, 1, on_step=out.write)
    capsys.readouterr()
    hint = "contact 'hertz', the first of 2; others: 'ceiling'"
    assert main(["profile", str(path)]) == 0
    assert hint in capsys.readouterr().err
    assert main(["profile", str(path), "--contact", "hertz"]) == 0
    assert capsys.readouterr().err == ""
    assert main(["profile", str(path), "-q", "--csv", str(tmp_path / "a.csv")]) == 0
    assert capsys.readouterr().err == ""


def test_a_window_without_a_display_is_refused(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setitem(sys.modules, "pyvista", SimpleNamespace())  # it is asked for a window in no case
    case = fc.Model(fc.generate.half_spheres(size=25.0), kinematics="axisymmetric")
    with fc.ResultWriter(tmp_path / "a.vtkhdf", case) as out:
        case.add_material(fc.LinearElastic(E=20_000.0, nu=0.3))
        supported(case, A2B2={"y": -2.0}, A1B1={"y": 2.0})
        case.add_contact("hertz", secondary="CONT1", primary="CONT2")
        fc.solve(case, 1, on_step=out.write)
    assert main(["plot", str(tmp_path / "a.vtkhdf"), "--view"]) == 1
    assert "there is no display to open a window on" in capsys.readouterr().err


def test_the_command_by_itself_prints_its_help(capsys):
    with pytest.raises(SystemExit) as end:
        main([])
    assert end.value.code == 0
    assert capsys.readouterr().out.startswith("usage: fastcontact")
